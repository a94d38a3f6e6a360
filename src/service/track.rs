//! Poses that are given ahead of their time: the camera moves along them, and each frame shows where it is when the frame is expected to be finished.

use std::{
    collections::VecDeque,
    time::{Duration, SystemTime},
};

use crate::scene::Camera;

/// How far ahead of its time a pose may be.
const MOST_AHEAD: Duration = Duration::from_secs(10);
/// Poses that may wait: those of a thousand a second.
const MOST_POSES: usize = 10_000;

/// Why a pose is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum TrackError {
    /// It is earlier than the one before.
    #[error("time: it must be later than that of the pose before")]
    Order,
    /// It is too far ahead.
    #[error("time: at most 10 s ahead of the daemon's clock are allowed")]
    Ahead,
    /// There are too many.
    #[error("time: at most 10000 poses may wait")]
    Full,
}

#[derive(Clone, Copy, Debug)]
struct Timed {
    at: SystemTime,
    camera: Camera,
    received: SystemTime,
}

/// Poses in the order of their times. The first one may be past: the camera is on its way from there, or rests.
#[derive(Debug, Default)]
pub(super) struct Track {
    poses: VecDeque<Timed>,
    /// The first pose has been shown.
    reached: bool,
    /// The last time that was asked for.
    shown: Option<SystemTime>,
}

impl Track {
    /// The last pose.
    pub(super) fn last(&self) -> Option<Camera> {
        self.poses.back().map(|pose| pose.camera)
    }

    /// When the camera moves next, which is past where it does; `None`: it rests.
    pub(super) fn moves(&self) -> Option<SystemTime> {
        let moves = self.poses.len() > 1 || !self.reached;
        self.poses.front().map(|pose| pose.at).filter(|_| moves)
    }

    /// Forgets all poses.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Changes what all poses are.
    pub(super) fn change(&mut self, of: impl Fn(&Camera) -> Camera) {
        self.poses.iter_mut().for_each(|pose| pose.camera = of(&pose.camera));
    }

    /// Adds a pose for a time. After an error the track is as it was.
    pub(super) fn push(&mut self, at: SystemTime, camera: Camera, now: SystemTime) -> Result<(), TrackError> {
        if self.poses.back().is_some_and(|last| at <= last.at) {
            return Err(TrackError::Order);
        }
        if at.duration_since(now).is_ok_and(|ahead| ahead > MOST_AHEAD) {
            return Err(TrackError::Ahead);
        }
        if self.poses.len() >= MOST_POSES {
            return Err(TrackError::Full);
        }
        self.poses.push_back(Timed { at, camera, received: now });
        Ok(())
    }

    /// The camera at a time, and when the pose was received that it moves to; `None`: it is as it was. It never goes back:
    /// poses that are past are forgotten, but for the last one.
    pub(super) fn at(&mut self, time: SystemTime) -> Option<(Camera, SystemTime)> {
        if self.shown.is_some_and(|shown| time <= shown) {
            return None;
        }
        self.shown = Some(time);
        while self.poses.get(1).is_some_and(|next| next.at <= time) {
            self.poses.pop_front();
        }
        let from = self.poses.front().copied().filter(|from| from.at <= time)?;
        let Some(to) = self.poses.get(1) else {
            let rests = std::mem::replace(&mut self.reached, true);
            return (!rests).then_some((from.camera, from.received));
        };
        self.reached = false;
        let seconds = |later: SystemTime| later.duration_since(from.at).unwrap_or_default().as_secs_f64();
        let camera = between(&from.camera, &to.camera, seconds(time) / seconds(to.at));
        Some((camera, to.received))
    }
}

/// A camera between two: positions and velocities along a line, orientations along the great arc.
fn between(from: &Camera, to: &Camera, share: f64) -> Camera {
    Camera {
        position_m: from.position_m.lerp(to.position_m, share),
        world_from_camera: from.world_from_camera.slerp(to.world_from_camera, share).normalize(),
        velocity_c: from.velocity_c.lerp(to.velocity_c, share),
        ..*from
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn pose(x: f64, angle: f64) -> Camera {
        Camera {
            position_m: DVec3::new(x, 0.0, 0.0),
            world_from_camera: DQuat::from_rotation_y(angle),
            ..Camera::default()
        }
    }

    #[test]
    fn the_camera_is_between_the_poses_before_and_after_and_rests_at_the_last() {
        let start = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        let after = |ms: u64| start + Duration::from_millis(ms);
        let mut track = Track::default();
        // Poses at 30 Hz of a camera that moves and turns evenly, frames at another rate.
        for step in 0..30_u64 {
            let at = step as f64 / 30.0;
            track.push(start + Duration::from_secs_f64(0.1 + at), pose(1e9 * at, 0.7 * at), start).unwrap();
        }
        assert_eq!(track.moves(), Some(after(100)));
        assert_eq!(track.at(after(50)), None, "not yet");
        assert!(track.at(after(100)).is_some() && track.at(after(100)).is_none() && track.at(after(99)).is_none());
        for ms in (101..1066).step_by(7) {
            let (camera, received) = track.at(after(ms)).unwrap();
            let t = (ms as f64 - 100.0) * 1e-3;
            assert_eq!(received, start);
            assert!((camera.position_m.x - 1e9 * t).abs() < 1.0, "{ms}");
            assert!(camera.world_from_camera.angle_between(DQuat::from_rotation_y(0.7 * t)) < 1e-6, "{ms}");
        }
        let (last, _) = track.at(after(5000)).unwrap();
        let end = pose(1e9 * 29.0 / 30.0, 0.7 * 29.0 / 30.0);
        assert_eq!(last.position_m, end.position_m);
        assert!(last.world_from_camera.angle_between(end.world_from_camera) < 1e-7);
        assert_eq!((track.moves(), track.at(after(5001))), (None, None));
        // A pose that comes late goes on from there.
        track.push(after(6000), pose(2e9, 0.0), after(5500)).unwrap();
        assert!(track.moves().is_some_and(|moves| moves < after(5500)));
        let (camera, received) = track.at(after(5999)).unwrap();
        assert!((1.99e9..2e9).contains(&camera.position_m.x) && received == after(5500));
    }

    #[test]
    fn poses_out_of_order_too_far_ahead_and_too_many_are_refused() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        let mut track = Track::default();
        track.push(now, pose(0.0, 0.0), now).unwrap();
        assert_eq!(track.push(now, pose(1.0, 0.0), now), Err(TrackError::Order));
        assert_eq!(track.push(now + Duration::from_secs(11), pose(1.0, 0.0), now), Err(TrackError::Ahead));
        for step in 1..MOST_POSES as u64 {
            track.push(now + Duration::from_micros(step), pose(0.0, 0.0), now).unwrap();
        }
        assert_eq!(track.push(now + Duration::from_secs(1), pose(1.0, 0.0), now), Err(TrackError::Full));
        assert_eq!(track.last().unwrap(), pose(0.0, 0.0));
        track.clear();
        assert_eq!((track.moves(), track.last()), (None, None));
    }
}

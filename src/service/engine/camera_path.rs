//! Camera poses that clients send ahead of their time. The camera moves along them, and each frame shows the pose for
//! the time at which it is expected to be finished.

use std::{
    collections::VecDeque,
    time::{Duration, SystemTime},
};

use crate::scene::Camera;

/// Maximum time by which a pose may be ahead of the present.
const MOST_AHEAD: Duration = Duration::from_secs(10);
/// Maximum number of waiting poses: a thousand per second.
const MOST_POSES: usize = 10_000;

/// Reasons why a pose is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CameraPathError {
    /// It is earlier than the previous one.
    #[error("time: must be later than that of the previous pose")]
    Order,
    /// It is too far ahead.
    #[error("time: must be at most 10 s ahead of the daemon's clock")]
    Ahead,
    /// There are too many.
    #[error("time: there must be at most 10000 waiting poses")]
    Full,
}

#[derive(Clone, Copy, Debug)]
struct Timed {
    at: SystemTime,
    camera: Camera,
    received: SystemTime,
}

/// Poses in the order of their times. The first pose may be in the past: the camera moves away from it, or rests there.
#[derive(Debug, Default)]
pub(crate) struct CameraPath {
    poses: VecDeque<Timed>,
    /// Whether the camera has reached the first pose.
    reached: bool,
    /// Time of the last query.
    shown: Option<SystemTime>,
}

impl CameraPath {
    /// Returns the last pose.
    pub(crate) fn last(&self) -> Option<Camera> {
        self.poses.back().map(|pose| pose.camera)
    }

    /// Returns the time at which the camera moves next. The time is in the past if the camera is moving now; `None` if it rests.
    pub(crate) fn moves(&self) -> Option<SystemTime> {
        let moves = self.poses.len() > 1 || !self.reached;
        self.poses.front().map(|pose| pose.at).filter(|_| moves)
    }

    /// Removes all poses.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Changes all poses.
    pub(crate) fn change(&mut self, of: impl Fn(&Camera) -> Camera) {
        self.poses.iter_mut().for_each(|pose| pose.camera = of(&pose.camera));
    }

    /// Adds a pose for a time. On an error, the path stays unchanged.
    pub(crate) fn push(&mut self, at: SystemTime, camera: Camera, now: SystemTime) -> Result<(), CameraPathError> {
        if self.poses.back().is_some_and(|last| at <= last.at) {
            return Err(CameraPathError::Order);
        }
        if at.duration_since(now).is_ok_and(|ahead| ahead > MOST_AHEAD) {
            return Err(CameraPathError::Ahead);
        }
        if self.poses.len() >= MOST_POSES {
            return Err(CameraPathError::Full);
        }
        self.poses.push_back(Timed { at, camera, received: now });
        Ok(())
    }

    /// Returns the camera at a time, and the time at which the pose that it moves to was received; `None` if it has not moved. Time never goes back,
    /// so all past poses except the last are removed.
    pub(crate) fn advance(&mut self, time: SystemTime) -> Option<(Camera, SystemTime)> {
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

/// Interpolates between two cameras: positions and velocities linearly, orientations along the great arc.
fn between(from: &Camera, to: &Camera, share: f64) -> Camera {
    Camera {
        position_m: from.position_m.lerp(to.position_m, share),
        world_from_camera: from.world_from_camera.slerp(to.world_from_camera, share).normalize(),
        velocity_c: from.velocity_c.lerp(to.velocity_c, share),
        ..*from
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
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
    fn the_camera_moves_between_neighbouring_poses_and_rests_at_the_last() {
        let start = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        let after = |ms: u64| start + Duration::from_millis(ms);
        let mut path = CameraPath::default();
        // Poses at 30 Hz of a camera that moves and turns uniformly, and frames at another rate.
        for step in 0..30_u64 {
            let at = step as f64 / 30.0;
            path.push(start + Duration::from_secs_f64(0.1 + at), pose(1e9 * at, 0.7 * at), start).unwrap();
        }
        assert_eq!(path.moves(), Some(after(100)));
        assert_eq!(path.advance(after(50)), None, "the first pose is not due yet");
        assert!(
            path.advance(after(100)).is_some()
                && path.advance(after(100)).is_none()
                && path.advance(after(99)).is_none()
        );
        for ms in (101..1066).step_by(7) {
            let (camera, received) = path.advance(after(ms)).unwrap();
            let t = (ms as f64 - 100.0) * 1e-3;
            assert_eq!(received, start);
            assert!((camera.position_m.x - 1e9 * t).abs() < 1.0, "{ms}");
            assert!(camera.world_from_camera.angle_between(DQuat::from_rotation_y(0.7 * t)) < 1e-6, "{ms}");
        }
        let (last, _) = path.advance(after(5000)).unwrap();
        let end = pose(1e9 * 29.0 / 30.0, 0.7 * 29.0 / 30.0);
        assert_eq!(last.position_m, end.position_m);
        assert!(last.world_from_camera.angle_between(end.world_from_camera) < 1e-7);
        assert_eq!((path.moves(), path.advance(after(5001))), (None, None));
        // After a late pose, the camera moves on from its present place.
        path.push(after(6000), pose(2e9, 0.0), after(5500)).unwrap();
        assert!(path.moves().is_some_and(|moves| moves < after(5500)));
        let (camera, received) = path.advance(after(5999)).unwrap();
        assert!((1.99e9..2e9).contains(&camera.position_m.x) && received == after(5500));
    }

    #[test]
    fn poses_out_of_order_too_far_ahead_and_too_many_are_refused() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        let mut path = CameraPath::default();
        path.push(now, pose(0.0, 0.0), now).unwrap();
        assert_eq!(path.push(now, pose(1.0, 0.0), now), Err(CameraPathError::Order));
        assert_eq!(path.push(now + Duration::from_secs(11), pose(1.0, 0.0), now), Err(CameraPathError::Ahead));
        for step in 1..MOST_POSES as u64 {
            path.push(now + Duration::from_micros(step), pose(0.0, 0.0), now).unwrap();
        }
        assert_eq!(path.push(now + Duration::from_secs(1), pose(1.0, 0.0), now), Err(CameraPathError::Full));
        assert_eq!(path.last().unwrap(), pose(0.0, 0.0));
        path.clear();
        assert_eq!((path.moves(), path.last()), (None, None));
    }
}

//! A path made of what a daemon has shown: at the times of keyframes, from what was seen before and after them.
//!
//! What comes is a new value whenever something has changed. Between two values that follow each other within [`MOST_GAP_S`] a quantity was on its
//! way, and is interpolated; over longer gaps it has stood still, and has then jumped. Keyframes are made as values come, so that a recording takes
//! no more room than its path.

use glam::{DQuat, DVec3};

use super::frames::MOST_FRAMES;
use crate::config::{Easing, ExposureKey, FrameValues, Keyframe};
use crate::scene::Camera;

/// Between values further apart nothing has moved, s.
pub const MOST_GAP_S: f64 = 0.25;

/// The frames of keyframes: as evenly spaced as whole numbers of frames allow.
#[derive(Clone, Copy, Debug)]
struct Times {
    fps: f64,
    keyframes_per_second: f64,
}

impl Times {
    fn frame(self, keyframe: usize) -> u32 {
        (keyframe as f64 * self.fps / self.keyframes_per_second).round() as u32
    }

    fn seconds(self, keyframe: usize) -> f64 {
        f64::from(self.frame(keyframe)) / self.fps
    }
}

/// A quantity at the keyframes that were so far.
#[derive(Clone, Debug)]
struct Signal<T> {
    last: Option<(f64, T)>,
    at_keyframes: Vec<T>,
}

impl<T> Default for Signal<T> {
    fn default() -> Self {
        Self { last: None, at_keyframes: Vec::new() }
    }
}

impl<T: Copy + PartialEq> Signal<T> {
    /// Takes a value that was seen at a time.
    fn see(&mut self, at_s: f64, value: T, times: Times, between: impl Fn(T, T, f64) -> T) {
        while self.at_keyframes.len() < MOST_FRAMES as usize && times.seconds(self.at_keyframes.len()) <= at_s {
            let keyframe_s = times.seconds(self.at_keyframes.len());
            self.at_keyframes.push(match self.last {
                _ if keyframe_s == at_s => value,
                // Before the first value it was what it is then.
                None => value,
                Some((last_s, last)) if at_s - last_s <= MOST_GAP_S => {
                    between(last, value, ((keyframe_s - last_s) / (at_s - last_s)).clamp(0.0, 1.0))
                }
                Some((_, last)) => last,
            });
        }
        self.last = Some((at_s, value));
    }

    /// Holds the last value up to the end.
    fn end(&mut self, at_s: f64, times: Times) {
        if let Some((_, value)) = self.last {
            self.last = None;
            self.see(at_s, value, times, |_, value, _| value);
            if self.at_keyframes.is_empty() {
                self.at_keyframes.push(value);
            }
        }
    }

    /// The value where a keyframe has to name it: at the first one, and where it begins to change, changes, and ends to change.
    fn named(&self, keyframe: usize) -> Option<T> {
        let value = *self.at_keyframes.get(keyframe)?;
        let differs = |other: Option<&T>| other.is_some_and(|other| *other != value);
        let before = keyframe.checked_sub(1).and_then(|before| self.at_keyframes.get(before));
        (keyframe == 0 || differs(before) || differs(self.at_keyframes.get(keyframe + 1))).then_some(value)
    }

    fn changes(&self) -> bool {
        self.at_keyframes.windows(2).any(|pair| pair[0] != pair[1])
    }
}

fn mixed(from: f64, to: f64, share: f64) -> f64 {
    from + (to - from) * share
}

/// What a daemon shows, but for its camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenScene {
    /// The moment that is shown, s since 2000-01-01T12:00:00Z.
    pub time_s: f64,
    /// Faintest magnitude that is drawn.
    pub magnitude_limit: f64,
    /// Exposure of the view that is recorded.
    pub exposure: ExposureKey,
}

/// What was seen so far.
#[derive(Clone, Debug)]
pub struct Recording {
    times: Times,
    poses: Signal<(DVec3, DQuat)>,
    velocities_c: Signal<DVec3>,
    moments_s: Signal<f64>,
    limits: Signal<f64>,
    exposures: Signal<f64>,
    /// Whether exposures are exposure values, and not compensations; `None` before the first one.
    is_fixed: Option<bool>,
    /// Whether there were both.
    is_mixed: bool,
}

/// What has become of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPath {
    /// At least one, unless no camera was seen.
    pub keyframes: Vec<Keyframe>,
    /// The exposure has changed between manual and automatic, which a path cannot: it has none.
    pub left_exposure_out: bool,
}

impl Recording {
    /// A recording for a film of so many frames per second, with so many keyframes per second, which must not be more.
    pub fn new(fps: f64, keyframes_per_second: f64) -> Self {
        Self {
            times: Times { fps, keyframes_per_second },
            poses: Signal::default(),
            velocities_c: Signal::default(),
            moments_s: Signal::default(),
            limits: Signal::default(),
            exposures: Signal::default(),
            is_fixed: None,
            is_mixed: false,
        }
    }

    /// Time of the last frame that a film may have, s: a recording ends there.
    pub fn most_s(&self) -> f64 {
        f64::from(MOST_FRAMES - 1) / self.times.fps
    }

    /// Takes a camera that was seen so long after the start; times never fall.
    pub fn see_camera(&mut self, at_s: f64, camera: &Camera) {
        let pose = (camera.position_m, camera.world_from_camera);
        self.poses.see(at_s, pose, self.times, |from, to, share| {
            // The shorter way: a quaternion and its negative are one rotation.
            let turn = if from.1.dot(to.1) < 0.0 { -to.1 } else { to.1 };
            (from.0.lerp(to.0, share), from.1.slerp(turn, share).normalize())
        });
        self.velocities_c.see(at_s, camera.velocity_c, self.times, |from, to, share| from.lerp(to, share));
    }

    /// Takes what was seen of the scene so long after the start; times never fall.
    pub fn see_scene(&mut self, at_s: f64, scene: &SeenScene) {
        self.moments_s.see(at_s, scene.time_s, self.times, mixed);
        self.limits.see(at_s, scene.magnitude_limit, self.times, mixed);
        let (is_fixed, value) = match scene.exposure {
            ExposureKey::Ev100(value) => (true, value),
            ExposureKey::CompensationEv(value) => (false, value),
        };
        self.is_mixed |= *self.is_fixed.get_or_insert(is_fixed) != is_fixed;
        self.exposures.see(at_s, value, self.times, mixed);
    }

    /// The path up to a time after the start.
    pub fn end(mut self, at_s: f64) -> RecordedPath {
        let Self { times, .. } = self;
        self.poses.end(at_s, times);
        self.velocities_c.end(at_s, times);
        self.moments_s.end(at_s, times);
        self.limits.end(at_s, times);
        self.exposures.end(at_s, times);
        let left_exposure_out = self.is_mixed;
        let keeps_exposure = !left_exposure_out && self.exposures.changes();
        let keeps_velocity = self.velocities_c.at_keyframes.iter().any(|velocity_c| *velocity_c != DVec3::ZERO);
        let count = self.poses.at_keyframes.len();
        let values = |keyframe: usize| {
            let pose = self.poses.named(keyframe);
            let exposure = self.exposures.named(keyframe).filter(|_| keeps_exposure);
            FrameValues {
                position_m: pose.map(|(position_m, _)| position_m),
                frame_from_camera: pose.map(|(_, turn)| turn),
                time_s: self.moments_s.named(keyframe),
                fov: None,
                exposure: exposure.map(if self.is_fixed == Some(true) {
                    ExposureKey::Ev100
                } else {
                    ExposureKey::CompensationEv
                }),
                magnitude_limit: self.limits.named(keyframe),
                velocity_c: self.velocities_c.named(keyframe).filter(|_| keeps_velocity),
            }
        };
        let named = (0..count).map(|keyframe| (times.frame(keyframe), values(keyframe)));
        let named: Vec<(u32, FrameValues)> = named.filter(|(_, values)| *values != FrameValues::default()).collect();
        let last = named.len().saturating_sub(1);
        let keyframe = |(number, (frame, values)): (usize, (u32, FrameValues))| {
            // A smooth track comes to rest at its ends, and the camera has not: it was on its way when the recording began and ended.
            let easing = if number == 0 || number + 1 >= last { Easing::Linear } else { Easing::Smooth };
            Keyframe { frame, values, easing }
        };
        RecordedPath { keyframes: named.into_iter().enumerate().map(keyframe).collect(), left_exposure_out }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    fn camera(x_m: f64) -> Camera {
        Camera::new([x_m, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0], [0.0; 3]).unwrap()
    }

    const SCENE: SeenScene =
        SeenScene { time_s: 10.0, magnitude_limit: 9.0, exposure: ExposureKey::CompensationEv(0.0) };

    #[test]
    fn what_moves_is_interpolated_what_stands_is_named_once_and_what_jumps_jumps() {
        let mut recording = Recording::new(30.0, 10.0);
        recording.see_scene(0.0, &SCENE);
        for step in 0..=33 {
            let at_s = f64::from(step) * 0.03;
            recording.see_camera(at_s, &camera(at_s));
        }
        // Rests for three seconds, and is elsewhere then.
        recording.see_camera(4.0, &camera(70.0));
        recording.see_scene(2.0, &SeenScene { magnitude_limit: 7.0, ..SCENE });
        let path = recording.end(5.0);
        assert!(!path.left_exposure_out);
        let at = |frame: u32| path.keyframes.iter().find(|keyframe| keyframe.frame == frame).map(|key| &key.values);
        for frame in [0, 3, 15, 27] {
            let x_m = at(frame).unwrap().position_m.unwrap().x;
            assert!((x_m - f64::from(frame) / 30.0).abs() < 1e-12, "{frame}: {x_m}");
        }
        assert_eq!(at(60).map(|values| values.position_m), Some(None), "the limit alone has changed");
        assert_eq!(at(90), None, "nothing has changed");
        assert_eq!(at(117).unwrap().position_m.unwrap().x, 0.99);
        assert_eq!(at(120).unwrap().position_m.unwrap().x, 70.0);
        assert_eq!([57, 60].map(|frame| at(frame).unwrap().magnitude_limit.unwrap()), [9.0, 7.0]);
        assert_eq!((at(0).unwrap().time_s, at(0).unwrap().exposure), (Some(10.0), None));
        assert_eq!((path.keyframes[0].easing, path.keyframes[3].easing), (Easing::Linear, Easing::Smooth));
    }

    #[test]
    fn exposures_are_recorded_where_they_change_and_left_out_where_a_path_cannot_have_them() {
        let record = |exposures: [ExposureKey; 2]| {
            let mut recording = Recording::new(24.0, 24.0);
            recording.see_camera(0.0, &camera(0.0));
            for (at_s, exposure) in [0.0, 1.0].into_iter().zip(exposures) {
                recording.see_scene(at_s, &SeenScene { exposure, ..SCENE });
            }
            recording.end(2.0)
        };
        let changed = record([ExposureKey::Ev100(-3.0), ExposureKey::Ev100(-4.0)]);
        let at_24 = changed.keyframes.iter().find(|keyframe| keyframe.frame == 24).unwrap();
        assert_eq!(at_24.values.exposure, Some(ExposureKey::Ev100(-4.0)));
        let mixed = record([ExposureKey::Ev100(-3.0), ExposureKey::CompensationEv(1.0)]);
        assert!(mixed.left_exposure_out);
        assert!(mixed.keyframes.iter().all(|keyframe| keyframe.values.exposure.is_none()));
        assert_eq!(Recording::new(24.0, 24.0).end(1.0).keyframes, []);
    }
}

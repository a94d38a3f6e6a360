//! Makes a path from the observed camera and scene of a daemon, with evenly spaced keyframes that are interpolated
//! between observations.
//!
//! A new value is reported whenever something has changed. If two values follow each other within [`MOST_GAP_S`], the
//! quantity was moving and is interpolated; over a longer gap it was at rest and then jumped. Keyframes are made as
//! values arrive, so that a recording needs no more memory than its path.

use glam::{DQuat, DVec3};

use super::frames::MOST_FRAMES;
use crate::config::{Easing, ExposureKey, FrameValues, Keyframe};
use crate::scene::Camera;

/// Longest interval between two values of a moving quantity, s. If values are further apart, the quantity was at rest.
pub const MOST_GAP_S: f64 = 0.25;

/// Frame numbers of keyframes, as evenly spaced as whole numbers allow.
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

/// Values of a quantity at the keyframes so far.
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
    /// Records a value observed at a time.
    fn record(&mut self, at_s: f64, value: T, times: Times, between: impl Fn(T, T, f64) -> T) {
        while self.at_keyframes.len() < MOST_FRAMES as usize && times.seconds(self.at_keyframes.len()) <= at_s {
            let keyframe_s = times.seconds(self.at_keyframes.len());
            self.at_keyframes.push(match self.last {
                _ if keyframe_s == at_s => value,
                // Before the first observation of a quantity, its first observed value is used.
                None => value,
                Some((last_s, last)) if at_s - last_s <= MOST_GAP_S => {
                    between(last, value, ((keyframe_s - last_s) / (at_s - last_s)).clamp(0.0, 1.0))
                }
                Some((_, last)) => last,
            });
        }
        self.last = Some((at_s, value));
    }

    /// Fills the remaining keyframes, up to the end, with the last value.
    fn end(&mut self, at_s: f64, times: Times) {
        if let Some((_, value)) = self.last {
            self.last = None;
            self.record(at_s, value, times, |_, value, _| value);
            if self.at_keyframes.is_empty() {
                self.at_keyframes.push(value);
            }
        }
    }

    /// Returns the value if a keyframe must name it: at the first keyframe, and where a change begins, continues or
    /// ends.
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

/// State shown by a daemon, except for its camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedScene {
    /// Displayed moment, s since 2000-01-01T12:00:00Z.
    pub time_s: f64,
    /// Faintest drawn magnitude.
    pub magnitude_limit: f64,
    /// Exposure of the recorded view.
    pub exposure: ExposureKey,
}

/// Observations so far.
#[derive(Clone, Debug)]
pub struct Recording {
    times: Times,
    poses: Signal<(DVec3, DQuat)>,
    velocities_c: Signal<DVec3>,
    moments_s: Signal<f64>,
    limits: Signal<f64>,
    exposures: Signal<f64>,
    /// Whether exposures are exposure values rather than compensations; `None` before the first one.
    is_fixed: Option<bool>,
    /// Whether both kinds occurred.
    is_mixed: bool,
}

/// Result of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPath {
    /// The keyframes: at least one, unless no camera was observed.
    pub keyframes: Vec<Keyframe>,
    /// The exposure changed between manual and automatic, which a path cannot express, so the path has no exposure.
    pub exposure_omitted: bool,
}

impl Recording {
    /// Starts a recording for a film with these numbers of frames and of keyframes per second; the number of keyframes
    /// must not be larger.
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

    /// Time of the last possible frame of a film, s: a recording ends there.
    pub fn most_s(&self) -> f64 {
        f64::from(MOST_FRAMES - 1) / self.times.fps
    }

    /// Records a camera observed at a time after the start; times must not decrease.
    pub fn record_camera(&mut self, at_s: f64, camera: &Camera) {
        let pose = (camera.position_m, camera.world_from_camera);
        self.poses.record(at_s, pose, self.times, |from, to, share| {
            // Take the shorter way: a quaternion and its negative are the same rotation.
            let turn = if from.1.dot(to.1) < 0.0 { -to.1 } else { to.1 };
            (from.0.lerp(to.0, share), from.1.slerp(turn, share).normalize())
        });
        self.velocities_c.record(at_s, camera.velocity_c, self.times, |from, to, share| from.lerp(to, share));
    }

    /// Records a scene observed at a time after the start; times must not decrease.
    pub fn record_scene(&mut self, at_s: f64, scene: &ObservedScene) {
        self.moments_s.record(at_s, scene.time_s, self.times, mixed);
        self.limits.record(at_s, scene.magnitude_limit, self.times, mixed);
        let (is_fixed, value) = match scene.exposure {
            ExposureKey::Ev100(value) => (true, value),
            ExposureKey::CompensationEv(value) => (false, value),
        };
        self.is_mixed |= *self.is_fixed.get_or_insert(is_fixed) != is_fixed;
        self.exposures.record(at_s, value, self.times, mixed);
    }

    /// Ends the recording at a time after the start and returns its path.
    pub fn end(mut self, at_s: f64) -> RecordedPath {
        let Self { times, .. } = self;
        self.poses.end(at_s, times);
        self.velocities_c.end(at_s, times);
        self.moments_s.end(at_s, times);
        self.limits.end(at_s, times);
        self.exposures.end(at_s, times);
        let exposure_omitted = self.is_mixed;
        let keeps_exposure = !exposure_omitted && self.exposures.changes();
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
            // A smooth track comes to rest at its ends, but the camera may have been moving when the recording began
            // and ended.
            let easing = if number == 0 || number + 1 >= last { Easing::Linear } else { Easing::Smooth };
            Keyframe { frame, values, easing }
        };
        RecordedPath { keyframes: named.into_iter().enumerate().map(keyframe).collect(), exposure_omitted }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::*;

    fn camera(x_m: f64) -> Camera {
        Camera::new([x_m, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0], [0.0; 3]).unwrap()
    }

    const SCENE: ObservedScene =
        ObservedScene { time_s: 10.0, magnitude_limit: 9.0, exposure: ExposureKey::CompensationEv(0.0) };

    #[test]
    fn motion_is_interpolated_rest_is_named_once_and_jumps_stay_jumps() {
        let mut recording = Recording::new(30.0, 10.0);
        recording.record_scene(0.0, &SCENE);
        for step in 0..=33 {
            let at_s = f64::from(step) * 0.03;
            recording.record_camera(at_s, &camera(at_s));
        }
        // The camera rests for three seconds and then jumps.
        recording.record_camera(4.0, &camera(70.0));
        recording.record_scene(2.0, &ObservedScene { magnitude_limit: 7.0, ..SCENE });
        let path = recording.end(5.0);
        assert!(!path.exposure_omitted);
        let values_at =
            |frame: u32| path.keyframes.iter().find(|keyframe| keyframe.frame == frame).map(|key| &key.values);
        for frame in [0, 3, 15, 27] {
            let x_m = values_at(frame).unwrap().position_m.unwrap().x;
            assert!((x_m - f64::from(frame) / 30.0).abs() < 1e-12, "{frame}: {x_m}");
        }
        assert_eq!(values_at(60).map(|values| values.position_m), Some(None), "only the limit has changed");
        assert_eq!(values_at(90), None, "nothing has changed");
        assert_eq!(values_at(117).unwrap().position_m.unwrap().x, 0.99);
        assert_eq!(values_at(120).unwrap().position_m.unwrap().x, 70.0);
        assert_eq!([57, 60].map(|frame| values_at(frame).unwrap().magnitude_limit.unwrap()), [9.0, 7.0]);
        assert_eq!((values_at(0).unwrap().time_s, values_at(0).unwrap().exposure), (Some(10.0), None));
        assert_eq!((path.keyframes[0].easing, path.keyframes[3].easing), (Easing::Linear, Easing::Smooth));
    }

    #[test]
    fn exposure_changes_are_recorded_unless_a_path_cannot_express_them() {
        let record = |exposures: [ExposureKey; 2]| {
            let mut recording = Recording::new(24.0, 24.0);
            recording.record_camera(0.0, &camera(0.0));
            for (at_s, exposure) in [0.0, 1.0].into_iter().zip(exposures) {
                recording.record_scene(at_s, &ObservedScene { exposure, ..SCENE });
            }
            recording.end(2.0)
        };
        let changed = record([ExposureKey::Ev100(-3.0), ExposureKey::Ev100(-4.0)]);
        let at_24 = changed.keyframes.iter().find(|keyframe| keyframe.frame == 24).unwrap();
        assert_eq!(at_24.values.exposure, Some(ExposureKey::Ev100(-4.0)));
        let mixed = record([ExposureKey::Ev100(-3.0), ExposureKey::CompensationEv(1.0)]);
        assert!(mixed.exposure_omitted);
        assert!(mixed.keyframes.iter().all(|keyframe| keyframe.values.exposure.is_none()));
        assert_eq!(Recording::new(24.0, 24.0).end(1.0).keyframes, []);
    }
}

//! The clock of a scene. It runs or is stopped.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, SystemTime},
};

use glam::DQuat;

use super::{Camera, SceneSnapshot};
use crate::{
    calendar::{self, MOMENTS_S},
    observer::{Frame, Observer},
    scene::SceneObjects,
    units::EARTH_ROTATION_RAD_S,
};

/// Rotation of the sky from one step to the next, rad: 2 arcsec, which is less than a tenth of a pixel in any view.
const STEP_RAD: f64 = 1e-5;
/// Shortest and longest step, s.
const STEPS_S: [f64; 2] = [1.0 / 60.0, 1.0];

/// A moment that advances at a rate, in steps too short to be visible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneClock {
    /// The moment at `since`, s since 2000-01-01T12:00:00Z.
    pub time_s: f64,
    /// Seconds of the scene per second of real time; negative: backwards.
    pub rate: f64,
    /// Real time at which it was set. Callers must pass in real times that are never set back.
    pub since: SystemTime,
}

impl SceneClock {
    /// Largest rate in either direction: ten years per second.
    pub const MOST_RATE: f64 = 3.2e8;

    /// A fixed moment.
    pub fn stopped(time_s: f64) -> Self {
        Self { time_s, rate: 0.0, since: SystemTime::UNIX_EPOCH }
    }

    /// A moment that advances from now on.
    pub fn running(time_s: f64, rate: f64, now: SystemTime) -> Self {
        Self { time_s, rate, since: now }
    }

    /// The moment at a real time.
    pub fn time_s(&self, now: SystemTime) -> f64 {
        let [first, last] = MOMENTS_S;
        (self.time_s + self.rate * self.step(now) as f64 * self.step_s()).clamp(first, last)
    }

    /// Index of the step at a real time; frames of the same step show the same moment.
    pub fn step(&self, now: SystemTime) -> u64 {
        if self.rate == 0.0 {
            return 0;
        }
        // The clock does not advance before the time at which it was set.
        let gone = (now.duration_since(self.since).unwrap_or_default().as_secs_f64() / self.step_s()) as u64;
        gone.min(self.last_step())
    }

    /// Index of the step at which a running clock reaches the first or the last moment.
    fn last_step(&self) -> u64 {
        let [first, last] = MOMENTS_S;
        let left_s = if self.rate < 0.0 { self.time_s - first } else { last - self.time_s };
        (left_s / (self.rate.abs() * self.step_s())).ceil() as u64
    }

    /// The first or last moment in words, if the clock runs and has reached it.
    pub fn end(&self, now: SystemTime) -> Option<String> {
        let is_there = self.rate != 0.0 && self.step(now) == self.last_step();
        is_there.then(|| calendar::written(self.time_s(now)))
    }

    /// Time until the next step; `None` if the clock is stopped or has reached the first or the last moment.
    pub fn next_step(&self, now: SystemTime) -> Option<Duration> {
        let next_s = (self.step(now) + 1) as f64 * self.step_s();
        let gone = now.duration_since(self.since).unwrap_or_default();
        let runs = self.rate != 0.0 && self.step(now) < self.last_step();
        runs.then(|| Duration::from_secs_f64(next_s).saturating_sub(gone))
    }

    fn step_s(&self) -> f64 {
        let [shortest, longest] = STEPS_S;
        (STEP_RAD / (EARTH_ROTATION_RAD_S * self.rate.abs())).clamp(shortest, longest)
    }
}

/// Logs once that a running clock has reached the first or the last moment.
#[derive(Debug, Default)]
pub struct EndNotice {
    told: AtomicBool,
}

impl EndNotice {
    /// Checks a clock at a real time.
    pub fn look(&self, clock: &SceneClock, now: SystemTime) {
        let end = clock.end(now);
        let told = self.told.swap(end.is_some(), Ordering::Relaxed);
        if let Some(end) = end.filter(|_| !told) {
            tracing::warn!("the scene's time stops at {end}, where the range of its ephemerides ends");
        }
    }
}

impl Camera {
    /// The camera at another moment, s since 2000-01-01T12:00:00Z: it rotates with its frame of reference.
    #[must_use]
    pub fn carried(&self, objects: &SceneObjects, to_s: f64) -> Self {
        if !self.frame.turns() || self.as_of_s == to_s {
            return *self;
        }
        let axes = [self.as_of_s, to_s].map(|time_s| self.frame.icrs_from(objects.observer.as_ref(), time_s));
        let [Some(before), Some(after)] = axes.map(|axes| axes.map(|axes| DQuat::from_mat3(&axes))) else {
            return *self;
        };
        let turned = after * before.inverse() * self.world_from_camera;
        Self { world_from_camera: turned.normalize(), as_of_s: to_s, ..*self }
    }

    /// The camera after its observer has moved: a camera in the horizon frame keeps its azimuth and altitude.
    #[must_use]
    pub fn on_horizon_of(&self, before: Option<&Observer>, after: Option<&Observer>) -> Self {
        let (Some(before), Some(after)) = (before, after) else { return *self };
        if self.frame != Frame::Horizon || before == after {
            return *self;
        }
        let [before, after] = [before, after].map(|observer| observer.icrs_from_horizon(self.as_of_s));
        Self { world_from_camera: (after * before.inverse() * self.world_from_camera).normalize(), ..*self }
    }
}

impl SceneSnapshot {
    /// The scene at another moment, s since 2000-01-01T12:00:00Z: bodies with an ephemeris are moved, and a camera in a
    /// rotating frame is rotated. Stars are not changed ([`SeenStars`](super::SeenStars)).
    #[must_use]
    pub fn at(&self, time_s: f64) -> Self {
        if time_s == self.objects.time_s {
            return self.clone();
        }
        let camera = self.camera.carried(&self.objects, time_s);
        Self { objects: self.objects.at(time_s).into(), camera, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_advances_in_steps_forwards_and_backwards_or_stops() {
        let start = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        let after = |s: f64| start + Duration::from_secs_f64(s);
        let stopped = SceneClock::stopped(5.0);
        assert_eq!((stopped.time_s(after(1e6)), stopped.step(after(9.0)), stopped.next_step(start)), (5.0, 0, None));
        for rate in [1.0, -1.0, 60.0, 86_400.0, -3e6] {
            let clock = SceneClock::running(100.0, rate, start);
            for s in [0.0, 0.01, 0.5, 3.7, 1000.0] {
                let behind_s = (clock.time_s(after(s)) - 100.0 - rate * s) / -rate;
                assert!((-1e-9..STEPS_S[1]).contains(&behind_s), "{rate} {s} {behind_s}");
                let next = after(s) + clock.next_step(after(s)).expect("it runs") + Duration::from_micros(1);
                assert_eq!(clock.step(next), clock.step(after(s)) + 1, "{rate} {s}");
                let turns_rad = |step_s: f64| step_s * rate.abs() * EARTH_ROTATION_RAD_S;
                assert!(turns_rad(clock.step_s()) <= STEP_RAD.max(turns_rad(STEPS_S[0])) * (1.0 + 1e-12));
            }
            assert_eq!(clock.time_s(SystemTime::UNIX_EPOCH), 100.0, "before it was set");
        }
        let fast = SceneClock::running(0.0, SceneClock::MOST_RATE, start);
        assert_eq!(fast.time_s(after(1e6)), MOMENTS_S[1]);
        // Moments 14 s and 25 s from the limits, whose years are far outside 1 to 9999.
        for (time_s, rate, limit_s, end) in [
            (MOMENTS_S[0] + 14.0, -1.0, MOMENTS_S[0], "-6000-01-01T00:00:00Z"),
            (MOMENTS_S[1] - 25.0, 2.0, MOMENTS_S[1], "+10001-01-01T00:00:00Z"),
        ] {
            let clock = SceneClock::running(time_s, rate, start);
            assert_eq!((clock.end(after(11.0)), clock.next_step(after(11.0)).is_some()), (None, true));
            assert_eq!(clock.time_s(after(16.0)), limit_s);
            assert_eq!((clock.end(after(16.0)).as_deref(), clock.next_step(after(16.0))), (Some(end), None));
            assert_eq!(clock.step(after(16.0)), clock.step(after(1e5)));
            assert_eq!(SceneClock::stopped(limit_s).end(after(16.0)), None);
        }
        for first_year_s in [-63_082_281_600.0, 252_455_572_799.0] {
            assert_eq!(SceneClock::stopped(first_year_s).time_s(start), first_year_s);
        }
    }

    #[test]
    fn a_camera_rotates_only_with_rotating_frames() {
        let objects = SceneObjects::default();
        // Mars rotates by 14.62 degrees around its pole in one hour.
        let turned_deg = |frame: Frame, hours: f64| {
            let camera = Camera { frame, as_of_s: 8.2e8, ..Camera::default() };
            let carried = camera.carried(&objects, 8.2e8 + 3600.0 * hours);
            assert_eq!(carried.position_m, camera.position_m);
            camera.world_from_camera.angle_between(carried.world_from_camera).to_degrees()
        };
        assert!((turned_deg(Frame::Mars, 1.0) - 350.891_98 / 24.0).abs() < 1e-3, "{}", turned_deg(Frame::Mars, 1.0));
        assert!((turned_deg(Frame::Earth, 6.0) - 90.246).abs() < 2e-3, "{}", turned_deg(Frame::Earth, 6.0));
        for frame in [Frame::Icrs, Frame::Galactic, Frame::Ecliptic, Frame::Horizon] {
            assert_eq!(turned_deg(frame, 5.0), 0.0, "{frame:?}");
        }
    }
}

//! Tracks through keyframes: numbers and rotations as functions of the frame number.
//!
//! A segment is linear or smooth. Smooth segments are cubic Hermite splines whose tangents keep them monotone between
//! keyframes (F. N. Fritsch and J. Butland, "A method for constructing local monotone piecewise cubic interpolants",
//! SIAM J. Sci. Stat. Comput. 5, 1984), so that they do not overshoot a keyframe. At a keyframe between a linear and a
//! smooth segment, the smooth one adopts the rate of the linear one, within the limits of monotonicity. Values are held
//! before the first keyframe and after the last one, and a smooth track comes to rest there: its rate is continuous
//! everywhere.
//!
//! Rotations are cubic Bézier curves of great arcs (K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH
//! 1985). The same rule, applied to each component, gives their angular velocities at the keyframes: for rotations
//! about one axis the result is the spline of the angle.

use glam::{DQuat, DVec3};

use crate::config::Easing;

/// Position of a frame in a track.
enum Place {
    /// At a keyframe, or held at the first or last one.
    At(usize),
    /// Between a keyframe and the next one, at this share of the way in frames.
    Between(usize, f64),
}

/// Increasing frame numbers of the keyframes, and the easing of the segments that begin there.
#[derive(Clone, Debug)]
struct Knots {
    frames: Vec<f64>,
    easings: Vec<Easing>,
}

impl Knots {
    /// Splits a list of keyframes (frame, value, easing) into knots and values.
    fn from_keyframes<T>(keyframes: impl IntoIterator<Item = (u32, T, Easing)>) -> (Self, Vec<T>) {
        let mut knots = Self { frames: Vec::new(), easings: Vec::new() };
        let mut values = Vec::new();
        for (frame, value, easing) in keyframes {
            knots.frames.push(f64::from(frame));
            knots.easings.push(easing);
            values.push(value);
        }
        (knots, values)
    }

    fn place(&self, frame: f64) -> Place {
        let after = self.frames.partition_point(|knot| *knot <= frame);
        if after == 0 {
            return Place::At(0);
        }
        let before = after - 1;
        if after == self.frames.len() || self.frames[before] == frame {
            return Place::At(before);
        }
        Place::Between(before, (frame - self.frames[before]) / self.length(before))
    }

    fn length(&self, segment: usize) -> f64 {
        self.frames[segment + 1] - self.frames[segment]
    }

    /// Returns the rates at the keyframes, per frame, from the mean rates of the segments.
    fn rates<const N: usize>(&self, means: &[[f64; N]]) -> Vec<[f64; N]> {
        let rate = |knot: usize| {
            if knot == 0 || knot == means.len() {
                return [0.0; N];
            }
            let [(length_before, easing_before), (length_after, easing_after)] =
                [knot - 1, knot].map(|s| (self.length(s), self.easings[s]));
            std::array::from_fn(|c| {
                let (before, after) = (means[knot - 1][c], means[knot][c]);
                if before * after <= 0.0 {
                    return 0.0;
                }
                // A cubic is monotone if the rates at its ends are at most three times the mean rate.
                let limited = |rate: f64, mean: f64| rate.signum() * rate.abs().min(3.0 * mean.abs());
                match (easing_before, easing_after) {
                    (Easing::Linear, Easing::Smooth) => limited(before, after),
                    (Easing::Smooth, Easing::Linear) => limited(after, before),
                    _ => {
                        let weights = [2.0 * length_after + length_before, length_after + 2.0 * length_before];
                        (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after)
                    }
                }
            })
        };
        (0..=means.len()).map(rate).collect()
    }
}

/// A spline of `N` numbers.
#[derive(Clone, Debug)]
pub(super) struct Track<const N: usize> {
    knots: Knots,
    values: Vec<[f64; N]>,
    rates: Vec<[f64; N]>,
}

impl<const N: usize> Track<N> {
    /// Returns a track through keyframes (frame, value, easing); `None` if there are none.
    pub(super) fn new(keyframes: impl IntoIterator<Item = (u32, [f64; N], Easing)>) -> Option<Self> {
        let (knots, values) = Knots::from_keyframes(keyframes);
        let segments = values.len().checked_sub(1)?;
        let mean = |s: usize| std::array::from_fn(|c| (values[s + 1][c] - values[s][c]) / knots.length(s));
        let means: Vec<[f64; N]> = (0..segments).map(mean).collect();
        let rates = knots.rates(&means);
        Some(Self { knots, values, rates })
    }

    /// Returns the nearer keyframe and the offset from its value. The offset is 0 at the keyframe itself, so that
    /// values near it keep full precision.
    pub(super) fn offset(&self, frame: f64) -> (usize, [f64; N]) {
        let (before, share) = match self.knots.place(frame) {
            Place::At(knot) => return (knot, [0.0; N]),
            Place::Between(before, share) => (before, share),
        };
        let (length, from_end) = (self.knots.length(before), share > 0.5);
        let offset = |c: usize| {
            let whole = self.values[before + 1][c] - self.values[before][c];
            let (eased, bent) = match self.knots.easings[before] {
                Easing::Linear => (if from_end { 1.0 - share } else { share }, 0.0),
                Easing::Smooth => {
                    let left = 1.0 - share;
                    let step = |u: f64| u * u * (3.0 - 2.0 * u);
                    let [start, end] = [self.rates[before][c], self.rates[before + 1][c]];
                    // Terms of the cubic Hermite basis for the rates at both ends, without the part due to the mean
                    // rate, which `step` contains.
                    let bent = length * share * left * (start * left - end * share);
                    (step(if from_end { left } else { share }), bent)
                }
            };
            (if from_end { -whole * eased } else { whole * eased }) + bent
        };
        (before + usize::from(from_end), std::array::from_fn(offset))
    }

    /// Returns the value at a frame.
    pub(super) fn at(&self, frame: f64) -> [f64; N] {
        let (knot, offset) = self.offset(frame);
        std::array::from_fn(|c| self.values[knot][c] + offset[c])
    }
}

/// Returns the rotation for a rotation vector, rad.
fn rotation_from_vector(rotation: DVec3) -> DQuat {
    DQuat::from_scaled_axis(rotation)
}

/// Returns the shorter rotation between two rotations in the axes of the first, as a rotation vector, rad.
fn between(from: DQuat, to: DQuat) -> DVec3 {
    let turn = from.inverse() * to;
    (if turn.w < 0.0 { -turn } else { turn }).to_scaled_axis()
}

fn along(from: DQuat, to: DQuat, share: f64) -> DQuat {
    from * rotation_from_vector(between(from, to) * share)
}

/// A spline of rotations.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    knots: Knots,
    values: Vec<DQuat>,
    /// Rotation vectors of the segments, rad.
    turns: Vec<DVec3>,
    /// Angular velocities at the keyframes in the axes of the keyframe, rad per frame.
    rates: Vec<DVec3>,
}

impl Turns {
    /// Returns a track through keyframes (frame, unit quaternion, easing); `None` if there are none.
    pub(super) fn new(keyframes: impl IntoIterator<Item = (u32, DQuat, Easing)>) -> Option<Self> {
        let (knots, values) = Knots::from_keyframes(keyframes);
        let segments = values.len().checked_sub(1)?;
        let turns: Vec<DVec3> = (0..segments).map(|s| between(values[s], values[s + 1])).collect();
        // A rotation vector is the same in the axes of both ends of its segment.
        let means: Vec<[f64; 3]> = (0..segments).map(|s| (turns[s] / knots.length(s)).to_array()).collect();
        let rates = knots.rates(&means).into_iter().map(DVec3::from_array).collect();
        Some(Self { knots, values, turns, rates })
    }

    /// Returns the rotation at a frame.
    pub(super) fn at(&self, frame: f64) -> DQuat {
        let (before, share) = match self.knots.place(frame) {
            Place::At(knot) => return self.values[knot],
            Place::Between(before, share) => (before, share),
        };
        let [start, end] = [self.values[before], self.values[before + 1]];
        let turned = match self.knots.easings[before] {
            Easing::Linear => start * rotation_from_vector(self.turns[before] * share),
            Easing::Smooth => {
                let third = self.knots.length(before) / 3.0;
                let points = [
                    start,
                    start * rotation_from_vector(self.rates[before] * third),
                    end * rotation_from_vector(-self.rates[before + 1] * third),
                    end,
                ];
                let [a, b, c] = [0, 1, 2].map(|i| along(points[i], points[i + 1], share));
                along(along(a, b, share), along(b, c, share), share)
            }
        };
        turned.normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(keyframes: &[(u32, f64, Easing)]) -> Track<1> {
        Track::new(keyframes.iter().map(|&(frame, value, easing)| (frame, [value], easing))).unwrap()
    }

    const UNEVEN: [(u32, f64, Easing); 6] = [
        (0, 3.0, Easing::Smooth),
        (10, 3.0, Easing::Smooth),
        (25, -40.0, Easing::Linear),
        (30, -60.0, Easing::Smooth),
        (60, -61.0, Easing::Smooth),
        (64, 1e6, Easing::Smooth),
    ];

    #[test]
    fn values_are_exact_at_keyframes_held_outside_and_never_overshoot() {
        let track = track(&UNEVEN);
        for (frame, value, _) in UNEVEN {
            assert_eq!(track.at(f64::from(frame)), [value]);
        }
        assert_eq!((track.at(-5.0), track.at(1e9)), ([3.0], [1e6]));
        for pair in UNEVEN.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let mut last = from.1;
            for step in 1..=100 {
                let [value] = track.at(f64::from(from.0) + f64::from(to.0 - from.0) * f64::from(step) / 100.0);
                assert!((value - last) * (to.1 - from.1) >= 0.0, "{from:?} {to:?} step {step}: {last} {value}");
                last = value;
            }
        }
    }

    /// Largest jump of the rate at the keyframes, relative to the largest rate near them.
    fn jump_of_rate(value: impl Fn(f64) -> f64, frames: &[u32]) -> f64 {
        let step = 1e-4;
        let jump = |&frame: &u32| {
            let frame = f64::from(frame);
            let rate = |from: f64| (value(from + step) - value(from)) / step;
            (rate(frame) - rate(frame - step)).abs()
        };
        frames.iter().map(jump).fold(0.0, f64::max)
    }

    #[test]
    fn rates_of_smooth_tracks_are_continuous() {
        let smooth = track(&[
            (0, 0.0, Easing::Smooth),
            (10, 1.0, Easing::Smooth),
            (15, 4.0, Easing::Linear),
            (20, 9.0, Easing::Smooth),
            (30, 15.0, Easing::Smooth),
        ]);
        let jump = jump_of_rate(|frame| smooth.at(frame)[0], &[0, 10, 15, 20, 30]);
        assert!(jump < 1e-3, "{jump}");
        // Check that this measure detects a jump.
        let kinked = track(&[(0, 0.0, Easing::Linear), (10, 1.0, Easing::Linear), (15, 4.0, Easing::Linear)]);
        assert!(jump_of_rate(|frame| kinked.at(frame)[0], &[0, 10, 15]) > 0.4);
    }

    #[test]
    fn rotations_about_one_axis_match_the_spline_of_the_angle() {
        let axis = DVec3::new(0.6, 0.0, 0.8);
        let angles = [(0, 0.1), (10, 1.0), (15, 2.6), (40, 2.6), (50, 0.4)];
        for easing in [Easing::Smooth, Easing::Linear] {
            let turns = Turns::new(angles.map(|(frame, angle)| (frame, DQuat::from_axis_angle(axis, angle), easing)));
            let numbers = track(&angles.map(|(frame, angle)| (frame, angle, easing)));
            for tenth in -10..520 {
                let frame = f64::from(tenth) / 10.0;
                let found = turns.as_ref().unwrap().at(frame);
                let expected = DQuat::from_axis_angle(axis, numbers.at(frame)[0]);
                assert!(found.angle_between(expected) < 1e-7, "{easing:?} {frame}: {found} {expected}");
            }
        }
    }

    #[test]
    fn linear_rotations_have_constant_rate_and_smooth_ones_continuous_rate() {
        let keys = [
            (0, DQuat::IDENTITY),
            (12, DQuat::from_rotation_y(1.2)),
            (20, DQuat::from_rotation_x(2.0)),
            // The negative quaternion represents the same rotation.
            (32, -DQuat::from_rotation_z(0.4)),
        ];
        let turns = |easing| Turns::new(keys.map(|(frame, turn)| (frame, turn, easing))).unwrap();
        let linear = turns(Easing::Linear);
        let step = |frame: f64| linear.at(frame).angle_between(linear.at(frame + 0.5));
        for frame in [12.0, 12.5, 15.0, 19.5] {
            assert!((step(frame) / step(14.0) - 1.0).abs() < 1e-9, "{frame}");
        }
        let smooth = turns(Easing::Smooth);
        for (frame, turn) in keys {
            assert_eq!(smooth.at(f64::from(frame)), turn);
        }
        let jump = |turns: &Turns, frame: f64| {
            let rate = |from: f64| between(turns.at(from), turns.at(from + 1e-4)) / 1e-4;
            (rate(frame) - rate(frame - 1e-4)).length()
        };
        for (frame, _) in keys {
            assert!(jump(&smooth, f64::from(frame)) < 1e-3, "{frame}: {}", jump(&smooth, f64::from(frame)));
        }
        assert!(jump(&linear, 12.0) > 0.1);
    }
}

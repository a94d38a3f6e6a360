//! Distributions of delays, given by quantiles.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A distribution through given quantiles. Between them the logarithm of the value is linear in -ln(1 - q); above the last one it is constant.
#[derive(Clone, Debug)]
pub struct Quantiles(Vec<(f64, f64)>);

impl Quantiles {
    /// Points (-ln(1 - q), value in ns), ascending, from q = 0 on.
    pub fn new(points: &[(f64, f64)]) -> Self {
        Self(points.iter().map(|&(q, value_ns)| (-(1.0 - q).ln(), value_ns.max(1.0))).collect())
    }

    pub fn uniform_ms(low: f64, high: f64) -> Self {
        Self::new(&[
            (0.0, low * 1e6),
            (0.5, (low + high) * 0.5e6),
            (0.9, (0.1 * low + 0.9 * high) * 1e6),
            (0.999, high * 1e6),
        ])
    }

    /// Delay of one message, from figures of the time until *all* of six nodes are READY (ms: median, 99 %, maximum of 3,600 frames). A single node
    /// exceeds a time with a sixth of that probability, and each of its two messages with half of that.
    pub fn of_all_ready_ms([median, p99, maximum]: [f64; 3]) -> Self {
        let point = |all, ms: f64| (Self::of_one_message(all), (ms - median * 0.5) * 1e6);
        let tail = [point(0.99, p99), point(1.0 - 1.0 / 3600.0, maximum)];
        Self::new(&[(0.0, median * 0.25e6), (0.85, median * 0.5e6), tail[0], tail[1]])
    }

    /// Time for which a process waits for a busy processor: the difference between the figures of a busy processor and those of an idle one.
    pub fn of_stalls_ms([_, p99, maximum]: [f64; 3], [_, idle_p99, idle_maximum]: [f64; 3]) -> Self {
        let point = |all, ms: f64| (Self::of_one_message(all), ms * 1e6);
        let tail = [point(0.99, p99 - idle_p99), point(1.0 - 1.0 / 3600.0, maximum - idle_maximum)];
        Self::new(&[(0.0, 1.0), (0.85, 2e4), tail[0], tail[1]])
    }

    /// Returns the quantile of a single message that corresponds to a quantile of the slowest of six pairs of messages.
    fn of_one_message(all: f64) -> f64 {
        1.0 - (1.0 - all.powf(1.0 / 6.0)) / 2.0
    }

    pub fn value_ns(&self, q: f64) -> u64 {
        let x = -(1.0 - q).ln();
        let above = self.0.partition_point(|point| point.0 <= x);
        let Some(&(right_x, right)) = self.0.get(above) else {
            return self.0.last().map_or(0, |point| point.1 as u64);
        };
        let (left_x, left) = self.0[above.saturating_sub(1)];
        let share = if right_x > left_x { (x - left_x) / (right_x - left_x) } else { 0.0 };
        (left.ln() + share * (right.ln() - left.ln())).exp() as u64
    }

    pub fn draw_ns(&self, random: &mut ChaCha8Rng) -> u64 {
        self.value_ns(random.random::<f64>())
    }
}

/// Value at a quantile of measured values, by the nearest rank; 0 without values.
pub fn quantile(values: &mut [u64], q: f64) -> u64 {
    values.sort_unstable();
    let rank = (q * values.len() as f64).ceil() as usize;
    values.get(rank.clamp(1, values.len().max(1)) - 1).copied().unwrap_or(0)
}

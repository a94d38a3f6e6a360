//! Smooth noise on a lattice in space: the same at every call.

/// Standard deviation of the noise: sqrt(1/12) for the lattice values times (26/35)^(3/2), because the cubic blend of
/// two values leaves 26/35 of the variance per axis on average.
pub const LATTICE_NOISE_DEVIATION: f64 = 0.1848;

/// Smooth noise of mean 0: random values in -0.5..0.5 on the integer lattice, blended with a cubic ease.
#[inline]
pub fn lattice_noise(x: f64, y: f64, z: f64, seed: u64) -> f64 {
    let (ix, fx) = split(x);
    let (iy, fy) = split(y);
    let (iz, fz) = split(z);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy: u64, dz: u64| {
        let value = |dx: u64| lattice_value(ix.wrapping_add(dx), iy.wrapping_add(dy), iz.wrapping_add(dz), seed);
        mix(value(0), value(1), fx)
    };
    mix(mix(row(0, 0), row(1, 0), fy), mix(row(0, 1), row(1, 1), fy), fz)
}

/// Lattice index (wrapped to unsigned) and eased position between it and the next.
#[inline]
fn split(x: f64) -> (u64, f64) {
    let floor = x.floor();
    let t = x - floor;
    (floor as i64 as u64, t * t * (3.0 - 2.0 * t))
}

/// Random value in -0.5..0.5 of a lattice point: odd multipliers per axis, then the finaliser of SplitMix64.
#[inline]
fn lattice_value(ix: u64, iy: u64, iz: u64, seed: u64) -> f64 {
    let mut h = seed
        ^ ix.wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ iy.wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ iz.wrapping_mul(0x1656_67b1_9e37_79f9);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^= h >> 31;
    (h >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic scattered positions: multiples of irrational steps.
    fn places() -> impl Iterator<Item = (f64, f64, f64)> {
        (0..100_000).map(|i| {
            let i = f64::from(i);
            ((i * 0.754_877_67).fract(), (i * 0.569_840_29).fract(), (i * 0.324_717_96).fract())
        })
    }

    #[test]
    fn noise_has_the_stated_deviation() {
        let values: Vec<f64> =
            places().map(|(x, y, z)| lattice_noise(400.0 * x, 400.0 * y - 200.0, 400.0 * z, 7)).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 0.005, "mean {mean}");
        assert!((deviation / LATTICE_NOISE_DEVIATION - 1.0).abs() < 0.05, "deviation {deviation}");
    }

    #[test]
    fn noise_is_continuous_across_lattice_planes() {
        for x in [-3.0, 0.0, 5.0] {
            let step = lattice_noise(x + 1e-9, 0.3, 0.4, 1) - lattice_noise(x - 1e-9, 0.3, 0.4, 1);
            assert!(step.abs() < 1e-6, "{step}");
        }
    }
}

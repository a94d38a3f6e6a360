//! The corona of the Sun: light of the photosphere scattered by electrons and dust, with its mean brightness at
//! eclipses (S. Baumbach, Astronomische Nachrichten 263, 121, 1937; C. W. Allen, "Astrophysical Quantities", 3rd
//! edition, section 84), the same in all directions. It has 1.1e-6 of the Sun's light, half that of the full Moon,
//! and is visible when a moon or the ground hides the Sun.

/// Terms of the corona's luminance: the value at the limb relative to the mean of the disc, and the exponent of the
/// decrease with distance. The first term is for dust, the other two are for electrons.
pub const TERMS: [[f64; 2]; 3] = [[5.32e-8, 2.5], [1.425e-6, 7.0], [2.565e-6, 17.0]];
/// Distance from which it fades out, radii of the Sun.
pub const FADES: f64 = 4.0;
/// Distance at which it ends, radii of the Sun.
pub const OUTER: f64 = 24.0;

/// Luminance relative to the mean of the disc, at a distance from the Sun's centre in radii; 0 on the disc.
pub fn over_disc(distance: f64) -> f64 {
    if !(1.0..OUTER).contains(&distance) {
        return 0.0;
    }
    let t = ((distance - FADES) / (OUTER - FADES)).clamp(0.0, 1.0);
    let window = 1.0 - t * t * (3.0 - 2.0 * t);
    window * TERMS.iter().map(|[part, power]| part * distance.powf(-power)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corona_has_half_the_light_of_the_full_moon() {
        // In units of the disc's light: 2 r dr over rings.
        let steps = 230_000;
        let step = (OUTER - 1.0) / f64::from(steps);
        let ring = |i: i32| {
            let r = 1.0 + (f64::from(i) + 0.5) * step;
            2.0 * r * over_disc(r) * step
        };
        let share: f64 = (0..steps).map(ring).sum();
        let magnitude = -26.74 - 2.5 * share.log10();
        println!("{share:.3e} of the Sun's light, V = {magnitude:.2}");
        // If the corona had no end, it would have 1.125e-6 of the Sun's light. The full Moon has V = -12.7.
        assert!((share - 1.065e-6).abs() < 0.003e-6, "{share}");
        assert!((-12.1..-11.7).contains(&magnitude));
        assert_eq!([0.99, OUTER, 50.0].map(over_disc), [0.0; 3]);
        assert!((over_disc(1.0) - 4.043e-6).abs() < 1e-9);
    }
}

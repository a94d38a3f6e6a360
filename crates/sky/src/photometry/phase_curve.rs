//! Measured brightness of the planets and the Moon as a function of phase: A. Mallama and J. L. Hilton, "Computing
//! apparent planetary magnitudes for The Astronomical Almanac", Astronomy and Computing 25, 10, 2018; the Moon by C. W.
//! Allen, "Astrophysical Quantities", 3rd edition, section 66, with the opposition surge of K. Krisciunas and B. E.
//! Schaefer, Publications of the Astronomical Society of the Pacific 103, 1033, 1991; the moons of Jupiter and Saturn
//! by the Explanatory Supplement to the Astronomical Almanac, 3rd edition, 10.5.
//!
//! A curve gives V(1, a): the V magnitude at one astronomical unit from the Sun and from the eye, at the phase angle
//! a. A surface is shaded by its reflection law. Its light is multiplied by one factor, which depends on the phase
//! angle at which it is seen. The factor gives the body the brightness of its curve and keeps the shading of the law.

use super::{reflection::ReflectionLaw, rings};
use crate::{
    polynomial::polynomial,
    solar_system::SolarBody,
    units::{ASTRONOMICAL_UNIT_M, JULIAN_YEAR_S},
};

/// V magnitude of the Sun at one astronomical unit: absolute magnitude 4.83, as in the preset.
const SUN_V: f64 = -26.742;
/// First and last year of the change of Neptune's brightness, and its amount, magnitudes.
const NEPTUNE_YEARS: [f64; 2] = [1980.0, 2000.0];
const NEPTUNE_MAG: f64 = 0.11;
/// Largest phase angles at which the Earth sees Uranus and Neptune, degrees. Up to them the curves have no phase term.
const MOST_URANUS_PHASE_DEG: f64 = 3.1;
const MOST_NEPTUNE_PHASE_DEG: f64 = 1.9;
/// Largest opening of Saturn's rings, degrees, and largest phase angle at which the Earth sees them.
const MOST_RINGS_DEG: f64 = 27.0;
const MOST_RING_PHASE_DEG: f64 = 6.5;

/// Largest phase angle to which the curve of a body is known, degrees; 0 for the Sun, which has none.
pub fn known_to_deg(body: SolarBody) -> f64 {
    match body {
        SolarBody::Sun => 0.0,
        SolarBody::Venus => 179.0,
        SolarBody::Mercury | SolarBody::Earth => 170.0,
        SolarBody::Uranus => 154.0,
        SolarBody::Moon | SolarBody::Saturn | SolarBody::Mars => 150.0,
        SolarBody::Neptune => 133.0,
        SolarBody::Jupiter => 130.0,
        SolarBody::Io | SolarBody::Europa | SolarBody::Ganymede | SolarBody::Callisto => 12.0,
        SolarBody::Titan => 6.5,
    }
}

/// V(1, a) of a body at a phase angle, degrees; beyond the known range, the value at its limit. `None` for the Sun.
///
/// Mars and the moons of Jupiter: the mean over their rotation; Mars also over its year. Saturn: the globe without
/// rings. Uranus: seen from above its equator. Neptune: its brightness since 2000, see [`fainter_in`].
pub fn magnitude(body: SolarBody, phase_deg: f64) -> Option<f64> {
    let a = phase_deg.clamp(0.0, known_to_deg(body));
    let magnitude = match body {
        SolarBody::Sun => return None,
        SolarBody::Mercury => {
            polynomial(&[-0.613, 6.328e-2, -1.6336e-3, 3.3644e-5, -3.4265e-7, 1.6893e-9, -3.0334e-12], a)
        }
        SolarBody::Venus if a <= 163.7 => polynomial(&[-4.384, -1.044e-3, 3.687e-4, -2.814e-6, 8.938e-9], a),
        SolarBody::Venus => polynomial(&[236.058_28, -2.819_14, 8.390_34e-3], a),
        SolarBody::Earth => polynomial(&[-3.99, -1.060e-3, 2.054e-4], a),
        // -12.73 at 384,400 km; at full phase it is a third brighter than the linear law.
        SolarBody::Moon => {
            let surge = if a < 7.0 { -2.5 * (1.35 - 0.05 * a).log10() } else { 0.0 };
            let at_one = -12.73 + 5.0 * (ASTRONOMICAL_UNIT_M / 3.844e8).log10();
            at_one + 0.026 * a + 4e-9 * a.powi(4) + surge
        }
        SolarBody::Mars if a <= 50.0 => polynomial(&[-1.601, 2.267e-2, -1.302e-4], a),
        SolarBody::Mars => polynomial(&[-0.367, -2.573e-2, 3.445e-4], a),
        SolarBody::Jupiter if a <= 12.0 => polynomial(&[-9.395, -3.7e-4, 6.16e-4], a),
        SolarBody::Jupiter => {
            let share = polynomial(&[1.0, -1.507, -0.363, -0.062, 2.809, -1.876], a / 180.0);
            -9.428 - 2.5 * share.log10()
        }
        SolarBody::Saturn if a <= 6.5 => polynomial(&[-8.95, -3.7e-4, 6.16e-4], a),
        SolarBody::Saturn => polynomial(&[-8.94, 2.446e-4, 2.672e-4, -1.505e-6, 4.767e-9], a),
        SolarBody::Uranus if a <= MOST_URANUS_PHASE_DEG => -7.110,
        SolarBody::Uranus => polynomial(&[-7.110, 6.587e-3, 1.045e-4], a),
        SolarBody::Neptune if a <= MOST_NEPTUNE_PHASE_DEG => -7.00,
        SolarBody::Neptune => polynomial(&[-7.00, 7.944e-3, 9.617e-5], a),
        SolarBody::Io => polynomial(&[-1.68, 4.6e-2, -1.0e-3], a),
        SolarBody::Europa => polynomial(&[-1.41, 3.12e-2, -1.25e-3], a),
        SolarBody::Ganymede => polynomial(&[-2.09, 3.23e-2, -6.6e-4], a),
        SolarBody::Callisto => polynomial(&[-1.05, 7.8e-2, -2.74e-3], a),
        SolarBody::Titan => -1.28,
    };
    Some(magnitude)
}

/// Magnitudes by which a body was fainter in a year than its [`magnitude`]: Neptune had V(1, 0) = -6.89 until 1980, and
/// became brighter at a constant rate until 2000.
pub fn fainter_in(body: SolarBody, year: f64) -> f64 {
    let [first, last] = NEPTUNE_YEARS;
    match body {
        SolarBody::Neptune => NEPTUNE_MAG * ((last - year) / (last - first)).clamp(0.0, 1.0),
        _ => 0.0,
    }
}

/// The year of a moment, s since J2000.0, or the nearest year that has the same brightness of all bodies. It is
/// constant when no brightness changes.
pub fn year_of_brightness(time_s: f64) -> f64 {
    let [first, last] = NEPTUNE_YEARS;
    (2000.0 + time_s / JULIAN_YEAR_S).clamp(first, last)
}

/// Latitudes of the eye and of the Sun above a body's equator, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    /// Latitude of the eye.
    pub eye_rad: f64,
    /// Latitude of the Sun.
    pub sun_rad: f64,
}

/// Correction to [`magnitude`] for the orientation of a body's pole: Saturn's rings, and the brighter poles of
/// Uranus.
fn tilted(body: SolarBody, phase_deg: f64, tilt: Tilt) -> f64 {
    let Tilt { eye_rad, sun_rad } = tilt;
    match body {
        SolarBody::Saturn => {
            // If the Sun and the eye are on different sides, the visible side of the rings is not lit. Openings and
            // phases are limited to those seen from the Earth.
            let open_rad = (eye_rad * sun_rad).max(0.0).sqrt().min(MOST_RINGS_DEG.to_radians());
            let (sine, a) = (open_rad.sin(), phase_deg.min(MOST_RING_PHASE_DEG));
            let with_rings = -8.914 - 1.825 * sine + 0.026 * a - 0.378 * sine * (-2.25 * a).exp();
            let globe = polynomial(&[-8.95, -3.7e-4, 6.16e-4], a);
            (with_rings - globe).min(0.0)
        }
        SolarBody::Uranus => -8.4e-4 * 0.5 * (eye_rad.abs() + sun_rad.abs()).to_degrees(),
        _ => 0.0,
    }
}

/// Light of the rings relative to the globe, per unit of [`rings::illuminance_of_unit`]: 0.516 at tilts of 20 degrees
/// and a phase of 6.
const RINGS_OF_UNIT: f64 = 1.87;

/// Share of the rings in Saturn's light at a phase angle. In the measured curve the rings have no light at tilts
/// below 1 to 6 degrees, where its phase terms exceed the light of the rings. There the share is the reflection of
/// the zones by the law of [`rings`], scaled to the brightness measured at a tilt of 20 degrees.
pub fn ring_share(phase_rad: f64, tilt: Tilt) -> f64 {
    let measured = 1.0 - 10_f64.powf(0.4 * tilted(SolarBody::Saturn, phase_rad.to_degrees(), tilt));
    if tilt.eye_rad * tilt.sun_rad <= 0.0 {
        return measured;
    }
    let [mu_eye, mu_sun] = [tilt.eye_rad, tilt.sun_rad].map(|angle| angle.sin().abs());
    let of_globe = rings::illuminance_of_unit(mu_eye, mu_sun, 1.0).map_or(0.0, |unit| RINGS_OF_UNIT * unit);
    measured.max(of_globe / (1.0 + of_globe))
}

/// Factor that brings the light of a sphere of `radius_m`, with a reflection law and the luminance of its geometric
/// albedo, to that of the body's curve in a year; 1 for the Sun. Saturn's globe gets the light of the rings too. Beyond
/// the known range of the curve the factor is that at its limit. It reaches 25,000 for Venus, whose thin crescent is far brighter
/// than a surface's, because its air scatters forwards.
pub fn factor(
    body: SolarBody,
    law: ReflectionLaw,
    geometric_albedo: f64,
    radius_m: f64,
    phase_rad: f64,
    tilt: Tilt,
    year: f64,
) -> f64 {
    let phase_rad = phase_rad.min(known_to_deg(body).to_radians());
    let phase_deg = phase_rad.to_degrees();
    let Some(magnitude) = magnitude(body, phase_deg) else { return 1.0 };
    let of_law = geometric_albedo * (radius_m / ASTRONOMICAL_UNIT_M).powi(2) * law.phase_function(phase_rad);
    let measured = magnitude + tilted(body, phase_deg, tilt) + fainter_in(body, year);
    let of_curve = 10_f64.powf(-0.4 * (measured - SUN_V));
    of_curve / of_law
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;

    #[test]
    fn the_sun_has_no_phases() {
        assert_eq!(magnitude(SolarBody::Sun, 10.0), None);
        assert_eq!(factor(SolarBody::Sun, ReflectionLaw::Lambert, 0.3, 1e6, 1.0, Tilt::default(), 2000.0), 1.0);
    }

    #[test]
    fn light_matches_the_curve_at_every_phase() {
        for body in SolarBody::ALL.into_iter().filter(|body| *body != SolarBody::Sun) {
            let (albedo, radius_m) = (0.3, 6e6);
            for phase_deg in (0..=179).map(f64::from) {
                if phase_deg > known_to_deg(body) {
                    continue;
                }
                let phase_rad = f64::to_radians(phase_deg);
                for law in ReflectionLaw::ALL {
                    let of_law = albedo * (radius_m / ASTRONOMICAL_UNIT_M).powi(2) * law.phase_function(phase_rad);
                    let factor = factor(body, law, albedo, radius_m, phase_rad, Tilt::default(), 2000.0);
                    let magnitude = SUN_V - 2.5 * (of_law * factor).log10();
                    assert!(
                        (magnitude - super::magnitude(body, phase_rad.to_degrees()).unwrap()).abs() < 1e-9,
                        "{body:?} {phase_deg}"
                    );
                }
            }
            assert!(
                factor(body, ReflectionLaw::Lambert, albedo, radius_m, std::f64::consts::PI, Tilt::default(), 2000.0)
                    .is_finite()
            );
        }
    }

    #[test]
    fn neptune_became_brighter_from_1980_to_2000() {
        // Mallama and Hilton 2018, equation 16.
        for (year, published) in
            [(-6000.0, -6.89), (1846.7, -6.89), (1980.0, -6.89), (1990.0, -6.945), (2000.0, -7.0), (2026.9, -7.0)]
        {
            let found = magnitude(SolarBody::Neptune, 1.0).unwrap() + fainter_in(SolarBody::Neptune, year);
            assert!((found - published).abs() < 1e-9, "{year}: {found}");
            let light = |year: f64| {
                let (law, phase_rad) = (ReflectionLaw::Lambert, f64::to_radians(1.0));
                factor(SolarBody::Neptune, law, 0.4, 2.4e7, phase_rad, Tilt::default(), year)
            };
            let fainter = -2.5 * (light(year) / light(2026.0)).log10();
            assert!((fainter - (published + 7.0)).abs() < 1e-9, "{year}: {fainter}");
            assert_eq!(fainter_in(SolarBody::Uranus, year), 0.0);
            // The nearest year with the same brightness.
            let same = year_of_brightness((year - 2000.0) * JULIAN_YEAR_S);
            let change = fainter_in(SolarBody::Neptune, same) - fainter_in(SolarBody::Neptune, year);
            assert!(change.abs() < 1e-9, "{year}: {same}");
        }
        assert_eq!(year_of_brightness(8.2e8), year_of_brightness(9.2e8));
    }

    #[test]
    fn uranus_and_neptune_have_no_phase_term_as_seen_from_the_earth() {
        // Mallama and Hilton 2018, equations 14 to 17.
        for (body, phase_deg, published) in [
            (SolarBody::Uranus, 0.0, -7.11),
            (SolarBody::Uranus, 3.1, -7.11),
            (SolarBody::Uranus, 10.0, -7.11 + 6.587e-2 + 1.045e-2),
            (SolarBody::Neptune, 0.0, -7.0),
            (SolarBody::Neptune, 1.9, -7.0),
            (SolarBody::Neptune, 10.0, -7.0 + 7.944e-2 + 9.617e-3),
        ] {
            let found = magnitude(body, phase_deg).unwrap();
            assert!((found - published).abs() < 1e-9, "{body:?} {phase_deg}: {found}");
        }
    }

    #[test]
    fn rings_have_light_at_every_tilt_on_the_side_of_the_sun() {
        let share = |eye_deg: f64, sun_deg: f64, phase_deg: f64| {
            let tilt = Tilt { eye_rad: eye_deg.to_radians(), sun_rad: sun_deg.to_radians() };
            ring_share(phase_deg.to_radians(), tilt)
        };
        // Measured: 0.452 magnitudes at a tilt of 20 degrees and a phase of 6.
        assert!(
            (share(20.0, 20.0, 6.0) - (1.0 - 10_f64.powf(-0.4 * 0.4521))).abs() < 3e-3,
            "{}",
            share(20.0, 20.0, 6.0)
        );
        // Autumn 2025.
        let thin = share(-1.8, -2.0, 3.0);
        assert!((0.03..0.08).contains(&thin), "{thin}");
        assert_eq!(share(0.5, -0.5, 3.0), 0.0);
        let mut last = 0.0;
        for step in 1..270 {
            let next = share(f64::from(step) * 0.1, f64::from(step) * 0.1, 4.0);
            assert!(next > last && next - last < 0.01, "{step}: {last} {next}");
            last = next;
        }
    }

    #[test]
    fn pieces_of_curves_are_continuous() {
        for (body, border_deg) in [
            (SolarBody::Venus, 163.7),
            (SolarBody::Mars, 50.0),
            (SolarBody::Jupiter, 12.0),
            (SolarBody::Saturn, 6.5),
            (SolarBody::Moon, 7.0),
            (SolarBody::Uranus, 3.1),
            (SolarBody::Neptune, 1.9),
        ] {
            let [before, after] = [-1e-6, 1e-6].map(|by| magnitude(body, border_deg + by).unwrap());
            assert!((before - after).abs() < 0.05, "{body:?} {before} {after}");
        }
    }
}

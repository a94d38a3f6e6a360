//! Bodies of the Solar System by name: sizes, albedos, spins. Positions and pole directions come from the scene.
//!
//! Radii: Archinal et al. 2018, "Report of the IAU Working Group on Cartographic Coordinates and Rotational Elements:
//! 2015"; the Sun's is the nominal one of IAU 2015 resolution B3. Geometric albedos in V and sidereal periods: NASA
//! planetary fact sheets. The tints are mild colours chosen by eye; their luminance is 1, so that the luminance of the
//! albedo is the albedo in V. Laws: Lommel-Seeliger for bare rock and dust, Lambert for clouds. The Sun: absolute
//! magnitude 4.83, 5772 K, linear limb darkening 0.6 (of visible light; Cox, Allen's Astrophysical Quantities, 4th
//! edition, 14.7).

use glam::{DQuat, DVec3};

use super::{Body, Emission, ReflectionLaw, Spin, Surface};
use crate::{
    photometry::rec709::luminance,
    solar_system::SolarBody,
    units::{DAY_S, SOLAR_TEMPERATURE_K},
};

/// A row of the table: radius at the equator and at the pole, km; geometric albedo; tint; period, s; law.
type Line = (f64, f64, f64, [f64; 3], f64, ReflectionLaw);

/// Absolute V magnitude of the Sun.
pub const SUN_ABSOLUTE_MAGNITUDE: f64 = 4.83;
/// Linear limb darkening of the Sun.
pub const SUN_LIMB_DARKENING: f64 = 0.6;

fn line(body: SolarBody) -> Line {
    use ReflectionLaw::{Lambert, LommelSeeliger};
    match body {
        SolarBody::Sun => (695_700.0, 695_700.0, 0.0, [1.0; 3], 25.38 * DAY_S, Lambert),
        SolarBody::Mercury => (2440.53, 2438.26, 0.142, [1.12, 0.98, 0.85], 58.6462 * DAY_S, LommelSeeliger),
        SolarBody::Venus => (6051.8, 6051.8, 0.689, [1.06, 1.0, 0.84], -243.018 * DAY_S, Lambert),
        SolarBody::Earth => (6378.1366, 6356.7519, 0.434, [0.9, 1.0, 1.22], 86_164.1, Lambert),
        SolarBody::Moon => (1737.4, 1737.4, 0.12, [1.07, 0.99, 0.9], 27.321_661 * DAY_S, LommelSeeliger),
        SolarBody::Mars => (3396.19, 3376.2, 0.17, [1.55, 0.88, 0.55], 88_642.66, LommelSeeliger),
        SolarBody::Jupiter => (71_492.0, 66_854.0, 0.538, [1.08, 0.99, 0.86], 35_729.7, Lambert),
        SolarBody::Saturn => (60_268.0, 54_364.0, 0.499, [1.14, 0.99, 0.7], 38_362.4, Lambert),
        SolarBody::Uranus => (25_559.0, 24_973.0, 0.488, [0.74, 1.06, 1.15], -62_064.0, Lambert),
        SolarBody::Neptune => (24_764.0, 24_341.0, 0.442, [0.66, 1.06, 1.35], 57_996.0, Lambert),
        SolarBody::Io => (1821.49, 1821.49, 0.63, [1.25, 1.0, 0.5], 1.769_137_8 * DAY_S, LommelSeeliger),
        SolarBody::Europa => (1560.8, 1560.8, 0.67, [1.05, 1.0, 0.88], 3.551_181 * DAY_S, LommelSeeliger),
        SolarBody::Ganymede => (2631.2, 2631.2, 0.43, [1.05, 1.0, 0.9], 7.154_553 * DAY_S, LommelSeeliger),
        SolarBody::Callisto => (2410.3, 2410.3, 0.17, [1.07, 0.99, 0.87], 16.689_02 * DAY_S, LommelSeeliger),
        SolarBody::Titan => (2575.15, 2574.47, 0.22, [1.3, 0.98, 0.4], 15.945_42 * DAY_S, Lambert),
    }
}

/// Geometric albedo, and mean radius, m, for which the measured brightness holds.
pub(super) fn measured(body: SolarBody) -> (f64, f64) {
    let (equator_km, pole_km, albedo, ..) = line(body);
    (albedo, (equator_km * equator_km * pole_km).cbrt() * 1e3)
}

impl Body {
    /// Returns a body of the Solar System with its size, surface and spin. Its axes are parallel to those of the world.
    pub fn preset(of: SolarBody, name: &str, position_m: DVec3) -> Self {
        let (equator_km, pole_km, albedo, tint, period_s, law) = line(of);
        let normalised_tint = tint.map(|channel| channel / luminance(tint));
        let emission = (of == SolarBody::Sun).then(|| {
            let temperature_k = f64::from(SOLAR_TEMPERATURE_K);
            let darkening = SUN_LIMB_DARKENING;
            let emission = Emission::of_star(SUN_ABSOLUTE_MAGNITUDE, temperature_k, equator_km * 1e3, darkening);
            Emission { corona: true, ..emission }
        });
        Self {
            name: name.to_owned(),
            ephemeris: None,
            position_m,
            radii_m: DVec3::new(equator_km, equator_km, pole_km) * 1e3,
            orientation: DQuat::IDENTITY,
            spin: Spin { period_s: Some(period_s), phase_rad: 0.0 },
            surface: Surface {
                law,
                geometric_albedo: normalised_tint.map(|channel| channel * albedo),
                phase_curve: (of != SolarBody::Sun).then_some(of),
                texture: None,
            },
            emission,
            seen_through: [1.0; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotation angle after a time, s.
    fn turn_rad(body: SolarBody, time_s: f64) -> f64 {
        time_s / line(body).4 * std::f64::consts::TAU
    }

    #[test]
    fn all_presets_are_valid_and_only_the_sun_shines() {
        for preset in SolarBody::ALL {
            let body = Body::preset(preset, preset.name(), DVec3::X);
            body.check().unwrap();
            assert_eq!(body.emission.is_some(), preset == SolarBody::Sun);
            let (_, _, albedo, ..) = line(preset);
            assert!((luminance(body.surface.geometric_albedo) - albedo).abs() < 1e-12);
        }
    }

    #[test]
    fn bodies_rotate_with_their_periods_and_some_are_retrograde() {
        for preset in SolarBody::ALL {
            let body = Body::preset(preset, "x", DVec3::ZERO);
            let turned = body.world_from_body(1000.0) * DVec3::X;
            let expected = turn_rad(preset, 1000.0);
            assert!((turned - DVec3::new(expected.cos(), expected.sin(), 0.0)).length() < 1e-12, "{preset:?}");
        }
        assert!(turn_rad(SolarBody::Venus, 1.0) < 0.0 && turn_rad(SolarBody::Earth, 1.0) > 0.0);
    }
}

//! The air above an observer: extinction of the light that passes through it, and the light that it scatters.
//!
//! **Extinction** in magnitudes per air mass is the sum of molecules (inverse fourth power of the wavelength),
//! aerosol (power -1.3) and ozone, after B. E. Schaefer, "Astronomy and the limits of vision", Vistas in Astronomy
//! 36, 311 (1993); air masses after G. V. Rozenberg, "Twilight" (1966), 40 at the horizon. In clear air
//! ([`clear_extinction_mag`]) the part of the molecules is proportional to the pressure at the observer.
//!
//! **The sky's light** is that of [`super::sky_light`] for the same extinction. A factor that depends on the altitude
//! of the source ([`measured_over_model`]) gives the zenith its measured brightness in twilight (F. Patat, O. S.
//! Ugolnikov and O. V. Postylyakov, A&A 455, 385, 2006; below 14 degrees B. E. Schaefer, "To the visual limits", Sky
//! and Telescope 95, 57, 1998); it is 1 by day. The light of the night sky is added: its
//! level is given for the zenith, and [`SkyLight::night_at`] is its distribution.
//!
//! Units: rad, m, hPa, magnitudes, cd/m^2, lx.

use std::sync::Arc;

use super::{
    rec709::luminance,
    sky_light::{AEROSOL_KM, Depths, MOLECULES_KM, SkyLight, ozone_share_above},
};
use crate::units::{KELVIN_OF_ZERO_CELSIUS, luminance_from_mag_per_arcsec2};

/// Dominant wavelengths of the primaries of Rec. 709, um.
const PRIMARIES_UM: [f64; 3] = [0.6114, 0.5491, 0.4642];
/// Wavelength of the V band, um.
const V_UM: f64 = 0.55;
/// Extinction by molecules at sea level, V magnitudes per air mass.
const MOLECULES_MAG: f64 = 0.1066;
/// Extinction by aerosol in clear air at sea level, V magnitudes per air mass: the sum of all parts is 0.2.
const AEROSOL_MAG: f64 = 0.0624;
/// Extinction by ozone: the value in V is Schaefer's, the primaries follow from the cross sections of the Chappuis
/// band (Gorshelev et al. 2014: 4.6, 3.3 and 0.3e-21 cm^2 at 611, 550 and 464 nm).
const OZONE_V_MAG: f64 = 0.031;
const OZONE_MAG: [f64; 3] = [0.043, 0.031, 0.003];
/// Exponent of the wavelength in the extinction by aerosol.
const AEROSOL_POWER: f64 = -1.3;

/// Pressure of the standard atmosphere (ISO 2533) at sea level, hPa, and its temperature there, K.
const SEA_HPA: f64 = 1013.25;
const SEA_K: f64 = KELVIN_OF_ZERO_CELSIUS + 15.0;
/// Layers of the standard atmosphere: height of the base, m, and rise of the temperature with height, K/m.
const STANDARD_LAYERS: [[f64; 2]; 5] =
    [[0.0, -6.5e-3], [11_000.0, 0.0], [20_000.0, 1e-3], [32_000.0, 2.8e-3], [47_000.0, 0.0]];
/// Weight of a mole of air divided by the gas constant, K/m.
const KELVIN_PER_M: f64 = 0.034_163_2;
/// Lowest height, m; lower heights have the air of this one.
const LOWEST_M: f64 = -1000.0;

/// 10^(-0.4 m) = 2^(-LOG2_PER_MAG m).
const LOG2_PER_MAG: f64 = 0.4 * std::f64::consts::LOG2_10;

/// An optical depth of 1, in magnitudes.
const MAG_PER_DEPTH: f64 = 1.085_736;

/// Measured luminance of the zenith in twilight relative to the model: altitude of the source in degrees, and logarithm
/// of the ratio.
const TWILIGHT: [[f64; 2]; 9] = [
    [-18.0, 0.64],
    [-16.0, 0.74],
    [-14.0, 0.94],
    [-12.0, 0.67],
    [-10.0, 0.36],
    [-8.0, 0.10],
    [-6.0, -0.11],
    [-5.0, -0.08],
    [0.0, 0.0],
];

/// Correction factors for the model's light from a source at an altitude, rad: one for light scattered once, and one
/// for light scattered more than once. If the model is too bright, both reduce the light. In deep twilight the model is
/// too dark, because it lacks light that was scattered many times. The arch above the source is lit directly, so that
/// its light is not changed.
pub fn measured_over_model(source_rad: f64) -> [f64; 2] {
    let altitude = source_rad.to_degrees();
    let [first, last] = [TWILIGHT[0], TWILIGHT[TWILIGHT.len() - 1]];
    let between = TWILIGHT.windows(2).find(|ends| (ends[0][0]..ends[1][0]).contains(&altitude)).map(|ends| {
        let part = (altitude - ends[0][0]) / (ends[1][0] - ends[0][0]);
        ends[0][1] + part * (ends[1][1] - ends[0][1])
    });
    let factor = 10f64.powf(between.unwrap_or(if altitude < first[0] { first[1] } else { last[1] }));
    [factor.min(1.0), factor]
}

/// Air mass at an altitude, given by its sine; below the horizon, that of the horizon.
pub fn air_mass(sine: f64) -> f64 {
    let sine = sine.max(0.0);
    1.0 / (sine + 0.025 * (-11.0 * sine).exp())
}

/// Pressure, hPa, and temperature, degrees Celsius, of the standard atmosphere (ISO 2533) at a height above the sea, m,
/// up to 50 km. The height is taken as geopotential: at 50 km the pressure is 5 % too low.
pub fn standard_air(height_m: f64) -> (f64, f64) {
    let height_m = height_m.max(LOWEST_M);
    let (mut pressure_hpa, mut kelvin) = (SEA_HPA, SEA_K);
    for (index, [base_m, gradient]) in STANDARD_LAYERS.into_iter().enumerate() {
        let top_m = STANDARD_LAYERS.get(index + 1).map_or(f64::INFINITY, |[top_m, _]| *top_m);
        let rise_m = height_m.min(top_m) - base_m;
        // Below the sea, the lowest layer continues.
        if index > 0 && rise_m <= 0.0 {
            break;
        }
        let at_end = kelvin + gradient * rise_m;
        pressure_hpa *= if gradient == 0.0 {
            (-KELVIN_PER_M * rise_m / kelvin).exp()
        } else {
            (at_end / kelvin).powf(-KELVIN_PER_M / gradient)
        };
        kelvin = at_end;
    }
    (pressure_hpa, kelvin - KELVIN_OF_ZERO_CELSIUS)
}

/// Pressure at a height above the sea, m, relative to that at sea level; 1 below the sea.
fn pressure_share(height_m: f64) -> f64 {
    standard_air(height_m.max(0.0)).0 / SEA_HPA
}

/// Extinction of clear air at a height above the sea, m, V magnitudes per air mass: 0.2 at sea level and below it. It
/// decreases continuously with height, to 8e-5 at 50 km.
pub fn clear_extinction_mag(height_m: f64) -> f64 {
    let height_km = height_m.max(0.0) / 1e3;
    MOLECULES_MAG * pressure_share(height_m)
        + OZONE_V_MAG * ozone_share_above(height_km)
        + AEROSOL_MAG * (-height_km / AEROSOL_KM).exp()
}

/// Optical properties of the air, by channel of linear Rec. 709.
#[derive(Clone, Debug, PartialEq)]
pub struct Air {
    /// Extinction, magnitudes per air mass.
    pub extinction_mag: [f64; 3],
    /// Luminance of the airglow in the zenith, cd/m^2.
    pub glow_cd_m2: [f64; 3],
    /// Scattered light.
    pub scattered: Arc<SkyLight>,
}

impl Air {
    /// Air with an extinction of `extinction_mag` in V per air mass, at a height above the sea, m, with an airglow of
    /// luminance `glow_cd_m2` in the zenith. The computation takes a tenth of a second.
    pub fn new(extinction_mag: f64, height_m: f64, glow_cd_m2: [f64; 3]) -> Self {
        let height_km = (height_m / 1e3).max(0.0);
        let pressure = pressure_share(height_m);
        let molecules_v = MOLECULES_MAG * pressure;
        let ozone_above = ozone_share_above(height_km);
        // Below the extinction of air without aerosol, molecules and ozone are reduced too.
        let clean_v = molecules_v + OZONE_V_MAG * ozone_above;
        let clean = (extinction_mag / clean_v).min(1.0);
        let aerosol_v = (extinction_mag - clean_v).max(0.0);
        let ratios = PRIMARIES_UM.map(|wavelength| wavelength / V_UM);
        let molecules = ratios.map(|ratio| clean * molecules_v * ratio.powi(-4));
        let aerosol = ratios.map(|ratio| aerosol_v * ratio.powf(AEROSOL_POWER));
        let ozone = OZONE_MAG.map(|mag| clean * mag);
        let depth = |mag: [f64; 3]| mag.map(|mag| mag / MAG_PER_DEPTH);
        let depths = Depths {
            molecules: depth(molecules),
            aerosol: depth(aerosol),
            ozone: depth(ozone),
            height_km,
            // Close to sea level, the air below the observer does not matter. At sea level, the quotient is not
            // defined.
            molecules_below_km: if height_km > 0.01 { -height_km / pressure.ln() } else { MOLECULES_KM },
            // If the haze at the observer is denser than in clear air at sea level, it has the same density below.
            most_haze_below: (AEROSOL_MAG / aerosol_v).max(1.0),
        };
        Self {
            extinction_mag: [0, 1, 2].map(|c| molecules[c] + aerosol[c] + ozone_above * ozone[c]),
            glow_cd_m2,
            scattered: Arc::new(SkyLight::new(depths)),
        }
    }

    /// Base-2 logarithm of the transmission per air mass; negative.
    pub fn extinction_log2(&self) -> [f64; 3] {
        self.extinction_mag.map(|mag| -LOG2_PER_MAG * mag)
    }

    /// Transmission of light from outside at an altitude, given by its sine.
    pub fn transmission(&self, sine: f64) -> [f64; 3] {
        let air_mass = air_mass(sine);
        self.extinction_log2().map(|log2| (log2 * air_mass).exp2())
    }

    /// Light of the night sky at an altitude, rad, cd/m^2: airglow and light from space, direct and scattered.
    pub fn glow(&self, altitude_rad: f64) -> [f64; 3] {
        let relative = self.scattered.night_at(altitude_rad);
        [0, 1, 2].map(|c| self.glow_cd_m2[c] * relative[c])
    }
}

/// Display level of the mean of a picture, as a share of white. It falls with the luminance, because a night must look
/// dark. Source: G. Krawczyk, K. Myszkowski and H.-P. Seidel, "Perceptual effects in real-time tone mapping", SCCG 2005: 0.03 at
/// night, 0.1 at 0.4 cd/m^2, 0.65 by day.
pub fn key_of(mean_cd_m2: f64) -> f64 {
    1.03 - 2.0 / (2.0 + (mean_cd_m2 + 1.0).log10())
}

/// Luminance of glow of a surface brightness in magnitudes per square arcsecond, with a colour of luminance 1,
/// cd/m^2.
pub fn glow_of(mag_per_arcsec2: f64, colour: [f64; 3]) -> [f64; 3] {
    let cd_m2 = luminance_from_mag_per_arcsec2(mag_per_arcsec2);
    colour.map(|channel| cd_m2 * channel / luminance(colour))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{photometry::blackbody::rec709_in_gamut, units::illuminance_lx_from_magnitude};

    fn air() -> Air {
        Air::new(0.2, 0.0, glow_of(22.0, [1.0; 3]))
    }

    fn sun_lx() -> [f64; 3] {
        rec709_in_gamut(5772.0).map(|channel| channel * illuminance_lx_from_magnitude(-26.74))
    }

    fn zenith_cd_m2(air: &Air, sun_deg: f64) -> f64 {
        let altitude = f64::to_radians(sun_deg);
        let table = air.scattered.table(altitude);
        let seen = table.luminance(std::f64::consts::FRAC_PI_2, 0.0, altitude.sin());
        let sun = sun_lx();
        luminance([0, 1, 2].map(|c| seen[c] * sun[c])) + luminance(air.glow(std::f64::consts::FRAC_PI_2))
    }

    #[test]
    fn extinction_matches_the_v_band_and_is_larger_in_blue() {
        for (mag, height_m) in [(0.2, 0.0), (0.13, 2635.0), (0.4, 0.0), (0.05, 0.0)] {
            let [red, green, blue] = Air::new(mag, height_m, [0.0; 3]).extinction_mag;
            assert!((green / mag - 1.0).abs() < 0.01, "{green} {mag}");
            assert!(red < green && blue > 1.3 * green, "{red} {green} {blue}");
        }
        assert!((air_mass(1.0) - 1.0).abs() < 1e-6 && (air_mass(0.5) - 2.0).abs() < 1e-2);
        assert_eq!(air_mass(0.0), 40.0);
    }

    #[test]
    fn the_zenith_has_the_published_luminance_by_night_in_twilight_and_by_day() {
        // Patat et al.: V in the zenith of Paranal, 11.84 + 1.518 z - 0.057 z^2 mag per square arcsecond, z degrees
        // of depression beyond 5; night 21.6. Day: M. Karayel, M. Navvab, E. Ne'eman and S. Selkowitz, Energy and
        // Buildings 6, 1984: (1.376 T - 1.81) tan h + 0.38 kcd/m^2, 1.3 at 30 degrees for a turbidity T of 2.5.
        let of_mag = luminance_from_mag_per_arcsec2;
        let patat = |depression_deg: f64| {
            let beyond = depression_deg - 5.0;
            of_mag(11.84 + 1.518 * beyond - 0.057 * beyond * beyond)
        };
        let day = (1.376 * 2.5 - 1.81) * f64::to_radians(30.0).tan() * 1e3 + 380.0;
        let twilight = [-12.0, -10.0, -8.0, -7.0, -6.0].map(|sun_deg: f64| (sun_deg, patat(-sun_deg)));
        for (sun_deg, published) in [(-18.0, of_mag(21.6)), (30.0, day)].into_iter().chain(twilight) {
            let found = zenith_cd_m2(&air(), sun_deg);
            println!(
                "Sun {sun_deg}: zenith {found:.3e} cd/m^2, published {published:.3e}, ratio {:.2}",
                found / published
            );
            assert!((1.0 / 1.5..1.5).contains(&(found / published)), "{sun_deg}: {found} {published}");
        }
        // An error of one degree in the Sun's altitude must fail.
        assert!(!(1.0 / 1.5..1.5).contains(&(zenith_cd_m2(&air(), -5.0) / patat(6.0))));
    }

    #[test]
    fn the_standard_atmosphere_has_its_published_pressure_and_temperature() {
        // ISO 2533, geopotential heights, m: hPa and degrees Celsius.
        for (height_m, hpa, celsius) in [
            (-1000.0, 1139.29, 21.5),
            (0.0, 1013.25, 15.0),
            (5000.0, 540.2, -17.5),
            (11_000.0, 226.32, -56.5),
            (20_000.0, 54.749, -56.5),
            (32_000.0, 8.6802, -44.5),
            (47_000.0, 1.1091, -2.5),
            (50_000.0, 0.7594, -2.5),
        ] {
            let (pressure_hpa, temperature_c) = standard_air(height_m);
            assert!((pressure_hpa / hpa - 1.0).abs() < 2.4e-4, "{height_m}: {pressure_hpa}");
            assert!((temperature_c - celsius).abs() < 1e-9, "{height_m}: {temperature_c}");
        }
        assert_eq!(standard_air(-12_000.0), standard_air(LOWEST_M));
    }

    #[test]
    fn clear_air_thins_with_height_without_a_step() {
        assert!((clear_extinction_mag(0.0) - 0.2).abs() < 1e-12);
        assert_eq!(clear_extinction_mag(-400.0), clear_extinction_mag(0.0));
        let mut before = clear_extinction_mag(0.0);
        for step in 1..=500 {
            let next = clear_extinction_mag(f64::from(step) * 100.0);
            assert!(next < before && next > 0.9 * before, "{step}: {before} {next}");
            before = next;
        }
        assert!((5e-5..1e-4).contains(&before), "{before}");
    }

    #[test]
    fn the_daylight_of_thin_air_falls_with_height_without_a_step() {
        let sun = f64::to_radians(40.0);
        let azimuth = f64::to_radians(120.0);
        let seen_cd_m2 = |air: &Air, altitude_deg: f64| {
            let (table, altitude) = (air.scattered.table(sun), altitude_deg.to_radians());
            let cosine = altitude.sin() * sun.sin() + altitude.cos() * sun.cos() * azimuth.cos();
            let light = table.luminance(altitude, azimuth, cosine);
            luminance([0, 1, 2].map(|c| light[c] * sun_lx()[c]))
        };
        let heights = [20.0, 21.0, 22.0, 30.0, 40.0, 50.0].map(|height_km| height_km * 1e3);
        let seen = heights.map(|height_m| {
            let air = Air::new(clear_extinction_mag(height_m), height_m, [0.0; 3]);
            [90.0, 45.0, 5.0, -1.0].map(|altitude_deg| seen_cd_m2(&air, altitude_deg))
        });
        println!("zenith, 45, 5 and -1 degrees at {heights:?} m: {seen:.3?} cd/m^2");
        // Light is scattered once, by a column in proportion to the pressure: 1.163 to 1.190 kcd/m^2 for the pressure
        // at sea level.
        for (height_m, [zenith, ..]) in heights.iter().zip(seen) {
            let at_sea_pressure = zenith / pressure_share(*height_m);
            assert!((1.12e3..1.24e3).contains(&at_sea_pressure), "{height_m}: {zenith} {at_sea_pressure}");
        }
        for (pair, kilometres) in seen.windows(2).zip([1.0, 1.0, 8.0, 10.0, 10.0]) {
            for (below, above) in pair[0].iter().zip(pair[1]) {
                let per_km = (below / above).powf(1.0 / kilometres);
                assert!((1.09..1.21).contains(&per_km), "{below} {above}");
            }
        }
        // The air below the horizon of a high place is far denser than that of the place.
        let high = Air::new(clear_extinction_mag(22e3), 22e3, [0.0; 3]);
        let lowest = high.scattered.lowest_rad().to_degrees();
        assert!(seen_cd_m2(&high, 0.95 * lowest) > 5.0 * seen_cd_m2(&high, 0.0));
    }

    /// Altitudes of the tables below, degrees.
    const ALTITUDES: [f64; 12] = [90.0, 60.0, 45.0, 30.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.0, -0.5];

    /// Length of a path through the air, after Krisciunas and Schaefer 1991: 5 at the horizon.
    fn length(sine: f64) -> f64 {
        (1.0 - 0.96 * (1.0 - sine * sine)).sqrt().recip()
    }

    #[test]
    fn the_night_sky_has_its_published_profile_from_the_zenith_to_the_horizon() {
        // Relative to the zenith: C. R. Benn and S. L. Ellison, New Astronomy Reviews 42, 503, 1998: 0.4 + 0.6 X, dimmed
        // by k (X - 1), with X = (1 - 0.96 cos^2 h)^-0.5.
        for (extinction_mag, height_m) in [(0.2, 0.0), (0.116, 2635.0)] {
            let air = Air::new(extinction_mag, height_m, [1.0; 3]);
            for altitude in ALTITUDES {
                let sine = f64::to_radians(altitude.max(0.0)).sin();
                let long = length(sine);
                let published = (0.4 + 0.6 * long) * 10_f64.powf(-0.4 * extinction_mag * (long - 1.0));
                let attenuated = (0.4 + 0.6 * long) * air.transmission(sine)[1] / air.transmission(1.0)[1];
                let found = luminance(air.glow(altitude.to_radians()));
                println!(
                    "{height_m} m, {altitude} degrees: {found:.3}, published {published:.3}, only attenuated {attenuated:.3}"
                );
                if altitude >= 5.0 {
                    assert!((1.0 / 1.5..1.5).contains(&(found / published)), "{altitude}: {found} {published}");
                }
                // In the lowest degrees the air is opaque, which the formula ignores. There the sky has the mean
                // luminance of the sky and the ground that surround the air.
                assert!(found > 0.6 && found < 2.3, "{altitude}: {found}");
                if altitude <= 2.0 {
                    assert!(attenuated < 0.5 * found, "scattered light dominates: {altitude}");
                }
            }
            // The light has no step, neither at altitude 0 nor above.
            let lowest = air.scattered.lowest_rad().to_degrees();
            let mut before = luminance(air.glow(lowest.to_radians()));
            for step in 1..1000 {
                let next = luminance(air.glow((lowest + f64::from(step) * 0.02).to_radians()));
                assert!((next / before - 1.0).abs() < 0.02, "{step}: {before} {next}");
                before = next;
            }
        }
        // The sky below altitude 0 on a mountain is that of the table, not that of altitude 0.
        let [level, below] =
            [0.0, -1.0].map(|altitude: f64| luminance(Air::new(0.116, 2635.0, [1.0; 3]).glow(altitude.to_radians())));
        assert!(below < 0.95 * level, "{level} {below}");
    }

    #[test]
    fn moonlight_has_its_published_profile_from_the_zenith_to_the_horizon() {
        // Full Moon at an altitude of 45 degrees: Krisciunas and Schaefer 1991, equations 3 and 15 to 21.
        let (air, extinction_mag) = (air(), 0.2);
        let moon = f64::to_radians(45.0);
        let passed = |sine: f64| 10_f64.powf(-0.4 * extinction_mag * length(sine));
        for (azimuth_deg, altitude) in [60.0_f64, 120.0, 180.0]
            .into_iter()
            .flat_map(|azimuth_deg| ALTITUDES.map(|altitude| (azimuth_deg, altitude)))
        {
            let seen = f64::to_radians(altitude);
            let cosine = seen.sin() * moon.sin() + seen.cos() * moon.cos() * azimuth_deg.to_radians().cos();
            let light = air.scattered.table(moon).luminance(seen, azimuth_deg.to_radians(), cosine);
            let (lx, colour) = (illuminance_lx_from_magnitude(-12.73), rec709_in_gamut(5772.0));
            let found = luminance([0, 1, 2].map(|c| light[c] * lx * colour[c]));
            let apart_deg = cosine.acos().to_degrees();
            let scattered = 10_f64.powf(5.36) * (1.06 + cosine * cosine) + 10_f64.powf(6.15 - apart_deg / 40.0);
            let nanolamberts =
                scattered * 10_f64.powf(-0.4 * 3.84) * passed(moon.sin()) * (1.0 - passed(seen.sin().max(0.0)));
            let published = nanolamberts * 1e-5 / std::f64::consts::PI;
            println!("azimuth {azimuth_deg}, {altitude}: {found:.3e} cd/m^2, published {published:.3e}");
            if altitude >= 0.0 {
                assert!((1.0 / 1.5..1.5).contains(&(found / published)), "{altitude}: {found} {published}");
            }
        }
    }

    #[test]
    fn the_sky_in_twilight_gives_the_ground_its_published_illuminance() {
        // P. K. Seidelmann, "Explanatory Supplement", 1992, table 9.311, lx; at 18 degrees of depression the light is
        // that of the airglow and the stars.
        let air = air();
        for (sun_deg, published_lx) in [(-6.0, 3.4), (-12.0, 8.1e-3), (-18.0, 6.5e-4)] {
            let sun = f64::to_radians(sun_deg);
            let (table, rgb) = (air.scattered.table(sun), sun_lx());
            let at = |altitude_rad: f64, azimuth_rad: f64| {
                let cosine = altitude_rad.sin() * sun.sin() + altitude_rad.cos() * sun.cos() * azimuth_rad.cos();
                let light = table.luminance(altitude_rad, azimuth_rad, cosine);
                let scattered = luminance([0, 1, 2].map(|c| light[c] * rgb[c]));
                scattered + luminance(air.glow(altitude_rad))
            };
            for altitude in ALTITUDES {
                let [towards, across, away] = [0.0, 0.5, 1.0].map(|turn| at(altitude.to_radians(), turn * PI));
                println!(
                    "Sun {sun_deg}, {altitude}: {towards:.3e} {across:.3e} {away:.3e} cd/m^2 at 0, 90 and 180 degrees"
                );
            }
            let (rings, around) = (90, 36);
            let lit_lx: f64 = (0..rings * around)
                .map(|node| {
                    let altitude_rad = (f64::from(node / around) + 0.5) / f64::from(rings) * PI / 2.0;
                    let part = altitude_rad.sin() * altitude_rad.cos() * PI / 2.0 / f64::from(rings);
                    let azimuth_rad = (f64::from(node % around) + 0.5) / f64::from(around) * PI;
                    2.0 * PI / f64::from(around) * part * at(altitude_rad, azimuth_rad)
                })
                .sum();
            println!("Sun {sun_deg}: {lit_lx:.3e} lx on the ground, published {published_lx:.3e}");
            assert!((1.0 / 1.5..1.5).contains(&(lit_lx / published_lx)), "{sun_deg}: {lit_lx} {published_lx}");
        }
    }

    #[test]
    fn light_is_continuous_from_day_to_night() {
        let air = air();
        let mut before = f64::INFINITY;
        for tenth in (-250..=300).rev() {
            let zenith = zenith_cd_m2(&air, f64::from(tenth) / 10.0);
            assert!(zenith > 0.0 && (before / zenith < 1.4 || before == f64::INFINITY), "{tenth}: {before} {zenith}");
            before = zenith;
        }
    }
}

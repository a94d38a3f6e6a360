//! The ranges of the numbers of a configuration, each written once: the check of the sections and the schema
//! ([`super::reference`]) read the same table. What scene and views check themselves, because clients are refused by the same
//! rules, stands here with their constants; a test feeds every bound, and what lies just beyond it, to the parser.
//!
//! Keys are dotted paths from the root. `[]` stands for any element of a list of tables; the range of a list of numbers is that
//! of each of its elements.

use toml::{Table, Value};

use super::bodies::{MAGNITUDES, TEMPERATURES_K};
use super::error::{Fault, finite};
use super::windows::{PLACES_PX, SIDES_PX};
use crate::catalogue::galaxy::MOST_STARS;
use crate::photometry::psf::DIAMETERS_MM;
use crate::plan::settings::{AsteroidSettings, PixelGaussianSettings, StarSettings};
use crate::relativity::MAX_SPEED_C;
use crate::scene::SceneClock;
use crate::scene::asteroids::{LARGEST_EXTENT_M, LEAST_OF_RANGE, MOST_INSTANCES, STEEPEST_SIZE_INDEX};
use crate::scene::bodies::{BRIGHTEST_ALBEDO, FARTHEST_M, RADII_M};
use crate::scene::overlay::{SIZES_PX, WIDTHS_PX};
use crate::view::MAX_EYE_OFFSET_M;

/// What a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Path of the key.
    pub key: &'static str,
    /// Lower bound.
    pub least: f64,
    /// Whether the lower bound itself is refused.
    pub above: bool,
    /// Upper bound, infinite for none. Infinite values are refused all the same.
    pub most: f64,
    /// What the number counts, as messages name it; empty where the key says it.
    pub unit: &'static str,
}

/// From `least` to `most`, both allowed.
const fn closed(key: &'static str, [least, most]: [f64; 2], unit: &'static str) -> Range {
    Range { key, least, above: false, most, unit }
}

/// Above 0 up to `most`.
const fn above_0(key: &'static str, most: f64, unit: &'static str) -> Range {
    Range { key, least: 0.0, above: true, most, unit }
}

/// From `least` on.
const fn from(key: &'static str, least: f64, unit: &'static str) -> Range {
    Range { key, least, above: false, most: f64::INFINITY, unit }
}

const MAGNITUDE: [f64; 2] = StarSettings::MAGNITUDES;
/// Beyond +-100 the white luminance leaves the range of f32 together with the stars' light.
const EV100: [f64; 2] = [-100.0, 100.0];
const SHARE: [f64; 2] = [0.0, 1.0];
const SIGMAS_PX: [f64; 2] = [*PixelGaussianSettings::SIGMAS_PX.start(), *PixelGaussianSettings::SIGMAS_PX.end()];
const DIAMETER_MM: [f64; 2] = [*DIAMETERS_MM.start(), *DIAMETERS_MM.end()];
const VARIANCES_PX2: [f64; 2] = [0.01, 10_000.0];
const EDGES_DEG: [f64; 2] = [-89.0, 89.0];
const EYE_M: [f64; 2] = [-MAX_EYE_OFFSET_M, MAX_EYE_OFFSET_M];
const PLACE_M: [f64; 2] = [-FARTHEST_M, FARTHEST_M];
const ALBEDO: [f64; 2] = [0.0, BRIGHTEST_ALBEDO];
const EXTENT_M: [f64; 2] = [0.0, LARGEST_EXTENT_M];

/// From the deepest places to far above the air.
const HEIGHTS_M: [f64; 2] = [-12_000.0, 1e6];

/// Largest luminance of a calibrated display, cd/m^2.
const MOST_PEAK_CD_M2: f64 = 1e6;

/// What [`check`] enforces.
const CHECKED_HERE: &[Range] = &[
    closed("scene.time_rate", [-SceneClock::MOST_RATE, SceneClock::MOST_RATE], ""),
    closed("scene.observer.latitude_deg", [-90.0, 90.0], ""),
    closed("scene.observer.longitude_deg", [-360.0, 360.0], ""),
    closed("scene.observer.height_m", HEIGHTS_M, "m"),
    closed("scene.observer.altitude_deg", [-90.0, 90.0], ""),
    closed("scene.observer.ut1_minus_utc_s", [-1.0, 1.0], "s"),
    closed("scene.observer.delta_t_s", [-1e6, 1e6], "s"),
    closed("scene.observer.air.extinction_mag", [0.0, 2.0], "magnitudes"),
    closed("scene.observer.air.night_sky_mag", [10.0, 30.0], "magnitudes per square arcsecond"),
    closed("scene.observer.air.pressure_hpa", [0.0, 1200.0], "hPa"),
    closed("scene.observer.air.temperature_c", [-90.0, 60.0], "degrees Celsius"),
    closed("scene.observer.ground.albedo", SHARE, ""),
    closed("scene.observer.ground.landscape_azimuth_deg", [-360.0, 360.0], "degrees"),
    closed("stars.magnitude_limit", MAGNITUDE, ""),
    closed("stars.pixel_gaussian.sigma_px", SIGMAS_PX, "pixels"),
    above_0("stars.pixel_gaussian.sigma_arcmin", PixelGaussianSettings::MOST_SIGMA_ARCMIN, "arcminutes"),
    // Three times this, of the brightest of the scaled discs, stays below 90 degrees.
    above_0("stars.billboard.diameter_arcmin", 1800.0, "arcminutes"),
    above_0("stars.billboard.screen_size_px", 1024.0, "pixels"),
    closed("stars.billboard.brightest_magnitude", MAGNITUDE, ""),
    closed("stars.billboard.faintest_magnitude", MAGNITUDE, ""),
    closed("stars.gaussian_psf.limiting_magnitude", MAGNITUDE, ""),
    closed("stars.gaussian_psf.saturation_magnitude", MAGNITUDE, ""),
    closed("stars.gaussian_psf.sigma2_px2", VARIANCES_PX2, "pixels^2"),
    closed("stars.gaussian_psf.glare_sigma2_px2", VARIANCES_PX2, "pixels^2"),
    closed("stars.gaussian_psf.glare_brightness", SHARE, "of the core's brightness"),
    // Cells of a face are numbered in 32 bits; every pixel looks at each layer.
    closed("stars.cell_sky.cells", [1.0, 65_535.0], ""),
    closed("stars.cell_sky.layers", [1.0, 64.0], ""),
    above_0("stars.cell_sky.radius_px", 1024.0, "pixels"),
    // `photometry::psf::MAX_WIDTH_RAD` in a round number.
    above_0("stars.psf_texture.width_arcmin", 1200.0, "arcminutes"),
    closed("stars.psf_texture.diameter_mm", DIAMETER_MM, "mm"),
    above_0("glare.inner_deg", 180.0, "degrees"),
    closed("glare.fraction", SHARE, "of the light"),
    closed("glare.age_years", [0.0, 120.0], "years"),
    // From brighter than any star to fainter than any telescope sees.
    closed("exposure.limiting_magnitude", [-10.0, 30.0], ""),
    closed("exposure.ev100", EV100, ""),
    closed("exposure.min_ev100", EV100, ""),
    closed("exposure.max_ev100", EV100, ""),
    closed("exposure.key", [1e-6, 1.0], "of display white"),
    // Below, a pixel of the meter is narrower than f32 tells directions apart well.
    closed("exposure.spot_deg", [0.05, 90.0], "degrees"),
    closed("exposure.compensation_ev", [-30.0, 30.0], ""),
    from("exposure.adaptation_s", 0.0, "s"),
    closed("tone_map.white", [1.0, 1e6], "times display white"),
    above_0("tone_map.peak_cd_m2", MOST_PEAK_CD_M2, "cd/m^2"),
    closed("tone_map.desaturation", SHARE, ""),
    closed("tone_map.scotopic", SHARE, ""),
    // Larger error budgets are mistakes: all of the light, or ten pixels.
    above_0("accuracy.flux", 1.0, ""),
    above_0("accuracy.centroid_px", 10.0, "pixels"),
    above_0("accuracy.flicker", 1.0, ""),
    above_0("accuracy.glare", 1.0, ""),
    closed("accuracy.display_codes", [0.0, 64.0], "codes of 8 bits"),
    above_0("accuracy.frame_ms", 10_000.0, "ms"),
    closed("headset.resolution_scale", [0.1, 4.0], ""),
    above_0("headset.flight_m_s", 1e12, "m/s"),
    closed("headset.turn_deg_s", [0.0, 360.0], "deg/s"),
];

/// What other modules enforce, by these constants or by rules of which these are the outermost bounds.
const CHECKED_ELSEWHERE: &[Range] = &[
    closed("scene.catalogues[].light.b_v", [-0.5, 3.0], "magnitudes"),
    closed("scene.catalogues[].galaxy.stars", [1.0, MOST_STARS as f64], ""),
    closed("scene.camera.velocity_c", [-MAX_SPEED_C, MAX_SPEED_C], ""),
    from("views[].size", 1.0, "pixels"),
    from("views[].face_size", 1.0, "pixels"),
    above_0("views[].fov_y_deg", 178.0, "degrees"),
    above_0("views[].fov_deg", 360.0, "degrees"),
    closed("views[].fov.left_deg", EDGES_DEG, "degrees"),
    closed("views[].fov.right_deg", EDGES_DEG, "degrees"),
    closed("views[].fov.up_deg", EDGES_DEG, "degrees"),
    closed("views[].fov.down_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_left.left_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_left.right_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_left.up_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_left.down_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_right.left_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_right.right_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_right.up_deg", EDGES_DEG, "degrees"),
    closed("views[].fov_right.down_deg", EDGES_DEG, "degrees"),
    // Each eye stands half of it from the view's place.
    closed("views[].ipd_m", [0.0, 2.0 * MAX_EYE_OFFSET_M], "m"),
    closed("views[].position_m", EYE_M, "m"),
    closed("bodies[].position_m", PLACE_M, "m"),
    closed("bodies[].radius_m", RADII_M, "m"),
    closed("bodies[].radii_m", RADII_M, "m"),
    closed("bodies[].geometric_albedo", ALBEDO, ""),
    closed("bodies[].emission.absolute_magnitude", MAGNITUDES, ""),
    closed("bodies[].emission.temperature_k", TEMPERATURES_K, "K"),
    closed("bodies[].emission.limb_darkening", SHARE, ""),
    closed("overlay.grids[].spacing_deg", [1.0, 90.0], "degrees"),
    closed("overlay.grids[].width_px", WIDTHS_PX, "pixels"),
    closed("overlay.grids[].opacity", SHARE, ""),
    closed("overlay.trajectories[].width_px", WIDTHS_PX, "pixels"),
    closed("overlay.trajectories[].opacity", SHARE, ""),
    closed("overlay.labels[].dec_deg", [-90.0, 90.0], "degrees"),
    closed("overlay.labels[].position_m", PLACE_M, "m"),
    closed("overlay.labels[].size_px", SIZES_PX, "pixels"),
    closed("overlay.labels[].opacity", SHARE, ""),
    closed("windows[].position", PLACES_PX, "pixels"),
    closed("windows[].size", SIDES_PX, "pixels"),
    closed("asteroid_fields[].position_m", PLACE_M, "m"),
    closed("asteroid_fields[].instances", [1.0, MOST_INSTANCES as f64], ""),
    above_0("asteroid_fields[].size_m", LARGEST_EXTENT_M, "m"),
    closed("asteroid_fields[].inner_m", EXTENT_M, "m"),
    above_0("asteroid_fields[].outer_m", LARGEST_EXTENT_M, "m"),
    above_0("asteroid_fields[].height_m", LARGEST_EXTENT_M, "m"),
    closed("asteroid_fields[].thickness_m", EXTENT_M, "m"),
    closed("asteroid_fields[].radius_m", [LEAST_OF_RANGE, LARGEST_EXTENT_M], "m"),
    closed("asteroid_fields[].size_index", [0.0, STEEPEST_SIZE_INDEX], ""),
    closed("asteroid_fields[].spin_period_s", [LEAST_OF_RANGE, LARGEST_EXTENT_M], "s"),
    closed("asteroid_fields[].geometric_albedo", ALBEDO, ""),
    closed("asteroids.quality", AsteroidSettings::QUALITIES, ""),
    closed("asteroids.tiles", AsteroidSettings::TILES, ", powers of two"),
    closed("asteroids.tile_px", AsteroidSettings::TILE_PX, "pixels, powers of two"),
    closed("asteroids.samples", AsteroidSettings::SAMPLES, ""),
    // The upper bound is half of `peak_cd_m2`: with less contrast than 2 it is no display.
    closed("tone_map.black_cd_m2", [0.0, MOST_PEAK_CD_M2 / 2.0], "cd/m^2"),
];

/// Every range.
pub fn all() -> impl Iterator<Item = &'static Range> {
    CHECKED_HERE.iter().chain(CHECKED_ELSEWHERE)
}

impl Range {
    /// Whether the number is allowed. NaN and infinities are not.
    pub fn allows(&self, value: f64) -> bool {
        let above = if self.above { value > self.least } else { value >= self.least };
        value.is_finite() && above && value <= self.most
    }
}

/// `0 to 1 of display white`, `values above 0 up to 10`, `values from 0 s`.
impl std::fmt::Display for Range {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (least, most) = (number(self.least), number(self.most));
        match (self.above, self.most.is_finite()) {
            (true, true) => write!(formatter, "values above {least} up to {most}")?,
            (true, false) => write!(formatter, "values above {least}")?,
            (false, true) => write!(formatter, "{least} to {most}")?,
            (false, false) => write!(formatter, "values from {least}")?,
        }
        match self.unit {
            "" => Ok(()),
            unit if unit.starts_with(',') => formatter.write_str(unit),
            unit => write!(formatter, " {unit}"),
        }
    }
}

/// A bound as people write it: 1e12, not 1000000000000.
pub(super) fn number(value: f64) -> String {
    let (plain, short) = (format!("{value}"), format!("{value:e}"));
    if short.len() + 4 < plain.len() { short } else { plain }
}

/// Checks the numbers of the sections that are given in a document whose types have been checked.
pub(super) fn check(document: &Table) -> Result<(), Fault> {
    for range in CHECKED_HERE {
        let (section, path) = range.key.split_once('.').unwrap_or((range.key, ""));
        let given = path.split('.').try_fold(document.get(section), |value, step| value.map(|value| value.get(step)));
        let value = match given.flatten() {
            Some(Value::Float(value)) => *value,
            Some(Value::Integer(value)) => *value as f64,
            _ => continue,
        };
        finite(range.key, value)?;
        if !range.allows(value) {
            return Err(Fault::new(range.key, format!("{value}: allowed are {range}")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_written_as_people_write_them() {
        let text = |range: Range| range.to_string();
        assert_eq!(text(closed("k", [1e-6, 1.0], "of display white")), "0.000001 to 1 of display white");
        assert_eq!(text(above_0("k", 1e12, "m/s")), "values above 0 up to 1e12 m/s");
        assert_eq!(text(from("k", 0.0, "s")), "values from 0 s");
    }

    #[test]
    fn nan_and_infinities_are_never_allowed() {
        for range in all() {
            assert!(
                [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].iter().all(|&value| !range.allows(value)),
                "{range:?}"
            );
        }
        assert!(above_0("k", 1.0, "").allows(1.0) && !above_0("k", 1.0, "").allows(0.0));
    }
}

//! `[scene.observer.air]` and `[scene.observer.ground]`.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::finite;
use crate::observer::RefractingAir;
use crate::photometry::{
    atmosphere::{Air, clear_extinction_mag, glow_of},
    blackbody::rec709_in_gamut,
};
use crate::ranges::KeyError;
use crate::scene::{
    landscape::Landscape,
    surroundings::{Ground, Horizon},
};

/// Colour temperature of the night sky, K. Its light comes mostly from the Sun and stars; its measured B - V is 0.7 to 1.
const GLOW_K: f64 = 5772.0;
/// Height above which no air is drawn, m. At this height, the zenith has 1 cd/m^2 by day, and the standard atmosphere ends.
const HIGHEST_M: f64 = 50_000.0;
/// Maximum number of points of a horizon.
pub const MOST_POINTS: usize = 10_000;

/// The air. It absorbs light (more of it near the horizon), refracts light, and scatters the light of the Sun and the Moon.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AirConfig {
    /// Whether there is air. Above a height of 50 km none is drawn.
    pub enabled: bool,
    /// Extinction in the V band per air mass, magnitudes; 0 means no air. The default is that of clear air at the observer's height: 0.2 at sea
    /// level.
    #[schemars(range(min = 0.0, max = 2.0), extend("x-unit" = "magnitudes"))]
    pub extinction_mag: Option<f64>,
    /// Brightness of the zenith on a dark night without stars and planets: V magnitudes per square arcsecond; 22 far from all lamps, 18 in a town.
    #[schemars(range(min = 10.0, max = 30.0), extend("x-unit" = "magnitudes per square arcsecond"))]
    pub night_sky_mag: f64,
    /// Pressure at the observer, which determines refraction; 0 means no refraction. The default is that of the standard atmosphere at the observer's
    /// height.
    #[schemars(range(min = 0.0, max = 1200.0), extend("x-unit" = "hPa"))]
    pub pressure_hpa: Option<f64>,
    /// Temperature at the observer, degrees Celsius; the default is that of the standard atmosphere.
    #[schemars(range(min = -90.0, max = 60.0), extend("x-unit" = "degrees Celsius"))]
    pub temperature_c: Option<f64>,
}

/// The ground: it hides everything below the horizon.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GroundConfig {
    /// Whether there is ground. Without ground, the sky below the horizon mirrors the sky above it. Stars, planets and the Moon are then visible
    /// below the horizon, but a Sun that has set is not.
    pub enabled: bool,
    /// Share of the incident light that the ground reflects.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub albedo: f64,
    /// The horizon line, as pairs of azimuth (0 to 360, in rising order) and altitude (-90 to 90). Straight lines connect the points, all the way
    /// around. Two points with the same azimuth form a vertical wall. A point at 360 closes the line; it must have the altitude of the point at 0 if
    /// there is one. Empty: the horizon of the sea, which is below altitude 0 by the dip at the observer's height.
    pub horizon_deg: Vec<[f64; 2]>,
    /// A panorama instead of that line: a PNG with alpha, twice as wide as high. Azimuth increases to the right, and the zenith is at the top. The
    /// colour is the reflectance, and alpha is the opacity in front of the sky. Relative paths start at the configuration's folder.
    pub landscape: Option<PathBuf>,
    /// Azimuth of the middle of the panorama.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub landscape_azimuth_deg: f64,
}

impl Default for AirConfig {
    fn default() -> Self {
        Self { enabled: true, extinction_mag: None, night_sky_mag: 22.0, pressure_hpa: None, temperature_c: None }
    }
}

impl Default for GroundConfig {
    fn default() -> Self {
        Self { enabled: true, albedo: 0.15, horizon_deg: Vec::new(), landscape: None, landscape_azimuth_deg: 180.0 }
    }
}

impl AirConfig {
    /// Checks the rules beyond types and ranges, at a height, m; an error names the key below `scene.observer.air`.
    pub(super) fn check(&self, height_m: f64) -> Result<(), KeyError> {
        if self.extinction_mag.is_some() && height_m > HIGHEST_M {
            let problem = format!("no air is drawn at a height of {height_m} m: omit the key above {HIGHEST_M} m");
            return Err(KeyError::new("extinction_mag", problem));
        }
        Ok(())
    }

    /// Returns the reason why a key has no effect at a height, m, although the air is turned on; `None` if it has an effect.
    pub(super) fn why_idle(&self, key: &str, height_m: f64) -> Option<String> {
        let is_of_air = ["night_sky_mag", "pressure_hpa", "temperature_c"].contains(&key);
        if is_of_air && height_m > HIGHEST_M {
            return Some(format!("at a height of {height_m} m: no air is drawn above {HIGHEST_M} m"));
        }
        if is_of_air && self.extinction_mag == Some(0.0) {
            return Some("with extinction_mag = 0: there is no air that could glow and refract".to_owned());
        }
        let is_unrefracted = key == "temperature_c" && self.pressure_hpa == Some(0.0);
        is_unrefracted.then(|| "with pressure_hpa = 0: there is no refraction".to_owned())
    }

    /// Returns the air at a height, m; `None` if it is turned off, or if the height is above [`HIGHEST_M`], which is logged.
    pub(super) fn air(&self, height_m: f64) -> Option<Air> {
        if self.enabled && height_m > HIGHEST_M {
            tracing::info!("scene.observer.height_m = {height_m}: no air is drawn above {HIGHEST_M} m");
        }
        let glow_cd_m2 = glow_of(self.night_sky_mag, rec709_in_gamut(GLOW_K));
        self.extinction(height_m).map(|extinction_mag| Air::new(extinction_mag, height_m, glow_cd_m2))
    }

    /// Extinction of the air at a height, m, V magnitudes; `None` without air.
    fn extinction(&self, height_m: f64) -> Option<f64> {
        let extinction_mag = self.extinction_mag.unwrap_or_else(|| clear_extinction_mag(height_m));
        let has_air = self.enabled && extinction_mag > 0.0 && height_m <= HIGHEST_M;
        has_air.then_some(extinction_mag)
    }

    /// The refracting air at a height, m; `None` without air.
    pub(super) fn refracting(&self, height_m: f64) -> Option<RefractingAir> {
        let standard = RefractingAir::at_height(height_m);
        self.extinction(height_m).map(|_| RefractingAir {
            pressure_hpa: self.pressure_hpa.unwrap_or(standard.pressure_hpa),
            temperature_c: self.temperature_c.unwrap_or(standard.temperature_c),
        })
    }
}

impl GroundConfig {
    /// Checks the rules beyond types and ranges; an error names the key below `scene.observer.ground`.
    pub(super) fn check(&self) -> Result<(), KeyError> {
        if self.horizon_deg.len() > MOST_POINTS {
            let problem = format!("{} points: must be at most {MOST_POINTS}", self.horizon_deg.len());
            return Err(KeyError::new("horizon_deg", problem));
        }
        if self.landscape.is_some() && !self.horizon_deg.is_empty() {
            let problem = "landscape is also given, and its alpha is the horizon: give at most one of them";
            return Err(KeyError::new("horizon_deg", problem));
        }
        for (index, point) in self.horizon_deg.iter().enumerate() {
            let key = format!("horizon_deg[{index}]");
            self.check_point(index, *point, &key).map_err(|problem| KeyError::new(key, problem))?;
        }
        Ok(())
    }

    /// Checks that a point of the horizon line is within its range and may follow the preceding points.
    fn check_point(&self, index: usize, [azimuth_deg, altitude_deg]: [f64; 2], key: &str) -> Result<(), String> {
        for value in [azimuth_deg, altitude_deg] {
            finite(key, value).map_err(|fault| fault.problem)?;
        }
        if !(0.0..=360.0).contains(&azimuth_deg) {
            return Err(format!("azimuth {azimuth_deg}: must be between 0 and 360"));
        }
        if altitude_deg.abs() > 90.0 {
            return Err(format!("altitude {altitude_deg}: must be between -90 and 90"));
        }
        let before = &self.horizon_deg[..index];
        let [last, last_altitude] = before.last().copied().unwrap_or([f64::NEG_INFINITY; 2]);
        if azimuth_deg < last {
            return Err(format!(
                "azimuth {azimuth_deg} does not rise: must be at least {last}, the azimuth of the previous point"
            ));
        }
        if azimuth_deg == last && altitude_deg == last_altitude {
            return Err(format!("azimuth {azimuth_deg} and altitude {altitude_deg} are those of the previous point"));
        }
        if before.iter().rev().take_while(|point| point[0] == azimuth_deg).count() > 1 {
            return Err(format!("a third point of azimuth {azimuth_deg}: a vertical wall has two"));
        }
        if azimuth_deg < 360.0 {
            return Ok(());
        }
        match before.first().filter(|first| first[0] == 0.0) {
            Some([_, north_deg]) if *north_deg != altitude_deg => Err(format!(
                "altitude {altitude_deg} at azimuth 360: must be {north_deg}, that of azimuth 0, to close the line"
            )),
            _ if last == 360.0 => {
                Err("a second point of azimuth 360: write a wall in the north with azimuth 0".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Reads the landscape, from a path relative to `folder`, if there is ground; an error names the key below `scene.observer.ground`.
    pub(super) fn landscape(&self, folder: &Path) -> Result<Option<Landscape>, KeyError> {
        let read = |file: &PathBuf| Landscape::from_png(&folder.join(file), self.landscape_azimuth_deg.to_radians());
        let landscape = self.landscape.as_ref().filter(|_| self.enabled).map(read).transpose();
        landscape.map_err(|error| KeyError::new("landscape", error.to_string()))
    }

    /// The ground with its landscape, if it has one; `None` if it is turned off.
    /// Without a horizon line, the ground ends `dip_rad` below altitude 0.
    pub(super) fn ground(&self, landscape: Option<Arc<Landscape>>, dip_rad: f64) -> Option<Ground> {
        let points = || self.horizon_deg.iter().map(|point| point.map(f64::to_radians)).collect();
        let line = || if self.horizon_deg.is_empty() { Horizon::level(-dip_rad) } else { Horizon::new(points()) };
        self.enabled.then(|| Ground {
            horizon: landscape.as_ref().map_or_else(line, |landscape| landscape.horizon()),
            albedo: self.albedo,
            landscape,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn horizons_rise_round_the_compass_or_are_refused_by_point() {
        let check = |points: &[[f64; 2]]| GroundConfig { horizon_deg: points.to_vec(), ..Default::default() }.check();
        assert!(check(&[]).is_ok() && check(&[[0.0, 90.0], [359.9, -90.0]]).is_ok());
        let wall = &[[0.0, 3.0], [60.0, 2.0], [90.0, 2.0], [90.0, 7.0], [120.0, 7.0]];
        assert!(check(wall).is_ok() && check(&[[0.0, 3.0], [180.0, 5.0], [360.0, 3.0]]).is_ok());
        // If there is no point of azimuth 0, a point of azimuth 360 defines the altitude in the north.
        assert!(check(&[[90.0, 3.0], [360.0, 4.0]]).is_ok() && check(&[[360.0, 1.0]]).is_ok());
        for (points, key, part) in [
            (&[[5.0, 1.0], [4.0, 2.0]][..], "horizon_deg[1]", "does not rise"),
            (&[[5.0, 1.0], [5.0, 1.0]][..], "horizon_deg[1]", "those of the previous point"),
            (&[[5.0, 1.0], [5.0, 2.0], [5.0, 3.0]][..], "horizon_deg[2]", "a third point of azimuth 5"),
            (&[[0.0, 3.0], [360.0, 4.0]][..], "horizon_deg[1]", "must be 3, that of azimuth 0"),
            (&[[0.0, 1.0], [0.0, 3.0], [360.0, 3.0]][..], "horizon_deg[2]", "must be 1"),
            (&[[9.0, 3.0], [360.0, 4.0], [360.0, 5.0]][..], "horizon_deg[2]", "a second point of azimuth 360"),
            (&[[360.1, 1.0]][..], "horizon_deg[0]", "between 0 and 360"),
            (&[[-0.1, 1.0]][..], "horizon_deg[0]", "between 0 and 360"),
            (&[[1.0, 91.0]][..], "horizon_deg[0]", "between -90 and 90"),
            (&[[1.0, f64::NAN]][..], "horizon_deg[0]", "finite"),
            (&[[1.0, 0.0]; MOST_POINTS + 1][..], "horizon_deg", "10001 points"),
        ] {
            let fault = check(points).expect_err(key);
            assert!(fault.key == key && fault.problem.contains(part), "{fault:?}");
        }
    }

    #[test]
    fn air_continues_up_to_50_km() {
        let mut before = f64::INFINITY;
        for height_m in [0.0, 10e3, 20e3, 21e3, 22e3, 30e3, 40e3, HIGHEST_M] {
            let air = AirConfig::default();
            let extinction_mag = air.extinction(height_m).unwrap_or_else(|| panic!("no air at {height_m} m"));
            assert!(extinction_mag > 0.0 && extinction_mag < before, "{height_m}: {extinction_mag}");
            assert!(air.refracting(height_m).is_some());
            before = extinction_mag;
        }
        assert_eq!(AirConfig::default().extinction(HIGHEST_M + 1.0), None);
        // Nor does a given extinction have a lower limit, except that 0 means no air.
        let given = |mag: f64| AirConfig { extinction_mag: Some(mag), ..Default::default() }.extinction(0.0);
        assert_eq!([given(0.001), given(0.0)], [Some(0.001), None]);
    }

    #[test]
    fn air_is_thinner_on_a_mountain_and_absent_in_space() {
        let mag = |height_m: f64| AirConfig::default().air(height_m).map(|air| air.extinction_mag[1]);
        assert!((mag(0.0).expect("air over the sea") - 0.2).abs() < 0.003);
        // Cerro Paranal: 0.11 to 0.13 mag.
        assert!((0.10..0.13).contains(&mag(2635.0).expect("air on a mountain")), "{:?}", mag(2635.0));
        assert_eq!(mag(1e5), None);
        assert!(AirConfig { enabled: false, ..Default::default() }.air(0.0).is_none());
        let dense = AirConfig { extinction_mag: Some(0.3), ..Default::default() };
        assert!(dense.check(4e4).is_ok() && dense.air(4e4).is_some() && dense.air(2e5).is_none());
        let fault = dense.check(2e5).expect_err("there is no air");
        assert!(fault.key == "extinction_mag" && fault.problem.contains("50000 m"), "{fault:?}");
    }
}

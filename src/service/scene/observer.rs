//! The observer of a scene as clients define it, and the effect of changes. A landscape comes only from the
//! configuration: clients turn it on or off.

use std::{path::PathBuf, sync::Arc};

use crate::{
    config::{AirConfig, GroundConfig, ObserverConfig},
    observer::Observer,
    scene::{SceneObjects, landscape::Landscape, surroundings::Surroundings},
};

/// The ground around an observer.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundForm {
    /// Whether the ground is drawn.
    pub enabled: bool,
    /// Albedo, 0 to 1.
    pub albedo: f64,
    /// Horizon line: azimuths from 0 to 360 in rising order (two equal ones mean a vertical wall), and altitudes from -90 to 90. If it is empty, the
    /// horizon is that of the sea.
    pub horizon_deg: Vec<[f64; 2]>,
    /// Whether the configuration's panorama replaces that line.
    pub landscape: bool,
}

/// Changes of the observer; `None` keeps a value. Ranges are those of the configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObserverChange {
    /// Geodetic latitude (WGS84), north positive.
    pub latitude_deg: Option<f64>,
    /// Longitude, east positive.
    pub longitude_deg: Option<f64>,
    /// Height above the ellipsoid.
    pub height_m: Option<f64>,
    /// UT1 - UTC.
    pub ut1_minus_utc_s: Option<f64>,
    /// TT - UT1; `Some(None)`: derived from leap seconds, and estimated before 1972.
    pub delta_t_s: Option<Option<f64>>,
    /// The atmosphere, as a whole.
    pub air: Option<AirConfig>,
    /// The ground, as a whole.
    pub ground: Option<GroundForm>,
}

impl ObserverChange {
    /// Whether the change has no effect.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }
}

/// The observer of a scene as it was defined, and the landscape of the configuration.
#[derive(Clone, Debug)]
pub(crate) struct GivenObserver {
    given: ObserverConfig,
    /// Panorama of the configuration and its file, which are kept while the ground does not use them. `None` if the configuration turns the ground
    /// off, because the file is not read then.
    lent: Option<(PathBuf, Arc<Landscape>)>,
}

/// A prepared change.
#[derive(Clone, Debug)]
pub(crate) struct MadeObserver {
    pub(crate) given: GivenObserver,
    pub(crate) observer: Observer,
    pub(crate) surroundings: Option<Arc<Surroundings>>,
}

impl GivenObserver {
    /// Takes the observer of a configuration; `objects` contain its landscape.
    pub(crate) fn new(given: ObserverConfig, objects: &SceneObjects) -> Self {
        let ground = objects.surroundings.as_ref().and_then(|surroundings| surroundings.ground.as_ref());
        let landscape = ground.and_then(|ground| ground.landscape.clone());
        Self { lent: given.ground.landscape.clone().zip(landscape), given }
    }

    pub(crate) fn definition(&self) -> &ObserverConfig {
        &self.given
    }

    /// Returns the ground as clients see it.
    pub(crate) fn ground(&self) -> GroundForm {
        let GroundConfig { enabled, albedo, horizon_deg, landscape, .. } = &self.given.ground;
        GroundForm {
            enabled: *enabled,
            albedo: *albedo,
            horizon_deg: horizon_deg.clone(),
            landscape: landscape.is_some() && self.lent.is_some(),
        }
    }

    /// Applies a change. The tables of the atmosphere take a tenth of a second. The error states the valid values.
    pub(crate) fn changed(&self, change: &ObserverChange, observer: &Observer) -> Result<MadeObserver, String> {
        let now = &self.given;
        let ground = match &change.ground {
            None => now.ground.clone(),
            Some(GroundForm { landscape: true, .. }) if self.lent.is_none() => {
                return Err("observer.ground.landscape: the configuration has none".to_owned());
            }
            Some(form) => GroundConfig {
                enabled: form.enabled,
                albedo: form.albedo,
                horizon_deg: form.horizon_deg.clone(),
                landscape: self.lent.as_ref().filter(|_| form.landscape).map(|(file, _)| file.clone()),
                landscape_azimuth_deg: now.ground.landscape_azimuth_deg,
            },
        };
        let given = ObserverConfig {
            latitude_deg: change.latitude_deg.unwrap_or(now.latitude_deg),
            longitude_deg: change.longitude_deg.unwrap_or(now.longitude_deg),
            height_m: change.height_m.unwrap_or(now.height_m),
            ut1_minus_utc_s: change.ut1_minus_utc_s.unwrap_or(now.ut1_minus_utc_s),
            delta_t_s: change.delta_t_s.unwrap_or(now.delta_t_s),
            air: change.air.clone().unwrap_or_else(|| now.air.clone()),
            ground,
            ..now.clone()
        };
        given.check().map_err(|problem| problem.replace("ground.horizon_deg", "ground.horizon"))?;
        let landscape = self.lent.as_ref().filter(|_| given.ground.landscape.is_some());
        let landscape = landscape.map(|(_, landscape)| Arc::clone(landscape));
        let surroundings = given.surroundings_with(landscape).map(Arc::new);
        let observer = observer.moved(given.place(), given.clock());
        let given = Self { given, lent: self.lent.clone() };
        Ok(MadeObserver { given, observer, surroundings })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::Config;

    #[test]
    fn keys_change_separately_and_errors_state_valid_values() {
        let text = "[scene]\ntime = 2026-11-23T20:00:00Z\n[scene.observer]\nlatitude_deg = 48\nlongitude_deg = 11\n\
                    height_m = 500\n[scene.observer.air]\nnight_sky_mag = 20\n";
        let config = Config::from_text(text, "sky.toml", Path::new("."), &[]).unwrap();
        let objects = config.objects().unwrap();
        let observer = objects.observer.unwrap();
        let given = GivenObserver::new(config.scene.observer.clone().unwrap(), &objects);
        let sydney =
            ObserverChange { latitude_deg: Some(-33.9), longitude_deg: Some(151.2), ..ObserverChange::default() };
        let made = given.changed(&sydney, &observer).unwrap();
        assert_eq!(made.observer.epoch.position_m, observer.epoch.position_m, "the old scene keeps its position");
        assert_eq!(made.observer.place.height_m, 500.0);
        assert_eq!(made.given.definition().air.night_sky_mag, 20.0);
        assert!(made.surroundings.as_ref().unwrap().ground.is_some());
        // The output must be valid input, because a state file contains it.
        let off = format!("{text}[scene.observer.ground]\nenabled = false\nlandscape = 'hills.png'\n");
        let off = Config::from_text(&off, "sky.toml", Path::new("."), &[]).unwrap();
        let off_objects = off.objects().unwrap();
        let off = GivenObserver::new(off.scene.observer.clone().unwrap(), &off_objects);
        let output = ObserverChange { ground: Some(off.ground()), ..ObserverChange::default() };
        assert!(off.changed(&output, &observer).unwrap().surroundings.unwrap().ground.is_none());
        // Without a change, the scene is shared.
        let same = given.changed(&ObserverChange::default(), &observer).unwrap();
        assert_eq!((same.observer, same.surroundings), (observer, objects.surroundings.clone()));
        let air = |air: AirConfig| ObserverChange { air: Some(air), ..ObserverChange::default() };
        let ground = |landscape: bool, horizon_deg: Vec<[f64; 2]>| {
            let ground = GroundForm { enabled: true, albedo: 0.1, horizon_deg, landscape };
            ObserverChange { ground: Some(ground), ..ObserverChange::default() }
        };
        for (change, part) in [
            (ObserverChange { latitude_deg: Some(91.0), ..Default::default() }, "observer.latitude_deg: 91"),
            (ObserverChange { latitude_deg: Some(f64::NAN), ..Default::default() }, "observer.latitude_deg: NaN"),
            (ObserverChange { delta_t_s: Some(Some(2e6)), ..Default::default() }, "observer.delta_t_s: 2000000"),
            (air(AirConfig { night_sky_mag: 3.0, ..AirConfig::default() }), "observer.air.night_sky_mag: 3"),
            (ground(true, Vec::new()), "observer.ground.landscape"),
            (ground(false, vec![[10.0, 1.0], [5.0, 1.0]]), "observer.ground.horizon[1]"),
        ] {
            let problem = given.changed(&change, &observer).unwrap_err();
            assert!(problem.contains(part), "{problem}\nmissing: {part}");
        }
        let without = air(AirConfig { enabled: false, ..AirConfig::default() });
        assert!(given.changed(&without, &observer).unwrap().surroundings.unwrap().air.is_none());
    }
}

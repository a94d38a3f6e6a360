//! The observer: conversion between protobuf messages and plain types.

use crate::{
    config::{AirConfig, GroundConfig, MOST_HORIZON_POINTS},
    service::{
        proto,
        scene::observer::{GivenObserver, GroundForm, ObserverChange},
    },
};

/// Fields of the observer that a mask may name.
const ALLOWED: &str = "must be one of observer, observer.latitude_deg, observer.longitude_deg, observer.height_m, observer.ut1_minus_utc_s, observer.delta_t_s, observer.air and observer.ground";

fn air_to_pb(air: &AirConfig) -> proto::Air {
    proto::Air {
        enabled: Some(air.enabled),
        extinction_mag: air.extinction_mag,
        night_sky_mag: Some(air.night_sky_mag),
        pressure_hpa: air.pressure_hpa,
        temperature_c: air.temperature_c,
    }
}

fn air_from_pb(air: proto::Air) -> AirConfig {
    let unsaid = AirConfig::default();
    AirConfig {
        enabled: air.enabled.unwrap_or(unsaid.enabled),
        extinction_mag: air.extinction_mag,
        night_sky_mag: air.night_sky_mag.unwrap_or(unsaid.night_sky_mag),
        pressure_hpa: air.pressure_hpa,
        temperature_c: air.temperature_c,
    }
}

fn ground_to_pb(ground: &GroundForm) -> proto::Ground {
    let point = |[azimuth_deg, altitude_deg]: &[f64; 2]| proto::HorizonPoint {
        azimuth_deg: *azimuth_deg,
        altitude_deg: *altitude_deg,
    };
    proto::Ground {
        enabled: Some(ground.enabled),
        albedo: Some(ground.albedo),
        horizon: ground.horizon_deg.iter().map(point).collect(),
        landscape: ground.landscape,
    }
}

fn ground_from_pb(ground: proto::Ground) -> GroundForm {
    let unsaid = GroundConfig::default();
    GroundForm {
        enabled: ground.enabled.unwrap_or(unsaid.enabled),
        albedo: ground.albedo.unwrap_or(unsaid.albedo),
        horizon_deg: ground.horizon.iter().map(|point| [point.azimuth_deg, point.altitude_deg]).collect(),
        landscape: ground.landscape,
    }
}

pub(crate) fn observer_to_pb(observer: &GivenObserver) -> proto::Observer {
    let given = observer.definition();
    proto::Observer {
        latitude_deg: given.latitude_deg,
        longitude_deg: given.longitude_deg,
        height_m: given.height_m,
        ut1_minus_utc_s: given.ut1_minus_utc_s,
        delta_t_s: given.delta_t_s,
        air: Some(air_to_pb(&given.air)),
        ground: Some(ground_to_pb(&observer.ground())),
    }
}

/// Converts a complete observer to the change that sets it.
pub(crate) fn observer_from_pb(observer: &proto::Observer) -> ObserverChange {
    let ground = Some(ground_from_pb(observer.ground.clone().unwrap_or_default()));
    ObserverChange { ground, ..observer_without_ground(observer) }
}

fn observer_without_ground(observer: &proto::Observer) -> ObserverChange {
    ObserverChange {
        latitude_deg: Some(observer.latitude_deg),
        longitude_deg: Some(observer.longitude_deg),
        height_m: Some(observer.height_m),
        ut1_minus_utc_s: Some(observer.ut1_minus_utc_s),
        delta_t_s: Some(observer.delta_t_s),
        air: Some(air_from_pb(observer.air.unwrap_or_default())),
        ground: None,
    }
}

/// Adds the part that a mask's path after `observer` names. The error states the problem and the valid values.
pub(crate) fn add_observer_change(
    change: &mut ObserverChange,
    rest: &str,
    given: Option<&proto::Observer>,
) -> Result<(), String> {
    let given = given.ok_or_else(|| format!("observer: named by update_mask as observer{rest}, but missing"))?;
    // Check this before copying, because a message can have two million points.
    let points = given.ground.as_ref().map_or(0, |ground| ground.horizon.len());
    if points > MOST_HORIZON_POINTS {
        return Err(format!("observer.ground.horizon: {points} points: there must be at most {MOST_HORIZON_POINTS}"));
    }
    // A mask may name a field a thousand times, so copy the value only once.
    let ground =
        |now: Option<GroundForm>| now.or_else(|| Some(ground_from_pb(given.ground.clone().unwrap_or_default())));
    match rest {
        "" => *change = ObserverChange { ground: ground(change.ground.take()), ..observer_without_ground(given) },
        ".latitude_deg" => change.latitude_deg = Some(given.latitude_deg),
        ".longitude_deg" => change.longitude_deg = Some(given.longitude_deg),
        ".height_m" => change.height_m = Some(given.height_m),
        ".ut1_minus_utc_s" => change.ut1_minus_utc_s = Some(given.ut1_minus_utc_s),
        ".delta_t_s" => change.delta_t_s = Some(given.delta_t_s),
        ".air" => change.air = Some(air_from_pb(given.air.unwrap_or_default())),
        ".ground" => change.ground = ground(change.ground.take()),
        _ => return Err(format!("update_mask: no field `observer{rest}`: {ALLOWED}")),
    }
    Ok(())
}

/// Returns the paths of a change and the message with their values.
pub(crate) fn observer_change_to_pb(change: &ObserverChange) -> (Vec<String>, Option<proto::Observer>) {
    let named = [
        change.latitude_deg.map(|_| "latitude_deg"),
        change.longitude_deg.map(|_| "longitude_deg"),
        change.height_m.map(|_| "height_m"),
        change.ut1_minus_utc_s.map(|_| "ut1_minus_utc_s"),
        change.delta_t_s.map(|_| "delta_t_s"),
        change.air.as_ref().map(|_| "air"),
        change.ground.as_ref().map(|_| "ground"),
    ];
    let observer = proto::Observer {
        latitude_deg: change.latitude_deg.unwrap_or_default(),
        longitude_deg: change.longitude_deg.unwrap_or_default(),
        height_m: change.height_m.unwrap_or_default(),
        ut1_minus_utc_s: change.ut1_minus_utc_s.unwrap_or_default(),
        delta_t_s: change.delta_t_s.flatten(),
        air: change.air.as_ref().map(air_to_pb),
        ground: change.ground.as_ref().map(ground_to_pb),
    };
    let paths = named.into_iter().flatten().map(|key| format!("observer.{key}")).collect();
    (paths, (!change.is_nothing()).then_some(observer))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn changes_survive_a_round_trip() {
        let air = AirConfig { night_sky_mag: 19.5, pressure_hpa: Some(900.0), ..AirConfig::default() };
        let ground =
            GroundForm { enabled: true, albedo: 0.3, horizon_deg: vec![[10.0, 2.0], [200.0, -1.0]], landscape: false };
        for change in [
            ObserverChange { latitude_deg: Some(-3.0), ..ObserverChange::default() },
            ObserverChange { delta_t_s: Some(None), height_m: Some(12.0), ..ObserverChange::default() },
            ObserverChange { air: Some(air), ground: Some(ground), ..ObserverChange::default() },
        ] {
            let (paths, observer) = observer_change_to_pb(&change);
            let mut back = ObserverChange::default();
            for path in &paths {
                add_observer_change(&mut back, path.strip_prefix("observer").unwrap(), observer.as_ref()).unwrap();
            }
            assert_eq!(back, change, "{paths:?}");
        }
        let problem = |rest: &str, given: Option<&proto::Observer>| {
            add_observer_change(&mut ObserverChange::default(), rest, given).unwrap_err()
        };
        assert!(problem(".latitude_deg", None).contains("missing"));
        assert!(problem(".moon", Some(&proto::Observer::default())).contains("observer.ground"));
        // Missing values are the configuration's defaults.
        let said = observer_from_pb(&proto::Observer::default());
        assert_eq!(said.air, Some(AirConfig::default()));
        assert!(said.ground.unwrap().enabled);
    }
}

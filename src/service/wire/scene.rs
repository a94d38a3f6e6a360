//! The scene and its changes: conversion between protobuf messages and plain types.

use super::{
    objects::{
        add_change, body_from_pb, body_to_pb, change_to_pb, field_from_pb, field_to_pb, time_from_j2000, time_from_pb,
        time_to_pb,
    },
    observer::{add_observer_change, observer_change_to_pb, observer_to_pb},
    overlay::{add_overlay_change, overlay_change_to_pb, overlay_to_pb},
};
use crate::{
    plan::settings::{AsteroidSettings, ImpostorMethod, StarMethod},
    scene::SceneClock,
    service::{
        proto,
        scene::state::{SceneCatalogue, SceneState, SceneUpdate},
        time_source::TimeSource,
    },
};

pub(crate) fn scene_to_pb(scene: &SceneState, catalogues: &[SceneCatalogue], time: &TimeSource) -> proto::Scene {
    let now = time.now();
    let time_s = scene.clock.time_s(now);
    let catalogue =
        |catalogue: &SceneCatalogue| proto::Catalogue { name: catalogue.name.clone(), stars: catalogue.stars };
    proto::Scene {
        revision: scene.revision,
        catalogues: catalogues.iter().map(catalogue).collect(),
        stars: Some(proto::StarSettings {
            method: scene.stars.method.name().to_owned(),
            magnitude_limit: scene.stars.magnitude_limit,
        }),
        bodies: scene.objects.body_forms(time_s).iter().map(body_to_pb).collect(),
        asteroid_fields: scene.objects.field_specs().iter().map(field_to_pb).collect(),
        time: time_to_pb(time_s),
        time_j2000_s: Some(time_s),
        time_rate: scene.clock.rate,
        time_told: Some(time.told(now).into()),
        observer: scene.objects.observer().map(observer_to_pb),
        asteroids: Some(proto::AsteroidSettings {
            impostor: scene.asteroids.impostor.name().to_owned(),
            quality: scene.asteroids.quality,
        }),
        overlay: Some(overlay_to_pb(&scene.objects.drawn.overlay)),
    }
}

/// Returns a star method by name; the error lists the names.
pub(crate) fn star_method(name: &str) -> Result<StarMethod, String> {
    StarMethod::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = StarMethod::ALL.iter().map(|method| method.name()).collect();
        format!("unknown star method `{name}`: must be one of {}", names.join(", "))
    })
}

/// Returns an impostor method by name; the error lists the names.
fn impostor(name: &str) -> Result<ImpostorMethod, String> {
    ImpostorMethod::from_name(name).ok_or_else(|| {
        let names = ImpostorMethod::ALL.map(ImpostorMethod::name).join(", ");
        format!("asteroids.impostor: unknown method `{name}`: must be one of {names}")
    })
}

/// Maximum number of fields in an update mask.
const MOST_PATHS: usize = 1024;

/// Reads the fields that the mask names; the error states the problem and the valid values.
pub(crate) fn scene_update_from_pb(request: &proto::UpdateSceneRequest) -> Result<SceneUpdate, String> {
    const ALLOWED: &str = "allowed are stars, stars.method, stars.magnitude_limit, time, time_j2000_s, time_rate, asteroids, \
                           asteroids.impostor, asteroids.quality, bodies, bodies.NAME, asteroid_fields, asteroid_fields.NAME, overlay, \
                           overlay.grids, overlay.trajectories, overlay.trajectories.NAME, overlay.labels, \
                           overlay.labels.NAME, overlay.pictures, overlay.pictures.NAME, overlay.cardinal_points, overlay.test_patterns, \
                           observer and observer.KEY";
    let paths = request.update_mask.as_ref().map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() {
        return Err(format!("update_mask names no field: {ALLOWED}"));
    }
    if paths.len() > MOST_PATHS {
        return Err(format!("update_mask names {} fields: there must be at most {MOST_PATHS}", paths.len()));
    }
    let scene = request.scene.clone().unwrap_or_default();
    let (stars, asteroids) = (scene.stars.unwrap_or_default(), scene.asteroids.unwrap_or_default());
    let mut update = SceneUpdate::default();
    for path in paths {
        let below = |list: &str| path.strip_prefix(list).filter(|rest| rest.is_empty() || rest.starts_with('.'));
        if let Some(rest) = below("bodies") {
            add_change(&mut update.bodies, "bodies", rest, &scene.bodies, |body| &body.name, body_from_pb)?;
            continue;
        }
        if let Some(rest) = below("asteroid_fields") {
            let (change, given) = (&mut update.asteroid_fields, &scene.asteroid_fields);
            add_change(change, "asteroid_fields", rest, given, |field| &field.name, field_from_pb)?;
            continue;
        }
        if let Some(rest) = below("overlay")
            && add_overlay_change(&mut update.overlay, rest, scene.overlay.as_ref())?
        {
            continue;
        }
        if let Some(rest) = below("observer") {
            add_observer_change(&mut update.observer, rest, scene.observer.as_ref())?;
            continue;
        }
        let names = |whole: &str, part: &str| path == whole || path.strip_prefix(whole) == Some(part);
        let known = ["stars", "stars.method", "stars.magnitude_limit", "time", "time_j2000_s", "time_rate"];
        let known = known.into_iter().chain(["asteroids", "asteroids.impostor", "asteroids.quality"]);
        if matches!(path.as_str(), "revision" | "catalogues") {
            return Err(format!("update_mask: `{path}` cannot be changed: {ALLOWED}"));
        }
        if !known.into_iter().any(|known| known == path) {
            return Err(format!("update_mask: no field `{path}`: {ALLOWED}"));
        }
        if names("stars", ".method") {
            let method = star_method(&stars.method).map_err(|problem| format!("stars.method: {problem}"))?;
            update.star_method = Some(method);
        }
        if names("stars", ".magnitude_limit") {
            let [least, most] = crate::plan::settings::MAGNITUDES;
            if !(least..=most).contains(&stars.magnitude_limit) {
                let allowed = format!("must be a magnitude between {least} and {most}");
                return Err(format!("stars.magnitude_limit = {}: {allowed}", stars.magnitude_limit));
            }
            update.magnitude_limit = Some(stars.magnitude_limit);
        }
        if path == "time" || path == "time_j2000_s" {
            let is_other = |other: &String| other != path && (other == "time" || other == "time_j2000_s");
            if paths.iter().any(is_other) {
                return Err("update_mask: time and time_j2000_s set the same value: name only one of them".to_owned());
            }
            let stamped = path == "time";
            let time_s = if stamped { time_from_pb(scene.time)? } else { time_from_j2000(scene.time_j2000_s)? };
            update.time_s = Some(time_s);
        }
        if path == "time_rate" {
            let most = SceneClock::MOST_RATE;
            if scene.time_rate.is_nan() || scene.time_rate.abs() > most {
                return Err(format!("time_rate = {}: must be between -{most:e} and {most:e}", scene.time_rate));
            }
            update.time_rate = Some(scene.time_rate);
        }
        if names("asteroids", ".impostor") {
            update.impostor = Some(impostor(&asteroids.impostor)?);
        }
        if names("asteroids", ".quality") {
            AsteroidSettings::check_quality(asteroids.quality)
                .map_err(|(key, problem)| format!("asteroids.{key} = {problem}"))?;
            update.quality = Some(asteroids.quality);
        }
    }
    Ok(update)
}

/// Returns the request for a change.
pub(crate) fn scene_update_to_pb(update: &SceneUpdate, expected_revision: Option<u64>) -> proto::UpdateSceneRequest {
    let named = [
        update.star_method.is_some().then_some("stars.method"),
        update.magnitude_limit.is_some().then_some("stars.magnitude_limit"),
        update.time_s.map(|time_s| if time_to_pb(time_s).is_some() { "time" } else { "time_j2000_s" }),
        update.time_rate.is_some().then_some("time_rate"),
        update.impostor.is_some().then_some("asteroids.impostor"),
        update.quality.is_some().then_some("asteroids.quality"),
    ];
    let (body_paths, bodies) = change_to_pb(&update.bodies, "bodies", body_to_pb);
    let (field_paths, asteroid_fields) = change_to_pb(&update.asteroid_fields, "asteroid_fields", field_to_pb);
    let (overlay_paths, overlay) = overlay_change_to_pb(&update.overlay);
    let paths = named.into_iter().flatten().map(str::to_owned);
    let (observer_paths, observer) = observer_change_to_pb(&update.observer);
    let paths = paths.chain(body_paths).chain(field_paths).chain(overlay_paths).chain(observer_paths).collect();
    let scene = proto::Scene {
        stars: Some(proto::StarSettings {
            method: update.star_method.map(|method| method.name().to_owned()).unwrap_or_default(),
            magnitude_limit: update.magnitude_limit.unwrap_or_default(),
        }),
        bodies,
        asteroid_fields,
        time: update.time_s.and_then(time_to_pb),
        time_j2000_s: update.time_s,
        time_rate: update.time_rate.unwrap_or_default(),
        asteroids: Some(proto::AsteroidSettings {
            impostor: update.impostor.map(|method| method.name().to_owned()).unwrap_or_default(),
            quality: update.quality.unwrap_or_default(),
        }),
        overlay: Some(overlay),
        observer,
        ..proto::Scene::default()
    };
    proto::UpdateSceneRequest {
        scene: Some(scene),
        update_mask: Some(prost_types::FieldMask { paths }),
        expected_revision,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(method: &str, magnitude_limit: f64, paths: &[&str]) -> proto::UpdateSceneRequest {
        let stars = proto::StarSettings { method: method.to_owned(), magnitude_limit };
        proto::UpdateSceneRequest {
            scene: Some(proto::Scene { stars: Some(stars), ..Default::default() }),
            update_mask: Some(prost_types::FieldMask { paths: paths.iter().map(|path| path.to_string()).collect() }),
            expected_revision: None,
        }
    }

    #[test]
    fn the_mask_selects_the_changed_fields() {
        let update = |paths: &[&str]| scene_update_from_pb(&request("tent", 6.5, paths)).unwrap();
        let (tent, limit) = (Some(StarMethod::Tent), Some(6.5));
        for (paths, star_method, magnitude_limit) in [
            (&["stars"][..], tent, limit),
            (&["stars.method"], tent, None),
            (&["stars.magnitude_limit"], None, limit),
            (&["stars.magnitude_limit", "stars.method"], tent, limit),
        ] {
            let expected = SceneUpdate { star_method, magnitude_limit, ..SceneUpdate::default() };
            assert_eq!(update(paths), expected, "{paths:?}");
        }
        // Values that the mask does not name are ignored.
        assert!(scene_update_from_pb(&request("dots", 6.5, &["stars.magnitude_limit"])).is_ok());
    }

    #[test]
    fn unknown_and_constant_fields_are_refused_with_the_valid_ones() {
        for (method, limit, paths, parts) in [
            ("tent", 6.5, &[][..], &["no field", "stars.magnitude_limit"][..]),
            ("tent", 6.5, &["stars.colour"], &["`stars.colour`", "stars.method"]),
            ("tent", 6.5, &["stars.method", "revision"], &["`revision` cannot be changed"]),
            ("tent", 6.5, &["catalogues"], &["`catalogues` cannot be changed"]),
            ("dots", 6.5, &["stars.method"], &["`dots`", "auto, bspline, tent", "packed_cas"]),
            ("", 6.5, &["stars"], &["unknown star method ``"]),
            ("tent", f64::NAN, &["stars"], &["magnitude_limit = NaN", "between -100 and 100"]),
        ] {
            let problem = scene_update_from_pb(&request(method, limit, paths)).unwrap_err();
            assert!(parts.iter().all(|part| problem.contains(part)), "{problem}");
        }
        let empty = proto::UpdateSceneRequest::default();
        assert!(scene_update_from_pb(&empty).is_err());
    }
}

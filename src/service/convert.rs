//! Between protobuf messages and plain types. Nothing else in the crate sees a generated type.

use std::time::SystemTime;

use glam::{DQuat, DVec3};

use super::{
    convert_objects::{
        add_change, body_from_pb, body_to_pb, change_to_pb, field_from_pb, field_to_pb, time_from_pb, time_to_pb,
    },
    convert_observer::{add_observer_change, observer_change_to_pb, observer_to_pb},
    convert_overlay::{add_overlay_change, overlay_change_to_pb, overlay_to_pb},
    proto,
    render::CameraUpdate,
    scene::{SceneState, SceneUpdate},
    server::SceneCatalogue,
};
use crate::{
    gpu::AdapterReport,
    observer::Frame,
    output::Encoding,
    plan::settings::{AsteroidSettings, ImpostorMethod, StarMethod},
    scene::{Camera, SceneClock},
    verify::{CheckResult, Outcome},
};

pub(super) fn vector_to_pb(v: DVec3) -> proto::Vector3 {
    proto::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(super) fn vector_from_pb(v: proto::Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(super) fn quaternion_from_pb(q: proto::Quaternion) -> [f64; 4] {
    [q.x, q.y, q.z, q.w]
}

pub(super) fn camera_to_pb(camera: &Camera) -> proto::Camera {
    let DQuat { x, y, z, w } = camera.world_from_camera;
    proto::Camera {
        position_m: Some(vector_to_pb(camera.position_m)),
        orientation: Some(proto::Quaternion { x, y, z, w }),
        velocity_c: Some(vector_to_pb(camera.velocity_c)),
        revision: camera.revision,
        holder: String::new(),
        frame: sky_frame_to_pb(camera.frame).into(),
        scene_time: camera.frame.turns().then(|| time_to_pb(camera.as_of_s)),
    }
}

pub(super) fn sky_frame_to_pb(frame: Frame) -> proto::SkyFrame {
    match frame {
        Frame::Icrs => proto::SkyFrame::Icrs,
        Frame::Galactic => proto::SkyFrame::Galactic,
        Frame::Ecliptic => proto::SkyFrame::Ecliptic,
        Frame::Horizon => proto::SkyFrame::Horizon,
        Frame::Sun => proto::SkyFrame::Sun,
        Frame::Mercury => proto::SkyFrame::Mercury,
        Frame::Venus => proto::SkyFrame::Venus,
        Frame::Earth => proto::SkyFrame::Earth,
        Frame::Moon => proto::SkyFrame::Moon,
        Frame::Mars => proto::SkyFrame::Mars,
        Frame::Jupiter => proto::SkyFrame::Jupiter,
        Frame::Saturn => proto::SkyFrame::Saturn,
        Frame::Uranus => proto::SkyFrame::Uranus,
        Frame::Neptune => proto::SkyFrame::Neptune,
        Frame::Io => proto::SkyFrame::Io,
        Frame::Europa => proto::SkyFrame::Europa,
        Frame::Ganymede => proto::SkyFrame::Ganymede,
        Frame::Callisto => proto::SkyFrame::Callisto,
        Frame::Titan => proto::SkyFrame::Titan,
    }
}

/// The axes of a number; `None`: nothing is said. The error lists what is allowed.
pub(super) fn sky_frame_from_pb(frame: i32) -> Result<Option<Frame>, String> {
    match proto::SkyFrame::try_from(frame) {
        Ok(proto::SkyFrame::Unspecified) => Ok(None),
        Ok(proto::SkyFrame::Icrs) => Ok(Some(Frame::Icrs)),
        Ok(proto::SkyFrame::Galactic) => Ok(Some(Frame::Galactic)),
        Ok(proto::SkyFrame::Ecliptic) => Ok(Some(Frame::Ecliptic)),
        Ok(proto::SkyFrame::Horizon) => Ok(Some(Frame::Horizon)),
        Ok(proto::SkyFrame::Sun) => Ok(Some(Frame::Sun)),
        Ok(proto::SkyFrame::Mercury) => Ok(Some(Frame::Mercury)),
        Ok(proto::SkyFrame::Venus) => Ok(Some(Frame::Venus)),
        Ok(proto::SkyFrame::Earth) => Ok(Some(Frame::Earth)),
        Ok(proto::SkyFrame::Moon) => Ok(Some(Frame::Moon)),
        Ok(proto::SkyFrame::Mars) => Ok(Some(Frame::Mars)),
        Ok(proto::SkyFrame::Jupiter) => Ok(Some(Frame::Jupiter)),
        Ok(proto::SkyFrame::Saturn) => Ok(Some(Frame::Saturn)),
        Ok(proto::SkyFrame::Uranus) => Ok(Some(Frame::Uranus)),
        Ok(proto::SkyFrame::Neptune) => Ok(Some(Frame::Neptune)),
        Ok(proto::SkyFrame::Io) => Ok(Some(Frame::Io)),
        Ok(proto::SkyFrame::Europa) => Ok(Some(Frame::Europa)),
        Ok(proto::SkyFrame::Ganymede) => Ok(Some(Frame::Ganymede)),
        Ok(proto::SkyFrame::Callisto) => Ok(Some(Frame::Callisto)),
        Ok(proto::SkyFrame::Titan) => Ok(Some(Frame::Titan)),
        Err(_) => Err(format!(
            "frame = {frame}: allowed are SKY_FRAME_ICRS, SKY_FRAME_GALACTIC, SKY_FRAME_ECLIPTIC, SKY_FRAME_HORIZON and the bodies from SKY_FRAME_SUN to SKY_FRAME_TITAN"
        )),
    }
}

pub(super) fn update_from_pb(request: proto::SetCameraRequest) -> CameraUpdate {
    CameraUpdate {
        position_m: request.position_m.map(vector_from_pb),
        orientation: request.orientation.map(quaternion_from_pb),
        velocity_c: request.velocity_c.map(vector_from_pb),
        frame: None,
    }
}

/// A change that leads to a camera; the error says what is wrong with it.
pub(super) fn camera_update_from_pb(camera: proto::Camera) -> Result<CameraUpdate, String> {
    Ok(CameraUpdate {
        position_m: camera.position_m.map(vector_from_pb),
        orientation: camera.orientation.map(quaternion_from_pb),
        velocity_c: camera.velocity_c.map(vector_from_pb),
        frame: sky_frame_from_pb(camera.frame)?,
    })
}

pub(super) fn update_to_pb(update: &CameraUpdate) -> proto::SetCameraRequest {
    proto::SetCameraRequest {
        position_m: update.position_m.map(|[x, y, z]| proto::Vector3 { x, y, z }),
        orientation: update.orientation.map(|[x, y, z, w]| proto::Quaternion { x, y, z, w }),
        velocity_c: update.velocity_c.map(|[x, y, z]| proto::Vector3 { x, y, z }),
        expected_revision: None,
        look: None,
        frame: update.frame.map_or(proto::SkyFrame::Unspecified, sky_frame_to_pb).into(),
    }
}

pub(super) fn encoding_to_pb(encoding: Encoding) -> proto::Encoding {
    match encoding {
        Encoding::Rgba8 => proto::Encoding::Rgba8,
        Encoding::Png => proto::Encoding::Png,
        Encoding::Jpeg => proto::Encoding::Jpeg,
        Encoding::H264 => proto::Encoding::H264,
        Encoding::Rgb32f => proto::Encoding::Rgb32f,
        Encoding::Exr => proto::Encoding::Exr,
    }
}

/// `None`: the number stands for no encoding.
pub(super) fn encoding_from_pb(encoding: i32) -> Option<Encoding> {
    match proto::Encoding::try_from(encoding).ok()? {
        proto::Encoding::Unspecified => None,
        proto::Encoding::Rgba8 => Some(Encoding::Rgba8),
        proto::Encoding::Png => Some(Encoding::Png),
        proto::Encoding::Jpeg => Some(Encoding::Jpeg),
        proto::Encoding::H264 => Some(Encoding::H264),
        proto::Encoding::Rgb32f => Some(Encoding::Rgb32f),
        proto::Encoding::Exr => Some(Encoding::Exr),
    }
}

pub(super) fn info_to_pb(
    adapter: &AdapterReport,
    stars: u64,
    scene_revision: u64,
    frames_rendered: u64,
) -> proto::Info {
    proto::Info {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        adapter: adapter.adapter.clone(),
        driver: adapter.driver.clone(),
        backend: adapter.backend.clone(),
        device_type: adapter.device_type.clone(),
        features: adapter.features.clone(),
        limits: adapter.limits.iter().cloned().collect(),
        fallbacks: adapter.fallbacks.clone(),
        stars,
        scene_revision,
        frames_rendered,
        headset: None,
    }
}

pub(super) fn scene_to_pb(scene: &SceneState, catalogues: &[SceneCatalogue]) -> proto::Scene {
    let now = SystemTime::now();
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
        asteroid_fields: scene.objects.field_forms().iter().map(field_to_pb).collect(),
        time: Some(time_to_pb(time_s)),
        time_rate: scene.clock.rate,
        time_told: Some(now.into()),
        observer: scene.objects.observer().map(observer_to_pb),
        asteroids: Some(proto::AsteroidSettings {
            impostor: scene.asteroids.impostor.name().to_owned(),
            quality: scene.asteroids.quality,
        }),
        overlay: Some(overlay_to_pb(&scene.objects.drawn.overlay)),
    }
}

/// The star method of a name; the error lists the names.
pub(super) fn star_method(name: &str) -> Result<StarMethod, String> {
    StarMethod::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = StarMethod::ALL.iter().map(|method| method.name()).collect();
        format!("unknown star method `{name}`: allowed are {}", names.join(", "))
    })
}

/// The impostor of a name; the error lists the names.
fn impostor(name: &str) -> Result<ImpostorMethod, String> {
    ImpostorMethod::from_name(name).ok_or_else(|| {
        let names = ImpostorMethod::ALL.map(ImpostorMethod::name).join(", ");
        format!("asteroids.impostor: unknown method `{name}`: allowed are {names}")
    })
}

/// Fields that one change may name.
const MOST_PATHS: usize = 1024;

/// The fields that the mask names; the error tells what is wrong and what is allowed.
pub(super) fn scene_update_from_pb(request: &proto::UpdateSceneRequest) -> Result<SceneUpdate, String> {
    const ALLOWED: &str = "allowed are stars, stars.method, stars.magnitude_limit, time, time_rate, asteroids, \
                           asteroids.impostor, asteroids.quality, bodies, bodies.NAME, asteroid_fields, asteroid_fields.NAME, overlay, \
                           overlay.grids, overlay.trajectories, overlay.trajectories.NAME, overlay.labels, \
                           overlay.labels.NAME, overlay.test_patterns, observer and observer.KEY of what it has";
    let paths = request.update_mask.as_ref().map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() {
        return Err(format!("update_mask names no field: {ALLOWED}"));
    }
    if paths.len() > MOST_PATHS {
        return Err(format!("update_mask names {} fields: at most {MOST_PATHS} are allowed", paths.len()));
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
        let known = ["stars", "stars.method", "stars.magnitude_limit", "time", "time_rate"];
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
            let [least, most] = crate::plan::settings::StarSettings::MAGNITUDES;
            if !(least..=most).contains(&stars.magnitude_limit) {
                let allowed = format!("allowed are magnitudes from {least} to {most}");
                return Err(format!("stars.magnitude_limit = {}: {allowed}", stars.magnitude_limit));
            }
            update.magnitude_limit = Some(stars.magnitude_limit);
        }
        if path == "time" {
            update.time_s = Some(time_from_pb(scene.time)?);
        }
        if path == "time_rate" {
            let most = SceneClock::MOST_RATE;
            if scene.time_rate.is_nan() || scene.time_rate.abs() > most {
                return Err(format!("time_rate = {}: allowed are -{most:e} to {most:e}", scene.time_rate));
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

/// The request that asks for a change.
pub(super) fn scene_update_to_pb(update: &SceneUpdate, expected_revision: Option<u64>) -> proto::UpdateSceneRequest {
    let named = [
        update.star_method.is_some().then_some("stars.method"),
        update.magnitude_limit.is_some().then_some("stars.magnitude_limit"),
        update.time_s.is_some().then_some("time"),
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
        time: update.time_s.map(time_to_pb),
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

pub(super) fn check_to_pb(result: CheckResult) -> proto::VerifyResult {
    use proto::verify_result::Outcome as Wire;
    let outcome = match result.outcome {
        Outcome::Pass => Wire::Pass,
        Outcome::Fail => Wire::Fail,
        Outcome::NotApplicable => Wire::NotApplicable,
    };
    let figure = |figure: crate::verify::Figure| proto::VerifyFigure {
        what: figure.what,
        measured: figure.measured,
        limit: figure.limit,
        unit: figure.unit.to_owned(),
        pass: figure.pass,
    };
    proto::VerifyResult {
        number: result.number.map(u32::from),
        name: result.name.to_owned(),
        group: result.group.to_owned(),
        outcome: outcome.into(),
        figures: result.figures.into_iter().map(figure).collect(),
        message: result.message.unwrap_or_default(),
        seconds: result.seconds,
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
    fn the_mask_decides_what_is_changed() {
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
        // A value that the mask does not name is not looked at.
        assert!(scene_update_from_pb(&request("dots", 6.5, &["stars.magnitude_limit"])).is_ok());
    }

    #[test]
    fn what_cannot_be_changed_is_refused_with_what_can() {
        for (method, limit, paths, parts) in [
            ("tent", 6.5, &[][..], &["no field", "stars.magnitude_limit"][..]),
            ("tent", 6.5, &["stars.colour"], &["`stars.colour`", "stars.method"]),
            ("tent", 6.5, &["stars.method", "revision"], &["`revision` cannot be changed"]),
            ("tent", 6.5, &["catalogues"], &["`catalogues` cannot be changed"]),
            ("dots", 6.5, &["stars.method"], &["`dots`", "auto, bspline, tent", "packed_cas"]),
            ("", 6.5, &["stars"], &["unknown star method ``"]),
            ("tent", f64::NAN, &["stars"], &["magnitude_limit = NaN", "magnitudes from -100 to 100"]),
        ] {
            let problem = scene_update_from_pb(&request(method, limit, paths)).unwrap_err();
            assert!(parts.iter().all(|part| problem.contains(part)), "{problem}");
        }
        let empty = proto::UpdateSceneRequest::default();
        assert!(scene_update_from_pb(&empty).is_err());
    }
}

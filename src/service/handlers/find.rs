//! `Find` returns the direction of a body, star or constellation by name. Also here is the orientation of a camera that looks in a direction or at a
//! named object.

use glam::{DQuat, DVec3};
use tonic::Status;

use super::{identify::star_to_pb, service::Service};
use crate::{
    catalogue::{
        constellations::{self, CONSTELLATIONS, areas_sr, middles},
        names::{self, NamedStar},
    },
    config::{MOST_ABOVE_DEG, MOST_TURN_DEG},
    coordinates::lon_lat_from_direction,
    observer::{Frame, frame_from_camera},
    plan::stars::identify::SeenStar,
    relativity::seen_direction,
    scene::{SceneSnapshot, bodies::Body},
    service::{
        frames::errors::refused,
        proto,
        scene::excerpts::listed,
        wire::{
            camera::{sky_frame_from_pb, vector_to_pb},
            refusals,
        },
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude},
};

/// Maximum length of a name, characters.
const MOST_NAME: usize = 64;
/// Maximum number of suggestions for an unknown name.
const SUGGESTIONS: usize = 8;

/// Returns the message of a body as a camera sees it.
pub(crate) fn body_to_pb(scene: &SceneSnapshot, body: &Body) -> proto::IdentifiedObject {
    let camera = &scene.camera;
    let from_camera_m = body.position_m - camera.position_m;
    let seen_m = scene.objects.seen_m(camera.position_m, from_camera_m);
    proto::IdentifiedObject {
        kind: proto::ObjectKind::Body.into(),
        name: body.name.clone(),
        direction: Some(vector_to_pb(seen_direction(camera.velocity_c, seen_m))),
        distance_m: Some(from_camera_m.length()),
        ..Default::default()
    }
}

fn seen_star(scene: &SceneSnapshot, NamedStar { star, .. }: &NamedStar) -> SeenStar {
    let camera = &scene.camera;
    let from_camera_pc = if star.distance_known { star.position - camera.position_m / PARSEC_M } else { star.position };
    let distance_pc = star.distance_known.then(|| from_camera_pc.length());
    let at_1_pc = f64::from(star.magnitude) - if star.distance_known { 5.0 } else { 0.0 };
    SeenStar {
        position: star.position,
        direction: seen_afar(scene, from_camera_pc),
        separation_rad: 0.0,
        illuminance_lx: illuminance_lx_from_magnitude(at_1_pc)
            / distance_pc.map_or(1.0, |distance| distance * distance),
        temperature_k: f64::from(star.temperature_k),
        distance_pc,
    }
}

/// Returns the message of a constellation by its index in [`CONSTELLATIONS`].
fn constellation_to_pb(scene: &SceneSnapshot, number: usize) -> proto::IdentifiedObject {
    let (name, middle) = middles()[number];
    proto::IdentifiedObject {
        kind: proto::ObjectKind::Constellation.into(),
        name: name.to_owned(),
        direction: Some(vector_to_pb(seen_afar(scene, middle))),
        solid_angle_sr: Some(areas_sr()[number]),
        ..Default::default()
    }
}

/// Returns the apparent direction, for the scene's camera, of a distant object in a direction of any length.
fn seen_afar(scene: &SceneSnapshot, direction: DVec3) -> DVec3 {
    let seen = seen_direction(scene.camera.velocity_c, direction);
    scene.objects.refraction(scene.camera.position_m).map_or(seen, |refraction| refraction.seen(seen))
}

/// Finds an object by name: a body of the scene, a star of the built-in table or of a file by name or designation, or a
/// constellation by name or abbreviation. The error suggests similar names.
fn found(scene: &SceneSnapshot, name: &str) -> Result<proto::IdentifiedObject, String> {
    if let Some(body) = scene.objects.bodies.iter().find(|body| names::is_same(&body.name, name)) {
        return Ok(body_to_pb(scene, body));
    }
    let named = scene.stars.named();
    if let Some(star) = names::find(named.iter(), name) {
        return Ok(star_to_pb(&seen_star(scene, star), &scene.stars));
    }
    if let Some(number) = constellations::find(name) {
        return Ok(constellation_to_pb(scene, number));
    }
    if let Some(why) = names::why_no_number(named.iter(), name) {
        return Err(format!("there is no `{name}`: {why}"));
    }
    let start: String = name.to_lowercase().chars().take(2).collect();
    let of_bodies = scene.objects.bodies.iter().map(|body| &body.name[..]);
    let near = of_bodies.chain(named.iter().map(|star| star.name.as_ref())).chain(CONSTELLATIONS.map(|(_, full)| full));
    let near: Vec<&str> =
        near.filter(|name| !name.is_empty() && name.to_lowercase().starts_with(&start)).take(SUGGESTIONS).collect();
    let near = if near.is_empty() { String::new() } else { format!("; similar names: {}", listed(near)) };
    Err(format!("there is no body of the scene, no star and no constellation `{name}`{near}"))
}

fn checked_name(name: &str, key: &str) -> Result<(), String> {
    match name.chars().count() {
        0 => Err(format!("{key}: missing")),
        count if count > MOST_NAME => Err(format!("{key}: must have at most {MOST_NAME} characters")),
        _ => Ok(()),
    }
}

/// Returns the orientation of a camera that looks as requested, from camera axes to ICRS axes, and its new reference frame.
pub(crate) fn turned(look: &proto::Look, scene: &SceneSnapshot) -> Result<(DQuat, Frame), String> {
    let prefixed = |problem: String| format!("look.{problem}");
    let frame = sky_frame_from_pb(look.frame).map_err(prefixed)?.unwrap_or(scene.camera.frame);
    let Some(icrs_from_frame) = scene.objects.icrs_from(frame) else {
        return Err(prefixed("frame: SKY_FRAME_HORIZON: the scene has no observer".to_owned()));
    };
    let proto::Look { longitude_deg, latitude_deg, roll_deg, above_deg, .. } = *look;
    for (key, value) in [
        ("longitude_deg", longitude_deg),
        ("latitude_deg", latitude_deg),
        ("roll_deg", roll_deg),
        ("above_deg", above_deg),
    ] {
        if !value.is_finite() {
            return Err(prefixed(format!("{key} = {value}: must be a finite number")));
        }
    }
    for (key, value, most) in [
        ("longitude_deg", longitude_deg, MOST_TURN_DEG),
        ("roll_deg", roll_deg, MOST_TURN_DEG),
        ("above_deg", above_deg, MOST_ABOVE_DEG),
    ] {
        if value.abs() > most {
            return Err(prefixed(format!("{key} = {value}: must be between -{most} and {most}")));
        }
    }
    let (longitude_rad, latitude_rad) = if look.at.is_empty() {
        if latitude_deg.abs() > 90.0 {
            return Err(prefixed(format!("latitude_deg = {latitude_deg}: must be between -90 and 90")));
        }
        (frame.longitude_rad(longitude_deg), latitude_deg.to_radians())
    } else {
        if (longitude_deg, latitude_deg) != (0.0, 0.0) {
            return Err(prefixed(
                "at: must not be combined with a direction: exactly one of them is needed".to_owned(),
            ));
        }
        checked_name(&look.at, "at").map_err(prefixed)?;
        let object = found(scene, &look.at).map_err(|problem| prefixed(format!("at: {problem}")))?;
        let direction = object.direction.map(|v| DVec3::new(v.x, v.y, v.z)).unwrap_or_default();
        if direction == DVec3::ZERO {
            return Err(prefixed(format!("at: the camera is at the centre of `{}`", look.at)));
        }
        lon_lat_from_direction(icrs_from_frame.transpose() * direction)
    };
    let at_it = frame_from_camera(longitude_rad, latitude_rad, roll_deg.to_radians());
    let from_camera = at_it * DQuat::from_rotation_x(-above_deg.to_radians());
    Ok(((DQuat::from_mat3(&icrs_from_frame) * from_camera).normalize(), frame))
}

impl Service {
    pub(crate) fn found(&self, request: &proto::FindRequest) -> Result<proto::FindResponse, Status> {
        checked_name(&request.name, "name").map_err(refusals::invalid)?;
        let state = self.render.scene().map_err(refused)?;
        let scene = self.render.snapshot(&state);
        let object = found(&scene, &request.name).map_err(|problem| Status::not_found(format!("name: {problem}")))?;
        Ok(proto::FindResponse {
            object: Some(object),
            camera_revision: scene.camera.revision,
            scene_revision: scene.revision,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        catalogue::{chunks::StarSet, names::StarNames},
        observer::{Clock, Observer, Place, RefractingAir, horizontal_direction},
        scene::{Camera, SceneObjects, bodies::SolarBody, surroundings::Surroundings},
        service::handlers::identify,
    };

    fn scene() -> SceneSnapshot {
        let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 100.0 };
        let time_s = 8.2e8;
        let observer = Observer::new(place, Clock::default(), time_s);
        let mut mars = Body::preset(SolarBody::Mars, "mars", DVec3::ZERO);
        mars.ephemeris = Some(SolarBody::Mars.into());
        let probe = Body::preset(SolarBody::Mars, "Barnard's probe", DVec3::splat(1e12));
        let bodies = vec![Arc::new(mars), Arc::new(probe)];
        let objects = SceneObjects { bodies, time_s, observer: Some(observer), ..Default::default() };
        let stars = StarSet::default().of_epoch(observer.epoch.of_stars());
        let camera = Camera { position_m: observer.epoch.position_m, ..Camera::default() };
        SceneSnapshot { objects: Arc::new(objects.placed()), camera, ..SceneSnapshot::of_stars(stars) }
    }

    #[test]
    fn bodies_and_stars_are_found_by_any_name_and_similar_names_are_suggested() {
        let scene = scene();
        let direction = |name: &str| {
            let direction = found(&scene, name).unwrap().direction.unwrap();
            DVec3::new(direction.x, direction.y, direction.z)
        };
        let standpoint = scene.objects.observer.unwrap().epoch;
        assert!(direction("Mars").angle_between(standpoint.apparent_m(SolarBody::Mars)) < 1e-9);
        assert_eq!(direction("sirius"), direction("alf CMa"));
        assert_eq!(direction("R Leo"), direction("HR 3882"));
        assert_eq!(direction("Barnard\u{2019}s probe"), direction("barnard's probe"));
        let sirius = found(&scene, "Sirius").unwrap();
        assert!((sirius.v_mag.unwrap() + 1.46).abs() < 0.01 && sirius.name == "Sirius");
        let problem = found(&scene, "Sirus").unwrap_err();
        assert!(problem.contains("Sirius"), "{problem}");
        let problem = found(&scene, "HIP 32349").unwrap_err();
        assert!(problem.contains("no HIP numbers") && problem.contains("HR numbers"), "{problem}");
        assert!(found(&scene, "zzz").unwrap_err().ends_with("`zzz`"));
    }

    /// A star of a file must be found where it is drawn, even if the built-in star of the same name is elsewhere.
    #[test]
    fn stars_of_files_come_before_built_in_ones() {
        let mut star = scene().stars.named().iter().find(|named| named.name == "Sirius").unwrap().star;
        let mut scene = scene();
        star.position = DVec3::Z * 2.6;
        let names = StarNames { name: "Sirius".to_owned(), designations: vec!["HIP 32349".to_owned()] };
        let of_file = vec![NamedStar::from_file(names, star)];
        scene.stars = Arc::new(StarSet::clone(&scene.stars).with_names(of_file));
        for name in ["Sirius", "HIP 32349"] {
            let direction = found(&scene, name).unwrap().direction.unwrap();
            assert!(DVec3::new(direction.x, direction.y, direction.z).angle_between(DVec3::Z) < 0.02, "{name}");
        }
        let built_in = found(&scene, "alf CMa").unwrap().direction.unwrap();
        assert!(built_in.z < 0.0, "the built-in table is still there");
    }

    #[test]
    fn a_look_points_in_a_direction_of_its_frame_or_at_a_name() {
        let scene = scene();
        let look = |look: proto::Look| turned(&look, &scene);
        let horizon = proto::SkyFrame::Horizon.into();
        let (east, frame) = look(proto::Look { frame: horizon, longitude_deg: 90.0, ..Default::default() }).unwrap();
        let standpoint = scene.objects.observer.unwrap().epoch;
        assert_eq!(frame, Frame::Horizon);
        assert!((east * DVec3::NEG_Z - standpoint.icrs_from_horizon * DVec3::X).length() < 1e-12);
        assert!((east * DVec3::Y - standpoint.icrs_from_horizon * DVec3::Y).length() < 1e-12, "the zenith is up");
        let raised = proto::Look { frame: horizon, longitude_deg: 90.0, above_deg: 30.0, ..Default::default() };
        let ahead = look(raised).unwrap().0.inverse() * (standpoint.icrs_from_horizon * DVec3::X);
        assert!((ahead - DVec3::new(0.0, 0.5, -(0.75_f64.sqrt()))).length() < 1e-12, "30 degrees up: {ahead}");
        let (mars, _) = look(proto::Look { at: "Mars".to_owned(), ..Default::default() }).unwrap();
        assert!((mars * DVec3::NEG_Z).angle_between(standpoint.apparent_m(SolarBody::Mars)) < 1e-7);
        for (wrong, part) in [
            (proto::Look { frame: 9, ..Default::default() }, "look.frame"),
            (proto::Look { latitude_deg: 91.0, ..Default::default() }, "between -90 and 90"),
            (proto::Look { roll_deg: f64::NAN, ..Default::default() }, "look.roll_deg"),
            (proto::Look { above_deg: f64::NAN, ..Default::default() }, "look.above_deg"),
            (proto::Look { at: "Mars".to_owned(), latitude_deg: 1.0, ..Default::default() }, "exactly one"),
            (proto::Look { above_deg: 1e300, ..Default::default() }, "look.above_deg = 1"),
            (proto::Look { above_deg: -180.5, ..Default::default() }, "between -180 and 180"),
            (
                proto::Look { roll_deg: 361.0, ..Default::default() },
                "look.roll_deg = 361: must be between -360 and 360",
            ),
            (proto::Look { longitude_deg: -1e300, ..Default::default() }, "look.longitude_deg = -1"),
            (proto::Look { at: "x".repeat(65), ..Default::default() }, "look.at: must have at most 64 characters"),
            (proto::Look { at: "nowhere".to_owned(), ..Default::default() }, "no constellation `nowhere`"),
        ] {
            let problem = look(wrong).unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
        let mut without = scene.clone();
        without.objects = Arc::default();
        let problem = turned(&proto::Look { frame: horizon, ..Default::default() }, &without).unwrap_err();
        assert!(problem.contains("no observer"), "{problem}");
    }

    #[test]
    fn low_objects_are_found_at_their_refracted_place() {
        let mut scene = scene();
        let mut objects = (*scene.objects).clone();
        let up = objects.observer.unwrap().epoch.icrs_from_horizon * horizontal_direction(1.0, 2_f64.to_radians());
        let mars =
            |distance_m| Arc::new(Body::preset(SolarBody::Mars, "mars", scene.camera.position_m + up * distance_m));
        let air = RefractingAir { pressure_hpa: 1010.0, temperature_c: 10.0 };
        objects.surroundings = Some(Arc::new(Surroundings { air: None, refraction: Some(air), ground: None }));
        let found_at = |scene: &SceneSnapshot| {
            let direction = found(scene, "mars").unwrap().direction.unwrap();
            DVec3::new(direction.x, direction.y, direction.z)
        };
        objects.bodies = vec![mars(1e11)];
        scene.objects = Arc::new(objects.clone());
        let lifted_arcmin = found_at(&scene).angle_between(up).to_degrees() * 60.0;
        // Bennett's formula gives 17.0 at 2.28 degrees.
        assert!((lifted_arcmin - 17.0).abs() < 0.05, "{lifted_arcmin}");
        let look = proto::Look { at: "mars".to_owned(), ..Default::default() };
        let (turned, _) = turned(&look, &scene).unwrap();
        assert!((turned * DVec3::NEG_Z).angle_between(found_at(&scene)) < 1e-7);
        // Identify finds the body at its refracted place only.
        let names_at = |direction: DVec3| identify::body_names(&scene, direction, 1e-4);
        assert_eq!((names_at(found_at(&scene)), names_at(up)), (vec!["mars".to_owned()], Vec::new()));
        // Within the atmosphere, the body appears at its geometric direction.
        objects.bodies = vec![Arc::new(Body { radii_m: DVec3::splat(1.0), ..(*mars(1e4)).clone() })];
        scene.objects = Arc::new(objects);
        assert!(found_at(&scene).angle_between(up) < 1e-9);
    }
}

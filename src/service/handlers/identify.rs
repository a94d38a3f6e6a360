//! `Identify` returns the objects in a direction.

use std::sync::Arc;

use glam::DVec3;
use tokio::task;
use tonic::Status;

use super::{find::body_to_pb, service::Service};
use crate::{
    catalogue::{chunks::StarSet, constellations::constellation_of, deep::DeepError, names::NamedStar},
    plan::stars::identify::{MOST_RADIUS_RAD, SeenStar, stars_near},
    relativity::seen_direction,
    scene::{
        Camera, SceneSnapshot,
        bodies::{Body, Ephemeris, SolarBody},
    },
    service::{
        frames::errors::refused,
        network::clients::ClientInfo,
        proto, threads,
        wire::{
            camera::{vector_from_pb, vector_to_pb},
            refusals,
        },
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
};

/// Default and maximum search radius, degrees.
const RADIUS_DEG: f64 = 0.5;
const MOST_RADIUS_DEG: f64 = 10.0;
const _: () = assert!(MOST_RADIUS_DEG / 180.0 * std::f64::consts::PI < MOST_RADIUS_RAD);
/// Default and maximum number of objects.
const OBJECTS: u32 = 8;
const MOST_OBJECTS: u32 = 64;
/// Two stars of catalogues count as the same star if the relative difference of their distances is below this.
const SAME_PLACE: f64 = 1e-5;

/// A validated request.
struct Question {
    direction: DVec3,
    radius_rad: f64,
    most: usize,
}

impl Question {
    fn new(request: &proto::IdentifyRequest) -> Result<Self, Status> {
        let wrong = |problem: String| Err(refusals::invalid(problem));
        let Some(direction) = request.direction.map(|direction| DVec3::from_array(vector_from_pb(direction))) else {
            return wrong("direction: missing".to_owned());
        };
        // Directions are correct even for vectors whose square overflows or underflows f64.
        let largest = direction.abs().max_element();
        let Some(direction) = (direction / largest).try_normalize().filter(|_| direction.is_finite()) else {
            return wrong(format!("direction = {direction}: must be a finite vector that is not 0"));
        };
        let radius_deg = if request.radius_deg == 0.0 { RADIUS_DEG } else { request.radius_deg };
        if !(radius_deg > 0.0 && radius_deg <= MOST_RADIUS_DEG) {
            return wrong(format!(
                "radius_deg = {radius_deg}: must be at most {MOST_RADIUS_DEG}, or 0 for {RADIUS_DEG}"
            ));
        }
        if request.most > MOST_OBJECTS {
            return wrong(format!("most = {}: must be at most {MOST_OBJECTS}, or 0 for {OBJECTS}", request.most));
        }
        let most = if request.most == 0 { OBJECTS } else { request.most } as usize;
        Ok(Self { direction, radius_rad: radius_deg.to_radians(), most })
    }
}

/// Returns the distance along a unit direction from a camera to a body, m; `None` if the ray misses it.
fn distance_m(camera: &Camera, body: &Body, time_s: f64, direction: DVec3) -> Option<f64> {
    let body_from_world = body.world_from_body(time_s).conjugate();
    // In units of its semi-axes, a body is a sphere of radius 1.
    let from = body_from_world * (camera.position_m - body.position_m) / body.radii_m;
    let step = body_from_world * direction / body.radii_m;
    let [a, half_b, c] = [step.length_squared(), step.dot(from), from.length_squared() - 1.0];
    let root = (half_b * half_b - a * c).sqrt();
    // This comparison excludes NaN. A camera inside of the body sees the far side.
    [(-half_b - root) / a, (-half_b + root) / a].into_iter().find(|distance| *distance > 0.0)
}

/// Bodies in a direction or near it.
enum Bodies {
    /// Bodies that cover the direction, nearest first. They hide everything behind them.
    Cover(Vec<proto::IdentifiedObject>),
    /// Bodies within the search radius, nearest to the direction first; moons follow their planet.
    Nearby(Vec<proto::IdentifiedObject>),
}

fn bodies(scene: &SceneSnapshot, question: &Question) -> Bodies {
    let Camera { position_m, velocity_c, .. } = scene.camera;
    // Light from the given apparent direction was emitted in this direction.
    let refraction = scene.objects.refraction(position_m);
    let without_air = |seen: DVec3| refraction.map_or(seen, |refraction| refraction.arriving(seen));
    let rest = seen_direction(-velocity_c, without_air(question.direction));
    let mut found: Vec<(f64, &Body)> = scene
        .objects
        .bodies
        .iter()
        .filter_map(|body| Some((distance_m(&scene.camera, body, scene.objects.time_s, rest)?, body.as_ref())))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let message = |separation_rad: f64, distance_m: f64, body: &Body| proto::IdentifiedObject {
        separation_deg: separation_rad.to_degrees(),
        distance_m: Some(distance_m),
        ..body_to_pb(scene, body)
    };
    if scene.objects.local_sky(position_m).is_some_and(|sky| sky.hides(question.direction)) {
        // The ground hides everything behind it.
        return Bodies::Cover(Vec::new());
    }
    if !found.is_empty() {
        return Bodies::Cover(found.into_iter().map(|(distance_m, body)| message(0.0, distance_m, body)).collect());
    }
    // A planet may be smaller than a pixel, so a click may miss its disc.
    let nearby: Vec<NearbyBody> = scene
        .objects
        .bodies
        .iter()
        .map(|body| {
            let distance_m = (body.position_m - position_m).length();
            let radius_rad = body.angular_radius_rad(position_m);
            let seen_m = scene.objects.seen_m(position_m, body.position_m - position_m);
            let direction = seen_direction(velocity_c, seen_m);
            let separation_rad = direction.angle_between(question.direction);
            let solar_body = body.ephemeris.and_then(Ephemeris::stands_as);
            NearbyBody {
                solar_body,
                direction,
                off_rad: separation_rad - radius_rad,
                message: message(separation_rad, distance_m, body),
            }
        })
        .filter(|nearby| nearby.off_rad <= question.radius_rad)
        .collect();
    Bodies::Nearby(in_order(nearby, question.radius_rad))
}

/// A body near the requested direction.
struct NearbyBody {
    /// The body of the Solar System whose position it has.
    solar_body: Option<SolarBody>,
    direction: DVec3,
    /// Angle between the direction and its limb, rad.
    off_rad: f64,
    message: proto::IdentifiedObject,
}

/// Sorts by distance from the direction; moons that are not separated from their planet within the radius follow it.
fn in_order(nearby: Vec<NearbyBody>, radius_rad: f64) -> Vec<proto::IdentifiedObject> {
    let key = |body: &NearbyBody| {
        let planet = body.solar_body.and_then(SolarBody::planet);
        let is_planet = |other: &&NearbyBody| {
            planet.is_some() && other.solar_body == planet && other.direction.angle_between(body.direction) < radius_rad
        };
        nearby.iter().find(is_planet).map_or((body.off_rad, -1.0), |planet| (planet.off_rad, body.off_rad))
    };
    let keys: Vec<(f64, f64)> = nearby.iter().map(key).collect();
    let mut found: Vec<_> = keys.into_iter().zip(nearby.into_iter().map(|body| body.message)).collect();
    found.sort_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    found.into_iter().map(|(_, message)| message).collect()
}

/// Returns the star of the built-in table at a place.
fn named<'a>(star: &SeenStar, stars: &'a StarSet) -> Option<&'a NamedStar> {
    let is_known = star.distance_pc.is_some();
    let named = stars.named().iter().filter(|named| named.star.distance_known == is_known);
    // If several stars are at one place, choose the one that is most similar in brightness.
    let off = |named: &NamedStar| named.star.position.distance(star.position) / named.star.position.length();
    let at_1_pc = magnitude_from_illuminance_lx(star.illuminance_lx * star.distance_pc.map_or(1.0, |pc| pc * pc));
    let unlike = |named: &NamedStar| {
        let magnitude = f64::from(named.star.magnitude) - if named.star.distance_known { 5.0 } else { 0.0 };
        (magnitude - at_1_pc).abs()
    };
    // Distances are rounded to a tenth of [`SAME_PLACE`], so that similar ones are equal.
    let key = |named: &NamedStar| ((10.0 * off(named) / SAME_PLACE).round(), unlike(named));
    let there = named.filter(|named| off(named) < SAME_PLACE).map(|named| (key(named), named));
    there.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, named)| named)
}

pub(crate) fn star_to_pb(star: &SeenStar, stars: &StarSet) -> proto::IdentifiedObject {
    let named = named(star, stars);
    proto::IdentifiedObject {
        kind: proto::ObjectKind::Star.into(),
        name: named.map(|named| named.name.to_string()).unwrap_or_default(),
        designation: named.map(|named| named.designation.to_string()).unwrap_or_default(),
        direction: Some(vector_to_pb(star.direction)),
        separation_deg: star.separation_rad.to_degrees(),
        v_mag: Some(magnitude_from_illuminance_lx(star.illuminance_lx)),
        temperature_k: Some(star.temperature_k),
        distance_m: star.distance_pc.map(|distance| distance * PARSEC_M),
        solid_angle_sr: None,
    }
}

impl Service {
    pub(crate) async fn identified(
        &self,
        client: &ClientInfo,
        request: &proto::IdentifyRequest,
    ) -> Result<proto::IdentifyResponse, Status> {
        let question = Question::new(request)?;
        let own = client.search()?;
        let place = Arc::clone(&self.looking)
            .try_acquire_owned()
            .map_err(|_| refusals::exhausted("searches", "too many Identify calls are running: try again later"))?;
        let state = self.render.scene().map_err(refused)?;
        let scene = self.render.snapshot(&state);
        let faintest_lx = illuminance_lx_from_magnitude(state.stars.magnitude_limit);
        let looking = move || -> Result<_, DeepError> {
            let _places = [own, place];
            let SceneSnapshot { stars, camera, .. } = &scene;
            let Question { direction, radius_rad, most } = question;
            let refraction = scene.objects.refraction(camera.position_m);
            let mut objects = match bodies(&scene, &question) {
                Bodies::Cover(objects) => objects,
                Bodies::Nearby(mut objects) => {
                    let found = threads::on_own_cores(|| {
                        stars_near(stars, (camera, refraction), direction, radius_rad, faintest_lx, most)
                    })?;
                    objects.extend(found.iter().map(|star| star_to_pb(star, stars)));
                    objects
                }
            };
            objects.truncate(most);
            let (camera_revision, scene_revision) = (camera.revision, scene.revision);
            let (_, constellation) =
                constellation_of(refraction.map_or(direction, |refraction| refraction.arriving(direction)));
            let constellation = constellation.to_owned();
            Ok(proto::IdentifyResponse { objects, camera_revision, scene_revision, constellation })
        };
        let found = task::spawn_blocking(looking).await;
        let found = found.map_err(|error| Status::internal(format!("the search failed: {error}")))?;
        found.map_err(|error| Status::data_loss(error.to_string()))
    }
}

/// Returns the names of the bodies in a direction or within an angle of it, rad.
#[cfg(test)]
pub(crate) fn body_names(scene: &SceneSnapshot, direction: DVec3, radius_rad: f64) -> Vec<String> {
    match bodies(scene, &Question { direction, radius_rad, most: 8 }) {
        Bodies::Cover(objects) | Bodies::Nearby(objects) => objects.into_iter().map(|object| object.name).collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_found_exactly_where_it_covers_the_sky() {
        let mut mars = Body::preset(SolarBody::Mars, "mars", DVec3::X * 1e9);
        mars.radii_m = DVec3::new(1e7, 2e7, 3e7);
        let camera = Camera::default();
        let hit = |direction: DVec3| distance_m(&camera, &mars, 0.0, direction.normalize());
        let along_x = mars.world_from_body(0.0).conjugate() * DVec3::X;
        // Support function of the ellipsoid along the line of sight.
        let front = 1.0 / (along_x / mars.radii_m).length();
        assert!((hit(DVec3::X).unwrap() - (1e9 - front)).abs() < 1e-3 * front);
        assert_eq!(hit(DVec3::NEG_X), None);
        assert_eq!(hit(DVec3::new(1.0, 0.031, 0.0)), None);
        let inside = Camera { position_m: DVec3::X * 1e9, ..camera };
        assert!((distance_m(&inside, &mars, 0.0, DVec3::X).unwrap() - front).abs() < 1e-3 * front);
    }

    #[test]
    fn questions_are_judged() {
        let ask = |direction: [f64; 3], radius_deg, most| {
            let direction = Some(vector_to_pb(DVec3::from_array(direction)));
            Question::new(&proto::IdentifyRequest { direction, radius_deg, most })
        };
        let question = ask([0.0, 0.0, 1e-300], 0.0, 0).unwrap();
        assert_eq!((question.direction, question.radius_rad, question.most), (DVec3::Z, 0.5_f64.to_radians(), 8));
        assert_eq!(ask([1e300, 0.0, 0.0], 10.0, 64).unwrap().direction, DVec3::X);
        for (direction, radius_deg, most, part) in [
            ([0.0; 3], 0.0, 0, "not 0"),
            ([f64::NAN, 0.0, 1.0], 0.0, 0, "direction"),
            ([f64::INFINITY, 0.0, 1.0], 0.0, 0, "direction"),
            ([1.0, 0.0, 0.0], 10.1, 0, "radius_deg"),
            ([1.0, 0.0, 0.0], -1.0, 0, "radius_deg"),
            ([1.0, 0.0, 0.0], f64::NAN, 0, "radius_deg"),
            ([1.0, 0.0, 0.0], 1.0, 65, "most"),
        ] {
            let status = ask(direction, radius_deg, most).err().unwrap();
            assert!(status.message().contains(part), "{status}");
        }
        assert!(Question::new(&proto::IdentifyRequest::default()).is_err());
    }

    #[test]
    fn moons_close_to_their_planet_come_after_it() {
        let nearby = |name: &str, solar_body: SolarBody, angle_rad: f64| NearbyBody {
            solar_body: Some(solar_body),
            direction: DVec3::new(angle_rad.sin(), 0.0, angle_rad.cos()),
            off_rad: (angle_rad - 0.01).abs(),
            message: proto::IdentifiedObject { name: name.to_owned(), ..Default::default() },
        };
        let names = |radius_rad: f64| {
            let bodies = vec![
                nearby("io", SolarBody::Io, 0.01),
                nearby("mars", SolarBody::Mars, 0.013),
                nearby("jupiter", SolarBody::Jupiter, 0.012),
                nearby("titan", SolarBody::Titan, 0.0105),
            ];
            in_order(bodies, radius_rad).into_iter().map(|object| object.name).collect::<Vec<_>>()
        };
        assert_eq!(names(0.001), ["io", "titan", "jupiter", "mars"]);
        assert_eq!(names(0.003), ["titan", "jupiter", "io", "mars"]);
    }
}

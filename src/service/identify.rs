//! `Identify`: what stands in a direction.

use std::sync::Arc;

use glam::DVec3;
use tokio::task;
use tonic::Status;

use super::{
    background,
    convert::{vector_from_pb, vector_to_pb},
    find::body_to_pb,
    handlers::{Service, refused},
    proto, refusals,
};
use crate::{
    catalogue::{bright::BrightStar, chunks::StarSet, constellations::constellation_of},
    plan::stars::identify::{MOST_RADIUS_RAD, SeenStar, stars_near},
    relativity::seen_direction,
    scene::{
        Camera, SceneSnapshot,
        bodies::{Body, Ephemeris, SolarBody},
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
};

/// What is looked through where nothing is said, and at most, degrees.
const RADIUS_DEG: f64 = 0.5;
const MOST_RADIUS_DEG: f64 = 10.0;
const _: () = assert!(MOST_RADIUS_DEG / 180.0 * std::f64::consts::PI < MOST_RADIUS_RAD);
/// How many objects are told where nothing is said, and at most.
const OBJECTS: u32 = 8;
const MOST_OBJECTS: u32 = 64;
/// Part of a distance within which two stars of catalogues are the same one.
const SAME_PLACE: f64 = 1e-5;

/// What is asked for, after it was judged.
struct Question {
    direction: DVec3,
    radius_rad: f64,
    most: usize,
}

impl Question {
    fn new(request: &proto::IdentifyRequest) -> Result<Self, Status> {
        let wrong = |problem: String| Err(refusals::invalid(problem));
        let Some(direction) = request.direction.map(|direction| DVec3::from_array(vector_from_pb(direction))) else {
            return wrong("direction: it is missing".to_owned());
        };
        // Of a vector whose square is too large or too small for f64 the direction is not lost.
        let largest = direction.abs().max_element();
        let Some(direction) = (direction / largest).try_normalize().filter(|_| direction.is_finite()) else {
            return wrong(format!("direction = {direction}: needed is a finite vector that is not 0"));
        };
        let radius_deg = if request.radius_deg == 0.0 { RADIUS_DEG } else { request.radius_deg };
        if !(radius_deg > 0.0 && radius_deg <= MOST_RADIUS_DEG) {
            return wrong(format!(
                "radius_deg = {radius_deg}: allowed is up to {MOST_RADIUS_DEG}, and 0 for {RADIUS_DEG}"
            ));
        }
        if request.most > MOST_OBJECTS {
            return wrong(format!("most = {}: allowed is up to {MOST_OBJECTS}, and 0 for {OBJECTS}", request.most));
        }
        let most = if request.most == 0 { OBJECTS } else { request.most } as usize;
        Ok(Self { direction, radius_rad: radius_deg.to_radians(), most })
    }
}

/// Distance along a unit direction from a camera to a body, m; `None`: it is not there.
fn distance_m(camera: &Camera, body: &Body, time_s: f64, direction: DVec3) -> Option<f64> {
    let body_from_world = body.world_from_body(time_s).conjugate();
    // In units of the semi-axes a body is a sphere of radius 1.
    let from = body_from_world * (camera.position_m - body.position_m) / body.radii_m;
    let step = body_from_world * direction / body.radii_m;
    let [a, half_b, c] = [step.length_squared(), step.dot(from), from.length_squared() - 1.0];
    let root = (half_b * half_b - a * c).sqrt();
    // NaN is no number above 0; who stands inside sees the far side.
    [(-half_b - root) / a, (-half_b + root) / a].into_iter().find(|distance| *distance > 0.0)
}

/// The bodies in a direction.
enum Bodies {
    /// They cover it, the nearest first: nothing is seen through them.
    Cover(Vec<proto::IdentifiedObject>),
    /// They are within the radius of it, the nearest to it first, and moons after the planet that they are beside.
    Beside(Vec<proto::IdentifiedObject>),
}

fn bodies(scene: &SceneSnapshot, question: &Question) -> Bodies {
    let Camera { position_m, velocity_c, .. } = scene.camera;
    // Light that comes from where one points has left in this direction.
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
    let told = |separation_rad: f64, distance_m: f64, body: &Body| proto::IdentifiedObject {
        separation_deg: separation_rad.to_degrees(),
        distance_m: Some(distance_m),
        ..body_to_pb(scene, body)
    };
    if scene.objects.local_sky(position_m).is_some_and(|sky| sky.hides(question.direction)) {
        // The ground stands before everything.
        return Bodies::Cover(Vec::new());
    }
    if !found.is_empty() {
        return Bodies::Cover(found.into_iter().map(|(distance_m, body)| told(0.0, distance_m, body)).collect());
    }
    // A planet is smaller than a pixel: who points at it misses its disc.
    let beside: Vec<Beside> = scene
        .objects
        .bodies
        .iter()
        .map(|body| {
            let distance_m = (body.position_m - position_m).length();
            let radius_rad = body.angular_radius_rad(position_m);
            let seen_m = scene.objects.seen_m(position_m, body.position_m - position_m);
            let direction = seen_direction(velocity_c, seen_m);
            let separation_rad = direction.angle_between(question.direction);
            let of = body.ephemeris.and_then(Ephemeris::stands_as);
            Beside { of, direction, off_rad: separation_rad - radius_rad, told: told(separation_rad, distance_m, body) }
        })
        .filter(|beside| beside.off_rad <= question.radius_rad)
        .collect();
    Bodies::Beside(in_order(beside, question.radius_rad))
}

/// A body near the direction that was asked for.
struct Beside {
    /// As which body of the Solar System it stands.
    of: Option<SolarBody>,
    direction: DVec3,
    /// From the direction to its limb, rad.
    off_rad: f64,
    told: proto::IdentifiedObject,
}

/// The nearest first; moons that cannot be told from their planet within the radius come after it.
fn in_order(beside: Vec<Beside>, radius_rad: f64) -> Vec<proto::IdentifiedObject> {
    let key = |body: &Beside| {
        let planet = body.of.and_then(SolarBody::planet);
        let beside_it = |other: &&Beside| {
            planet.is_some() && other.of == planet && other.direction.angle_between(body.direction) < radius_rad
        };
        beside.iter().find(beside_it).map_or((body.off_rad, -1.0), |planet| (planet.off_rad, body.off_rad))
    };
    let keys: Vec<(f64, f64)> = beside.iter().map(key).collect();
    let mut found: Vec<_> = keys.into_iter().zip(beside.into_iter().map(|body| body.told)).collect();
    found.sort_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    found.into_iter().map(|(_, told)| told).collect()
}

/// The star of the built-in table at a place.
fn named<'a>(star: &SeenStar, stars: &'a StarSet) -> Option<&'a BrightStar> {
    let is_known = star.distance_pc.is_some();
    let named = stars.named().iter().filter(|named| named.star.distance_known == is_known);
    // Of pairs at one place the one that is as bright.
    let off = |named: &BrightStar| named.star.position.distance(star.position) / named.star.position.length();
    let at_1_pc = magnitude_from_illuminance_lx(star.illuminance_lx * star.distance_pc.map_or(1.0, |pc| pc * pc));
    let unlike = |named: &BrightStar| {
        let magnitude = f64::from(named.star.magnitude) - if named.star.distance_known { 5.0 } else { 0.0 };
        (magnitude - at_1_pc).abs()
    };
    // Places are rounded to a tenth of this.
    let key = |named: &BrightStar| ((10.0 * off(named) / SAME_PLACE).round(), unlike(named));
    let there = named.filter(|named| off(named) < SAME_PLACE).map(|named| (key(named), named));
    there.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, named)| named)
}

pub(super) fn star_to_pb(star: &SeenStar, stars: &StarSet) -> proto::IdentifiedObject {
    let named = named(star, stars);
    proto::IdentifiedObject {
        kind: proto::ObjectKind::Star.into(),
        name: named.map(|named| named.name.to_owned()).unwrap_or_default(),
        designation: named.map(|named| named.designation.to_owned()).unwrap_or_default(),
        direction: Some(vector_to_pb(star.direction)),
        separation_deg: star.separation_rad.to_degrees(),
        v_mag: Some(magnitude_from_illuminance_lx(star.illuminance_lx)),
        temperature_k: Some(star.temperature_k),
        distance_m: star.distance_pc.map(|distance| distance * PARSEC_M),
        solid_angle_sr: None,
    }
}

impl Service {
    pub(super) async fn identified(&self, request: &proto::IdentifyRequest) -> Result<proto::IdentifyResponse, Status> {
        let question = Question::new(request)?;
        let place = Arc::clone(&self.looking).try_acquire_owned().map_err(|_| {
            refusals::exhausted("searches", "as many calls of Identify as may be are looking already: try again")
        })?;
        let state = self.render.scene().map_err(refused)?;
        let scene = self.render.snapshot(&state);
        let faintest_lx = illuminance_lx_from_magnitude(state.stars.magnitude_limit);
        let looking = move || {
            let _place = place;
            let SceneSnapshot { stars, camera, .. } = &scene;
            let Question { direction, radius_rad, most } = question;
            let refraction = scene.objects.refraction(camera.position_m);
            let mut objects = match bodies(&scene, &question) {
                Bodies::Cover(objects) => objects,
                Bodies::Beside(mut objects) => {
                    let found = background::on_own_cores(|| {
                        stars_near(stars, (camera, refraction), direction, radius_rad, faintest_lx, most)
                    });
                    objects.extend(found.iter().map(|star| star_to_pb(star, stars)));
                    objects
                }
            };
            objects.truncate(most);
            let (camera_revision, scene_revision) = (camera.revision, scene.revision);
            let (_, constellation) =
                constellation_of(refraction.map_or(direction, |refraction| refraction.arriving(direction)));
            let constellation = constellation.to_owned();
            proto::IdentifyResponse { objects, camera_revision, scene_revision, constellation }
        };
        task::spawn_blocking(looking).await.map_err(|error| Status::internal(format!("looking failed: {error}")))
    }
}

/// Names of the bodies in a direction or within an angle of it, rad.
#[cfg(test)]
pub(super) fn bodies_told(scene: &SceneSnapshot, direction: DVec3, radius_rad: f64) -> Vec<String> {
    match bodies(scene, &Question { direction, radius_rad, most: 8 }) {
        Bodies::Cover(objects) | Bodies::Beside(objects) => objects.into_iter().map(|object| object.name).collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_where_it_covers_the_sky_and_nowhere_else() {
        let mut mars = Body::preset(SolarBody::Mars, "mars", DVec3::X * 1e9);
        mars.radii_m = DVec3::new(1e7, 2e7, 3e7);
        let camera = Camera::default();
        let hit = |direction: DVec3| distance_m(&camera, &mars, 0.0, direction.normalize());
        let along_x = mars.world_from_body(0.0).conjugate() * DVec3::X;
        // The support of the ellipsoid along the line of sight.
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
    fn moons_that_are_not_apart_from_their_planet_come_after_it() {
        let beside = |name: &str, of: SolarBody, angle_rad: f64| Beside {
            of: Some(of),
            direction: DVec3::new(angle_rad.sin(), 0.0, angle_rad.cos()),
            off_rad: (angle_rad - 0.01).abs(),
            told: proto::IdentifiedObject { name: name.to_owned(), ..Default::default() },
        };
        let names = |radius_rad: f64| {
            let bodies = vec![
                beside("io", SolarBody::Io, 0.01),
                beside("mars", SolarBody::Mars, 0.013),
                beside("jupiter", SolarBody::Jupiter, 0.012),
                beside("titan", SolarBody::Titan, 0.0105),
            ];
            in_order(bodies, radius_rad).into_iter().map(|told| told.name).collect::<Vec<_>>()
        };
        assert_eq!(names(0.001), ["io", "titan", "jupiter", "mars"]);
        assert_eq!(names(0.003), ["titan", "jupiter", "io", "mars"]);
    }
}

//! The light of planets and moons equals their measured phase curves at every phase, whether they are drawn as a point,
//! as a small disc or as a large one.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use steradian::{
    photometry::{
        phase_curve::{fainter_in, known_to_deg, magnitude},
        rec709::luminance,
    },
    plan::bodies::light::illuminance_of,
    reference::bodies::rays::draw,
    scene::{
        SceneObjects,
        bodies::{Body, SolarBody, suns},
    },
    units::{ASTRONOMICAL_UNIT_M, JULIAN_YEAR_S, illuminance_lx_from_magnitude},
    view::{View, ViewKind},
};

/// Returns a scene with a body one astronomical unit from the Sun, and one from the eye at the origin. It is seen at a
/// phase angle. Its pole is perpendicular to both directions, so that rings are edge-on.
fn scene(body: SolarBody, phase_deg: f64) -> SceneObjects {
    let place = DVec3::NEG_Z * ASTRONOMICAL_UNIT_M;
    let mut planet = Body::preset(body, "planet", place);
    planet.orientation = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let (sin, cos) = phase_deg.to_radians().sin_cos();
    let sun = Body::preset(SolarBody::Sun, "sun", place + DVec3::new(sin, 0.0, cos) * ASTRONOMICAL_UNIT_M);
    SceneObjects { bodies: vec![Arc::new(planet), Arc::new(sun)], ..Default::default() }
}

#[test]
fn light_equals_the_measured_curves_at_every_phase_and_size() {
    for body in SolarBody::ALL.into_iter().filter(|body| *body != SolarBody::Sun) {
        let mut worst = [(0.0_f64, 0.0); 3];
        let known = known_to_deg(body);
        let phases = (0..=179).map(f64::from).filter(|phase_deg| *phase_deg <= known);
        for phase_deg in phases.chain((known.fract() > 0.0).then_some(known)) {
            let objects = scene(body, phase_deg);
            let published = magnitude(body, phase_deg).unwrap();
            let error = |lx: f64| -2.5 * (lx / illuminance_lx_from_magnitude(published)).log10();
            let mut note = |index: usize, lx: f64| {
                let error = error(lx);
                if error.abs() > worst[index].0.abs() {
                    worst[index] = (error, phase_deg);
                }
            };
            note(0, luminance(illuminance_of(&objects.bodies[0], DVec3::ZERO, &suns(&objects), 0.0)));
            // Draw discs only up to this phase, because the rays do not resolve thinner crescents. Discs follow the
            // same curve as points, so a few phases are enough.
            if phase_deg > 150.0 || phase_deg % 30.0 != 0.0 {
                continue;
            }
            let size_rad = 2.0 * objects.bodies[0].radii_m.max_element() / ASTRONOMICAL_UNIT_M;
            let planet = SceneObjects { bodies: objects.bodies.clone(), ..SceneObjects::default() };
            for (index, diameter_px, samples) in [(1, 5.0, 96), (2, 40.0, 16)] {
                let side = (1.3 * diameter_px) as u32 + 2;
                let fov_y_rad = size_rad * f64::from(side) / diameter_px;
                let kind = ViewKind::Perspective { size: [side; 2], fov_y_rad };
                let view = View::new("window", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
                let mapping = view.images[0].projection.mapping();
                let image = draw(&planet, DVec3::ZERO, DQuat::IDENTITY, mapping, samples);
                note(index, luminance(image.illuminance_lx(mapping)));
            }
        }
        let [point, small, large] = worst.map(|(error, phase_deg)| format!("{error:+.4} mag at {phase_deg}"));
        println!("{body:?}, to {known} degrees: point {point}; 5 pixels {small}; 40 pixels {large}");
        for ((error, phase_deg), most) in worst.into_iter().zip([0.01, 0.02, 0.02]) {
            assert!(error.abs() < most, "{body:?} {phase_deg}: {error}");
        }
    }
}

#[test]
fn neptune_was_fainter_before_2000() {
    for year in [1900.0, 1980.0, 1985.0, 1995.0, 2000.0, 2026.0] {
        let objects = SceneObjects { time_s: (year - 2000.0) * JULIAN_YEAR_S, ..scene(SolarBody::Neptune, 1.0) };
        let lx = luminance(illuminance_of(&objects.bodies[0], DVec3::ZERO, &suns(&objects), objects.time_s));
        let published = magnitude(SolarBody::Neptune, 1.0).unwrap() + fainter_in(SolarBody::Neptune, year);
        let error = -2.5 * (lx / illuminance_lx_from_magnitude(published)).log10();
        assert!(error.abs() < 0.008, "{year}: {error}");
    }
}

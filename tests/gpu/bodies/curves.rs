//! The light of bodies equals their measured phase curves, up to the ends of the curves, whether they are drawn as
//! points or as discs of any size.

use std::sync::Arc;

use crate::common::*;
use glam::{DQuat, DVec3};
use steradian::{
    photometry::{phase_curve::magnitude, rec709::luminance},
    plan::{bodies::light::illuminance_of, settings::StarMethod},
    render::Renderer,
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody, suns},
    },
    units::{ASTRONOMICAL_UNIT_M, illuminance_lx_from_magnitude},
    view::ViewKind,
};

/// Diameters at which the light is compared, pixels. The first is drawn as a point, the second half as a point and half as a disc, the others as
/// discs.
const DIAMETERS_PX: [f64; 5] = [0.5, 3.0, 6.0, 25.0, 200.0];

/// Returns a scene with a body one astronomical unit from the Sun, and one from the camera. It is seen at a phase
/// angle, and its pole leans towards the eye.
fn scene(body: SolarBody, phase_deg: f64, lean_deg: f64) -> SceneSnapshot {
    let place = DVec3::NEG_Z * ASTRONOMICAL_UNIT_M;
    let mut planet = Body::preset(body, "planet", place);
    planet.orientation = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2 + lean_deg.to_radians());
    let (sin, cos) = phase_deg.to_radians().sin_cos();
    let mut sun = Body::preset(SolarBody::Sun, "sun", place + DVec3::new(sin, 0.0, cos) * ASTRONOMICAL_UNIT_M);
    if let Some(emission) = &mut sun.emission {
        emission.corona = false;
    }
    let objects = SceneObjects { bodies: vec![Arc::new(planet), Arc::new(sun)], ..Default::default() };
    SceneSnapshot { objects: Arc::new(objects), camera: Camera::default(), ..snapshot(Vec::new()) }
}

/// Returns the light of a body in a picture, lx.
fn light_lx(renderer: &mut Renderer, scene: &SceneSnapshot, diameter_px: f64) -> f64 {
    let radii_m = scene.objects.bodies[0].radii_m.max_element();
    let wide = 2.6 * diameter_px + 24.0;
    let size_rad = 2.0 * radii_m / ASTRONOMICAL_UNIT_M;
    let fov_y_rad = 2.0 * (0.5 * size_rad * wide / diameter_px).atan();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [wide as u32; 2], fov_y_rad })]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    illuminance_lx(&render_hdr(renderer, scene, &rig, &settings(StarMethod::Auto)).images[0], mapping)
}

#[test]
fn a_thin_crescent_keeps_its_light_before_the_corona() {
    let mut renderer = renderer();
    for phase_deg in [175.0, 177.04] {
        let without = scene(SolarBody::Venus, phase_deg, 0.0);
        let mut sun = (*without.objects.bodies[1]).clone();
        if let Some(emission) = &mut sun.emission {
            emission.corona = true;
        }
        let mut with = |venus: &Arc<Body>, diameter_px: f64| {
            let bodies = vec![Arc::clone(venus), Arc::new(sun.clone())];
            let objects = Arc::new(SceneObjects { bodies, ..(*without.objects).clone() });
            light_lx(&mut renderer, &SceneSnapshot { objects, ..without.clone() }, diameter_px)
        };
        let venus = &without.objects.bodies[0];
        let whole = luminance(illuminance_of(venus, DVec3::ZERO, &suns(&without.objects), 0.0));
        let mut dark = (**venus).clone();
        (dark.surface.geometric_albedo, dark.surface.phase_curve) = ([0.0; 3], None);
        let dark = Arc::new(dark);
        for diameter_px in [3.0, 6.0, 8.5, 25.0] {
            let light_lx = with(venus, diameter_px) - with(&dark, diameter_px);
            let error_mag = -2.5 * (light_lx / whole).log10();
            println!("phase {phase_deg}, {diameter_px} pixels in front of the corona: {error_mag:+.3} mag");
            assert!(error_mag.abs() < 0.05, "phase {phase_deg}, {diameter_px} pixels: {error_mag}");
        }
    }
}

#[test]
fn light_equals_the_measured_curve_at_every_phase_and_size() {
    let mut renderer = renderer();
    for (body, phases_deg, lean_deg) in [
        (SolarBody::Mercury, &[2.0, 90.0, 150.0, 169.0][..], 0.0),
        (SolarBody::Venus, &[2.0, 90.0, 162.96, 168.69, 172.94, 177.04, 179.0], 0.0),
        (SolarBody::Moon, &[0.0, 90.0, 149.0], 0.0),
        (SolarBody::Jupiter, &[1.0, 90.0, 130.0], 3.0),
        (SolarBody::Saturn, &[0.5, 3.0, 6.0], 26.0),
        (SolarBody::Saturn, &[0.5, 3.0, 6.0], 18.0),
        (SolarBody::Saturn, &[0.5, 3.0, 6.0], 12.0),
        (SolarBody::Saturn, &[0.5, 3.0, 6.0], 5.0),
        (SolarBody::Saturn, &[6.0, 90.0, 150.0], 0.0),
        (SolarBody::Uranus, &[2.0, 150.0], 0.0),
    ] {
        let mut worst = DIAMETERS_PX.map(|_| 0.0_f64);
        for phase_deg in phases_deg {
            let scene = scene(body, *phase_deg, lean_deg);
            let whole = luminance(illuminance_of(&scene.objects.bodies[0], DVec3::ZERO, &suns(&scene.objects), 0.0));
            if lean_deg == 0.0 {
                let published = illuminance_lx_from_magnitude(magnitude(body, *phase_deg).unwrap());
                assert!((2.5 * (whole / published).log10()).abs() < 0.06, "{body:?} {phase_deg}");
            }
            for (worst, diameter_px) in worst.iter_mut().zip(DIAMETERS_PX) {
                let found = -2.5 * (light_lx(&mut renderer, &scene, diameter_px) / whole).log10();
                if found.abs() > worst.abs() {
                    *worst = found;
                }
            }
        }
        println!("{body:?}, leaning {lean_deg}: errors {worst:+.3?} mag at {DIAMETERS_PX:?} pixels");
        assert!(worst.iter().all(|error| error.abs() < 0.05), "{body:?}, leaning {lean_deg}: {worst:?}");
    }
}

//! The corona of the Sun: its brightness follows the measured profile at every distance, and bodies in front hide it.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::{DQuat, DVec2, DVec3};
use steradian::{
    photometry::{corona, rec709::luminance},
    plan::settings::StarMethod,
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, Emission, SolarBody},
    },
    units::ASTRONOMICAL_UNIT_M,
    view::{Rig, ViewKind, projection::FisheyeMapping},
};

const AU: f64 = ASTRONOMICAL_UNIT_M;
/// Angular radius of the Sun, and of the moon in front of it, as seen from 1 au, rad.
const SUN_RAD: f64 = 695_700e3 / AU;

/// Returns a scene with the Sun ahead, and optionally a moon in front of it. The moon is given by its radius and the
/// offset of its centre, in radii of the Sun.
fn scene(moon: Option<(f64, f64)>, has_corona: bool) -> SceneSnapshot {
    let mut sun = Body::preset(SolarBody::Sun, "sun", DVec3::NEG_Z * AU);
    sun.emission = sun.emission.map(|emission| Emission { corona: has_corona, ..emission });
    let mut bodies = vec![Arc::new(sun)];
    if let Some((moon_radii, offset_radii)) = moon {
        let distance_m = 3.8e8;
        let place = DQuat::from_rotation_y(-offset_radii * SUN_RAD) * DVec3::NEG_Z * distance_m;
        let mut moon = Body::preset(SolarBody::Moon, "moon", place);
        moon.radii_m = DVec3::splat(distance_m * (moon_radii * SUN_RAD).sin());
        // The moon is black, so all light comes from the Sun and the corona.
        moon.surface.geometric_albedo = [0.0; 3];
        moon.surface.phase_curve = None;
        bodies.push(Arc::new(moon));
    }
    let objects = SceneObjects { bodies, ..Default::default() };
    SceneSnapshot { objects: Arc::new(objects), camera: Camera::default(), ..snapshot(Vec::new()) }
}

fn disc_cd_m2(scene: &SceneSnapshot) -> f64 {
    let sun: &Body = &scene.objects.bodies[0];
    let emission = sun.emission.unwrap();
    luminance(emission.luminance_cd_m2) * emission.mean_over_middle()
}

/// Returns the luminance of all pixels, relative to the mean luminance of the Sun's disc.
fn picture(scene: &SceneSnapshot, rig: &Rig) -> Vec<f64> {
    let frame = render_hdr(&mut renderer(), scene, rig, &settings(StarMethod::Auto));
    let unit = disc_cd_m2(scene);
    let pixels = frame.images[0].hdr.as_ref().unwrap().iter();
    pixels.map(|[r, g, b, _]| luminance([r, g, b].map(|c| f64::from(*c))) / unit).collect()
}

/// Returns a window 480 pixels wide that shows 24 radii of the Sun, which is half of its corona. A radius has 20
/// pixels.
fn window() -> Rig {
    rig(vec![("window", ViewKind::Perspective { size: [480, 480], fov_y_rad: 2.0 * (12.0 * SUN_RAD).atan() })])
}

/// Returns the mean of the profile over a pixel of the window, from 40 x 40 points. `hidden` is the radius of a disc
/// without light, and the offset of its centre, in radii of the Sun.
fn expected(pixel: usize, hidden: Option<(f64, f64)>) -> f64 {
    let corner = DVec2::new((pixel % 480) as f64, (pixel / 480) as f64);
    let mut sum = 0.0;
    for part in 0..1600 {
        let point_radii =
            (corner + (DVec2::new(f64::from(part % 40), f64::from(part / 40)) + 0.5) / 40.0 - 240.0) / 20.0;
        let direction = DVec3::new(point_radii.x * SUN_RAD, point_radii.y * SUN_RAD, -1.0).normalize();
        let distance = direction.angle_between(DVec3::NEG_Z).sin() / SUN_RAD;
        let is_hidden = hidden.is_some_and(|(moon_radii, offset_radii)| {
            let middle = DQuat::from_rotation_y(-offset_radii * SUN_RAD) * DVec3::NEG_Z;
            direction.angle_between(middle) < moon_radii * SUN_RAD
        });
        sum += if is_hidden { 0.0 } else { corona::over_disc(distance) };
    }
    sum / 1600.0
}

#[test]
fn a_corona_has_the_measured_brightness_at_every_distance() {
    let scene = scene(Some((1.05, 0.0)), true);
    let relative = picture(&scene, &window());
    let mut worst = [0.0_f64; 2];
    // It is enough to compare the pixels of a few rows and columns.
    for pixel in (0..480 * 480).filter(|pixel| pixel / 480 % 37 == 18 || pixel % 480 % 53 == 20) {
        let (left, whole) = (expected(pixel, Some((1.05, 0.0))), expected(pixel, None));
        // The renderer divides pixels on the limb of the moon into 12 x 12 parts.
        let at_limb = usize::from(left != whole);
        if whole > 1e-9 {
            worst[at_limb] = worst[at_limb].max((relative[pixel] - left).abs() / whole);
        } else {
            assert!((relative[pixel] - left).abs() < 1e-11, "{pixel}");
        }
    }
    println!("largest error {:.1e} next to the moon, {:.1e} on its limb", worst[0], worst[1]);
    assert!(worst[0] < 1.3e-2 && worst[1] < 0.04, "{worst:?}");
    // The disc of the moon is dark.
    assert_eq!(relative[240 * 480 + 240], 0.0);
    // A corona with another profile fails the comparison.
    let [near, far] = [1.5, 4.0].map(|radii| relative[240 * 480 + 240 + (radii * 20.0) as usize]);
    let [of_near, of_far] = [1.5, 4.0].map(|radii| expected(240 * 480 + 240 + (radii * 20.0) as usize, None));
    assert!((near / far / (of_near / of_far) - 1.0).abs() < 1e-2);
    assert!((near / far / (of_near / of_far * 1.05) - 1.0).abs() > 1e-2);
}

#[test]
fn coarse_pixels_keep_the_light_of_a_corona_and_a_moon_hides_its_share() {
    // Light of the whole corona. It is small because the corona is faint at its outer end: see photometry::corona.
    let whole = 1.0653e-6;
    // A dome with pixels of 0.35 degrees, and a window with pixels of 1 arcmin.
    for (name, kind) in [
        ("dome", ViewKind::Fisheye { size: [256, 256], mapping: FisheyeMapping::Equidistant, fov_rad: PI / 4.0 }),
        ("window", ViewKind::Perspective { size: [400, 400], fov_y_rad: 0.26 }),
    ] {
        let rig = rig(vec![(name, kind)]);
        let mapping = rig.views()[0].images[0].projection.mapping();
        let light = |scene: &SceneSnapshot| {
            let relative = picture(scene, &rig);
            let width = mapping.size()[0];
            let omega = |index: usize| mapping.solid_angle_sr(index as u32 % width, index as u32 / width);
            relative.iter().enumerate().map(|(index, light)| light * omega(index)).sum::<f64>()
                / (PI * SUN_RAD * SUN_RAD)
        };
        let [with_corona, without] = [true, false].map(|has_corona| light(&scene(None, has_corona)));
        println!("{name}: {:.4e} of the Sun's light", with_corona - without);
        // The light of the corona is the difference of two values near 1, which have the precision of f32.
        assert!((without - 1.0).abs() < 3e-3, "{without}");
        let hidden = light(&scene(Some((1.0001, 0.0)), true));
        println!("{name}: {hidden:.4e} behind a moon as large as the Sun");
        assert!((hidden / whole - 1.0).abs() < 0.04, "{name}: {hidden}");
        // A moon 30 times as large as the Sun covers half of the sky next to it.
        let half = light(&scene(Some((30.0, 30.0)), true));
        let sun_half = light(&scene(Some((30.0, 30.0)), false));
        println!(
            "{name}: {half:.4} of the Sun's light next to a large moon, {:.3} of the corona's",
            (half - sun_half) / whole
        );
        assert!(
            (0.4..0.6).contains(&((half - sun_half) / whole)) && (0.48..0.52).contains(&half),
            "{name}: {half} {sun_half}"
        );
    }
}

#[test]
fn a_flattened_star_in_front_of_its_own_corona_has_its_light() {
    // The near side of such a star is closer than its shortest radius, so its globe counts as being in front of its corona.
    for (flattening, radius_px) in [(0.3, 3.0), (0.3, 8.0), (0.3, 12.0), (0.5, 4.0), (0.5, 8.0)] {
        let flattened = |has_corona| {
            let mut scene = scene(None, has_corona);
            let objects = Arc::make_mut(&mut scene.objects);
            let sun = Arc::make_mut(&mut objects.bodies[0]);
            // The star is seen from its equator.
            sun.orientation = DQuat::from_rotation_x(0.5 * PI);
            sun.radii_m.z *= flattening;
            scene
        };
        let fov_y_rad = 2.0 * (48.0 / radius_px * SUN_RAD).atan();
        let rig = rig(vec![("window", ViewKind::Perspective { size: [96, 96], fov_y_rad })]);
        let [with_corona, without] = [true, false].map(|has_corona| picture(&flattened(has_corona), &rig));
        let least = with_corona.iter().copied().fold(f64::INFINITY, f64::min);
        let [light, own] = [&with_corona, &without].map(|picture| picture.iter().sum::<f64>());
        println!("{flattening}, {radius_px} pixels: light with and without the corona {:.1e}", light / own - 1.0);
        assert!(least >= 0.0 && (light / own - 1.0).abs() < 4e-3, "{least}");
    }
}

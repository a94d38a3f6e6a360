//! Bodies drawn in f64: their light equals closed forms in every projection, and the nearest body hides those behind
//! it.

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec3};
use steradian::{
    photometry::{rec709::luminance, reflection::sphere_illuminance_lx},
    plan::bodies::light::illuminance_of,
    reference::bodies::rays::{BodyImage, Eye, draw, draw_lit, hides},
    scene::{
        SceneObjects,
        bodies::{Body, Emission, ReflectionLaw, SolarBody, Texture, suns},
    },
    view::projection::{
        CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping, pixel_centre,
    },
};

const AU_M: f64 = 1.495_978_707e11;

/// A sphere with a radius of 1000 km at the origin; the Sun is 1 au from it, on the +x axis.
fn sphere(law: ReflectionLaw) -> Body {
    let mut body = Body::preset(SolarBody::Moon, "ball", DVec3::ZERO);
    body.radii_m = DVec3::splat(1e6);
    body.surface.law = law;
    body.surface.geometric_albedo = [0.2, 0.3, 0.4];
    body.surface.phase_curve = None;
    body
}

fn with_sun(bodies: Vec<Body>) -> SceneObjects {
    let sun = Body::preset(SolarBody::Sun, "sun", DVec3::X * AU_M);
    let bodies = bodies.into_iter().chain([sun]).map(Arc::new).collect();
    SceneObjects { bodies, ..SceneObjects::default() }
}

/// Draws the first body alone, in the light of all suns.
fn draw_first(
    objects: &SceneObjects,
    eye_m: DVec3,
    world_from_view: DQuat,
    mapping: &dyn PlaneMapping,
    samples: u32,
) -> BodyImage {
    draw_lit(&objects.bodies[..1], &suns(objects), 0.0, Eye { eye_m, world_from_view }, mapping, samples)
}

/// Returns the rotation of a view along `direction`.
fn looking(direction: DVec3) -> DQuat {
    DQuat::from_rotation_arc(DVec3::NEG_Z, direction.normalize())
}

/// Returns pictures in which a body is drawn: name, mapping, and direction of the body in view axes.
fn pictures() -> Vec<(&'static str, Box<dyn PlaneMapping>, DVec3)> {
    let cube = |face| Box::new(CubeFace::new(face, 192).unwrap());
    let equirectangular = || Box::new(Equirectangular::new([384, 192]).unwrap());
    let fisheye = |mapping, fov: f64| Box::new(Fisheye::new([256, 256], mapping, fov).unwrap());
    vec![
        ("perspective", Box::new(Perspective::symmetric([192, 128], 1.0).unwrap()), DVec3::NEG_Z),
        (
            "perspective off the axis",
            Box::new(Perspective::symmetric([192, 128], 1.6).unwrap()),
            DVec3::new(0.5, 0.15, -1.0),
        ),
        ("fisheye", fisheye(FisheyeMapping::Equidistant, PI), DVec3::new(0.9, -0.2, -0.8)),
        ("stereographic fisheye", fisheye(FisheyeMapping::Stereographic, 4.0), DVec3::new(-0.5, 0.5, -0.1)),
        ("equirectangular", equirectangular(), DVec3::new(0.0, 0.3, -1.0)),
        ("equirectangular seam", equirectangular(), DVec3::new(0.0, 0.1, 1.0)),
        ("equirectangular pole", equirectangular(), DVec3::new(0.15, 1.0, 0.07)),
        ("cube face", cube(Face::Front), DVec3::new(0.2, 0.1, -1.0)),
    ]
}

#[test]
fn light_of_a_sphere_matches_the_closed_form_in_every_projection_and_phase() {
    for law in ReflectionLaw::ALL {
        let objects = with_sun(vec![sphere(law)]);
        let sun_lx = suns(&objects)[0].light_at(DVec3::ZERO).unwrap().illuminance_lx;
        for phase_deg in [0.5, 60.0, 110.0] {
            let phase_rad = f64::to_radians(phase_deg);
            // The sphere is near enough to cover some pixels, and too near for the closed form, so the expected light
            // is an integral over the disc.
            let eye_m = DVec3::new(phase_rad.cos(), phase_rad.sin(), 0.0) * 3e6;
            let expected = illuminance_of(&objects.bodies[0], eye_m, &suns(&objects), 0.0);
            for (name, mapping, direction) in pictures() {
                let world_from_view = DQuat::from_rotation_arc(direction.normalize(), -eye_m.normalize());
                let image = draw_first(&objects, eye_m, world_from_view, mapping.as_ref(), 8);
                let found = image.illuminance_lx(mapping.as_ref());
                for channel in 0..3 {
                    let error = found[channel] / expected[channel] - 1.0;
                    assert!(error.abs() < 1e-3, "{law:?} {phase_deg} {name}: {error}");
                }
                let wrong = sphere_illuminance_lx(law, 0.31, sun_lx[1], 1e6, 3e6, phase_rad);
                assert!((found[1] / wrong - 1.0).abs() > 5e-3, "another albedo must fail");
            }
        }
    }
}

#[test]
fn light_of_a_distant_sphere_in_a_long_lens_matches_the_closed_form() {
    for law in ReflectionLaw::ALL {
        let objects = with_sun(vec![sphere(law)]);
        let sun_lx = suns(&objects)[0].light_at(DVec3::ZERO).unwrap().illuminance_lx;
        for phase_deg in [0.5, 45.0, 90.0, 135.0] {
            let phase_rad = f64::to_radians(phase_deg);
            let distance_m = 2e10;
            let eye_m = DVec3::new(phase_rad.cos(), 0.0, phase_rad.sin()) * distance_m;
            let lens = Perspective::symmetric([80, 80], 2.2e6 / distance_m).unwrap();
            let image = draw_first(&objects, eye_m, looking(-eye_m), &lens, 16);
            let found = image.illuminance_lx(&lens);
            for (channel, albedo) in [0.2, 0.3, 0.4].into_iter().enumerate() {
                let lit = sun_lx[channel];
                let closed = |albedo: f64| sphere_illuminance_lx(law, albedo, lit, 1e6, distance_m, phase_rad);
                let error = found[channel] / closed(albedo) - 1.0;
                assert!(error.abs() < 1e-3, "{law:?} {phase_deg}: {error}");
                assert!((found[channel] / closed(albedo * 1.01) - 1.0).abs() > 5e-3);
            }
            let covered = image.covered_sr(&lens) / (PI * (1e6 / distance_m).powi(2));
            assert!((covered - 1.0).abs() < 3e-5, "{covered}");
        }
    }
}

#[test]
fn an_ellipsoid_covers_its_cross_section_along_every_axis() {
    let mut body = sphere(ReflectionLaw::Lambert);
    body.radii_m = DVec3::new(1e6, 2e6, 3e6);
    body.orientation = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(1.1);
    let (axes, orientation) = (body.radii_m, body.orientation);
    let objects = with_sun(vec![body]);
    let distance_m = 1e10;
    for (axis, area_m2) in [(DVec3::X, axes.y * axes.z), (DVec3::Y, axes.x * axes.z), (DVec3::Z, axes.x * axes.y)] {
        let eye_m = orientation * axis * distance_m;
        let lens = Perspective::symmetric([96, 96], 6.6e6 / distance_m).unwrap();
        let image = draw_first(&objects, eye_m, looking(-eye_m), &lens, 12);
        let covered_m2 = image.covered_sr(&lens) * distance_m * distance_m;
        assert!((covered_m2 / (PI * area_m2) - 1.0).abs() < 3.7e-4, "{axis}: {covered_m2}");
        assert!((covered_m2 / (PI * area_m2 * 1.01) - 1.0).abs() > 5e-3);
        let expected = illuminance_of(&objects.bodies[0], eye_m, &suns(&objects), 0.0);
        let found = image.illuminance_lx(&lens);
        if expected[1] > 0.0 {
            assert!((found[1] / expected[1] - 1.0).abs() < 1e-3, "{axis}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn light_of_nearby_ellipsoids_and_textures_matches_the_plans_sum() {
    let mut body = sphere(ReflectionLaw::LommelSeeliger);
    body.radii_m = DVec3::new(1.3e6, 1e6, 0.7e6);
    body.orientation = DQuat::from_rotation_y(0.7);
    let spots = |i: u32| [0.2 + 0.8 * f32::from((i * 7 % 13) as u8) / 13.0, 0.5, 1.0 - 0.5 * (i % 3) as f32 / 3.0];
    body.surface.texture = Some(Arc::new(Texture { size: [16, 8], rgb: (0..128).map(spots).collect() }));
    let objects = with_sun(vec![body]);
    let fisheye = Fisheye::new([256, 256], FisheyeMapping::Equidistant, PI).unwrap();
    for eye_m in [DVec3::new(2e6, 1.3e6, 0.3e6), DVec3::new(-0.3e6, 1.2e6, 1e6), DVec3::new(0.1e6, 0.1e6, 1.6e6)] {
        let expected = illuminance_of(&objects.bodies[0], eye_m, &suns(&objects), 0.0);
        let found = draw_first(&objects, eye_m, looking(-eye_m), &fisheye, 12).illuminance_lx(&fisheye);
        for channel in 0..3 {
            let error = found[channel] / expected[channel] - 1.0;
            assert!(error.abs() < 1e-3, "{eye_m} {channel}: {error}");
        }
    }
}

#[test]
fn the_suns_disc_at_one_astronomical_unit_has_its_magnitude() {
    let objects = SceneObjects {
        bodies: vec![Arc::new(Body::preset(SolarBody::Sun, "sun", DVec3::ZERO))],
        ..SceneObjects::default()
    };
    let lens = Perspective::symmetric([64, 64], f64::to_radians(0.6)).unwrap();
    let image = draw(&objects, DVec3::X * AU_M, looking(DVec3::NEG_X), &lens, 12);
    let found_lx = luminance(image.illuminance_lx(&lens));
    let magnitude = steradian::units::magnitude_from_illuminance_lx(found_lx);
    let expected = 4.83 + 5.0 * (AU_M / (10.0 * steradian::units::PARSEC_M)).log10();
    assert!((magnitude - expected).abs() < 3.2e-4, "{magnitude} {expected}");
    assert!((found_lx / 1.26e5 - 1.0).abs() < 0.01, "{found_lx} lx");
    // The limb is darker than the centre: at the very edge it has 0.4 of the luminance of the centre.
    let middle = luminance(image.luminance_cd_m2[32 * 64 + 32]);
    let row = &image.luminance_cd_m2[32 * 64..33 * 64];
    let dimmest = row.iter().zip(&image.coverage[32 * 64..]).filter(|(_, covered)| **covered > 0.999);
    let dimmest = dimmest.map(|(rgb, _)| luminance(*rgb)).fold(f64::INFINITY, f64::min);
    assert!(dimmest < 0.7 * middle && dimmest > 0.4 * middle, "{dimmest} {middle}");
}

#[test]
fn the_nearest_body_hides_exactly_the_directions_behind_it() {
    let mut near = sphere(ReflectionLaw::Lambert);
    near.radii_m = DVec3::new(1e6, 2e6, 1.3e6);
    let mut far = Body::preset(SolarBody::Sun, "lamp", DVec3::NEG_Z * 5e7);
    far.radii_m = DVec3::splat(1e7);
    far.emission = Some(Emission { luminance_cd_m2: [7.0; 3], limb_darkening: 0.0, corona: false });
    far.surface.geometric_albedo = [0.0; 3];
    let bodies = [near.clone(), far].map(Arc::new).to_vec();
    let eye_m = DVec3::Z * 1e7;
    for bodies in [bodies.clone(), bodies.into_iter().rev().collect()] {
        let objects = SceneObjects { bodies, ..SceneObjects::default() };
        let flat = Perspective::symmetric([65, 65], 0.6).unwrap();
        let image = draw(&objects, eye_m, DQuat::IDENTITY, &flat, 1);
        let mut counts = [0; 3];
        for (index, rgb) in image.luminance_cd_m2.iter().enumerate() {
            let centre = pixel_centre(index as u32 % 65, index as u32 / 65);
            let direction = flat.direction_from_pixel(centre).unwrap();
            let [near_hides, far_hides] = [0, 1].map(|i| {
                objects
                    .bodies
                    .iter()
                    .any(|body| (body.name == "lamp") == (i == 1) && hides(body, eye_m, direction, 0.0))
            });
            let kind = if near_hides { 0 } else { 1 + usize::from(!far_hides) };
            counts[kind] += 1;
            // The lamp lights only the far side of the near body, so its near side is dark.
            assert!((rgb[0] - [0.0, 7.0, 0.0][kind]).abs() < 4e-15, "pixel {index}: {rgb:?}");
            assert_eq!(image.coverage[index], [1.0, 1.0, 0.0][kind]);
        }
        assert!(counts.iter().all(|&count| count > 50), "{counts:?}");
    }
    // Test directions slightly inside and outside of the outline of an ellipsoid, even from a great distance.
    for distance_m in [3e6, 1e9, 1e14] {
        let eye_m = DVec3::Z * distance_m;
        // Tangent to the ellipse (y / 2e6)^2 + (z / 1.3e6)^2 = 1 in the y-z plane: tan^2 = b^2 / (d^2 - c^2).
        let tangent = 2e6 / (distance_m * distance_m - 1.3e6f64.powi(2)).sqrt();
        let towards = |factor: f64| DVec3::new(0.0, tangent * factor, -1.0).normalize();
        assert!(hides(&near, eye_m, towards(1.0 - 1e-7), 0.0), "{distance_m}");
        assert!(!hides(&near, eye_m, towards(1.0 + 1e-7), 0.0), "{distance_m}");
        assert!(!hides(&near, eye_m, -towards(0.5), 0.0), "behind the eye");
    }
}

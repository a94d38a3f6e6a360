//! Measures the errors of display images, compared with exact images, in many poses: by kind of place in the picture,
//! and for the light of the brightest stars.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use steradian::{
    catalogue::chunks::StarSet,
    chart::code_errors,
    coordinates::galactic_from_icrs,
    plan::{Output, settings::RenderSettings},
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{
        Rig, ViewKind, Viewport,
        projection::{FisheyeMapping, pixel_centre},
    },
};

use crate::common::{configured, renderer, rig};

/// Error budget, codes.
const BUDGET: f64 = 0.5;
/// A pixel above this code belongs to a star or to the Milky Way.
const LIT_CODE: f64 = 8.0;
/// A pixel above this code belongs to a bright star; pixels within [`NEAR_PX`] of it count as near a bright star.
const BRIGHT_CODE: f64 = 150.0;
const NEAR_PX: i64 = 6;
/// Half the width of the Milky Way, rad.
const MILKY_WAY_RAD: f64 = 0.14;
/// Number of bright stars whose light is compared, and half the side of the square over which it is summed, pixels,
/// which is that of the B-spline.
const BRIGHTEST: usize = 500;
const SQUARE_PX: i64 = 1;

/// Kinds of places in a picture. Every pixel belongs to the first one.
const PLACES: [&str; 8] =
    ["all", "above code 8", "dark sky", "near a bright star", "Milky Way", "edge", "pole", "narrow pixels"];

/// Errors of all channels by place, and the worst relative error of the light of bright stars.
#[derive(Default)]
struct Found {
    errors: [Vec<f32>; PLACES.len()],
    worst_light: f64,
}

impl Found {
    /// Returns the given quantile of the errors at a place, or `None` if it has no pixels.
    fn quantile(&mut self, place: usize, share: f64) -> Option<f64> {
        let errors = &mut self.errors[place];
        let index = (errors.len().checked_sub(1)? as f64 * share) as usize;
        Some(f64::from(*errors.select_nth_unstable_by(index, f32::total_cmp).1))
    }

    fn add(&mut self, exact: &Frame, drawn: &Frame, settings: &RenderSettings, viewport: &Viewport, stars: &[DVec3]) {
        let mapping = viewport.projection.mapping();
        let [width, height] = mapping.size();
        let white = steradian::photometry::exposure::white_luminance_cd_m2(exact.exposure_ev100);
        let pixels = exact.images[0].hdr.as_ref().unwrap();
        let inside = |x: i64, y: i64| {
            (0..i64::from(width)).contains(&x)
                && (0..i64::from(height)).contains(&y)
                && pixels[(y * i64::from(width) + x) as usize][3] > 0.0
        };
        let codes: Vec<f64> = pixels
            .iter()
            .map(|[r, g, b, _]| {
                let rgb = settings.tone_map.display_rgb([*r, *g, *b].map(f64::from), white);
                255.0 * rgb.into_iter().fold(0.0, f64::max)
            })
            .collect();
        let mut near = vec![false; codes.len()];
        for (index, _) in codes.iter().enumerate().filter(|(_, code)| **code > BRIGHT_CODE) {
            let (x, y) = (index as i64 % i64::from(width), index as i64 / i64::from(width));
            for (dx, dy) in (-NEAR_PX..=NEAR_PX).flat_map(|dy| (-NEAR_PX..=NEAR_PX).map(move |dx| (dx, dy))) {
                if inside(x + dx, y + dy) {
                    near[((y + dy) * i64::from(width) + x + dx) as usize] = true;
                }
            }
        }
        let galactic = galactic_from_icrs();
        let [errors] = &code_errors(exact, drawn, settings)[..] else { panic!("there is one image") };
        let equirectangular = width == 2 * height;
        for (index, errors) in errors.iter().enumerate() {
            let (x, y) = (index as i64 % i64::from(width), index as i64 / i64::from(width));
            if !inside(x, y) {
                continue;
            }
            let direction = mapping.direction_from_pixel(pixel_centre(x as u32, y as u32)).unwrap();
            let latitude_rad = (galactic * (viewport.world_from_view * direction)).z.clamp(-1.0, 1.0).asin();
            let at_edge =
                !equirectangular && [(-3, 0), (3, 0), (0, -3), (0, 3)].iter().any(|(dx, dy)| !inside(x + dx, y + dy));
            let at_pole = equirectangular && direction.y.abs() > 0.98;
            let places = [
                true,
                codes[index] > LIT_CODE,
                codes[index] <= LIT_CODE && !near[index],
                near[index],
                latitude_rad.abs() < MILKY_WAY_RAD,
                at_edge,
                at_pole,
                equirectangular && (0.36..0.5).contains(&direction.x.hypot(direction.z)),
            ];
            for (errors_there, _) in self.errors.iter_mut().zip(places).filter(|(_, there)| *there) {
                errors_there.extend(errors.map(|error| error.abs() as f32));
            }
        }
        // Compare the light of the brightest stars in the picture, in a square around each star.
        let drawn_pixels = drawn.images[0].hdr.as_ref().unwrap();
        for direction in stars {
            let Some(pixel) = mapping.pixel_from_direction(viewport.world_from_view.inverse() * *direction) else {
                continue;
            };
            let (x, y) = (pixel.x.floor() as i64, pixel.y.floor() as i64);
            let square =
                (-SQUARE_PX..=SQUARE_PX).flat_map(|dy| (-SQUARE_PX..=SQUARE_PX).map(move |dx| (x + dx, y + dy)));
            let square: Vec<(i64, i64)> = square.collect();
            if !square.iter().all(|(x, y)| inside(*x, *y)) {
                continue;
            }
            // Weight the light by the profile of the star's image, as in photometry. Otherwise the error of the sky in
            // the corners of the square, which is up to half a code, would add a hundredth of the light of the fainter
            // stars.
            let light = |image: &[[f32; 4]]| -> f64 {
                let places = square.iter().map(|(x, y)| (y * i64::from(width) + x) as usize);
                places.map(|at| f64::from(pixels[at][1]) * f64::from(image[at][1]) * f64::from(image[at][3])).sum()
            };
            self.worst_light = self.worst_light.max((light(drawn_pixels) / light(pixels) - 1.0).abs());
        }
    }
}

/// Returns camera orientations that are evenly distributed over all rotations.
fn poses(count: u32) -> impl Iterator<Item = DQuat> {
    (0..count).map(|i| {
        let [u, v, w] =
            [0.754_877_666, 0.569_840_291, 0.430_159_709].map(|step: f64| (0.5 + step * f64::from(i)).fract());
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(a * (TAU * v).sin(), a * (TAU * v).cos(), b * (TAU * w).sin(), b * (TAU * w).cos())
    })
}

fn views() -> [(&'static str, Rig); 3] {
    [
        (
            "dome",
            rig(vec![("v", ViewKind::Fisheye { size: [512; 2], mapping: FisheyeMapping::Equidistant, fov_rad: PI })]),
        ),
        ("flat", rig(vec![("v", ViewKind::Perspective { size: [640, 360], fov_y_rad: 1.05 })])),
        ("whole sky", rig(vec![("v", ViewKind::Equirectangular { size: [800, 400] })])),
    ]
}

/// Returns the directions of stars as seen from the barycentre, the brightest first.
pub fn by_brightness(stars: &StarSet) -> Vec<DVec3> {
    let lights = stars.iter().map(|(place_pc, at_infinity, star)| {
        let distance_squared = if at_infinity { 1.0 } else { place_pc.length_squared() };
        (star.illuminance_at_1_pc_lx() / distance_squared, place_pc.normalize())
    });
    let mut lights: Vec<(f64, DVec3)> = lights.collect();
    lights.sort_by(|a, b| b.0.total_cmp(&a.0));
    lights.into_iter().map(|(_, direction)| direction).collect()
}

fn draw(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings, output: Output) -> Frame {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr()).drawn_for(output)).unwrap()
}

/// Measures the errors of `count` poses, and passes [`Found`] to `check` for each exposure and view.
fn measure(count: u32, check: impl Fn(f64, &str, &mut Found)) {
    let galaxy =
        "scene.catalogues=[\"builtin:bright\", { galaxy = { stars = 1200000, seed = 1, fainter_than = 6.5 } }]";
    let mut renderer = renderer();
    for ev100 in [-5.4, -8.5] {
        let exposure = format!("exposure={{ mode = \"manual\", ev100 = {ev100} }}");
        let (mut scene, _, settings) = configured("dome.toml", &[galaxy, &exposure]);
        let mut brightest = by_brightness(&scene.stars);
        brightest.truncate(BRIGHTEST);
        for (name, rig) in views() {
            let mut found = Found::default();
            for pose in poses(count) {
                scene.camera.world_from_camera = pose;
                let [exact, display] =
                    [Output::Hdr, Output::Display].map(|output| draw(&mut renderer, &scene, &rig, &settings, output));
                let viewport = &rig.viewports(pose)[0];
                found.add(&exact, &display, &settings, viewport, &brightest);
            }
            println!(
                "ev100 {ev100}, {name}, {count} poses: largest relative error of the light of the {BRIGHTEST} brightest stars {:.2e}",
                found.worst_light
            );
            for (place, kind) in PLACES.iter().enumerate() {
                let channels = found.errors[place].len();
                if let (Some(most), Some(largest)) = (found.quantile(place, 0.999), found.quantile(place, 1.0)) {
                    println!("  {kind:20} {channels:10} channels, 99.9 % {most:.3}, largest {largest:.3} codes");
                }
            }
            check(ev100, name, &mut found);
        }
    }
}

fn assert_budget(ev100: f64, name: &str, found: &mut Found) {
    for place in [0, 1] {
        let (most, largest) = (found.quantile(place, 0.999).unwrap(), found.quantile(place, 1.0).unwrap());
        assert!(most <= BUDGET && largest <= 4.0 * BUDGET, "{ev100} {name} {}: {most} {largest}", PLACES[place]);
    }
    // The narrowest pixels that read the map of faint light are a tenth of a whole-sky map.
    assert!(found.quantile(7, 0.999).is_none_or(|most| most <= 1.2 * BUDGET), "{ev100} {name} {}", PLACES[7]);
    assert!(found.worst_light < 0.01, "{ev100} {name}: {}", found.worst_light);
}

#[test]
fn display_images_keep_their_budget_in_every_place() {
    measure(2, assert_budget);
}

#[test]
#[ignore = "long: make test-all"]
fn display_images_keep_their_budget_in_sixteen_poses() {
    measure(16, assert_budget);
}

//! The published glare pyramids agree with the f64 reference, and have their known errors.

use std::f64::consts::PI;

use crate::common::*;
use glam::DVec3;
use steradian::{
    gpu::GpuOptions,
    photometry::rec709::luminance,
    plan::{
        glare::pyramid::{PyramidAxes, PyramidPlan},
        settings::{GlareMethod, GlareSettings, PyramidWeights, RenderSettings, StarMethod},
    },
    reference::glare::pyramid::with_glare,
    render::Renderer,
    scene::SceneSnapshot,
    units::illuminance_lx_from_magnitude,
    verify::scenes::{cube, fisheye},
    view::{
        Rig, ViewKind,
        projection::{FisheyeMapping, Projection},
    },
};

const METHODS: [GlareMethod; 2] = [GlareMethod::ScreenPyramid, GlareMethod::ViewPyramid];

const WEIGHTS: [PyramidWeights; 2] = [PyramidWeights::Equal, PyramidWeights::Halved];

fn with_glare_of(method: GlareMethod, weights: PyramidWeights, fraction: f64) -> RenderSettings {
    let glare = GlareSettings { method, weights, fraction, ..GlareSettings::default() };
    RenderSettings { glare, ..settings(StarMethod::BSpline) }
}

fn without_glare() -> RenderSettings {
    RenderSettings { glare: GlareSettings::none(), ..settings(StarMethod::BSpline) }
}

fn perspective(size: [u32; 2], degrees: f64) -> ViewKind {
    ViewKind::Perspective { size, fov_y_rad: degrees.to_radians() }
}

/// Returns R, G and B of every pixel of all images of a frame.
fn images(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings) -> Vec<Vec<[f32; 4]>> {
    render_hdr(renderer, scene, rig, settings).images.into_iter().map(|image| image.hdr.unwrap()).collect()
}

fn projections(rig: &Rig) -> Vec<&Projection> {
    rig.views().iter().flat_map(|view| &view.images).map(|image| &image.projection).collect()
}

/// Compares a picture with glare with the f64 reference, which is computed from the picture without glare. Returns the
/// largest relative difference of any channel, and the relative difference of the sums.
fn differences(
    drawn: &[[f32; 4]],
    glaring: &[[f32; 4]],
    projection: &Projection,
    axes: PyramidAxes,
    weights: PyramidWeights,
) -> [f64; 2] {
    let light: Vec<[f64; 3]> = drawn.iter().map(|[r, g, b, _]| [*r, *g, *b].map(f64::from)).collect();
    let expected = with_glare(projection, &light, (axes, weights), 0.5);
    let faintest = 1e-9 * light.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
    let mut worst = 0.0_f64;
    let mut sums = [0.0; 2];
    for (pixel, expected) in glaring.iter().zip(&expected) {
        for c in 0..3 {
            let found = f64::from(pixel[c]);
            worst = worst.max((found - expected[c]).abs() / (expected[c] + faintest));
            sums[0] += found;
            sums[1] += expected[c];
        }
    }
    [worst, (sums[0] / sums[1] - 1.0).abs()]
}

fn stars_everywhere() -> SceneSnapshot {
    let stars = spiral(60).enumerate().map(|(i, direction)| star(direction, i as f32 % 7.0 - 1.0));
    snapshot(stars.collect())
}

#[test]
fn pyramids_equal_the_reference_in_every_projection() {
    let mut renderer = renderer();
    let mut kinds = all_views();
    kinds.push(("odd", perspective([127, 95], 60.0)));
    kinds.push(("tiny", perspective([3, 1], 60.0)));
    let rig = rig(kinds);
    let scene = stars_everywhere();
    let drawn = images(&mut renderer, &scene, &rig, &without_glare());
    for method in METHODS {
        let axes = PyramidAxes::for_method(method).unwrap();
        for weights in WEIGHTS {
            let glaring = images(&mut renderer, &scene, &rig, &with_glare_of(method, weights, 0.5));
            for ((drawn, glaring), projection) in drawn.iter().zip(&glaring).zip(projections(&rig)) {
                let [worst, sum] = differences(drawn, glaring, projection, axes, weights);
                let message =
                    format!("{method:?} {weights:?} {:?}: {worst:e}, sum {sum:e}", projection.mapping().size());
                assert!(worst < 2e-3 && sum < 1e-4, "{message}");
            }
        }
    }
}

#[test]
fn other_axes_weights_or_a_shift_fail_the_comparison() {
    let mut renderer = renderer();
    for kind in [perspective([128, 96], 90.0), fisheye(128, FisheyeMapping::Equidistant, 180.0)] {
        let rig = rig(vec![("view", kind)]);
        let scene = stars_everywhere();
        let drawn = images(&mut renderer, &scene, &rig, &without_glare()).remove(0);
        let settings = with_glare_of(GlareMethod::ScreenPyramid, PyramidWeights::Equal, 0.5);
        let glaring = images(&mut renderer, &scene, &rig, &settings).remove(0);
        let against =
            |glaring: &[_], axes, weights| differences(&drawn, glaring, projections(&rig)[0], axes, weights)[0];
        assert!(against(&glaring, PyramidAxes::Screen, PyramidWeights::Equal) < 2e-3);
        assert!(against(&glaring, PyramidAxes::View, PyramidWeights::Equal) > 0.1);
        assert!(against(&glaring, PyramidAxes::Screen, PyramidWeights::Halved) > 0.1);
        let mut shifted = glaring;
        shifted.rotate_right(1);
        assert!(against(&shifted, PyramidAxes::Screen, PyramidWeights::Equal) > 0.1);
    }
}

/// The strips have an odd number of rows, so their borders cut blocks of 2 x 2 pixels at the base of the pyramid.
#[test]
fn pyramids_in_strips_give_the_same_bits_as_a_whole_picture() {
    let strips = GpuOptions { binding_limit_bytes: Some(160 * 16 * 25), ..Default::default() };
    let (mut whole, mut cut) = (renderer(), renderer_with(&strips));
    let rig = rig(vec![
        ("flat", perspective([160, 160], 90.0)),
        ("dome", fisheye(160, FisheyeMapping::Equidistant, 180.0)),
        ("narrow", perspective([96, 99], 20.0)),
    ]);
    let scene = stars_everywhere();
    for method in METHODS {
        let settings = with_glare_of(method, PyramidWeights::Equal, 0.3);
        // The plan chooses the unit of the sums per frame, not per batch, so even the stars are equal.
        assert_eq!(images(&mut whole, &scene, &rig, &settings), images(&mut cut, &scene, &rig, &settings));
    }
}

/// The scale of half floats depends on the brightest channel of the current frame only.
#[test]
fn a_frame_does_not_depend_on_the_brightness_of_the_previous_one() {
    let rig = rig(vec![("view", perspective([64, 64], 60.0))]);
    let scenes = [-20.0, 15.0, -26.0, 21.0].map(|magnitude| snapshot(vec![star(DVec3::NEG_Z, magnitude)]));
    let mut one_for_all = renderer();
    for method in METHODS {
        let settings = with_glare_of(method, PyramidWeights::Halved, 0.5);
        let light = scenes.each_ref().map(|scene| {
            let image = images(&mut one_for_all, scene, &rig, &settings);
            assert_eq!(image, images(&mut new_renderer(), scene, &rig, &settings));
            image[0].iter().map(|[r, ..]| f64::from(*r)).sum::<f64>()
        });
        // A difference of 35 magnitudes is a factor of 10^14.
        assert!((light[0] / light[1] / 1e14 - 1.0).abs() < 3.4e-4, "{light:?}");
        assert!(light.iter().all(|light| light.is_finite() && *light > 0.0), "{light:?}");
    }
}

/// Returns the scattered light of one view, cd/m^2. It is drawn with a fraction of 1, with which only scattered light remains.
fn veil(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    rig: &Rig,
    method: GlareMethod,
    weights: PyramidWeights,
) -> Vec<f64> {
    let image = images(renderer, scene, rig, &with_glare_of(method, weights, 1.0)).remove(0);
    image.iter().map(|[r, g, b, _]| luminance([*r, *g, *b].map(f64::from))).collect()
}

fn one_star(direction: DVec3) -> SceneSnapshot {
    snapshot(vec![star(direction, -1.0)])
}

fn lux(veil: &[f64], projection: &Projection) -> f64 {
    let mapping = projection.mapping();
    let width = mapping.size()[0];
    (0..)
        .zip(veil)
        .map(|(index, luminance): (u32, _)| luminance * mapping.solid_angle_sr(index % width, index / width))
        .sum()
}

/// Rotates `direction` by `angle_rad` towards `azimuth_rad`. An azimuth of 0 points outwards, away from the view axis.
fn rotated(direction: DVec3, angle_rad: f64, azimuth_rad: f64) -> DVec3 {
    let outwards = (DVec3::Z - direction * direction.z).normalize();
    let across = direction.cross(outwards);
    direction * angle_rad.cos() + (outwards * azimuth_rad.cos() + across * azimuth_rad.sin()) * angle_rad.sin()
}

/// Returns the interpolated luminance in a direction.
fn luminance_towards(veil: &[f64], projection: &Projection, direction: DVec3) -> f64 {
    let mapping = projection.mapping();
    let position = mapping.pixel_from_direction(direction).unwrap() - 0.5;
    let (first, part) = (position.floor(), position - position.floor());
    let pixel = |i: u32, j: u32| veil[((first.y as u32 + j) * mapping.size()[0] + first.x as u32 + i) as usize];
    let row = |j: u32| pixel(0, j) * (1.0 - part.x) + pixel(1, j) * part.x;
    row(0) * (1.0 - part.y) + row(1) * part.y
}

/// Returns the light of the glare of a star divided by the light of the star, and the luminance of the glare.
fn glare_of_star(
    renderer: &mut Renderer,
    rig: &Rig,
    direction: DVec3,
    method: GlareMethod,
    weights: PyramidWeights,
) -> (f64, Vec<f64>) {
    let veil = veil(renderer, &one_star(direction), rig, method, weights);
    (lux(&veil, projections(rig)[0]) / illuminance_lx_from_magnitude(-1.0), veil)
}

#[test]
fn glare_of_a_central_star_is_symmetric_and_has_the_weighted_profile() {
    let mut renderer = renderer();
    let rig = rig(vec![("view", perspective([256, 256], 20.0))]);
    for method in METHODS {
        for (weights, slope) in WEIGHTS.into_iter().zip([-2.0, -3.0]) {
            let (_, veil) = glare_of_star(&mut renderer, &rig, DVec3::NEG_Z, method, weights);
            for (index, luminance) in veil.iter().enumerate() {
                let (x, y) = (index % 256, index / 256);
                for other in [veil[y * 256 + 255 - x], veil[(255 - y) * 256 + x]] {
                    assert!((luminance / other - 1.0).abs() < 1e-3, "{method:?} at {x}, {y}: {luminance} {other}");
                }
            }
            let plan = PyramidPlan::new([256, 256]);
            for distance_px in [20, 40] {
                let expected = plan.per_px2(weights, f64::from(distance_px) + 0.5);
                let found = veil[128 * 256 + 128 + distance_px as usize] / veil.iter().sum::<f64>();
                assert!((found / expected - 1.0).abs() < 0.025, "{method:?} {weights:?}: {found} {expected}");
            }
            // Logarithmic slope of the luminance from 10 to 40 pixels off the star.
            let found = (veil[128 * 256 + 168] / veil[128 * 256 + 138]).ln() / (40.5_f64 / 10.5).ln();
            assert!((found - slope).abs() < 0.06, "{method:?} {weights:?}: {found}");
        }
    }
}

/// The pyramids blur luminance. If all pixels have almost the same solid angle, light is kept except for the part that leaves the picture. In a wide
/// picture, the widest levels reach pixels with smaller solid angles, and even more of these if they blur along great circles.
#[test]
fn glare_keeps_light_in_narrow_pictures_but_not_in_wide_ones() {
    let mut renderer = renderer();
    // Expected shares of the light: on the screen axes with equal and with halved weights, then the same on the view axes.
    for (degrees, expected) in [(20.0, [0.973, 0.997, 0.980, 0.998]), (140.0, [0.674, 0.916, 1.087, 1.025])] {
        let rig = rig(vec![("view", perspective([256, 256], degrees))]);
        let cases = METHODS.into_iter().flat_map(|method| WEIGHTS.map(|weights| (method, weights)));
        for ((method, weights), expected) in cases.zip(expected) {
            let (found, _) = glare_of_star(&mut renderer, &rig, DVec3::NEG_Z, method, weights);
            assert!((found - expected).abs() < 2.2e-3, "{degrees} {method:?} {weights:?}: {found}");
        }
    }
}

/// At an angle a off the axis of a flat picture, a small angle covers 1 / cos a times as many pixels in the radial direction as across it. Glare that
/// is round on the screen and falls off with the square of the distance is therefore cos^2 a times as bright there: 0.5 at 45 degrees, 0.25 at 60.
/// The view-space method has 0.88 to 1.00, because its taps are a few texels apart where pixels are small.
#[test]
fn off_axis_glare_is_elliptic_on_screen_axes_and_rounder_on_view_axes() {
    let mut renderer = renderer();
    let rig = rig(vec![("view", perspective([512, 512], 150.0))]);
    for off_axis_deg in [45.0_f64, 60.0] {
        for azimuth_deg in [0.0_f64, 45.0, 90.0] {
            let (sin, cos) = off_axis_deg.to_radians().sin_cos();
            let (up, right) = azimuth_deg.to_radians().sin_cos();
            let direction = DVec3::new(sin * right, sin * up, -cos);
            let [screen, view] = METHODS.map(|method| {
                let (_, veil) = glare_of_star(&mut renderer, &rig, direction, method, PyramidWeights::Equal);
                let luminance = |azimuth_rad: f64| {
                    // Use the mean over a few rings, because the taps of the blurs are visible in single rings.
                    let ring = |angle_deg: f64| {
                        let direction = rotated(direction, angle_deg.to_radians(), azimuth_rad);
                        luminance_towards(&veil, projections(&rig)[0], direction) * angle_deg * angle_deg
                    };
                    [5.0, 6.0, 7.0, 8.0].map(ring).iter().sum::<f64>()
                };
                (luminance(0.0) + luminance(PI)) / (luminance(0.5 * PI) + luminance(1.5 * PI))
            });
            assert!((screen / (cos * cos) - 1.0).abs() < 0.04, "{off_axis_deg} {azimuth_deg}: {screen}");
            assert!((0.86..1.02).contains(&view), "{off_axis_deg} {azimuth_deg}: {view}");
        }
    }
}

/// A star approaches the right edge and leaves the picture. Positions are in pixels from the centre.
#[test]
fn glare_is_too_bright_at_edges_and_missing_beyond_them() {
    let mut renderer = renderer();
    let rig = rig(vec![("view", perspective([256, 256], 60.0))]);
    let step = 2.0 * (PI / 6.0).tan() / 256.0;
    for (method, at_edge) in METHODS.into_iter().zip([1.78, 1.21]) {
        let mut glare_at = |px: f64| {
            let (kept, veil) = glare_of_star(
                &mut renderer,
                &rig,
                DVec3::new(px * step, 0.5 * step, -1.0),
                method,
                PyramidWeights::Equal,
            );
            (kept, veil.iter().fold(0.0_f64, |a, b| a.max(*b)))
        };
        // Half of the glare of a star at the edge should be outside of the picture, but the picture contains more light than
        // the star has.
        let (edge, _) = glare_at(126.5);
        assert!((edge - at_edge).abs() < 0.02, "{method:?}: {edge}");
        // Once no pixel contains light of the star, the veil vanishes, although half of the veil's light should be in the picture.
        assert_eq!(glare_at(131.0), (0.0, 0.0), "{method:?}");
    }
}

#[test]
fn glare_does_not_cross_the_edge_of_a_cube_face() {
    let mut renderer = renderer();
    let rig = rig(vec![("cube", cube(64))]);
    let at_edge = DVec3::new(0.9, 0.0, -1.0);
    for method in METHODS {
        let settings = with_glare_of(method, PyramidWeights::Equal, 1.0);
        let faces = images(&mut renderer, &one_star(at_edge), &rig, &settings);
        let lit = faces.iter().filter(|face| face.iter().any(|[r, ..]| *r > 0.0)).count();
        assert_eq!(lit, 1, "{method:?}");
    }
}

#[test]
fn taps_behind_the_eye_mirror_a_star_in_a_wide_picture() {
    let mut renderer = renderer();
    let rig = rig(vec![("view", perspective([128, 128], 150.0))]);
    let left_direction = DVec3::new(-70_f64.to_radians().tan(), 0.0, -1.0);
    let [screen, view] = METHODS.map(|method| {
        let (_, veil) = glare_of_star(&mut renderer, &rig, left_direction, method, PyramidWeights::Equal);
        // Ratio of the luminance at the right border to that at a point half way between the centre and the border.
        veil[64 * 128 + 124] / veil[64 * 128 + 84]
    });
    assert!(screen < 0.2, "{screen}");
    assert!(view > 1.8, "{view}");
}

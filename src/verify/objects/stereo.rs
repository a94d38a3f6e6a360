//! Two eyes see an asteroid that recedes, through all levels of detail from its finest mesh to a point.

use glam::{DQuat, DVec2, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
    },
    stage::{Detail, Light, PLACES, Posed, RADIUS_M, bound_m, eye_m, light_and_middle, window},
};
use crate::{
    render::FrameImage,
    view::{Fov, Rig, View, ViewKind, projection::Projection},
};

/// Angle of a pixel, rad.
const PIXEL_RAD: f64 = 3e-3;
/// Nearest distance, mean radii. At this distance, the finest mesh is the correct level of detail.
const NEAREST: f64 = 14.0;
/// Growth of the distance from one step to the next.
const GROWTH: f64 = 1.04;
/// Distance between the eyes, mean radii. Disparity determines where impostors start, and is many pixels there.
const EYES: f64 = 1.0;
/// Sub-pixel positions at which each step is seen.
const SUB_PIXEL: [DVec2; 4] =
    [DVec2::new(0.13, 0.41), DVec2::new(0.63, 0.16), DVec2::new(0.38, 0.66), DVec2::new(0.88, 0.91)];

/// Light, lx, and centroid, px, of an asteroid in both eyes.
type Measured = [(f64, DVec2); 2];

/// A step at one sub-pixel position, as drawn and as in the truth, with its distance.
struct Step {
    drawn: Measured,
    truth: Measured,
    distance_m: f64,
}

/// 25: compares disparity with the finest mesh and with the closed form, and height in both eyes; measures changes from
/// step to step.
pub(in crate::verify) fn in_stereo(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let eyes_m = EYES * RADIUS_M;
    let projection = Rig::new(vec![View::new("eye", window(64, PIXEL_RAD, 0.0), DQuat::IDENTITY, DVec3::ZERO)?])?;
    let projection = projection.views().iter().flat_map(|view| &view.images).map(|image| &image.projection).next();
    let projection: Projection = projection.cloned().ok_or(CheckError::Missing("an image"))?;
    let detail = Detail::new(&context.settings.asteroids, &projection, DVec3::NEG_Z, eyes_m);
    let nearest_m = NEAREST * RADIUS_M;
    let count = ((2.5 * detail.points_m() / nearest_m).ln() / GROWTH.ln()).ceil() as usize;
    let distances: Vec<f64> = (0..count).map(|step| nearest_m * GROWTH.powi(step as i32)).collect();

    // A rig holds 64 images. A step needs two images at each of four sub-pixel positions: eight steps.
    let mut steps: Vec<Vec<Step>> = Vec::new();
    for some in distances.chunks(PLACES / 2 / SUB_PIXEL.len()) {
        let cases: Vec<(f64, DVec2)> = some.iter().flat_map(|d| SUB_PIXEL.map(|place| (*d, place))).collect();
        let measured = measured(context, &cases, eyes_m)?;
        let mut measured = measured.into_iter();
        for distance_m in some {
            let of_step = measured.by_ref().take(SUB_PIXEL.len());
            steps.push(of_step.map(|[drawn, truth]| Step { drawn, truth, distance_m: *distance_m }).collect());
        }
    }

    let disparity = |measured: &Measured| measured[0].1.x - measured[1].1.x;
    let height = |measured: &Measured| measured[0].1.y - measured[1].1.y;
    let all = || steps.iter().flatten();
    let closed = all().map(|step| {
        // Pixels of a flat window are evenly spaced in tangents.
        let expected = eyes_m / step.distance_m / PIXEL_RAD;
        // The lit part, and therefore the centroid, may be up to a radius nearer or farther than the asteroid's position.
        let depth = eyes_m / (step.distance_m - RADIUS_M) / PIXEL_RAD - expected;
        (disparity(&step.drawn) - expected).abs() - depth
    });
    let error = all().map(|step| (disparity(&step.drawn) - disparity(&step.truth)).abs());
    let vertical = all().map(|step| (height(&step.drawn) - height(&step.truth)).abs());
    // Average over the sub-pixel positions, because edges are sampled.
    let mean = |figure: &dyn Fn(&Step) -> f64| -> Vec<f64> {
        steps.iter().map(|step| step.iter().map(figure).sum::<f64>() / step.len() as f64).collect()
    };
    // Where the mesh has few samples, the true light is computed from the light at distances with many samples. It is inversely proportional to the
    // squared distance.
    let squared = |step: &Step| step.distance_m * step.distance_m;
    let many_m = 0.4 * detail.points_m();
    let known = all().filter(|step| step.distance_m > many_m && step.distance_m < many_m * GROWTH.powi(3));
    let known: Vec<f64> = known.map(|step| eyes(&step.truth) * squared(step)).collect();
    let far_lx_m2 = known.iter().sum::<f64>() / known.len() as f64;
    let flux = mean(&|step: &Step| {
        let truth = if step.distance_m > many_m { far_lx_m2 / squared(step) } else { eyes(&step.truth) };
        eyes(&step.drawn) / truth
    });
    let aside = [0, 1].map(|axis| mean(&|step: &Step| step.drawn[0].1[axis] - step.truth[0].1[axis]));
    // Returns the largest difference per step between the mean of `some` steps and the mean of as many preceding steps.
    let jumps = |values: &[f64], some: usize| {
        let means: Vec<f64> = values.windows(some).map(|window| window.iter().sum::<f64>() / some as f64).collect();
        worst(means.iter().zip(means.iter().skip(some)).map(|(before, after)| (after - before).abs() / some as f64))
    };
    let points_m = detail.points_m();
    let near = distances.iter().filter(|distance_m| **distance_m < points_m).count();
    let lost = |shown: &dyn Fn(f64) -> bool| {
        let shown = steps.iter().zip(&flux).filter(|(step, _)| step.first().is_some_and(|step| shown(step.distance_m)));
        worst(shown.map(|(_, flux)| (flux - 1.0).abs()))
    };
    let off = worst(aside[0].iter().zip(&aside[1]).map(|(x, y)| x.hypot(*y)));
    Ok(vec![
        Figure::informative("steps", steps.len() as f64, ""),
        Figure::at_most("disparity against the mesh", worst(error), 0.5, "px"),
        Figure::at_most(
            "disparity against the closed form, in excess of the asteroid's depth",
            worst(closed),
            0.5,
            "px",
        ),
        Figure::at_most("difference in height", worst(vertical), 0.25, "px"),
        Figure::at_most("light of meshes and impostors", lost(&|distance_m| distance_m < points_m), 0.05, "relative"),
        Figure::informative("light of the point", lost(&|distance_m| distance_m >= 2.0 * points_m), "relative"),
        Figure::at_most("change of light in a step", jumps(&flux[..near], 3), 0.02, "relative"),
        // A point covers few samples at a diameter of one or two pixels, so average six steps.
        Figure::at_most("change while the point replaces the mesh", jumps(&flux[near..], 6), 0.02, "relative"),
        Figure::at_most("middle against the mesh", off, 0.5, "px"),
        Figure::at_most("change of the middle in a step", jumps(&aside[0], 3).max(jumps(&aside[1], 3)), 0.1, "px"),
    ])
}

/// Returns the mean light of both eyes, lx.
fn eyes(measured: &Measured) -> f64 {
    0.5 * (measured[0].0 + measured[1].0)
}

/// Measures asteroids in two eyes at distances and sub-pixel positions, drawn and true.
fn measured(context: &mut Context<'_>, cases: &[(f64, DVec2)], eyes_m: f64) -> Result<Vec<[Measured; 2]>, CheckError> {
    // Separate the pairs of eyes by the width of the field of view at the farthest asteroid.
    let spacing_m = cases.iter().map(|(distance_m, _)| *distance_m).fold(0.0, f64::max) * 0.6 + 4.0 * eyes_m;
    let pose = |(index, (distance_m, place)): (usize, &(f64, DVec2))| Posed {
        // The asteroids are on a plane, so that the depth equals the distance.
        place_m: eye_m(index, spacing_m) + DVec3::new(place.x * PIXEL_RAD, place.y * PIXEL_RAD, -1.0) * *distance_m,
        camera_from_shape: DQuat::from_euler(glam::EulerRot::XYZ, 0.5, 1.1, 0.3),
    };
    let posed: Vec<Posed> = cases.iter().enumerate().map(pose).collect();
    // The nearest asteroid determines the size of the window.
    let nearest_m = cases.iter().map(|(distance_m, _)| *distance_m).fold(f64::INFINITY, f64::min);
    let side = (2.0 * (bound_m() / (nearest_m - bound_m()) / PIXEL_RAD).ceil()) as u32 + 12;
    let tangent = 0.5 * f64::from(side) * PIXEL_RAD;
    let views = cases.iter().enumerate().map(|(index, (distance_m, _))| {
        // Each eye's window is shifted by half the disparity in whole pixels, like the canted fields of a headset.
        let shift = (0.5 * eyes_m / distance_m / PIXEL_RAD).round() * PIXEL_RAD;
        let fov_left = Fov {
            left_rad: (shift - tangent).atan(),
            right_rad: (shift + tangent).atan(),
            up_rad: tangent.atan(),
            down_rad: -tangent.atan(),
        };
        let kind = ViewKind::Stereo { size: [side; 2], ipd_m: eyes_m, fov_left, fov_right: fov_left.mirrored() };
        View::new(&format!("step-{index}"), kind, DQuat::IDENTITY, eye_m(index, spacing_m))
    });
    let rig = Rig::new(views.collect::<Result<_, _>>()?)?;
    let light = Light::Sun(DVec3::new(0.8, 0.3, 0.8));
    let [drawn, truth] = context.drawn_and_true(&posed, light, &rig)?;
    // Positions are measured in one common window for both eyes.
    let measure = |images: &[FrameImage]| -> Result<Vec<Measured>, CheckError> {
        let view_images = rig.views().iter().flat_map(|view| &view.images);
        let each = images.iter().zip(view_images).map(|(image, view_image)| {
            let mapping = view_image.projection.mapping();
            let (light, middle) = light_and_middle(image, mapping)?;
            let axis = mapping.pixel_from_direction(DVec3::NEG_Z).ok_or(CheckError::Missing("a pixel"))?;
            Ok((light, middle - axis))
        });
        let each = each.collect::<Result<Vec<_>, CheckError>>()?;
        Ok(each.chunks_exact(2).map(|eyes| [eyes[0], eyes[1]]).collect())
    };
    let (drawn, truth) = (measure(&drawn)?, measure(&truth)?);
    Ok(drawn.into_iter().zip(truth).map(|(drawn, truth)| [drawn, truth]).collect())
}

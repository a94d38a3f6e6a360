//! Rendered kernels: position, width, flicker and roundness of a star over its sub-pixel positions.
//!
//! Each position has a small view, which is turned so that the star is at this position. A frame has sixty views. Thus
//! each star is at the centre of a picture, however large the picture is, and thousands of positions take seconds.

use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3};

use super::{
    Figure,
    context::{CheckError, Context, hdr_view, images, worst},
    scenes::{snapshot, spiral, star},
};
use crate::{
    metrics::{FlickerMeter, HdrView, centroid_error_px, illuminance_lx, shape_px, shape_rad, sub_pixel_positions},
    plan::settings::StarMethod,
    units::illuminance_lx_from_magnitude,
    view::{
        Fov, Rig, View, ViewKind,
        projection::{Perspective, PlaneMapping},
    },
};

/// Number of views in a frame; an adapter supports 64.
const VIEWS: usize = 60;
/// Side of a view, pixels.
const SIDE: u32 = 64;
/// Tangent of a pixel's angle in a view 60 degrees high with 1080 lines.
fn pixel_tangent() -> f64 {
    2.0 * (PI / 6.0).tan() / 1080.0
}

/// Returns a window of [`SIDE`] pixels of a flat picture with its centre at `tangent` to the right of the axis.
fn window(tangent: f64) -> ViewKind {
    let half = pixel_tangent() * f64::from(SIDE) / 2.0;
    let fov = Fov {
        left_rad: (tangent - half).atan(),
        right_rad: (tangent + half).atan(),
        up_rad: half.atan(),
        down_rad: (-half).atan(),
    };
    ViewKind::OffAxis { size: [SIDE; 2], fov }
}

/// Returns the mapping of the view, used to place stars.
fn mapping_of(kind: &ViewKind) -> Result<Perspective, CheckError> {
    let ViewKind::OffAxis { size, fov } = kind else { return Err(CheckError::Missing("an off-axis view")) };
    Ok(Perspective::off_axis(*size, fov.left_rad, fov.right_rad, fov.up_rad, fov.down_rad)?)
}

/// Draws one star at many sub-pixel positions at the centre of a window. Passes each image, the star's position in pixels and its direction in the
/// view to `look`.
fn pan(
    context: &mut Context<'_>,
    kind: &ViewKind,
    magnitude: f32,
    positions: usize,
    mut look: impl FnMut(&HdrView<'_>, DVec2, DVec3) -> Result<(), CheckError>,
) -> Result<(), CheckError> {
    let mapping = mapping_of(kind)?;
    let scene = snapshot(vec![star(DVec3::NEG_Z, magnitude)]);
    let places: Vec<DVec2> =
        sub_pixel_positions(positions).map(|position| DVec2::splat(f64::from(SIDE / 2)) + position).collect();
    for some in places.chunks(VIEWS) {
        let (mut views, mut directions) = (Vec::new(), Vec::new());
        for (index, place) in some.iter().enumerate() {
            let direction = mapping.direction_from_pixel(*place).ok_or(CheckError::Missing("a direction"))?;
            let turn = DQuat::from_rotation_arc(direction, DVec3::NEG_Z);
            views.push(View::new(&format!("v{index}"), kind.clone(), turn, DVec3::ZERO)?);
            directions.push(direction);
        }
        let rig = Rig::new(views)?;
        let frame = context.render(&scene, &rig)?;
        if frame.images.len() != some.len() {
            return Err(CheckError::Missing("an image"));
        }
        for ((image, of_view), (place, direction)) in images(&frame, &rig).zip(some.iter().zip(directions)) {
            look(&hdr_view(image, of_view.projection.mapping())?, *place, direction)?;
        }
    }
    Ok(())
}

/// Magnitude of the stars in these checks.
const MAGNITUDE: f32 = 3.0;

fn light_lx() -> f64 {
    illuminance_lx_from_magnitude(f64::from(MAGNITUDE))
}

/// Returns the luminance that must be displayed as white so that the peak of a star, in one pixel, is `k` times as bright as white.
fn white_for(k: f64, kind: &ViewKind) -> Result<f64, CheckError> {
    let omega = mapping_of(kind)?.solid_angle_sr(SIDE / 2, SIDE / 2);
    Ok(light_lx() / omega / k)
}

/// 9: measures position and width of a star ten times as bright as white.
pub(super) fn sub_pixel_sweep(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let kind = window(0.0);
    context.expose_for(white_for(10.0, &kind)?);
    let (mut centroid, mut widths) = (Vec::new(), Vec::new());
    pan(context, &kind, MAGNITUDE, 600, |image, place, _| {
        // The measuring window covers the whole picture, so that stray light counts.
        centroid.push(centroid_error_px(image, place, 100.0)?);
        widths.push(shape_px(image, place, 100.0)?.rms_radius());
        Ok(())
    })?;
    let mean = widths.iter().sum::<f64>() / widths.len() as f64;
    let width = worst(widths.iter().map(|width| (width / mean - 1.0).abs()));
    Ok(vec![
        Figure::at_most("centroid", worst(centroid), 0.005, "px"),
        Figure::at_most("width", width, 0.005, "relative"),
        Figure::informative("mean width", mean, "px"),
    ])
}

/// Measures the flicker, after tone mapping, of a star whose peak is `k` times white. Uses `positions` positions.
fn flicker(context: &mut Context<'_>, k: f64, positions: usize) -> Result<f64, CheckError> {
    let kind = window(0.0);
    let white = white_for(k, &kind)?;
    context.expose_for(white);
    // The exposure for a relative method is scaled by its mean light, so that k is the same.
    let mut scale = 1.0;
    if context.method().is_relative() {
        let mut sum = 0.0;
        pan(context, &kind, MAGNITUDE, VIEWS, |image, _, _| {
            sum += illuminance_lx(image)?;
            Ok(())
        })?;
        scale = light_lx() * VIEWS as f64 / sum;
    }
    let mut meter = FlickerMeter::new(white / scale)?;
    pan(context, &kind, MAGNITUDE, positions, |image, _, _| Ok(meter.add(image)?))?;
    Ok(meter.flicker()?.after)
}

/// 10: measures flicker at 1, 10 and 100 times white. The limit for the B-spline is larger: 0.04, up to 10 times white.
pub(super) fn slow_pan(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mut figures = Vec::new();
    for k in [1.0, 10.0, 100.0] {
        let found = flicker(context, k, 3000)?;
        let name = format!("flicker at {k} times white");
        figures.push(match context.method() {
            StarMethod::BSpline if k > 10.0 => Figure::informative(name, found, ""),
            StarMethod::BSpline => Figure::at_most(name, found, 0.04, ""),
            _ => Figure::at_most(name, found, 0.02, ""),
        });
    }
    figures.push(Figure::at_most("jump as a star brightens", brightening(context)?, 0.02, "relative"));
    Ok(figures)
}

/// A star brightens slowly from 1/20 of white to 20 times white. Returns the largest change, from one step to the next,
/// in the growth of its displayed light. Even if a method changes its kernel with brightness, the star must not jump.
fn brightening(context: &mut Context<'_>) -> Result<f64, CheckError> {
    let kind = window(0.0);
    let mapping = mapping_of(&kind)?;
    context.expose_for(white_for(1.0, &kind)?);
    let white = white_for(1.0, &kind)?;
    // A position between the centre and the corner of a pixel, where kernels differ by their average amount.
    let towards = mapping.direction_from_pixel(DVec2::new(32.3, 32.2)).ok_or(CheckError::Missing("a direction"))?;
    let range = 2.5 * 20f64.log10();
    let (mut records, mut views) = (Vec::new(), Vec::new());
    for (index, direction) in spiral(VIEWS).enumerate() {
        let fainter = range * (1.0 - 2.0 * index as f64 / (VIEWS - 1) as f64);
        records.push(star(direction, MAGNITUDE + fainter as f32));
        let turn = DQuat::from_rotation_arc(towards, direction);
        views.push(View::new(&format!("v{index}"), kind.clone(), turn, DVec3::ZERO)?);
    }
    let rig = Rig::new(views)?;
    let frame = context.render(&snapshot(records), &rig)?;
    let mut displayed = Vec::new();
    for (image, of_view) in images(&frame, &rig) {
        let image = hdr_view(image, of_view.projection.mapping())?;
        let mut sum = 0.0;
        for y in 0..SIDE {
            for x in 0..SIDE {
                let level = image.luminance_cd_m2(x, y) / white;
                sum += level / (1.0 + level);
            }
        }
        displayed.push(f64::ln(sum));
    }
    let growth: Vec<f64> = displayed.windows(2).map(|pair| pair[1] - pair[0]).collect();
    Ok(worst(growth.windows(2).map(|pair| (pair[1] - pair[0]).abs())))
}

/// Measures the shape of a star in the sky, on the axis of a flat picture and 45 degrees off it. A star narrower than a
/// pixel has the shape of the pixels. A resolved star must be round.
pub(super) fn roundness(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mut figures = Vec::new();
    for (degrees, tangent) in [(0, 0.0), (45, 1.0)] {
        let kind = window(tangent);
        context.expose_for(white_for(10.0, &window(0.0))?);
        let (mut ellipticities, mut narrow_px) = (Vec::new(), Vec::new());
        pan(context, &kind, MAGNITUDE, 60, |image, place, direction| {
            narrow_px.push(shape_px(image, place, 100.0)?.minor);
            // A point has no shape to measure.
            ellipticities.extend(shape_rad(&[*image], direction, 0.2)?.ellipticity());
            Ok(())
        })?;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let name = format!("ellipticity at {degrees} degrees");
        let resolved = mean(&narrow_px) >= 1.0;
        figures.push(match (ellipticities.is_empty(), resolved) {
            (true, _) => Figure::informative(format!("{name}: a point, width"), 0.0, "px"),
            (false, true) => Figure::at_most(name, mean(&ellipticities), 0.05, ""),
            (false, false) => Figure::informative(format!("{name} (narrower than a pixel)"), mean(&ellipticities), ""),
        });
    }
    Ok(figures)
}

//! Robustness of sums of light: many stars in a pixel, dynamic range, overflow, order, colour.

use glam::{DVec2, DVec3};
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
    Figure,
    context::{CheckError, Context, hdr_pixels, hdr_view, images, light_of_views_lx, worst},
    scenes::{cube, rig, snapshot, spiral, star},
};
use crate::{
    catalogue::{StarRecord, chunks::StarSet},
    metrics::{Difference, MetricError, PointSource, faint_beside_bright, order_dependence, uv_distance},
    photometry::{blackbody::rec709_in_gamut, rec709::luminance},
    plan::settings::Accumulator,
    render::{Frame, RenderError},
    scene::{Camera, SceneSnapshot},
    units::illuminance_lx_from_magnitude,
    view::{Rig, ViewKind},
};

/// Returns a small view whose central pixel looks at -z; its pixels are an arcminute wide, so that a star of magnitude
/// 20 is within the range of a half float.
fn small_rig() -> Result<Rig, CheckError> {
    Ok(rig([("v", ViewKind::Perspective { size: [33, 33], fov_y_rad: 0.0096 })])?)
}

/// Returns the light of a crowd of stars in one pixel, divided by the number of stars and by the light of one star. For methods of relative
/// brightness, this star is drawn alone; for other methods its light is that of the catalogue.
fn crowd(context: &mut Context<'_>, count: usize, magnitude: f32) -> Result<f64, CheckError> {
    let rig = small_rig()?;
    let light = context.light_lx(&snapshot(vec![star(DVec3::NEG_Z, magnitude); count]), &rig)?[0];
    let one_lx = if context.method().is_relative() {
        context.light_lx(&snapshot(vec![star(DVec3::NEG_Z, magnitude)]), &rig)?[0]
    } else {
        illuminance_lx_from_magnitude(f64::from(magnitude))
    };
    if one_lx > 0.0 { Ok(light / (one_lx * count as f64)) } else { Err(MetricError::NoLight("a star").into()) }
}

/// 11: a million stars, each far below the precision of a 16-bit float sum.
pub(super) fn million_faint(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let kept = crowd(context, 1_000_000, 20.0)?;
    Ok(vec![
        Figure::at_most("light", (kept - 1.0).abs(), 1e-3, "relative"),
        Figure::informative("share kept", kept, ""),
    ])
}

/// Tests the published weakness of sums in 16-bit floats: they stop growing.
pub(super) fn equal_stars(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let kept = crowd(context, 20_000, 10.0)?;
    // Faint stars are added to a brighter one.
    let rig = small_rig()?;
    let mut records = vec![star(DVec3::NEG_Z, 12.0)];
    let alone = context.light_lx(&snapshot(records.clone()), &rig)?[0];
    records.resize(20_001, star(DVec3::NEG_Z, 20.0));
    let together = context.light_lx(&snapshot(records), &rig)?[0];
    // The scale of a relative method comes from the bright star.
    let scale = if context.method().is_relative() { illuminance_lx_from_magnitude(12.0) / alone } else { 1.0 };
    let faint_kept = scale * (together - alone) / (2e4 * illuminance_lx_from_magnitude(20.0));
    Ok(vec![
        Figure::at_most("light of 20,000 equal stars", (kept - 1.0).abs(), 1e-3, "relative"),
        Figure::informative("share kept", kept, ""),
        Figure::at_most(
            "light of 20,000 stars of magnitude 20 on one of 12",
            (faint_kept - 1.0).abs(),
            1e-3,
            "relative",
        ),
        Figure::informative("share kept", faint_kept, ""),
    ])
}

/// 12: a faint star and one that is a hundred million times as bright, without the Sun and with it.
pub(super) fn sirius(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = rig([("v", ViewKind::Perspective { size: [129, 129], fov_y_rad: 0.2 })])?;
    let mapping = rig.views()[0].images[0].projection.mapping();
    let sources = [(30.3, 30.4, -1.46_f32), (62.6, 30.2, 21.0), (30.5, 90.5, -26.7)];
    let mut points = Vec::new();
    for (x, y, magnitude) in sources {
        let pixel = DVec2::new(x, y);
        let direction = mapping.direction_from_pixel(pixel).ok_or(CheckError::Missing("a direction"))?;
        let illuminance_lx = illuminance_lx_from_magnitude(f64::from(magnitude));
        points.push((star(direction, magnitude), PointSource { pixel, illuminance_lx }));
    }
    let mut figures = Vec::new();
    for (stars, name) in [(2, ""), (3, " with the Sun")] {
        let frame = context.render(&snapshot(points[..stars].iter().map(|point| point.0).collect()), &rig)?;
        let image = frame.images.first().ok_or(CheckError::Missing("an image"))?;
        let image = hdr_view(image, mapping)?;
        let found = faint_beside_bright(&image, points[0].1, points[1].1, 12.0)?;
        // A relative method is scaled to the bright star, so only the faint star near it is judged.
        let relative = context.method().is_relative();
        let faint =
            if relative { (1.0 + found.faint_error) / (1.0 + found.bright_error) - 1.0 } else { found.faint_error };
        if !relative {
            figures.push(Figure::at_most(format!("light of Sirius{name}"), found.bright_error.abs(), 0.02, "relative"));
        }
        figures.push(Figure::at_most(format!("of magnitude 21{name}"), faint.abs(), 0.02, "relative"));
    }
    Ok(figures)
}

/// 13: sums that exceed their range. Fixed-point units are deliberately too fine. The light of sixty-four Suns in a
/// small pixel must be correct, or an overflow must be reported.
pub(super) fn overflow(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = rig([("v", ViewKind::Perspective { size: [33, 33], fov_y_rad: 0.01 })])?;
    let mut figures = Vec::new();
    if context.method().accumulator() == Accumulator::FixedPoint {
        let scene = snapshot(vec![star(DVec3::NEG_Z, 2.0); 4096]);
        let expected = 4096.0 * illuminance_lx_from_magnitude(2.0);
        // Within the reserve of the range, the light must be correct. Beyond it, the frame must be refused.
        let (mut wrong, mut reported) = (0, 0);
        for exponent in [0, 6, 10, 20, 30, 40] {
            context.renderer.unit_factor = 2f64.powi(exponent);
            let result = context.render(&scene, &rig);
            context.renderer.unit_factor = 1.0;
            match result {
                Err(CheckError::Render(RenderError::Overflow(_))) => reported += 1,
                Ok(frame) => {
                    let error = light_of_views_lx(&frame, &rig)?[0] / expected - 1.0;
                    wrong += u32::from(error.is_nan() || error.abs() > 1e-3);
                }
                Err(error) => return Err(error),
            }
        }
        if reported == 0 {
            return Err(CheckError::Missing("an overflow, which was provoked"));
        }
        figures.push(Figure::at_most("provoked overflows not reported", f64::from(wrong), 0.0, ""));
        figures.push(Figure::informative("reported", f64::from(reported), "of 6"));
    }
    let suns = snapshot(vec![star(DVec3::NEG_Z, -26.7); 64]);
    let one = snapshot(vec![star(DVec3::NEG_Z, 2.0)]);
    let lost = match context.render(&suns, &rig) {
        Err(CheckError::Render(RenderError::Overflow(_))) => 0.0,
        Err(error) => return Err(error),
        Ok(frame) => match light_of_views_lx(&frame, &rig) {
            // The frame has values that are not finite, but was not refused.
            Err(CheckError::Metric(MetricError::NotLight { .. })) => 1.0,
            Err(error) => return Err(error),
            Ok(light) => {
                let star_lx = context.light_lx(&one, &rig)?[0];
                let of_one = if context.method().is_relative() { star_lx } else { illuminance_lx_from_magnitude(2.0) };
                let expected = 64.0 * of_one * 10f64.powf(0.4 * f64::from(2.0_f32 + 26.7));
                (light[0] / expected - 1.0).abs()
            }
        },
    };
    figures.push(Figure::at_most("light of 64 Suns in a pixel that is lost without a report", lost, 1e-3, "relative"));
    Ok(figures)
}

/// 14: draws a hundred orders of the catalogue. Each changes the order in which the stars reach the GPU, so a method
/// cannot pass by sorting alone. Also reports the effect of other orders of the set's chunks, which no catalogue
/// produces: the hash that rounds a star depends on its index in the set.
pub(super) fn shuffled(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const SHUFFLES: u64 = 100;
    let mut records: Vec<StarRecord> = spiral(2000)
        .enumerate()
        .map(|(i, direction)| StarRecord { temperature_k: 2500.0 + i as f32 * 7.0, ..star(direction, (i % 17) as f32) })
        .collect();
    // Half of the stars are concentrated in a few pixels, so that many threads add to the same sums.
    for record in records.iter_mut().step_by(2) {
        record.position = (DVec3::NEG_Z + record.position * 0.01).normalize();
    }
    let rig = rig([("flat", ViewKind::Perspective { size: [160, 90], fov_y_rad: 1.0 }), ("cube", cube(32))])?;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let first = context.render(&snapshot(records.clone()), &rig)?;
    // Two black pictures would also be equal, which would prove nothing.
    if worst(light_of_views_lx(&first, &rig)?) == 0.0 {
        return Err(MetricError::NoLight("shuffled stars").into());
    }
    let (mut changed, mut largest, mut largest_of_chunks) = (0, 0.0_f64, 0.0_f64);
    for shuffle in 0..SHUFFLES {
        records.shuffle(&mut random);
        context.renderer.catalogue_order = Some(shuffle);
        let frame = context.render(&snapshot(records.clone()), &rig);
        context.renderer.catalogue_order = None;
        let found = change(&first, &frame?, &rig)?;
        changed += u32::from(!found.identical);
        largest = largest.max(found.largest_of_brightest);
        if shuffle % 10 == 0 {
            let mut set = StarSet::from_records(records.clone());
            set.chunks.shuffle(&mut random);
            let scene = SceneSnapshot {
                revision: 1,
                stars: reordered(&set).into(),
                objects: Default::default(),
                camera: Camera::default(),
            };
            let found = change(&first, &context.render(&scene, &rig)?, &rig)?;
            largest_of_chunks = largest_of_chunks.max(found.largest_of_brightest);
        }
    }
    Ok(vec![
        Figure::at_most("shuffles, out of 100, that changed a bit", f64::from(changed), 0.0, ""),
        Figure::informative("largest change, relative to the brightest pixel", largest, ""),
        Figure::informative("with chunks in another order", largest_of_chunks, ""),
    ])
}

/// Returns the largest difference of any image of two frames.
fn change(before: &Frame, now: &Frame, rig: &Rig) -> Result<Difference, CheckError> {
    let mut worst: Option<Difference> = None;
    for ((before, of_view), (now, _)) in images(before, rig).zip(images(now, rig)) {
        let mapping = of_view.projection.mapping();
        let found = order_dependence(&[hdr_view(before, mapping)?, hdr_view(now, mapping)?])?;
        worst = Some(match worst {
            Some(other) if other.largest_of_brightest > found.largest_of_brightest => {
                Difference { identical: other.identical && found.identical, ..other }
            }
            Some(other) => Difference { identical: other.identical && found.identical, ..found },
            None => found,
        });
    }
    worst.ok_or(CheckError::Missing("an image"))
}

/// Returns the same set with its stars in the current order of its chunks.
fn reordered(set: &StarSet) -> StarSet {
    let mut other = StarSet::default();
    for chunk in &set.chunks {
        let first = other.stars.len() as u32;
        other.stars.extend_from_slice(set.stars_of(chunk));
        other.chunks.push(crate::catalogue::chunks::Chunk { first, ..*chunk });
    }
    other
}

/// 15: light adds, temperatures do not.
pub(super) fn two_colours(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = small_rig()?;
    let mapping = rig.views()[0].images[0].projection.mapping();
    let star_of = |temperature_k: f32| StarRecord { temperature_k, ..star(DVec3::NEG_Z, 3.0) };
    let frame = context.render(&snapshot(vec![star_of(3000.0), star_of(20_000.0)]), &rig)?;
    let pixels = hdr_pixels(frame.images.first().ok_or(CheckError::Missing("an image"))?)?;
    let rgb = |pixel: &[f32; 4]| [pixel[0], pixel[1], pixel[2]].map(f64::from);
    let [mut brightest, mut all] = [[0.0; 3]; 2];
    for (index, pixel) in pixels.iter().enumerate() {
        let colour = rgb(pixel);
        let omega = mapping.solid_angle_sr(index as u32 % 33, index as u32 / 33);
        for (sum, channel) in all.iter_mut().zip(colour) {
            *sum += channel * omega;
        }
        if luminance(colour) > luminance(brightest) {
            brightest = colour;
        }
    }
    let (red, blue) = (rec709_in_gamut(3000.0), rec709_in_gamut(20_000.0));
    let expected = [red[0] + blue[0], red[1] + blue[1], red[2] + blue[2]];
    let error = |colour| uv_distance(colour, expected).unwrap_or(f64::NAN);
    Ok(vec![Figure::at_most("colour of 3000 K and 20000 K", worst([error(brightest), error(all)]), 0.003, "u'v'")])
}

//! Compares solid angles with f64: those of rendered frames, and those that the adapter computes in a separate test of its arithmetic.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec2, DVec3};

use super::{
    Figure,
    context::{CheckError, Context, hdr_pixels, hdr_view, images, worst},
    scenes::{cube, fisheye, rig, snapshot, spiral, star},
};
use crate::{
    metrics,
    reference::triangle_solid_angle::{face_errors, pixel_solid_angle_sr},
    render::probe::{Probe, probe},
    units::illuminance_lx_from_magnitude,
    view::{
        Fov, Part, ViewKind, Viewport,
        projection::{
            CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping, Projection,
            ProjectionError, pixel_centre,
        },
    },
};

/// Limit of the failure test for the sum of a picture's solid angles, relative. At the orthographic rim, the density is
/// unbounded.
fn sum_limit(kind: &ViewKind) -> f64 {
    match kind {
        ViewKind::Fisheye { mapping: FisheyeMapping::Orthographic, .. } => 1e-3,
        _ => 1e-6,
    }
}

/// 1: sums the solid angles that the renderer returns with a picture of 4096 pixels.
pub(super) fn sum(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let empty = snapshot(Vec::new());
    let kinds = [
        ("perspective", ViewKind::Perspective { size: [4096, 2304], fov_y_rad: PI / 3.0 }),
        ("cube face", ViewKind::Cubemap { face_size: 4096, faces: vec![Face::Front] }),
        ("equirectangular", ViewKind::Equirectangular { size: [4096, 2048] }),
        ("equidistant 180", fisheye(4096, FisheyeMapping::Equidistant, 180.0)),
        ("equidistant 360", fisheye(4096, FisheyeMapping::Equidistant, 360.0)),
        ("equisolid 220", fisheye(4096, FisheyeMapping::Equisolid, 220.0)),
        ("stereographic 180", fisheye(4096, FisheyeMapping::Stereographic, 180.0)),
        ("orthographic 180", fisheye(4096, FisheyeMapping::Orthographic, 180.0)),
    ];
    let mut figures: Vec<Figure> = Vec::new();
    for (name, kind) in kinds {
        let limit = sum_limit(&kind);
        let rig = rig([("v", kind)])?;
        let frame = context.render(&empty, &rig)?;
        let mut error = f64::NAN;
        for (image, of_view) in images(&frame, &rig) {
            error = sum_error(hdr_pixels(image)?, &of_view.projection);
        }
        figures.push(Figure::at_most(name, error, limit, "relative"));
    }
    Ok(worst_of(figures))
}

/// Relative error of the sum of a picture's solid angles.
fn sum_error(pixels: &[[f32; 4]], projection: &Projection) -> f64 {
    let sum: f64 = pixels.iter().map(|pixel| f64::from(pixel[3])).sum();
    (sum / projection.picture_solid_angle_sr() - 1.0).abs()
}

/// Relative error of a solid angle; outside of the picture it must be 0.
fn pixel_error(found: f32, exact: f64) -> f64 {
    match exact {
        0.0 if found == 0.0 => 0.0,
        0.0 => f64::INFINITY,
        exact => (f64::from(found) / exact - 1.0).abs(),
    }
}

/// Keeps only the worst of the figures that have the same limit.
fn worst_of(mut figures: Vec<Figure>) -> Vec<Figure> {
    figures.sort_by(|a, b| b.measured.total_cmp(&a.measured));
    let mut kept: Vec<Figure> = Vec::new();
    for figure in figures {
        if kept.iter().all(|other| other.limit != figure.limit) {
            kept.push(figure);
        }
    }
    kept.sort_by(|a, b| a.limit.unwrap_or(f64::INFINITY).total_cmp(&b.limit.unwrap_or(f64::INFINITY)));
    kept
}

/// Returns every projection at `size` pixels by name.
///
/// # Errors
/// A size that is 0 or odd.
pub fn all_projections(size: u32) -> Result<Vec<(String, Projection)>, ProjectionError> {
    let square = [size; 2];
    let flat = |degrees: f64| Perspective::symmetric(square, degrees.to_radians()).map(Projection::Perspective);
    let wide = Perspective::symmetric([size, size * 9 / 16], PI / 3.0)?;
    let off_axis = Perspective::off_axis(square, -0.94, 0.7, 0.78, -0.87)?;
    let mut all = vec![
        ("perspective 60".to_owned(), Projection::Perspective(wide)),
        ("perspective 150".to_owned(), flat(150.0)?),
        ("perspective 178".to_owned(), flat(178.0)?),
        ("off-axis".to_owned(), Projection::Perspective(off_axis)),
        ("cube face".to_owned(), Projection::CubeFace(CubeFace::new(Face::Left, size)?)),
        ("equirectangular".to_owned(), Projection::Equirectangular(Equirectangular::new([size, size / 2])?)),
    ];
    for (mapping, fields) in [
        (FisheyeMapping::Equidistant, &[180.0, 220.0, 360.0][..]),
        (FisheyeMapping::Equisolid, &[180.0, 220.0, 360.0]),
        (FisheyeMapping::Orthographic, &[120.0, 180.0]),
        (FisheyeMapping::Stereographic, &[180.0, 220.0, 350.0]),
    ] {
        for degrees in fields {
            let fisheye = Fisheye::new(square, mapping, f64::to_radians(*degrees))?;
            all.push((format!("{} {degrees}", mapping.name()), Projection::Fisheye(fisheye)));
        }
    }
    Ok(all)
}

/// Returns pixels over the whole picture: a grid, the corners, the rim, the neighbourhood of the antipode.
pub fn sample_pixels(mapping: &dyn PlaneMapping) -> Vec<[u32; 2]> {
    let [width, height] = mapping.size();
    let along = |i: u32, side: u32| (u64::from(i) * u64::from(side - 1) / 40) as u32;
    let mut pixels: Vec<[u32; 2]> =
        (0..=40).flat_map(|j| (0..=40).map(move |i| [along(i, width), along(j, height)])).collect();
    for i in 0..720 {
        let (sin, cos) = (f64::from(i) * 0.5).to_radians().sin_cos();
        let radius = f64::from(width.min(height)) / 2.0 - 0.8;
        pixels.push([(f64::from(width) / 2.0 + radius * cos) as u32, (f64::from(height) / 2.0 + radius * sin) as u32]);
    }
    pixels
}

/// Returns whether a pixel is within 16 pixels of the rim of a round picture.
pub fn is_near_rim(size: [u32; 2], pixel: [u32; 2]) -> bool {
    let [width, height] = size.map(f64::from);
    let from_centre = (pixel_centre(pixel[0], pixel[1]) - DVec2::new(width, height) / 2.0).length();
    from_centre > width.min(height) / 2.0 - 16.0
}

/// Limit on the relative error of a solid angle: 1e-5, and 1e-3 where a pixel is stretched without bound, at the
/// orthographic rim and at the antipode of the equidistant full sphere.
pub fn limit_at(projection: &Projection, pixel: [u32; 2]) -> f64 {
    let size = projection.mapping().size();
    let Projection::Fisheye(fisheye) = projection else { return 1e-5 };
    let rim = fisheye.mapping == FisheyeMapping::Orthographic && is_near_rim(size, pixel);
    let antipode = fisheye.mapping == FisheyeMapping::Equidistant && fisheye.is_full_sphere() && {
        let from_centre = pixel_centre(pixel[0], pixel[1]) - DVec2::new(f64::from(size[0]), f64::from(size[1])) / 2.0;
        from_centre.length() > fisheye.radius_px() * 0.998
    };
    if rim || antipode { 1e-3 } else { 1e-5 }
}

/// Returns the viewport of a projection at the camera's position and orientation.
pub fn viewport(projection: Projection) -> Viewport {
    Viewport {
        view: 0,
        part: Part::Whole,
        projection,
        world_from_view: DQuat::IDENTITY,
        eye_offset_m: DVec3::ZERO,
        viewing_circle_m: 0.0,
    }
}

/// 2: tests the adapter's arithmetic where f32 has little precision to spare.
pub(super) fn at_16k(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mut figures = Vec::new();
    for (name, projection) in all_projections(16_384)? {
        let mapping = projection.mapping();
        let pixels = sample_pixels(mapping);
        let probes: Vec<Probe> = pixels.iter().map(|&pixel| Probe { direction: DVec3::NEG_Z, pixel }).collect();
        let probed = probe(context.renderer.gpu(), &viewport(projection.clone()), &probes)?;
        for (pixel, probed) in pixels.iter().zip(&probed) {
            let error = pixel_error(probed.solid_angle_sr, mapping.solid_angle_sr(pixel[0], pixel[1]));
            figures.push(Figure::at_most(name.as_str(), error, limit_at(&projection, *pixel), "relative"));
        }
    }
    Ok(worst_of(figures))
}

/// Compares the published solid angle of two spherical triangles in f32 with that of the renderer's pictures.
pub(super) fn triangles(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let size = 4096;
    let rig = rig([("v", ViewKind::Cubemap { face_size: size, faces: vec![Face::Front] })])?;
    let frame = context.render(&snapshot(Vec::new()), &rig)?;
    let image = frame.images.first().ok_or(CheckError::Missing("an image"))?;
    let pixels = hdr_pixels(image)?;
    let ours = face_errors(size, |x, y| f64::from(pixels[(y * size + x) as usize][3]))?;
    let mut figures = vec![Figure::at_most("renderer at 4096: largest", ours.largest, 1e-6, "relative")];
    for size in [1080, 4096, 8192] {
        let found = face_errors(size, |x, y| f64::from(pixel_solid_angle_sr(size, x, y)))?;
        figures.push(Figure::informative(format!("two triangles at {size}: p99"), found.p99, "relative"));
        figures.push(Figure::informative("largest", found.largest, "relative"));
    }
    Ok(figures)
}

/// 3: compares a part of the picture of a symmetric view with an off-axis frustum that shows the same part.
pub(super) fn off_axis_window(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let scene = snapshot(spiral(20_000).map(|d| star(d, 3.0)).collect());
    let half = (PI / 6.0).tan();
    // The part has the columns 120 to 200 and the rows 30 to 90 of the whole picture.
    let fov = Fov {
        left_rad: 0.0,
        right_rad: (half * 2.0 / 3.0).atan(),
        up_rad: (half * 0.75).atan(),
        down_rad: (half * 0.25).atan(),
    };
    let rig = rig([
        ("whole", ViewKind::Perspective { size: [240, 240], fov_y_rad: PI / 3.0 }),
        ("window", ViewKind::OffAxis { size: [80, 60], fov }),
    ])?;
    let frame = context.render(&scene, &rig)?;
    let [whole, window] = &frame.images[..] else { return Err(CheckError::Missing("two images")) };
    let (whole, window) = (hdr_pixels(whole)?, hdr_pixels(window)?);
    let brightest = f64::from(whole.iter().map(|pixel| pixel[1]).fold(0.0, f32::max));
    if brightest == 0.0 {
        return Err(metrics::MetricError::NoLight("a window").into());
    }
    let pairs = || {
        let place = |i: usize| (whole[(i / 80 + 30) * 240 + i % 80 + 120], window[i]);
        (0..80 * 60).map(place)
    };
    let solid_angle = worst(pairs().map(|(a, b)| f64::from(a[3] / b[3] - 1.0).abs()));
    let light = worst(pairs().map(|(a, b)| f64::from((a[1] - b[1]).abs()) / brightest));
    Ok(vec![
        Figure::at_most("solid angle", solid_angle, 1e-6, "relative"),
        // Rounding of f32 coordinates shifts a kernel by some 1e-5 of a pixel.
        Figure::at_most("luminance, relative to the brightest pixel", light, 1e-4, ""),
    ])
}

/// 4: odd sizes have a pixel exactly at the centre; at 360 degrees the rim is a single direction.
pub(super) fn fisheye_centre_and_rim(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mappings = [
        (FisheyeMapping::Equidistant, 360.0),
        (FisheyeMapping::Equisolid, 360.0),
        (FisheyeMapping::Orthographic, 180.0),
        (FisheyeMapping::Stereographic, 350.0),
    ];
    let (mut not_finite, mut pairs, mut figures) = (0_u64, Vec::new(), Vec::new());
    for size in [254, 255] {
        for (mapping, degrees) in mappings {
            let rig = rig([("v", fisheye(size, mapping, degrees))])?;
            let projection = &rig.views()[0].images[0].projection;
            // On the axis, next to it, and at the antipode if it is visible.
            let mut places = vec![DVec3::NEG_Z, DVec3::new(1e-4, -2e-4, -1.0)];
            if degrees == 360.0 {
                places.extend([DVec3::Z, DVec3::new(1e-3, 2e-3, 1.0)]);
            }
            for place in places {
                let frame = context.render(&snapshot(vec![star(place, 2.0)]), &rig)?;
                for (image, _) in images(&frame, &rig) {
                    let pixels = hdr_pixels(image)?;
                    not_finite += pixels.iter().flatten().filter(|value| !value.is_finite()).count() as u64;
                    let lit = hdr_view(image, projection.mapping())?;
                    pairs.push((metrics::illuminance_lx(&lit)?, illuminance_lx_from_magnitude(2.0)));
                    for (index, pixel) in pixels.iter().enumerate() {
                        let place = [index as u32 % size, index as u32 / size];
                        let exact = projection.mapping().solid_angle_sr(place[0], place[1]);
                        if exact > 0.0 {
                            let error = (f64::from(pixel[3]) / exact - 1.0).abs();
                            let name = format!("solid angle, {} {degrees}", mapping.name());
                            figures.push((name, error, limit_at(projection, place)));
                        }
                    }
                }
            }
        }
    }
    figures.sort_by(|a, b| (b.1 / b.2).total_cmp(&(a.1 / a.2)));
    let mut kept = vec![Figure::at_most("values that are not finite", not_finite as f64, 0.0, "")];
    kept.extend(
        figures.into_iter().take(1).map(|(name, error, limit)| Figure::at_most(name, error, limit, "relative")),
    );
    kept.push(Figure::at_most("light of a star at these places", context.worst_flux_error(&pairs)?, 1e-4, "relative"));
    Ok(kept)
}

/// Returns views of the whole sphere with their names.
pub(super) fn whole_sky(scale: u32) -> [(&'static str, ViewKind); 3] {
    [
        ("cube", cube(48 * scale)),
        ("equirectangular", ViewKind::Equirectangular { size: [128 * scale, 64 * scale] }),
        (
            "equidistant-360",
            ViewKind::Fisheye { size: [96 * scale; 2], mapping: FisheyeMapping::Equidistant, fov_rad: TAU },
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solid_angle_errors_of_millionths_are_detected() {
        for (_, kind) in whole_sky(1) {
            let rig = rig([("v", kind)]).unwrap();
            let projection = &rig.views()[0].images[0].projection;
            let [width, height] = projection.mapping().size();
            let picture = |factor: f64| -> Vec<[f32; 4]> {
                let solid_angle = |i: u32| (projection.mapping().solid_angle_sr(i % width, i / width) * factor) as f32;
                (0..width * height).map(|i| [0.0, 0.0, 0.0, solid_angle(i)]).collect()
            };
            let [right, wrong] = [1.0, 1.0 + 5e-6].map(|factor| sum_error(&picture(factor), projection));
            assert!((wrong - right).abs() > 4e-6, "{right} {wrong}");
        }
        assert!(pixel_error(1.00002e-6, 1e-6) > 1e-5 && pixel_error(1e-6, 1e-6) < 1e-7);
        assert_eq!((pixel_error(0.0, 0.0), pixel_error(1e-9, 0.0)), (0.0, f64::INFINITY));
        let figures = vec![
            Figure::at_most("a", 1e-7, 1e-6, ""),
            Figure::at_most("b", f64::NAN, 1e-6, ""),
            Figure::at_most("c", 1e-4, 1e-3, ""),
        ];
        let kept: Vec<String> = worst_of(figures).into_iter().map(|figure| figure.what).collect();
        assert_eq!(kept, ["b", "c"], "NaN is the worst");
    }
}

//! Glare for two eyes: a near source has a different veil in each eye, a far source has the same veil in both.

use glam::DVec3;

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
        scenes::{rig, snapshot, star, star_at},
    },
    Picture, pictures, stereo,
};
use crate::{
    catalogue::StarRecord, metrics, photometry::rec709::luminance, reference::glare::sky_cube::sampled_pixels,
    units::PARSEC_M,
};

/// Direction of the star, seen from the midpoint between the eyes.
const PLACE: DVec3 = DVec3::new(0.15, 0.1, -1.0);
/// Absolute magnitude of the star: it gives 1e10 lx at 1 m. Less than 3e9 lx cannot be represented that near, because
/// the least light of a star is 2^-78 lx at 1 pc.
const ABSOLUTE_MAGNITUDE: f32 = 48.5;
/// Number of pixels compared in each eye.
const SAMPLES: usize = 800;
/// Radius around the star's image within which pixels are left out, pixels. There, the angle between the eyes matters
/// even at a kilometre.
const APART_PX: f64 = 6.0;

/// Measures a star 1 m in front of the eyes, at 1 km and at infinity.
pub(in crate::verify) fn two_eyes(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let near_star = |distance_m: f64| star_at(PLACE.normalize() * (distance_m / PARSEC_M), ABSOLUTE_MAGNITUDE);
    let rig = rig([("stereo", stereo(160, 90.0))])?;
    let kernel = context.expected_kernel()?;
    context.scatter_all();
    let mut look = |record: StarRecord| -> Result<Vec<[(f64, f64); 2]>, CheckError> {
        let scene = snapshot(vec![record]);
        let frame = context.render(&scene, &rig)?;
        let pictures = pictures(&scene, &rig, &frame)?;
        let [left, right] = &pictures[..] else { return Err(CheckError::Missing("an eye")) };
        let apart = APART_PX * left.view_image.projection.middle_pixel_rad();
        let near: Vec<_> =
            pictures.iter().flat_map(|eye| &eye.sources).map(|source| (source.direction, apart)).collect();
        // Both eyes have the same mapping, so the same pixels look in the same directions.
        let pixels = sampled_pixels(left.hdr.mapping(), SAMPLES, &near);
        let of_pixel = |pixel: [u32; 2]| {
            let of_eye = |eye: &Picture<'_>| {
                let expected = eye.veil(&*kernel).over_pixel(eye.hdr.mapping(), pixel);
                (eye.hdr.luminance_cd_m2(pixel[0], pixel[1]), expected.map_or(f64::NAN, luminance))
            };
            [of_eye(left), of_eye(right)]
        };
        Ok(pixels.into_iter().map(of_pixel).collect())
    };
    let [near, kilometre, infinity] = [near_star(1.0), near_star(1e3), star(PLACE, -1.0)].map(&mut look);
    let near = near?;
    let pairs: Vec<(f64, f64)> = near.iter().flatten().copied().collect();
    let (scale, scale_note) = context.glare_scale(&pairs)?;
    let scaled: Vec<(f64, f64)> = pairs.iter().map(|(found, expected)| (scale * found, *expected)).collect();
    // The error is relative to the difference between the eyes, so that interchanged eyes have an error of 2.
    let (mut off, mut all) = (0.0, 0.0);
    for [(left, of_left), (right, of_right)] in &near {
        let expected = of_left - of_right;
        off += (scale * (left - right) - expected).powi(2);
        all += expected * expected;
    }
    let mut figures = vec![
        Figure::at_most(
            format!("veil of each eye, star at 1 m{scale_note}"),
            metrics::relative_errors(&scaled)?.largest,
            0.02,
            "relative",
        ),
        Figure::at_most("difference between the eyes", (off / all).sqrt(), 0.02, "relative"),
    ];
    for (name, luminances) in [("star at 1 km: difference between the eyes", kilometre?), ("at infinity", infinity?)] {
        let between = worst(luminances.iter().map(|[left, right]| (left.0 / right.0 - 1.0).abs()));
        figures.push(Figure::at_most(name, between, 0.01, "relative"));
    }
    Ok(figures)
}

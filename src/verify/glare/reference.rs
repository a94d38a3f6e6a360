//! Compares glare with a convolution on the sphere in f64.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    super::{
        Figure,
        context::{CheckError, Context},
        scenes::{cube, fisheye, rig, snapshot, spiral, star},
    },
    Picture, UNRESOLVED_PX, flat, pictures, stereo,
};
use crate::{
    catalogue::StarRecord,
    metrics,
    photometry::{glare::GlareKernel, rec709::luminance},
    reference::glare::sky_cube::sampled_pixels,
    scene::SceneSnapshot,
    view::{
        Rig, ViewKind,
        projection::{FisheyeMapping, pixel_centre},
    },
};

/// A pixel next to a source is left out if the source gives more than this share of the pixel's scattered light. The
/// image of a source covers these pixels, and its glare cannot be distinguished from the image there. Methods may
/// therefore distribute the sum of that light among these pixels in any way. Sources that add less than the limits do
/// not matter.
const UNRESOLVED_SHARE: f64 = 0.05;
/// Number of stars visible without a telescope.
const STARS: usize = 9000;
/// Number of compared pixels in each view, for one star and for many.
const SAMPLES: [usize; 2] = [2000, 250];

fn views() -> Result<Rig, CheckError> {
    Ok(rig([
        ("perspective-60", flat(320, 60.0)),
        ("perspective-110", flat(384, 110.0)),
        ("stereo", stereo(320, 80.0)),
        ("cube", cube(192)),
        ("fisheye-180", fisheye(384, FisheyeMapping::Equidistant, 180.0)),
        ("fisheye-220", fisheye(384, FisheyeMapping::Equisolid, 220.0)),
        ("equirectangular", ViewKind::Equirectangular { size: [768, 384] }),
    ])?)
}

/// Returns a star with a colour from red to blue, depending on its index.
fn coloured(direction: DVec3, magnitude: f32, index: usize) -> StarRecord {
    StarRecord { temperature_k: [3200.0, 5800.0, 9600.0, 20000.0][index % 4], ..star(direction, magnitude) }
}

/// Returns stars of magnitude -1.4 to 6.5. Their number increases tenfold every two magnitudes.
pub(super) fn sky() -> SceneSnapshot {
    let magnitude = |rank: usize| 6.5 - 2.0 * (STARS as f64 / (1.0 + rank as f64)).log10();
    let records = spiral(STARS).enumerate();
    snapshot(records.map(|(i, d)| coloured(d, magnitude((i * 7919) % STARS) as f32, i)).collect())
}

/// 21: measures one star, and a sky of 9000 stars, in every projection.
pub(in crate::verify) fn against_reference(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = views()?;
    let one = snapshot(vec![coloured(DVec3::new(0.1, 0.2, -1.0), 0.0, 2)]);
    let mut figures = Vec::new();
    context.scatter_all();
    for ((scene, samples), name) in [one, sky()].iter().zip(SAMPLES).zip(["one star", "9000 stars"]) {
        let frame = context.render(scene, &rig)?;
        figures.extend(compare(context, name, &pictures(scene, &rig, &frame)?, samples)?);
    }
    Ok(figures)
}

/// Compares the pixels of pictures of scattered light for each channel.
pub(super) fn compare(
    context: &Context<'_>,
    name: &str,
    pictures: &[Picture<'_>],
    samples: usize,
) -> Result<Vec<Figure>, CheckError> {
    let kernel = context.expected_kernel()?;
    let (mut pairs, mut left_out, mut all) = (Vec::new(), 0, 0);
    for picture in pictures {
        let of_view = pictures.iter().filter(|other| other.name == picture.name).count();
        let pixels = sampled_pixels(picture.hdr.mapping(), samples.div_ceil(of_view), &[]);
        let of_picture = pairs_of(picture, &*kernel, &pixels);
        all += pixels.len();
        left_out += pixels.len() - of_picture.len();
        pairs.push((picture.name, of_picture));
    }
    let together: Vec<(f64, f64)> = pairs.iter().flat_map(|(_, pairs)| pairs.iter().flatten().copied()).collect();
    let (scale, scale_note) = context.glare_scale(&together)?;
    let (mut rms, mut largest) = ((0.0, ""), (0.0, ""));
    for (view, pairs) in &pairs {
        let scaled: Vec<_> = pairs.iter().flatten().map(|(found, expected)| (scale * found, *expected)).collect();
        let errors = metrics::relative_errors(&scaled)?;
        for (worst, error) in [(&mut rms, errors.rms), (&mut largest, errors.largest)] {
            if error >= worst.0 {
                *worst = (error, view);
            }
        }
    }
    Ok(vec![
        Figure::at_most(format!("{name}: rms{scale_note}, {}", rms.1), rms.0, 0.02, "relative"),
        Figure::at_most(format!("largest, {}", largest.1), largest.0, 0.06, "relative"),
        Figure::informative("pixels left out next to sources", left_out as f64 / all as f64, "of the pixels"),
    ])
}

/// Returns measured and expected values in each channel; pixels next to a source that dominates them are left out.
fn pairs_of(picture: &Picture<'_>, kernel: &dyn GlareKernel, pixels: &[[u32; 2]]) -> Vec<[(f64, f64); 3]> {
    let mapping = picture.hdr.mapping();
    let middle_rad = picture.view_image.projection.middle_pixel_rad();
    let of_pixel = |[x, y]: &[u32; 2]| {
        let expected = picture.veil(kernel).over_pixel(mapping, [*x, *y])?;
        let centre = mapping.direction_from_pixel(pixel_centre(*x, *y))?;
        let near_rad = UNRESOLVED_PX * middle_rad.max(mapping.solid_angle_sr(*x, *y).sqrt());
        let most = UNRESOLVED_SHARE * luminance(expected);
        let outshines = |(direction, rgb_lx): (DVec3, [f64; 3])| {
            let chord = (direction - centre).length();
            chord < near_rad && luminance(rgb_lx) * kernel.per_sr(2.0 * (0.5 * chord).min(1.0).asin()) > most
        };
        if picture.sources.iter().any(|source| outshines((source.direction, source.rgb_lx))) {
            return None;
        }
        let found = picture.hdr.rgb_cd_m2(*x, *y);
        Some([0, 1, 2].map(|c| (found[c], expected[c])))
    };
    pixels.par_iter().filter_map(of_pixel).collect()
}

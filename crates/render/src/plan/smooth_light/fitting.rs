//! The map that suits the views of a frame: its texels, the stars that it may contain, and its pictures.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{
    PICTURES_AT_ONCE, SkyLayout, SkyMap,
    caps::{has_square_pixels, is_whole_sky, smallest_read_sr},
    pieces::{PIECE_SIDE, PieceGrid, SIZES_PER_OCTAVE, WantedPicture},
    words_needed,
};
use crate::{
    catalogue::{chunks::StarSet, deep::LAYERS},
    plan::{
        Limits,
        glare::sky_cube::map_place_pc,
        settings::RenderSettings,
        stars::{
            cull::{CullSettings, Field},
            deep::{layers_from, pixel_sr_near},
        },
        tiles::BYTES_PER_PIXEL,
    },
    sky_pictures::{SKY_FACES, SkyPictures},
    view::{
        Viewport,
        projection::{FisheyeMapping, Projection},
    },
};

/// Texels of a map, and the stars that they may hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Texels {
    /// Side at the centre of a view, pixels.
    pub side_px: f64,
    /// Blur, applied along each axis when a texel is stored: weights of the neighbours at distances of one and two texels.
    pub blur: [f64; 2],
    /// Greatest difference between a star's light in a pixel and its light in exact images, relative to that of texels without blur.
    pub error: f64,
}

/// Texels for stars that exact images draw with the tent.
pub(super) const OF_TENT: Texels = Texels { side_px: 0.632, blur: [0.0; 2], error: 1.0 };
/// The same for whole-sky maps, a compromise between their square pixels at the equator and their narrow ones (tests/gpu/display_poses.rs).
const OF_WHOLE_SKY: Texels = Texels { side_px: 0.56, ..OF_TENT };
/// Texels of pictures of the whole sky for a deep store, whose faint stars exact images draw with the B-spline. Measured with
/// `benches/deep_patches.rs`.
const OF_DEEP: Texels = Texels { side_px: 0.65, ..OF_TENT };
/// The same for pieces, from the best texels to those that need the least memory. Texels that are larger than the size of equal variance have smaller
/// errors. The greatest difference is 7 % of a star's light for blurred texels and 21 % for others, over all positions of a star among the texels and
/// all angles between texels and square pixels. Domes have no blurred texels: their pixels are far from square, so they would gain only half as much.
const OF_DEEP_PIECES: [Texels; 2] =
    [Texels { side_px: 0.45, blur: [0.291, 0.0243], error: 0.38 }, Texels { side_px: 0.85, ..OF_TENT }];
/// Largest cell of the composite stars of a deep store, pixels. It is smaller than [`crate::plan::stars::deep::DIRECT_CELL_PX`], because interpolation
/// adds to the error.
pub(in crate::plan) const CELL_PX: f64 = 0.66;
/// Illuminance of the brightest star of the map, divided by the solid angle of the smallest pixel, in steps of the display image.
pub(super) const BRIGHTEST_STEPS: f64 = 1.8;
/// The same for whole-sky maps: the light of a star is spread over several narrow pixels.
const BRIGHTEST_STEPS_OF_WHOLE_SKY: f64 = 1.5;
/// Illuminance of the brightest star of the map of a deep store, divided by the solid angle of the central pixel, in steps: the errors of several such
/// stars may add up in a pixel. Measured with `benches/deep_patches.rs`.
const BRIGHTEST_STEPS_AT_CENTRE: f64 = 0.8;
/// Least ratio of the smallest pixel to the central one (solid angles) for which the pictures of the whole sky have a suitable resolution.
const LEAST_PIXEL_RATIO: f64 = 0.45;
/// The same for pieces, whose texels have several sizes.
const LEAST_RATIO_OF_PIECES: f64 = 0.1;
/// Greatest ratio of the central pixels of two views that read one map.
const MOST_VIEW_RATIO: f64 = 1.25;
/// Greatest distance of an eye from the camera at which the directions of the map's stars are still right.
const FARTHEST_EYE_M: f64 = 1e9;

/// Inputs for the choice of a map.
pub(super) struct SkyInputs<'a> {
    pub settings: &'a RenderSettings,
    pub stars: &'a Arc<StarSet>,
    pub camera_pc: DVec3,
    /// Drawn viewports.
    pub viewports: &'a [Viewport],
    pub cull: CullSettings,
    /// Step of the display image, cd/m^2.
    pub step_cd_m2: f64,
    pub limits: &'a Limits,
}

/// Illuminance of the brightest star of the map of a deep store, divided by the solid angle of the smallest pixel, in steps of the display image, for
/// texels without blur. It is rounded to steps of a fixed factor, so that it seldom changes during a zoom.
fn steps_of_deep(viewports: &[Viewport], smallest_sr: f64) -> f64 {
    let middle_rad =
        viewports.iter().map(|viewport| viewport.projection.middle_pixel_rad()).fold(f64::INFINITY, f64::min);
    let steps = BRIGHTEST_STEPS.min(BRIGHTEST_STEPS_AT_CENTRE * middle_rad.powi(2) / smallest_sr);
    ((steps.log2() * SIZES_PER_OCTAVE).floor() / SIZES_PER_OCTAVE).exp2()
}

/// The map for these views, with the pictures that they read: of the whole sky, or in pieces.
pub(super) fn fitting(inputs: &SkyInputs<'_>) -> Option<(SkyMap, Arc<[WantedPicture]>)> {
    let (deep, limits) = (&inputs.stars.deep, inputs.limits);
    let smallest_sr = smallest_sr(inputs.viewports);
    let (of_whole, brightest_steps) = of_whole_pictures(inputs.viewports, smallest_sr, deep.is_some())?;
    let below_lx = brightest_steps * inputs.step_cd_m2 * smallest_sr;
    let whole = finest_pixel_rad(inputs.viewports, SkyKind::Whole);
    let whole = whole.map(|rad| SkyPictures::of_texels(of_whole.side_px * rad)).filter(|whole| {
        4 * whole.texels() <= limits.max_binding_bytes
            && whole.side <= limits.max_view_side_px
            // Pictures of the whole sky would need all stars of every layer that reaches this illuminance.
            && (deep.is_none() || layers_from(below_lx) == 0)
    });
    if let Some(SkyPictures { side }) = whole {
        let read = (0..SKY_FACES).map(|number| WantedPicture { number, level: 0.0 }).collect();
        let map = map_of(inputs, below_lx, of_whole, SkyLayout::Whole { side });
        return (map.below_lx > map.faintest_lx).then_some((map, read));
    }
    finest_pixel_rad(inputs.viewports, SkyKind::Pieces)?;
    let are_flat = inputs.viewports.iter().all(|v| matches!(v.projection, Projection::Perspective(_)));
    let of_pieces: &[Texels] = match deep {
        Some(_) if are_flat => &OF_DEEP_PIECES,
        Some(_) => &OF_DEEP_PIECES[1..],
        None => &[OF_TENT],
    };
    of_pieces.iter().find_map(|texels| in_pieces(inputs, *texels, smallest_sr, brightest_steps))
}

/// Texels of pictures of the whole sky, and the illuminance of their brightest star divided by the solid angle of the smallest pixel, in steps; `None`:
/// a whole-sky map of a deep store, because only stars of chunks are drawn in caps.
fn of_whole_pictures(viewports: &[Viewport], smallest_sr: f64, has_deep: bool) -> Option<(Texels, f64)> {
    match (has_deep, viewports.iter().any(is_whole_sky)) {
        (false, false) => Some((OF_TENT, BRIGHTEST_STEPS)),
        (false, true) => Some((OF_WHOLE_SKY, BRIGHTEST_STEPS_OF_WHOLE_SKY)),
        (true, false) => Some((OF_DEEP, steps_of_deep(viewports, smallest_sr))),
        (true, true) => None,
    }
}

/// A map for these views.
fn map_of(inputs: &SkyInputs<'_>, below_lx: f64, texels: Texels, layout: SkyLayout) -> SkyMap {
    SkyMap {
        place_pc: map_place_pc(inputs.camera_pc),
        below_lx,
        faintest_lx: inputs.cull.faintest_lx,
        unit_cd_m2: inputs.step_cd_m2,
        layout,
        texels,
    }
}

/// A map in pieces, with the pieces that the views read; `None`: it would be too large, or empty.
fn in_pieces(
    inputs: &SkyInputs<'_>,
    texels: Texels,
    smallest_sr: f64,
    brightest_steps: f64,
) -> Option<(SkyMap, Arc<[WantedPicture]>)> {
    let SkyInputs { viewports, step_cd_m2, cull, limits, .. } = inputs;
    let grid = PieceGrid::of_texels(texels.side_px * smallest_sr.sqrt())?;
    // While a zoom does not change the texels, the limit of a star's light does not change either.
    let most_sr = (grid.texel / texels.side_px).powi(2) * (-2.0 / SIZES_PER_OCTAVE).exp2();
    let below_lx = brightest_steps / texels.error * step_cd_m2 * smallest_sr.min(most_sr);
    // If every layer of a deep store is drawn star by star, the map has no composite stars.
    let has_stars = inputs.stars.deep.is_none() || layers_from(below_lx) < LAYERS.len();
    (has_stars && below_lx > cull.faintest_lx).then_some(())?;
    let read = pieces_in(&grid, texels.side_px, viewports, cull);
    // A texel is blurred with others of its picture, so a picture must not be divided when it is drawn.
    let drawn_bytes = PICTURES_AT_ONCE as u64 * u64::from(PIECE_SIDE * PIECE_SIDE) * BYTES_PER_PIXEL;
    let is_undivided = texels.blur == [0.0; 2] || drawn_bytes <= limits.max_binding_bytes;
    let fits = is_undivided && 4 * words_needed(&grid, &read) <= limits.max_binding_bytes;
    fits.then(|| (map_of(inputs, below_lx, texels, SkyLayout::Pieces(grid)), read))
}

/// The pieces that are in view, with texels of `texel_px` of the views' smallest pixels at each piece.
fn pieces_in(grid: &PieceGrid, texel_px: f64, viewports: &[Viewport], cull: &CullSettings) -> Arc<[WantedPicture]> {
    let fields: Vec<Field> = viewports.iter().map(|viewport| Field::new(viewport, cull)).collect();
    let wanted = |number: u32| {
        let (cone, corners) = (grid.cone(number), grid.corners(number));
        let seeing = viewports.iter().zip(&fields).filter(|(_, field)| field.touches_polygon(cone, &corners));
        let pixels_rad = seeing.map(|(viewport, _)| pixel_sr_near(viewport, cone.axis, 0.0).sqrt());
        let finest_rad = pixels_rad.fold(f64::INFINITY, f64::min);
        finest_rad.is_finite().then(|| grid.wanted(number, texel_px * finest_rad))
    };
    let near = grid.pieces_where(|cone| fields.iter().any(|field| field.touches_cone(cone)));
    near.into_par_iter().filter_map(wanted).collect::<Vec<_>>().into()
}

/// Whether the texels of one map have a suitable size for all of these views.
pub(in crate::plan) fn fit_one_map(viewports: &[Viewport]) -> bool {
    [SkyKind::Whole, SkyKind::Pieces].into_iter().any(|kind| finest_pixel_rad(viewports, kind).is_some())
}

/// Solid angle of the smallest pixel that reads a map, sr.
pub(super) fn smallest_sr(viewports: &[Viewport]) -> f64 {
    viewports.iter().map(smallest_read_sr).fold(f64::INFINITY, f64::min)
}

/// Kinds of [`SkyLayout`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SkyKind {
    Whole,
    Pieces,
}

/// The smallest central pixel of the views, rad; `None`: no map of this kind fits all of them.
fn finest_pixel_rad(viewports: &[Viewport], kind: SkyKind) -> Option<f64> {
    let least_ratio = if kind == SkyKind::Whole { LEAST_PIXEL_RATIO } else { LEAST_RATIO_OF_PIECES };
    let fits = |viewport: &Viewport| {
        let projection = &viewport.projection;
        let are_similar = projection.smallest_pixel_sr() >= least_ratio * projection.middle_pixel_rad().powi(2);
        let is_suitable = match projection {
            Projection::Perspective(_) | Projection::CubeFace(_) => are_similar,
            Projection::Fisheye(fisheye) => are_similar && fisheye.mapping != FisheyeMapping::Orthographic,
            // Its narrow pixels do not read the map.
            Projection::Equirectangular(_) => kind == SkyKind::Whole && has_square_pixels(viewport.size()),
            Projection::Tabulated(_) => false,
        };
        is_suitable && viewport.eye_offset_m.length() <= FARTHEST_EYE_M
    };
    let middle = viewports.iter().map(|viewport| viewport.projection.middle_pixel_rad());
    let (least, most) = middle.fold((f64::INFINITY, 0.0_f64), |(least, most), px| (least.min(px), most.max(px)));
    (!viewports.is_empty() && viewports.iter().all(fits) && most <= MOST_VIEW_RATIO * least).then_some(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::smooth_light::caps::tests::viewports;
    use crate::view::ViewKind;

    #[test]
    fn whole_sky_maps_of_a_deep_store_have_no_pictures() {
        let map = ViewKind::Equirectangular { size: [512, 256] };
        let dome = ViewKind::DomeMaster { size: 256, fov_rad: std::f64::consts::PI, tilt_rad: 0.0 };
        let texels = |kinds: &[&ViewKind], has_deep: bool| {
            let viewports = viewports(kinds.iter().map(|kind| (*kind).clone()).collect());
            of_whole_pictures(&viewports, smallest_sr(&viewports), has_deep).map(|(texels, _)| texels)
        };
        assert_eq!(texels(&[&dome], false), Some(OF_TENT));
        assert_eq!(texels(&[&dome, &map], false), Some(OF_WHOLE_SKY));
        assert_eq!(texels(&[&dome], true), Some(OF_DEEP));
        assert_eq!(texels(&[&dome, &map], true), None);
    }
}

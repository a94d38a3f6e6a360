//! Pictures of an overlay: their positions in each image, and the texels that the pass reads.

use std::{collections::HashMap, f64::consts::PI, sync::Arc};

use glam::{DVec2, DVec3};

use super::{AT_INFINITY, Drawing, Eye, Ink, OverlayPlanError, Shape, blocks::BLOCK_PX};
use crate::{
    coordinates::direction_from_lon_lat,
    scene::overlay::{Anchor, Colour, Picture, PictureLevels},
};

/// Length of a header, 32-bit words: nine numbers of f32 of [`Placed::rows`], width and height that the picture
/// fills (f32), columns, rows, and the index of the first texel.
pub const HEADER_WORDS: usize = 14;
/// Size of a texel in pixels below which a coarser level is drawn.
const LEAST_TEXEL_PX: f64 = 0.7;
/// Step along the upward direction, rad.
const UP_STEP_RAD: f64 = 1e-4;
/// Factor on the angular spread of a block's samples, which covers the directions between them.
const REACH: f64 = 1.3;

/// First 32-bit word of the texels of each level of each picture.
pub type FirstTexels = HashMap<(*const PictureLevels, usize), u32>;

/// A picture in view axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// A direction `d` is at `(0.5 + rows[0].d / rows[2].d, 0.5 + rows[1].d / rows[2].d)` of width and height, from the upper left corner,
    /// if `rows[2].d` is positive.
    pub rows: [DVec3; 3],
    /// Angle from its middle to its farthest corner, rad.
    reach_rad: f64,
}

/// Its middle and the direction of its top, view axes.
fn axes(eye: &Eye<'_>, anchor: &Anchor) -> Option<[DVec3; 2]> {
    let [middle, above] = match *anchor {
        Anchor::Direction(direction) => {
            let (longitude, latitude) = (direction.y.atan2(direction.x), direction.z.clamp(-1.0, 1.0).asin());
            [0.0, UP_STEP_RAD].map(|step| Some(eye.apparent(direction_from_lon_lat(longitude, latitude + step))))
        }
        Anchor::Horizon([azimuth, altitude]) => {
            [0.0, UP_STEP_RAD].map(|step| eye.towards_horizon([azimuth, altitude + step]))
        }
        Anchor::Point(_) => return None,
    };
    let (middle, above) = (middle?.normalize(), above?.normalize());
    Some([middle, (above - middle * above.dot(middle)).normalize()])
}

impl Placed {
    fn new(eye: &Eye<'_>, picture: &Picture) -> Option<Self> {
        let [middle, top] = axes(eye, &picture.anchor)?;
        let (sin, cos) = picture.roll_rad.sin_cos();
        let right = middle.cross(top);
        let (right, up) = (right * cos + top * sin, top * cos - right * sin);
        let [width, height] = picture.levels.size().map(f64::from);
        let half_width = (picture.width_rad / 2.0).tan();
        let half_height = half_width * height / width;
        let rows = [right / (2.0 * half_width), -up / (2.0 * half_height), middle];
        Some(Self { rows, reach_rad: half_width.hypot(half_height).atan() })
    }

    /// Whether a block of pixels may contain a part of it.
    fn touches(&self, eye: &Eye<'_>, corner: [u32; 2]) -> bool {
        let mapping = eye.viewport.projection.mapping();
        let size = DVec2::from_array(eye.viewport.size().map(f64::from));
        let samples = |count: u32| {
            let at = move |index: u32| f64::from(index) / f64::from(count - 1) * f64::from(BLOCK_PX);
            let points = (0..count).flat_map(move |y| (0..count).map(move |x| DVec2::new(at(x), at(y))));
            let first = DVec2::from_array(corner.map(f64::from));
            points.filter_map(move |point| mapping.direction_from_pixel((first + point).min(size)))
        };
        let mut seen: Vec<DVec3> = samples(3).collect();
        if seen.is_empty() {
            // The rim of a round picture may cross the block between these points.
            seen = samples(9).collect();
        }
        let Some(first) = seen.first() else { return false };
        let spread = seen.iter().map(|direction| direction.angle_between(*first)).fold(0.0, f64::max);
        let nearest = seen.iter().map(|direction| direction.angle_between(self.rows[2])).fold(PI, f64::min);
        nearest <= self.reach_rad + REACH * spread
    }
}

/// The level whose texels are as large as the pixels at the middle of the picture.
fn level_of(eye: &Eye<'_>, picture: &Picture, placed: &Placed) -> usize {
    let projection = &eye.viewport.projection;
    let mapping = projection.mapping();
    let [width, height] = eye.viewport.size();
    let middle = mapping.pixel_from_direction(placed.rows[2]);
    let inside =
        middle.filter(|pixel| pixel.cmpge(DVec2::ZERO).all() && pixel.x < width.into() && pixel.y < height.into());
    let pixel_sr = inside.map_or(0.0, |pixel| mapping.solid_angle_sr(pixel.x as u32, pixel.y as u32));
    let pixel_rad = if pixel_sr > 0.0 { pixel_sr.sqrt() } else { projection.middle_pixel_rad() };
    let texel_rad = |extent: [f64; 2]| 2.0 * (picture.width_rad / 2.0).tan() / extent[0];
    let levels = picture.levels.levels();
    let fits = levels.iter().position(|level| texel_rad(level.extent) >= LEAST_TEXEL_PX * pixel_rad);
    fits.unwrap_or(levels.len() - 1)
}

/// Draws a picture as one stroke of boxes of whole blocks.
pub(super) fn draw(
    drawing: &mut Drawing<'_>,
    first_texels: &mut FirstTexels,
    eye: &Eye<'_>,
    picture: &Picture,
) -> Result<(), OverlayPlanError> {
    let Some(placed) = Placed::new(eye, picture) else { return Ok(()) };
    let [columns, rows] = eye.viewport.size().map(|side| side.div_ceil(BLOCK_PX));
    let mut runs: Vec<[u32; 3]> = Vec::new();
    for row in 0..rows {
        for column in (0..columns).filter(|column| placed.touches(eye, [column * BLOCK_PX, row * BLOCK_PX])) {
            match runs.last_mut() {
                Some([of_row, _, end]) if *of_row == row && *end == column => *end += 1,
                _ => runs.push([row, column, column + 1]),
            }
        }
    }
    if runs.is_empty() {
        return Ok(());
    }
    let level = level_of(eye, picture, &placed);
    let first_texel = *first_texels.entry((Arc::as_ptr(&picture.levels), level)).or_insert_with(|| {
        let texels = &picture.levels.levels()[level].rgba;
        drawing.align_texels();
        let first = drawing.texels.len() / 4;
        drawing.texels.extend(texels.iter().flatten());
        first as u32
    });
    drawing.align_texels();
    let header = drawing.texels.len() / 4;
    for number in placed.rows.iter().flat_map(|row| row.to_array()) {
        drawing.texels.extend((number as f32).to_le_bytes());
    }
    let level = &picture.levels.levels()[level];
    for number in level.extent {
        drawing.texels.extend((number as f32).to_le_bytes());
    }
    for word in level.size.into_iter().chain([first_texel]) {
        drawing.texels.extend(word.to_le_bytes());
    }
    drawing.next_stroke();
    let ink = Ink { colour: Colour([0; 3]), opacity: picture.opacity };
    for [row, first, end] in runs {
        let side = BLOCK_PX as i32;
        let [row, first, end] = [row, first, end].map(|number| number as i32);
        let (from, to) = ([first * side, row * side], [end * side, (row + 1) * side]);
        drawing.push(ink, Shape::Picture { from, to, header: header as u32, nearness: AT_INFINITY })?;
    }
    Ok(())
}

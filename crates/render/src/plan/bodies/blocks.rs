//! Blocks of pixels that may show a body. Most pictures have few such blocks, and the pass that traces rays runs only for these.

use glam::{DVec2, DVec3};

use super::seen::BodyDisc;
use crate::{
    plan::tiles::Tile,
    view::{Viewport, projection::Projection},
};

/// Pixels along a side of a block.
pub const BLOCK_PX: u32 = 64;
/// Margin for directions between the tested points of a block.
const ROOM: f64 = 1.2;

/// All blocks of a tile: their first column, and their first row within the tile.
pub fn all_blocks(width: u32, tile: &Tile) -> Vec<[u32; 2]> {
    let starts = |side: u32| (0..side.div_ceil(BLOCK_PX)).map(|block| block * BLOCK_PX);
    starts(tile.rows).flat_map(|y| starts(width).map(move |x| [x, y])).collect()
}

/// The blocks that may show one of these bodies.
pub fn reached_blocks(viewport: &Viewport, tile: &Tile, discs: &[BodyDisc]) -> Vec<[u32; 2]> {
    if discs.is_empty() {
        return Vec::new();
    }
    let bodies: Vec<(DVec3, f64)> = discs.iter().map(|disc| (disc.centre.normalize(), disc.reach_rad)).collect();
    let mut blocks = all_blocks(viewport.size()[0], tile);
    blocks.retain(|block| match cone_of(&viewport.projection, tile, *block) {
        Some((axis, half_rad)) => {
            bodies.iter().any(|(towards, reach_rad)| axis.angle_between(*towards) <= half_rad + reach_rad)
        }
        None => true,
    });
    blocks
}

/// Axis and half angle of a cone that contains the directions of a block, view axes; `None`: the block may show anything.
fn cone_of(projection: &Projection, tile: &Tile, [x, y]: [u32; 2]) -> Option<(DVec3, f64)> {
    if matches!(projection, Projection::Tabulated(_)) {
        return None;
    }
    let mapping = projection.mapping();
    let size = DVec2::from(mapping.size().map(f64::from));
    let side = |first: u32, last: u32| {
        let (first, last) = (f64::from(first), f64::from(last));
        [first, 0.5 * (first + last), last]
    };
    let columns = side(x, (x + BLOCK_PX).min(mapping.size()[0]));
    let rows = side(tile.first_row + y, tile.first_row + (y + BLOCK_PX).min(tile.rows));
    let direction = |pixel: DVec2| {
        // Outside a round picture, use its rim.
        let held = match projection {
            Projection::Fisheye(_) => 0.5 * size + (pixel - 0.5 * size).clamp_length_max(0.5 * size.x - 1e-3),
            _ => pixel,
        };
        mapping.direction_from_pixel(held).map(DVec3::normalize)
    };
    let axis = direction(DVec2::new(columns[1], rows[1]))?;
    let mut half_rad = 0.0_f64;
    for pixel in columns.into_iter().flat_map(|column| rows.map(|row| DVec2::new(column, row))) {
        half_rad = half_rad.max(direction(pixel)?.angle_between(axis));
    }
    Some((axis, ROOM * half_rad))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::plan::bodies::seen::Around;
    use crate::view::{
        Part,
        projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective},
    };

    /// Every pixel is within the cone of its block, and the cones are not the whole sphere.
    #[test]
    fn cones_of_blocks_contain_the_directions_of_their_pixels() {
        let fisheye = |size: u32, mapping, fov| Projection::Fisheye(Fisheye::new([size; 2], mapping, fov).unwrap());
        let projections = [
            Projection::Perspective(Perspective::symmetric([300, 200], 2.0).unwrap()),
            Projection::CubeFace(CubeFace::new(Face::Up, 200).unwrap()),
            Projection::Equirectangular(Equirectangular::new([400, 200]).unwrap()),
            Projection::Equirectangular(Equirectangular::new([64, 32]).unwrap()),
            fisheye(300, FisheyeMapping::Equidistant, 3.2),
            fisheye(300, FisheyeMapping::Equidistant, 6.2),
            fisheye(40, FisheyeMapping::Equidistant, 6.2),
            fisheye(300, FisheyeMapping::Equisolid, 6.0),
            fisheye(300, FisheyeMapping::Orthographic, 3.1),
            fisheye(300, FisheyeMapping::Stereographic, 4.0),
        ];
        for projection in projections {
            let mapping = projection.mapping();
            let [width, height] = mapping.size();
            let first_row = height / 3;
            let tile = Tile { viewport: 0, first_row, rows: height - first_row, first_pixel: 0 };
            let blocks = all_blocks(width, &tile);
            let mut pixels = 0;
            for &block in &blocks {
                let (axis, half_rad) = cone_of(&projection, &tile, block).unwrap();
                for y in block[1]..(block[1] + BLOCK_PX).min(tile.rows) {
                    for x in block[0]..(block[0] + BLOCK_PX).min(width) {
                        pixels += 1;
                        let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(first_row + y) + 0.5);
                        let Some(direction) = mapping.direction_from_pixel(pixel) else { continue };
                        assert!(axis.angle_between(direction) <= half_rad, "{projection:?} {pixel}");
                    }
                }
            }
            assert_eq!(pixels, width * tile.rows, "{projection:?}");
            // A small body at the centre of a pixel is in few blocks, including that pixel's.
            let pixel = DVec2::new(f64::from(width / 2) + 0.5, f64::from(first_row + tile.rows / 2) + 0.5);
            let disc = BodyDisc {
                body: 0,
                centre: mapping.direction_from_pixel(pixel).unwrap(),
                on_plane: false,
                distance_m: 1.0,
                unit_from_view: glam::DMat3::IDENTITY,
                reach_rad: 1e-3,
                part: 1.0,
                kept: 1.0,
                suns: Vec::new(),
                around: Around::Nothing,
            };
            let viewport = Viewport {
                view: 0,
                part: Part::Whole,
                projection: projection.clone(),
                world_from_view: DQuat::IDENTITY,
                eye_offset_m: DVec3::ZERO,
                viewing_circle_m: 0.0,
            };
            let own = [width / 2, tile.rows / 2].map(|side| side / BLOCK_PX * BLOCK_PX);
            let reached = reached_blocks(&viewport, &tile, std::slice::from_ref(&disc));
            assert!(reached.contains(&own), "{projection:?}: {reached:?}");
            assert!(reached.len() <= 9.max(blocks.len() / 2) && (width < 100 || reached.len() < blocks.len()));
            assert!(reached_blocks(&viewport, &tile, &[]).is_empty());
            let everywhere = BodyDisc { reach_rad: 4.0, ..disc };
            assert_eq!(reached_blocks(&viewport, &tile, &[everywhere]), blocks);
        }
    }
}

//! Atlases in f64: parallel projections of the finest mesh into tiles, and their bilinear samples.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::raster::{Projected, hits};
use crate::{
    plan::asteroids::{
        bounds::BORDER_PX,
        tiles::{AtlasLayout, AtlasTile},
    },
    scene::asteroids::Shape,
};

/// A texel of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Texel {
    /// Fraction of it that the shape covers.
    pub coverage: f64,
    /// Mean normal of the covered part, shape's axes. If nothing is covered, this and the next two fields are those of the nearest covered texel.
    pub normal: DVec3,
    /// Mean albedo factor of the covered part.
    pub albedo: f64,
    /// Mean depth of the covered part along the tile's direction, in units of the shape's bound: 0 at its centre, 1 towards the eye.
    pub depth: f64,
}

/// The atlas of one shape.
#[derive(Clone, Debug)]
pub struct Atlas {
    layout: AtlasLayout,
    tiles: u32,
    tile_px: u32,
    bound: f64,
    /// Tile by tile, row by row within a tile.
    texels: Vec<Texel>,
}

impl Atlas {
    /// Bakes the finest mesh of a shape, with `samples` x `samples` samples per texel. A sphere with the radius of the
    /// shape's bound touches the one-texel border of every tile.
    pub fn bake(shape: &Shape, layout: AtlasLayout, tiles: u32, tile_px: u32, samples: usize) -> Self {
        let texels = (0..tiles * tiles)
            .into_par_iter()
            .flat_map(|index| {
                let tile = AtlasTile { column: index % tiles, row: index / tiles };
                bake_tile(shape, layout, tile, tiles, tile_px as usize, samples)
            })
            .collect();
        Self { layout, tiles, tile_px, bound: shape.bound, texels }
    }

    /// Returns the layout of its tiles.
    pub fn layout(&self) -> AtlasLayout {
        self.layout
    }

    /// Returns the number of tiles along a side.
    pub fn tiles(&self) -> u32 {
        self.tiles
    }

    /// Returns the number of texels along a side of a tile.
    pub fn tile_px(&self) -> u32 {
        self.tile_px
    }

    /// Returns the radius of the sphere that fits into a tile.
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Returns a texel of a tile; columns and rows count from its top left.
    pub fn texel(&self, tile: AtlasTile, x: u32, y: u32) -> Texel {
        let index = tile.row * self.tiles + tile.column;
        self.texels[((index * self.tile_px + y) * self.tile_px + x) as usize]
    }

    /// Samples a tile bilinearly. `place` is in units of the bound, right and up from the centre of the picture.
    pub fn sample(&self, tile: AtlasTile, place: DVec2) -> Texel {
        let side = f64::from(self.tile_px);
        let scale = 0.5 * (side - f64::from(BORDER_PX));
        let texel = DVec2::new(0.5 * side + scale * place.x, 0.5 * side - scale * place.y);
        let held = texel.clamp(DVec2::splat(0.5), DVec2::splat(side - 0.5)) - 0.5;
        let low = held.floor().min(DVec2::splat(side - 2.0));
        let part = held - low;
        let mut sum = Texel::default();
        for (dx, dy, weight) in [
            (0, 0, (1.0 - part.x) * (1.0 - part.y)),
            (1, 0, part.x * (1.0 - part.y)),
            (0, 1, (1.0 - part.x) * part.y),
            (1, 1, part.x * part.y),
        ] {
            let texel = self.texel(tile, low.x as u32 + dx, low.y as u32 + dy);
            sum.coverage += weight * texel.coverage;
            sum.normal += weight * texel.normal;
            sum.albedo += weight * texel.albedo;
            sum.depth += weight * texel.depth;
        }
        sum
    }
}

fn bake_tile(
    shape: &Shape,
    layout: AtlasLayout,
    tile: AtlasTile,
    tiles: u32,
    side: usize,
    samples: usize,
) -> Vec<Texel> {
    let axes = layout.axes(tile, tiles);
    let scale = 0.5 * (side as f64 - f64::from(BORDER_PX)) * samples as f64 / shape.bound;
    let middle = 0.5 * (side * samples) as f64;
    let found = hits(&shape.lods[0].mesh, side * samples, |position| Projected {
        place: DVec2::new(middle + scale * position.dot(axes.right), middle - scale * position.dot(axes.up)),
        nearness: position.dot(axes.direction),
        weight: 1.0,
    });
    let mut texels = vec![Texel::default(); side * side];
    for (index, texel) in texels.iter_mut().enumerate() {
        let first = (index / side * side * samples + index % side) * samples;
        let seen = (0..samples * samples)
            .filter_map(|sample| found[first + sample / samples * side * samples + sample % samples]);
        let mut count = 0.0;
        for hit in seen {
            count += 1.0;
            texel.normal += hit.normal;
            texel.albedo += hit.albedo;
            texel.depth += hit.position.dot(axes.direction) / shape.bound;
        }
        if count > 0.0 {
            texel.coverage = count / (samples * samples) as f64;
            texel.normal /= count;
            texel.albedo /= count;
            texel.depth /= count;
        }
    }
    bleed(&mut texels, side);
    texels
}

/// Gives every uncovered texel the values of the nearest covered one, or of the first of several equally near ones.
fn bleed(texels: &mut [Texel], side: usize) {
    let covered: Vec<(usize, Texel)> =
        texels.iter().copied().enumerate().filter(|(_, texel)| texel.coverage > 0.0).collect();
    for (index, texel) in texels.iter_mut().enumerate().filter(|(_, texel)| texel.coverage == 0.0) {
        let distance = |other: usize| {
            let (dx, dy) = ((index % side).abs_diff(other % side), (index / side).abs_diff(other / side));
            dx * dx + dy * dy
        };
        if let Some((_, nearest)) = covered.iter().min_by_key(|(other, _)| distance(*other)) {
            *texel = Texel { coverage: 0.0, ..*nearest };
        }
    }
}

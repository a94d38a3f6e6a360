//! Bakes impostor atlases on the CPU, on all cores: the finest mesh of a shape is drawn onto every tile, and every texel
//! is the mean of its samples.
//!
//! Every adapter gets the same bits, so a cached atlas serves all of them. For a software driver this is faster than its rasteriser, because only the
//! nearest triangle and its depth are written per sample.
//!
//! No shader: works on the CPU.
//!
//! The f64 twin is `crate::reference::asteroids::impostors`.

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::texels::{Level, TEXEL_BYTES, Texel, bleed, write_tile};
use crate::{
    plan::asteroids::{
        AsteroidSettings, ImpostorMethod,
        bounds::BORDER_PX,
        tiles::{AtlasLayout, AtlasTile},
    },
    scene::asteroids::{Mesh, Shape},
};

/// Samples along the side of a texel.
const SAMPLES: usize = 4;
/// Triangle number of samples that no triangle covers.
const NO_TRIANGLE: u32 = u32::MAX;

/// Layout and size of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct AtlasSize {
    pub layout: AtlasLayout,
    /// Tiles along a side.
    pub tiles: u32,
    /// Texels along a side of a tile.
    pub tile_px: u32,
}

impl AtlasSize {
    /// Returns the atlas that a method reads; `None` for methods without an atlas.
    pub(crate) fn from_method(method: ImpostorMethod, settings: &AsteroidSettings) -> Option<Self> {
        let layout = AtlasLayout::for_method(method)?;
        Some(Self { layout, tiles: settings.tiles, tile_px: settings.tile_px })
    }

    /// Returns the number of texels along a side of the atlas.
    pub(crate) fn side(self) -> usize {
        self.tiles as usize * self.tile_px as usize
    }
}

/// Bakes the finest level of a shape's atlas. Albedos are divided by `albedo_scale`.
pub(super) fn bake(shape: &Shape, size: AtlasSize, albedo_scale: f32) -> Level {
    let baker = TileBaker::new(shape, size, albedo_scale);
    let (side, px) = (size.side(), size.tile_px as usize);
    let mut level = Level::empty(side);
    let [normal_bytes, surface_bytes] = TEXEL_BYTES.map(|bytes| bytes * side * px);
    let rows = level.normals.par_chunks_mut(normal_bytes).zip(level.surfaces.par_chunks_mut(surface_bytes));
    rows.zip(0..size.tiles).for_each_init(Samples::default, |samples, ((normals, surfaces), row)| {
        for column in 0..size.tiles {
            let mut texels = baker.texels(samples, AtlasTile { column, row });
            bleed(&mut texels, px);
            write_tile(&texels, px, [&mut *normals, &mut *surfaces], side, column as usize);
        }
    });
    level
}

/// Draws the tiles of one shape's atlas.
pub(super) struct TileBaker<'a> {
    mesh: &'a Mesh,
    /// Radius of the bounding sphere, mean radii.
    bound: f32,
    size: AtlasSize,
    albedo_scale: f32,
}

/// A value that is linear in a picture: `at_origin + slope . place`.
#[derive(Clone, Copy)]
struct Plane<T> {
    at_origin: T,
    slope: [T; 2],
}

/// Samples of one tile, row by row, and the projected mesh; kept from tile to tile.
#[derive(Default)]
pub(super) struct Samples {
    /// Depth towards the eye, bounding radii.
    depths: Vec<f32>,
    /// Index into `seen`, or [`NO_TRIANGLE`].
    triangles: Vec<u32>,
    /// Normal and albedo of a triangle at its samples.
    seen: Vec<Plane<Vec4>>,
    /// Position in samples from the top left, and depth.
    vertices: Vec<Vec3>,
}

impl<'a> TileBaker<'a> {
    pub(super) fn new(shape: &'a Shape, size: AtlasSize, albedo_scale: f32) -> Self {
        Self { mesh: &shape.lods[0].mesh, bound: shape.bound as f32, size, albedo_scale }
    }

    /// Returns the texels of a tile, row by row from the top left. A texel without a covered sample is [`Texel::default`].
    pub(super) fn texels(&self, samples: &mut Samples, tile: AtlasTile) -> Vec<Texel> {
        let px = self.size.tile_px as usize;
        let side = px * SAMPLES;
        self.project(samples, tile, side);
        self.draw(samples, side);
        (0..px * px).map(|texel| self.texel(samples, side, [texel % px, texel / px])).collect()
    }

    /// Projects the vertices along the tile's direction and clears the samples.
    fn project(&self, samples: &mut Samples, tile: AtlasTile, side: usize) {
        let axes = self.size.layout.axes(tile, self.size.tiles);
        let [right, up, direction] = [axes.right, axes.up, axes.direction].map(|axis| axis.as_vec3() / self.bound);
        // A border of half of `BORDER_PX` texels around the bounding sphere stays empty.
        let scale = 0.5 * (self.size.tile_px - BORDER_PX) as f32 * SAMPLES as f32;
        let middle = 0.5 * side as f32;
        samples.vertices.clear();
        samples.vertices.extend(self.mesh.positions.iter().map(|position| {
            let position = Vec3::from_array(*position);
            Vec3::new(middle + scale * position.dot(right), middle - scale * position.dot(up), position.dot(direction))
        }));
        samples.seen.clear();
        samples.depths.clear();
        samples.depths.resize(side * side, f32::NEG_INFINITY);
        samples.triangles.clear();
        samples.triangles.resize(side * side, NO_TRIANGLE);
    }

    /// Draws all triangles that face the eye. The mesh is closed, so the others are hidden.
    fn draw(&self, samples: &mut Samples, side: usize) {
        for triangle in &self.mesh.triangles {
            let at = |corner: usize| samples.vertices[triangle[corner] as usize];
            let corners = [at(0), at(1), at(2)];
            let [a, b, c] = [corners[0].truncate(), corners[1].truncate(), corners[2].truncate()];
            // The y axis of a picture points down, so counter-clockwise triangles have a negative area.
            let doubled_area = (b - a).perp_dot(c - a);
            if doubled_area >= 0.0 {
                continue;
            }
            let depth = plane(corners, doubled_area, [corners[0].z, corners[1].z, corners[2].z]);
            let number = samples.seen.len() as u32;
            let mut covers = false;
            // The samples of a row lie between its crossings with two edges. Triangles at a common edge compute the same crossing, so every sample
            // belongs to exactly one of them.
            let [top, middle, bottom] = by_y([a, b, c]);
            let (long, upper, lower) = (Edge::new(top, bottom), Edge::new(top, middle), Edge::new(middle, bottom));
            let (first, bend, end) = (first_sample(top.y), first_sample(middle.y), first_sample(bottom.y).min(side));
            let mut y = first as u32 as f32 + 0.5;
            for row in first..end {
                let (one, other) = (long.crossing(y), if row < bend { upper.crossing(y) } else { lower.crossing(y) });
                let at_row = depth.at_origin + depth.slope[1] * y;
                y += 1.0;
                let (start, end) = (first_sample(one.min(other)), first_sample(one.max(other)).min(side));
                if start >= end {
                    continue;
                }
                covers = true;
                let nearest = &mut samples.depths[row * side..][start..end];
                let shown = &mut samples.triangles[row * side..][start..end];
                let mut x = start as u32 as f32 + 0.5;
                for i in 0..end - start {
                    let found = at_row + depth.slope[0] * x;
                    x += 1.0;
                    if found > nearest[i] {
                        nearest[i] = found;
                        shown[i] = number;
                    }
                }
            }
            if covers {
                let shown = |corner: usize| {
                    let vertex = triangle[corner] as usize;
                    Vec3::from_array(self.mesh.normals[vertex]).extend(self.mesh.albedos[vertex] / self.albedo_scale)
                };
                samples.seen.push(plane(corners, doubled_area, [shown(0), shown(1), shown(2)]));
            }
        }
    }

    /// Returns the means over the covered samples of a texel, and the covered share.
    fn texel(&self, samples: &Samples, side: usize, [x, y]: [usize; 2]) -> Texel {
        let (mut sum, mut depth, mut count) = (Vec4::ZERO, 0.0, 0.0);
        let left = (x * SAMPLES) as u32 as f32 + 0.5;
        let mut place = Vec2::new(left, (y * SAMPLES) as u32 as f32 + 0.5);
        for row in y * SAMPLES..(y + 1) * SAMPLES {
            let first = row * side + x * SAMPLES;
            let triangles = &samples.triangles[first..first + SAMPLES];
            let depths = &samples.depths[first..first + SAMPLES];
            place.x = left;
            for column in 0..SAMPLES {
                if let Some(seen) = samples.seen.get(triangles[column] as usize) {
                    let shown = seen.at(place);
                    let length = shown.truncate().length();
                    let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
                    sum += shown * Vec4::new(scale, scale, scale, 1.0);
                    depth += depths[column];
                    count += 1.0;
                }
                place.x += 1.0;
            }
            place.y += 1.0;
        }
        if count == 0.0 {
            return Texel::default();
        }
        let [x, y, z] = (0.5 * sum.truncate() / count + 0.5).to_array();
        let coverage = count / (SAMPLES * SAMPLES) as f32;
        Texel { normal: [x, y, z, coverage], surface: [sum.w / count, 0.5 + 0.5 * depth / count] }
    }
}

/// Returns the index of the first sample that is not before a position in the picture. Samples are at `index + 0.5`, so it is the nearest integer.
/// Adding 2^23 rounds an f32 to an integer and leaves it in the lowest bits; `f32::round` would call the C library.
#[inline]
fn first_sample(position: f32) -> usize {
    const TWO_TO_23: f32 = 8_388_608.0;
    ((position.max(0.0) + TWO_TO_23).to_bits() - TWO_TO_23.to_bits()) as usize
}

/// Sorts corners from the top to the bottom.
#[inline]
fn by_y([a, b, c]: [Vec2; 3]) -> [Vec2; 3] {
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    let (b, c) = if b.y <= c.y { (b, c) } else { (c, b) };
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    [a, b, c]
}

/// An edge of a triangle.
struct Edge {
    top: Vec2,
    /// Change of x per row.
    slope: f32,
}

impl Edge {
    /// Creates the edge from its upper to its lower end.
    #[inline]
    fn new(top: Vec2, bottom: Vec2) -> Self {
        Self { top, slope: (bottom.x - top.x) / (bottom.y - top.y) }
    }

    /// Returns x at which the edge crosses a row between its ends.
    #[inline]
    fn crossing(&self, y: f32) -> f32 {
        self.top.x + (y - self.top.y) * self.slope
    }
}

/// Returns the plane through the values at the corners of a triangle.
#[inline]
fn plane<T>([a, b, c]: [Vec3; 3], doubled_area: f32, [at_a, at_b, at_c]: [T; 3]) -> Plane<T>
where
    T: Copy + std::ops::Sub<Output = T> + std::ops::Mul<f32, Output = T>,
{
    let (ab, ac) = ((b - a).truncate(), (c - a).truncate());
    let (to_b, to_c) = (at_b - at_a, at_c - at_a);
    let slope =
        [(to_b * ac.y - to_c * ab.y) * (1.0 / doubled_area), (to_c * ab.x - to_b * ac.x) * (1.0 / doubled_area)];
    Plane { at_origin: at_a - slope[0] * a.x - slope[1] * a.y, slope }
}

impl<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>> Plane<T> {
    #[inline]
    fn at(&self, place: Vec2) -> T {
        self.at_origin + self.slope[0] * place.x + self.slope[1] * place.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sample_is_the_one_whose_centre_follows() {
        let cases = [(-3.0, 0), (0.0, 0), (0.49, 0), (0.51, 1), (1.49, 1), (1.6, 2), (127.49, 127), (255.6, 256)];
        for (position, first) in cases {
            assert_eq!(first_sample(position), first, "{position}");
        }
    }
}

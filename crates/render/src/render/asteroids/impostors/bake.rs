//! Bakes impostor atlases on the CPU, on all cores: the finest mesh of a shape is drawn onto every tile, and every texel
//! is the mean of its samples.
//!
//! The same bits on every adapter, so a cached atlas serves all of them. On a software driver it is faster than its
//! rasteriser, because nothing but the nearest triangle and its depth is written per sample.
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

/// Samples along the side of a texel. A row of them is one vector.
const SAMPLES: usize = 4;
/// Centres of the samples in a row of a texel, from its left side.
const CENTRES: Vec4 = Vec4::new(0.5, 1.5, 2.5, 3.5);
/// Number of a triangle at samples that none covers: beyond every index.
const NO_TRIANGLE: f32 = f32::INFINITY;

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
    /// Atlas that a method reads; `None` for methods without an atlas.
    pub(crate) fn from_method(method: ImpostorMethod, settings: &AsteroidSettings) -> Option<Self> {
        let layout = AtlasLayout::for_method(method)?;
        Some(Self { layout, tiles: settings.tiles, tile_px: settings.tile_px })
    }

    /// Texels along a side of the atlas.
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
    /// Depths towards the eye, bounding radii.
    depths: Vec<Vec4>,
    /// Indices into `seen` as floats, or [`NO_TRIANGLE`].
    triangles: Vec<Vec4>,
    /// What a triangle shows at its samples: normal and albedo.
    seen: Vec<Plane<Vec4>>,
    /// Position in samples from the top left, and depth.
    vertices: Vec<Vec3>,
}

impl<'a> TileBaker<'a> {
    pub(super) fn new(shape: &'a Shape, size: AtlasSize, albedo_scale: f32) -> Self {
        Self { mesh: &shape.lods[0].mesh, bound: shape.bound as f32, size, albedo_scale }
    }

    /// Texels of a tile, row by row from the top left. Those without a covered sample are [`Texel::default`].
    pub(super) fn texels(&self, samples: &mut Samples, tile: AtlasTile) -> Vec<Texel> {
        let px = self.size.tile_px as usize;
        self.project(samples, tile, px);
        self.draw(samples, px);
        (0..px * px).map(|texel| samples.texel(px, [texel % px, texel / px])).collect()
    }

    /// Projects the vertices along the tile's direction and clears the samples.
    fn project(&self, samples: &mut Samples, tile: AtlasTile, px: usize) {
        let axes = self.size.layout.axes(tile, self.size.tiles);
        let [right, up, direction] = [axes.right, axes.up, axes.direction].map(|axis| axis.as_vec3() / self.bound);
        // A border of half of `BORDER_PX` texels around the bounding sphere stays empty.
        let scale = 0.5 * (self.size.tile_px - BORDER_PX) as f32 * SAMPLES as f32;
        let middle = 0.5 * (px * SAMPLES) as f32;
        samples.vertices.clear();
        samples.vertices.extend(self.mesh.positions.iter().map(|position| {
            let position = Vec3::from_array(*position);
            Vec3::new(middle + scale * position.dot(right), middle - scale * position.dot(up), position.dot(direction))
        }));
        samples.seen.clear();
        samples.depths.clear();
        samples.depths.resize(SAMPLES * px * px, Vec4::NEG_INFINITY);
        samples.triangles.clear();
        samples.triangles.resize(SAMPLES * px * px, Vec4::splat(NO_TRIANGLE));
    }

    /// Draws all triangles that face the eye. The mesh is closed, so the others are hidden.
    fn draw(&self, samples: &mut Samples, px: usize) {
        let side = px * SAMPLES;
        for triangle in &self.mesh.triangles {
            let at = |corner: usize| samples.vertices[triangle[corner] as usize];
            let corners = [at(0), at(1), at(2)];
            let [a, b, c] = [corners[0].truncate(), corners[1].truncate(), corners[2].truncate()];
            // The y axis of a picture points down, so counter-clockwise triangles have a negative area.
            let doubled_area = (b - a).perp_dot(c - a);
            if doubled_area >= 0.0 {
                continue;
            }
            // Rows of samples, and texels of each row, that the triangle may cover.
            let (least, most) = (a.min(b).min(c), a.max(b).max(c));
            let rows = first_sample(least.y)..first_sample(most.y).min(side);
            let [left, right] = [first_sample(least.x), first_sample(most.x).min(side)];
            if rows.is_empty() || left >= right {
                continue;
            }
            let texels = left / SAMPLES..right.div_ceil(SAMPLES);
            // A sample is inside if it is on the inner side of all edges. Triangles at a common edge compute values that differ in sign only,
            // so every sample belongs to at least one of them.
            let edges = [edge(a, b), edge(b, c), edge(c, a)];
            let depth = plane(corners, doubled_area, [corners[0].z, corners[1].z, corners[2].z]);
            let number = Vec4::splat(samples.seen.len() as f32);
            for row in rows {
                let y = row as u32 as f32 + 0.5;
                let [one, two, three] = [edges[0].row(y), edges[1].row(y), edges[2].row(y)];
                let depth = depth.row(y);
                let texels = row * px + texels.start..row * px + texels.end;
                let nearest = &mut samples.depths[texels.clone()];
                let shown = &mut samples.triangles[texels];
                let mut x = CENTRES + (left / SAMPLES * SAMPLES) as u32 as f32;
                for i in 0..nearest.len() {
                    let inside = one.at(x).min(two.at(x)).min(three.at(x)).cmpge(Vec4::ZERO);
                    let found = depth.at(x);
                    let visible = inside & found.cmpgt(nearest[i]);
                    nearest[i] = Vec4::select(visible, found, nearest[i]);
                    shown[i] = Vec4::select(visible, number, shown[i]);
                    x += SAMPLES as f32;
                }
            }
            let shown = |corner: usize| {
                let vertex = triangle[corner] as usize;
                Vec3::from_array(self.mesh.normals[vertex]).extend(self.mesh.albedos[vertex] / self.albedo_scale)
            };
            samples.seen.push(plane(corners, doubled_area, [shown(0), shown(1), shown(2)]));
        }
    }
}

impl Samples {
    /// Means over the covered samples of a texel, and the covered share, in a tile of `px` texels along a side.
    fn texel(&self, px: usize, [x, y]: [usize; 2]) -> Texel {
        let (mut sum, mut depth, mut count) = (Vec4::ZERO, 0.0, 0.0);
        let xs = (CENTRES + (x * SAMPLES) as u32 as f32).to_array();
        for row in y * SAMPLES..(y + 1) * SAMPLES {
            let place_y = row as u32 as f32 + 0.5;
            let triangles = self.triangles[row * px + x].to_array();
            let depths = self.depths[row * px + x].to_array();
            for column in 0..SAMPLES {
                if let Some(seen) = self.seen.get(triangles[column] as usize) {
                    let shown = seen.at(Vec2::new(xs[column], place_y));
                    let length = shown.truncate().length();
                    let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
                    sum += shown * Vec4::new(scale, scale, scale, 1.0);
                    depth += depths[column];
                    count += 1.0;
                }
            }
        }
        if count == 0.0 {
            return Texel::default();
        }
        let [x, y, z] = (0.5 * sum.truncate() / count + 0.5).to_array();
        let coverage = count / (SAMPLES * SAMPLES) as f32;
        Texel { normal: [x, y, z, coverage], surface: [sum.w / count, 0.5 + 0.5 * depth / count] }
    }
}

/// The first sample, at `index + 0.5`, that is not before a position in the picture: the nearest integer. Adding 2^23 rounds
/// an f32 to an integer and leaves it in the lowest bits; `f32::round` is a call into the C library.
#[inline]
fn first_sample(position: f32) -> usize {
    const TWO_TO_23: f32 = 8_388_608.0;
    ((position.max(0.0) + TWO_TO_23).to_bits() - TWO_TO_23.to_bits()) as usize
}

/// Twice the area between an edge of a triangle that faces the eye and a place, positive inside.
#[inline]
fn edge(from: Vec2, to: Vec2) -> Plane<f32> {
    Plane { at_origin: to.perp_dot(from), slope: [to.y - from.y, from.x - to.x] }
}

/// The plane through the values at the corners of a triangle.
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

/// The values of a plane along a row.
#[derive(Clone, Copy)]
struct Row {
    at_left: Vec4,
    slope: Vec4,
}

impl Plane<f32> {
    #[inline]
    fn row(&self, y: f32) -> Row {
        Row { at_left: Vec4::splat(self.at_origin + self.slope[1] * y), slope: Vec4::splat(self.slope[0]) }
    }
}

impl Row {
    #[inline]
    fn at(&self, x: Vec4) -> Vec4 {
        self.at_left + self.slope * x
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

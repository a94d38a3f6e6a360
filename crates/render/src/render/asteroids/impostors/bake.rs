//! Bakes impostor atlases on the CPU, on all cores: the finest mesh of a shape is drawn onto every tile, and every texel
//! is the mean of its samples.
//!
//! The same bits on every adapter, so a cached atlas serves all of them. On a software driver it is faster than its
//! rasteriser, because nothing but the nearest triangle and its depth is written per sample.
//!
//! No shader: works on the CPU.
//!
//! The f64 twin is `crate::reference::asteroids::impostors`.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::texels::{Level, TEXEL_BYTES, Texel, bleed, write_tile};
use crate::{
    plan::asteroids::{
        AsteroidSettings, ImpostorMethod,
        bounds::BORDER_PX,
        tiles::{AtlasLayout, AtlasTile},
    },
    scene::asteroids::{Mesh, Shape, silhouette::first_centre},
};

/// Samples along the side of a texel.
const SAMPLES: usize = 4;
/// Number of a triangle at samples that none covers.
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

/// What a triangle shows at its samples.
struct SeenTriangle {
    normal: Plane<Vec3>,
    albedo: Plane<f32>,
}

/// Samples of one tile, row by row, and the projected mesh; kept from tile to tile.
#[derive(Default)]
pub(super) struct Samples {
    /// Depth towards the eye, bounding radii.
    depths: Vec<f32>,
    /// Index into `seen`, or [`NO_TRIANGLE`].
    triangles: Vec<u32>,
    seen: Vec<SeenTriangle>,
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
            // Samples of a row are between the crossings of two edges. Triangles at a common edge compute the same
            // crossing, so every sample belongs to exactly one of them.
            let low = a.y.min(b.y).min(c.y);
            let high = a.y.max(b.y).max(c.y);
            let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];
            for row in first_sample(low)..first_sample(high).min(side) {
                let y = row as f32 + 0.5;
                let [left, right] = crossings(&edges, y);
                let span = first_sample(left)..first_sample(right).min(side);
                if span.is_empty() {
                    continue;
                }
                covers = true;
                let at_row = depth.at_origin + depth.slope[1] * y;
                let places = row * side + span.start..row * side + span.end;
                let nearest = &mut samples.depths[places.clone()];
                let shown = &mut samples.triangles[places][..nearest.len()];
                for i in 0..nearest.len() {
                    let found = at_row + depth.slope[0] * ((span.start + i) as f32 + 0.5);
                    let nearer = found > nearest[i];
                    nearest[i] = if nearer { found } else { nearest[i] };
                    shown[i] = if nearer { number } else { shown[i] };
                }
            }
            if covers {
                let normals = triangle.map(|vertex| Vec3::from_array(self.mesh.normals[vertex as usize]));
                let albedos = triangle.map(|vertex| self.mesh.albedos[vertex as usize] / self.albedo_scale);
                samples.seen.push(SeenTriangle {
                    normal: plane(corners, doubled_area, normals),
                    albedo: plane(corners, doubled_area, albedos),
                });
            }
        }
    }

    /// Means over the covered samples of a texel, and the covered share.
    fn texel(&self, samples: &Samples, side: usize, [x, y]: [usize; 2]) -> Texel {
        let (mut normal, mut albedo, mut depth, mut count) = (Vec3::ZERO, 0.0, 0.0, 0.0);
        for row in y * SAMPLES..(y + 1) * SAMPLES {
            for column in x * SAMPLES..(x + 1) * SAMPLES {
                let sample = row * side + column;
                let Some(seen) = samples.seen.get(samples.triangles[sample] as usize) else { continue };
                let place = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                normal += seen.normal.at(place).normalize_or_zero();
                albedo += seen.albedo.at(place);
                depth += samples.depths[sample];
                count += 1.0;
            }
        }
        if count == 0.0 {
            return Texel::default();
        }
        let [x, y, z] = (0.5 * normal / count + 0.5).to_array();
        let coverage = count / (SAMPLES * SAMPLES) as f32;
        Texel { normal: [x, y, z, coverage], surface: [albedo / count, 0.5 + 0.5 * depth / count] }
    }
}

/// The first sample, at `index + 0.5`, that is not before a position.
#[inline]
fn first_sample(position: f32) -> usize {
    first_centre(f64::from(position))
}

/// An edge of a triangle from its upper to its lower end.
struct Edge {
    top: Vec2,
    bottom_y: f32,
    /// Change of x per row.
    slope: f32,
}

impl Edge {
    #[inline]
    fn new(from: Vec2, to: Vec2) -> Self {
        let (top, bottom) = if from.y <= to.y { (from, to) } else { (to, from) };
        Self { top, bottom_y: bottom.y, slope: (bottom.x - top.x) / (bottom.y - top.y) }
    }
}

/// The smallest and the largest x at which the edges of a triangle cross a row. `y` is between its lowest and its highest
/// corner.
#[inline]
fn crossings(edges: &[Edge; 3], y: f32) -> [f32; 2] {
    let mut found = [f32::INFINITY, f32::NEG_INFINITY];
    for Edge { top, bottom_y, slope } in edges {
        if top.y <= y && y < *bottom_y {
            let x = top.x + (y - top.y) * slope;
            found = [found[0].min(x), found[1].max(x)];
        }
    }
    found
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

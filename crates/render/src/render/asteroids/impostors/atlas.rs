//! Atlases of impostors as textures: baked on the CPU, kept on disk, one layer per shape.
//!
//! `octahedral` and `octahedral_blend` read the same atlas; `euler_atlas` has a separate one. Both textures are arrays
//! with one layer per shape and with mip levels:
//! - *normals*, `Rgba8Unorm`: the mean normal in the shape's axes, mapped from -1..1 to 0..1, and coverage;
//! - *surfaces*, `Rgba8Unorm`: albedo divided by [`ImpostorAtlas::albedo_scale`], and depth along the tile's direction
//!   in units of the shape's bounding radius (0 to 1; 0.5 in the middle, 1 towards the eye).
//!
//! Another thread can bake the atlases that a renderer will need in advance ([`BakedImpostors`]). The renderer uploads them layer by layer during
//! earlier frames, so that no frame waits for all of them. The cache of the process keeps the finest levels.
//!
//! No twin: reference/asteroids/impostors/bake.rs.

use std::{
    collections::HashMap,
    convert::Infallible,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use rayon::prelude::*;

use super::texels::{Level, level_count, levels};
use crate::{
    cache::{self, Form, Part},
    gpu::{self, Gpu, GpuError},
    plan::asteroids::{AsteroidSettings, ImpostorMethod, areas::projected_areas, bounds::BORDER_PX},
    render::{
        asteroids::impostors::bake::{self, AtlasSize},
        asteroids::layout,
    },
    scene::asteroids::ShapeSet,
};

/// The finest levels of all layers.
const PART: Part = Part { name: "asteroid-atlas", version: 3 };
const FORM: Form<Vec<Level>> = Form { to_bytes, from_bytes };

/// Reason why an atlas cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImpostorAtlasError {
    /// The atlas would be too large.
    #[error(
        "asteroids.tiles = {tiles} and asteroids.tile_px = {tile_px} make an atlas {side} pixels wide; \
         this adapter allows {limit}"
    )]
    TooLarge {
        /// Tiles along a side.
        tiles: u32,
        /// Texels along a side of a tile.
        tile_px: u32,
        /// Side of the atlas, texels: product of both.
        side: u64,
        /// The adapter's limit, texels.
        limit: u32,
    },
    /// The atlas has fewer than 2 tiles or tiles smaller than 4 texels.
    #[error("asteroids.tiles = {tiles} and asteroids.tile_px = {tile_px}: an atlas needs at least 2 tiles of 4 pixels")]
    TooSmall {
        /// Tiles along a side.
        tiles: u32,
        /// Texels along a side of a tile.
        tile_px: u32,
    },
    /// The set has no shapes, or more than a texture has layers.
    #[error("{shapes} shapes in a field of asteroids: impostors need at least one, and this adapter holds {limit}")]
    Shapes {
        /// Number of shapes.
        shapes: usize,
        /// The adapter's limit.
        limit: u32,
    },
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Impostor atlas on the adapter; bound as group 1 by `shaders/asteroids/impostors/atlas.wgsl`.
pub(crate) struct ImpostorAtlas {
    /// Binding 0: `layout::ImpostorAtlas`, uniform.
    pub parameters: wgpu::Buffer,
    /// Binding 1: an f32 per shape, storage.
    pub bounds: wgpu::Buffer,
    /// Binding 2, `Rgba8Unorm`, a 2D array.
    pub normals: wgpu::TextureView,
    /// Binding 3, `Rgba8Unorm`, a 2D array.
    pub surfaces: wgpu::TextureView,
    /// Binding 4: linear filtering, also between mip levels.
    pub sampler: wgpu::Sampler,
}

impl ImpostorAtlas {
    /// Returns the atlas of a method for all shapes of a set. The atlas was baked in advance, is read from the cache, or is baked now and kept.
    /// Returns `None` for methods without an atlas.
    pub(crate) fn new(
        gpu: &Gpu,
        ahead: &BakedImpostors,
        shapes: &ShapeSet,
        method: ImpostorMethod,
        settings: &AsteroidSettings,
    ) -> Result<Option<Self>, ImpostorAtlasError> {
        let Some(size) = AtlasSize::from_method(method, settings) else { return Ok(None) };
        check(&gpu.device.limits(), shapes, size)?;
        let atlas = ahead.take(shapes, size).unwrap_or_else(|| AtlasAhead::new(shapes, size, layers_of(shapes, size)));
        let textures = atlas.into_textures(gpu);
        let atlas = Self::from_textures(gpu, shapes, size, textures);
        gpu.take_failure()?;
        Ok(Some(atlas))
    }

    fn from_textures(gpu: &Gpu, shapes: &ShapeSet, size: AtlasSize, textures: AtlasTextures) -> Self {
        let parameters = layout::ImpostorAtlas {
            tiles: size.tiles,
            tile_px: size.tile_px,
            levels: level_count(size.tile_px),
            albedo_scale: albedo_scale(shapes),
        };
        let bounds: Vec<f32> = shapes.shapes.iter().map(|shape| shape.bound as f32).collect();
        let whole = |texture: &wgpu::Texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            })
        };
        Self {
            parameters: gpu::uniform_buffer(gpu, "impostor atlas", &parameters),
            bounds: gpu::storage_buffer(gpu, "impostor bounds", &bounds),
            normals: whole(&textures.normals),
            surfaces: whole(&textures.surfaces),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
        }
    }

    /// Returns the bindings of group 1, for a layout that uses all of them.
    pub(crate) fn bindings(&self) -> [(u32, wgpu::BindingResource<'_>); 5] {
        [
            (0, self.parameters.as_entire_binding()),
            (1, self.bounds.as_entire_binding()),
            (2, wgpu::BindingResource::TextureView(&self.normals)),
            (3, wgpu::BindingResource::TextureView(&self.surfaces)),
            (4, wgpu::BindingResource::Sampler(&self.sampler)),
        ]
    }
}

/// Textures of an atlas.
#[derive(Debug)]
pub(super) struct AtlasTextures {
    normals: wgpu::Texture,
    surfaces: wgpu::Texture,
}

impl AtlasTextures {
    fn new(gpu: &Gpu, size: AtlasSize, layers: u32) -> Self {
        let side = size.tiles * size.tile_px;
        let texture = |label| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
                mip_level_count: level_count(size.tile_px),
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        Self { normals: texture("impostor normals"), surfaces: texture("impostor surfaces") }
    }

    /// Writes all levels of a layer.
    fn write(&self, gpu: &Gpu, layer: u32, levels: &[Level]) {
        let side = self.normals.width();
        for (level, texels) in (0..).zip(levels) {
            write_level(gpu, &self.normals, &texels.normals, side >> level, level, layer);
            write_level(gpu, &self.surfaces, &texels.surfaces_with_coverage(), side >> level, level, layer);
        }
    }
}

/// An atlas whose layers are uploaded one by one.
#[derive(Debug)]
pub(super) struct AtlasAhead {
    size: AtlasSize,
    /// Number of layers.
    layers: u32,
    /// Made with the first layer.
    pub(super) textures: Option<AtlasTextures>,
    /// Layers that are not uploaded yet, with all levels.
    pub(super) waiting: Vec<(u32, Vec<Level>)>,
}

impl AtlasAhead {
    fn new(shapes: &ShapeSet, size: AtlasSize, layers: Vec<Vec<Level>>) -> Self {
        Self { size, layers: shapes.shapes.len() as u32, textures: None, waiting: (0..).zip(layers).collect() }
    }

    /// Uploads a layer. Returns `false` if none was left.
    fn upload_one(&mut self, gpu: &Gpu) -> bool {
        let Some((layer, levels)) = self.waiting.pop() else { return false };
        let textures = self.textures.get_or_insert_with(|| AtlasTextures::new(gpu, self.size, self.layers));
        textures.write(gpu, layer, &levels);
        true
    }

    fn into_textures(mut self, gpu: &Gpu) -> AtlasTextures {
        while self.upload_one(gpu) {}
        self.textures.unwrap_or_else(|| AtlasTextures::new(gpu, self.size, self.layers))
    }
}

/// Returns the scale of stored albedos: the greatest albedo factor of all shapes, stored as 1.
fn albedo_scale(shapes: &ShapeSet) -> f32 {
    let finest = shapes.shapes.iter().filter_map(|shape| shape.lods.first());
    let greatest = finest.flat_map(|lod| &lod.mesh.albedos).copied().fold(0.0, f32::max);
    if greatest > 0.0 { greatest } else { 1.0 }
}

fn check(limits: &wgpu::Limits, shapes: &ShapeSet, size: AtlasSize) -> Result<(), ImpostorAtlasError> {
    let AtlasSize { tiles, tile_px, .. } = size;
    if tiles < 2 || tile_px < 2 * BORDER_PX {
        return Err(ImpostorAtlasError::TooSmall { tiles, tile_px });
    }
    let side = u64::from(tiles) * u64::from(tile_px);
    if side > u64::from(limits.max_texture_dimension_2d) {
        return Err(ImpostorAtlasError::TooLarge { tiles, tile_px, side, limit: limits.max_texture_dimension_2d });
    }
    let count = shapes.shapes.len();
    if count == 0 || count > limits.max_texture_array_layers as usize {
        return Err(ImpostorAtlasError::Shapes { shapes: count, limit: limits.max_texture_array_layers });
    }
    Ok(())
}

/// [`BakedImpostors::bake`] waits at most this long for the upload of a layer. If no frames are drawn, nothing is uploaded.
const PATIENCE: Duration = Duration::from_secs(1);

/// Atlases and projected areas that another thread prepared for a renderer that will need them. Clones share the content.
#[derive(Clone, Debug)]
pub struct BakedImpostors(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    /// Limits of the renderer's adapter.
    limits: wgpu::Limits,
    baked: Mutex<Baked>,
    /// Signalled after each upload.
    uploaded: Condvar,
}

#[derive(Debug, Default)]
struct Baked {
    /// Keyed by the digest of the shapes and the atlas size.
    atlases: HashMap<(u64, AtlasSize), AtlasAhead>,
    areas: HashMap<u64, Vec<f32>>,
}

impl Baked {
    /// Returns the number of layers that are not uploaded yet.
    fn waiting(&self) -> usize {
        self.atlases.values().map(|atlas| atlas.waiting.len()).sum()
    }
}

impl BakedImpostors {
    /// Creates an empty store for a renderer with this device.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let limits = gpu.device.limits();
        Self(Arc::new(Shared { limits, baked: Mutex::default(), uploaded: Condvar::new() }))
    }

    fn baked(&self) -> MutexGuard<'_, Baked> {
        // No code panics while it holds the lock, so the content is consistent even if the lock is poisoned.
        self.0.baked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Uploads the next waiting layer, if any. Called by the renderer with each frame.
    pub(crate) fn upload_one(&self, gpu: &Gpu) {
        let mut baked = self.baked();
        if baked.atlases.values_mut().any(|atlas| atlas.upload_one(gpu)) {
            self.0.uploaded.notify_all();
        }
    }

    /// Drops everything with textures, because the renderer's device was lost.
    pub(crate) fn forget_textures(&self) {
        self.baked().atlases.retain(|_, atlas| atlas.textures.is_none());
        self.0.uploaded.notify_all();
    }

    pub(super) fn take(&self, shapes: &ShapeSet, size: AtlasSize) -> Option<AtlasAhead> {
        self.baked().atlases.remove(&(shapes.digest, size))
    }

    /// Returns the projected areas of the shapes of a set, divided by pi: prepared in advance, or computed now.
    pub(crate) fn areas_of(&self, shapes: &ShapeSet) -> Vec<f32> {
        let ahead = self.baked().areas.remove(&shapes.digest);
        ahead.unwrap_or_else(|| shapes.shapes.iter().flat_map(projected_areas).collect())
    }

    /// Prepares the atlases for the first frame with these sets of shapes. If the renderer draws frames in the meantime, this returns after it has
    /// uploaded the atlases. Content that was prepared earlier and has not been used is dropped.
    ///
    /// # Errors
    ///
    /// The atlas settings are invalid for the renderer's adapter.
    pub fn bake(&self, sets: &[Arc<ShapeSet>], settings: &AsteroidSettings) -> Result<(), ImpostorAtlasError> {
        *self.baked() = Baked::default();
        let size = settings.drawn_impostors().and_then(|method| AtlasSize::from_method(method, settings));
        for shapes in sets {
            if let Some(size) = size {
                check(&self.0.limits, shapes, size)?;
                let atlas = AtlasAhead::new(shapes, size, layers_of(shapes, size));
                self.baked().atlases.insert((shapes.digest, size), atlas);
            }
            let areas = shapes.shapes.iter().flat_map(projected_areas).collect();
            self.baked().areas.insert(shapes.digest, areas);
        }
        // Wait as long as layers are being uploaded.
        let mut baked = self.baked();
        while baked.waiting() > 0 {
            let waiting = baked.waiting();
            let progress = self.0.uploaded.wait_timeout_while(baked, PATIENCE, |baked| baked.waiting() == waiting);
            let (now, waited) = progress.unwrap_or_else(PoisonError::into_inner);
            if waited.timed_out() {
                break;
            }
            baked = now;
        }
        Ok(())
    }
}

/// Returns all levels of all layers; the finest ones are read from the cache, or baked now and kept.
fn layers_of(shapes: &ShapeSet, size: AtlasSize) -> Vec<Vec<Level>> {
    let parameters = [size.layout as u32, size.tiles, size.tile_px, shapes.shapes.len() as u32];
    let inputs: [&[u8]; 3] =
        [&shapes.digest.to_le_bytes(), bytemuck::bytes_of(&parameters), &albedo_scale(shapes).to_le_bytes()];
    let Ok(finest) = cache::kept_or_made(PART, &inputs, FORM, || Ok::<_, Infallible>(bake_all(shapes, size)));
    let count = level_count(size.tile_px);
    finest.into_par_iter().map(|finest| levels(finest, size.tiles * size.tile_px, count)).collect()
}

/// Serialises all layers: for each, the number of bytes of its normals, then normals and surfaces.
fn to_bytes(finest: &Vec<Level>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(finest.iter().map(|level| 8 + level.normals.len() + level.surfaces.len()).sum());
    for level in finest {
        bytes.extend((level.normals.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&level.normals);
        bytes.extend_from_slice(&level.surfaces);
    }
    bytes
}

fn from_bytes(mut bytes: &[u8]) -> Option<Vec<Level>> {
    let mut finest = Vec::new();
    while let Some((length, rest)) = bytes.split_first_chunk() {
        let length = usize::try_from(u64::from_le_bytes(*length)).ok().filter(|length| length % 4 == 0)?;
        let (normals, rest) = rest.split_at_checked(length)?;
        // A texel has four bytes of normals and two of its surface.
        let (surfaces, rest) = rest.split_at_checked(length / 2)?;
        finest.push(Level { normals: normals.to_vec(), surfaces: surfaces.to_vec() });
        bytes = rest;
    }
    bytes.is_empty().then_some(finest)
}

fn bake_all(shapes: &ShapeSet, size: AtlasSize) -> Vec<Level> {
    let scale = albedo_scale(shapes);
    shapes.shapes.par_iter().map(|shape| bake::bake(shape, size, scale)).collect()
}

fn write_level(gpu: &Gpu, texture: &wgpu::Texture, bytes: &[u8], side: u32, level: u32, layer: u32) {
    let to = wgpu::TexelCopyTextureInfo {
        texture,
        mip_level: level,
        origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
        aspect: wgpu::TextureAspect::All,
    };
    let bytes_per_row = bytes.len() as u32 / side;
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(bytes_per_row), rows_per_image: Some(side) };
    gpu.queue.write_texture(to, bytes, layout, wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_survive_their_bytes_and_incomplete_ones_are_refused() {
        let level = |texels: u8| Level { normals: (0..4 * texels).collect(), surfaces: (0..2 * texels).collect() };
        let levels = vec![level(16), level(4), level(1)];
        let bytes = to_bytes(&levels);
        let same = |a: &[Level], b: &[Level]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.normals == b.normals && a.surfaces == b.surfaces)
        };
        assert!(from_bytes(&bytes).is_some_and(|read| same(&read, &levels)));
        let cuts = [1, 7, 8, bytes.len() - 1].map(|length| &bytes[..length]);
        assert!(cuts.into_iter().all(|cut| from_bytes(cut).is_none()));
        assert!(from_bytes(&[&bytes[..], &[0]].concat()).is_none());
        let mut other_length = bytes;
        other_length[0] = 63;
        assert!(from_bytes(&other_length).is_none());
    }
}

//! Atlases of impostors as textures: baked on the CPU, kept on disk, one layer per shape.
//!
//! `octahedral` and `octahedral_blend` read the same atlas; `euler_atlas` has a separate one. Both textures are arrays
//! with one layer per shape and with mip levels:
//! - *normals*, `Rgba8Unorm`: the mean normal in the shape's axes, mapped from -1..1 to 0..1, and coverage;
//! - *surfaces*, `Rgba8Unorm`: albedo divided by [`ImpostorAtlas::albedo_scale`], and depth along the tile's direction
//!   in units of the shape's bounding radius (0 to 1; 0.5 in the middle, 1 towards the eye).
//!
//! Another thread can bake the atlases that a renderer will need in advance ([`BakedImpostors`]).
//!
//! A cache file holds the finest level of all layers; its name and header identify shapes and settings. Layout,
//! little-endian: [`Header`], normals of all layers, surfaces of all layers. The CRC-32 covers every byte after itself.
//!
//! No twin: reference/asteroids/impostors/bake.rs.

use std::{
    collections::HashMap,
    io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bytemuck::{Pod, Zeroable};

use rayon::prelude::*;

use super::{
    cache,
    texels::{Level, level_count, levels},
};
use crate::{
    files,
    gpu::{self, Gpu, GpuError},
    plan::asteroids::{AsteroidSettings, ImpostorMethod, areas::projected_areas, bounds::BORDER_PX},
    render::{
        asteroids::impostors::bake::{self, AtlasSize},
        asteroids::layout,
    },
    scene::asteroids::ShapeSet,
};

const _: () = assert!(cfg!(target_endian = "little"), "atlases are little-endian and read without conversion");

const MAGIC: [u8; 8] = *b"STERIMPO";
/// Version of the baked content. Increase it whenever baking changes the texels.
const VERSION: u32 = 2;

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
    /// Returns the atlas of a method for all shapes of a set: baked in advance, read from the cache, or baked now and
    /// cached. Returns `None` for methods without an atlas. An unusable cache file is logged and replaced.
    pub(crate) fn new(
        gpu: &Gpu,
        ahead: &BakedImpostors,
        shapes: &ShapeSet,
        method: ImpostorMethod,
        settings: &AsteroidSettings,
    ) -> Result<Option<Self>, ImpostorAtlasError> {
        let Some(size) = AtlasSize::from_method(method, settings) else { return Ok(None) };
        check(gpu, shapes, size)?;
        let layers = match ahead.take(shapes, size) {
            Some(layers) => layers,
            None => layers_of(shapes, size, settings),
        };
        let atlas = Self::upload(gpu, shapes, size, layers);
        gpu.take_failure()?;
        Ok(Some(atlas))
    }

    fn upload(gpu: &Gpu, shapes: &ShapeSet, size: AtlasSize, layers: Vec<Vec<Level>>) -> Self {
        let side = size.tiles * size.tile_px;
        let count = level_count(size.tile_px);
        let texture = |label, format| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers.len() as u32 },
                mip_level_count: count,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        let normals = texture("impostor normals", wgpu::TextureFormat::Rgba8Unorm);
        let surfaces = texture("impostor surfaces", wgpu::TextureFormat::Rgba8Unorm);
        // Texels of all layers and mip levels.
        for (layer, levels) in (0..).zip(layers) {
            for (level, texels) in (0..).zip(levels) {
                write_level(gpu, &normals, &texels.normals, side >> level, level, layer);
                write_level(gpu, &surfaces, &texels.surfaces_with_coverage(), side >> level, level, layer);
            }
        }
        // Parameters, bounds and views for the bindings.
        let parameters = layout::ImpostorAtlas {
            tiles: size.tiles,
            tile_px: size.tile_px,
            levels: count,
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
            normals: whole(&normals),
            surfaces: whole(&surfaces),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
        }
    }

    /// Bindings of group 1, for a layout that uses all of them.
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

/// Scale of stored albedos: the greatest albedo factor of all shapes, stored as 1.
fn albedo_scale(shapes: &ShapeSet) -> f32 {
    let finest = shapes.shapes.iter().filter_map(|shape| shape.lods.first());
    let greatest = finest.flat_map(|lod| &lod.mesh.albedos).copied().fold(0.0, f32::max);
    if greatest > 0.0 { greatest } else { 1.0 }
}

fn check(gpu: &Gpu, shapes: &ShapeSet, size: AtlasSize) -> Result<(), ImpostorAtlasError> {
    let AtlasSize { tiles, tile_px, .. } = size;
    let limits = gpu.device.limits();
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

/// Atlases and projected areas that another device prepared for a renderer that will need them. Clones share the
/// content.
#[derive(Clone, Debug, Default)]
pub struct BakedImpostors(Arc<Mutex<Baked>>);

#[derive(Debug, Default)]
struct Baked {
    /// Keyed by the digest of the shapes and the atlas size.
    atlases: HashMap<(u64, AtlasSize), Vec<Vec<Level>>>,
    areas: HashMap<u64, Vec<f32>>,
}

impl BakedImpostors {
    fn baked(&self) -> MutexGuard<'_, Baked> {
        // No code panics while it holds the lock, so the content is consistent even if the lock is poisoned.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn take(&self, shapes: &ShapeSet, size: AtlasSize) -> Option<Vec<Vec<Level>>> {
        self.baked().atlases.remove(&(shapes.digest, size))
    }

    /// Projected areas of the shapes of a set, divided by pi: prepared in advance, or computed now.
    pub(crate) fn areas_of(&self, shapes: &ShapeSet) -> Vec<f32> {
        let ahead = self.baked().areas.remove(&shapes.digest);
        ahead.unwrap_or_else(|| shapes.shapes.iter().flat_map(projected_areas).collect())
    }

    /// Prepares the atlases for the first frame with these sets of shapes on an adapter like `gpu`. Content prepared earlier and not yet
    /// taken is dropped.
    ///
    /// # Errors
    ///
    /// The atlas settings are invalid for the adapter.
    pub fn bake(
        &self,
        gpu: &Gpu,
        sets: &[Arc<ShapeSet>],
        settings: &AsteroidSettings,
    ) -> Result<(), ImpostorAtlasError> {
        *self.baked() = Baked::default();
        let size = settings.drawn_impostors().and_then(|method| AtlasSize::from_method(method, settings));
        for shapes in sets {
            if let Some(size) = size {
                check(gpu, shapes, size)?;
                let layers = layers_of(shapes, size, settings);
                self.baked().atlases.insert((shapes.digest, size), layers);
            }
            let areas = shapes.shapes.iter().flat_map(projected_areas).collect();
            self.baked().areas.insert(shapes.digest, areas);
        }
        Ok(())
    }
}

/// Returns all levels of all layers, from the cache, or baked now and cached.
fn layers_of(shapes: &ShapeSet, size: AtlasSize, settings: &AsteroidSettings) -> Vec<Vec<Level>> {
    let header = Header::new(shapes, size);
    let path = settings.cache_folder().map(|folder| folder.join(header.file_name(size)));
    let kept = path.as_deref().and_then(|path| match read(path, &header) {
        Ok(kept) => {
            if kept.is_some() {
                cache::mark_used(path);
            }
            kept
        }
        Err(problem) => {
            tracing::warn!(file = %path.display(), %problem, "cannot use the cached impostor atlas; baking it again");
            None
        }
    });
    let finest = match kept {
        Some(finest) => finest,
        None => {
            let finest = bake_all(shapes, size);
            if let Some(path) = &path
                && let Err(problem) = keep(path, header, &finest, settings)
            {
                tracing::warn!(file = %path.display(), %problem, "cannot write the impostor atlas to the cache");
            }
            finest
        }
    };
    let count = level_count(size.tile_px);
    finest.into_par_iter().map(|finest| levels(finest, size.tiles * size.tile_px, count)).collect()
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

/// The first 48 bytes of a cache file.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    crc32: u32,
    version: u32,
    digest: u64,
    layout: u32,
    tiles: u32,
    tile_px: u32,
    shapes: u32,
    albedo_scale: f32,
    reserved: u32,
}

/// Bytes at the start of the header that the checksum does not cover.
const UNCHECKED: usize = 12;

impl Header {
    fn new(shapes: &ShapeSet, size: AtlasSize) -> Self {
        Self {
            magic: MAGIC,
            crc32: 0,
            version: VERSION,
            digest: shapes.digest,
            layout: size.layout as u32,
            tiles: size.tiles,
            tile_px: size.tile_px,
            shapes: shapes.shapes.len() as u32,
            albedo_scale: albedo_scale(shapes),
            reserved: 0,
        }
    }

    fn file_name(&self, size: AtlasSize) -> PathBuf {
        let (layout, prefix, suffix) = (size.layout.name(), cache::PREFIX, cache::SUFFIX);
        format!("{prefix}{layout}-{}x{}-{:016x}{suffix}", self.tiles, self.tile_px, self.digest).into()
    }

    /// Number of texels of a layer.
    fn texels(&self) -> usize {
        (self.tiles as usize * self.tile_px as usize).pow(2)
    }
}

/// Reason why a cache file cannot be used.
#[derive(Debug, thiserror::Error)]
enum CacheError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("{found} bytes long, not {expected}")]
    Length { found: usize, expected: usize },
    #[error("checksum mismatch")]
    Checksum,
    #[error("the header belongs to another atlas or to another program version")]
    Header,
}

/// Reads the finest levels from a cache file; `None` if the file does not exist.
fn read(path: &Path, wanted: &Header) -> Result<Option<Vec<Level>>, CacheError> {
    let (texels, shapes) = (wanted.texels(), wanted.shapes as usize);
    let expected = size_of::<Header>() + 6 * texels * shapes;
    let bytes = match files::read_bounded(path, expected as u64) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    if bytes.len() != expected {
        return Err(CacheError::Length { found: bytes.len(), expected });
    }
    let (head, data) = bytes.split_at(size_of::<Header>());
    let header: Header = bytemuck::pod_read_unaligned(head);
    if header.crc32 != crc32fast::hash(&bytes[UNCHECKED..]) {
        return Err(CacheError::Checksum);
    }
    if (Header { crc32: 0, ..header }) != *wanted {
        return Err(CacheError::Header);
    }
    let (normals, surfaces) = data.split_at(4 * texels * shapes);
    let layers = normals.chunks_exact(4 * texels).zip(surfaces.chunks_exact(2 * texels));
    Ok(Some(layers.map(|(n, s)| Level { normals: n.to_vec(), surfaces: s.to_vec() }).collect()))
}

/// Writes a cache file, unless it alone exceeds the bound of the cache, and removes the files that exceed it.
fn keep(path: &Path, header: Header, finest: &[Level], settings: &AsteroidSettings) -> io::Result<()> {
    let most_bytes = u64::from(settings.cache_mib) << 20;
    let bytes = (size_of::<Header>() + 6 * header.texels() * finest.len()) as u64;
    if bytes > most_bytes {
        tracing::info!(bytes, most_bytes, "the impostor atlas is larger than asteroids.cache_mib and is not kept");
        return Ok(());
    }
    write(path, header, finest)?;
    cache::trim(path, most_bytes)
}

fn write(path: &Path, header: Header, finest: &[Level]) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    finest.iter().for_each(|level| bytes.extend_from_slice(&level.normals));
    finest.iter().for_each(|level| bytes.extend_from_slice(&level.surfaces));
    let crc32 = crc32fast::hash(&bytes[UNCHECKED..]);
    bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&Header { crc32, ..header }));
    files::write_whole(path, &bytes)
}

//! Bakes impostor atlases: the mesh rasteriser draws the finest mesh of a shape onto every tile, and a filter pass
//! averages the samples of each texel.
//!
//! Shaders: `shaders/asteroids/impostors/bake*.wgsl`; the f64 twin is `crate::reference::asteroids::impostors`.
//!
//! An atlas is baked in square blocks of tiles, to keep the sample textures small.

use crate::render::{constants::workgroups::FILTER_SIDE, shader::Shader};
use crate::{
    gpu::{self, Gpu, GpuError, LayoutOf, ReadbackBuffer},
    plan::asteroids::{
        AsteroidSettings, ImpostorMethod,
        bounds::BORDER_PX,
        tiles::{AtlasLayout, AtlasTile},
    },
    render::asteroids::layout,
    scene::asteroids::{Mesh, Shape},
};

/// Samples along the side of a texel.
const SAMPLES: u32 = 4;
/// Maximum number of samples along the side of a block.
const BLOCK_SAMPLES: u32 = 2048;

/// Pipelines of the bake.
pub(crate) struct ImpostorBakePass {
    draw: wgpu::RenderPipeline,
    filter: wgpu::ComputePipeline,
}

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
}

/// Sample textures and texel buffer of a block.
struct Block {
    /// Tiles along a side.
    tiles: u32,
    normals: wgpu::TextureView,
    surfaces: wgpu::TextureView,
    depth: wgpu::TextureView,
    texels: wgpu::Buffer,
}

/// Mesh buffers on the adapter.
struct MeshBuffers {
    vertices: [wgpu::Buffer; 3],
    indices: wgpu::Buffer,
    index_count: u32,
}

impl ImpostorBakePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            draw: draw_pipeline(gpu),
            filter: gpu.compute_pipeline(&Shader::new("asteroids/impostors/bake_filter").source()),
        }
    }

    /// Bakes the atlas of a shape and waits for the device. Returns two words per texel (see
    /// `shaders/asteroids/impostors/bake_filter.wgsl`), row by row from the top.
    pub(crate) fn bake(
        &self,
        gpu: &Gpu,
        shape: &Shape,
        size: AtlasSize,
        albedo_scale: f32,
    ) -> Result<Vec<[u32; 2]>, GpuError> {
        let mesh = MeshBuffers::new(gpu, &shape.lods[0].mesh);
        let block = Block::new(gpu, size);
        let side = (size.tiles * size.tile_px) as usize;
        let mut atlas = vec![[0; 2]; side * side];
        for row in (0..size.tiles).step_by(block.tiles as usize) {
            for column in (0..size.tiles).step_by(block.tiles as usize) {
                let texels = self.bake_block(gpu, &block, &mesh, shape, size, albedo_scale, [column, row])?;
                // Skip the part of the block beyond the last tile of the atlas.
                let block_side = (block.tiles * size.tile_px) as usize;
                let [x, y] = [column, row].map(|tile| (tile * size.tile_px) as usize);
                let width = block_side.min(side - x);
                for j in 0..block_side.min(side - y) {
                    let to = (y + j) * side + x;
                    atlas[to..to + width].copy_from_slice(&texels[j * block_side..j * block_side + width]);
                }
            }
        }
        gpu.take_failure()?;
        Ok(atlas)
    }

    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    fn bake_block(
        &self,
        gpu: &Gpu,
        block: &Block,
        mesh: &MeshBuffers,
        shape: &Shape,
        size: AtlasSize,
        albedo_scale: f32,
        first: [u32; 2],
    ) -> Result<Vec<[u32; 2]>, GpuError> {
        // Rasterise the mesh onto every tile of the block.
        let tiles = tiles_of_block(size, block.tiles, first);
        let side = block.tiles * size.tile_px;
        let parameters = layout::ImpostorBakeParameters {
            side: (side * SAMPLES) as f32,
            scale: 0.5 * (size.tile_px - BORDER_PX) as f32 * SAMPLES as f32,
            bound: shape.bound as f32,
            albedo_scale,
        };
        let parameters = gpu::uniform_buffer(gpu, "impostor bake parameters", &parameters);
        let tile_buffer = gpu::storage_buffer(gpu, "impostor tiles", &tiles);
        let bindings = [(0, parameters.as_entire_binding()), (1, tile_buffer.as_entire_binding())];
        let group = gpu.bind_once(LayoutOf::Render(&self.draw, 0), &bindings);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = begin(&mut encoder, block);
            pass.set_pipeline(&self.draw);
            pass.set_bind_group(0, &group, &[]);
            for (slot, buffer) in (0..).zip(&mesh.vertices) {
                pass.set_vertex_buffer(slot, buffer.slice(..));
            }
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.index_count, 0, 0..tiles.len() as u32);
        }
        // Average the samples of each texel.
        let filter = layout::ImpostorFilterParameters { side, samples: SAMPLES, ..Default::default() };
        let filter = gpu::uniform_buffer(gpu, "impostor filter parameters", &filter);
        let resources = [
            (0, filter.as_entire_binding()),
            (1, wgpu::BindingResource::TextureView(&block.normals)),
            (2, wgpu::BindingResource::TextureView(&block.surfaces)),
            (3, block.texels.as_entire_binding()),
        ];
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.filter);
            pass.set_bind_group(0, &gpu.bind_once(LayoutOf::Compute(&self.filter, 0), &resources), &[]);
            pass.dispatch_workgroups(side.div_ceil(FILTER_SIDE), side.div_ceil(FILTER_SIDE), 1);
        }
        // Submit, wait and read the texels back.
        let mut readback = ReadbackBuffer::new("impostor texels");
        let count = (side * side) as usize;
        let bytes = (count * size_of::<[u32; 2]>()) as u64;
        readback.begin(bytes);
        let place = readback.copy(gpu, &mut encoder, &block.texels, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
        readback.map(gpu);
        gpu.wait(None)?;
        let texels = readback.read(gpu, place, count)?;
        readback.unmap(gpu);
        Ok(texels)
    }
}

/// Tiles of the block that begins at `[column, row]`, without those beyond the atlas.
fn tiles_of_block(size: AtlasSize, block_tiles: u32, [column, row]: [u32; 2]) -> Vec<layout::ImpostorBakeTile> {
    let mut tiles = Vec::new();
    for y in 0..block_tiles.min(size.tiles - row) {
        for x in 0..block_tiles.min(size.tiles - column) {
            let axes = size.layout.axes(AtlasTile { column: column + x, row: row + y }, size.tiles);
            let middle = [x, y].map(|along| (along as f32 + 0.5) * (size.tile_px * SAMPLES) as f32);
            tiles.push(layout::ImpostorBakeTile {
                right: axes.right.as_vec3().to_array(),
                up: axes.up.as_vec3().to_array(),
                direction: axes.direction.as_vec3().to_array(),
                middle,
                ..Default::default()
            });
        }
    }
    tiles
}

impl MeshBuffers {
    fn new(gpu: &Gpu, mesh: &Mesh) -> Self {
        let vertices = wgpu::BufferUsages::VERTEX;
        let indices: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        Self {
            vertices: [
                gpu::filled_buffer(gpu, "positions", &mesh.positions, vertices),
                gpu::filled_buffer(gpu, "normals", &mesh.normals, vertices),
                gpu::filled_buffer(gpu, "albedos", &mesh.albedos, vertices),
            ],
            index_count: indices.len() as u32,
            indices: gpu::filled_buffer(gpu, "triangles", &indices, wgpu::BufferUsages::INDEX),
        }
    }
}

impl Block {
    fn new(gpu: &Gpu, size: AtlasSize) -> Self {
        let limit = BLOCK_SAMPLES.min(gpu.device.limits().max_texture_dimension_2d);
        let tiles = (limit / (size.tile_px * SAMPLES)).clamp(1, size.tiles);
        let texels = tiles * size.tile_px;
        let view = |format, usage| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("impostor samples"),
                size: wgpu::Extent3d { width: texels * SAMPLES, height: texels * SAMPLES, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        Self {
            tiles,
            normals: view(wgpu::TextureFormat::Rgba16Float, read),
            surfaces: view(wgpu::TextureFormat::Rg16Float, read),
            depth: view(wgpu::TextureFormat::Depth32Float, wgpu::TextureUsages::empty()),
            texels: gpu.create_buffer(&wgpu::BufferDescriptor {
                label: Some("impostor texels"),
                size: (u64::from(texels).pow(2) * size_of::<[u32; 2]>() as u64).next_multiple_of(16),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        }
    }
}

fn begin<'a>(encoder: &'a mut wgpu::CommandEncoder, block: &'a Block) -> wgpu::RenderPass<'a> {
    let colour = |view| {
        Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
        })
    };
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("impostor bake"),
        color_attachments: &[colour(&block.normals), colour(&block.surfaces)],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &block.depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        }),
        ..Default::default()
    })
}

fn draw_pipeline(gpu: &Gpu) -> wgpu::RenderPipeline {
    let [vertex, fragment] =
        ["asteroids/impostors/bake", "asteroids/impostors/bake_sample"].map(|file| Shader::new(file).source());
    let module = |source: &gpu::ShaderSource| {
        gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(source.name),
            source: wgpu::ShaderSource::Wgsl(source.text.as_str().into()),
        })
    };
    let formats = [wgpu::VertexFormat::Float32x3, wgpu::VertexFormat::Float32x3, wgpu::VertexFormat::Float32];
    let attributes: Vec<[wgpu::VertexAttribute; 1]> = (0..)
        .zip(formats)
        .map(|(shader_location, format)| [wgpu::VertexAttribute { format, offset: 0, shader_location }])
        .collect();
    let buffers: Vec<_> = attributes
        .iter()
        .map(|attributes| {
            Some(wgpu::VertexBufferLayout {
                array_stride: attributes[0].format.size(),
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes,
            })
        })
        .collect();
    let target = |format| Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL });
    gpu.render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(vertex.name),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module(&vertex),
            entry_point: Some(vertex.entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module(&fragment),
            entry_point: Some(fragment.entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[target(wgpu::TextureFormat::Rgba16Float), target(wgpu::TextureFormat::Rg16Float)],
        }),
        multiview_mask: None,
        cache: None,
    })
}

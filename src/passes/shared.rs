//! What the passes share: binding whole buffers, and the grid over the pixels of a batch.

use crate::{
    gpu::{Gpu, Shader, ShaderSource, constants::display, layout},
    plan::{
        settings::{ToneMapOperator, ToneMapSettings},
        tiles::Tile,
    },
};

pub(crate) use crate::gpu::constants::pixel_grid::{COLUMNS, ROWS};

/// Items of stars are bound from multiples of this many, so that their offset is aligned.
pub(crate) const ITEM_ALIGNMENT: usize = 8;

/// Buffers that one batch of tiles draws into.
pub(crate) struct StarTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    /// First words of the sums, or what a published method sums.
    pub pixels: &'a wgpu::Buffer,
}

/// What bodies and asteroids leave for what is drawn behind and beside them: see `shaders/shared/occlusion.wgsl`.
#[derive(Clone, Copy)]
pub(crate) struct Occlusion<'a> {
    /// Whether there is anything; the buffers are stand-ins otherwise.
    pub present: bool,
    /// What the geometry pass has left in the pixels of the batch.
    pub geometry: &'a wgpu::Buffer,
    pub view_bodies: &'a wgpu::Buffer,
    pub body_runs: &'a wgpu::Buffer,
}

/// Binds it as every pass that splats does.
pub(crate) fn bind_occlusion(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    occlusion: &Occlusion<'_>,
) -> wgpu::BindGroup {
    let buffers = [occlusion.geometry, occlusion.view_bodies, occlusion.body_runs];
    let bindings: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
    bind_buffers(gpu, pipeline, 2, &bindings)
}

/// Layers of samples that asteroids were drawn into, for one tile.
pub(crate) struct RasterLayers<'a> {
    /// Luminance in units of `luminance_scale`, `samples` times as wide and high as the tile.
    pub colour: &'a wgpu::TextureView,
    /// Reversed depth of the same size: `near_m` over the distance; 0: nothing.
    pub depth: &'a wgpu::TextureView,
    /// The same of six cube faces, as arrays.
    pub faces_colour: &'a wgpu::TextureView,
    /// See `faces_colour`.
    pub faces_depth: &'a wgpu::TextureView,
    /// Bit set of the faces that were drawn; 0: the views of faces are stand-ins.
    pub faces: u32,
    /// Side of a face, samples.
    pub face_size_px: u32,
    /// Samples along a side of a pixel.
    pub samples: u32,
    /// Distance at depth 1, m.
    pub near_m: f32,
    /// cd/m^2 per unit of luminance.
    pub luminance_scale: f32,
}

/// Buffers of a batch whose picture is written, or written over, as luminance and summed for the exposure.
pub(crate) struct PictureTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub pixels: &'a wgpu::Buffer,
    pub partial_sums: &'a wgpu::Buffer,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

/// Flags of a tile: one for each block of pixels of the grid, in rows.
pub(crate) fn flags_of(width: u32, rows: u32) -> u32 {
    width.div_ceil(COLUMNS) * rows.div_ceil(ROWS)
}

/// A buffer of stars in the order of the catalogue.
pub(crate) struct CatalogueDraw<'a> {
    pub stars: &'a wgpu::Buffer,
    pub count: u32,
}

/// A run of items that read from one buffer of stars.
pub(crate) struct StarDraw<'a> {
    pub stars: &'a wgpu::Buffer,
    pub items: &'a wgpu::Buffer,
    /// First item; a multiple of [`ITEM_ALIGNMENT`].
    pub first_item: u64,
    pub item_count: u32,
}

/// Stars and their items, as every pass over items binds them.
pub(crate) fn bind_items(gpu: &Gpu, pipeline: &wgpu::ComputePipeline, draw: &StarDraw<'_>) -> wgpu::BindGroup {
    let items = wgpu::BufferBinding {
        buffer: draw.items,
        offset: draw.first_item * size_of::<layout::StarItem>() as u64,
        size: wgpu::BufferSize::new(u64::from(draw.item_count) * size_of::<layout::StarItem>() as u64),
    };
    bind_buffers(gpu, pipeline, 1, &[(0, draw.stars.as_entire_binding()), (1, wgpu::BindingResource::Buffer(items))])
}

/// The complete module of a shader that splats in fixed point, with the words that the adapter can add to.
pub(crate) fn splatting(gpu: &Gpu, file: &str) -> ShaderSource {
    let accumulate = if gpu.wide_accumulator { "shared/accumulate_u64" } else { "shared/accumulate_u32" };
    Shader::new(file).with("accumulate", accumulate).source()
}

/// Parameters and sums, as every pass that splats in fixed point binds them; `others` follow.
pub(crate) fn bind_sums(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    parameters: &wgpu::Buffer,
    target: &StarTarget<'_>,
    high_words: &wgpu::Buffer,
    others: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let sums = [
        (0, parameters.as_entire_binding()),
        (1, target.viewports.as_entire_binding()),
        (2, target.tiles.as_entire_binding()),
        (3, target.counters.as_entire_binding()),
        (4, target.pixels.as_entire_binding()),
        (6, high_words.as_entire_binding()),
    ];
    bind_buffers(gpu, pipeline, 0, &[&sums[..], others].concat())
}

/// Parameters and picture, as every pass over pictures of luminance binds them.
pub(crate) fn bind_picture(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    parameters: &wgpu::Buffer,
    target: &PictureTarget<'_>,
) -> wgpu::BindGroup {
    let buffers = [parameters, target.viewports, target.tiles, target.pixels, target.partial_sums];
    let bindings: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
    bind_buffers(gpu, pipeline, 0, &bindings)
}

/// A bind group of buffers, in the order of their bindings.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    bind_to(gpu, &pipeline.get_bind_group_layout(group), buffers)
}

/// A bind group of a layout, in the order of its bindings.
pub(crate) fn bind_to(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("pass"), layout, entries: &entries })
}

/// Columns and rows of a dispatch of at least `workgroups`, each within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.device.limits().max_compute_workgroups_per_dimension);
    [columns, workgroups.div_ceil(columns)]
}

/// Workgroups over all pixels of a batch's tiles: columns, rows, tiles. `widths` are those of the tiles.
pub(crate) fn pixel_grid(tiles: &[Tile], widths: &[u32]) -> [u32; 3] {
    let columns = widths.iter().max().copied().unwrap_or(0).div_ceil(COLUMNS);
    let rows = tiles.iter().map(|tile| tile.rows).max().unwrap_or(0).div_ceil(ROWS);
    [columns, rows, tiles.len() as u32]
}

/// Bytes of a partial sum: illuminance that counts, and solid angle that does not.
pub(crate) const PARTIAL_SUM_BYTES: u64 = 8;

/// Partial sums that a tile's workgroups write: one per column of pixels and row of workgroups.
pub(crate) fn partial_sums(width: u32, rows: u32) -> u32 {
    width * rows.div_ceil(ROWS)
}

/// Lists of asteroids for one plane, as the passes that draw them bind them: `group` is group 0 of `shaders/asteroids/listed.wgsl`, whose
/// dynamic offset is the kind times `kind_stride`; `arguments` are five words per list.
pub(crate) struct AsteroidDraw<'a> {
    /// Bindings of the plane.
    pub group: &'a wgpu::BindGroup,
    /// Bytes between the kinds' uniforms.
    pub kind_stride: u32,
    /// Arguments of all lists.
    pub arguments: &'a wgpu::Buffer,
    /// First list of the plane.
    pub first_list: u64,
}

impl AsteroidDraw<'_> {
    /// Offset of a kind's arguments, bytes.
    pub(crate) fn arguments_at(&self, kind: u32) -> u64 {
        (self.first_list + u64::from(kind)) * ASTEROID_ARGUMENT_BYTES
    }
}

/// Bytes of the arguments of one draw.
pub(crate) const ASTEROID_ARGUMENT_BYTES: u64 = 20;

/// Format of what asteroids are drawn onto.
pub(crate) const ASTEROID_COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Format of their depth: greater is nearer.
pub(crate) const ASTEROID_DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Group 0 of every pass that draws asteroids.
pub(crate) fn asteroid_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let uniform = |dynamic: bool| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: dynamic,
        min_binding_size: None,
    };
    let storage = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..8)
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: if binding == 0 { wgpu::ShaderStages::VERTEX_FRAGMENT } else { wgpu::ShaderStages::VERTEX },
            ty: match binding {
                0 => uniform(false),
                1 => uniform(true),
                _ => storage,
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("asteroids"), entries: &entries })
}

/// A pipeline that draws asteroids: `groups` are its bind groups, the first that of [`asteroid_layout`].
pub(crate) fn asteroid_pipeline(
    gpu: &Gpu,
    [vertex, fragment]: [&ShaderSource; 2],
    constants: &[(&str, f64)],
    groups: &[Option<&wgpu::BindGroupLayout>],
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    primitive: wgpu::PrimitiveState,
) -> wgpu::RenderPipeline {
    let module = |source: &ShaderSource| {
        gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(source.name),
            source: wgpu::ShaderSource::Wgsl(source.text.as_str().into()),
        })
    };
    let options = wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false };
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(vertex.name),
        bind_group_layouts: groups,
        ..Default::default()
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment.name),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module(vertex),
            entry_point: Some(vertex.entry_point),
            compilation_options: options.clone(),
            buffers,
        },
        primitive,
        depth_stencil: Some(wgpu::DepthStencilState {
            format: ASTEROID_DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module(fragment),
            entry_point: Some(fragment.entry_point),
            compilation_options: options.clone(),
            targets: &[Some(ASTEROID_COLOUR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// What of the tone mapping is compiled into a pipeline, so that what is not asked for costs nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct DisplayVariant {
    operator: ToneMapOperator,
    desaturates: bool,
    scotopic: bool,
}

impl DisplayVariant {
    pub(crate) fn of(settings: &ToneMapSettings) -> Self {
        Self {
            operator: settings.operator,
            desaturates: settings.desaturation > 0.0,
            scotopic: settings.scotopic > 0.0,
        }
    }

    /// The constants of `shaders/display/encode.wgsl`.
    pub(crate) fn constants(self) -> [(&'static str, f64); 3] {
        let operator = match self.operator {
            ToneMapOperator::Filmic => display::OPERATOR_FILMIC,
            ToneMapOperator::Srgb => display::OPERATOR_SRGB,
            ToneMapOperator::Reinhard => display::OPERATOR_REINHARD,
            ToneMapOperator::Aces => display::OPERATOR_ACES,
            ToneMapOperator::Calibrated => display::OPERATOR_CALIBRATED,
        };
        let flag = |on: bool| f64::from(u8::from(on));
        [
            ("TONE_OPERATOR", f64::from(operator)),
            ("DESATURATES", flag(self.desaturates)),
            ("SCOTOPIC", flag(self.scotopic)),
        ]
    }
}

/// The numbers of the tone mapping as shaders read them.
pub(crate) fn encode_display(settings: &ToneMapSettings) -> layout::Display {
    layout::Display {
        white: settings.white as f32,
        peak_cd_m2: settings.peak_cd_m2 as f32,
        black_cd_m2: settings.black_cd_m2 as f32,
        desaturation: settings.desaturation as f32,
        scotopic: settings.scotopic as f32,
        dither: u32::from(settings.dither),
        ..Default::default()
    }
}

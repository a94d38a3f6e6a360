//! Colour and depth layers of meshes and impostors: textures reused from tile to tile, and the draws into them.
//!
//! No shader: holds textures and orders the draws of mesh and impostors.
//! No twin: reference/asteroids/mesh.rs.

use super::{
    Asteroids,
    encode::encoded_viewport,
    impostors::splat::{SplatLayers, SplatList, SplatLists},
    kind_stride,
    raster::{ASTEROID_COLOUR, ASTEROID_DEPTH, AsteroidDraw},
};
use crate::{
    gpu::{Gpu, GpuTimer, LayoutOf},
    plan::{
        asteroids::{AsteroidPlan, frame::NEAR_M},
        tiles::Tile,
    },
    render::{asteroids::layout, targets::RasterLayers},
    view::projection::Face,
};

/// Colour and depth textures of one size, with their views.
struct Layers {
    size: wgpu::Extent3d,
    colour: wgpu::TextureView,
    depth: wgpu::TextureView,
    /// One pair of views per layer, for drawing.
    single: Vec<[wgpu::TextureView; 2]>,
}

/// Textures of windows and cube faces.
pub(super) struct LayerTargets {
    window: Option<Layers>,
    faces: Option<Layers>,
    no_faces: Option<Layers>,
    /// Viewport whose faces are currently drawn.
    faces_of: Option<usize>,
}

impl Layers {
    fn new(gpu: &Gpu, size: wgpu::Extent3d, array: bool) -> Self {
        let texture = |label: &str, format: wgpu::TextureFormat, usage: wgpu::TextureUsages| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC
                    | usage,
                view_formats: &[],
            })
        };
        // Splats write colours from a compute pass.
        let colour = texture("asteroid colour", ASTEROID_COLOUR, wgpu::TextureUsages::STORAGE_BINDING);
        let depth = texture("asteroid depth", ASTEROID_DEPTH, wgpu::TextureUsages::empty());
        let whole = |texture: &wgpu::Texture| {
            let dimension = if array { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 };
            texture.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() })
        };
        let layer = |texture: &wgpu::Texture, layer: u32| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            })
        };
        let single = (0..size.depth_or_array_layers).map(|i| [layer(&colour, i), layer(&depth, i)]).collect();
        Self { size, colour: whole(&colour), depth: whole(&depth), single }
    }

    /// Ensures that `held` has at least the given size.
    fn at_least(held: &mut Option<Self>, gpu: &Gpu, [width, height, layers]: [u32; 3], array: bool) {
        let mut size = wgpu::Extent3d { width, height, depth_or_array_layers: layers };
        if let Some(old) = held {
            if old.size.width >= width && old.size.height >= height && old.size.depth_or_array_layers >= layers {
                return;
            }
            if !array {
                size.width = width.max(old.size.width);
                size.height = height.max(old.size.height);
            }
            // Drop the old textures before the new ones are made, so that both never exist at once.
            *held = None;
        }
        *held = Some(Self::new(gpu, size, array));
    }
}

impl LayerTargets {
    pub(super) fn new() -> Self {
        Self { window: None, faces: None, no_faces: None, faces_of: None }
    }

    /// Begins a frame: invalidates the contents of the faces.
    pub(super) fn begin(&mut self) {
        self.faces_of = None;
    }
}

impl Asteroids {
    /// Records meshes and impostors of one tile: onto its window, and onto the faces behind its picture unless they are drawn already. Returns `None`
    /// if there are no fields.
    pub(crate) fn record_layers(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        plan: &AsteroidPlan,
        tile: &Tile,
    ) -> Option<RasterLayers> {
        self.held.as_ref()?;
        let viewport = tile.viewport;
        let samples = plan.samples[viewport];
        let width = plan.viewports[viewport].size()[0] * samples;
        let height = tile.rows * samples;
        let faces = plan.cut.faces[viewport];
        let side = plan.face_px[viewport];
        Layers::at_least(&mut self.targets.window, gpu, [width, height, 1], false);
        Layers::at_least(&mut self.targets.no_faces, gpu, [1, 1, 1], true);
        if faces != 0 {
            Layers::at_least(&mut self.targets.faces, gpu, [side, side, 8 - faces.leading_zeros()], true);
            if self.targets.faces_of != Some(viewport) {
                for face in Face::ALL.into_iter().filter(|face| faces >> *face as u8 & 1 == 1) {
                    let target = self.targets.faces.as_ref().map(|layers| layers.single[face as usize].clone());
                    if let (Some(plane), Some(target)) = (plan.plane_of(viewport, Some(face)), target) {
                        let window = layout::AsteroidTarget { rows: side, samples: 1, ..Default::default() };
                        self.draw(gpu, encoder, timer, plan, plane, window, [side, side], &target);
                    }
                }
                self.targets.faces_of = Some(viewport);
            }
        }
        let target = self.targets.window.as_ref()?.single[0].clone();
        let window =
            layout::AsteroidTarget { first_row: tile.first_row, rows: tile.rows, samples, ..Default::default() };
        self.draw(gpu, encoder, timer, plan, viewport, window, [width, height], &target);
        let (window, no_faces) = (self.targets.window.as_ref()?, self.targets.no_faces.as_ref()?);
        let behind = self.targets.faces.as_ref().filter(|_| faces != 0).unwrap_or(no_faces);
        Some(RasterLayers {
            colour: window.colour.clone(),
            depth: window.depth.clone(),
            faces_colour: behind.colour.clone(),
            faces_depth: behind.depth.clone(),
            faces: u32::from(faces),
            face_size_px: side,
            samples,
            near_m: NEAR_M as f32,
            luminance_scale: plan.luminance_scale as f32,
        })
    }

    /// Clears the target and draws the lists of a plane.
    #[expect(clippy::too_many_arguments, reason = "a draw takes its plane, its window and its target")]
    fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        plan: &AsteroidPlan,
        plane: usize,
        window: layout::AsteroidTarget,
        [width, height]: [u32; 2],
        [colour, depth]: &[wgpu::TextureView; 2],
    ) {
        // Uniform of the target.
        let source = &plan.planes[plane];
        let target = layout::AsteroidTarget {
            viewport: encoded_viewport(plan, source),
            eye: plan.viewports[source.viewport].eye_offset_m.as_vec3().to_array(),
            near: NEAR_M as f32,
            plane: plane as u32,
            units_per_cd_m2: plan.luminance_scale.recip() as f32,
            kinds: plan.kinds,
            ..window
        };
        let target = gpu.frame_uniform("asteroid target", &target);
        // Draw meshes, and impostors that are squares.
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("asteroids"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: colour,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: timer.render_pass("asteroids"),
            ..Default::default()
        });
        let Self { held: Some(held), passes, impostors, buffers, .. } = self else { return };
        let Some(kinds) = buffers.kinds.as_ref().map(|(kinds, _)| kinds.clone()) else { return };
        let one_kind = wgpu::BufferBinding {
            buffer: &kinds,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<layout::AsteroidBucket>() as u64),
        };
        let group = gpu.bind(
            LayoutOf::Own(passes.layout(gpu)),
            &[
                (0, target.as_entire_binding()),
                (1, wgpu::BindingResource::Buffer(one_kind)),
                (2, buffers.items.with_room(gpu, 0).as_entire_binding()),
                (3, buffers.fields.with_room(gpu, 0).as_entire_binding()),
                (4, held.instances.as_entire_binding()),
                (5, buffers.entries.with_room(gpu, 0).as_entire_binding()),
                (6, buffers.bases.with_room(gpu, 0).as_entire_binding()),
                (7, held.tables.as_entire_binding()),
            ],
        );
        let arguments = buffers.arguments.with_room(gpu, 0).clone();
        let draw = AsteroidDraw {
            group: &group,
            kind_stride: kind_stride(gpu),
            arguments: &arguments,
            first_list: plane as u64 * u64::from(plan.kinds),
        };
        pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
        pass.set_scissor_rect(0, 0, width, height);
        // Without impostors only the mesh lists exist.
        if let Some(impostors) = impostors {
            for (set, atlas) in held.atlas_groups().iter().enumerate() {
                impostors.record(&mut pass, &draw, held.kinds.impostor_kind(set) as u32, atlas);
            }
        }
        passes.mesh(gpu).record(&mut pass, &draw, &held.vertices, &held.indices, held.kinds.meshes as u32);
        drop(pass);
        // Draw the impostors that are splatted.
        let Some(splats) = &plan.splats else { return };
        let lists = SplatLists {
            target: &target,
            items: buffers.items.with_room(gpu, 0),
            fields: buffers.fields.with_room(gpu, 0),
            instances: &held.instances,
            entries: buffers.entries.with_room(gpu, 0),
            tables: &held.tables,
            arguments: &arguments,
            still_seen: buffers.still_seen.with_room(gpu, 0),
        };
        let layers = SplatLayers { colour, depth, size: [width, height] };
        for (set, atlas) in held.atlases().iter().enumerate() {
            let list = draw.first_list + held.kinds.impostor_kind(set) as u64;
            let splatted = SplatList { list, atlas, lists: &lists };
            passes.splats(gpu).record(gpu, encoder, timer, splats, &splatted, layers, &mut buffers.samples);
        }
    }
}

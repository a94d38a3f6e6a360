//! Records the blending star methods. Every plane is drawn once per frame, as a whole, into a texture that the resolve pass of its tiles reads. A
//! flat picture is a plane; other projections use the six faces of a cube (`plan::cube_faces`).

mod draw;

use std::sync::{Arc, OnceLock};

use glam::DQuat;

use self::draw::{BillboardFrame, BillboardPass, BillboardPipelines, BillboardPlane, CountPass};
use super::catalogue_buffers::CatalogueBuffers;
use super::luminance::{LuminanceInputs, LuminancePass, LuminanceSource};
use crate::plan::tiles::MAX_TILES;
use crate::{
    gpu::{Gpu, GpuTimer},
    photometry::star_image::{SPRITE_SIZE, sprite},
    plan::{
        KernelPlan,
        settings::StarMethod,
        stars::{
            billboards::{BillboardPlan, DrawnPsf},
            cube_faces::{CubeFaces, GUARD_PX},
        },
        tiles::Tile,
    },
    render::{
        stars::layout,
        targets::{PictureTarget, tile_grid},
        technique::{PipelineJob, Recording, Wish, begin_pass},
        viewport::encode_viewport,
    },
    view::{
        Viewport,
        projection::{Face, Perspective, Projection},
    },
};

/// Texture that stars are blended into.
struct BlendTarget {
    size: wgpu::Extent3d,
    /// View of all layers.
    whole: wgpu::TextureView,
    /// View of each layer.
    layers: Vec<wgpu::TextureView>,
}

/// Lazily created passes and textures of the blending methods.
pub(super) struct Billboards {
    pipelines: BillboardPipelines,
    /// Passes of the methods used so far, with their images.
    methods: Vec<MethodPass>,
    /// Index of the current method.
    in_use: Option<usize>,
    from_texture: OnceLock<LuminancePass>,
    from_cube: OnceLock<LuminancePass>,
    count: OnceLock<CountPass>,
    target: Option<BlendTarget>,
    /// Viewport whose stars are in `target`, in the frame that is being recorded.
    drawn: Option<usize>,
}

struct MethodPass {
    method: StarMethod,
    pass: BillboardPass,
    /// Point-spread function whose texture the pass contains.
    psf: Option<Arc<DrawnPsf>>,
}

impl Billboards {
    pub(super) fn new() -> Self {
        Self {
            pipelines: BillboardPipelines::new(),
            methods: Vec::new(),
            in_use: None,
            from_texture: OnceLock::new(),
            from_cube: OnceLock::new(),
            count: OnceLock::new(),
            target: None,
            drawn: None,
        }
    }

    /// Returns jobs that create the pipelines of a method for the viewports of `wish`.
    pub(super) fn pipelines<'a>(&'a self, wish: &Wish<'a>, method: StarMethod) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        let needs_cube =
            |viewport: &Viewport| CubeFaces::for_projection(&viewport.projection, gpu.max_view_side_px()).is_some();
        let mut jobs = vec![
            PipelineJob::new("stars", move || self.pipelines.get(gpu, method)),
            PipelineJob::new("star counts", move || {
                self.count_pass(gpu);
            }),
        ];
        if wish.viewports.iter().any(needs_cube) {
            jobs.push(PipelineJob::new("stars from a cube", move || {
                self.cube_resolve(gpu);
            }));
        }
        if !wish.viewports.iter().all(needs_cube) {
            jobs.push(PipelineJob::new("stars from a plane", move || {
                self.texture_resolve(gpu);
            }));
        }
        jobs
    }

    fn cube_resolve(&self, gpu: &Gpu) -> &LuminancePass {
        self.from_cube.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Cube))
    }

    fn texture_resolve(&self, gpu: &Gpu) -> &LuminancePass {
        self.from_texture.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Texture))
    }

    fn count_pass(&self, gpu: &Gpu) -> &CountPass {
        self.count.get_or_init(|| CountPass::new(gpu))
    }

    /// Releases everything that depends on the scene or on the size of images.
    pub(super) fn release(&mut self) {
        self.methods.clear();
        self.in_use = None;
        self.target = None;
        self.drawn = None;
    }

    /// Prepares the method of a frame.
    pub(super) fn begin(&mut self, gpu: &Gpu, method: StarMethod, psf: Option<&Arc<DrawnPsf>>) {
        self.drawn = None;
        let same = |held: &Option<Arc<DrawnPsf>>| match (held, psf) {
            (Some(held), Some(psf)) => Arc::ptr_eq(held, psf),
            (None, None) => true,
            _ => false,
        };
        // A pass contains the texture of its point-spread function, so it is kept only if the function is unchanged.
        self.methods.retain(|held| held.method != method || same(&held.psf));
        self.in_use = self.methods.iter().position(|held| held.method == method);
        if self.in_use.is_none() {
            let sprite = (method == StarMethod::Sprite).then(|| sprite(SPRITE_SIZE));
            let sprite_image = sprite.as_ref().map(|image| (image.size, image.rgb.as_slice()));
            let psf_image = psf.map(|psf| (psf.form.size, psf.form.rgb.as_slice()));
            if let Some(pass) = BillboardPass::new(gpu, &self.pipelines, method, psf_image.or(sprite_image)) {
                self.methods.push(MethodPass { method, pass, psf: psf.cloned() });
                self.in_use = Some(self.methods.len() - 1);
            }
        }
    }

    /// Records the tiles of a batch. The stars of a viewport are drawn with its first tile.
    pub(super) fn record_batch(
        &mut self,
        recording: &mut Recording<'_>,
        number: usize,
        catalogue: Option<&CatalogueBuffers>,
        colours: &wgpu::Buffer,
    ) {
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let (Some(billboards), Some(catalogue)) = (&plan.stars.billboards, catalogue) else { return };
        let frame = BillboardFrame {
            plan: billboards,
            psf: plan.stars.psf.as_deref(),
            camera_pc: plan.views.camera_pc.as_vec3().to_array(),
            colours,
            draws: &catalogue.draws(),
        };
        for (index, tile) in plan.views.batches[number].tiles.iter().enumerate() {
            let encoded = &recording.targets.batches[number].encoded_tiles[index];
            let encoded = gpu.frame_uniform_list("tile", std::slice::from_ref(encoded), MAX_TILES);
            let viewport = &plan.views.viewports[tile.viewport];
            let cube = CubeFaces::for_projection(&viewport.projection, gpu.max_view_side_px());
            if self.drawn != Some(tile.viewport) {
                self.draw_planes(gpu, recording.encoder, recording.timer, &frame, viewport, cube);
                self.drawn = Some(tile.viewport);
            }
            let target = PictureTarget { tiles: &encoded, ..recording.targets.picture(number) };
            let mut pass = begin_pass(recording.encoder, recording.timer, "resolve");
            self.resolve(gpu, &mut pass, cube, viewport, tile, &target);
        }
    }

    /// Records the resolve pass of a tile.
    fn resolve(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        cube: Option<CubeFaces>,
        viewport: &Viewport,
        tile: &Tile,
        target: &PictureTarget<'_>,
    ) {
        let Some(drawn) = &self.target else { return };
        let (resolve, numbers) = match cube {
            Some(cube) => (self.cube_resolve(gpu), [cube.edge_px, GUARD_PX]),
            None => (self.texture_resolve(gpu), [0, 0]),
        };
        let source_bindings = [(0, wgpu::BindingResource::TextureView(&drawn.whole))];
        let inputs = LuminanceInputs { scale: 1.0, numbers, source_bindings: &source_bindings };
        resolve.record(gpu, pass, &inputs, target, tile_grid(tile, viewport));
    }

    /// Records the planes of a viewport: the picture itself, or the faces of its cube.
    fn draw_planes(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &BillboardFrame<'_>,
        viewport: &Viewport,
        cube: Option<CubeFaces>,
    ) {
        // Planes to draw; `None` for faces that the picture does not show.
        let planes: Vec<Option<BillboardPlane>> = match cube {
            Some(cube) => {
                let face_plane = |face: Face| {
                    let turned = Viewport {
                        projection: Projection::Perspective(cube.plane()),
                        world_from_view: viewport.world_from_view * face.cube_from_face(),
                        ..viewport.clone()
                    };
                    plane_of(&turned, &cube.plane(), face.cube_from_face())
                };
                let faces = Face::ALL.into_iter().zip(cube.needed).take(cube.layers());
                faces.map(|(face, needed)| needed.then(|| face_plane(face))).collect()
            }
            None => match &viewport.projection {
                Projection::Perspective(plane) => vec![Some(plane_of(viewport, plane, DQuat::IDENTITY))],
                // Billboards keep their orientation across the edges of a cubemap's faces.
                Projection::CubeFace(face) => {
                    vec![Some(plane_of(viewport, face.plane(), face.face.cube_from_face()))]
                }
                Projection::Fisheye(_) | Projection::Equirectangular(_) | Projection::Tabulated(_) => Vec::new(),
            },
        };
        // One render pass per plane.
        let size = cube.map_or(viewport.size(), |cube| [cube.side_px(); 2]);
        self.make_target(gpu, size, planes.len() as u32);
        let Some(held) = self.in_use.and_then(|index| self.methods.get(index)) else { return };
        let Some(target) = &self.target else { return };
        for (view, plane) in target.layers.iter().zip(&planes) {
            let Some(plane) = plane else { continue };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("stars"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: None,
                timestamp_writes: timer.render_pass("stars"),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            held.pass.record(gpu, &mut pass, frame, plane);
        }
    }

    /// Creates the blend target, unless the current one has the right size.
    fn make_target(&mut self, gpu: &Gpu, [width, height]: [u32; 2], layers: u32) {
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: layers };
        if self.target.as_ref().is_some_and(|held| held.size == size) {
            return;
        }
        // Drop the old texture before the new one is made, so that both never exist at once.
        self.target = None;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("blended stars"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: gpu.blend_format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = |dimension, base_array_layer, array_layer_count| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(dimension),
                base_array_layer,
                array_layer_count,
                ..Default::default()
            })
        };
        self.target = Some(BlendTarget {
            size,
            whole: view(wgpu::TextureViewDimension::D2Array, 0, None),
            layers: (0..layers).map(|layer| view(wgpu::TextureViewDimension::D2, layer, Some(1))).collect(),
        });
    }

    /// Records the count of drawn stars, after all timed passes.
    pub(super) fn record_count(
        &self,
        recording: &mut Recording<'_>,
        plan: &BillboardPlan,
        catalogue: &CatalogueBuffers,
    ) {
        let (gpu, targets) = (recording.gpu, &*recording.targets);
        let count = self.count_pass(gpu);
        let camera_pc = recording.frame.plan.views.camera_pc.as_vec3().to_array();
        let viewports = (&targets.viewports, recording.frame.plan.views.viewports.len() as u32);
        let descriptor = wgpu::ComputePassDescriptor { label: Some("count stars"), timestamp_writes: None };
        let mut pass = recording.encoder.begin_compute_pass(&descriptor);
        let draws = catalogue.draws();
        count.record(gpu, &mut pass, (camera_pc, plan.faintest_lx), viewports, &targets.counters, &draws);
    }
}

fn plane_of(viewport: &Viewport, plane: &Perspective, view_from_plane: DQuat) -> BillboardPlane {
    let [left, right, ..] = plane.edge_tangents(0.0);
    BillboardPlane {
        viewport: layout::Viewport { kind: 0, ..encode_viewport(viewport, &KernelPlan::bspline()) },
        view_from_plane,
        pixel_rad: (right - left) / f64::from(viewport.size()[0]),
    }
}

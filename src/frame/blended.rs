//! Recording the star methods that blend: every plane is drawn whole into a texture, once per frame, and the resolve pass of
//! its tiles reads it there. Flat pictures are planes themselves; other projections go through the six faces of a cube
//! (`plan::cube_faces`).

use std::{f64::consts::PI, sync::OnceLock};

use glam::DQuat;

use super::{catalogue_buffers::CatalogueBuffers, record::begin_pass};
use crate::{
    gpu::{Gpu, GpuTimer, encode_viewport, layout},
    passes::{
        billboards::{BillboardPass, BillboardPlane, CountPass, SquareImage},
        luminance::{LuminancePass, LuminanceSource},
        shared::{CatalogueDraw, PictureTarget, pixel_grid},
    },
    photometry::{
        psf::PsfError,
        star_image::{SPRITE_SIZE, sprite},
    },
    plan::{
        KernelPlan,
        billboard::{BillboardPlan, DrawnPsf},
        cube_faces::{CubeFaces, GUARD_PX},
        settings::{PsfTextureSettings, RenderSettings, StarMethod},
        tiles::Tile,
    },
    view::{
        Viewport,
        projection::{Face, Perspective, Projection},
    },
};

/// Passes and textures of the methods that blend, made when they are first asked for.
pub(super) struct Blended {
    /// The passes of the methods used so far, with their images.
    methods: Vec<MethodPass>,
    /// The one in use.
    in_use: Option<usize>,
    /// The point-spread function last asked for, with what it was made from: it takes its time.
    psf: Option<(PsfTextureSettings, DrawnPsf)>,
    from_texture: OnceLock<LuminancePass>,
    from_cube: OnceLock<LuminancePass>,
    count: OnceLock<CountPass>,
    target: Option<wgpu::Texture>,
    /// The viewport that `target` holds in the frame being recorded.
    drawn: Option<usize>,
}

struct MethodPass {
    method: StarMethod,
    pass: BillboardPass,
}

/// What is drawn in a frame.
pub(super) struct BlendedFrame<'a> {
    pub plan: BillboardPlan,
    pub camera_pc: [f32; 3],
    pub colours: &'a wgpu::Buffer,
    /// All stars: buffer and number.
    pub segments: Vec<(wgpu::Buffer, u32)>,
}

impl BlendedFrame<'_> {
    fn draws(&self) -> Vec<CatalogueDraw<'_>> {
        self.segments.iter().map(|(stars, count)| CatalogueDraw { stars, count: *count }).collect()
    }
}

impl Blended {
    pub(super) fn new() -> Self {
        Self {
            methods: Vec::new(),
            in_use: None,
            psf: None,
            from_texture: OnceLock::new(),
            from_cube: OnceLock::new(),
            count: OnceLock::new(),
            target: None,
            drawn: None,
        }
    }

    /// Forgets everything that belongs to a scene or a size.
    pub(super) fn forget_buffers(&mut self) {
        self.methods.clear();
        self.in_use = None;
        self.target = None;
        self.drawn = None;
    }

    /// Holds the point-spread function of `psf_texture`, until its settings change: a file that changes alone is not read
    /// again.
    pub(super) fn hold_psf(&mut self, settings: &PsfTextureSettings) -> Result<(), PsfError> {
        if self.psf.as_ref().is_none_or(|(of, _)| of != settings) {
            let psf = DrawnPsf::new(&settings.texture()?);
            self.psf = Some((settings.clone(), psf));
            // The pass holds the texture of the function before.
            self.methods.retain(|held| held.method != StarMethod::PsfTexture);
        }
        Ok(())
    }

    /// The point-spread function, where the method has one.
    fn psf_of(&self, method: StarMethod) -> Option<&DrawnPsf> {
        self.psf.as_ref().filter(|_| method == StarMethod::PsfTexture).map(|(_, psf)| psf)
    }

    /// Prepares the method of a frame; its plan. `shown_ev100` is the exposure that the frame will be shown with.
    pub(super) fn begin(&mut self, gpu: &Gpu, settings: &RenderSettings, shown_ev100: f64) -> BillboardPlan {
        self.drawn = None;
        let method = settings.stars.method;
        self.in_use = self.methods.iter().position(|held| held.method == method);
        if self.in_use.is_none() {
            let sprite = (method == StarMethod::Sprite).then(|| sprite(SPRITE_SIZE));
            let of_sprite = sprite.as_ref().map(|image| SquareImage { size: image.size, rgb: &image.rgb });
            let of_psf = self.psf_of(method).map(|psf| SquareImage { size: psf.form.size, rgb: &psf.form.rgb });
            if let Some(pass) = BillboardPass::new(gpu, method, of_psf.or(of_sprite)) {
                self.methods.push(MethodPass { method, pass });
                self.in_use = Some(self.methods.len() - 1);
            }
        }
        BillboardPlan::new(&settings.stars, settings.exposure.ev100, shown_ev100, self.psf_of(method))
    }

    /// Records one tile of a viewport: the stars, if it is the first one of the viewport, and the resolve pass.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(super) fn record_tile(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &BlendedFrame<'_>,
        viewport: &Viewport,
        tile: &Tile,
        target: &PictureTarget<'_>,
    ) {
        let cube = CubeFaces::for_projection(&viewport.projection, gpu.max_view_side_px());
        if self.drawn != Some(tile.viewport) {
            self.draw_planes(gpu, encoder, timer, frame, viewport, cube);
            self.drawn = Some(tile.viewport);
        }
        let Some(texture) = &self.target else { return };
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let (resolve, numbers) = match cube {
            Some(cube) => {
                let pass = self.from_cube.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Cube));
                (pass, [cube.edge_px, GUARD_PX])
            }
            None => (self.from_texture.get_or_init(|| LuminancePass::new(gpu, LuminanceSource::Texture)), [0, 0]),
        };
        let mut pass = begin_pass(encoder, timer, "resolve");
        let grid = pixel_grid(std::slice::from_ref(tile), &[viewport.size()[0]]);
        resolve.record(gpu, &mut pass, 1.0, numbers, target, &[(0, wgpu::BindingResource::TextureView(&view))], grid);
    }

    /// Records the planes of a viewport: itself, or the faces of its cube.
    fn draw_planes(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &BlendedFrame<'_>,
        viewport: &Viewport,
        cube: Option<CubeFaces>,
    ) {
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
                // Billboards of a cubemap's faces stand the same way across its edges.
                Projection::CubeFace(face) => {
                    vec![Some(plane_of(viewport, face.plane(), face.face.cube_from_face()))]
                }
                Projection::Fisheye(_) | Projection::Equirectangular(_) => Vec::new(),
            },
        };
        let size = cube.map_or(viewport.size(), |cube| [cube.side_px(); 2]);
        let texture = self.target_of(gpu, size, planes.len() as u32);
        let Some(held) = self.in_use.and_then(|index| self.methods.get(index)) else { return };
        for (layer, plane) in planes.iter().enumerate() {
            let Some(plane) = plane else { continue };
            let view = texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer as u32,
                array_layer_count: Some(1),
                ..Default::default()
            });
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("stars"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
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
            let draws = frame.draws();
            held.pass.record(
                gpu,
                &mut pass,
                &frame.plan,
                self.psf_of(held.method),
                frame.camera_pc,
                plane,
                frame.colours,
                &draws,
            );
        }
    }

    /// A texture of that size, the one held if it fits.
    fn target_of(&mut self, gpu: &Gpu, [width, height]: [u32; 2], layers: u32) -> wgpu::Texture {
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: layers };
        if self.target.as_ref().is_some_and(|held| held.size() != size) {
            // Gone before its successor is made, so that both never exist at once.
            self.target = None;
        }
        self.target
            .get_or_insert_with(|| {
                gpu.device.create_texture(&wgpu::TextureDescriptor {
                    label: Some("blended stars"),
                    size,
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format: gpu.blend_format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                    view_formats: &[],
                })
            })
            .clone()
    }

    /// Counts the stars drawn: after everything that is timed.
    pub(super) fn record_count(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        frame: &BlendedFrame<'_>,
        viewports: (&wgpu::Buffer, u32),
        counters: &wgpu::Buffer,
    ) {
        let count = self.count.get_or_init(|| CountPass::new(gpu));
        let mut pass = encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("count stars"), timestamp_writes: None });
        let draws = frame.draws();
        count.record(gpu, &mut pass, frame.camera_pc, frame.plan.faintest_lx, viewports, counters, &draws);
    }
}

/// Bytes of the texture that a picture is drawn into.
pub(super) fn target_bytes(gpu: &Gpu, projection: &Projection) -> u64 {
    let cube = CubeFaces::for_projection(projection, gpu.max_view_side_px());
    let (size, layers) =
        cube.map_or((projection.mapping().size(), 1), |cube| ([cube.side_px(); 2], cube.layers() as u64));
    let texel_bytes = u64::from(gpu.blend_format.block_copy_size(None).unwrap_or(16));
    size.map(u64::from).iter().product::<u64>() * layers * texel_bytes
}

fn plane_of(viewport: &Viewport, plane: &Perspective, view_from_plane: DQuat) -> BillboardPlane {
    let [left, right, ..] = plane.edge_tangents(0.0);
    BillboardPlane {
        viewport: layout::Viewport { kind: 0, ..encode_viewport(viewport, &KernelPlan::bspline()) },
        view_from_plane,
        pixel_rad: (right - left) / f64::from(viewport.size()[0]),
    }
}

/// The exposure that a frame is shown with: the known one, or what a meter would read off the whole sky.
pub(super) fn shown_ev100(
    settings: &RenderSettings,
    adapted_ev100: Option<f64>,
    camera_pc: glam::DVec3,
    catalogue: Option<&CatalogueBuffers>,
) -> f64 {
    settings.known_white_ev100(adapted_ev100).unwrap_or_else(|| {
        let chunks = catalogue.map_or(&[][..], |catalogue| &catalogue.set.chunks);
        let light_lx: f64 = chunks
            .iter()
            .map(|chunk| {
                let distance_pc = if chunk.at_infinity { 1.0 } else { (chunk.origin_pc - camera_pc).length() };
                chunk.total_lx / (distance_pc * distance_pc).max(1e-12)
            })
            .sum();
        settings.exposure.metered_ev100(light_lx / (4.0 * PI))
    })
}

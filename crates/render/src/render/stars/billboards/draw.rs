//! The published star methods that use the graphics pipeline: one point or square per star, in the order of the catalogue, added by blending.
//!
//! Shaders: `shaders/stars/billboards/`; the f64 twin is `crate::reference::stars::billboards`.
//!
//! No shader: the passes of shaders/stars/billboards.
//! No twin: reference/stars/billboards.rs.

use glam::DQuat;

use crate::render::{
    constants::{billboards, workgroups::CATALOGUE_THREADS},
    shader::Shader,
};
use crate::{
    gpu::{Gpu, LayoutOf, Variants, bind_buffers, dispatch_rows},
    plan::{
        settings::StarMethod,
        stars::billboards::{BillboardPlan, DrawnPsf},
    },
    render::{stars::catalogue_buffers::CatalogueDraw, stars::layout, tabulated::projecting},
};

/// Draw pass of one method.
pub(crate) struct BillboardPass {
    pipeline: wgpu::RenderPipeline,
    /// Vertices per star.
    vertices: u32,
    /// Star image, for the methods that use one.
    image: Option<wgpu::TextureView>,
}

/// Inputs of a frame.
#[derive(Clone, Copy)]
pub(crate) struct BillboardFrame<'a> {
    pub plan: &'a BillboardPlan,
    pub psf: Option<&'a DrawnPsf>,
    pub camera_pc: [f32; 3],
    pub colours: &'a wgpu::Buffer,
    /// All stars of the catalogue.
    pub draws: &'a [CatalogueDraw<'a>],
}

/// Image plane that stars are drawn on.
pub(crate) struct BillboardPlane {
    /// Encoded viewport of the plane.
    pub viewport: layout::Viewport,
    /// Rotation from the plane's axes to those of the view.
    pub view_from_plane: DQuat,
    /// Angle of a pixel at the principal ray, rad.
    pub pixel_rad: f64,
}

/// Distribution of a star's light over its billboard. Each profile has a fragment shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Profile {
    /// A whole pixel.
    Point,
    /// Covered share of a pixel, for a small disc.
    SmoothPoint,
    /// Constant luminance.
    Disc,
    /// A cone.
    Cone,
    /// A cone and a glare.
    Glare,
    /// Two Gaussians at the pixel's centre.
    Gaussian,
    /// Two Gaussians averaged over the pixel.
    GaussianIntegrated,
    /// A round spot on the screen.
    Screen,
    /// An image.
    Sprite,
    /// An image of a point-spread function.
    Psf,
}

impl Profile {
    /// Whether the profile reads an image of a star.
    fn has_image(self) -> bool {
        matches!(self, Self::Sprite | Self::Psf)
    }

    fn file(self) -> &'static str {
        match self {
            Self::Point => "stars/billboards/profile_point",
            Self::SmoothPoint => "stars/billboards/profile_smooth_point",
            Self::Disc => "stars/billboards/profile_disc",
            Self::Cone => "stars/billboards/profile_cone",
            Self::Glare => "stars/billboards/profile_glare",
            Self::Gaussian => "stars/billboards/profile_gaussian",
            Self::GaussianIntegrated => "stars/billboards/profile_gaussian_integrated",
            Self::Screen => "stars/billboards/profile_screen",
            Self::Sprite => "stars/billboards/profile_sprite",
            Self::Psf => "stars/billboards/profile_psf",
        }
    }
}

/// Returns the law and profile of a method; `None` if it does not blend.
fn shaders_of(method: StarMethod) -> Option<(u32, Profile)> {
    Some(match method {
        StarMethod::HardwarePoint => (billboards::LAW_POINT, Profile::Point),
        StarMethod::HardwareSmoothPoint => (billboards::LAW_SMOOTH_POINT, Profile::SmoothPoint),
        StarMethod::Disc => (billboards::LAW_CONSTANT, Profile::Disc),
        StarMethod::SmoothDisc => (billboards::LAW_CONSTANT, Profile::Cone),
        StarMethod::Sprite => (billboards::LAW_CONSTANT, Profile::Sprite),
        StarMethod::ScaledDisc => (billboards::LAW_SCALED, Profile::Cone),
        StarMethod::GlareDisc => (billboards::LAW_GLARE, Profile::Glare),
        StarMethod::GaussianPsf => (billboards::LAW_GAUSSIAN, Profile::Gaussian),
        StarMethod::GaussianPsfIntegrated => (billboards::LAW_GAUSSIAN, Profile::GaussianIntegrated),
        StarMethod::ScreenBillboard => (billboards::LAW_SCREEN, Profile::Screen),
        StarMethod::PsfTexture => (billboards::LAW_PSF, Profile::Psf),
        _ => return None,
    })
}

/// Returns the primitive topology and number of vertices of a billboard.
fn corners_of(profile: Profile) -> (wgpu::PrimitiveTopology, u32) {
    match profile {
        Profile::Point => (wgpu::PrimitiveTopology::PointList, 1),
        _ => (wgpu::PrimitiveTopology::TriangleStrip, 4),
    }
}

/// Pipelines of all methods, each created at first use.
pub(crate) struct BillboardPipelines(Variants<StarMethod, wgpu::RenderPipeline>);

impl BillboardPipelines {
    /// Creates an empty set of pipelines.
    pub(crate) fn new() -> Self {
        Self(Variants::new())
    }

    /// Returns the pipeline of a blending method; `None` for other methods.
    pub(crate) fn get(&self, gpu: &Gpu, method: StarMethod) -> Option<wgpu::RenderPipeline> {
        let (law, profile) = shaders_of(method)?;
        let make = || {
            gpu.blending_pipeline(
                &Shader::new("stars/billboards/place").source(),
                &[("LAW", f64::from(law))],
                &Shader::new("stars/billboards/shade").with("profile", profile.file()).source(),
                corners_of(profile).0,
            )
        };
        Some(self.0.get(method, make))
    }
}

impl BillboardPass {
    /// Creates the pass of a blending method; `None` for other methods. `image` is the star image of `sprite` and
    /// `psf_texture`.
    pub(crate) fn new(
        gpu: &Gpu,
        pipelines: &BillboardPipelines,
        method: StarMethod,
        image: Option<(u32, &[[f32; 3]])>,
    ) -> Option<Self> {
        let (_, profile) = shaders_of(method)?;
        let (_, vertices) = corners_of(profile);
        let pipeline = pipelines.get(gpu, method)?;
        let image = image.filter(|_| profile.has_image()).map(|image| image_texture(gpu, image));
        Some(Self { pipeline, vertices, image })
    }

    /// Records all stars onto one plane.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &BillboardFrame<'_>,
        plane: &BillboardPlane,
    ) {
        let BillboardFrame { plan, psf, camera_pc, colours, draws } = *frame;
        let parameters = gpu.frame_uniform("billboards", &parameters(plan, psf, camera_pc, plane));
        let viewport = gpu.frame_uniform("plane", &plane.viewport);
        let group = gpu.bind(
            LayoutOf::Render(&self.pipeline, 0),
            &[(0, parameters.as_entire_binding()), (1, viewport.as_entire_binding()), (2, colours.as_entire_binding())],
        );
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        if let Some(image) = &self.image {
            pass.set_bind_group(
                2,
                &gpu.bind(LayoutOf::Render(&self.pipeline, 2), &[(0, wgpu::BindingResource::TextureView(image))]),
                &[],
            );
        }
        for draw in draws {
            pass.set_bind_group(
                1,
                &gpu.bind(LayoutOf::Render(&self.pipeline, 1), &[(0, draw.stars.as_entire_binding())]),
                &[],
            );
            pass.draw(0..self.vertices, 0..draw.count);
        }
    }
}

fn parameters(
    plan: &BillboardPlan,
    psf: Option<&DrawnPsf>,
    camera: [f32; 3],
    plane: &BillboardPlane,
) -> layout::BillboardParameters {
    let rotation = glam::DMat3::from_quat(plane.view_from_plane);
    let row = |index: usize| {
        let row = rotation.row(index);
        [row.x as f32, row.y as f32, row.z as f32, 0.0]
    };
    let gaussian = plan.gaussian;
    layout::BillboardParameters {
        view_from_plane_x: row(0),
        view_from_plane_y: row(1),
        view_from_plane_z: row(2),
        camera,
        faintest_lx: plan.faintest_lx as f32,
        radius_rad: plan.radius_rad as f32,
        solid_angle_sr: plan.solid_angle_sr as f32,
        brightest_magnitude: plan.magnitudes[0] as f32,
        faintest_magnitude: plan.magnitudes[1] as f32,
        half_side_px: plan.half_side_px as f32,
        limiting_magnitude: gaussian.limiting_magnitude as f32,
        saturation_magnitude: gaussian.saturation_magnitude as f32,
        sigma2_px2: gaussian.sigma2_px2 as f32,
        glare_sigma2_px2: gaussian.glare_sigma2_px2 as f32,
        glare_brightness: gaussian.glare_brightness as f32,
        white_cd_m2: plan.white_cd_m2 as f32,
        half_width_rad: psf.map_or(0.0, |psf| psf.form.half_width_rad() as f32),
        texel_rad: psf.map_or(0.0, |psf| psf.form.pixel_rad as f32),
        crop_rad: plan.crop_rad as f32,
        least_crop_rad: psf.map_or(0.0, |psf| BillboardPlan::least_crop_rad(psf, plane.pixel_rad) as f32),
        softening_rad2: psf.map_or(0.0, |psf| psf.form.softening_rad2() as f32),
    }
}

fn image_texture(gpu: &Gpu, (side, rgb): (u32, &[[f32; 3]])) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("star image"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let texels: Vec<[f32; 4]> = rgb.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect();
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * side), rows_per_image: Some(side) };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(&texels), layout, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Counts the stars in pictures. It is recorded after all timed passes, since drawing does not need the number.
pub(crate) struct CountPass {
    pipeline: wgpu::ComputePipeline,
}

impl CountPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipeline: gpu.compute_pipeline(&projecting(gpu, "stars/billboards/count").source()) }
    }

    /// Counts the stars of every viewport into the counter of its view.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        (camera, faintest_lx): ([f32; 3], f64),
        viewports: (&wgpu::Buffer, u32),
        counters: &wgpu::Buffer,
        draws: &[CatalogueDraw<'_>],
    ) {
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        for tile in 0..viewports.1 {
            for draw in draws {
                let [columns, rows] = dispatch_rows(gpu, draw.count.div_ceil(CATALOGUE_THREADS));
                let parameters = layout::CatalogueParameters {
                    camera,
                    star_count: draw.count,
                    faintest_lx: faintest_lx as f32,
                    tile,
                    row_threads: columns * CATALOGUE_THREADS,
                    ..Default::default()
                };
                let parameters = gpu.frame_uniform("catalogue parameters", &parameters);
                let buffers = [
                    (0, parameters.as_entire_binding()),
                    (1, viewports.0.as_entire_binding()),
                    (2, counters.as_entire_binding()),
                ];
                pass.set_bind_group(0, &bind_buffers(gpu, &self.pipeline, 0, &buffers), &[]);
                let stars = [(0, draw.stars.as_entire_binding())];
                pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, &stars), &[]);
                pass.dispatch_workgroups(columns, rows, 1);
            }
        }
    }
}

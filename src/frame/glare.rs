//! Recording the glare of a frame: after every batch has left its picture, whole, in its pixels.

use super::{
    glare_pyramid::GlarePyramid,
    glare_sky::{GlareSky, SkyScene},
};
use crate::{
    gpu::{Gpu, GpuTimer, layout},
    photometry::glare::{GlareKernel, GlareKernelError},
    plan::{
        glare_pyramid::PyramidAxes,
        object_glare::{Cloud, Source},
        settings::{GlareMethod, GlareSettings},
        tiles::Batch,
    },
    view::Viewport,
};

/// Passes and buffers of glare, made when they are first asked for.
pub(super) struct Glare {
    sky: GlareSky,
    pyramid: GlarePyramid,
}

/// A batch whose picture is finished but for its glare.
pub(super) struct GlareBatch<'a> {
    pub batch: &'a Batch,
    /// The batch's tiles as shaders read them.
    pub tiles: &'a wgpu::Buffer,
    /// The same on this side.
    pub encoded_tiles: &'a [layout::Tile],
    /// The picture.
    pub pixels: wgpu::Buffer,
    /// Workgroups of the passes over pixels.
    pub grid: [u32; 3],
}

/// All pictures of a frame.
pub(super) struct GlareFrame<'a> {
    pub settings: &'a GlareSettings,
    /// Share of the light that is scattered.
    pub fraction: f64,
    /// What draws the glare, neither `auto` nor `none`.
    pub method: GlareMethod,
    pub viewports: &'a [Viewport],
    /// The same as shaders read them.
    pub encoded_viewports: &'a wgpu::Buffer,
    pub partial_sums: &'a wgpu::Buffer,
    /// What scatters besides the stars in the eye of each viewport; empty: nothing.
    pub object_sources: &'a [Vec<Source>],
    /// The same of fields of asteroids.
    pub clouds: &'a [Vec<Cloud>],
    pub batches: Vec<GlareBatch<'a>>,
}

impl Glare {
    pub(super) fn new() -> Self {
        Self { sky: GlareSky::new(), pyramid: GlarePyramid::new() }
    }

    /// Holds the kernel of the settings, until they change: a file that changes alone is not read again.
    pub(super) fn hold_kernel(&mut self, settings: &GlareSettings) -> Result<(), GlareKernelError> {
        self.sky.hold_kernel(settings)
    }

    /// See [`GlareSky::hold_map`]. For the method `sky_cube`, after [`Glare::hold_kernel`].
    pub(super) fn hold_map(&mut self, gpu: &Gpu, settings: &GlareSettings, scene: &SkyScene<'_>) {
        self.sky.hold_map(gpu, settings, scene);
    }

    /// The kernel that is held.
    pub(super) fn kernel(&self) -> Option<&dyn GlareKernel> {
        self.sky.kernel()
    }

    /// Lets go of buffers and textures.
    pub(super) fn release(&mut self) {
        self.sky.release();
        self.pyramid.release();
    }

    /// Records everything that glare takes.
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &GlareFrame<'_>,
        scene: &SkyScene<'_>,
    ) {
        if let Some(axes) = PyramidAxes::of(frame.method) {
            self.sky.release();
            self.pyramid.record(gpu, encoder, timer, frame, axes);
        } else {
            self.pyramid.release();
            self.sky.record(gpu, encoder, timer, frame, scene);
        }
    }
}

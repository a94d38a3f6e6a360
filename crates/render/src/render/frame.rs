//! Frames: images, statistics and times.

use std::{ops::BitOrAssign, sync::Arc};

use serde::Serialize;

use super::AsteroidCounts;
#[cfg(doc)]
use super::Renderer;
use crate::{
    photometry::rec709::luminance,
    plan::FramePlan,
    view::{Part, projector::ProjectorOutput},
};

/// One image of a frame.
#[derive(Clone, Debug)]
pub struct FrameImage {
    /// Index of the view in the rig.
    pub view: usize,
    /// Part of the view that the image shows.
    pub part: Part,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Display image, 8 bits each of R, G, B, A, row by row from the top, if requested.
    pub display: Option<Vec<u8>>,
    /// R, G, B in cd/m^2 (linear Rec. 709) and the pixel's solid angle in sr (0 outside the picture), row by row from
    /// the top, if requested.
    pub hdr: Option<Vec<[f32; 4]>>,
    /// Corrections of a projector view. Blending and the projector's response are applied to the display image, not to
    /// the HDR image.
    pub projector: Option<Arc<ProjectorOutput>>,
}

impl FrameImage {
    /// Returns the illuminance of the image: luminance times solid angle, summed over all pixels, lx. `None` if the HDR image was not requested.
    pub fn illuminance_lx(&self) -> Option<f64> {
        let light = |[red, green, blue, omega_sr]: &[f32; 4]| {
            luminance([red, green, blue].map(|channel| f64::from(*channel))) * f64::from(*omega_sr)
        };
        Some(self.hdr.as_ref()?.iter().map(light).sum())
    }
}

impl Frame {
    /// Replaces the view indices of a frame of a partial rig by those of the whole rig, which `numbers` lists in the order of the partial rig.
    ///
    /// # Panics
    ///
    /// `numbers` has fewer entries than there are views.
    #[must_use]
    pub fn with_views(mut self, numbers: &[usize]) -> Self {
        for image in &mut self.images {
            image.view = numbers[image.view];
        }
        self
    }

    /// Adds the HDR images of another frame that shows the same views.
    pub(super) fn with_hdr_of(mut self, exact: Frame) -> Self {
        for image in exact.images {
            match self.images.iter_mut().find(|own| (own.view, own.part) == (image.view, image.part)) {
                Some(own) => own.hdr = image.hdr,
                None => self.images.push(image),
            }
        }
        self.hdr_plan = Some(exact.plan);
        // Sort by the order of the views in the rig; the stable sort keeps the order of a view's parts.
        self.images.sort_by_key(|image| image.view);
        let (own, other) = (&mut self.times, exact.times);
        own.plan_ms += other.plan_ms;
        own.cull_ms += other.cull_ms;
        own.objects_made += other.objects_made;
        own.gpu_and_readback_ms += other.gpu_and_readback_ms;
        own.total_ms += other.total_ms;
        own.gpu_ms = own.gpu_ms.zip(other.gpu_ms).map(|(own, other)| own + other);
        own.passes_ms.extend(other.passes_ms);
        self
    }
}

/// Statistics of one view of a frame. They are also written to the manifest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewStatistics {
    /// The view's name.
    pub name: String,
    /// Number of stars whose image is in the picture.
    pub stars_drawn: u64,
    /// Number of stars in the map of faint light that the view reads, over the whole sky; 0: the view reads no map. Stars that a whole-sky map draws
    /// near its poles count as well.
    pub stars_in_map: u64,
    /// Magnitude of the faintest visible stars in the display image: those whose peak is 20 of 255. Computed from the exposure and the view's mean
    /// pixel. `None` for star methods that do not draw stars with their physical light.
    pub limiting_magnitude: Option<f64>,
    /// Numbers of asteroids, by the form they are drawn in.
    pub asteroids: AsteroidCounts,
    /// The view's share of GPU time, ms. The star pass is divided in proportion to the number of stars, passes over pixels in proportion to the
    /// number of pixels. `None` if the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
}

/// Buffers of a view to read back; none by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Wanted {
    /// The tone-mapped display image.
    pub display: bool,
    /// The exact HDR image.
    pub hdr: bool,
    /// The HDR image with the accuracy `accuracy.hdr`. The image is exact if any view of the frame requests an exact one.
    pub hdr_streamed: bool,
    /// Make the HDR image but leave it on the GPU, to measure the time that it takes.
    pub hdr_stays: bool,
}

impl Wanted {
    /// Requests only the display image.
    pub const fn display() -> Self {
        Self { display: true, hdr: false, hdr_streamed: false, hdr_stays: false }
    }

    /// Requests only the exact HDR image.
    pub const fn hdr() -> Self {
        Self { display: false, hdr: true, hdr_streamed: false, hdr_stays: false }
    }

    /// Requests only the HDR image with the accuracy `accuracy.hdr`.
    pub const fn hdr_streamed() -> Self {
        Self { display: false, hdr: false, hdr_streamed: true, hdr_stays: false }
    }

    /// Requests both images.
    pub const fn both() -> Self {
        Self { display: true, hdr: true, hdr_streamed: false, hdr_stays: false }
    }

    /// Whether an HDR image is read back.
    pub const fn reads_hdr(self) -> bool {
        self.hdr || self.hdr_streamed
    }
}

impl BitOrAssign for Wanted {
    /// Returns a request for all buffers that either of the two contains.
    fn bitor_assign(&mut self, other: Self) {
        self.display |= other.display;
        self.hdr |= other.hdr;
        self.hdr_streamed |= other.hdr_streamed;
        self.hdr_stays |= other.hdr_stays;
    }
}

/// Times of the stages of a frame, ms.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct FrameTimes {
    /// Planning and recording on the CPU.
    pub plan_ms: f64,
    /// Each pass on the GPU, by name; empty if the adapter has no timestamps.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// GPU time from clearing the first buffer to the end of the last pass, excluding readback copies; `None` if the
    /// adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Culling on the CPU, part of `plan_ms`.
    pub cull_ms: f64,
    /// Number of buffers, bind groups and pipelines created for the frame; 0 in a steady state.
    pub objects_made: u64,
    /// Time from submission to the end of the readback. It includes only the time during which the caller waited, not the time between
    /// [`Renderer::submit`] and [`Renderer::finish`].
    pub gpu_and_readback_ms: f64,
    /// Duration of [`Renderer::render`], or of [`Renderer::submit`] and [`Renderer::finish`] without the time between
    /// them.
    pub total_ms: f64,
}

/// A finished frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Sequence number of the frame in its renderer.
    pub number: u64,
    /// Revision of the scene.
    pub scene_revision: u64,
    /// Revision of the camera.
    pub camera_revision: u64,
    /// Exposure of all views, EV at ISO 100.
    pub exposure_ev100: f64,
    /// Metered exposure of this frame, the target of adaptation.
    pub metered_ev100: f64,
    /// Mean luminance over all views, weighted by solid angle, cd/m^2. If a separate meter frame was drawn, it is the mean over that frame.
    pub mean_luminance_cd_m2: f64,
    /// Images in the order of views and parts. There are none for views without requested buffers.
    pub images: Vec<FrameImage>,
    /// One entry per view of the rig.
    pub views: Vec<ViewStatistics>,
    /// Chosen methods and the certificate.
    pub plan: FramePlan,
    /// Plan of the HDR images, if they were drawn separately from the display images.
    pub hdr_plan: Option<FramePlan>,
    /// Times of the stages.
    pub times: FrameTimes,
}

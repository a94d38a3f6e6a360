//! What a frame is: images, statistics and times.

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
    /// Which image of the view.
    pub part: Part,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Display image, 8 bits each of R, G, B, A, row by row from the top; if it was asked for.
    pub display: Option<Vec<u8>>,
    /// R, G, B in cd/m^2 (linear Rec. 709) and the pixel's solid angle in sr (0 outside of the picture), row by row from
    /// the top; if it was asked for.
    pub hdr: Option<Vec<[f32; 4]>>,
    /// Of a projector: what was done to its picture. Blending and the projector's response are in the display image, not in the HDR image.
    pub projector: Option<Arc<ProjectorOutput>>,
}

impl FrameImage {
    /// Illuminance of the image: luminance times solid angle, summed over all pixels, lx. `None` if the HDR image was not asked for.
    pub fn illuminance_lx(&self) -> Option<f64> {
        let light = |[red, green, blue, omega_sr]: &[f32; 4]| {
            luminance([red, green, blue].map(|channel| f64::from(*channel))) * f64::from(*omega_sr)
        };
        Some(self.hdr.as_ref()?.iter().map(light).sum())
    }
}

impl Frame {
    /// The same frame of a part of a rig, with the views' numbers in the whole rig: `numbers` has them in the order of the part.
    ///
    /// # Panics
    ///
    /// There are fewer numbers than views.
    #[must_use]
    pub fn of_views(mut self, numbers: &[usize]) -> Self {
        for image in &mut self.images {
            image.view = numbers[image.view];
        }
        self
    }

    /// The same frame with the HDR images of another one, which shows the same.
    pub(super) fn with_hdr_of(mut self, exact: Frame) -> Self {
        for image in exact.images {
            match self.images.iter_mut().find(|own| (own.view, own.part) == (image.view, image.part)) {
                Some(own) => own.hdr = image.hdr,
                None => self.images.push(image),
            }
        }
        self.hdr_plan = Some(exact.plan);
        // Views lie in the order of the rig; a view's parts keep theirs.
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

/// What a view of a frame holds, for the manifest and for statistics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewStatistics {
    /// The view's name.
    pub name: String,
    /// Stars whose image lies in the picture.
    pub stars_drawn: u64,
    /// Stars in the map of faint light that the view reads, all over the sky; 0: it reads none.
    pub stars_in_map: u64,
    /// Magnitude of the stars that the display image just shows: they peak at 20 of 255. It follows from the exposure and the view's
    /// mean pixel; `None` for star methods that do not draw stars with their own light.
    pub limiting_magnitude: Option<f64>,
    /// Asteroids by what they are drawn as.
    pub asteroids: AsteroidCounts,
    /// The view's share of the GPU's time, ms: of the star pass by stars drawn, of the passes over pixels by pixels. `None`
    /// where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
}

/// Which buffers of a view leave the GPU; by default none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Wanted {
    /// The tone-mapped display image.
    pub display: bool,
    /// The HDR image.
    pub hdr: bool,
    /// The HDR image is made and stays on the GPU: to time the making of it.
    pub hdr_stays: bool,
}

impl Wanted {
    /// The display image alone.
    pub const fn display() -> Self {
        Self { display: true, hdr: false, hdr_stays: false }
    }

    /// The HDR image alone.
    pub const fn hdr() -> Self {
        Self { display: false, hdr: true, hdr_stays: false }
    }

    /// Both images.
    pub const fn both() -> Self {
        Self { display: true, hdr: true, hdr_stays: false }
    }
}

impl BitOrAssign for Wanted {
    /// What either of them wants.
    fn bitor_assign(&mut self, other: Self) {
        self.display |= other.display;
        self.hdr |= other.hdr;
        self.hdr_stays |= other.hdr_stays;
    }
}

/// Time of the stages of a frame, ms.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct FrameTimes {
    /// Planning and recording on the CPU.
    pub plan_ms: f64,
    /// Each pass on the GPU, by name; empty where the adapter has no timestamps.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// On the GPU from the clearing of the first buffer to the end of the last pass, without the copies that are read
    /// back; `None` where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Culling on the CPU, part of `plan_ms`.
    pub cull_ms: f64,
    /// Buffers, bind groups and pipelines that were made for the frame: none in a steady state.
    pub objects_made: u64,
    /// From submission to the end of the readback, as far as the caller waited for it: without the time between
    /// [`Renderer::submit`] and [`Renderer::finish`].
    pub gpu_and_readback_ms: f64,
    /// All of [`Renderer::render`], or of [`Renderer::submit`] and [`Renderer::finish`] together, without the time between them.
    pub total_ms: f64,
}

/// A finished frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Counts the frames of a renderer.
    pub number: u64,
    /// Revision of the scene shown.
    pub scene_revision: u64,
    /// Revision of the camera.
    pub camera_revision: u64,
    /// Exposure of all views.
    pub exposure_ev100: f64,
    /// What the frame asks for: the exposure to adapt to.
    pub metered_ev100: f64,
    /// Mean luminance over all views, weighted by solid angle, cd/m^2; where a meter of its own has looked, over what that has seen.
    pub mean_luminance_cd_m2: f64,
    /// The images, in the order of views and parts; a view of which nothing was wanted has none.
    pub images: Vec<FrameImage>,
    /// One entry per view that it was drawn for.
    pub views: Vec<ViewStatistics>,
    /// Methods chosen and the certificate.
    pub plan: FramePlan,
    /// The same of the HDR images, where these were drawn apart from the display images.
    pub hdr_plan: Option<FramePlan>,
    /// Where the time went.
    pub times: FrameTimes,
}

//! Requests for frames: the scene, the views, and options.

use std::{borrow::Cow, sync::LazyLock};

use super::{Presentation, Wanted};
#[cfg(doc)]
use super::{RenderError, Renderer};
use crate::{
    plan::{Output, budget::draws_outputs_apart, settings::RenderSettings, view_settings::FrameGroup},
    scene::SceneSnapshot,
    view::Rig,
};

/// Settings of frames that do not set any.
static DEFAULT_SETTINGS: LazyLock<RenderSettings> = LazyLock::new(RenderSettings::default);

/// One frame of all views of a rig, for [`Renderer::render`] and [`Renderer::submit`].
///
/// Without options, the frame is drawn with the default [`RenderSettings`], the display image of every view is read back, and automatic exposure is
/// that of a fully adapted eye.
///
/// ```
/// # use steradian_render::{render::{FrameRequest, Wanted}, scene::SceneSnapshot, view::Rig};
/// # fn requests(scene: &SceneSnapshot, rig: &Rig) {
/// let displayed = FrameRequest::new(scene, rig);
/// let measured = FrameRequest::new(scene, rig).wanted(Wanted::hdr()).adapted_ev100(-3.0);
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use = "a request does nothing until it is passed to a renderer"]
pub struct FrameRequest<'a> {
    pub(super) scene: &'a SceneSnapshot,
    pub(super) rig: &'a Rig,
    pub(super) settings: &'a RenderSettings,
    pub(super) adapted_ev100: Option<f64>,
    pub(super) presentations: &'a [Presentation<'a>],
    wanted: WantedViews<'a>,
    output: Option<Output>,
    pub(super) sky_map: SkyMapUse,
    /// Index of the frame's series, and number of series.
    pub(super) series: [usize; 2],
    /// Views and settings from which automatic exposure is computed, if they differ from those of the frame.
    pub(super) exposed_as: Option<(&'a Rig, &'a RenderSettings)>,
}

/// What a frame does if it may read a map of faint light and the map does not exist yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SkyMapUse {
    /// Draw the whole map first.
    #[default]
    Wait,
    /// Draw a part of the map, and draw every star individually until the map is complete.
    InTurn,
    /// Draw every star individually.
    Off,
}

#[derive(Clone, Copy, Debug)]
enum WantedViews<'a> {
    Every(Wanted),
    Each(&'a [Wanted]),
}

impl<'a> FrameRequest<'a> {
    /// Requests the display images of all views of `rig`, which is at the camera of `scene`.
    pub fn new(scene: &'a SceneSnapshot, rig: &'a Rig) -> Self {
        Self {
            scene,
            rig,
            settings: &DEFAULT_SETTINGS,
            adapted_ev100: None,
            presentations: &[],
            wanted: WantedViews::Every(Wanted::display()),
            output: None,
            sky_map: SkyMapUse::default(),
            series: [0, 1],
            exposed_as: None,
        }
    }

    /// Requests the display images of one group of views of a rig, as made by [`frame_groups`](crate::plan::view_settings::frame_groups). The
    /// renderer keeps separate maps of glare and of faint stars for each group, so that the groups can be drawn in turn.
    ///
    /// # Panics
    ///
    /// `number` is not the index of a group.
    pub fn for_group(scene: &'a SceneSnapshot, groups: &'a [FrameGroup], number: usize) -> Self {
        let group = &groups[number];
        let exposed_as = group.exposed_as.as_ref().map(|(rig, settings)| (rig, settings));
        let series = [number, groups.len()];
        Self { series, exposed_as, ..Self::new(scene, &group.rig).settings(&group.settings) }
    }

    /// Sets the render settings.
    pub fn settings(self, settings: &'a RenderSettings) -> Self {
        Self { settings, ..self }
    }

    /// Sets the buffers to read back, the same for every view.
    pub fn wanted(self, wanted: Wanted) -> Self {
        Self { wanted: WantedViews::Every(wanted), ..self }
    }

    /// Sets the buffers to read back for each view, in the order of the rig. If the number of entries differs from the number of views, the frame is
    /// refused with [`RenderError::WantedCount`].
    pub fn wanted_per_view(self, wanted: &'a [Wanted]) -> Self {
        Self { wanted: WantedViews::Each(wanted), ..self }
    }

    /// Sets the exposure of an eye that adapts over time (EV at ISO 100), for automatic exposure. `None` has no effect.
    pub fn adapted_ev100(self, adapted_ev100: impl Into<Option<f64>>) -> Self {
        Self { adapted_ev100: adapted_ev100.into(), ..self }
    }

    /// Sets textures to draw images into in the same submission, in addition to the readback.
    pub fn presentations(self, presentations: &'a [Presentation<'a>]) -> Self {
        Self { presentations, ..self }
    }

    /// Sets what the frame does if display images may read a map of faint light and the map does not exist yet.
    pub fn sky_map(self, sky_map: SkyMapUse) -> Self {
        Self { sky_map, ..self }
    }

    /// Returns the scene, with its camera.
    pub fn get_scene(&self) -> &'a SceneSnapshot {
        self.scene
    }

    /// Returns the views.
    pub fn get_rig(&self) -> &'a Rig {
        self.rig
    }

    /// See [`Self::settings`].
    pub fn get_settings(&self) -> &'a RenderSettings {
        self.settings
    }

    /// See [`Self::adapted_ev100`].
    pub fn get_adapted_ev100(&self) -> Option<f64> {
        self.adapted_ev100
    }

    /// Draws within the error budget of the given output, regardless of the images that are read back. This serves to measure the cost of a budget.
    #[doc(hidden)]
    pub fn drawn_for(self, output: Output) -> Self {
        Self { output: Some(output), ..self }
    }

    /// Returns the output that determines the frame's error budget.
    pub(super) fn output(&self) -> Output {
        if let Some(output) = self.output {
            return output;
        }
        let given = self.given_views();
        let any = |wants: fn(&Wanted) -> bool| given.iter().any(wants);
        let is_exact = self.settings.accuracy.hdr == 0.0;
        if any(|wanted| wanted.hdr || wanted.hdr_stays) || (is_exact && any(|wanted| wanted.hdr_streamed)) {
            Output::Hdr
        } else if any(|wanted| wanted.hdr_streamed) {
            Output::HdrStream
        } else {
            Output::Display
        }
    }

    /// Returns the buffers to read back from a frame of display images and from a frame of HDR images, if two separate frames are needed.
    pub(super) fn outputs(&self) -> Option<[Vec<Wanted>; 2]> {
        let wanted = self.given_views();
        let apart = self.output.is_none() && self.presentations.is_empty() && {
            let viewports = self.rig.viewports(glam::DQuat::IDENTITY);
            draws_outputs_apart(self.settings, &self.scene.objects, &viewports)
        };
        let both = self.output() != Output::Display && wanted.iter().any(|wanted| wanted.display);
        (apart && both).then(|| {
            let display = |wanted: &Wanted| Wanted { hdr: false, hdr_streamed: false, hdr_stays: false, ..*wanted };
            let hdr = |wanted: &Wanted| Wanted { display: false, ..*wanted };
            [wanted.iter().map(display).collect(), wanted.iter().map(hdr).collect()]
        })
    }

    /// Returns the buffers to read back for each view, as given.
    fn given_views(&self) -> Cow<'a, [Wanted]> {
        match self.wanted {
            WantedViews::Every(wanted) => Cow::Owned(vec![wanted; self.rig.views().len()]),
            WantedViews::Each(wanted) => Cow::Borrowed(wanted),
        }
    }

    /// Returns the buffers to read back for each view. HDR images for streams are listed like other HDR images; [`Self::output`] contains their error
    /// budget.
    pub fn wanted_views(&self) -> Vec<Wanted> {
        let reads = |wanted: &Wanted| Wanted { hdr: wanted.reads_hdr(), hdr_streamed: false, ..*wanted };
        self.given_views().iter().map(reads).collect()
    }
}

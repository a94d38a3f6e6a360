//! What a frame is asked to be: the scene, the views, and options.

use std::{borrow::Cow, sync::LazyLock};

use super::{Presentation, Wanted};
#[cfg(doc)]
use super::{RenderError, Renderer};
use crate::{
    plan::{Output, budget::draws_outputs_apart, settings::RenderSettings, view_settings::FrameGroup},
    scene::SceneSnapshot,
    view::Rig,
};

/// What frames without settings of their own are drawn with.
static DEFAULT_SETTINGS: LazyLock<RenderSettings> = LazyLock::new(RenderSettings::default);

/// One frame of all views of a rig, for [`Renderer::render`] and [`Renderer::submit`].
///
/// Without options it is drawn with the default [`RenderSettings`], the display image of every view is read back, and
/// automatic exposure shows it as to an eye that has fully adapted.
///
/// ```
/// # use steradian::{FrameRequest, Rig, SceneSnapshot, Wanted};
/// # fn requests(scene: &SceneSnapshot, rig: &Rig) {
/// let shown = FrameRequest::new(scene, rig);
/// let measured = FrameRequest::new(scene, rig).wanted(Wanted::hdr()).adapted_ev100(-3.0);
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use = "a request draws nothing: hand it to a renderer"]
pub struct FrameRequest<'a> {
    pub(super) scene: &'a SceneSnapshot,
    pub(super) rig: &'a Rig,
    pub(super) settings: &'a RenderSettings,
    pub(super) adapted_ev100: Option<f64>,
    pub(super) presentations: &'a [Presentation<'a>],
    wanted: WantedViews<'a>,
    output: Option<Output>,
    pub(super) sky_map: SkyMapUse,
    /// Number of the series that the frame belongs to, and how many there are.
    pub(super) series: [usize; 2],
    /// The views that an automatic exposure is found for, and the settings that it is found with.
    pub(super) exposed_as: Option<(&'a Rig, &'a RenderSettings)>,
}

/// What a frame does that may read a map of faint light where none is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SkyMapUse {
    /// It waits for one.
    #[default]
    Wait,
    /// It makes a part of one and draws every star by itself meanwhile.
    InTurn,
    /// It draws every star by itself.
    Off,
}

#[derive(Clone, Copy, Debug)]
enum WantedViews<'a> {
    Every(Wanted),
    Each(&'a [Wanted]),
}

impl<'a> FrameRequest<'a> {
    /// The display images of all views of `rig`, which is at the camera of `scene`.
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

    /// The display images of the views of one of the frames that [`frame_groups`](crate::plan::view_settings::frame_groups) has made
    /// of a rig. The renderer keeps maps of glare and of faint stars for each of them, so that they may be drawn in turn.
    ///
    /// # Panics
    ///
    /// There is no group of that number.
    pub fn of_group(scene: &'a SceneSnapshot, groups: &'a [FrameGroup], number: usize) -> Self {
        let group = &groups[number];
        let exposed_as = group.exposed_as.as_ref().map(|(rig, settings)| (rig, settings));
        let series = [number, groups.len()];
        Self { series, exposed_as, ..Self::new(scene, &group.rig).settings(&group.settings) }
    }

    /// How it is drawn.
    pub fn settings(self, settings: &'a RenderSettings) -> Self {
        Self { settings, ..self }
    }

    /// What to read back of every view.
    pub fn wanted(self, wanted: Wanted) -> Self {
        Self { wanted: WantedViews::Every(wanted), ..self }
    }

    /// What to read back of each view, in the order of the rig. A frame is refused with [`RenderError::WantedCount`] where there
    /// are not as many as views.
    pub fn wanted_of_each(self, wanted: &'a [Wanted]) -> Self {
        Self { wanted: WantedViews::Each(wanted), ..self }
    }

    /// With automatic exposure, the exposure to show the frame with (EV at ISO 100): that of an eye that adapts over time.
    /// `None` is the same as no such call.
    pub fn adapted_ev100(self, adapted_ev100: impl Into<Option<f64>>) -> Self {
        Self { adapted_ev100: adapted_ev100.into(), ..self }
    }

    /// Textures to draw images into, in the same submission, besides what is read back.
    pub fn presentations(self, presentations: &'a [Presentation<'a>]) -> Self {
        Self { presentations, ..self }
    }

    /// What to do where display images may read a map of faint light and none is there.
    pub fn sky_map(self, sky_map: SkyMapUse) -> Self {
        Self { sky_map, ..self }
    }

    /// The scene, with its camera.
    pub fn get_scene(&self) -> &'a SceneSnapshot {
        self.scene
    }

    /// The views.
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

    /// Draws within the budget of that output, whatever is read back: to measure what a budget costs.
    #[doc(hidden)]
    pub fn drawn_for(self, output: Output) -> Self {
        Self { output: Some(output), ..self }
    }

    /// What the frame is for: its budget.
    pub(super) fn output(&self) -> Output {
        if let Some(output) = self.output {
            return output;
        }
        let exact = |wanted: &Wanted| wanted.hdr || wanted.hdr_stays;
        if self.wanted_views().iter().any(exact) { Output::Hdr } else { Output::Display }
    }

    /// What to read back in a frame of display images and in one of HDR images, where these are two frames.
    pub(super) fn outputs(&self) -> Option<[Vec<Wanted>; 2]> {
        let wanted = self.wanted_views();
        let apart = self.output.is_none() && self.presentations.is_empty() && {
            let viewports = self.rig.viewports(glam::DQuat::IDENTITY);
            draws_outputs_apart(self.settings, &self.scene.objects, &viewports)
        };
        let both = self.output() == Output::Hdr && wanted.iter().any(|wanted| wanted.display);
        (apart && both).then(|| {
            let shown = |wanted: &Wanted| Wanted { hdr: false, hdr_stays: false, ..*wanted };
            let exact = |wanted: &Wanted| Wanted { display: false, ..*wanted };
            [wanted.iter().map(shown).collect(), wanted.iter().map(exact).collect()]
        })
    }

    /// What to read back, view by view.
    pub fn wanted_views(&self) -> Cow<'a, [Wanted]> {
        match self.wanted {
            WantedViews::Every(wanted) => Cow::Owned(vec![wanted; self.rig.views().len()]),
            WantedViews::Each(wanted) => Cow::Borrowed(wanted),
        }
    }
}

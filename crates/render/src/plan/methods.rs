//! Decisions that follow from the settings alone, and decisions that are the same for all frames of given objects and views. They determine the
//! resident data and the pipelines before the first plan.

use super::{
    Limits,
    budget::{ErrorBudget, Output, draws_outputs_apart, may_have_veil_in_sums},
    display::{is_scattered_after, resolves_to_display},
    glare::GlareMap,
    plain_blocks::plain_spacings,
    settings::{Accumulator, Culling, GlareMethod, ImpostorMethod, RenderSettings, StarMethod, ToneMapSettings},
};
use crate::{scene::SceneObjects, view::Viewport};

/// Methods and parameters of all frames with the same settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Methods {
    /// Star method.
    pub stars: StarMethod,
    /// Glare method; never `auto`.
    pub glare: GlareMethod,
    /// Parameters of the glare map of `sky_cube`.
    pub glare_map: GlareMap,
    /// Impostor method; never `auto`. `None`: all asteroids are meshes or points.
    pub impostors: Option<ImpostorMethod>,
}

impl Methods {
    /// Methods of frames with these settings.
    pub fn new(settings: &RenderSettings) -> Self {
        Self {
            stars: settings.stars.method,
            glare: settings.glare.chosen(settings.stars.method),
            glare_map: GlareMap::new(settings),
            impostors: settings.asteroids.drawn_impostors(),
        }
    }

    /// Whether light is summed in fixed point, for the resolve pass to convert to luminance.
    pub fn adds_up(&self) -> bool {
        self.stars.accumulator() == Accumulator::FixedPoint
    }
}

/// Properties that all frames of the same objects and views with the same settings have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    limits: Limits,
    /// Methods of the frames.
    pub methods: Methods,
    /// Display transform.
    pub tone_map: ToneMapSettings,
    /// Whether display and HDR images are drawn as separate frames.
    pub draws_outputs_apart: bool,
    /// Whether frames with display images only may include the veil of single sources in their sums of light: see
    /// [`super::GlarePlan::in_sums`].
    pub may_have_veil_in_sums: bool,
    /// Whether some frames with display images only have plain blocks, and whether some have none.
    has_plain: (bool, bool),
    /// Whether a frame may be drawn before its exposure is known.
    pub may_be_metered: bool,
    /// Whether asteroids are culled on the adapter.
    pub culls_on_gpu: bool,
    /// See [`ErrorBudget::allows_short_codes`], for frames with display images only.
    pub has_short_codes: bool,
}

impl Forecast {
    /// Properties of frames of these objects in these viewports.
    pub fn new(settings: &RenderSettings, objects: &SceneObjects, viewports: &[Viewport], limits: &Limits) -> Self {
        let spacings = plain_spacings(viewports, objects.surroundings.is_some());
        let draws_outputs_apart = draws_outputs_apart(settings, objects, viewports);
        let is_possible = limits.fuses_display && draws_outputs_apart;
        let has_plain =
            (is_possible && spacings.iter().any(Option::is_some), !is_possible || spacings.iter().any(Option::is_none));
        Self {
            limits: *limits,
            methods: Methods::new(settings),
            tone_map: settings.tone_map,
            draws_outputs_apart,
            may_have_veil_in_sums: may_have_veil_in_sums(settings, objects, viewports),
            has_plain,
            may_be_metered: settings.exposure.is_metered(),
            culls_on_gpu: settings.asteroids.culling == Culling::Gpu,
            has_short_codes: draws_outputs_apart
                && ErrorBudget::of_output(&settings.accuracy, Output::Display)
                    .is_some_and(ErrorBudget::allows_short_codes),
        }
    }

    /// For each kind of frame with display images only, whether it has plain blocks: frames of some of the views may have none.
    pub fn plain_forms(&self) -> &'static [bool] {
        match self.has_plain {
            (true, true) => &[true, false],
            (true, false) => &[true],
            _ => &[false],
        }
    }

    /// For each kind of frame, whether its exposure is known before it is drawn: with metering, the first frame is metered and later ones
    /// may use an adapted exposure.
    pub fn known_exposures(&self) -> &'static [bool] {
        if self.may_be_metered { &[false, true] } else { &[true] }
    }

    /// See [`super::DisplayPlan::is_scattered_after`], for frames with or without the veil in their sums.
    pub fn is_scattered_after(&self, has_veil_in_sums: bool) -> bool {
        is_scattered_after(self.methods.glare, has_veil_in_sums)
    }

    /// See [`super::DisplayPlan::resolves_to_display`].
    pub fn resolves_to_display(&self, exposure_is_known: bool, has_veil_in_sums: bool) -> bool {
        let scattered = self.is_scattered_after(has_veil_in_sums);
        resolves_to_display(&self.limits, exposure_is_known, scattered, self.methods.adds_up())
    }
}

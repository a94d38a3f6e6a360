//! The interface of techniques in a plan, and its inputs.
//!
//! A technique owns one part of the [`Plan`] and the data that it keeps from plan to plan. [`super::sequence`] lists the techniques. Order of calls
//! for a plan: [`Technique::check_rig`], [`Technique::check`], then [`Technique::plan`] step by step. A technique may read the parts that
//! earlier steps, or earlier techniques of the same step, have completed.

use std::sync::Arc;

use super::{
    ExposureSource, Limits, Output, Plan, PlanError, SkyUse, asteroids::glare::Cloud, kept::Kept, methods::Methods,
    settings::RenderSettings,
};
use crate::{
    scene::{SceneObjects, SceneSnapshot, bodies::Sun},
    view::Rig,
};

/// Step of a plan. The results of one step are complete before the next one reads them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Find the objects of each viewport: air, bodies, asteroids.
    Objects,
    /// Find the light that scatters in the eye.
    Scatter,
    /// Find the planned exposure.
    Exposure,
    /// Find the error that display images may have.
    Budget,
    /// Select stars and diffuse light, and choose the units of the sums of light.
    Light,
    /// Report the approximations, and plan the overlays.
    Report,
}

impl Step {
    /// All steps in order.
    pub const ALL: [Self; 6] = [Self::Objects, Self::Scatter, Self::Exposure, Self::Budget, Self::Light, Self::Report];
}

/// Inputs of [`Technique::check`].
#[derive(Clone, Copy)]
pub(super) struct CheckInputs<'a> {
    pub scene: &'a SceneSnapshot,
    pub settings: &'a RenderSettings,
    pub methods: &'a Methods,
}

/// Inputs of [`Technique::plan`].
#[derive(Clone, Copy)]
pub(super) struct PlanInputs<'a> {
    pub scene: &'a SceneSnapshot,
    pub rig: &'a Rig,
    pub settings: &'a RenderSettings,
    pub methods: &'a Methods,
    pub limits: &'a Limits,
    /// Exposure to show the frame with, if automatic exposure has adapted to one.
    pub adapted_ev100: Option<f64>,
    pub output: Output,
    pub sky: SkyUse,
    /// Source of an automatic exposure.
    pub exposure: ExposureSource,
    /// Objects of the scene as its camera sees them.
    pub objects: &'a Arc<SceneObjects>,
    /// Light sources among the objects.
    pub suns: &'a [Sun],
    /// Asteroid fields as the eye of each viewport sees them; empty without fields.
    pub clouds: &'a [Vec<Cloud>],
    /// Distance beyond the border of a picture from which the widest kernel reaches into it, pixels.
    pub margin_px: f64,
    /// Whether to skip chunks of stars outside every view.
    pub culling: bool,
    /// Whether to ask for pages of a deep store that are not in memory.
    pub asks_for_pages: bool,
    /// Whether stars of a deep store may be read while the frame is drawn.
    pub streams_stars: bool,
    /// Factor on the fixed-point units.
    pub unit_factor: f64,
}

/// Technique of a plan.
pub(super) trait Technique {
    /// Checks that the technique can draw into the views of a rig.
    fn check_rig(&self, _rig: &Rig, _settings: &RenderSettings, _limits: &Limits) -> Result<(), PlanError> {
        Ok(())
    }

    /// Checks that the technique can draw a scene in any view, and computes data that depends on the settings alone. Results of an earlier
    /// call are reused.
    fn check(&mut self, _inputs: &CheckInputs<'_>, _kept: &mut Kept) -> Result<(), PlanError> {
        Ok(())
    }

    /// Adds the results of a step to the technique's part of the plan.
    fn plan(&mut self, step: Step, inputs: &PlanInputs<'_>, kept: &mut Kept, plan: &mut Plan) -> Result<(), PlanError>;
}

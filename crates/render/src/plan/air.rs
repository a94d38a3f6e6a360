//! Ground and air around the camera.

use std::sync::Arc;

use super::{
    Plan, PlanError,
    kept::Kept,
    technique::{PlanInputs, Step, Technique},
};
use crate::scene::surroundings::LocalSky;

/// Sine of the altitude below which the light added by the air is too curved for interpolation.
pub const GRID_FROM_SINE: f64 = 0.07;

/// Air of a frame.
#[derive(Clone, Default)]
pub struct AirPlan {
    /// The ground and the air around the camera; `None`: space.
    pub sky: Option<Arc<LocalSky>>,
    /// Whether sky light is interpolated between grid points. It is if display images may have an error.
    pub from_grid: bool,
}

/// Plans [`AirPlan`].
pub(super) struct Air;

impl Technique for Air {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Objects => plan.air.sky.clone_from(&inputs.objects.local_sky),
            Step::Light => plan.air.from_grid = plan.display.step_cd_m2.is_some(),
            _ => {}
        }
        Ok(())
    }
}

//! Bodies in a plan: which of them each viewport shows, and the light that they send to its eye.

pub mod blocks;
pub mod light;
mod meeting;
mod ring_light;
pub mod seen;
pub mod textures;

use self::seen::plan_bodies;
use super::{
    Plan, PlanError,
    kept::Kept,
    technique::{PlanInputs, Step, Technique},
};

/// Plans the bodies of a frame.
pub(super) struct Bodies;

impl Technique for Bodies {
    fn plan(&mut self, step: Step, inputs: &PlanInputs<'_>, kept: &mut Kept, plan: &mut Plan) -> Result<(), PlanError> {
        if step == Step::Objects && !inputs.objects.is_empty() {
            let PlanInputs { scene, objects, suns, margin_px, .. } = *inputs;
            let (lights, viewports) = (&mut kept.lights, &plan.views.viewports);
            plan.bodies = Some(plan_bodies(objects, suns, lights, scene.camera.position_m, viewports, margin_px));
        }
        Ok(())
    }
}

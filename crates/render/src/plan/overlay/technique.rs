//! Lines and text over the display images of a frame.

use super::{OverlayInputs, OverlayPlanner};
use crate::plan::{
    Plan, PlanError,
    kept::Kept,
    technique::{PlanInputs, Step, Technique},
};

impl Technique for OverlayPlanner {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        if step == Step::Report {
            let views: Vec<String> = inputs.rig.views().iter().map(|view| view.name.clone()).collect();
            let overlay_inputs = OverlayInputs {
                objects: &inputs.scene.objects,
                camera: &inputs.scene.camera,
                viewports: &plan.views.viewports,
                views: &views,
            };
            plan.overlay = self.plan(&overlay_inputs)?;
        }
        Ok(())
    }
}

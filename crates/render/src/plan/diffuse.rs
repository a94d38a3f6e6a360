//! Diffuse light from the whole sky, such as the Milky Way and the zodiacal light: light that does not belong to single
//! stars.

use std::sync::Arc;

use super::{
    Plan, PlanError, SkyUse,
    budget::are_smooth,
    kept::Kept,
    technique::{PlanInputs, Step, Technique},
};
use crate::catalogue::{diffuse::DiffuseSky, zodiacal_light::ZodiacalLight};

/// Diffuse light of a frame.
#[derive(Clone)]
pub struct DiffusePlan {
    /// Light from beyond the Solar System; `None`: there is none.
    pub sky: Option<Arc<DiffuseSky>>,
    /// Zodiacal light; `None`: it is not drawn.
    pub zodiacal: Option<ZodiacalLight>,
    /// Greatest error of light that is interpolated between grid points, cd/m^2; `None`: every pixel reads the light individually.
    pub step_cd_m2: Option<f64>,
}

/// Plans [`DiffusePlan`].
pub(super) struct Diffuse;

impl Technique for Diffuse {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Light => {
                // Pictures of a map of faint light contain only stars, and published methods draw only stars, as published.
                let is_drawn = !matches!(inputs.sky, SkyUse::Part(_)) && inputs.methods.adds_up();
                let step_cd_m2 = plan
                    .display
                    .step_cd_m2
                    .filter(|_| plan.views.motion.is_none() && are_smooth(&plan.views.viewports));
                let (sky, zodiacal) = (inputs.scene.stars.unresolved.clone(), inputs.objects.zodiacal_light());
                let is_dark = sky.is_none() && zodiacal.is_none();
                plan.diffuse = (is_drawn && !is_dark).then_some(DiffusePlan { sky, zodiacal, step_cd_m2 });
            }
            Step::Report => {
                let interpolated = plan.diffuse.as_ref().and_then(|diffuse| diffuse.step_cd_m2);
                let budget = plan.display.budget.filter(|_| interpolated.is_some());
                let name = "diffuse light, interpolated where it is smooth";
                plan.report.certificate.extend(budget.map(|budget| budget.bound(name, 1.0)));
            }
            _ => {}
        }
        Ok(())
    }
}

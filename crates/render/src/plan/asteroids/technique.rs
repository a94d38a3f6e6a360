//! Asteroid fields of a frame.

use glam::DVec3;

use super::{AsteroidInputs, AsteroidPlan, Tables};
use crate::plan::{
    Plan, PlanError,
    bodies::seen::PointSource,
    kept::Kept,
    technique::{PlanInputs, Step, Technique},
};

/// Plans the asteroids of a frame, and keeps tables of directions.
#[derive(Default)]
pub(in crate::plan) struct Asteroids {
    tables: Tables,
}

impl Asteroids {
    /// Plans the fields. Groups that are drawn as points of light are added to the points of the bodies.
    fn plan_fields(&mut self, inputs: &PlanInputs<'_>, plan: &mut Plan) -> Result<(), PlanError> {
        let objects = inputs.objects;
        let field_inputs = AsteroidInputs {
            objects,
            settings: &inputs.settings.asteroids,
            viewports: &plan.views.viewports,
            margin_px: inputs.margin_px,
            camera_m: inputs.scene.camera.position_m,
            suns: inputs.suns,
            limits: inputs.limits,
        };
        plan.asteroids = AsteroidPlan::new(&field_inputs, &mut self.tables)?;
        if let (Some(bodies), Some(asteroids)) = (&mut plan.bodies, &plan.asteroids) {
            let through_air = |point: PointSource| {
                let sky = objects.local_sky.as_ref();
                let transmission = sky.map(|sky| sky.transmission(point.offset_m.normalize_or(DVec3::Y)));
                let factor = |c: usize| transmission.map_or(1.0, |transmission| transmission[c]);
                PointSource { intensity_cd: [0, 1, 2].map(|c| point.intensity_cd[c] * factor(c)), ..point }
            };
            bodies.points.extend(asteroids.cut.unresolved.iter().map(|node| through_air(node.point)));
        }
        Ok(())
    }
}

impl Technique for Asteroids {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Objects => self.plan_fields(inputs, plan)?,
            Step::Report => {
                let certificate = plan.asteroids.iter().flat_map(|asteroids| asteroids.certificate.iter().cloned());
                plan.report.certificate.extend(certificate);
            }
            _ => {}
        }
        Ok(())
    }
}

//! Order of a plan: the techniques, and the steps in which they plan.

use super::{
    Plan, PlanError,
    air::Air,
    asteroids::Asteroids,
    bodies::Bodies,
    diffuse::Diffuse,
    display::Display,
    exposure::Exposure,
    glare::Glare,
    kept::Kept,
    overlay::OverlayPlanner,
    smooth_light::SmoothLight,
    stars::Stars,
    technique::{PlanInputs, Step, Technique},
};

/// Techniques, usable from any thread.
pub(super) type Techniques = Vec<Box<dyn Technique + Send + Sync>>;

/// Creates all techniques. Within a step they plan in this order.
pub(super) fn techniques() -> Techniques {
    vec![
        Box::new(Air),
        Box::new(Bodies),
        Box::new(Exposure),
        Box::new(Display::default()),
        Box::new(SmoothLight::default()),
        Box::new(Stars::default()),
        Box::new(Glare),
        Box::new(Diffuse),
        Box::new(Asteroids::default()),
        Box::new(OverlayPlanner::default()),
    ]
}

/// Plans all parts, step by step.
pub(super) fn plan(
    techniques: &mut Techniques,
    inputs: &PlanInputs<'_>,
    kept: &mut Kept,
    plan: &mut Plan,
) -> Result<(), PlanError> {
    for step in Step::ALL {
        for technique in techniques.iter_mut() {
            technique.plan(step, inputs, kept, plan)?;
        }
    }
    Ok(())
}

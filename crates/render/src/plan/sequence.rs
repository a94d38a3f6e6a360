//! The parts of a plan, the techniques that compute them, and the steps of this computation.

use std::sync::Arc;

use super::{
    AirPlan, DiffusePlan, DisplayPlan, ExposurePlan, FramePlan, GlarePlan, PlanError, SmoothLightPlan, StarsPlan,
    ViewsPlan,
    air::Air,
    asteroids::{AsteroidPlan, Asteroids},
    bodies::{Bodies, seen::BodyPlan},
    diffuse::Diffuse,
    display::Display,
    exposure::Exposure,
    glare::Glare,
    kept::Kept,
    overlay::{OverlayPlan, OverlayPlanner},
    plain_blocks::{PlainBlocks, PlainBlocksPlan},
    smooth_light::SmoothLight,
    stars::Stars,
    technique::{PlanInputs, Step, Technique},
};

/// The plan of a frame, by technique.
#[derive(Clone, Default)]
pub struct Plan {
    /// Methods by name, and the certificate.
    pub report: FramePlan,
    /// Viewports, tiles and camera.
    pub views: ViewsPlan,
    /// Ground and air around the camera.
    pub air: AirPlan,
    /// Bodies, and points of light that are not stars; `None`: the scene has neither bodies nor asteroid fields.
    pub bodies: Option<BodyPlan>,
    /// Exposure.
    pub exposure: ExposurePlan,
    /// Display images.
    pub display: DisplayPlan,
    /// Plain blocks of display images; `None`: there are none.
    pub plain_blocks: Option<PlainBlocksPlan>,
    /// The map of faint light.
    pub smooth_light: SmoothLightPlan,
    /// Stars, and the units of all light.
    pub stars: StarsPlan,
    /// Glare.
    pub glare: GlarePlan,
    /// Diffuse light; `None`: there is none, or it is not drawn.
    pub diffuse: Option<DiffusePlan>,
    /// Asteroid fields; `None`: there are none.
    pub asteroids: Option<AsteroidPlan>,
    /// Lines and text over display images; `None`: there are none.
    pub overlay: Option<Arc<OverlayPlan>>,
}

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
        Box::new(PlainBlocks),
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

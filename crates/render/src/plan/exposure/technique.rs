//! Planned exposure of a frame.

use super::{DisplayedStars, guard::Lit, planned_ev100};
use crate::{
    plan::{
        ExposureSource, Plan, PlanError, SkyUse,
        asteroids::glare::clouds_of,
        bodies::seen::{BodyPlan, plan_bodies},
        kept::Kept,
        methods::Methods,
        settings::{ExposureSettings, GlareMethod, RenderSettings},
        stars::cull::{SPLAT_MARGIN_PX, VisibleChunk},
        technique::{PlanInputs, Step, Technique},
    },
    scene::{SceneSnapshot, bodies::suns},
    view::{Rig, Viewport},
};

/// Exposure of a frame.
#[derive(Clone, Debug, Default)]
pub struct ExposurePlan {
    /// Exposure of the display images; `None`: it is not known before the frame is drawn.
    pub known_ev100: Option<f64>,
    /// Exposure to adapt to, if it follows from the plan; `None`: it is metered.
    pub planned_ev100: Option<f64>,
    /// Exposure whose display white is the luminance that the frame shows as white, if it is known. It is either the known exposure or that of the
    /// display transform.
    pub known_white_ev100: Option<f64>,
    /// `known_white_ev100` if it is known, otherwise an estimate from the light in view, accurate to a fraction of a stop. `None`: there is nothing
    /// in view.
    pub expected_ev100: Option<f64>,
    /// Parameters of metering.
    pub metering: MeteringPlan,
    /// Stars that are visible in the display images.
    pub displayed_stars: DisplayedStars,
}

/// Parameters of metering by mean luminance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeteringPlan {
    /// Lowest exposure value.
    pub min_ev100: f64,
    /// Highest exposure value.
    pub max_ev100: f64,
    /// Offset to the exposure value of a standard meter, from key and compensation.
    pub offset_ev: f64,
}

impl MeteringPlan {
    /// Parameters for these settings.
    pub fn new(settings: &ExposureSettings) -> Self {
        // A manual exposure is metered too, for statistics.
        let auto = settings.auto_or_default();
        Self { min_ev100: auto.min_ev100, max_ev100: auto.max_ev100, offset_ev: auto.offset_ev() }
    }
}

/// Plans [`ExposurePlan`].
pub(in crate::plan) struct Exposure;

impl Exposure {
    /// Finds the exposure that follows from the plan.
    fn plan_exposure(inputs: &PlanInputs<'_>, kept: &mut Kept, plan: &mut Plan) {
        let settings = inputs.settings;
        // The pictures of a map of faint light have the exposure of the frames that use the map.
        let is_of_map = matches!(inputs.sky, SkyUse::Part(_));
        let viewports: &[Viewport] = if is_of_map { &[] } else { &plan.views.all_viewports };
        let pictures = kept.pictures.for_viewports(viewports);
        let displayed_stars = DisplayedStars::new(settings, viewports, &pictures);
        let planned_ev100 = if let ExposureSource::Planned(ev100) = inputs.exposure {
            Some(ev100)
        } else {
            let kernel = kept.kernel().filter(|_| plan.glare.method != GlareMethod::None);
            let lit = plan.bodies.as_ref().map(|bodies| Lit {
                objects: inputs.objects,
                suns: inputs.suns,
                camera_m: inputs.scene.camera.position_m,
                viewports: &plan.views.viewports,
                bodies,
                clouds: inputs.clouds,
                glare: kernel.map(|kernel| (&**kernel, plan.glare.fraction)),
            });
            rounded(planned_ev100(settings, &displayed_stars, &pictures, lit.as_ref()))
        };
        let known_ev100 = settings.exposure.known_ev100(inputs.adapted_ev100, planned_ev100);
        plan.exposure = ExposurePlan {
            known_ev100,
            planned_ev100,
            known_white_ev100: settings.known_white_ev100(known_ev100),
            expected_ev100: None,
            metering: MeteringPlan::new(&settings.exposure),
            displayed_stars,
        };
    }

    /// Estimates an unknown exposure from the stars and objects in view, and from the mean luminance of air and diffuse light.
    fn expected_ev100(inputs: &PlanInputs<'_>, plan: &Plan) -> Option<f64> {
        let air_cd_m2 = inputs.objects.local_sky.as_ref().map_or(0.0, |sky| sky.mean_cd_m2);
        let zodiacal = inputs.objects.zodiacal_light().map(|light| light.sky);
        let diffuse_cd_m2: f64 =
            inputs.scene.stars.unresolved.iter().chain(&zodiacal).map(|diffuse| diffuse.mean_cd_m2()).sum();
        let deep_cd_m2 =
            inputs.scene.stars.deep.as_ref().map_or(0.0, |deep| deep.total_lx() / (4.0 * std::f64::consts::PI));
        let total_solid_angle_sr = plan.views.total_solid_angle_sr;
        let air_lx = (air_cd_m2 + diffuse_cd_m2 + deep_cd_m2) * total_solid_angle_sr;
        let (visible, bodies) = (&plan.stars.visible, plan.bodies.as_ref());
        expected_ev100(visible, bodies, air_lx, total_solid_angle_sr, &inputs.settings.exposure)
    }
}

impl Technique for Exposure {
    fn plan(&mut self, step: Step, inputs: &PlanInputs<'_>, kept: &mut Kept, plan: &mut Plan) -> Result<(), PlanError> {
        match step {
            Step::Exposure => Self::plan_exposure(inputs, kept, plan),
            Step::Budget => {
                plan.exposure.expected_ev100 = match plan.exposure.known_white_ev100 {
                    Some(ev100) => Some(ev100),
                    None => Self::expected_ev100(inputs, plan),
                };
            }
            _ => {}
        }
        Ok(())
    }
}

/// The planned exposure of views, without the rest of their plan.
pub(in crate::plan) fn exposure_of_views(
    kept: &mut Kept,
    scene: &SceneSnapshot,
    rig: &Rig,
    settings: &RenderSettings,
) -> Option<f64> {
    let viewports = rig.viewports(scene.camera.world_from_camera);
    let pictures = kept.pictures.for_viewports(&viewports);
    let stars = DisplayedStars::new(settings, &viewports, &pictures);
    if scene.objects.is_empty() {
        return rounded(planned_ev100(settings, &stars, &pictures, None));
    }
    // Objects, and the light that they scatter in the eye.
    let camera_m = scene.camera.position_m;
    let objects = kept.objects_seen(scene);
    let suns = suns(&objects);
    let bodies = plan_bodies(&objects, &suns, &mut kept.lights, camera_m, &viewports, SPLAT_MARGIN_PX);
    let clouds = clouds_of(&objects, &suns, camera_m, &viewports);
    let kernel = kept.kernel().filter(|_| Methods::new(settings).glare != GlareMethod::None);
    let lit = Lit {
        objects: &objects,
        suns: &suns,
        camera_m,
        viewports: &viewports,
        bodies: &bodies,
        clouds: &clouds,
        glare: kernel.map(|kernel| (&**kernel, settings.glare.fraction_scattered())),
    };
    rounded(planned_ev100(settings, &stars, &pictures, Some(&lit)))
}

/// Rounds to f32, as frames report their exposure: a frame that has adapted to a planned exposure uses exactly the same value.
fn rounded(ev100: Option<f64>) -> Option<f64> {
    ev100.map(|ev100| f64::from(ev100 as f32))
}

/// Estimate of the exposure that will be metered, from the positions of the stars, accurate to a fraction of a stop.
fn expected_ev100(
    visible: &[VisibleChunk],
    bodies: Option<&BodyPlan>,
    air_lx: f64,
    total_solid_angle_sr: f64,
    settings: &ExposureSettings,
) -> Option<f64> {
    if total_solid_angle_sr <= 0.0 {
        return None;
    }
    let stars_lx: f64 = visible.iter().map(|chunk| chunk.total_lx * f64::from(chunk.viewports.count_ones())).sum();
    let light_lx = stars_lx + air_lx + bodies.map_or(0.0, BodyPlan::light_in_view_lx);
    Some(settings.metered_ev100(light_lx / total_solid_angle_sr))
}

//! Glare of a frame: its method, its sources besides the stars, and where it is added.

use std::sync::Arc;

use super::{
    objects::ExtendedSource,
    settings::{GlareMethod, PyramidWeights},
};
use crate::{
    photometry::glare::{GlareKernel, GlareKernelName},
    plan::{
        Approximation, Plan, PlanError,
        budget::may_have_veil_in_sums,
        kept::Kept,
        settings::RenderSettings,
        technique::{CheckInputs, PlanInputs, Step, Technique},
    },
    units::illuminance_lx_from_magnitude,
};

/// Glare of a frame.
#[derive(Clone, Default)]
pub struct GlarePlan {
    /// Method; never `auto`.
    pub method: GlareMethod,
    /// Fraction of the light that is scattered.
    pub fraction: f64,
    /// Kernel of `sky_cube`.
    pub kernel: Option<Arc<dyn GlareKernel>>,
    /// Parameters of the map of `sky_cube`.
    pub map: GlareMap,
    /// Weights of the levels of a pyramid.
    pub weights: PyramidWeights,
    /// `sky_cube`: sources of glare from asteroid fields, for the eye of each viewport; empty without fields.
    pub extended_sources: Vec<Vec<ExtendedSource>>,
    /// `sky_cube` for frames within an error budget: the veil of single sources is added to the sums of light together with the stars,
    /// and the rest is read from a coarse grid. `None`: glare is added to the finished pictures.
    pub in_sums: Option<VeilInSums>,
}

/// Glare of frames within an error budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VeilInSums {
    /// Luminance below which a source's veil is part of the smooth remainder, cd/m^2, as if all light were scattered.
    pub least_cd_m2: f64,
    /// Further threshold, as a fraction of the glow of the night sky there, for images whose error may be relative to the luminance of a pixel. The
    /// larger one applies.
    pub least_of_glow: f64,
}

/// Parameters of the glare map of `sky_cube` that depend on the settings alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GlareMap {
    /// Fainter stars do not scatter, lx.
    pub faintest_lx: f64,
    /// Relative tolerance: greatest veil of a source that is not drawn individually, as a fraction of the veil around it.
    pub tolerance: f64,
    /// Inner angle of the inverse-square kernel, rad; `None`: the kernel is read from a table.
    pub inverse_square_rad: Option<f64>,
}

impl GlareMap {
    /// Parameters for these settings.
    pub fn new(settings: &RenderSettings) -> Self {
        let glare = &settings.glare;
        Self {
            faintest_lx: illuminance_lx_from_magnitude(settings.stars.magnitude_limit),
            tolerance: settings.accuracy.glare,
            inverse_square_rad: (glare.kernel == GlareKernelName::InverseSquare).then(|| glare.inner_deg.to_radians()),
        }
    }
}

impl GlarePlan {
    /// Fraction of the light of stars and points that the sums of light contain before glare is drawn.
    pub fn share_in_sums(&self) -> f64 {
        if self.in_sums.is_some() { 1.0 - self.fraction } else { 1.0 }
    }

    /// Factor on the luminance of surfaces that are smooth over degrees. A pass subtracts the scattered fraction of all light, but adds
    /// only the scattered light of stars and bodies. A smooth surface receives as much scattered light as it loses, so it is drawn
    /// brighter by the lost fraction.
    pub fn share_of_smooth_surfaces(&self) -> f64 {
        let is_subtracted = self.method == GlareMethod::SkyCube && self.fraction < 1.0;
        if is_subtracted { 1.0 / (1.0 - self.fraction) } else { 1.0 }
    }

    /// The same factor for smooth light that the resolve pass adds. If the veil is in the sums, nothing is subtracted after that pass.
    pub fn share_of_smooth_light(&self) -> f64 {
        if self.in_sums.is_some() { 1.0 } else { self.share_of_smooth_surfaces() }
    }
}

/// Error of the kernel at the transition from the map of the sky to individual sources. It is due to interpolation and was measured for all
/// projections.
const MAP_ERROR: f64 = 0.01;

/// Plans [`GlarePlan`].
pub(in crate::plan) struct Glare;

impl Glare {
    /// Plans the method and the sources. Discs of bodies keep the light that they scatter onto themselves.
    fn plan_sources(inputs: &PlanInputs<'_>, kept: &Kept, plan: &mut Plan) {
        let settings = &inputs.settings.glare;
        let mut glare = GlarePlan {
            method: inputs.methods.glare,
            fraction: settings.fraction_scattered(),
            map: inputs.methods.glare_map,
            weights: settings.weights,
            ..GlarePlan::default()
        };
        if glare.method == GlareMethod::SkyCube {
            glare.kernel = kept.kernel().cloned();
            if let (Some(bodies), Some(kernel)) = (&mut plan.bodies, &glare.kernel) {
                bodies.keep_own_glare(&**kernel, glare.fraction);
            }
            let sources = inputs.clouds.iter().map(|clouds| clouds.iter().map(|cloud| cloud.source).collect());
            glare.extended_sources = sources.collect();
        }
        plan.glare = glare;
    }

    /// Reports the method and the approximations of `sky_cube`. Published methods have no bounds.
    fn report(inputs: &PlanInputs<'_>, plan: &mut Plan) {
        let (method, tolerance) = (inputs.methods.glare, inputs.settings.accuracy.glare);
        if method == GlareMethod::SkyCube {
            let bound = |name: &str, bound: f64| {
                Approximation::new(name, bound, "relative to the scattered light there", Some(tolerance))
            };
            plan.report.certificate.push(bound("glare of a source too faint to be drawn individually", tolerance));
            plan.report.certificate.push(bound("glare far from its source, from a map of the sky", MAP_ERROR));
            if let Some(budget) = plan.display.budget.filter(|_| plan.glare.in_sums.is_some()) {
                let share = budget.most_of_one_veil();
                plan.report.certificate.push(budget.bound("veil of one source that is not drawn individually", share));
            }
        }
        let is_auto = inputs.settings.glare.method == GlareMethod::Auto;
        plan.report.glare = if is_auto { format!("auto: {}", method.name()) } else { method.name().to_owned() };
    }
}

impl Technique for Glare {
    fn check(&mut self, inputs: &CheckInputs<'_>, kept: &mut Kept) -> Result<(), PlanError> {
        let (stars, glare) = (inputs.methods.stars, inputs.methods.glare);
        if glare == GlareMethod::SkyCube && !stars.draws_catalogue() {
            return Err(PlanError::GlareOfCatalogue(stars.name()));
        }
        // The exposure uses the kernel to weight the glare of bodies, with any glare method.
        if glare == GlareMethod::SkyCube || (glare != GlareMethod::None && !inputs.scene.objects.is_empty()) {
            kept.hold_kernel(&inputs.settings.glare)?;
        }
        Ok(())
    }

    fn plan(&mut self, step: Step, inputs: &PlanInputs<'_>, kept: &mut Kept, plan: &mut Plan) -> Result<(), PlanError> {
        match step {
            Step::Scatter => Self::plan_sources(inputs, kept, plan),
            Step::Budget => {
                let (settings, all_viewports) = (inputs.settings, &plan.views.all_viewports);
                let may_have_veil = may_have_veil_in_sums(settings, inputs.objects, all_viewports);
                let budget = plan.display.step_cd_m2.zip(plan.display.budget).filter(|_| may_have_veil);
                let fraction = plan.glare.fraction;
                plan.glare.in_sums = budget.map(|(step, budget)| VeilInSums {
                    least_cd_m2: budget.share_of_one_veil() * step / fraction,
                    least_of_glow: budget.share_of_glow() / fraction,
                });
            }
            Step::Light => Self::report(inputs, plan),
            _ => {}
        }
        Ok(())
    }
}

//! Display images: their transform, the error that they may have, and the pass that writes them.

use super::{
    Approximation, Limits, Plan, PlanError,
    budget::{ErrorBudget, SHORT_CODES_ERROR, draws_outputs_apart},
    kept::Kept,
    settings::{GlareMethod, ToneMapSettings},
    technique::{PlanInputs, Step, Technique},
};
use crate::photometry::exposure::white_luminance_cd_m2;

/// Change of a display image that may be visible, codes of 8 bits.
const SEEN_CODES: f64 = 0.5;

/// Display images of a frame.
#[derive(Clone, Default)]
pub struct DisplayPlan {
    /// Display transform.
    pub tone_map: ToneMapSettings,
    /// Error that the images may have; `None`: they are exact.
    pub budget: Option<ErrorBudget>,
    /// The least luminance that counts within the budget, cd/m^2.
    pub step_cd_m2: Option<f64>,
    /// Change of luminance that corresponds to [`SEEN_CODES`] where the transform is steepest, cd/m^2, whatever the budget; `None` without an
    /// expected exposure.
    pub seen_cd_m2: Option<f64>,
    /// Whether light is summed in fixed point, for the resolve pass to convert to luminance.
    pub adds_up: bool,
    /// Whether scattered light is added to pictures after the resolve pass.
    pub is_scattered_after: bool,
    /// Whether the resolve pass writes the display images. It does if the exposure is known in advance, no scattered light is added afterwards, and
    /// the adapter can do it ([`Limits::fuses_display`]).
    pub resolves_to_display: bool,
}

impl DisplayPlan {
    /// Whether the codes have short approximations: [`ErrorBudget::allows_short_codes`].
    pub fn has_short_codes(&self) -> bool {
        self.budget.is_some_and(ErrorBudget::allows_short_codes)
    }
}

/// See [`DisplayPlan::is_scattered_after`].
pub(super) fn is_scattered_after(glare: GlareMethod, has_veil_in_sums: bool) -> bool {
    glare != GlareMethod::None && !has_veil_in_sums
}

/// See [`DisplayPlan::resolves_to_display`].
pub(super) fn resolves_to_display(
    limits: &Limits,
    exposure_is_known: bool,
    is_scattered_after: bool,
    adds_up: bool,
) -> bool {
    limits.fuses_display && exposure_is_known && !is_scattered_after && adds_up
}

/// Plans [`DisplayPlan`], and keeps the greatest slope of the last display transform.
#[derive(Default)]
pub(super) struct Display {
    slope: Option<(ToneMapSettings, f64)>,
}

impl Display {
    /// See [`ToneMapSettings::greatest_slope`], which evaluates hundreds of luminances.
    fn slope_of(&mut self, tone_map: &ToneMapSettings) -> f64 {
        match self.slope {
            Some((held, slope)) if held == *tone_map => slope,
            _ => {
                let slope = tone_map.greatest_slope();
                self.slope = Some((*tone_map, slope));
                slope
            }
        }
    }
}

impl Technique for Display {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Budget => {
                let settings = inputs.settings;
                plan.display.tone_map = settings.tone_map;
                let all_viewports = &plan.views.all_viewports;
                let budget = ErrorBudget::of_output(&settings.accuracy, inputs.output)
                    .filter(|_| draws_outputs_apart(settings, inputs.objects, all_viewports));
                let white_cd_m2 = plan.exposure.expected_ev100.map_or(0.0, white_luminance_cd_m2);
                let slope = self.slope_of(&settings.tone_map);
                plan.display.seen_cd_m2 = ErrorBudget::Codes(SEEN_CODES).step_cd_m2(slope, white_cd_m2);
                if let Some(budget) = budget {
                    plan.display.step_cd_m2 = budget.step_cd_m2(slope, white_cd_m2);
                    plan.display.budget = plan.display.step_cd_m2.map(|_| budget);
                    plan.report.budget = plan.display.budget;
                }
            }
            Step::Light => {
                let display = &mut plan.display;
                display.adds_up = inputs.methods.adds_up();
                display.is_scattered_after = is_scattered_after(plan.glare.method, plan.glare.in_sums.is_some());
                let exposure_is_known = plan.exposure.known_ev100.is_some();
                display.resolves_to_display =
                    resolves_to_display(inputs.limits, exposure_is_known, display.is_scattered_after, display.adds_up);
            }
            Step::Report => {
                if let Some(ErrorBudget::Codes(budget)) =
                    plan.display.budget.filter(|budget| budget.allows_short_codes())
                {
                    let (name, unit) = ("codes from polynomials", "codes of 8 bits");
                    plan.report.certificate.push(Approximation::new(name, SHORT_CODES_ERROR, unit, Some(budget)));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

//! Ranges of the numbers in `[stars]`, `[exposure]` and `[accuracy]`, whose types are the planner's own.

use super::error::{Fault, finite};
use crate::plan::settings::{AccuracySettings, ExposureSettings, StarSettings};

pub(super) fn check_stars(stars: &StarSettings) -> Result<(), Fault> {
    finite("magnitude_limit", stars.magnitude_limit)
}

pub(super) fn check_exposure(exposure: &ExposureSettings) -> Result<(), Fault> {
    finite("ev100", exposure.ev100)?;
    finite("compensation_ev", exposure.compensation_ev)?;
    finite("min_ev100", exposure.min_ev100)?;
    finite("max_ev100", exposure.max_ev100)?;
    finite("adaptation_s", exposure.adaptation_s)?;
    if exposure.compensation_ev.abs() > 30.0 {
        return Err(Fault::new("compensation_ev", format!("{}: allowed are -30 to 30", exposure.compensation_ev)));
    }
    // Beyond +-100 the white luminance leaves the range of f32 together with the stars' light.
    for (key, value) in
        [("ev100", exposure.ev100), ("min_ev100", exposure.min_ev100), ("max_ev100", exposure.max_ev100)]
    {
        if value.abs() > 100.0 {
            return Err(Fault::new(key, format!("{value}: allowed are -100 to 100")));
        }
    }
    if exposure.min_ev100 > exposure.max_ev100 {
        let problem = format!("{} is above max_ev100 = {}: it must not be", exposure.min_ev100, exposure.max_ev100);
        return Err(Fault::new("min_ev100", problem));
    }
    if exposure.adaptation_s < 0.0 {
        return Err(Fault::new("adaptation_s", format!("{}: allowed are times from 0 s", exposure.adaptation_s)));
    }
    Ok(())
}

pub(super) fn check_accuracy(accuracy: &AccuracySettings) -> Result<(), Fault> {
    // Errors above these are no budget but a mistake: all of the light, or ten pixels.
    for (key, value, most) in
        [("flux", accuracy.flux, 1.0), ("centroid_px", accuracy.centroid_px, 10.0), ("flicker", accuracy.flicker, 1.0)]
    {
        finite(key, value)?;
        if value <= 0.0 || value > most {
            return Err(Fault::new(key, format!("{value}: allowed are error budgets above 0 up to {most}")));
        }
    }
    Ok(())
}

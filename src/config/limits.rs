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
    for (key, value) in [("flux", accuracy.flux), ("centroid_px", accuracy.centroid_px), ("flicker", accuracy.flicker)]
    {
        finite(key, value)?;
        if value <= 0.0 {
            return Err(Fault::new(key, format!("{value}: an error budget is above 0")));
        }
    }
    Ok(())
}

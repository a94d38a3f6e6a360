//! Ranges of the numbers in `[glare]`, whose types are the planner's own.

use super::error::{Fault, finite};
use crate::plan::settings::GlareSettings;

pub(super) fn check(glare: &GlareSettings) -> Result<(), Fault> {
    finite("inner_deg", glare.inner_deg)?;
    if !(glare.inner_deg > 0.0 && glare.inner_deg <= 180.0) {
        return Err(Fault::new("inner_deg", format!("{}: allowed are angles above 0 up to 180", glare.inner_deg)));
    }
    if !(0.0..=1.0).contains(&glare.fraction) {
        return Err(Fault::new("fraction", format!("{}: allowed are shares from 0 to 1", glare.fraction)));
    }
    Ok(())
}

//! Ranges of the numbers in `[glare]`, whose types are the planner's own.

use super::error::{Fault, finite};
use crate::{photometry::glare::GlareKernelName, plan::settings::GlareSettings};

pub(super) fn check(glare: &GlareSettings) -> Result<(), Fault> {
    finite("inner_deg", glare.inner_deg)?;
    if !(glare.inner_deg > 0.0 && glare.inner_deg <= 180.0) {
        return Err(Fault::new("inner_deg", format!("{}: allowed are angles above 0 up to 180", glare.inner_deg)));
    }
    if !(0.0..=1.0).contains(&glare.fraction) {
        return Err(Fault::new("fraction", format!("{}: allowed are shares from 0 to 1", glare.fraction)));
    }
    finite("age_years", glare.age_years)?;
    if !(0.0..=120.0).contains(&glare.age_years) {
        return Err(Fault::new("age_years", format!("{}: allowed are 0 to 120 years", glare.age_years)));
    }
    if glare.kernel == GlareKernelName::Psf && glare.psf_file.is_none() {
        let problem = "missing key: kernel = \"psf\" needs a file, CSV with the columns theta_deg,per_sr, EXR or FITS";
        return Err(Fault::new("psf_file", problem));
    }
    if glare.absolute {
        if glare.kernel != GlareKernelName::Cie {
            return Err(Fault::new("absolute", "true is allowed for kernel = \"cie\" only, the others are relative"));
        }
        let share = glare.fraction_scattered();
        if share > 1.0 {
            let (age, inner) = (glare.age_years, glare.inner_deg);
            let problem = format!(
                "true makes the kernel scatter {share:.2} of the light at age_years = {age} and inner_deg = {inner}: allowed is at most 1"
            );
            return Err(Fault::new("absolute", problem));
        }
    }
    Ok(())
}

//! Rules of `[stars]`, `[glare]`, `[exposure]` and `[tone_map]` that tie several keys together. The range of a single key stands
//! in [`super::ranges`] and has been checked before.

use toml::Table;

use super::effects;
use super::error::{Fault, finite};
use crate::{
    photometry::{
        glare::GlareKernelName,
        psf::{Aperture, PsfError},
    },
    plan::settings::{
        BillboardSettings, ExposureSettings, GaussianPsfSettings, GlareSettings, PsfTextureSettings, StarMethod,
        StarSettings, ToneMapSettings,
    },
};

pub(super) fn check_stars(stars: &StarSettings) -> Result<(), Fault> {
    check_billboard(&stars.billboard).map_err(|fault| fault.within("billboard"))?;
    check_gaussian_psf(&stars.gaussian_psf).map_err(|fault| fault.within("gaussian_psf"))?;
    check_psf_texture(&stars.psf_texture).map_err(|fault| fault.within("psf_texture"))
}

fn check_psf_texture(psf: &PsfTextureSettings) -> Result<(), Fault> {
    if Aperture::from_name(&psf.aperture, 6).is_none() {
        let problem = format!("`{}` is no aperture: allowed are {}", psf.aperture, Aperture::NAMES.join(", "));
        return Err(Fault::new("aperture", problem));
    }
    psf.check().map_err(|error| match error {
        PsfError::TooFine { allowed_steps, needed_steps, .. } => {
            // Steps of half a fringe in a texel go with the diameter, and were rounded up.
            let most = psf.diameter_mm * allowed_steps / needed_steps;
            let problem =
                format!("{}: at width_arcmin = {} allowed are at most {most:.3} mm", psf.diameter_mm, psf.width_arcmin);
            Fault::new("diameter_mm", problem)
        }
        error => Fault::new("", error.to_string()),
    })
}

fn check_billboard(billboard: &BillboardSettings) -> Result<(), Fault> {
    if billboard.brightest_magnitude >= billboard.faintest_magnitude {
        let (bright, faint) = (billboard.brightest_magnitude, billboard.faintest_magnitude);
        let problem = format!("{bright} must be brighter (smaller) than faintest_magnitude = {faint}");
        return Err(Fault::new("brightest_magnitude", problem));
    }
    Ok(())
}

fn check_gaussian_psf(gaussian: &GaussianPsfSettings) -> Result<(), Fault> {
    if gaussian.saturation_magnitude >= gaussian.limiting_magnitude {
        let (saturation, limiting) = (gaussian.saturation_magnitude, gaussian.limiting_magnitude);
        let problem = format!("{saturation} must be brighter (smaller) than limiting_magnitude = {limiting}");
        return Err(Fault::new("saturation_magnitude", problem));
    }
    Ok(())
}

pub(super) fn check_glare(glare: &GlareSettings) -> Result<(), Fault> {
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

/// Rules of `[exposure]`, of which `given` is the table as it stands in the document: a key that it has without any effect is a
/// mistake of whoever wrote it, who expects one.
pub(super) fn check_exposure(exposure: &ExposureSettings, given: &Table, stars: StarMethod) -> Result<(), Fault> {
    effects::check(exposure, given, stars)?;
    if exposure.min_ev100 > exposure.max_ev100 {
        let problem = format!("{} is above max_ev100 = {}: it must not be", exposure.min_ev100, exposure.max_ev100);
        return Err(Fault::new("min_ev100", problem));
    }
    Ok(())
}

pub(super) fn check_tone_map(tone_map: &ToneMapSettings) -> Result<(), Fault> {
    finite("black_cd_m2", tone_map.black_cd_m2)?;
    // With less contrast than 2 it is no display.
    let most = 0.5 * tone_map.peak_cd_m2;
    if !(0.0..=most).contains(&tone_map.black_cd_m2) {
        let problem = format!(
            "{}: allowed are 0 to {most} cd/m^2, half of peak_cd_m2 = {}",
            tone_map.black_cd_m2, tone_map.peak_cd_m2
        );
        return Err(Fault::new("black_cd_m2", problem));
    }
    Ok(())
}

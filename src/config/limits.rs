//! Rules of `[stars]`, `[glare]`, `[exposure]` and `[tone_map]` that involve several keys. Keys without effect are refused, unless [`super::effects`]
//! warns of them. The ranges of single keys are attributes of the fields; they are checked earlier.

use crate::ranges::{KeyEffects, KeyError, Obstacle, PartialSettings};
use crate::{
    photometry::{
        glare::GlareKernelName,
        psf::{Aperture, PsfError},
    },
    plan::settings::{
        AutoExposure, BillboardSettings, ExposureKeys, ExposureSettings, GaussianPsfSettings, GlareSettings,
        PsfTextureSettings, StarMethod, StarSettings, ToneMapSettings,
    },
};

pub(super) fn check_stars(stars: &StarSettings) -> Result<(), KeyError> {
    check_billboard(&stars.billboard).map_err(|fault| fault.within("billboard"))?;
    check_gaussian_psf(&stars.gaussian_psf).map_err(|fault| fault.within("gaussian_psf"))?;
    check_psf_texture(&stars.psf_texture).map_err(|fault| fault.within("psf_texture"))
}

fn check_psf_texture(psf: &PsfTextureSettings) -> Result<(), KeyError> {
    if Aperture::from_name(&psf.aperture, 6).is_none() {
        let problem = format!("`{}` is not an aperture: must be one of {}", psf.aperture, Aperture::NAMES.join(", "));
        return Err(KeyError::new("aperture", problem));
    }
    psf.check().map_err(|error| match error {
        PsfError::TooFine { allowed_steps, needed_steps, .. } => {
            // The number of half fringes in a texel, rounded up, is proportional to the diameter.
            let most = psf.diameter_mm * allowed_steps / needed_steps;
            let problem =
                format!("{}: must be at most {most:.3} mm at width_arcmin = {}", psf.diameter_mm, psf.width_arcmin);
            KeyError::new("diameter_mm", problem)
        }
        error => KeyError::new("", error.to_string()),
    })
}

fn check_billboard(billboard: &BillboardSettings) -> Result<(), KeyError> {
    if billboard.brightest_magnitude >= billboard.faintest_magnitude {
        let (bright, faint) = (billboard.brightest_magnitude, billboard.faintest_magnitude);
        let problem = format!("{bright} must be brighter (smaller) than faintest_magnitude = {faint}");
        return Err(KeyError::new("brightest_magnitude", problem));
    }
    Ok(())
}

fn check_gaussian_psf(gaussian: &GaussianPsfSettings) -> Result<(), KeyError> {
    if gaussian.saturation_magnitude >= gaussian.limiting_magnitude {
        let (saturation, limiting) = (gaussian.saturation_magnitude, gaussian.limiting_magnitude);
        let problem = format!("{saturation} must be brighter (smaller) than limiting_magnitude = {limiting}");
        return Err(KeyError::new("saturation_magnitude", problem));
    }
    Ok(())
}

/// Returns the general settings: the defaults, changed by `keys`. Every key must have an effect, either in these settings or in a view that changes
/// them by its keys in `views`.
pub(super) fn general_settings<S: KeyEffects + Default>(keys: &S::Keys, views: &[&S::Keys]) -> Result<S, KeyError> {
    let general = S::default().with_keys(keys);
    match useless_keys(&general, keys, views).into_iter().next() {
        None => Ok(general),
        Some((key, obstacle)) => Err(KeyError::new(key, obstacle.to_string())),
    }
}

/// Returns the given keys that have no effect, neither in the general settings nor in those of any view.
pub(super) fn useless_keys<S: KeyEffects>(
    general: &S,
    keys: &S::Keys,
    views: &[&S::Keys],
) -> Vec<(&'static str, Obstacle)> {
    let uses = |own: &S::Keys, key: &str| !own.given().contains(&key) && general.with_keys(own).obstacle(key).is_none();
    let useless = |key| Some((key, general.obstacle(key).filter(|_| !views.iter().any(|own| uses(own, key)))?));
    keys.given().into_iter().filter_map(useless).collect()
}

pub(super) fn check_glare(glare: &GlareSettings) -> Result<(), KeyError> {
    if glare.kernel == GlareKernelName::Psf && glare.psf_file.is_none() {
        let problem = "missing key: kernel = \"psf\" needs a file, CSV with the columns theta_deg,per_sr, EXR or FITS";
        return Err(KeyError::new("psf_file", problem));
    }
    if glare.is_absolute() {
        let share = glare.fraction_scattered();
        if share > 1.0 {
            let (age, inner) = (glare.age_years, glare.inner_deg);
            let problem = format!(
                "true makes the kernel scatter {share:.2} of the light at age_years = {age} and inner_deg = {inner}: must be at most 1"
            );
            return Err(KeyError::new("absolute", problem));
        }
    }
    Ok(())
}

/// Checks the general exposure, changed by `keys`; keys without effect are refused.
pub(super) fn check_exposure(
    keys: &ExposureKeys,
    general: &ExposureSettings,
    stars: StarMethod,
) -> Result<ExposureSettings, KeyError> {
    keys.check_effects(general, stars.is_relative()).map_err(|(key, problem)| KeyError::new(key, problem))?;
    let exposure = keys.over(general);
    if let ExposureSettings::Auto(AutoExposure { min_ev100, max_ev100, .. }) = exposure
        && min_ev100 > max_ev100
    {
        return Err(KeyError::new("min_ev100", format!("{min_ev100}: must not be above max_ev100 = {max_ev100}")));
    }
    Ok(exposure)
}

pub(super) fn check_tone_map(tone_map: &ToneMapSettings) -> Result<(), KeyError> {
    // The contrast of a display is at least 2.
    let most = 0.5 * tone_map.peak_cd_m2;
    if tone_map.black_cd_m2 > most {
        let problem = format!(
            "{}: must be between 0 and {most} cd/m^2, half of peak_cd_m2 = {}",
            tone_map.black_cd_m2, tone_map.peak_cd_m2
        );
        return Err(KeyError::new("black_cd_m2", problem));
    }
    Ok(())
}

//! Ranges of the numbers in `[stars]`, `[exposure]`, `[tone_map]` and `[accuracy]`, whose types are the planner's own.

use super::error::{Fault, finite};
use crate::{
    photometry::psf::{Aperture, DIAMETERS_MM, PsfError},
    plan::settings::{
        AccuracySettings, BillboardSettings, CellSkySettings, ExposureSettings, GaussianPsfSettings,
        PixelGaussianSettings, PsfTextureSettings, StarSettings, ToneMapSettings,
    },
};

/// Faintest and brightest magnitude limit.
const MOST_MAGNITUDE: f64 = 100.0;

pub(super) fn check_stars(stars: &StarSettings) -> Result<(), Fault> {
    finite("magnitude_limit", stars.magnitude_limit)?;
    // Beyond this an illuminance leaves the numbers that the planner works with.
    if stars.magnitude_limit.abs() > MOST_MAGNITUDE {
        let problem =
            format!("{}: allowed are magnitudes from -{MOST_MAGNITUDE} to {MOST_MAGNITUDE}", stars.magnitude_limit);
        return Err(Fault::new("magnitude_limit", problem));
    }
    check_pixel_gaussian(&stars.pixel_gaussian).map_err(|fault| fault.within("pixel_gaussian"))?;
    check_billboard(&stars.billboard).map_err(|fault| fault.within("billboard"))?;
    check_gaussian_psf(&stars.gaussian_psf).map_err(|fault| fault.within("gaussian_psf"))?;
    check_cell_sky(&stars.cell_sky).map_err(|fault| fault.within("cell_sky"))?;
    check_psf_texture(&stars.psf_texture).map_err(|fault| fault.within("psf_texture"))
}

fn check_pixel_gaussian(gaussian: &PixelGaussianSettings) -> Result<(), Fault> {
    finite("sigma_px", gaussian.sigma_px)?;
    let sigmas = PixelGaussianSettings::SIGMAS_PX;
    if !sigmas.contains(&gaussian.sigma_px) {
        let problem = format!("{}: allowed are {} to {} pixels", gaussian.sigma_px, sigmas.start(), sigmas.end());
        return Err(Fault::new("sigma_px", problem));
    }
    let most = PixelGaussianSettings::MOST_SIGMA_ARCMIN;
    gaussian.sigma_arcmin.map_or(Ok(()), |arcmin| above_0("sigma_arcmin", arcmin, most, "arcminutes (10 degrees)"))
}

fn check_cell_sky(sky: &CellSkySettings) -> Result<(), Fault> {
    // Cells of a face are numbered in 32 bits; every pixel looks at each layer.
    for (key, value, most) in [("cells", sky.cells, 65_535), ("layers", sky.layers, 64)] {
        if !(1..=most).contains(&value) {
            return Err(Fault::new(key, format!("{value}: allowed are 1 to {most}")));
        }
    }
    above_0("radius_px", sky.radius_px, 1024.0, "pixels")
}

fn check_psf_texture(psf: &PsfTextureSettings) -> Result<(), Fault> {
    // `photometry::psf::MAX_WIDTH_RAD` in a round number.
    above_0("width_arcmin", psf.width_arcmin, 1200.0, "arcminutes (20 degrees)")?;
    finite("diameter_mm", psf.diameter_mm)?;
    if !DIAMETERS_MM.contains(&psf.diameter_mm) {
        let problem = format!("{}: allowed are {} to {} mm", psf.diameter_mm, DIAMETERS_MM.start(), DIAMETERS_MM.end());
        return Err(Fault::new("diameter_mm", problem));
    }
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

fn above_0(key: &str, value: f64, most: f64, unit: &str) -> Result<(), Fault> {
    finite(key, value)?;
    if value <= 0.0 || value > most {
        return Err(Fault::new(key, format!("{value}: allowed are values above 0 up to {most} {unit}")));
    }
    Ok(())
}

fn magnitude(key: &str, value: f64) -> Result<(), Fault> {
    finite(key, value)?;
    if value.abs() > 100.0 {
        return Err(Fault::new(key, format!("{value}: allowed are magnitudes from -100 to 100")));
    }
    Ok(())
}

fn check_billboard(billboard: &BillboardSettings) -> Result<(), Fault> {
    // Three times this, of the brightest of the scaled discs, stays below 90 degrees.
    above_0("diameter_arcmin", billboard.diameter_arcmin, 1800.0, "arcminutes (30 degrees)")?;
    above_0("screen_size_px", billboard.screen_size_px, 1024.0, "pixels")?;
    magnitude("brightest_magnitude", billboard.brightest_magnitude)?;
    magnitude("faintest_magnitude", billboard.faintest_magnitude)?;
    if billboard.brightest_magnitude >= billboard.faintest_magnitude {
        let (bright, faint) = (billboard.brightest_magnitude, billboard.faintest_magnitude);
        let problem = format!("{bright} must be brighter (smaller) than faintest_magnitude = {faint}");
        return Err(Fault::new("brightest_magnitude", problem));
    }
    Ok(())
}

fn check_gaussian_psf(gaussian: &GaussianPsfSettings) -> Result<(), Fault> {
    magnitude("limiting_magnitude", gaussian.limiting_magnitude)?;
    magnitude("saturation_magnitude", gaussian.saturation_magnitude)?;
    if gaussian.saturation_magnitude >= gaussian.limiting_magnitude {
        let (saturation, limiting) = (gaussian.saturation_magnitude, gaussian.limiting_magnitude);
        let problem = format!("{saturation} must be brighter (smaller) than limiting_magnitude = {limiting}");
        return Err(Fault::new("saturation_magnitude", problem));
    }
    for (key, value) in [("sigma2_px2", gaussian.sigma2_px2), ("glare_sigma2_px2", gaussian.glare_sigma2_px2)] {
        finite(key, value)?;
        if !(0.01..=10_000.0).contains(&value) {
            return Err(Fault::new(key, format!("{value}: allowed are variances from 0.01 to 10000 pixels^2")));
        }
    }
    finite("glare_brightness", gaussian.glare_brightness)?;
    if !(0.0..=1.0).contains(&gaussian.glare_brightness) {
        let problem = format!("{}: allowed are 0 to 1 of the core's brightness", gaussian.glare_brightness);
        return Err(Fault::new("glare_brightness", problem));
    }
    Ok(())
}

pub(super) fn check_exposure(exposure: &ExposureSettings) -> Result<(), Fault> {
    finite("ev100", exposure.ev100)?;
    finite("key", exposure.key)?;
    finite("compensation_ev", exposure.compensation_ev)?;
    finite("min_ev100", exposure.min_ev100)?;
    finite("max_ev100", exposure.max_ev100)?;
    finite("adaptation_s", exposure.adaptation_s)?;
    if !(1e-6..=1.0).contains(&exposure.key) {
        return Err(Fault::new("key", format!("{}: allowed are 0.000001 to 1 of display white", exposure.key)));
    }
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

pub(super) fn check_tone_map(tone_map: &ToneMapSettings) -> Result<(), Fault> {
    finite("white", tone_map.white)?;
    if !(1.0..=1e6).contains(&tone_map.white) {
        return Err(Fault::new("white", format!("{}: allowed are 1 to 1000000 times display white", tone_map.white)));
    }
    above_0("peak_cd_m2", tone_map.peak_cd_m2, 1e6, "cd/m^2")?;
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
    for (key, value) in [("desaturation", tone_map.desaturation), ("scotopic", tone_map.scotopic)] {
        finite(key, value)?;
        if !(0.0..=1.0).contains(&value) {
            return Err(Fault::new(key, format!("{value}: allowed are 0 to 1")));
        }
    }
    Ok(())
}

pub(super) fn check_accuracy(accuracy: &AccuracySettings) -> Result<(), Fault> {
    // Errors above these are no budget but a mistake: all of the light, or ten pixels.
    for (key, value, most) in [
        ("flux", accuracy.flux, 1.0),
        ("centroid_px", accuracy.centroid_px, 10.0),
        ("flicker", accuracy.flicker, 1.0),
        ("glare", accuracy.glare, 1.0),
    ] {
        finite(key, value)?;
        if value <= 0.0 || value > most {
            return Err(Fault::new(key, format!("{value}: allowed are error budgets above 0 up to {most}")));
        }
    }
    Ok(())
}

//! `psf`: computes the point-spread function of an aperture, or converts the file of another program.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;

use super::{CliError, results};
use crate::photometry::psf::{self, ARCSECOND_RAD, Aperture, BLADES, Loaded, Optics, Psf, WHITE_K};

/// A peak further from the centre than this causes a warning, pixels.
const CENTRED_WITHIN_PX: f64 = 1.0;

/// Arguments of `psf`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian psf --aperture hexagon --diameter-mm 2 --out hexagon.exr\n  \
    steradian psf --aperture curved_blades --blades 7 --diameter-mm 5 --size 1024 --pixel-arcsec 10 --out lens.exr\n  \
    steradian psf --aperture jwst --diameter-mm 6600 --wavelengths 64 --temperature 4000 --out webb.exr\n  \
    steradian psf --from measured.fits --pixel-arcsec 0.031 --out measured.exr\n\n\
    Writes 32-bit R, G, B: the fraction of a star's flux in each pixel, with a sum of Y of 1, and the angle of a pixel in\n\
    the header. Without --temperature the sum of each channel is 1, for stars of every colour; with it the channels have\n\
    the colour of that star.")]
pub struct PsfArguments {
    /// Aperture to compute: circle, hexagon, curved_blades, jwst or hubble.
    #[arg(long, value_name = "NAME", required_unless_present = "from", requires = "diameter_mm")]
    aperture: Option<String>,
    /// EXR or FITS file to convert, instead of an aperture to compute.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["aperture", "diameter_mm", "blades", "size", "wavelengths",
        "temperature"])]
    from: Option<PathBuf>,
    /// Diameter of the circumscribed circle of the aperture, millimetres.
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    diameter_mm: Option<f64>,
    /// Number of blades of curved_blades.
    #[arg(long, value_name = "N", default_value_t = 6, allow_negative_numbers = true)]
    blades: u32,
    /// Pixels along a side.
    #[arg(long, value_name = "N", default_value_t = 512, allow_negative_numbers = true)]
    size: u32,
    /// Angle of a pixel, arcseconds. Default: a quarter of lambda / D at 550 nm, or the value in the header of --from.
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    pixel_arcsec: Option<f64>,
    /// Number of wavelengths.
    #[arg(long, value_name = "N", default_value_t = 95, allow_negative_numbers = true)]
    wavelengths: usize,
    /// Temperature of the star, kelvin.
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    temperature: Option<f64>,
    /// The EXR file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
pub fn run(arguments: &PsfArguments) -> Result<(), CliError> {
    if let Some(pixel_arcsec) = arguments.pixel_arcsec.filter(|pixel| !(*pixel > 0.0 && pixel.is_finite())) {
        return Err(CliError::Usage(format!("--pixel-arcsec {pixel_arcsec}: must be above 0")));
    }
    if !arguments.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return Err(CliError::Usage(format!(
            "--out {}: the name must end with .exr: the file is OpenEXR",
            arguments.out.display()
        )));
    }
    let psf = match (&arguments.from, &arguments.aperture) {
        (Some(file), _) => convert(file, arguments.pixel_arcsec)?,
        (None, name) => diffract(name.as_deref().unwrap_or_default(), arguments)?,
    };
    psf::write_exr(&arguments.out, &psf)?;
    let [red, green, blue] = psf.sum();
    results::line(format!(
        "wrote {}: {} x {} pixels of {:.4} arcseconds, sums R {red:.4} G {green:.4} B {blue:.4}, {:.2} % of the light",
        arguments.out.display(),
        psf.size,
        psf.size,
        psf.pixel_rad / ARCSECOND_RAD,
        100.0 * psf.covered
    ))
}

fn convert(file: &Path, pixel_arcsec: Option<f64>) -> Result<Psf, CliError> {
    let Loaded { psf, negative_pixels, peak_offset_px } = psf::read(file, pixel_arcsec)?;
    if negative_pixels > 0 {
        tracing::warn!("{}: {negative_pixels} negative pixels were set to 0", file.display());
    }
    if peak_offset_px.abs().max_element() > CENTRED_WITHIN_PX {
        tracing::warn!(
            "{}: the brightest pixel is {:.1} px to the right of the centre and {:.1} px above it; the star is assumed to \
             be at the centre",
            file.display(),
            peak_offset_px.x,
            peak_offset_px.y
        );
    }
    Ok(psf)
}

fn diffract(name: &str, arguments: &PsfArguments) -> Result<Psf, CliError> {
    let aperture = Aperture::from_name(name, arguments.blades).ok_or_else(|| {
        CliError::Usage(if Aperture::NAMES.contains(&name) {
            format!("--blades {}: must be between {} and {}", arguments.blades, BLADES.start(), BLADES.end())
        } else {
            format!("--aperture {name}: must be one of {}", Aperture::NAMES.join(", "))
        })
    })?;
    let diameter_mm = arguments
        .diameter_mm
        .ok_or_else(|| CliError::Usage("--diameter-mm is missing: --aperture needs it".to_owned()))?;
    let optics = Optics {
        aperture,
        diameter_mm,
        size: arguments.size,
        pixel_rad: arguments
            .pixel_arcsec
            .map_or_else(|| Optics::fine_pixel_rad(diameter_mm), |pixel| pixel * ARCSECOND_RAD),
        wavelengths: arguments.wavelengths,
        temperature_k: arguments.temperature.unwrap_or(WHITE_K),
    };
    let bar = io::stderr().is_terminal().then(ProgressBar::no_length);
    let psf = Psf::from_aperture(&optics, |done, of| match &bar {
        Some(bar) => {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        }
        // Log a plain line at each tenth of the work.
        None if done == 0 || done * 10 / of != (done - 1) * 10 / of => tracing::info!("{done} of {of} wavelengths"),
        None => {}
    })?;
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    Ok(if arguments.temperature.is_some() { psf } else { psf.balanced_to_white() })
}

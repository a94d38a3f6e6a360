//! Errors of display images relative to exact frames, before rounding.

use crate::{photometry::exposure::white_luminance_cd_m2, plan::settings::RenderSettings, render::Frame};

/// Returns the display values of a frame's HDR images minus those of an exact frame, in 8-bit codes before rounding, by image, pixel and channel.
/// Both use the exposure of the exact frame. The list of an image without HDR pixels is empty.
pub fn code_errors(exact: &Frame, drawn: &Frame, settings: &RenderSettings) -> Vec<Vec<[f64; 3]>> {
    let white = white_luminance_cd_m2(exact.exposure_ev100);
    let code = |[r, g, b, _]: &[f32; 4]| {
        settings.tone_map.display_rgb([*r, *g, *b].map(f64::from), white).map(|value| 255.0 * value)
    };
    let of_images = exact.images.iter().zip(&drawn.images);
    of_images
        .map(|(exact, drawn)| {
            let pixels = exact.hdr.iter().flatten().zip(drawn.hdr.iter().flatten());
            let of_pixel = |(exact, drawn): (&[f32; 4], &[f32; 4])| {
                let (exact, drawn) = (code(exact), code(drawn));
                std::array::from_fn(|channel| drawn[channel] - exact[channel])
            };
            pixels.map(of_pixel).collect()
        })
        .collect()
}

/// Errors of display values relative to exact frames, in 8-bit codes before rounding.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisplayErrors {
    /// Absolute errors of all channels of all pixels, ascending.
    codes: Vec<f64>,
    /// Image, column and row of the largest error.
    pub worst: [usize; 3],
}

impl DisplayErrors {
    /// Compares two frames in the pixels within the pictures.
    pub fn between(exact: &Frame, drawn: &Frame, settings: &RenderSettings) -> Self {
        let mut codes: Vec<f64> = Vec::new();
        let (mut worst, mut largest) = ([0; 3], 0.0);
        for (image, (exact, errors)) in exact.images.iter().zip(code_errors(exact, drawn, settings)).enumerate() {
            let width = exact.width as usize;
            let pixels = exact.hdr.iter().flatten().zip(errors).enumerate();
            for (index, (_, errors)) in pixels.filter(|(_, (exact, _))| exact[3] > 0.0) {
                for error in errors.map(f64::abs) {
                    codes.push(error);
                    if error > largest {
                        (worst, largest) = ([image, index % width, index / width], error);
                    }
                }
            }
        }
        codes.sort_by(f64::total_cmp);
        Self { codes, worst }
    }

    /// Returns the error that a share (0 to 1) of the channels does not exceed; NaN if there are no pixels.
    pub fn quantile(&self, share: f64) -> f64 {
        let index = (self.codes.len().saturating_sub(1) as f64 * share) as usize;
        self.codes.get(index).copied().unwrap_or(f64::NAN)
    }

    /// Returns the root mean square of the errors; NaN if there are no pixels.
    pub fn rms(&self) -> f64 {
        (self.codes.iter().map(|error| error * error).sum::<f64>() / self.codes.len() as f64).sqrt()
    }
}

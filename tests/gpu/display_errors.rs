//! How far display images are from exact frames, before rounding.

use steradian::{photometry::exposure::white_luminance_cd_m2, plan::settings::RenderSettings, render::Frame};

/// Display values of the HDR images of a frame less those of an exact one, with whose exposure both are shown: codes of 8 bits before rounding, by
/// image, pixel and channel.
pub fn code_errors(exact: &Frame, shown: &Frame, settings: &RenderSettings) -> Vec<Vec<[f64; 3]>> {
    let white = white_luminance_cd_m2(exact.exposure_ev100);
    let code = |[r, g, b, _]: &[f32; 4]| {
        settings.tone_map.display_rgb([*r, *g, *b].map(f64::from), white).map(|value| 255.0 * value)
    };
    let of_images = exact.images.iter().zip(&shown.images);
    of_images
        .map(|(exact, shown)| {
            let pixels = exact.hdr.as_ref().unwrap().iter().zip(shown.hdr.as_ref().unwrap());
            let of_pixel = |(exact, shown): (&[f32; 4], &[f32; 4])| {
                let (exact, shown) = (code(exact), code(shown));
                std::array::from_fn(|channel| shown[channel] - exact[channel])
            };
            pixels.map(of_pixel).collect()
        })
        .collect()
}

/// Errors of display values against an exact frame, codes of 8 bits before rounding.
pub struct Errors {
    /// Of all channels of all pixels, ascending.
    codes: Vec<f64>,
    /// Image, column and row of the largest one.
    pub worst: [usize; 3],
}

impl Errors {
    /// Those inside of the pictures.
    pub fn of(exact: &Frame, shown: &Frame, settings: &RenderSettings) -> Self {
        let mut codes: Vec<f64> = Vec::new();
        let (mut worst, mut largest) = ([0; 3], 0.0);
        for (image, (exact, errors)) in exact.images.iter().zip(code_errors(exact, shown, settings)).enumerate() {
            let width = exact.width as usize;
            let pixels = exact.hdr.as_ref().unwrap().iter().zip(errors).enumerate();
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

    pub fn quantile(&self, share: f64) -> f64 {
        self.codes[((self.codes.len() - 1) as f64 * share) as usize]
    }

    pub fn rms(&self) -> f64 {
        (self.codes.iter().map(|error| error * error).sum::<f64>() / self.codes.len() as f64).sqrt()
    }
}

//! How far display images are from exact frames, before rounding.

use steradian::{photometry::exposure::white_luminance_cd_m2, plan::settings::RenderSettings, render::Frame};

/// Errors of display values against an exact frame, codes of 8 bits before rounding.
pub struct Errors {
    /// Of all channels of all pixels, ascending.
    codes: Vec<f64>,
    /// Image, column and row of the largest one.
    pub worst: [usize; 3],
}

impl Errors {
    /// Those of the HDR images of a frame, which are shown with the exposure of the exact frame.
    pub fn of(exact: &Frame, shown: &Frame, settings: &RenderSettings) -> Self {
        let white = white_luminance_cd_m2(exact.exposure_ev100);
        let mut codes: Vec<f64> = Vec::new();
        let (mut worst, mut largest) = ([0; 3], 0.0);
        for (image, (exact, shown)) in exact.images.iter().zip(&shown.images).enumerate() {
            let width = exact.width as usize;
            let pixels = exact.hdr.as_ref().unwrap().iter().zip(shown.hdr.as_ref().unwrap()).enumerate();
            for (index, (exact, shown)) in pixels.filter(|(_, (exact, _))| exact[3] > 0.0) {
                let display =
                    |[r, g, b, _]: &[f32; 4]| settings.tone_map.display_rgb([*r, *g, *b].map(f64::from), white);
                let (exact, shown) = (display(exact), display(shown));
                for channel in 0..3 {
                    let error = 255.0 * (exact[channel] - shown[channel]).abs();
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

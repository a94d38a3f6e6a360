//! Motion blur: averages the light of several moments while a shutter is open.
//!
//! The moments are evenly spaced and symmetric around the frame's own moment, so that an object in uniform motion keeps
//! its position. Light is added in linear luminance, in f32 and in the order of the moments, so the sum is
//! deterministic. A sensor accumulates luminance. If the field of view changes, the solid angle of each pixel changes
//! as well, so its mean is also computed.

use serde::{Deserialize, Serialize};

use rayon::prelude::*;

use super::super::encode::{EncodeError, Encoding, hdr_of};
use crate::photometry::exposure::white_luminance_cd_m2;
use crate::photometry::tone_map::{ToneMapSettings, dither_threshold, linear_from_srgb};
use crate::render::FrameImage;

/// Maximum number of moments of a frame.
pub const MOST_SUB_FRAMES: u32 = 64;

/// Duration of the exposure and number of moments.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shutter {
    /// Share of the time between two frames during which the shutter is open, 0 to 1.
    pub open: f64,
    /// Number of moments, 1 to [`MOST_SUB_FRAMES`].
    pub sub_frames: u32,
}

impl Shutter {
    /// Returns the moments of a frame, in frames; if their number is odd, the middle one is exactly the frame's own
    /// moment.
    pub fn moments(self, frame: u32) -> impl Iterator<Item = f64> {
        let count = f64::from(self.sub_frames);
        (0..self.sub_frames).map(move |number| f64::from(frame) + self.open * ((f64::from(number) + 0.5) / count - 0.5))
    }

    /// Returns the index of the frame's own moment.
    pub fn middle(self) -> Option<u32> {
        (self.sub_frames % 2 == 1).then_some(self.sub_frames / 2)
    }

    /// Whether every frame shows a single moment.
    pub fn is_sharp(self) -> bool {
        self.sub_frames == 1 || self.open == 0.0
    }
}

/// Adds the light of an image of another moment.
///
/// # Errors
///
/// One of the images has no HDR image, or their sizes differ.
pub fn add(sum: &mut FrameImage, image: &FrameImage) -> Result<(), EncodeError> {
    let added = hdr_of(image, Encoding::Exr)?;
    hdr_of(sum, Encoding::Exr)?;
    let pixels = sum.hdr.as_deref_mut().unwrap_or_default();
    if pixels.len() != added.len() {
        let FrameImage { width, height, .. } = *image;
        return Err(EncodeError::Length { width, height, expected: added.len(), found: pixels.len() });
    }
    pixels.par_iter_mut().zip(added).for_each(|(pixel, added)| {
        for (value, added) in pixel.iter_mut().zip(added) {
            *value += added;
        }
    });
    Ok(())
}

/// Divides the sum of `count` images by `count`.
pub fn divide(sum: &mut FrameImage, count: u32) {
    let pixels = sum.hdr.as_deref_mut().unwrap_or_default();
    pixels.par_iter_mut().for_each(|pixel| {
        for value in pixel {
            *value /= count as f32;
        }
    });
}

/// Makes the 8-bit display image from the HDR image: tone mapping in f64, then the share and the response of a
/// projector, dithered as configured.
///
/// # Errors
///
/// The HDR image is missing or has another size.
pub fn show(image: &mut FrameImage, exposure_ev100: f64, tone_map: &ToneMapSettings) -> Result<(), EncodeError> {
    let width = image.width;
    let light = hdr_of(image, Encoding::Png)?;
    let white_cd_m2 = white_luminance_cd_m2(exposure_ev100);
    let projector = image.projector.as_deref();
    let mut display = vec![0_u8; light.len() * 4];
    display.par_chunks_mut(4).zip(light).enumerate().for_each(|(index, (pixel, [red, green, blue, _]))| {
        pixel[3] = u8::MAX;
        // Skip black pixels: most pixels of a night sky are black, and every operator maps black to black.
        if [*red, *green, *blue] == [0.0; 3] && projector.is_none() {
            return;
        }
        let [x, y] = [index as u32 % width, index as u32 / width];
        let threshold = if tone_map.dither { dither_threshold(x, y) } else { 0.5 };
        let rgb = tone_map.display_rgb([*red, *green, *blue].map(f64::from), white_cd_m2);
        let rgb = projector.map_or(rgb, |projector| projector.codes(index, rgb.map(linear_from_srgb)));
        for (code, value) in pixel.iter_mut().zip(rgb) {
            *code = (value.clamp(0.0, 1.0) * 255.0 + threshold).floor().min(255.0) as u8;
        }
    });
    image.display = Some(display);
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::super::super::encode::tests::sample;
    use super::*;

    #[test]
    fn moments_are_even_and_symmetric_around_the_frame() {
        let moments = |open, sub_frames| Shutter { open, sub_frames }.moments(7).collect::<Vec<_>>();
        assert_eq!(moments(0.5, 1), [7.0]);
        assert_eq!(moments(1.0, 4), [6.625, 6.875, 7.125, 7.375]);
        assert_eq!(moments(0.5, 2), [6.875, 7.125]);
        for sub_frames in 1..=MOST_SUB_FRAMES {
            let shutter = Shutter { open: 0.7, sub_frames };
            let of_frame = shutter.moments(31).position(|moment| moment == 31.0);
            assert_eq!(of_frame, shutter.middle().map(|middle| middle as usize), "{sub_frames}");
        }
        assert!(Shutter { open: 0.0, sub_frames: 8 }.is_sharp() && !Shutter { open: 0.1, sub_frames: 8 }.is_sharp());
    }

    #[test]
    fn mean_is_of_linear_light_and_mismatched_images_are_refused() {
        let mut sum = sample(4, 3);
        sum.hdr.as_mut().unwrap()[0] = [8.0, 0.0, 2.0, 1e-6];
        let mut dark = sum.clone();
        dark.hdr.as_mut().unwrap()[0] = [0.0, 4.0, 2.0, 1e-6];
        let same = sum.hdr.as_ref().unwrap()[5];
        add(&mut sum, &dark).unwrap();
        divide(&mut sum, 2);
        let mean = sum.hdr.as_ref().unwrap();
        assert_eq!((mean[0], mean[5]), ([4.0, 2.0, 2.0, 1e-6], same));
        assert!(add(&mut sum, &FrameImage { hdr: None, ..dark.clone() }).is_err());
        assert!(add(&mut sum, &sample(5, 3)).is_err());
        assert!(add(&mut FrameImage { hdr: None, ..dark.clone() }, &dark).is_err());
    }

    #[test]
    fn display_image_is_the_rounded_tone_mapping() {
        let mut image = sample(16, 9);
        image.display = None;
        for dither in [false, true] {
            let tone_map = ToneMapSettings { dither, ..ToneMapSettings::default() };
            show(&mut image, 1.0, &tone_map).unwrap();
            let white_cd_m2 = white_luminance_cd_m2(1.0);
            let display = image.display.as_ref().unwrap();
            for (pixel, [red, green, blue, _]) in display.chunks_exact(4).zip(image.hdr.as_ref().unwrap()) {
                let exact = tone_map.display_rgb([*red, *green, *blue].map(f64::from), white_cd_m2);
                let most = if dither { 1.0 } else { 0.5 };
                for (code, exact) in pixel.iter().zip(exact) {
                    assert!((f64::from(*code) - 255.0 * exact).abs() <= most + 1e-9, "{code} {exact}");
                }
                assert_eq!(pixel[3], 255);
            }
        }
        image.hdr = None;
        assert!(show(&mut image, 1.0, &ToneMapSettings::default()).is_err());
    }
}

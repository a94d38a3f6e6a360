//! Converts images of a frame to the texels of a window.

use std::borrow::Cow;

use half::f16;
use rayon::prelude::*;

use crate::{
    config::WindowFormat,
    photometry::{
        exposure::white_luminance_cd_m2,
        tone_map::{ToneMapSettings, linear_from_srgb},
    },
    render::FrameImage,
    view::projector::ProjectorOutput,
};

/// Largest 10-bit code.
const MOST_CODE: f64 = 1023.0;

/// Returns the format of the texture for the texels.
pub(super) fn texture_format(format: WindowFormat) -> wgpu::TextureFormat {
    match format {
        WindowFormat::Srgb8 => wgpu::TextureFormat::Rgba8Unorm,
        WindowFormat::Rgb10 => wgpu::TextureFormat::Rgb10a2Unorm,
        WindowFormat::Hdr => wgpu::TextureFormat::Rgba16Float,
    }
}

/// Returns the texels of an image, row by row from the top; `None`: the frame lacks the required image.
///
/// With 8 bits they are the bytes of the display image. Otherwise they are computed from the HDR image, in f64 and without dither, with the exposure
/// and, for 10 bits, the tone mapping of the display image; if the frame has only the display image, its codes are used.
pub(super) fn texels<'a>(
    image: &'a FrameImage,
    exposure_ev100: f64,
    tone_map: &ToneMapSettings,
    format: WindowFormat,
) -> Option<Cow<'a, [u8]>> {
    match (format, &image.hdr, &image.display) {
        (WindowFormat::Srgb8, _, display) => display.as_deref().map(Cow::Borrowed),
        (_, Some(hdr), _) => {
            let white_cd_m2 = white_luminance_cd_m2(exposure_ev100);
            let projector = image.projector.as_deref();
            // A projector's response applies to codes, and linear light has none.
            let blended = |index: usize, light: [f64; 3]| match projector.and_then(ProjectorOutput::blend) {
                None => light,
                Some(blend) => {
                    let [alpha, beta] = blend.weights()[index].map(f64::from);
                    light.map(|light| light * alpha * (1.0 - beta) + beta)
                }
            };
            Some(Cow::Owned(match format {
                WindowFormat::Hdr => halves(hdr.len(), |index| {
                    let [red, green, blue, _] = hdr[index].map(f64::from);
                    blended(index, [red, green, blue].map(|light| light / white_cd_m2))
                }),
                _ => tens(hdr.len(), |index| {
                    let [red, green, blue, _] = hdr[index].map(f64::from);
                    let codes = tone_map.display_rgb([red, green, blue], white_cd_m2);
                    projector.map_or(codes, |projector| projector.codes(index, codes.map(linear_from_srgb)))
                }),
            }))
        }
        (_, None, Some(display)) => {
            let codes = |index: usize| [0, 1, 2].map(|channel| f64::from(display[4 * index + channel]) / 255.0);
            Some(Cow::Owned(match format {
                WindowFormat::Hdr => halves(display.len() / 4, |index| codes(index).map(linear_from_srgb)),
                _ => tens(display.len() / 4, codes),
            }))
        }
        (_, None, None) => None,
    }
}

/// Packs values of 0 to 1 as three 10-bit codes per word.
fn tens(pixels: usize, value: impl Fn(usize) -> [f64; 3] + Sync) -> Vec<u8> {
    let mut texels = vec![0_u8; 4 * pixels];
    texels.par_chunks_exact_mut(4).enumerate().for_each(|(index, bytes)| {
        let [red, green, blue] = value(index).map(|value| (value.clamp(0.0, 1.0) * MOST_CODE).round() as u32);
        bytes.copy_from_slice(&(red | (green << 10) | (blue << 20) | (3 << 30)).to_le_bytes());
    });
    texels
}

/// Packs four half floats per pixel.
fn halves(pixels: usize, value: impl Fn(usize) -> [f64; 3] + Sync) -> Vec<u8> {
    let mut texels = vec![0_u8; 8 * pixels];
    texels.par_chunks_exact_mut(8).enumerate().for_each(|(index, bytes)| {
        let [red, green, blue] = value(index);
        for (bytes, value) in bytes.chunks_exact_mut(2).zip([red, green, blue, 1.0]) {
            let half = f16::from_f64(value.clamp(0.0, f64::from(f16::MAX)));
            bytes.copy_from_slice(&half.to_le_bytes());
        }
    });
    texels
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        photometry::tone_map::srgb_from_linear,
        view::{
            Part,
            projector::{Blend, Response, Weights},
        },
    };

    const EV100: f64 = -3.0;

    fn image(blend: Option<Blend>) -> FrameImage {
        let white_cd_m2 = white_luminance_cd_m2(EV100) as f32;
        let hdr = (0..8_u16).map(|step| {
            let light = white_cd_m2 * 0.5 * f32::from(step);
            [light, light * 0.5, light * 0.25, 1e-6]
        });
        let display = (0..32_u8).map(|byte| if byte % 4 == 3 { 255 } else { 8 * byte }).collect();
        FrameImage {
            view: 0,
            part: Part::Whole,
            width: 4,
            height: 2,
            display: Some(display),
            hdr: Some(hdr.collect()),
            projector: blend
                .map(|blend| Arc::new(ProjectorOutput::new([4, 2], None, Some(blend), Response::default()).unwrap())),
        }
    }

    fn codes(texels: &[u8]) -> Vec<[u32; 4]> {
        let word = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let parts = |word: u32| [word & 1023, (word >> 10) & 1023, (word >> 20) & 1023, word >> 30];
        texels.chunks_exact(4).map(|bytes| parts(word(bytes))).collect()
    }

    fn light(texels: &[u8]) -> Vec<[f64; 4]> {
        let half = |bytes: &[u8], start: usize| f16::from_le_bytes([bytes[start], bytes[start + 1]]).to_f64();
        texels.chunks_exact(8).map(|bytes| [0, 2, 4, 6].map(|start| half(bytes, start))).collect()
    }

    #[test]
    fn srgb8_texels_are_the_bytes_of_the_display_image() {
        let image = image(None);
        let found = texels(&image, EV100, &ToneMapSettings::default(), WindowFormat::Srgb8).unwrap();
        assert!(matches!(found, Cow::Borrowed(_)) && *found == *image.display.as_deref().unwrap());
    }

    #[test]
    fn rgb10_texels_are_the_tone_mapped_light_with_its_share() {
        let tone_map = ToneMapSettings::default();
        let white_cd_m2 = white_luminance_cd_m2(EV100);
        let half = Weights { size: [1, 1], values: &[0.5] };
        for blend in [None, Some(Blend::new([4, 2], Some(half), None).unwrap())] {
            let share = if blend.is_some() { 0.5 } else { 1.0 };
            let image = image(blend);
            let found = codes(&texels(&image, EV100, &tone_map, WindowFormat::Rgb10).unwrap());
            for (found, light) in found.iter().zip(image.hdr.as_ref().unwrap()) {
                let rgb = tone_map.display_rgb([light[0], light[1], light[2]].map(f64::from), white_cd_m2);
                for (code, value) in found.iter().zip(rgb) {
                    let expected = srgb_from_linear(linear_from_srgb(value) * share) * 1023.0;
                    assert!((f64::from(*code) - expected).abs() <= 0.5 + 1e-9, "{code} {expected}");
                }
                assert_eq!(found[3], 3);
            }
            assert!(found[7][0] > 0);
        }
    }

    #[test]
    fn hdr_texels_are_in_units_of_display_white_without_limit() {
        let image = image(None);
        let found = light(&texels(&image, EV100, &ToneMapSettings::default(), WindowFormat::Hdr).unwrap());
        for (step, found) in found.iter().enumerate() {
            let expected = 0.5 * step as f64;
            for (found, expected) in found.iter().zip([expected, expected * 0.5, expected * 0.25, 1.0]) {
                assert!((found - expected).abs() <= 1e-3 * expected, "{found} {expected}");
            }
        }
        assert!(found[7][0] > 3.0);
    }

    #[test]
    fn display_image_without_hdr_gives_its_codes() {
        let image = FrameImage { hdr: None, ..image(None) };
        let display = image.display.clone().unwrap();
        let found = codes(&texels(&image, EV100, &ToneMapSettings::default(), WindowFormat::Rgb10).unwrap());
        let found_light = light(&texels(&image, EV100, &ToneMapSettings::default(), WindowFormat::Hdr).unwrap());
        for (index, (codes, light)) in found.iter().zip(&found_light).enumerate() {
            for channel in 0..3 {
                let value = f64::from(display[4 * index + channel]) / 255.0;
                assert!((f64::from(codes[channel]) - value * 1023.0).abs() <= 0.5 + 1e-9);
                assert!((light[channel] - linear_from_srgb(value)).abs() <= 1e-3 * value);
            }
        }
        let nothing = FrameImage { display: None, ..image };
        for format in [WindowFormat::Srgb8, WindowFormat::Rgb10, WindowFormat::Hdr] {
            assert!(texels(&nothing, EV100, &ToneMapSettings::default(), format).is_none());
        }
    }
}

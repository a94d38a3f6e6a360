//! Encodes the images of a film's frames. Equal images with equal metadata give equal bytes.

use exr::prelude::{AttributeValue, LayerAttributes, Text};
use png::{BitDepth, ColorType};
use rayon::prelude::*;

use super::super::{
    encode::{EncodeError, Encoding, encode, hdr_of, png_of},
    exr_file::{HalfOf, exr_of},
};
use crate::photometry::exposure::white_luminance_cd_m2;
use crate::photometry::tone_map::{ToneMapSettings, linear_from_srgb};
use crate::render::{FrameImage, Wanted};

/// File format of a film's images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// Display images, PNG of 8 bits.
    Png8,
    /// Display images, PNG of 16 bits: HDR images with the exposure and tone mapping of display images, in f64, without dither.
    Png16,
    /// HDR images, OpenEXR of 16-bit floats in units of display white, whose luminance in cd/m^2 is the attribute
    /// `whiteLuminance`.
    Exr16,
    /// HDR images, OpenEXR of 32-bit floats, cd/m^2.
    Exr32,
}

named!(FilmFormat {
    Png8 = "png8",
    Png16 = "png16",
    Exr16 = "exr16",
    Exr32 = "exr32",
});

impl FilmFormat {
    /// Extension of file names.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png8 | Self::Png16 => "png",
            Self::Exr16 | Self::Exr32 => "exr",
        }
    }

    /// Returns the buffers that a frame must have.
    pub fn wanted(self) -> Wanted {
        if self == Self::Png8 { Wanted::display() } else { Wanted::hdr() }
    }

    /// Bytes per pixel before compression, which is about the maximum of a file.
    pub fn bytes_per_pixel(self) -> u64 {
        match self {
            Self::Png8 => 4,
            Self::Png16 => 6,
            Self::Exr16 => 10,
            Self::Exr32 => 16,
        }
    }
}

/// Metadata of an image.
#[derive(Clone, Debug)]
pub struct ImageWords {
    /// Exposure of the display image.
    pub exposure_ev100: f64,
    /// Its tone mapping.
    pub tone_map: ToneMapSettings,
    /// Attributes of EXR files, by name.
    pub attributes: Vec<(&'static str, String)>,
}

/// Encodes one image as a file.
///
/// # Errors
///
/// The buffer that the format needs is missing or has another length, or the encoder fails.
pub fn encode_image(format: FilmFormat, image: &FrameImage, words: &ImageWords) -> Result<Vec<u8>, EncodeError> {
    match format {
        FilmFormat::Png8 => encode(Encoding::Png, image),
        FilmFormat::Png16 => png16(image, words),
        FilmFormat::Exr16 | FilmFormat::Exr32 => exr(format, image, words),
    }
}

fn png16(image: &FrameImage, words: &ImageWords) -> Result<Vec<u8>, EncodeError> {
    let pixels = hdr_of(image, Encoding::Exr)?;
    let white_cd_m2 = white_luminance_cd_m2(words.exposure_ev100);
    let projector = image.projector.as_deref();
    let mut samples = vec![0_u8; pixels.len() * 6];
    samples.par_chunks_mut(6).zip(pixels).enumerate().for_each(|(index, (bytes, [red, green, blue, _]))| {
        // Skip black pixels: most pixels of a night sky are black, and every operator maps black to black.
        if [*red, *green, *blue] == [0.0; 3] && projector.is_none() {
            return;
        }
        let rgb = words.tone_map.display_rgb([*red, *green, *blue].map(f64::from), white_cd_m2);
        let rgb = projector.map_or(rgb, |projector| projector.codes(index, rgb.map(linear_from_srgb)));
        for (bytes, value) in bytes.chunks_exact_mut(2).zip(rgb) {
            let code = (value.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
            bytes.copy_from_slice(&code.to_be_bytes());
        }
    });
    png_of([image.width, image.height], (ColorType::Rgb, BitDepth::Sixteen), &samples)
}

/// Returns a text in Latin-1, the encoding of the format. Names and numbers are ASCII.
fn latin(text: &str) -> Text {
    let bytes: String = text.chars().map(|c| if c.is_ascii() { c } else { '?' }).collect();
    Text::new_or_none(bytes).unwrap_or_else(|| Text::from(""))
}

fn exr(format: FilmFormat, image: &FrameImage, words: &ImageWords) -> Result<Vec<u8>, EncodeError> {
    let pixels = hdr_of(image, Encoding::Exr)?;
    let white_cd_m2 = match format {
        FilmFormat::Exr16 => white_luminance_cd_m2(words.exposure_ev100) as f32,
        _ => 1.0,
    };
    let mut attributes = LayerAttributes { white_luminance: Some(white_cd_m2), ..LayerAttributes::default() };
    attributes.software_name = Some(latin(concat!("steradian ", env!("CARGO_PKG_VERSION"))));
    attributes.other.insert(Text::from("exposure_ev100"), AttributeValue::F64(words.exposure_ev100));
    for (name, value) in &words.attributes {
        attributes.other.insert(Text::from(*name), AttributeValue::Text(latin(value)));
    }
    let half = (format == FilmFormat::Exr16).then_some(HalfOf { unit_cd_m2: white_cd_m2 });
    let mut bytes = exr_of(image, pixels, half, attributes)?;
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// Sorts the attributes of a header by name, because the encoder writes them in an order that changes between runs.
/// Their total length does not change, and therefore no offset changes. A header that cannot be parsed is left
/// unchanged.
fn sort_attributes(file: &mut [u8]) {
    // The header begins after the magic number and the version.
    let first = 8;
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut position = first;
    let text_end = |file: &[u8], from: usize| Some(from + file.get(from..)?.iter().position(|byte| *byte == 0)?);
    while file.get(position).is_some_and(|byte| *byte != 0) {
        let end = text_end(file, position).and_then(|name| text_end(file, name + 1)).and_then(|kind| {
            let size: [u8; 4] = file.get(kind + 1..kind + 5)?.try_into().ok()?;
            let end = kind + 5 + usize::try_from(i32::from_le_bytes(size)).ok()?;
            (end <= file.len()).then_some(end)
        });
        let Some(end) = end else { return };
        attributes.push(file[position..end].to_vec());
        position = end;
    }
    attributes.sort();
    let sorted = attributes.concat();
    file[first..position].copy_from_slice(&sorted);
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use std::io::Cursor;

    use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};

    use super::super::super::{encode::tests::sample, exr_file::MOST_HALF};
    use super::*;
    use crate::view::projector::{Blend, ProjectorOutput, Response, Weights};

    fn words() -> ImageWords {
        let names = ["projection", "camera_position_m", "units", "configuration_sha256", "view_name", "film_frame"];
        ImageWords {
            exposure_ev100: -3.5,
            tone_map: ToneMapSettings::default(),
            attributes: names.map(|name| (name, format!("value of {name}"))).to_vec(),
        }
    }

    #[test]
    fn exr_attributes_are_sorted_and_light_is_in_the_stated_units() {
        let image = sample(21, 34);
        for format in [FilmFormat::Exr16, FilmFormat::Exr32] {
            let bytes = encode_image(format, &image, &words()).unwrap();
            for _ in 0..20 {
                assert!(encode_image(format, &image, &words()).unwrap() == bytes, "{format:?}");
            }
            let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().all_layers();
            let read = read.all_attributes().from_buffered(Cursor::new(&bytes)).unwrap();
            let layer = &read.layer_data[0];
            let text = |name: &str| match &layer.attributes.other[&Text::from(name)] {
                AttributeValue::Text(text) => text.to_string(),
                other => panic!("{name}: {other:?}"),
            };
            assert_eq!(text("units"), "value of units");
            assert_eq!(layer.attributes.other[&Text::from("exposure_ev100")], AttributeValue::F64(-3.5));
            assert!(layer.attributes.software_name.as_ref().unwrap().to_string().starts_with("steradian "));
            let white_cd_m2 = layer.attributes.white_luminance.unwrap();
            for (channel, index) in [("R", 0), ("G", 1), ("B", 2), ("omega", 3)] {
                let found = layer.channel_data.list.iter().find(|found| found.name == *channel).unwrap();
                let expected = image.hdr.as_ref().unwrap().iter().map(|pixel| pixel[index]);
                match &found.sample_data {
                    FlatSamples::F32(values) => assert!(values.iter().copied().eq(expected), "{format:?} {channel}"),
                    FlatSamples::F16(values) => {
                        assert!(format == FilmFormat::Exr16 && channel != "omega");
                        for (value, expected) in values.iter().zip(expected) {
                            let found = value.to_f32() * white_cd_m2;
                            let most = MOST_HALF * white_cd_m2;
                            let near = (found - expected).abs() <= 5e-4 * expected + 4e-8 * white_cd_m2;
                            assert!(near || (expected > most && found == most), "{found} {expected}");
                        }
                    }
                    FlatSamples::U32(_) => panic!("{channel} has integers"),
                }
            }
        }
    }

    #[test]
    fn png16_is_tone_mapped_light() {
        let image = sample(9, 5);
        let bytes = encode_image(FilmFormat::Png16, &image, &words()).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().bit_depth, png::BitDepth::Sixteen);
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let white_cd_m2 = white_luminance_cd_m2(-3.5);
        for (pixel, light) in pixels.chunks_exact(6).zip(image.hdr.as_ref().unwrap()) {
            let rgb =
                ToneMapSettings::default().display_rgb([light[0], light[1], light[2]].map(f64::from), white_cd_m2);
            for (bytes, value) in pixel.chunks_exact(2).zip(rgb) {
                let code = f64::from(u16::from_be_bytes([bytes[0], bytes[1]]));
                assert!((code - value * 65_535.0).abs() <= 0.5 + 1e-9);
            }
        }
    }

    #[test]
    fn projector_share_is_applied_in_every_format() {
        let values: Vec<f32> = (0..45).map(|index| index as f32 / 44.0).collect();
        let blend = Blend::new([9, 5], Some(Weights { size: [9, 5], values: &values }), None).unwrap();
        let response = Response { gamma: Some(2.4), lut: None };
        let output = ProjectorOutput::new([9, 5], None, Some(blend), response).unwrap();
        let image = FrameImage { projector: Some(std::sync::Arc::new(output)), ..sample(9, 5) };
        let bytes = encode_image(FilmFormat::Png16, &image, &words()).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let white_cd_m2 = white_luminance_cd_m2(-3.5);
        for ((pixel, light), alpha) in pixels.chunks_exact(6).zip(image.hdr.as_ref().unwrap()).zip(&values) {
            let rgb =
                ToneMapSettings::default().display_rgb([light[0], light[1], light[2]].map(f64::from), white_cd_m2);
            for (bytes, value) in pixel.chunks_exact(2).zip(rgb) {
                let code = f64::from(u16::from_be_bytes([bytes[0], bytes[1]])) / 65_535.0;
                let expected = (linear_from_srgb(value) * f64::from(*alpha)).powf(1.0 / 2.4);
                assert!((code - expected).abs() < 2e-5, "{code} {expected}");
            }
        }
        for format in [FilmFormat::Exr16, FilmFormat::Exr32] {
            let bytes = encode_image(format, &image, &words()).unwrap();
            let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
            let read = read.first_valid_layer().all_attributes().from_buffered(Cursor::new(&bytes)).unwrap();
            let found = read.layer_data.channel_data.list.iter().find(|found| found.name == *"alpha").unwrap();
            assert!(found.sample_data.values_as_f32().eq(values.iter().copied()), "{format:?}");
        }
    }

    #[test]
    fn missing_buffer_is_an_error() {
        for format in [FilmFormat::Png8, FilmFormat::Png16, FilmFormat::Exr16, FilmFormat::Exr32] {
            let image = FrameImage { display: None, hdr: None, ..sample(4, 4) };
            assert!(matches!(encode_image(format, &image, &words()), Err(EncodeError::Missing { .. })), "{format:?}");
        }
    }
}

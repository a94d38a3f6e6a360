//! Encodings of images for files and streams.
//!
//! All of them are deterministic: the same image gives the same bytes.

use exr::prelude::LayerAttributes;
use png::{BitDepth, ColorType};

use super::{exr_file::exr_of, jpeg, video::VideoEncoder};
use crate::render::{FrameImage, Wanted};

/// Encoding of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Display image: R, G, B, A bytes row by row from the top.
    Rgba8,
    /// Display image as PNG, 8 bits, marked sRGB.
    Png,
    /// Display image as JPEG.
    Jpeg,
    /// Display image as H.264. [`encode`] makes a key picture, and [`VideoEncoder`] makes a sequence of pictures.
    H264,
    /// Luminance in cd/m^2: R, G, B as little-endian f32, row by row from the top.
    Rgb32f,
    /// Luminance and solid angle as OpenEXR: channels `R`, `G`, `B` (cd/m^2) and `omega` (sr), 32-bit float.
    Exr,
}

named!(Encoding {
    Rgba8 = "RGBA8",
    Png = "PNG",
    Jpeg = "JPEG",
    H264 = "H264",
    Rgb32f = "RGB32F",
    Exr = "EXR",
});

impl Encoding {
    /// Returns the buffers that the encoding needs.
    pub fn wanted(self) -> Wanted {
        match self {
            Self::Exr => Wanted::hdr(),
            Self::Rgb32f => Wanted::hdr_streamed(),
            _ => Wanted::display(),
        }
    }
}

/// Reason why an image cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The frame was rendered without the buffer that the encoding needs.
    #[error("{encoding} needs the {buffer} image, which was not rendered")]
    Missing {
        /// Name of the encoding.
        encoding: &'static str,
        /// Name of the buffer.
        buffer: &'static str,
    },
    /// The length of a buffer does not match the size of the image.
    #[error("{width} x {height} pixels need {expected} values, but the buffer has {found}")]
    Length {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// Number of values required by the size.
        expected: usize,
        /// Number of values in the buffer.
        found: usize,
    },
    /// JPEG does not support an image of this size.
    #[error("{width} x {height} pixels are too many for JPEG: each side must be at most 65535")]
    TooLargeForJpeg {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// H.264 does not support an image of this size.
    #[error(
        "{width} x {height} pixels: H.264 supports 1 to 36864 squares of 16 x 16 pixels and up to 8688 pixels per side; max_size makes smaller copies"
    )]
    TooLargeForH264 {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// The H.264 encoder failed.
    #[error("H.264: {0}")]
    H264(String),
    /// The PNG encoder failed.
    #[error("PNG: {0}")]
    Png(#[from] png::EncodingError),
    /// The JPEG encoder failed.
    #[error("JPEG: {0}")]
    Jpeg(#[from] jpeg_encoder::EncodingError),
    /// The OpenEXR encoder failed.
    #[error("OpenEXR: {0}")]
    Exr(#[from] exr::error::Error),
}

/// Encodes one image of a frame.
pub fn encode(encoding: Encoding, image: &FrameImage) -> Result<Vec<u8>, EncodeError> {
    match encoding {
        Encoding::Rgba8 => Ok(display_of(image, encoding)?.to_vec()),
        Encoding::Png => {
            let size = [image.width, image.height];
            png_of(size, (ColorType::Rgba, BitDepth::Eight), display_of(image, encoding)?)
        }
        Encoding::Jpeg => jpeg_of(image, display_of(image, encoding)?),
        Encoding::H264 => VideoEncoder::new(image.width, image.height)?.encode(image, true),
        Encoding::Rgb32f => {
            let pixels = hdr_of(image, encoding)?;
            let mut bytes = Vec::with_capacity(pixels.len() * 12);
            for [red, green, blue, _] in pixels {
                for value in [red, green, blue] {
                    bytes.extend_from_slice(&value.to_le_bytes());
                }
            }
            Ok(bytes)
        }
        Encoding::Exr => exr_of(image, hdr_of(image, encoding)?, None, LayerAttributes::default()),
    }
}

fn checked<'a, T>(image: &FrameImage, values: &'a [T], per_pixel: usize) -> Result<&'a [T], EncodeError> {
    let expected = image.width as usize * image.height as usize * per_pixel;
    if values.len() != expected {
        let FrameImage { width, height, .. } = *image;
        return Err(EncodeError::Length { width, height, expected, found: values.len() });
    }
    Ok(values)
}

pub(super) fn display_of(image: &FrameImage, encoding: Encoding) -> Result<&[u8], EncodeError> {
    let missing = EncodeError::Missing { encoding: encoding.name(), buffer: "display" };
    checked(image, image.display.as_deref().ok_or(missing)?, 4)
}

pub(super) fn hdr_of(image: &FrameImage, encoding: Encoding) -> Result<&[[f32; 4]], EncodeError> {
    let missing = EncodeError::Missing { encoding: encoding.name(), buffer: "HDR" };
    checked(image, image.hdr.as_deref().ok_or(missing)?, 1)
}

/// Encodes a PNG, marked sRGB, from samples row by row from the top; 16-bit samples have the high byte first.
pub(crate) fn png_of(
    [width, height]: [u32; 2],
    (color, depth): (ColorType, BitDepth),
    samples: &[u8],
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    // A higher compression level would not make dithered black much smaller.
    encoder.set_compression(png::Compression::Fast);
    // The filter that is best for most lines of dithered skies. With a filter for each line, encoding takes 20 to 50 % longer, and files are at most 3 %
    // smaller.
    encoder.set_filter(png::Filter::Avg);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(samples)?;
    writer.finish()?;
    Ok(bytes)
}

fn jpeg_of(image: &FrameImage, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    let (Ok(width), Ok(height)) = (u16::try_from(image.width), u16::try_from(image.height)) else {
        return Err(EncodeError::TooLargeForJpeg { width: image.width, height: image.height });
    };
    Ok(jpeg::encode(pixels, width, height)?)
}

#[cfg(test)]
pub(super) mod tests {
    use exr::prelude::{ReadChannels, ReadLayers};

    use std::{io::Cursor, sync::Arc};

    use super::*;
    use crate::view::{
        Part,
        projector::{Blend, ProjectorOutput, Response, Weights},
    };

    /// Returns an image in which every value differs from its neighbours; extreme values are included.
    pub fn sample(width: u32, height: u32) -> FrameImage {
        let count = (width * height) as usize;
        let mut hdr: Vec<[f32; 4]> = (0..count)
            .map(|i| [i as f32 * 1e-7, (i as f32).sqrt(), 1.0 / (i as f32 + 1.0), 1e-6 + i as f32 * 1e-12])
            .collect();
        hdr[0] = [f32::MAX, f32::MIN_POSITIVE, 0.0, 0.0];
        let display = (0..count * 4).map(|i| if i % 4 == 3 { 255 } else { (i * 37 % 251) as u8 }).collect();
        FrameImage {
            view: 0,
            part: Part::Whole,
            width,
            height,
            display: Some(display),
            hdr: Some(hdr),
            projector: None,
        }
    }

    /// Values of a channel of an EXR file, by name.
    pub fn exr_channel(bytes: &[u8], name: &str) -> Vec<f32> {
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        let channels = &image.layer_data[0].channel_data.list;
        assert_eq!(channels.len(), 4);
        let channel = channels.iter().find(|channel| channel.name == *name).expect("the channel exists");
        match &channel.sample_data {
            exr::prelude::FlatSamples::F32(values) => values.clone(),
            other => panic!("{name} holds {other:?}"),
        }
    }

    #[test]
    fn exr_is_lossless_and_deterministic() {
        let image = sample(37, 53);
        let bytes = encode(Encoding::Exr, &image).unwrap();
        for (index, name) in ["R", "G", "B", "omega"].into_iter().enumerate() {
            let expected: Vec<u32> = image.hdr.as_ref().unwrap().iter().map(|pixel| pixel[index].to_bits()).collect();
            let found: Vec<u32> = exr_channel(&bytes, name).iter().map(|value| value.to_bits()).collect();
            assert_eq!(found, expected, "{name}");
        }
        assert_eq!(encode(Encoding::Exr, &image).unwrap(), bytes);
        let mut other = image;
        other.hdr.as_mut().unwrap()[7][2] *= 1.000_001;
        assert_ne!(encode(Encoding::Exr, &other).unwrap(), bytes);
    }

    #[test]
    fn exr_of_a_projector_stores_its_share_as_alpha() {
        let values: Vec<f32> = (0..12).map(|index| index as f32 / 11.0).collect();
        let blend = Blend::new([4, 3], Some(Weights { size: [4, 3], values: &values }), None).unwrap();
        let output = ProjectorOutput::new([4, 3], None, Some(blend), Response::default()).unwrap();
        let image = FrameImage { projector: Some(Arc::new(output)), ..sample(4, 3) };
        let bytes = encode(Encoding::Exr, &image).unwrap();
        let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        let read = read.first_valid_layer().all_attributes().from_buffered(Cursor::new(&bytes)).unwrap();
        let names: Vec<String> =
            read.layer_data.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
        assert_eq!(names, ["B", "G", "R", "alpha", "omega"]);
        let alpha: Vec<f32> = read.layer_data.channel_data.list[3].sample_data.values_as_f32().collect();
        assert_eq!(alpha, values);
        let red: Vec<f32> = read.layer_data.channel_data.list[2].sample_data.values_as_f32().collect();
        assert_eq!(
            red,
            image.hdr.unwrap().iter().map(|pixel| pixel[0]).collect::<Vec<_>>(),
            "red is stored before blending"
        );
    }

    #[test]
    fn png_is_lossless_and_marked_srgb() {
        let image = sample(31, 17);
        let bytes = encode(Encoding::Png, &image).unwrap();
        assert_eq!(encode(Encoding::Png, &image).unwrap(), bytes);
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(Some(&pixels), image.display.as_ref());
        assert_eq!(reader.info().srgb, Some(png::SrgbRenderingIntent::RelativeColorimetric));
        assert_eq!((reader.info().width, reader.info().height), (31, 17));
    }

    #[test]
    fn raw_encodings_contain_the_unchanged_values() {
        let image = sample(5, 3);
        assert_eq!(encode(Encoding::Rgba8, &image).unwrap(), *image.display.as_ref().unwrap());
        let bytes = encode(Encoding::Rgb32f, &image).unwrap();
        let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        let expected: Vec<f32> = image.hdr.unwrap().iter().flat_map(|pixel| pixel[..3].to_vec()).collect();
        assert_eq!(values, expected);
    }

    #[test]
    fn jpeg_has_the_image_size_and_refuses_larger_ones() {
        let bytes = encode(Encoding::Jpeg, &sample(40, 24)).unwrap();
        assert!(bytes.starts_with(&[0xff, 0xd8]) && bytes.ends_with(&[0xff, 0xd9]));
        let frame_header = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
        let side = |index: usize| u16::from_be_bytes([bytes[frame_header + index], bytes[frame_header + index + 1]]);
        assert_eq!((side(7), side(5)), (40, 24));
        let wide = FrameImage { width: 65_536, height: 1, display: Some(vec![0; 65_536 * 4]), ..sample(1, 1) };
        assert!(matches!(encode(Encoding::Jpeg, &wide), Err(EncodeError::TooLargeForJpeg { .. })));
    }

    /// Returns a picture of stars on black. Each star has a different colour and covers three by three pixels.
    pub(in crate::output) fn coloured_stars() -> FrameImage {
        let mut image = sample(256, 256);
        let pixels = image.display.as_mut().unwrap();
        pixels.chunks_exact_mut(4).for_each(|pixel| pixel.copy_from_slice(&[0, 0, 0, 255]));
        for star in 0..400_usize {
            let (x, y) = (2 + star % 20 * 12 + star * 7 % 9, 2 + star / 20 * 12 + star * 5 % 9);
            let warm = (star * 37 % 100) as f64 / 100.0;
            for (offset, share) in
                (0..9).map(|offset| (offset, [0.25, 0.5, 0.25][offset % 3] * [0.25, 0.5, 0.25][offset / 3]))
            {
                let index = 4 * ((y + offset / 3 - 1) * 256 + x + offset % 3 - 1);
                let rgb = [0.6 + 0.4 * warm, 0.75, 1.0 - 0.5 * warm].map(|c| (255.0 * c * 4.0 * share) as u8);
                pixels[index..index + 3].copy_from_slice(&rgb);
            }
        }
        image
    }

    fn decoded_jpeg(jpeg: &[u8]) -> Vec<u8> {
        zune_jpeg::JpegDecoder::new(Cursor::new(jpeg)).decode().unwrap()
    }

    /// Returns the root mean square of R - B over the pixels of stars, and that of the error of R - B in a decoded image (R, G, B).
    pub(in crate::output) fn colour_and_error(image: &FrameImage, decoded: &[u8]) -> [f64; 2] {
        let original = image.display.as_ref().unwrap().chunks_exact(4);
        let pairs = original.zip(decoded.chunks_exact(3)).filter(|(pixel, _)| pixel[..3].iter().any(|code| *code > 20));
        let difference = |pixel: &[u8]| f64::from(pixel[0]) - f64::from(pixel[2]);
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for (pixel, found) in pairs {
            sums[0] += difference(pixel).powi(2);
            sums[1] += (difference(pixel) - difference(found)).powi(2);
            count += 1.0;
        }
        sums.map(|sum: f64| (sum / count).sqrt())
    }

    #[test]
    fn stars_keep_their_colours_in_jpeg() {
        let image = coloured_stars();
        let [colour, error] = colour_and_error(&image, &decoded_jpeg(&encode(Encoding::Jpeg, &image).unwrap()));
        println!("R - B {colour:.1}, its error {error:.2}");
        assert!(colour > 20.0 && error < 4.0, "{colour} {error}");
        // For comparison, use the standard table of the quality for colour.
        let mut coarse = Vec::new();
        let mut encoder = jpeg_encoder::Encoder::new(&mut coarse, 92);
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_1_1);
        let pixels = image.display.as_ref().unwrap();
        encoder.encode(pixels, 256, 256, jpeg_encoder::ColorType::Rgba).unwrap();
        let [_, of_coarse] = colour_and_error(&image, &decoded_jpeg(&coarse));
        assert!(of_coarse > 2.0 * error, "{of_coarse} {error}");
    }

    #[test]
    fn missing_or_short_buffer_is_an_error() {
        for encoding in
            [Encoding::Rgba8, Encoding::Png, Encoding::Jpeg, Encoding::H264, Encoding::Rgb32f, Encoding::Exr]
        {
            let wanted = encoding.wanted();
            assert!(wanted.display != wanted.reads_hdr());
            let mut image = sample(4, 4);
            if wanted.reads_hdr() {
                image.hdr = None
            } else {
                image.display = None
            }
            assert!(matches!(encode(encoding, &image), Err(EncodeError::Missing { .. })), "{encoding:?}");
            let image = FrameImage { width: 5, ..sample(4, 4) };
            assert!(matches!(encode(encoding, &image), Err(EncodeError::Length { .. })), "{encoding:?}");
        }
    }
}

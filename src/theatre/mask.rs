//! Masks of projectors: PNG of 8 or 16 bits, grey or coloured, decoded to linear light.

use std::path::Path;

use png::{BitDepth, ColorType, Transformations};

use super::{MOST_BYTES, Reader, TheatreError, fault::Fault};
use crate::{files, view::projector::Weights};

/// Maximum width or height of a mask.
const MOST_SIDE_PX: u32 = 8192;

const ALLOWED: &str = "must be a PNG of 8 or 16 bits of at most 8192 x 8192 pixels: grey, RGB, or black or white with the mask in the alpha channel";

/// Factors for the pixels of a projector's raster. The mask may have a different size.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Values per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Row by row from the top, 0 to 1, linear light (`gammaEmbedded` undone); values at pixel centres.
    pub values: Vec<f32>,
    /// Largest code of the file: 255 or 65535.
    pub levels: u32,
}

impl Mask {
    /// The value at a position of the raster (0 to 1, right and down), linear between the centres of pixels.
    fn at(&self, x: f64, y: f64) -> f32 {
        let along = |share: f64, count: usize| {
            let place = (share * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let first = place.floor() as usize;
            (first, (first + 1).min(count - 1), (place - first as f64) as f32)
        };
        let ((left, right, across), (top, bottom, down)) = (along(x, self.width), along(y, self.height));
        let value = |column: usize, row: usize| self.values[row * self.width + column];
        let mixed = |row: usize| value(left, row) * (1.0 - across) + value(right, row) * across;
        mixed(top) * (1.0 - down) + mixed(bottom) * down
    }

    /// Returns the values with their size.
    pub fn weights(&self) -> Weights<'_> {
        Weights { size: [self.width, self.height], values: &self.values }
    }
}

/// A mask, and other properties of its file.
pub(super) struct Decoded {
    pub mask: Mask,
    pub components: u32,
    pub bits: u32,
    /// Whether the channels differ, so that the luminance was used.
    pub coloured: bool,
    /// Whether the values come from its alpha channel.
    pub from_alpha: bool,
}

/// Reads a mask from a PNG; `gamma` is the exponent that converts its codes to light (1 = linear).
///
/// # Errors
///
/// See [`TheatreError`].
pub fn read_mask(path: &Path, gamma: f64) -> Result<Mask, TheatreError> {
    let bytes =
        files::read_bounded(path, MOST_BYTES).map_err(|source| TheatreError::Read { path: path.to_owned(), source })?;
    let decoded = decode(&bytes, gamma, &mut |_, _| Ok(())).map_err(|fault| fault.of_file(path))?;
    Ok(decoded.mask)
}

/// Largest relative difference between the aspect ratios of a mask and its raster that causes no note.
const STRETCHED: f64 = 0.02;

impl Reader<'_> {
    /// Adds a note if a mask and its raster have different aspect ratios: the mask may belong to a raster in portrait format, or to another
    /// projector.
    pub(super) fn note_shape(&mut self, place: &str, mask: &Mask, [width, height]: [u32; 2]) {
        let [across, down] = [mask.width as f64 / f64::from(width), mask.height as f64 / f64::from(height)];
        // Rounding to whole pixels also changes the ratio.
        let rounding = 1.0 / mask.width as f64 + 1.0 / mask.height as f64;
        if (across / down - 1.0).abs() > STRETCHED + rounding {
            self.note(format!(
                "{place}: the mask has {} x {} pixels, which are stretched over a raster of {width} x {height}",
                mask.width, mask.height
            ));
        }
    }

    /// Adds a note if a mask is black everywhere.
    pub(super) fn note_black(&mut self, place: &str, mask: &Mask) {
        if mask.values.iter().all(|value| *value == 0.0) {
            self.note(format!("{place}: the mask is black everywhere: nothing is shown"));
        }
    }
}

/// Checks the exponent of a mask.
pub(super) fn check_gamma(gamma: f64) -> Result<f64, Fault> {
    if (0.1..=10.0).contains(&gamma) {
        Ok(gamma)
    } else {
        Err(Fault::new("gamma", format!("{gamma}"), "must be between 0.1 and 10 (1 is linear)"))
    }
}

/// Returns the product of two masks, with the larger of their sizes.
pub(super) fn product(first: &Mask, second: &Mask) -> Mask {
    let (width, height) = (first.width.max(second.width), first.height.max(second.height));
    let share = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
    let places = (0..height).flat_map(|j| (0..width).map(move |i| (share(i, width), share(j, height))));
    let values = places.map(|(x, y)| first.at(x, y) * second.at(x, y)).collect();
    Mask { width, height, values, levels: first.levels.max(second.levels) }
}

/// Decodes a mask. `take` is called with the width and the height before memory for the pixels is allocated.
pub(super) fn decode(
    bytes: &[u8],
    gamma: f64,
    take: &mut dyn FnMut(u32, u32) -> Result<(), Fault>,
) -> Result<Decoded, Fault> {
    let gamma = check_gamma(gamma)?;
    let bad = |problem: String| Fault::new("mask", problem, ALLOWED);
    let broken = |error: png::DecodingError| bad(format!("not readable ({error})"));
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(broken)?;
    let (width, height) = (header.width, header.height);
    if width > MOST_SIDE_PX || height > MOST_SIDE_PX {
        return Err(bad(format!("{width} x {height} pixels")));
    }
    take(width, height)?;
    let mut reader = decoder.read_info().map_err(broken)?;
    // The decoder does not check the length of a palette, and panics.
    if let Some(palette) = &reader.info().palette
        && (palette.is_empty() || palette.len() % 3 != 0 || palette.len() > 3 * 256)
    {
        return Err(bad(format!("its palette has {} bytes", palette.len())));
    }
    let (colour, depth) = reader.output_color_type();
    let (channels, colours) = match colour {
        ColorType::Grayscale => (1, 1),
        ColorType::GrayscaleAlpha => (2, 1),
        ColorType::Rgb => (3, 3),
        ColorType::Rgba => (4, 3),
        ColorType::Indexed => return Err(bad("a palette without colours".to_owned())),
    };
    let (levels, bytes_each): (u16, usize) = match depth {
        BitDepth::Eight => (255, 1),
        BitDepth::Sixteen => (65535, 2),
        _ => return Err(bad(format!("{} bits", depth as u8))),
    };
    let length = reader.output_buffer_size().ok_or_else(|| bad("it is too large".to_owned()))?;
    let mut codes = vec![0; length];
    reader.next_frame(&mut codes).map_err(broken)?;
    let light: Vec<f32> = (0..=levels).map(|code| (f64::from(code) / f64::from(levels)).powf(gamma) as f32).collect();
    let code = |texel: &[u8], channel: usize| {
        let first = channel * bytes_each;
        if bytes_each == 1 { u16::from(texel[first]) } else { u16::from_be_bytes([texel[first], texel[first + 1]]) }
    };
    let texels = || codes.chunks_exact(channels * bytes_each);
    let from_alpha = channels > colours && texels().any(|texel| code(texel, colours) != levels);
    if from_alpha {
        // If the colour is black everywhere or white everywhere, the alpha channel is the mask.
        let plain = |wanted: u16| texels().all(|texel| (0..colours).all(|channel| code(texel, channel) == wanted));
        if !plain(0) && !plain(levels) {
            return Err(bad(
                "its alpha channel is not opaque everywhere, and its colour is neither black nor white everywhere"
                    .to_owned(),
            ));
        }
    }
    let mut coloured = false;
    let mut values = Vec::with_capacity(width as usize * height as usize);
    for texel in texels() {
        let linear = |channel: usize| light[usize::from(code(texel, channel))];
        let grey = colours == 1 || (code(texel, 0) == code(texel, 1) && code(texel, 1) == code(texel, 2));
        values.push(if from_alpha {
            linear(colours)
        } else if grey {
            linear(0)
        } else {
            coloured = true;
            // The luminance as ITU-R BT.709 defines it.
            0.2126 * linear(0) + 0.7152 * linear(1) + 0.0722 * linear(2)
        });
    }
    if values.len() != width as usize * height as usize {
        return Err(bad(format!("{} of {width} x {height} pixels", values.len())));
    }
    let mask = Mask { width: width as usize, height: height as usize, values, levels: u32::from(levels) };
    Ok(Decoded { mask, components: colours as u32, bits: 8 * bytes_each as u32, coloured, from_alpha })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    fn png(colour: ColorType, depth: BitDepth, bytes: &[u8]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        file
    }

    fn read(bytes: &[u8], gamma: f64) -> Result<Decoded, Fault> {
        decode(bytes, gamma, &mut |_, _| Ok(()))
    }

    #[test]
    fn codes_are_converted_to_light_with_the_embedded_gamma() {
        let eight = png(ColorType::Grayscale, BitDepth::Eight, &[0, 128]);
        let linear = read(&eight, 1.0).unwrap();
        assert_eq!((linear.mask.levels, linear.components, linear.bits), (255, 1, 8));
        assert!((linear.mask.values[1] - 128.0 / 255.0).abs() < 1e-7);
        let embedded = read(&eight, 2.2).unwrap();
        assert!((embedded.mask.values[1] - (128.0f32 / 255.0).powf(2.2)).abs() < 1e-6);
        assert!((embedded.mask.values[1] - linear.mask.values[1]).abs() > 0.2);
        let sixteen =
            png(ColorType::Rgb, BitDepth::Sixteen, &[0x80, 0, 0x80, 0, 0x80, 0, 255, 255, 255, 255, 255, 255]);
        let sixteen = read(&sixteen, 1.0).unwrap();
        assert_eq!((sixteen.mask.levels, sixteen.components, sixteen.coloured), (65535, 3, false));
        assert!((sixteen.mask.values[0] - 32768.0 / 65535.0).abs() < 1e-7);
        assert_eq!(sixteen.mask.values[1], 1.0);
    }

    #[test]
    fn masks_of_two_sizes_are_multiplied_at_the_larger_one() {
        let mask = |width: usize, values: &[f32]| Mask { width, height: 1, values: values.to_vec(), levels: 255 };
        let both = product(&mask(4, &[1.0, 0.5, 0.5, 1.0]), &mask(2, &[0.0, 1.0]));
        assert_eq!((both.width, both.height), (4, 1));
        assert_eq!(both.values, [0.0, 0.125, 0.375, 1.0]);
    }

    #[test]
    fn colour_is_reported_and_transparency_is_a_mask_over_one_colour() {
        let coloured = read(&png(ColorType::Rgb, BitDepth::Eight, &[255, 0, 0, 9, 9, 9]), 1.0).unwrap();
        assert!(coloured.coloured && (coloured.mask.values[0] - 0.2126).abs() < 1e-6);
        assert!(read(&png(ColorType::GrayscaleAlpha, BitDepth::Eight, &[9, 255, 9, 255]), 1.0).is_ok());
        assert!(read(&png(ColorType::GrayscaleAlpha, BitDepth::Eight, &[9, 255, 9, 254]), 1.0).is_err());
        for colour in [0, 255] {
            let grey = png(ColorType::GrayscaleAlpha, BitDepth::Eight, &[colour, 255, colour, 51]);
            let rgba =
                png(ColorType::Rgba, BitDepth::Eight, &[colour, colour, colour, 255, colour, colour, colour, 51]);
            for file in [grey, rgba] {
                let decoded = read(&file, 1.0).unwrap();
                assert_eq!((decoded.from_alpha, &decoded.mask.values[..]), (true, &[1.0, 0.2][..]));
            }
        }
        assert!(read(&png(ColorType::Grayscale, BitDepth::Eight, &[0, 1]), 0.0).is_err());
        assert!(read(b"no picture", 1.0).is_err());
    }
}

//! Encodes JPEG in bands. Bands of rows are encoded on all cores, and joined into one file at restart markers (ITU-T
//! T.81, annex E), at which the coder starts again.

use jpeg_encoder::{ColorType, EncodingError, QuantizationTableType, SamplingFactor};
use rayon::prelude::*;

/// Quality, 0 to 100.
const QUALITY: u8 = 92;

/// Quantisation step of every frequency of the two colour differences. The standard table of this quality rounds high
/// frequencies so coarsely that stars, a few pixels wide, lose their colour.
const CHROMA_STEP: u16 = 3;

/// Side of a block, pixels.
const BLOCK: usize = 8;
/// Rows of blocks in a band; fewer if the band would exceed the blocks of a restart interval.
const ROWS: usize = 16;

/// Encodes an image (R, G, B, A row by row from the top; sides of 1 to 65535 pixels). The bytes do not depend on the
/// number of cores.
pub(super) fn encode(pixels: &[u8], width: u16, height: u16) -> Result<Vec<u8>, EncodingError> {
    let across = usize::from(width).div_ceil(BLOCK).max(1);
    let rows = (usize::from(u16::MAX) / across).clamp(1, ROWS);
    let band = rows * BLOCK * usize::from(width) * 4;
    if pixels.len() <= band {
        return encode_band(pixels, width);
    }
    let bands = pixels.par_chunks(band).map(|pixels| encode_band(pixels, width));
    let bands: Vec<Vec<u8>> = bands.collect::<Result<_, _>>()?;
    let interval = u16::try_from(rows * across).unwrap_or(u16::MAX);
    Ok(join_bands(&bands, height, interval))
}

fn encode_band(pixels: &[u8], width: u16) -> Result<Vec<u8>, EncodingError> {
    let height = u16::try_from(pixels.len() / 4 / usize::from(width)).unwrap_or(u16::MAX);
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, QUALITY);
    // Stars are a few pixels wide: halved colour resolution would spread their colour over black.
    encoder.set_sampling_factor(SamplingFactor::F_1_1);
    let fine = QuantizationTableType::Custom(Box::new([CHROMA_STEP; 64]));
    encoder.set_quantization_tables(QuantizationTableType::Default, fine);
    encoder.encode(pixels, width, height, ColorType::Rgba)?;
    Ok(bytes)
}

/// Second bytes of markers, after 0xff.
const FRAME: u8 = 0xc0;
const SCAN: u8 = 0xda;
const RESTART_INTERVAL: u8 = 0xdd;
const RESTART: u8 = 0xd0;
const END: [u8; 2] = [0xff, 0xd9];

/// Joins the files of the bands into one file. All of them have the same tables.
fn join_bands(bands: &[Vec<u8>], height: u16, interval: u16) -> Vec<u8> {
    let mut all = Vec::with_capacity(bands.iter().map(Vec::len).sum::<usize>() + 16);
    for (number, band) in bands.iter().enumerate() {
        let segments = segments(band);
        let data = segments.last().map_or(band.len(), |scan| scan.end);
        if number == 0 {
            all.extend(&band[..2]);
            for Segment { marker, start, end } in segments {
                if marker == SCAN {
                    all.extend([0xff, RESTART_INTERVAL, 0, 4]);
                    all.extend(interval.to_be_bytes());
                }
                let written = all.len();
                all.extend(&band[start..end]);
                if marker == FRAME {
                    // The height follows the marker, the length and the precision.
                    all[written + 5..written + 7].copy_from_slice(&height.to_be_bytes());
                }
            }
        } else {
            all.extend([0xff, RESTART + ((number - 1) % 8) as u8]);
        }
        all.extend(&band[data..band.len() - END.len()]);
    }
    all.extend(END);
    all
}

/// The byte range of a marker with its parameters in a file.
struct Segment {
    marker: u8,
    start: usize,
    end: usize,
}

/// Returns the segments before the coded data; the last one starts the scan.
fn segments(file: &[u8]) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    let mut start = 2;
    while segments.last().is_none_or(|segment| segment.marker != SCAN)
        && let Some([0xff, marker, high, low]) = file.get(start..start + 4)
    {
        let end = start + 2 + usize::from(u16::from_be_bytes([*high, *low]));
        segments.push(Segment { marker: *marker, start, end });
        start = end;
    }
    segments
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use std::io::Cursor;

    use zune_jpeg::zune_core::options::DecoderOptions;

    use super::*;

    fn image(width: usize, height: usize) -> Vec<u8> {
        let pixel = |index: usize| [(index % width) as u8, (index / width) as u8, (index * 7 % 251) as u8, 255];
        (0..width * height).flat_map(pixel).collect()
    }

    fn decoded(file: &[u8]) -> Vec<u8> {
        let options = DecoderOptions::default().set_max_width(65_535);
        zune_jpeg::JpegDecoder::new_with_options(Cursor::new(file), options).decode().unwrap()
    }

    #[test]
    fn bands_decode_like_a_single_encoding() {
        // Test one band, two bands, many bands (restart markers count modulo eight), a last band of one row, and odd sides.
        for [width, height] in [[33, 128], [40, 129], [17, 2000], [64, 1280], [300, 385]] {
            let pixels = image(width, height);
            let bands = encode(&pixels, width as u16, height as u16).unwrap();
            let whole = encode_band(&pixels, width as u16).unwrap();
            let markers =
                bands.windows(2).filter(|two| two[0] == 0xff && (RESTART..RESTART + 8).contains(&two[1])).count();
            assert_eq!(markers, (height - 1) / (ROWS * BLOCK), "{width} x {height}");
            assert_eq!(decoded(&bands), decoded(&whole), "{width} x {height}");
        }
    }

    #[test]
    fn restart_intervals_fit_their_field_for_wide_images() {
        let [width, height] = [65_535, 72];
        let pixels = image(width, height);
        let bands = encode(&pixels, width as u16, height as u16).unwrap();
        let position = bands.windows(2).position(|two| two == [0xff, RESTART_INTERVAL]).unwrap();
        let interval = u16::from_be_bytes([bands[position + 4], bands[position + 5]]);
        assert_eq!(usize::from(interval), 7 * width.div_ceil(BLOCK));
        assert_eq!(decoded(&bands).len(), 3 * width * height);
        // Check that this comparison detects wrongly joined bands.
        let narrow = image(40, 300);
        let file = |interval| {
            let bands: Vec<Vec<u8>> = narrow.chunks(40 * 128 * 4).map(|band| encode_band(band, 40).unwrap()).collect();
            join_bands(&bands, 300, interval)
        };
        assert_eq!(file(16 * 5), encode(&narrow, 40, 300).unwrap());
        let wrong = zune_jpeg::JpegDecoder::new(Cursor::new(file(16 * 4))).decode();
        assert!(wrong.map_or(true, |pixels| pixels != decoded(&file(16 * 5))));
    }
}

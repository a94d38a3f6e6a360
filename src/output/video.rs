//! H.264: the pictures of a stream, each coded relative to the previous one.
//!
//! Colours are as in the display image: primaries and matrix of BT.709, transfer function of sRGB, full range; the stream declares this. The colour
//! differences have half the resolution (4:2:0), which is all that decoders of browsers support. Their pixels are about as wide as a star. Therefore
//! the colours of the pixels in a square are averaged with weights proportional to their light, so that black pixels next to a star do not dilute its
//! colour.

use std::fmt;

use rusty_h264_common::YuvPlanes;
use rusty_h264_encoder::{Encoder, EncoderConfig};

use super::encode::{EncodeError, Encoding, display_of};
use crate::render::FrameImage;

/// Quantisation parameter, 0 to 51. This value causes errors of about one code of 255 in dark areas.
const QP: u8 = 18;

/// Maximum number of macroblocks (16 x 16 pixels) in a picture, and along a side. They are the limits of level 5.2, the
/// highest that decoders commonly support.
const MOST_MACROBLOCKS: u32 = 36_864;
const LONGEST_SIDE: u32 = 543;

/// Encodes pictures of one size. The first one is coded independently. Each later one is coded relative to the previous one, unless a key picture is
/// requested.
pub struct VideoEncoder {
    size: [u32; 2],
    encoder: Encoder,
    planes: Planes,
}

impl fmt::Debug for VideoEncoder {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("VideoEncoder").field("size", &self.size).finish_non_exhaustive()
    }
}

impl VideoEncoder {
    /// Creates an encoder for pictures of `width` x `height` pixels. If a side is odd, the last column or row is coded
    /// twice.
    ///
    /// # Errors
    ///
    /// [`EncodeError::TooLargeForH264`]: the picture is empty or larger than level 5.2 allows.
    pub fn new(width: u32, height: u32) -> Result<Self, EncodeError> {
        let [across, down] = [width, height].map(|side| side.div_ceil(16));
        let sides = [across, down].iter().all(|side| (1..=LONGEST_SIDE).contains(side));
        if !sides || across * down > MOST_MACROBLOCKS {
            return Err(EncodeError::TooLargeForH264 { width, height });
        }
        let planes = Planes::new(even(width, height));
        let encoder = Encoder::new(settings(planes.size)).map_err(|error| EncodeError::H264(error.to_string()))?;
        Ok(Self { size: [width, height], encoder, planes })
    }

    /// Approximate memory of an encoder for pictures of this size, bytes.
    pub fn memory_bytes(width: u32, height: u32) -> u64 {
        let size = even(width, height);
        (settings(size).memory_estimate().total + size[0] * size[1] * 3 / 2) as u64
    }

    /// Encodes the next picture as an access unit of Annex B: NAL units after start codes. A key picture, which does
    /// not refer to others, is preceded by the parameter sets.
    ///
    /// # Errors
    ///
    /// The display image is missing or has another size; the encoder is then unchanged.
    pub fn encode(&mut self, image: &FrameImage, key: bool) -> Result<Vec<u8>, EncodeError> {
        let pixels = display_of(image, Encoding::H264)?;
        let [width, height] = self.size;
        if [image.width, image.height] != self.size {
            let expected = width as usize * height as usize * 4;
            return Err(EncodeError::Length { width, height, expected, found: pixels.len() });
        }
        self.planes.fill(pixels, self.size.map(|side| side as usize));
        if key {
            self.encoder.request_keyframe();
        }
        let Planes { size: [width, height], luma, blue, red } = &self.planes;
        let planes = YuvPlanes::tight(*width, *height, luma, blue, red);
        let planes = planes.ok_or_else(|| EncodeError::H264("the planes do not match the size".into()))?;
        let coded = self.encoder.encode_planes(&planes).map_err(|error| EncodeError::H264(error.to_string()))?;
        Ok(with_usability(&coded))
    }
}

fn even(width: u32, height: u32) -> [usize; 2] {
    [width, height].map(|side| side.next_multiple_of(2) as usize)
}

fn settings([width, height]: [usize; 2]) -> EncoderConfig {
    let mut settings = EncoderConfig::baseline(width, height);
    settings.qp = QP;
    // Key pictures are requested explicitly.
    settings.gop_size = u32::MAX;
    settings.i_qp_offset = 0;
    settings.aq_strength = 0.0;
    settings
}

/// Luma, and the colour differences at half the resolution.
struct Planes {
    /// Size in pixels, even.
    size: [usize; 2],
    luma: Vec<u8>,
    blue: Vec<u8>,
    red: Vec<u8>,
}

/// Weights of red, green and blue in the luma of BT.709, in 65536ths.
const LUMA: [u32; 3] = [13_933, 46_871, 4_732];
/// Ranges of the colour differences of BT.709: blue and red minus luma.
const BLUE_RANGE: f32 = 1.8556;
const RED_RANGE: f32 = 1.5748;

impl Planes {
    fn new(size: [usize; 2]) -> Self {
        let pixels = size[0] * size[1];
        Self { size, luma: vec![0; pixels], blue: vec![0; pixels / 4], red: vec![0; pixels / 4] }
    }

    /// Fills the planes from the pixels of an image (R, G, B, A) with size `from`.
    fn fill(&mut self, image: &[u8], from: [usize; 2]) {
        let width = self.size[0];
        let row = |y: usize| &image[y.min(from[1] - 1) * from[0] * 4..][..from[0] * 4];
        let differences = self.blue.chunks_exact_mut(width / 2).zip(self.red.chunks_exact_mut(width / 2));
        for (y, (luma, (blue, red))) in self.luma.chunks_exact_mut(2 * width).zip(differences).enumerate() {
            let rows = [row(2 * y), row(2 * y + 1)];
            let (upper, lower) = luma.split_at_mut(width);
            let lumas = upper.chunks_exact_mut(2).zip(lower.chunks_exact_mut(2));
            for (x, ((upper, lower), (blue, red))) in lumas.zip(blue.iter_mut().zip(red)).enumerate() {
                let columns = [2 * x, (2 * x + 1).min(from[0] - 1)];
                let mut weights = 0;
                let mut sums = [0; 3];
                for (row, lumas) in rows.iter().zip([upper, lower]) {
                    for (column, luma) in columns.iter().zip(lumas) {
                        let colour = [0, 1, 2].map(|channel| u32::from(row[4 * column + channel]));
                        *luma = luma_of(colour);
                        let weight = colour.iter().sum::<u32>() + 1;
                        weights += weight;
                        sums = [0, 1, 2].map(|channel| sums[channel] + weight * colour[channel]);
                    }
                }
                let mean = sums.map(|sum| sum as f32 / weights as f32);
                let luma = [0, 1, 2].map(|channel| LUMA[channel] as f32 / 65_536.0 * mean[channel]).iter().sum::<f32>();
                *blue = (128.5 + (mean[2] - luma) / BLUE_RANGE) as u8;
                *red = (128.5 + (mean[0] - luma) / RED_RANGE) as u8;
            }
        }
    }
}

fn luma_of(colour: [u32; 3]) -> u8 {
    let sum: u32 = colour.iter().zip(LUMA).map(|(value, weight)| value * weight).sum();
    ((sum + (1 << 15)) >> 16) as u8
}

/// Type of the NAL unit that holds a sequence parameter set.
const SEQUENCE_PARAMETERS: u8 = 7;

/// Returns the access unit with video usability information in its sequence parameter set. The original set ends with a
/// flag that says that there is no such information.
fn with_usability(unit: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(unit.len() + 32);
    for nal in nal_units(unit) {
        out.extend([0, 0, 0, 1]);
        if nal.first().is_some_and(|header| header & 31 == SEQUENCE_PARAMETERS) {
            let mut bits = Bits::from_bytes(&unescaped(nal));
            bits.put_usability();
            out.extend(escaped(&bits.bytes()));
        } else {
            out.extend(nal);
        }
    }
    out
}

/// Returns the NAL units of an access unit without their start codes.
fn nal_units(unit: &[u8]) -> Vec<&[u8]> {
    let starts: Vec<usize> =
        unit.windows(3).enumerate().filter(|(_, code)| *code == [0, 0, 1]).map(|(index, _)| index).collect();
    let ends = starts.iter().skip(1).copied().chain([unit.len()]);
    // A start code of four bytes leaves a zero at the end of the preceding unit; no unit ends with a zero.
    let trimmed = |nal: &[u8]| nal.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    starts.iter().zip(ends).map(|(start, end)| &unit[start + 3..end]).map(|nal| &nal[..trimmed(nal)]).collect()
}

/// Removes the escape bytes that prevent start codes inside a NAL unit.
fn unescaped(nal: &[u8]) -> Vec<u8> {
    let mut zeros = 0;
    let is_kept = |byte: &u8| {
        let kept = zeros < 2 || *byte != 3;
        zeros = if kept && *byte == 0 { zeros + 1 } else { 0 };
        kept
    };
    nal.iter().copied().filter(is_kept).collect()
}

/// Inserts the escape bytes that prevent start codes inside a NAL unit.
fn escaped(nal: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(nal.len() + 4);
    for byte in nal {
        if matches!(out.as_slice(), [.., 0, 0]) && *byte <= 3 {
            out.push(3);
        }
        out.push(*byte);
    }
    out
}

/// Bits of a NAL unit, most significant first.
struct Bits(Vec<bool>);

impl Bits {
    fn from_bytes(bytes: &[u8]) -> Self {
        Self(bytes.iter().flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1 == 1)).collect())
    }

    fn put(&mut self, value: u32, bits: u32) {
        self.0.extend((0..bits).rev().map(|bit| value >> bit & 1 == 1));
    }

    /// Appends an exponential Golomb code.
    fn put_code(&mut self, value: u32) {
        let digits = (value + 1).ilog2();
        self.put(0, digits);
        self.put(value + 1, digits + 1);
    }

    /// Replaces the flag that there is no video usability information, the last bit before the stop bit, by that
    /// information (ITU-T H.264, annex E).
    fn put_usability(&mut self) {
        let stop = self.0.iter().rposition(|bit| *bit).unwrap_or_default();
        self.0.truncate(stop.saturating_sub(1));
        self.put(1, 1);
        // There is no aspect ratio and no overscan. The video signal has an unspecified format, full range, and a colour description.
        self.put(0b001, 3);
        self.put(0b10111, 5);
        for code in [BT709, SRGB_TRANSFER, BT709] {
            self.put(code, 8);
        }
        // Chroma samples lie at the centre of four pixels, in both fields.
        self.put(1, 1);
        self.put_code(1);
        self.put_code(1);
        // There is no timing, no parameter of a hypothetical decoder (two flags), and no picture structure.
        self.put(0, 4);
        // Restrictions: motion vectors may point outside of the picture; no limits on the bits of a picture or a macroblock; vectors of any length;
        // pictures are not reordered, and one reference picture is kept. Decoders thus show each picture immediately.
        self.put(0b11, 2);
        for code in [0, 0, 16, 16, 0, 1] {
            self.put_code(code);
        }
        self.put(1, 1);
    }

    fn bytes(&self) -> Vec<u8> {
        let byte =
            |bits: &[bool]| bits.iter().enumerate().fold(0, |byte, (index, bit)| byte | u8::from(*bit) << (7 - index));
        self.0.chunks(8).map(byte).collect()
    }
}

/// Code of BT.709 for primaries and for the matrix (ITU-T H.273).
const BT709: u32 = 1;
/// Code of the transfer function of sRGB.
const SRGB_TRANSFER: u32 = 13;

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use rusty_h264_decoder::Decoder;

    use super::*;
    use crate::output::encode::tests::{colour_and_error, coloured_stars, sample};

    /// Decodes all pictures, and returns the last one as a display image.
    fn decoded(units: &[Vec<u8>], [width, height]: [usize; 2]) -> Vec<u8> {
        let mut decoder = Decoder::new();
        let pictures: Vec<_> = units.iter().filter_map(|unit| decoder.decode(unit).unwrap()).collect();
        assert_eq!(pictures.len(), units.len(), "every picture is returned as soon as it is passed in");
        let picture = pictures.last().unwrap();
        assert_eq!([picture.width, picture.height], [width, height].map(|side| side.next_multiple_of(2)));
        let mut pixels = Vec::new();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let half = y / 2 * (picture.width / 2) + x / 2;
            let luma = f64::from(picture.y[y * picture.width + x]);
            let [blue, red] = [picture.u[half], picture.v[half]].map(|code| f64::from(code) - 128.0);
            let [red, blue] = [luma + 1.5748 * red, luma + 1.8556 * blue];
            let green = (luma - 0.2126 * red - 0.0722 * blue) / 0.7152;
            pixels.extend([red, green, blue].map(|code| code.round().clamp(0.0, 255.0) as u8));
        }
        pixels
    }

    fn moved(image: &FrameImage, by: usize) -> FrameImage {
        let mut moved = image.clone();
        moved.display.as_mut().unwrap().rotate_right(4 * by);
        moved
    }

    #[test]
    fn pictures_are_coded_in_sequence_and_key_pictures_independently() {
        let first = coloured_stars();
        let [second, third] = [1, 2].map(|by| moved(&first, by));
        let mut encoder = VideoEncoder::new(256, 256).unwrap();
        let units =
            [(&first, false), (&second, false), (&third, true)].map(|(image, key)| encoder.encode(image, key).unwrap());
        let types = |unit: &[u8]| nal_units(unit).iter().map(|nal| nal[0] & 31).collect::<Vec<u8>>();
        assert_eq!(units.each_ref().map(|unit| types(unit)), [vec![7, 8, 5], vec![1], vec![7, 8, 5]]);
        let rms = |image: &FrameImage, found: &[u8]| {
            let pixels = image.display.as_ref().unwrap().chunks_exact(4);
            let errors = pixels.zip(found.chunks_exact(3)).map(|(pixel, found)| {
                let luma =
                    |rgb: &[u8]| rgb.iter().zip([0.2126, 0.7152, 0.0722]).map(|(c, w)| f64::from(*c) * w).sum::<f64>();
                (luma(&pixel[..3]) - luma(found)).powi(2)
            });
            (errors.sum::<f64>() / (256.0 * 256.0)).sqrt()
        };
        for (image, units) in [(&first, &units[..1]), (&second, &units[..2]), (&third, &units[2..])] {
            let error = rms(image, &decoded(units, [256, 256]));
            println!("luma, rms: {error:.2} codes");
            assert!(error < 6.0, "{error}");
        }
        assert!(rms(&first, &decoded(&units[..2], [256, 256])) > 12.0, "the second picture differs from the first one");
        // The same pictures give the same bytes, and a still picture needs few bytes.
        let mut again = VideoEncoder::new(256, 256).unwrap();
        assert_eq!(again.encode(&first, true).unwrap(), units[0]);
        assert!(again.encode(&first, false).unwrap().len() * 20 < units[0].len());
    }

    #[test]
    fn stars_keep_more_colour_than_with_a_plain_mean() {
        let image = coloured_stars();
        let unit = VideoEncoder::new(256, 256).unwrap().encode(&image, true).unwrap();
        let [colour, error] = colour_and_error(&image, &decoded(&[unit], [256, 256]));
        println!("R - B {colour:.1}, its error {error:.2}");
        // At half the resolution, about half of the colour difference is lost.
        assert!(error < 0.6 * colour, "{colour} {error}");
    }

    #[test]
    fn area_colours_are_bt_709_full_range() {
        for colour in [[0, 0, 0], [255, 255, 255], [200, 30, 40], [10, 180, 60], [30, 40, 220]] {
            let mut image = sample(35, 18);
            let fill = |pixel: &mut [u8]| pixel[..3].copy_from_slice(&colour);
            image.display.as_mut().unwrap().chunks_exact_mut(4).for_each(fill);
            // Include odd sides.
            let unit = VideoEncoder::new(35, 18).unwrap().encode(&image, true).unwrap();
            for found in decoded(&[unit], [35, 18]).chunks_exact(3) {
                assert!(
                    found.iter().zip(colour).all(|(found, code)| found.abs_diff(code) <= 4),
                    "{found:?} {colour:?}"
                );
            }
        }
    }

    #[test]
    fn stream_declares_its_colours_and_no_reordering() {
        let unit = VideoEncoder::new(40, 24).unwrap().encode(&sample(40, 24), true).unwrap();
        let parameters =
            nal_units(&unit).into_iter().find(|nal| nal[0] & 31 == SEQUENCE_PARAMETERS).map(unescaped).unwrap();
        let bits = Bits::from_bytes(&parameters).0;
        let mut usability = Bits(Vec::new());
        usability.put(0, 1);
        usability.put(1, 1);
        usability.put_usability();
        // `put_usability` replaces the stop bit and the flag before it.
        let stop = bits.iter().rposition(|bit| *bit).unwrap();
        assert!(bits[..=stop].ends_with(&usability.0), "{parameters:?}");
        assert_eq!(
            usability.0[..9],
            [true, false, false, true, true, false, true, true, true],
            "signal, full range, colours"
        );
        let colours: Vec<u8> = Bits(usability.0[9..33].to_vec()).bytes();
        assert_eq!(colours, [1, 13, 1]);
    }

    #[test]
    fn escaping_round_trips() {
        for plain in [vec![0, 0, 0, 0, 1], vec![7, 0, 0, 3, 0, 0, 2, 5], vec![0, 0, 3], vec![1, 2, 3]] {
            let safe = escaped(&plain);
            assert!(safe.windows(3).all(|three| three[..2] != [0, 0] || three[2] > 2), "{safe:?}");
            assert_eq!(unescaped(&safe), plain);
        }
        assert_ne!(escaped(&[0, 0, 1]), [0, 0, 1]);
    }

    #[test]
    fn sizes_are_bounded() {
        for [width, height] in [[0, 16], [16, 0], [8_689, 16], [4_096, 2_320], [u32::MAX, u32::MAX]] {
            let refused = VideoEncoder::new(width, height).unwrap_err();
            assert!(matches!(refused, EncodeError::TooLargeForH264 { .. }), "{width} {height}");
        }
        let mut encoder = VideoEncoder::new(16, 16).unwrap();
        assert!(matches!(encoder.encode(&sample(32, 16), false), Err(EncodeError::Length { .. })));
        assert!(VideoEncoder::memory_bytes(1280, 720) < 16 << 20);
    }
}

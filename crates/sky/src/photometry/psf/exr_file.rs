//! Point-spread functions in OpenEXR: 32-bit channels `R`, `G`, `B`, and the angle of a pixel in the header.
//!
//! Files of other programs may lack the header entries and may have half floats or a single channel; alpha and other
//! channels are ignored.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AttributeValue, Encoding, FlatSamples, Image, ImageAttributes, Layer, LayerAttributes, SpecificChannels, Text,
    Vec2, WritableImage,
};

use super::read::{Plane, checked_size};
use super::{ARCSECOND_RAD, Psf, PsfError, SIZES};
use crate::files::{read_exr, write_whole};

/// Header entry: angle of a pixel, arcseconds.
pub const SCALE: &str = "pixelScaleArcsec";

/// Header entry: [`Psf::covered`].
const COVERED: &str = "lightCovered";

/// Largest number of samples of all channels: red, green, blue and alpha of the largest picture.
const MOST_SAMPLES: u64 = 4 * (*SIZES.end() as u64).pow(2);

const ALLOWED: &str = "a square OpenEXR image with channels R, G and B, or a single channel";

/// Writes a texture; the file appears as a whole or not at all. The same texture gives the same bytes.
pub fn write_exr(path: &Path, psf: &Psf) -> Result<(), PsfError> {
    let size = psf.size as usize;
    let channels = SpecificChannels::build().with_channel("R").with_channel("G").with_channel("B").with_pixel_fn(
        |pixel: Vec2<usize>| {
            let [red, green, blue] = psf.rgb[pixel.1 * size + pixel.0];
            (red, green, blue)
        },
    );
    let encoding = Encoding {
        compression: exr::prelude::Compression::ZIP16,
        blocks: exr::prelude::Blocks::ScanLines,
        line_order: exr::prelude::LineOrder::Increasing,
    };
    // Entries are written in the order of a hash map: with one in each of the two maps, the order is always the same.
    let mut attributes = LayerAttributes::default();
    attributes.other.insert(Text::from(SCALE), AttributeValue::F64(psf.pixel_rad / ARCSECOND_RAD));
    let layer = Layer::new(Vec2(size, size), attributes, encoding, channels);
    let mut image = Image::from_layer(layer);
    image.attributes.other.insert(Text::from(COVERED), AttributeValue::F64(psf.covered));
    let mut bytes = Cursor::new(Vec::new());
    image
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|source| PsfError::Encode { path: path.to_owned(), source })?;
    write_whole(path, &bytes.into_inner()).map_err(|source| PsfError::Write { path: path.to_owned(), source })
}

/// Reads a number from the header.
fn number(image: &ImageAttributes, layer: &LayerAttributes, name: &str) -> Option<f64> {
    match layer.other.get(&Text::from(name)).or_else(|| image.other.get(&Text::from(name)))? {
        AttributeValue::F64(value) => Some(*value),
        AttributeValue::F32(value) => Some(f64::from(*value)),
        _ => None,
    }
}

/// Reads the picture and its header.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Plane, PsfError> {
    let bad = |problem: String| PsfError::File { path: path.to_owned(), problem, allowed: ALLOWED };
    let unreadable = |error: exr::error::Error| bad(format!("not a readable OpenEXR file ({error})"));
    let few = |width: usize, height: usize, channels: usize| {
        let size = u64::from(checked_size(width, height).map_err(bad)?);
        let too_many = size * size * channels as u64 > MOST_SAMPLES;
        if too_many { Err(bad(format!("{channels} channels of {width} x {height} pixels"))) } else { Ok(()) }
    };
    let image = read_exr(bytes, few, unreadable)?;
    let layer = &image.layer_data;
    let channels = &layer.channel_data.list;
    let named = |name: &str| channels.iter().find(|channel| channel.name == *name);
    let samples: Vec<&FlatSamples> = match (named("R"), named("G"), named("B")) {
        (Some(red), Some(green), Some(blue)) => vec![&red.sample_data, &green.sample_data, &blue.sample_data],
        _ if channels.len() == 1 => vec![&channels[0].sample_data],
        _ => {
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return Err(bad(format!("channels {}", names.join(", "))));
        }
    };
    let channels: Vec<Vec<f64>> =
        samples.into_iter().map(|samples| samples.values_as_f32().map(f64::from).collect()).collect();
    let values = (0..channels[0].len())
        .map(|i| std::array::from_fn(|c| channels.get(c).unwrap_or(&channels[0]).get(i).copied().unwrap_or(f64::NAN)))
        .collect();
    Ok(Plane {
        width: layer.size.0,
        height: layer.size.1,
        values,
        pixel_arcsec: number(&image.attributes, &layer.attributes, SCALE),
        covered: number(&image.attributes, &layer.attributes, COVERED).filter(|c| *c > 0.0 && *c <= 1.1).unwrap_or(1.0),
    })
}

//! Writes images as deterministic OpenEXR files: equal channels and attributes give equal bytes.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, Vec2, WritableImage, f16,
};

use super::encode::EncodeError;
use crate::render::FrameImage;

/// Largest finite 16-bit float.
pub(super) const MOST_HALF: f32 = 65_504.0;

/// Colours as 16-bit floats, in units of the given luminance in cd/m^2.
#[derive(Clone, Copy)]
pub(super) struct HalfOf {
    pub(super) unit_cd_m2: f32,
}

/// Encodes an image: channels `R`, `G`, `B` in cd/m^2 as 32-bit floats or in a custom unit as 16-bit floats; `omega` in sr; and, for a projector
/// whose light is blended with that of others, `alpha`, its share of the light, which is not applied to the colours. `pixels` must match the size of
/// the image.
pub(super) fn exr_of(
    image: &FrameImage,
    pixels: &[[f32; 4]],
    half: Option<HalfOf>,
    attributes: LayerAttributes,
) -> Result<Vec<u8>, EncodeError> {
    let colour = |channel: usize| {
        let values = pixels.iter().map(|pixel| pixel[channel]);
        match half {
            None => FlatSamples::F32(values.collect()),
            Some(HalfOf { unit_cd_m2 }) => {
                let code = |light: f32| f16::from_f32((light / unit_cd_m2).clamp(-MOST_HALF, MOST_HALF));
                FlatSamples::F16(values.map(code).collect())
            }
        }
    };
    // Solid angles stay 32-bit floats: 16-bit floats would round them to 0.
    let omega_sr = FlatSamples::F32(pixels.iter().map(|pixel| pixel[3]).collect());
    let mut channels = vec![("R", colour(0)), ("G", colour(1)), ("B", colour(2)), ("omega", omega_sr)];
    if let Some(blend) = image.projector.as_ref().and_then(|projector| projector.blend()) {
        channels.push(("alpha", FlatSamples::F32(blend.weights().iter().map(|[alpha, _]| *alpha).collect())));
    }
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(Text::from(name), samples));
    // For deterministic files, write the blocks in the order of their rows, and no attribute with a time or a place. Use run-length compression:
    // deflate takes 20 times as long for light with stars, and makes files only a tenth smaller.
    let encoding = Encoding {
        compression: exr::prelude::Compression::RLE,
        blocks: exr::prelude::Blocks::ScanLines,
        line_order: exr::prelude::LineOrder::Increasing,
    };
    let size = Vec2(image.width as usize, image.height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels.collect()));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

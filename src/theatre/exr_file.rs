//! Directions as OpenEXR: channels `R`, `G`, `B` or `x`, `y`, `z` (case-insensitive), 16 or 32 bits.

use exr::prelude::{FlatSamples, Vec2};

use super::{MOST_SIDE, fault::Fault, pfm::Plane};
use crate::files::read_exr;

/// Maximum number of decoded channels: the three channels of directions, and an alpha channel.
const MOST_CHANNELS: usize = 4;

const CHANNELS: &str = "must have channels R, G, B or x, y, z, all as floats";

pub(super) fn is_exr(bytes: &[u8]) -> bool {
    // OpenEXR's magic number 20000630.
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

pub(super) fn decode(bytes: &[u8]) -> Result<Plane, Fault> {
    let bad = |problem: String, allowed: &str| Fault::new("OpenEXR", problem, allowed);
    let unreadable = |error: exr::error::Error| bad(format!("not readable ({error})"), CHANNELS);
    let few = |width: usize, height: usize, channels: usize| {
        if width <= MOST_SIDE && height <= MOST_SIDE && channels <= MOST_CHANNELS {
            return Ok(());
        }
        let allowed = format!("must have at most {MOST_CHANNELS} channels of {MOST_SIDE} x {MOST_SIDE}");
        Err(bad(format!("{channels} channels of {width} x {height} pixels"), &allowed))
    };
    let image = read_exr(bytes, few, unreadable)?;
    let layer = &image.layer_data;
    let list = &layer.channel_data.list;
    let named = |names: [&str; 2]| {
        let found = list.iter().find(|channel| names.iter().any(|name| channel.name == **name))?;
        (!matches!(found.sample_data, FlatSamples::U32(_))).then_some(&found.sample_data)
    };
    let colours = [["R", "R"], ["G", "G"], ["B", "B"]].map(named);
    let axes = [["x", "X"], ["y", "Y"], ["z", "Z"]].map(named);
    let (first, second, third) = match (colours, axes) {
        ([Some(_), Some(_), Some(_)], [Some(_), Some(_), Some(_)]) => {
            return Err(bad("it has both R, G, B and x, y, z".to_owned(), CHANNELS));
        }
        ([Some(a), Some(b), Some(c)], _) | (_, [Some(a), Some(b), Some(c)]) => (a, b, c),
        _ => {
            let names: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
            return Err(bad(format!("channels {}", names.join(", ")), CHANNELS));
        }
    };
    let Vec2(width, height) = layer.size;
    let samples = first.values_as_f32().zip(second.values_as_f32()).zip(third.values_as_f32());
    let values: Vec<[f32; 3]> = samples.map(|((x, y), z)| [x, y, z]).collect();
    if values.len() != width * height {
        return Err(bad(
            format!("{} of {width} x {height} samples", values.len()),
            "every pixel must have a sample of each channel",
        ));
    }
    Ok(Plane { width, height, values })
}

//! Reads the channels of OpenEXR files.

use std::io::Cursor;

use exr::prelude::{ReadChannels, ReadLayers};

/// Returns the values of the named channels.
pub fn channels<const N: usize>(bytes: &[u8], names: [&str; N]) -> [Vec<f32>; N] {
    let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = read.all_attributes().from_buffered(Cursor::new(bytes)).unwrap();
    let list = &image.layer_data.channel_data.list;
    names.map(|name| {
        let channel = list.iter().find(|channel| channel.name == *name).expect(name);
        channel.sample_data.values_as_f32().collect()
    })
}

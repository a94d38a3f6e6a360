// Replaces display/shown.wgsl on adapters that bind too few buffers. There display/tone_map.wgsl writes the display image.

fn show(index: u32, word: u32) {
}

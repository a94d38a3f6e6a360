// Fixed-point sums of R, G and B in four 32-bit words per pixel, for adapters without 64-bit atomics: the low 32 bits
// of each channel, and a word of carries (11 bits for R, 11 for G, 10 for B). R and G are in one buffer, B and the
// carries in another.

#import constants/counters
#import constants/fixed_point

@group(0) @binding(4) var<storage, read_write> pixels: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> high_words: array<atomic<u32>>;

// Not used here. It exists because shared/accumulate_u64.wgsl needs it.
var<private> target_tile: vec3<u32>;

fn add_channel(pixel: u32, channel: u32, value: f32) -> u32 {
    let high = floor(value * (1.0 / 4294967296.0));
    let low = u32(value - high * 4294967296.0);
    if low == 0u {
        return u32(high);
    }
    var before = 0u;
    if channel < 2u {
        before = atomicAdd(&pixels[2u * pixel + channel], low);
    } else {
        before = atomicAdd(&high_words[2u * pixel], low);
    }
    return u32(high) + select(0u, 1u, before + low < before);
}

// Adds `units` (integers) to a pixel. A value that is too large for a channel is counted as an overflow and not added.
fn accumulate(pixel: u32, units: vec3<f32>) {
    if any(units >= vec3(CHANNEL_UNITS)) {
        atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
        return;
    }
    let carries =
        vec3(add_channel(pixel, 0u, units.x), add_channel(pixel, 1u, units.y), add_channel(pixel, 2u, units.z));
    if any(carries != vec3(0u)) {
        let added = carries.x | (carries.y << 11u) | (carries.z << 22u);
        let before = atomicAdd(&high_words[2u * pixel + 1u], added);
        let sums = vec3(before & 0x7ffu, (before >> 11u) & 0x7ffu, before >> 22u) + carries;
        if any(sums > vec3(0x7ffu, 0x7ffu, 0x3ffu)) {
            atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
        }
    }
}

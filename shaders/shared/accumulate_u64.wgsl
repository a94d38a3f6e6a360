// Fixed-point sums of R, G and B in two 64-bit words per pixel: 21 low bits of each in the first, 21 high bits in the
// second. The first words of all pixels lie in one buffer, the second words in another: a faint star costs one atomic add
// per pixel, and its neighbours lie in the same line of the cache. Adding is order-free, so the same frame gives the same bits.
//
// Few stars reach the second words. Where one does, it raises the flag of the pixel's block, and the resolve pass reads
// the second words of raised blocks alone and leaves zeros there for the next frame.
//
// When a low field overflows, its carry runs into the next field: one unit of G per 2^21 units of R (relative 4.8e-7), the
// same whatever the order. The carry is added to the high field by the thread whose add caused it.

#requires u64
#import constants/counters
#import constants/fixed_point
#import constants/pixel_grid
#import shared/pixel_grid

@group(0) @binding(4) var<storage, read_write> pixels: array<atomic<u64>>;
@group(0) @binding(6) var<storage, read_write> high_words: array<atomic<u64>>;

// First pixel, width and first flag of the tile that is drawn into.
var<private> target_tile: vec3<u32>;

// Tells the resolve pass that the block of this pixel has second words.
fn raise_flag(pixel: u32) {
    let row = (pixel - target_tile.x) / target_tile.y;
    let column = pixel - target_tile.x - row * target_tile.y;
    let columns = (target_tile.y + COLUMNS - 1u) / COLUMNS;
    atomicStore(&counters[target_tile.z + row / ROWS * columns + column / COLUMNS], 1u);
}

const FIELD_BITS: u32 = 21u;

fn packed_fields(fields: vec3<u32>) -> u64 {
    let low = fields.x | (fields.y << 21u);
    let high = (fields.y >> 11u) | (fields.z << 10u);
    return u64(low) | (u64(high) << 32u);
}

// Adds `units` (whole numbers) to a pixel; more than a channel can hold is counted as an overflow and not added.
fn accumulate(pixel: u32, units: vec3<f32>) {
    if any(units >= vec3(CHANNEL_UNITS)) {
        atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
        return;
    }
    let high = floor(units * (1.0 / 2097152.0));
    let added = packed_fields(vec3<u32>(units - high * 2097152.0));
    let before = atomicAdd(&pixels[pixel], added);
    // Carries into bit 21, 42 and 63 are carries out of the three fields.
    let carried = (before ^ added ^ (before + added)) & 0x8000040000200000lu;
    if carried != 0lu || any(high > vec3(0.0)) {
        let added_high = (carried >> FIELD_BITS) + packed_fields(vec3<u32>(high));
        let before_high = atomicAdd(&high_words[pixel], added_high);
        raise_flag(pixel);
        if ((before_high ^ added_high ^ (before_high + added_high)) & 0x8000040000200000lu) != 0lu {
            atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
        }
    }
}

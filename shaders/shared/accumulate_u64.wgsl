// Fixed-point sums of R, G and B in two 64-bit words per pixel: the low 21 bits of each channel in the first word, the
// high 21 bits in the second. The first words of all pixels are in one buffer, the second words in another, so a faint
// star costs one atomic addition per pixel, and neighbouring pixels share a cache line. Addition does not depend on the
// order, so the same frame gives the same bits.
//
// Few stars reach the second words. A star that does raises the flag of the pixel's block. The resolve pass reads
// second words of flagged blocks only, and resets them to zero for the next frame.
//
// When a low field overflows, its carry runs into the next field: one unit of G per 2^21 units of R (relative 4.8e-7),
// in any order. The thread whose addition causes the carry adds it to the high field.

#requires u64
#import constants/counters
#import constants/fixed_point
#import constants/pixel_grid
#import shared/pixel_grid

@group(0) @binding(4) var<storage, read_write> pixels: array<atomic<u64>>;
@group(0) @binding(6) var<storage, read_write> high_words: array<atomic<u64>>;

// First pixel, width and first flag of the target tile.
var<private> target_tile: vec3<u32>;

// Marks the block of this pixel as having second words.
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

// Adds `units` (integers) to a pixel. A value that exceeds a channel is counted as an overflow and not added.
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

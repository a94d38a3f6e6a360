// Fixed-point sums of R, G and B in two 64-bit words per pixel: the low 21 bits of each channel in the first word, the
// high 21 bits in the second. The first words of all pixels are in one buffer, the second words in another, so a faint
// star costs one atomic addition per pixel, and neighbouring pixels share a cache line. Addition does not depend on the
// order, so the same frame gives the same bits.
//
// Few stars reach the second words. A star that does raises the flag of the pixel's block. The resolve pass reads the second words only of flagged
// blocks, and resets them to zero for the next frame.
//
// When a low field overflows, its carry runs into the next field: one unit of G per 2^21 units of R, a relative error of 4.8e-7. This does not depend
// on the order. The thread whose addition causes the carry adds it to the high field.

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
// The smallest number of units that a field cannot hold.
const FIELD_UNITS: f32 = 2097152.0;
// Bits that a carry out of a field reaches: 21, 42 and 63.
const CARRIES: u64 = 0x8000040000200000lu;

// Packs integers from 0 to FIELD_UNITS - 1. An integer is the low bits of its sum with 2^23; this costs a CPU less than a conversion.
fn packed_fields(units: vec3<f32>) -> u64 {
    let bits = bitcast<vec3<u32>>(units + 8388608.0);
    // The shifts to the left remove the bits of the exponent.
    let low = (bits.x & 0x1fffffu) | (bits.y << 21u);
    let high = ((bits.y & 0x1fffffu) >> 11u) | (bits.z << 10u);
    return u64(low) | (u64(high) << 32u);
}

// Adds fields to the second word of a pixel.
fn accumulate_high(pixel: u32, added: u64) {
    let before = atomicAdd(&high_words[pixel], added);
    raise_flag(pixel);
    if ((before ^ added ^ (before + added)) & CARRIES) != 0lu {
        atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
    }
}

// Adds `units` (integers) to a pixel. A value that is too large for a channel is counted as an overflow and not added. Few values need a second word,
// and a software driver skips code that none of its lanes needs.
fn accumulate(pixel: u32, units: vec3<f32>) {
    var low = units;
    var added_high = 0lu;
    if any(units >= vec3(FIELD_UNITS)) {
        if any(units >= vec3(CHANNEL_UNITS)) {
            atomicAdd(&counters[COUNTER_OVERFLOWS], 1u);
            return;
        }
        let high = floor(units * (1.0 / FIELD_UNITS));
        low = units - high * FIELD_UNITS;
        added_high = packed_fields(high);
    }
    let added = packed_fields(low);
    let before = atomicAdd(&pixels[pixel], added);
    added_high += ((before ^ added ^ (before + added)) & CARRIES) >> FIELD_BITS;
    if added_high != 0lu {
        accumulate_high(pixel, added_high);
    }
}

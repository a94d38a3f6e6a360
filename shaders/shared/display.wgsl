// Luminance over display white to 8 bits, dithered. The f64 twin is src/photometry/tone_map.rs. Needs math.wgsl.

const OPERATOR_FILMIC: u32 = 0u;
const OPERATOR_SRGB: u32 = 1u;
const BLACK: u32 = 0xff000000u;

fn filmic(value: vec3<f32>) -> vec3<f32> {
    // Beyond 1e4 the curve is within 2e-5 of 1, and the products stay finite.
    let x = clamp(value, vec3(0.0), vec3(1e4));
    return x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06);
}

fn srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3(0.0031308));
}

// R, G, B, A bytes of a pixel from its luminance over display white.
fn display_word(value: vec3<f32>, tone_operator: u32, column: u32, row: u32) -> u32 {
    var encoded = vec3(0.0);
    if tone_operator == OPERATOR_FILMIC {
        encoded = filmic(value);
    } else {
        encoded = srgb_from_linear(value);
    }
    // One threshold for the three channels, from the place in the image alone: no colour noise, no flicker.
    let threshold = f32(hash(column + 65536u * row) >> 8u) / 16777216.0;
    let bytes = vec3<u32>(min(encoded * 255.0 + threshold, vec3(255.0)));
    return BLACK | bytes.x | (bytes.y << 8u) | (bytes.z << 16u);
}

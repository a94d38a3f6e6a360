// Converts luminance to 8-bit display values. Operator and options are constants of the pipeline, so unused code is
// removed. The f64 twin is crates/sky/src/photometry/tone_map.rs.

#import constants/display
#import constants/rec709
#import shared/math
#import shared/srgb
#import structs/Display

const BLACK: u32 = 0xff000000u;

override TONE_OPERATOR: u32 = OPERATOR_FILMIC;
// Whether `desaturation` and `scotopic` are above 0.
override DESATURATES: bool = false;
override SCOTOPIC: bool = false;
// Whether codes are computed with the shorter approximations of shared/srgb.wgsl.
override SHORT_CODES: bool = false;

fn encoded_light(linear: vec3<f32>) -> vec3<f32> {
    if SHORT_CODES {
        return short_srgb_from_linear(linear);
    }
    return srgb_from_linear(linear);
}

fn decoded_light(encoded: vec3<f32>) -> vec3<f32> {
    if SHORT_CODES {
        return short_linear_from_srgb(encoded);
    }
    return linear_from_srgb(encoded);
}

fn filmic(value: vec3<f32>) -> vec3<f32> {
    // Above 1e4 the curve is within 2e-5 of 1. The limit keeps the products finite.
    let x = min(value, vec3(1e4));
    return x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06);
}

fn aces(value: vec3<f32>) -> vec3<f32> {
    // The curve reaches 1 at 7.24.
    let x = min(value, vec3(1e4));
    return min(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), vec3(1.0));
}

// Returns the factor by which Reinhard's operator scales a colour whose luminance relative to white is y.
fn reinhard_scale(y: f32, white: f32) -> f32 {
    return (1.0 + y / (white * white)) / (1.0 + y);
}

// Replaces NaN by black. It tests bits, since compilers may assume that comparisons never see NaN.
fn without_nan(luminance: vec3<f32>) -> vec3<f32> {
    return select(luminance, vec3(0.0), (bitcast<vec3<u32>>(luminance) & vec3(0x7fffffffu)) > vec3(0x7f800000u));
}

// Clamps light to finite, non-negative values.
fn bounded(light: vec3<f32>) -> vec3<f32> {
    return clamp(light, vec3(0.0), vec3(BRIGHTEST));
}

// How light (cd/m^2) appears to rods and cones: crates/sky/src/photometry/tone_map/scotopic.rs.
fn seen_at_night(light: vec3<f32>, amount: f32) -> vec3<f32> {
    let y = dot(light, LUMINANCE_WEIGHTS);
    let xyz = vec3(
        dot(light, vec3(0.4123908, 0.3575843, 0.1804808)),
        dot(light, vec3(0.2126390, 0.7151687, 0.0721923)),
        dot(light, vec3(0.0193308, 0.1191948, 0.9505322)),
    );
    if !(y > 0.0 && xyz.x > 0.0) {
        return light;
    }
    // Ratio of scotopic to photopic luminance, relative to that of white. Rod vision is displayed as the chromaticity x = y = 0.25.
    let ratio = (1.33 * (1.0 + (xyz.y + xyz.z) / xyz.x) - 1.68) / 2.5732779;
    let rods = y * ratio * vec3(0.7063652, 0.9898340, 1.9655961);
    let cones = clamp(0.767 + 0.3334 * 0.30102999566 * log2(y), 0.0, 1.0);
    return light + amount * (1.0 - cones) * (rods - light);
}

// Returns the colour of luminance `y` with the hue of `value`, as saturated as possible without a channel above 1.
fn at_luminance(value: vec3<f32>, y: f32) -> vec3<f32> {
    let own = dot(value, LUMINANCE_WEIGHTS);
    if !(own > 0.0 && y > 0.0) {
        return vec3(0.0);
    }
    let unit_colour = value * (1.0 / own);
    let most = max(unit_colour.x, max(unit_colour.y, unit_colour.z));
    var purity = 1.0;
    if y * most > 1.0 {
        purity = clamp((1.0 - y) / (y * (most - 1.0)), 0.0, 1.0);
    }
    return y * (1.0 + purity * (unit_colour - 1.0));
}

// Returns the encoded display values of light in cd/m^2.
fn encoded_display(luminance: vec3<f32>, display_per_cd_m2: f32, settings: Display) -> vec3<f32> {
    var light = bounded(without_nan(luminance));
    if SCOTOPIC {
        light = bounded(seen_at_night(light, settings.scotopic));
    }
    var value = min(light * display_per_cd_m2, vec3(BRIGHTEST));
    if TONE_OPERATOR == OPERATOR_CALIBRATED {
        // The display adds its black level to everything.
        value = bounded((light - settings.black_cd_m2) / (settings.peak_cd_m2 - settings.black_cd_m2));
    }
    var scale = 1.0;
    var encoded = vec3(0.0);
    if TONE_OPERATOR == OPERATOR_FILMIC {
        // The curve includes the display's gamma.
        encoded = filmic(value);
    } else if TONE_OPERATOR == OPERATOR_ACES {
        encoded = encoded_light(aces(value));
    } else {
        if TONE_OPERATOR == OPERATOR_REINHARD {
            scale = reinhard_scale(dot(value, LUMINANCE_WEIGHTS), settings.white);
        }
        encoded = encoded_light(scale * value);
    }
    if DESATURATES {
        let linear = decoded_light(encoded);
        // With curves per channel, the luminance is that of their result.
        let by_channel = TONE_OPERATOR == OPERATOR_FILMIC || TONE_OPERATOR == OPERATOR_ACES;
        let wanted = dot(select(scale * value, linear, by_channel), LUMINANCE_WEIGHTS);
        let kept = at_luminance(value, min(wanted, 1.0));
        encoded = encoded_light(linear + settings.desaturation * (kept - linear));
    }
    return encoded;
}

// Returns the R, G, B and A bytes of a pixel, from its light in cd/m^2.
fn display_word(luminance: vec3<f32>, display_per_cd_m2: f32, settings: Display, column: u32, row: u32) -> u32 {
    let encoded = encoded_display(luminance, display_per_cd_m2, settings);
    var threshold = 0.5;
    if settings.dither != 0u {
        // All three channels have the same threshold, which depends only on the pixel position. So there is no colour noise and no flicker.
        threshold = f32(hash(column + 65536u * row) >> 8u) / 16777216.0;
    }
    // Integers below 2^23 are the low bits of their sum with 2^23.
    let bytes = bitcast<vec3<u32>>(floor(min(encoded * 255.0 + threshold, vec3(255.0))) + 8388608.0) & vec3(255u);
    return BLACK | bytes.x | (bytes.y << 8u) | (bytes.z << 16u);
}

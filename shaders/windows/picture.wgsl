// Draws an image into a window. If the sizes are equal, pixels are copied. Otherwise each pixel of the window is the mean of the image over a square.
// The square has the size of the window's pixel, but at least that of one pixel of the image. For magnified images this is linear interpolation, and
// in reduced images it preserves the light of stars. Means are computed in linear light. The vertices come from shared/whole_target.wgsl.

#import shared/srgb

// 1: the image holds sRGB codes; 0: linear light.
override IMAGE_CODES: u32 = 1u;
// 1: the target expects sRGB codes; 0: linear light.
override TARGET_CODES: u32 = 1u;

@group(0) @binding(0) var image: texture_2d<f32>;
// Position of the image's upper left corner in the window in pixels, window pixels per image pixel, and an unused
// value.
@group(0) @binding(1) var<uniform> placed: vec4<f32>;

fn light_at(place: vec2<i32>) -> vec3<f32> {
    let value = textureLoad(image, place, 0).rgb;
    if IMAGE_CODES == 1u {
        return linear_from_srgb(value);
    }
    return value;
}

// Returns the overlap of an image pixel with the range between two positions along an axis.
fn covered(pixel: i32, from_place: f32, to_place: f32) -> f32 {
    return max(min(f32(pixel) + 1.0, to_place) - max(f32(pixel), from_place), 0.0);
}

@fragment
fn draw_picture(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let size = vec2<i32>(textureDimensions(image));
    let in_window = place.xy - placed.xy;
    if placed.z == 1.0 {
        let pixel = vec2<i32>(floor(in_window));
        if any(pixel < vec2(0)) || any(pixel >= size) {
            return vec4(0.0, 0.0, 0.0, 1.0);
        }
        if IMAGE_CODES == TARGET_CODES {
            return vec4(textureLoad(image, pixel, 0).rgb, 1.0);
        }
        return vec4(encoded(light_at(pixel)), 1.0);
    }
    let centre = in_window / placed.z;
    let reach = 0.5 * max(1.0 / placed.z, 1.0);
    if any(centre < vec2(0.0)) || any(centre >= vec2<f32>(size)) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    let low = centre - vec2(reach);
    let high = centre + vec2(reach);
    var sum = vec3(0.0);
    var weight = 0.0;
    for (var y = i32(floor(low.y)); f32(y) < high.y; y++) {
        let row_share = covered(y, low.y, high.y);
        for (var x = i32(floor(low.x)); f32(x) < high.x; x++) {
            let share = row_share * covered(x, low.x, high.x);
            sum += share * light_at(clamp(vec2(x, y), vec2(0), size - vec2(1)));
            weight += share;
        }
    }
    return vec4(encoded(sum / weight), 1.0);
}

fn encoded(light: vec3<f32>) -> vec3<f32> {
    if TARGET_CODES == 1u {
        return srgb_from_linear(light);
    }
    return light;
}

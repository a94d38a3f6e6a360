// An image in a window. Of the same size, each pixel is one of the image, as it is. Otherwise a pixel is the mean of the image over a
// square of its own width, but of one pixel of the image at least: that is linear interpolation where the image is magnified, and keeps the light of a
// star where it is shrunk. Means are of linear light. The corners come from shared/whole_target.wgsl.

#import shared/srgb

// 1: the image holds sRGB codes; 0: linear light.
override IMAGE_CODES: u32 = 1u;
// The same of the target.
override TARGET_CODES: u32 = 1u;

@group(0) @binding(0) var image: texture_2d<f32>;
// Place of the image's upper left corner in the window in pixels, pixels of the window per pixel of the image, and nothing.
@group(0) @binding(1) var<uniform> placed: vec4<f32>;

fn light_at(place: vec2<i32>) -> vec3<f32> {
    let value = textureLoad(image, place, 0).rgb;
    if IMAGE_CODES == 1u {
        return linear_from_srgb(value);
    }
    return value;
}

// Which part of a pixel of the image lies between two places along an axis.
fn covered(pixel: i32, from_place: f32, to_place: f32) -> f32 {
    return max(min(f32(pixel) + 1.0, to_place) - max(f32(pixel), from_place), 0.0);
}

@fragment
fn draw_picture(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let size = vec2<i32>(textureDimensions(image));
    let in_window = place.xy - placed.xy;
    if placed.z == 1.0 {
        let at = vec2<i32>(floor(in_window));
        if any(at < vec2(0)) || any(at >= size) {
            return vec4(0.0, 0.0, 0.0, 1.0);
        }
        if IMAGE_CODES == TARGET_CODES {
            return vec4(textureLoad(image, at, 0).rgb, 1.0);
        }
        return vec4(encoded(light_at(at)), 1.0);
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
        let of_row = covered(y, low.y, high.y);
        for (var x = i32(floor(low.x)); f32(x) < high.x; x++) {
            let share = of_row * covered(x, low.x, high.x);
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

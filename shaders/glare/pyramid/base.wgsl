// The base of a glare pyramid: the picture at half resolution, scaled to the range of half floats. Each texel is the
// mean of two by two pixels; pixels outside round pictures are black. One dispatch per tile writes the texels whose
// upper pixels are in the tile; the lower ones may be in the next tile.

#import constants/frame_lists
#import constants/workgroups
#import glare/pyramid/scale
#import shared/viewport
#import structs/GlareBaseParameters

@group(0) @binding(0) var<uniform> parameters: GlareBaseParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<storage, read> upper_pixels: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> lower_pixels: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> maximum: array<u32>;
@group(0) @binding(5) var base: texture_storage_2d<rgba16float, write>;

fn light_at(size: vec2<u32>, pixel: vec2<u32>) -> vec3<f32> {
    // The border pixels are repeated.
    let clamped = min(pixel, size - 1u);
    var red_green = vec2(0.0);
    var blue_omega = vec2(0.0);
    if clamped.y < parameters.upper.first_row + parameters.upper.rows {
        let index = parameters.upper.first_pixel + (clamped.y - parameters.upper.first_row) * size.x + clamped.x;
        red_green = upper_pixels[index];
        blue_omega = upper_pixels[parameters.upper_plane_pixels + index];
    } else {
        let index = parameters.lower.first_pixel + (clamped.y - parameters.lower.first_row) * size.x + clamped.x;
        red_green = lower_pixels[index];
        blue_omega = lower_pixels[parameters.lower_plane_pixels + index];
    }
    let light = vec3(red_green, blue_omega.x);
    // A non-finite pixel must not spoil the picture.
    return select(vec3(0.0), light, blue_omega.y > 0.0 && all(light < vec3(3e38)));
}

@compute @workgroup_size(PYRAMID_SIDE, PYRAMID_SIDE)
fn fill_base(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = viewports[parameters.upper.viewport].size;
    let first = (parameters.upper.first_row + 1u) / 2u;
    let end = (parameters.upper.first_row + parameters.upper.rows + 1u) / 2u;
    let texel = vec2(id.x, first + id.y);
    if texel.x >= (size.x + 1u) / 2u || texel.y >= end {
        return;
    }
    let scale = 0.25 * glare_scale(maximum[0]);
    var sum = vec3(0.0);
    for (var i = 0u; i < 4u; i++) {
        sum += light_at(size, 2u * texel + vec2(i & 1u, i >> 1u)) * scale;
    }
    textureStore(base, vec2<i32>(texel), nearest_half(sum));
}

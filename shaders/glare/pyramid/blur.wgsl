// Blurs a level of a glare pyramid along one axis: a Gaussian of seven taps, one texel of the level apart. The blur along the first axis reads the
// previous level, in which a bilinear lookup between four texels gives their mean. The blur along the second axis reads the result of the first. The
// chosen taps define the positions.

#import constants/frame_lists
#import constants/workgroups
#import glare/pyramid/scale
#import shared/viewport
#import taps = glare/pyramid/taps_screen | glare/pyramid/taps_view
#import structs/GlareBlurParameters

@group(0) @binding(0) var<uniform> parameters: GlareBlurParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var wider: texture_2d<f32>;
@group(0) @binding(3) var bilinear: sampler;
@group(0) @binding(4) var blurred: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(PYRAMID_SIDE, PYRAMID_SIDE)
fn blur_level(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(blurred);
    if any(id.xy >= size) {
        return;
    }
    let viewport = viewports[parameters.viewport];
    let taps = taps_at(viewport, (vec2<f32>(id.xy) + 0.5) / vec2<f32>(size), 1.0 / vec2<f32>(size));
    var sum = vec3(0.0);
    for (var k = -3; k <= 3; k++) {
        let place = place_of_tap(viewport, taps, k);
        if place.z > 0.0 {
            // Beyond the picture its border pixels are repeated.
            sum += parameters.weights[abs(k)] * textureSampleLevel(wider, bilinear, place.xy, 0.0).xyz;
        }
    }
    textureStore(blurred, vec2<i32>(id.xy), nearest_half(sum));
}

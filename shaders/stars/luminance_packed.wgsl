// Output of the published rasteriser: luminance and mixed temperature of a pixel as two half floats.

#import shared/math
#import shared/viewport

@group(1) @binding(0) var<storage, read> packed: array<u32>;
// Colours of luminance 1 for temperatures from 500 to 100000 K, on a logarithmic scale.
@group(1) @binding(1) var<storage, read> colours: array<vec4<f32>>;

fn luminance_of(viewport: Viewport, index: u32, pixel: vec2<i32>) -> vec3<f32> {
    let word = packed[index];
    if word == 0u {
        return vec3(0.0);
    }
    let halves = unpack2x16float(word);
    let step = step_of_temperature(halves.y);
    return halves.x * colours[u32(step + 0.5)].xyz;
}

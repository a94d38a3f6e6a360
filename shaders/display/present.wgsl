// The present pass: draws pixels of a tile into a texture that leaves the renderer, for example a headset's. The output
// is linear light; an sRGB texture encodes it. The vertices come from shared/whole_target.wgsl.

#import display/encode
#import source = display/present_codes | display/present_light
#import structs/PresentParameters

@group(0) @binding(0) var<uniform> parameters: PresentParameters;

@fragment
fn present(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(place.xy);
    let index = parameters.first_pixel + (pixel.y - parameters.first_row) * parameters.width + pixel.x;
    return vec4(linear_light(index), 1.0);
}

// Linear light of the HDR image after tone mapping, rounded to half floats.

#import display/encode
#import structs/Exposure

// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(1) var<storage, read> luminances: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> exposure: Exposure;

// Rounds values from 0 to 1 to the nearest half floats, ties to even. Targets may truncate instead, but that does not change rounded values.
fn nearest_halves(value: vec3<f32>) -> vec3<f32> {
    let bits = bitcast<vec3<u32>>(value);
    let normal = bitcast<vec3<f32>>((bits + 0xfffu + ((bits >> vec3(13u)) & vec3(1u))) & vec3(0xffffe000u));
    // Below 2^-14, half floats are multiples of 2^-24.
    let subnormal = round(value * 16777216.0) / 16777216.0;
    return select(normal, subnormal, value < vec3(6.103515625e-5));
}

fn linear_light(index: u32) -> vec3<f32> {
    let red_green = luminances[index];
    // Zero bits mark a dark pixel: see shared/pixel_grid.wgsl.
    if all(bitcast<vec2<u32>>(red_green) == vec2(0u)) {
        return vec3(0.0);
    }
    let luminance = vec3(red_green, luminances[parameters.plane_pixels + index].x);
    return nearest_halves(linear_from_srgb(encoded_display(luminance, exposure.display_per_cd_m2, parameters.shown)));
}

// The light near sources that are too faint to be drawn individually: a bump around each cell, which is added to the finest level
// of the glare map.

#import structs/GlareBumpParameters
#import structs/GlareCell

@group(0) @binding(0) var<uniform> parameters: GlareBumpParameters;
// Light of the bump of each cell, lx per sr.
@group(0) @binding(2) var<storage, read> bumps: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> scattered: array<vec4<f32>>;

fn weights(squared: vec4<f32>) -> vec4<f32> {
    let inside = max(1.0 - squared * parameters.inverse_squared, vec4(0.0));
    return inside * inside;
}

fn light_of(index: u32, cell: GlareCell) -> vec3<f32> {
    return bumps[index].xyz;
}

fn light_before(own: u32, direction: vec3<f32>) -> vec3<f32> {
    return scattered[own].xyz;
}

// Sample of an atlas: unit normal in the shape's axes and 1; albedo divided by its scale, and depth.

#import asteroids/impostors/bake_block

struct BakedSample {
    @location(0) normal: vec4<f32>,
    @location(1) surface: vec2<f32>,
}

@fragment
fn sample_tile(corner: BakedCorner) -> BakedSample {
    return BakedSample(vec4(normalize(corner.normal), 1.0), corner.surface);
}

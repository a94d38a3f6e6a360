// Luminance drawn on the picture's own plane.

#import shared/viewport

@group(1) @binding(0) var drawn: texture_2d_array<f32>;

fn luminance_of(viewport: Viewport, index: u32, pixel: vec2<i32>) -> vec3<f32> {
    return textureLoad(drawn, pixel, 0, 0).xyz;
}

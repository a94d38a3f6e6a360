// Scattered light from a pyramid of blurred images, combined at half the picture's resolution.

#import glare/pyramid/scale
#import shared/viewport

@group(1) @binding(0) var combined: texture_2d<f32>;
@group(1) @binding(1) var bilinear: sampler;
@group(1) @binding(2) var<storage, read> maximum: array<u32>;

// Returns the light scattered towards eight pixels of a column, cd/m^2.
fn scattered_towards(viewport: Viewport, tile: Tile, position: vec3<u32>) -> Light8 {
    let size = 2.0 * vec2<f32>(textureDimensions(combined));
    let scale = 1.0 / glare_scale(maximum[0]);
    let top = vec2<f32>(vec2(position.x, tile.first_row + position.y)) + 0.5;
    var light: Light8;
    for (var i = 0u; i < 8u; i++) {
        let place = (top + vec2(0.0, f32(i))) / size;
        let rgb = textureSampleLevel(combined, bilinear, place, 0.0).xyz * scale;
        light.red[i / 4u][i % 4u] = rgb.x;
        light.green[i / 4u][i % 4u] = rgb.y;
        light.blue[i / 4u][i % 4u] = rgb.z;
    }
    return light;
}

// The glare pass over pixels: a share of every pixel's light is scattered, and what is scattered towards it comes instead. The
// picture stands where the resolve pass has left it, whole, and stays there; its illuminance is summed anew for the exposure.
// What is scattered comes from glare_*.wgsl. Needs viewport.wgsl, math.wgsl, projection.wgsl, pixel_grid.wgsl and one of them.

struct GlareParameters {
    // Share of the light that is scattered.
    fraction: f32,
    // Pixels of the batch: where B and the solid angles begin.
    plane_pixels: u32,
    unused_0: u32,
    unused_1: u32,
}

@group(0) @binding(0) var<uniform> parameters: GlareParameters;
@group(0) @binding(1) var<storage, read> viewports: array<Viewport>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> partial_sums: array<f32>;

@compute @workgroup_size(COLUMNS)
fn composite_glare(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * COLUMNS + local;
    if x >= viewport.size.x || group.y * ROWS >= tile.rows {
        return;
    }
    var sum = 0.0;
    let end_row = min(tile.rows, (group.y + 1u) * ROWS);
    for (var row = group.y * ROWS; row < end_row; row++) {
        let index = tile.first_pixel + row * viewport.size.x + x;
        let blue_omega = pixels[parameters.plane_pixels + index];
        if blue_omega.y <= 0.0 {
            continue;
        }
        let drawn = vec3(pixels[index], blue_omega.x);
        let scattered = scattered_towards(viewport, tile, group, vec2(i32(x), i32(tile.first_row + row)));
        let luminance = (1.0 - parameters.fraction) * drawn + parameters.fraction * scattered;
        sum += dot(luminance, vec3(0.2126, 0.7152, 0.0722)) * blue_omega.y;
        pixels[index] = bitcast<vec2<f32>>(red_green_words(luminance));
        pixels[parameters.plane_pixels + index] = vec2(luminance.z, blue_omega.y);
    }
    partial_sums[tile.first_partial + group.y * viewport.size.x + x] = sum;
}

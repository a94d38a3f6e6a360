// The glare pass over pixels: removes the scattered share of every pixel's light, and adds the light that is scattered towards the pixel. The picture
// is read and written in place after the resolve pass; its illuminance is summed again for the exposure. The chosen source provides the light
// scattered towards eight pixels of a column.

#import constants/frame_lists
#import constants/pixel_grid
#import constants/rec709
#import glare/light8
#import scattered = glare/sky_cube/scattered | glare/pyramid/scattered
#import shared/pixel_grid
#import shared/viewport
#import structs/GlareParameters

@group(0) @binding(0) var<uniform> parameters: GlareParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> partial_sums: array<vec2<f32>>;

// Number of runs of ROWS rows per workgroup, with one invocation per column. A full wave is fastest on a GPU, one SIMD step on a software driver.
override ROW_GROUPS: u32;

@compute @workgroup_size(BLOCK_COLUMNS, ROW_GROUPS)
fn composite_glare(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * BLOCK_COLUMNS + local.x;
    let row_group = group.y * ROW_GROUPS + local.y;
    let end_row = min(tile.rows, (row_group + 1u) * ROWS);
    if x >= viewport.size.x || row_group * ROWS >= tile.rows {
        return;
    }
    var sum = vec2(0.0);
    for (var first_row = row_group * ROWS; first_row < end_row; first_row += 8u) {
        let scattered = scattered_towards(viewport, tile, vec3(x, first_row, group.z));
        for (var i = 0u; i < min(8u, end_row - first_row); i++) {
            let index = tile.first_pixel + (first_row + i) * viewport.size.x + x;
            let blue_omega = pixels[parameters.plane_pixels + index];
            if blue_omega.y <= 0.0 {
                continue;
            }
            let four = i / 4u;
            let one = i % 4u;
            let arriving = vec3(scattered.red[four][one], scattered.green[four][one], scattered.blue[four][one]);
            var luminance = parameters.fraction * arriving;
            if parameters.fraction < 1.0 {
                luminance += (1.0 - parameters.fraction) * vec3(pixels[index], blue_omega.x);
            }
            sum = metered(sum, dot(luminance, LUMINANCE_WEIGHTS) * blue_omega.y, blue_omega.y);
            pixels[index] = bitcast<vec2<f32>>(red_green_words(luminance));
            pixels[parameters.plane_pixels + index] = vec2(luminance.z, blue_omega.y);
        }
    }
    partial_sums[tile.first_partial + row_group * viewport.size.x + x] = sum;
}

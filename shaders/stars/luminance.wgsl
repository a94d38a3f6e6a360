// The resolve pass of methods that output luminance instead of illuminance: writes the luminance and solid angle of each pixel to the buffer that the
// exposure and tone-mapping passes read, and sums the illuminance. The chosen source provides the luminance of a pixel.

#import constants/frame_lists
#import constants/pixel_grid
#import constants/rec709
#import luminance = stars/luminance_*
#import shared/pixel_grid
#import shared/projection
#import shared/viewport
#import structs/LuminanceParameters

@group(0) @binding(0) var<uniform> parameters: LuminanceParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(3) var<storage, read_write> pixels: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> partial_sums: array<vec2<f32>>;

@compute @workgroup_size(COLUMNS)
fn resolve_luminance(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * COLUMNS + local;
    if x >= viewport.size.x || group.y * ROWS >= tile.rows {
        return;
    }
    var sum = vec2(0.0);
    for (var j = 0u; j < ROWS; j++) {
        let row = group.y * ROWS + j;
        if row >= tile.rows {
            break;
        }
        let index = tile.first_pixel + row * viewport.size.x + x;
        let pixel = vec2(i32(x), i32(tile.first_row + row));
        let omega = solid_angle(viewport, pixel);
        var luminance = vec3(0.0);
        if omega > 0.0 {
            luminance = luminance_of(viewport, index, pixel) * parameters.scale;
            sum = metered(sum, dot(luminance, LUMINANCE_WEIGHTS) * omega, omega);
        }
        pixels[index] = bitcast<vec2<f32>>(red_green_words(luminance));
        pixels[parameters.plane_pixels + index] = vec2(luminance.z, omega);
    }
    partial_sums[tile.first_partial + group.y * viewport.size.x + x] = sum;
}

// The tone-mapping pass: converts luminance to 8-bit display values. It runs if the exposure is not known in advance;
// otherwise the resolve pass writes the display image. The f64 twin is crates/sky/src/photometry/tone_map.rs.

#import constants/frame_lists
#import constants/pixel_grid
#import display/encode
#import shared/pixel_grid
#import shared/viewport
#import structs/Exposure
#import structs/ToneMapParameters

@group(0) @binding(0) var<uniform> parameters: ToneMapParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(3) var<storage, read> luminances: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> exposure: Exposure;
@group(0) @binding(5) var<storage, read_write> display: array<u32>;

@compute @workgroup_size(COLUMNS)
fn tone_map(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let size = viewports[tile.viewport].size;
    let x = group.x * COLUMNS + local;
    if x >= size.x || group.y * ROWS >= tile.rows {
        return;
    }
    for (var j = 0u; j < ROWS; j++) {
        let row = group.y * ROWS + j;
        if row >= tile.rows {
            break;
        }
        let index = tile.first_pixel + row * size.x + x;
        let red_green = luminances[index];
        var word = BLACK;
        if any(bitcast<vec2<u32>>(red_green) != vec2(0u)) {
            let luminance = vec3(red_green, luminances[parameters.plane_pixels + index].x);
            word = display_word(luminance, exposure.display_per_cd_m2, parameters.shown, x, tile.first_row + row);
        }
        display[index] = word;
    }
}

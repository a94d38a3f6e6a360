// Stores pictures of the sky as texels of the map of faint light.

#import constants/frame_lists
#import constants/pixel_grid
#import shared/sky_texel
#import shared/viewport
#import structs/PackParameters
#import structs/PackedPicture

@group(0) @binding(0) var<uniform> parameters: PackParameters;
@group(0) @binding(1) var<uniform> tiles: array<Tile, MAX_TILES>;
// R and G of all pixels in cd/m^2, then B and the solid angle.
@group(0) @binding(2) var<storage, read> pixels: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read_write> texels: array<u32>;
// By viewport.
@group(0) @binding(4) var<uniform> pictures: array<PackedPicture, MAX_VIEWPORTS>;

@compute @workgroup_size(COLUMNS)
fn pack_texels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let picture = pictures[tile.viewport];
    let x = group.x * COLUMNS + local;
    if x >= picture.width || group.y * ROWS >= tile.rows {
        return;
    }
    let end_row = min(tile.rows, (group.y + 1u) * ROWS);
    for (var row = group.y * ROWS; row < end_row; row++) {
        let index = tile.first_pixel + row * picture.width + x;
        let red_green = pixels[index];
        var light = vec3(0.0);
        // Zero bits mark a dark pixel: see shared/pixel_grid.wgsl.
        if any(bitcast<vec2<u32>>(red_green) != vec2(0u)) {
            light = vec3(red_green, pixels[parameters.plane_pixels + index].x) * parameters.units_per_cd_m2;
        }
        texels[picture.first_texel + (tile.first_row + row) * picture.width + x] = texel_of(light);
    }
}

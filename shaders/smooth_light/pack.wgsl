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

// Returns the light of a pixel of a picture, texel units; 0 outside of its tile.
fn light_at(tile: Tile, width: u32, x: i32, row: i32) -> vec3<f32> {
    if x < 0 || x >= i32(width) || row < 0 || row >= i32(tile.rows) {
        return vec3(0.0);
    }
    let index = tile.first_pixel + u32(row) * width + u32(x);
    let red_green = pixels[index];
    // Zero bits mark a dark pixel: see shared/pixel_grid.wgsl.
    if all(bitcast<vec2<u32>>(red_green) == vec2(0u)) {
        return vec3(0.0);
    }
    return vec3(red_green, pixels[parameters.plane_pixels + index].x) * parameters.units_per_cd_m2;
}

// Returns the weighted mean of five values in a line.
fn blurred(values: array<vec3<f32>, 5>) -> vec3<f32> {
    let centre = 1.0 - 2.0 * (parameters.blur.x + parameters.blur.y);
    return centre * values[2] + parameters.blur.x * (values[1] + values[3]) + parameters.blur.y * (values[0] + values[4]);
}

// Returns the same for values along a row.
fn blurred_row(tile: Tile, width: u32, x: i32, row: i32) -> vec3<f32> {
    return blurred(array(
        light_at(tile, width, x - 2, row),
        light_at(tile, width, x - 1, row),
        light_at(tile, width, x, row),
        light_at(tile, width, x + 1, row),
        light_at(tile, width, x + 2, row),
    ));
}

@compute @workgroup_size(COLUMNS)
fn pack_texels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let picture = pictures[tile.viewport];
    let x = i32(group.x * COLUMNS + local);
    let first_row = i32(group.y * ROWS);
    if x >= i32(picture.width) || first_row >= i32(tile.rows) {
        return;
    }
    let end_row = min(i32(tile.rows), first_row + i32(ROWS));
    let first_texel = i32(picture.first_texel) + x;
    let texel_rows = i32(tile.first_row);
    if parameters.blur.x == 0.0 {
        for (var row = first_row; row < end_row; row++) {
            let light = light_at(tile, picture.width, x, row);
            texels[first_texel + (texel_rows + row) * i32(picture.width)] = texel_of(light);
        }
        return;
    }
    // Five blurred rows: the next one and its neighbours.
    var rows: array<vec3<f32>, 5>;
    for (var i = 0; i < 4; i++) {
        rows[i + 1] = blurred_row(tile, picture.width, x, first_row - 2 + i);
    }
    for (var row = first_row; row < end_row; row++) {
        rows = array(rows[1], rows[2], rows[3], rows[4], blurred_row(tile, picture.width, x, row + 2));
        texels[first_texel + (texel_rows + row) * i32(picture.width)] = texel_of(blurred(rows));
    }
}

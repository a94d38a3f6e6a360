// Finds the sprites that may reach each square of 4 x 4 blocks of pixels. One invocation takes one square, so that the
// order of its list is reproducible.

#import constants/frame_lists
#import constants/glare_sprites
#import constants/workgroups
#import glare/sky_cube/cone
#import glare/sky_cube/sprites
#import shared/viewport

@group(0) @binding(0) var<uniform> parameters: SkyCubeParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
// Regions, then the cells of all regions.
@group(0) @binding(4) var<storage, read> sprite_cells: array<GlareSpriteCell>;
@group(0) @binding(5) var<storage, read> sprites: array<GlareSprite>;
// Per square: number of its sprites, then their indices. A number too large for the list marks the list as incomplete.
@group(0) @binding(6) var<storage, read_write> lists: array<u32>;

@compute @workgroup_size(SPRITE_SQUARES)
fn find_sprites(@builtin(global_invocation_id) place: vec3<u32>) {
    let squares = square_grid(parameters);
    if place.x >= squares.x {
        return;
    }
    let tile = tiles[place.z];
    let viewport = viewports[tile.viewport];
    let view = views[tile.viewport];
    let list = ((place.z * squares.y + place.y) * squares.x + place.x) * parameters.square_words;
    let from_pixel = place.xy * (SQUARE_BLOCKS * BLOCK_SIDE);
    if from_pixel.x >= viewport.size.x || from_pixel.y >= tile.rows {
        lists[list] = 0u;
        return;
    }
    let size = min(vec2(SQUARE_BLOCKS * BLOCK_SIDE), vec2(viewport.size.x, tile.rows) - from_pixel);
    let cone = cone_of(viewport, vec2<f32>(from_pixel + vec2(0u, tile.first_row)), size, 5u);
    var count = 0u;
    if cone.chord >= 0.0 {
        for (var r = 0u; r < parameters.regions; r++) {
            let region = sprite_cells[r];
            if length(region.direction - cone.axis) > cone.chord + region.reach {
                continue;
            }
            for (var c = region.first; c < region.first + region.count; c++) {
                let cell = sprite_cells[c];
                if length(cell.direction - cone.axis) > cone.chord + cell.reach {
                    continue;
                }
                for (var i = cell.first; i < cell.first + cell.count; i++) {
                    if reaches(sprites[i], view, cone.axis, cone.chord) {
                        count += 1u;
                        if count < parameters.square_words {
                            lists[list + count] = i;
                        }
                    }
                }
            }
        }
    }
    lists[list] = count;
}

// Assigns to each block of pixels the sprites of its square that may reach it. One workgroup takes a square, one
// invocation a block.

#import constants/frame_lists
#import constants/glare_sprites
#import glare/sky_cube/cone
#import glare/sky_cube/sprites
#import shared/viewport

@group(0) @binding(0) var<uniform> parameters: SkyCubeParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(0) @binding(4) var<storage, read> sprites: array<GlareSprite>;
// The lists of squares, then those of blocks. Per block: number of its sprites, then their indices. A number too large for
// the list marks the list as incomplete.
@group(0) @binding(5) var<storage, read_write> lists: array<u32>;

@compute @workgroup_size(SQUARE_BLOCKS, SQUARE_BLOCKS)
fn assign_sprites(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let block = vec3(group.xy * SQUARE_BLOCKS + local.xy, group.z);
    if block.x >= parameters.columns || block.y >= parameters.rows {
        return;
    }
    let tile = tiles[block.z];
    let viewport = viewports[tile.viewport];
    let view = views[tile.viewport];
    let list = list_of_block(parameters, block);
    let from_pixel = block.xy * BLOCK_SIDE;
    if from_pixel.x >= viewport.size.x || from_pixel.y >= tile.rows {
        lists[list] = 0u;
        return;
    }
    let squares = square_grid(parameters);
    let square = ((group.z * squares.y + group.y) * squares.x + group.x) * parameters.square_words;
    let found = lists[square];
    if found >= parameters.square_words {
        // The list of the square is incomplete, so the lists of its blocks are incomplete too.
        lists[list] = parameters.list_words;
        return;
    }
    let size = min(vec2(BLOCK_SIDE), vec2(viewport.size.x, tile.rows) - from_pixel);
    let cone = cone_of(viewport, vec2<f32>(from_pixel + vec2(0u, tile.first_row)), size, 3u);
    var count = 0u;
    for (var i = 1u; i <= found; i++) {
        let index = lists[square + i];
        if cone.chord >= 0.0 && reaches(sprites[index], view, cone.axis, cone.chord) {
            count += 1u;
            if count < parameters.list_words {
                lists[list + count] = index;
            }
        }
    }
    lists[list] = count;
}

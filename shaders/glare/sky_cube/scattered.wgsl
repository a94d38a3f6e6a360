// Light scattered towards pixels by the method `sky_cube`: from the map of the sky, from the sources of the view's own
// eye, and from the sprites that reach the pixel's block.

#import constants/frame_lists
#import constants/glare_sprites
#import glare/light8
#import glare/sky_cube/cells
#import glare/sky_cube/columns
#import glare/sky_cube/kernel
#import glare/sky_cube/near
#import glare/sky_cube/sprites
#import shared/math
#import shared/projection
#import shared/viewport

@group(1) @binding(0) var<uniform> sky: SkyCubeParameters;
@group(1) @binding(1) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(1) @binding(2) var<storage, read> map: array<vec4<f32>>;
@group(1) @binding(3) var<storage, read> near: array<GlareNear>;
@group(1) @binding(4) var<storage, read> sprites: array<GlareSprite>;
// Regions, then the cells of all regions.
@group(1) @binding(5) var<storage, read> sprite_cells: array<GlareSpriteCell>;
// Sprites of each square of blocks, then of each block.
@group(1) @binding(6) var<storage, read> lists: array<u32>;
@group(1) @binding(7) var<storage, read> kernel_table: array<f32>;

// Returns the light of the map for eight pixels of a column.
fn column_from_map(view: GlareView, viewport: Viewport, top: vec2<f32>, directions: array<Directions4, 2>) -> Light8 {
    var light: Light8;
    if FLAT {
        // In such views the map is smooth over many pixels, so a parabola through three rows serves eight pixels.
        let first = read_map(view.first_point, sky.edge_cells, direction_of(viewport, top));
        let middle = read_map(view.first_point, sky.edge_cells, direction_of(viewport, top + vec2(0.0, 3.5)));
        let last = read_map(view.first_point, sky.edge_cells, direction_of(viewport, top + vec2(0.0, 7.0)));
        let slope = 0.5 * (last - first);
        let bend = 0.5 * (first + last) - middle;
        for (var four = 0u; four < 2u; four++) {
            let t = (vec4(0.0, 1.0, 2.0, 3.0) + 4.0 * f32(four)) / 3.5 - 1.0;
            light.red[four] = middle.x + t * (slope.x + t * bend.x);
            light.green[four] = middle.y + t * (slope.y + t * bend.y);
            light.blue[four] = middle.z + t * (slope.z + t * bend.z);
        }
        return light;
    }
    for (var four = 0u; four < u32(turns(viewport, 2)); four++) {
        for (var one = 0u; one < u32(turns(viewport, 4)); one++) {
            let direction = vec3(directions[four].x[one], directions[four].y[one], directions[four].z[one]);
            let map_light = read_map(view.first_point, sky.edge_cells, direction);
            light.red[four][one] = map_light.x;
            light.green[four][one] = map_light.y;
            light.blue[four][one] = map_light.z;
        }
    }
    return light;
}

fn add_sprite(light: ptr<function, Light8>, view: GlareView, sprite: GlareSprite, directions: array<Directions4, 2>) {
    let first = sprite_kernel(view, sprite, directions[0]);
    let second = sprite_kernel(view, sprite, directions[1]);
    add_light(light, 0u, sprite.light, first);
    add_light(light, 1u, sprite.light, second);
}

// Adds all sprites of the sky that reach eight pixels.
fn add_from_sky(light: ptr<function, Light8>, view: GlareView, directions: array<Directions4, 2>) {
    let first = vec3(directions[0].x.x, directions[0].y.x, directions[0].z.x);
    let last = chords_squared(directions[1], first);
    // Pixels beyond a rim have no direction. Their chord is set to 1, which is large enough.
    let chord = sqrt(max(max(last.x, last.y), max(last.z, last.w)));
    for (var r = 0u; r < sky.regions; r++) {
        let region = sprite_cells[r];
        if length(region.direction - first) > chord + region.reach {
            continue;
        }
        for (var c = region.first; c < region.first + region.count; c++) {
            let cell = sprite_cells[c];
            if length(cell.direction - first) > chord + cell.reach {
                continue;
            }
            for (var i = cell.first; i < cell.first + cell.count; i++) {
                if sprites[i].inverse_squared <= view.greatest_inverse {
                    add_sprite(light, view, sprites[i], directions);
                }
            }
        }
    }
}

fn scattered_towards(viewport: Viewport, tile: Tile, position: vec3<u32>) -> Light8 {
    let view = views[tile.viewport];
    let top = vec2<f32>(vec2(position.x, tile.first_row + position.y)) + 0.5;
    let directions = array<Directions4, 2>(
        directions_of(viewport, top), directions_of(viewport, top + vec2(0.0, 4.0)));
    var light = column_from_map(view, viewport, top, directions);
    add_near(&light, view, directions);
    let block = vec3(position.xy / BLOCK_SIDE, position.z);
    let list = list_of_block(sky, block);
    let squares = square_grid(sky);
    let square = ((block.z * squares.y + block.y / SQUARE_BLOCKS) * squares.x + block.x / SQUARE_BLOCKS) * sky.square_words;
    // If the block's list is incomplete, use the list of its square. If that list is incomplete too, search all sprites.
    var count = lists[list];
    let from_square = count >= sky.list_words;
    if from_square {
        count = lists[square];
    }
    let from_sky = from_square && count >= sky.square_words;
    if from_sky {
        count = 0u;
    }
    for (var i = 1u; i <= count; i++) {
        var index = lists[list + select(i, 0u, from_square)];
        if from_square {
            index = lists[square + i];
        }
        add_sprite(&light, view, sprites[index], directions);
    }
    if from_sky {
        add_from_sky(&light, view, directions);
    }
    // Where the map is steep, its interpolation can be slightly negative.
    for (var four = 0u; four < 2u; four++) {
        light.red[four] = max(light.red[four], vec4(0.0));
        light.green[four] = max(light.green[four], vec4(0.0));
        light.blue[four] = max(light.blue[four], vec4(0.0));
    }
    return light;
}

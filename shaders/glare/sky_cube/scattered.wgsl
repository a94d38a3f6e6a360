// What is scattered towards a pixel, by the method `sky_cube`: from the map of the sky, from the sources of the view's
// own eye and from the sprites that reach the pixel's block.

#import constants/extended_sources
#import constants/glare_sprites
#import glare/sky_cube/cells
#import glare/sky_cube/kernel
#import glare/sky_cube/sprites
#import shared/math
#import shared/projection
#import shared/viewport

// A source that every eye sees elsewhere.
struct GlareNear {
    // Unit vector, world axes.
    direction: vec3<f32>,
    // Chord within which the parts of it are to be taken in its place; without parts the square of the chord by which its kernel is
    // softened.
    reach: f32,
    // Linear Rec. 709, lx.
    light: vec3<f32>,
    // So many parts follow. Of an extended source IS_EXTENDED, and in the low 16 bits the share of its light that its softened kernel leaves out.
    parts: u32,
}

@group(1) @binding(0) var<uniform> sky: SkyCubeParameters;
@group(1) @binding(1) var<storage, read> views: array<GlareView>;
@group(1) @binding(2) var<storage, read> map: array<vec4<f32>>;
@group(1) @binding(3) var<storage, read> near: array<GlareNear>;
@group(1) @binding(4) var<storage, read> sprites: array<GlareSprite>;
@group(1) @binding(5) var<storage, read> regions: array<GlareSpriteCell>;
@group(1) @binding(6) var<storage, read> sprite_cells: array<GlareSpriteCell>;
@group(1) @binding(7) var<storage, read> lists: array<u32>;
@group(1) @binding(8) var<storage, read> square_lists: array<u32>;
@group(1) @binding(9) var<storage, read> kernel_table: array<f32>;

// Whether all views are flat, with pixels far smaller than the cells of the map.
override FLAT: bool = false;
// Direction of a pixel's centre; on a flat plane also beyond the picture.
fn direction_of(viewport: Viewport, pixel: vec2<f32>) -> vec3<f32> {
    if FLAT {
        let on_plane = vec3((pixel - viewport.plane_offset) / viewport.plane_scale, -1.0);
        return world_direction(viewport, normalize(on_plane));
    }
    return world_direction(viewport, direction_from_pixel(viewport, pixel).xyz);
}

fn directions_of(viewport: Viewport, top: vec2<f32>) -> Directions4 {
    var four: Directions4;
    for (var one = 0u; one < u32(turns(viewport, 4)); one++) {
        set_lane(&four, one, direction_of(viewport, top + vec2(0.0, f32(one))));
    }
    return four;
}

// What the map has for eight pixels of a column.
fn column_from_map(view: GlareView, viewport: Viewport, top: vec2<f32>, directions: array<Directions4, 2>) -> Light8 {
    var light: Light8;
    if FLAT {
        // The map is smooth over much more than a few pixels of such views: a parabola through three rows does for eight.
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
            let of_pixel = read_map(view.first_point, sky.edge_cells, direction);
            light.red[four][one] = of_pixel.x;
            light.green[four][one] = of_pixel.y;
            light.blue[four][one] = of_pixel.z;
        }
    }
    return light;
}

fn add_light(light: ptr<function, Light8>, four: u32, colour: vec3<f32>, kernel: vec4<f32>) {
    (*light).red[four] += colour.x * kernel;
    (*light).green[four] += colour.y * kernel;
    (*light).blue[four] += colour.z * kernel;
}

fn add_sprite(light: ptr<function, Light8>, view: GlareView, sprite: GlareSprite, directions: array<Directions4, 2>) {
    let first = of_sprite(view, sprite, directions[0]);
    let second = of_sprite(view, sprite, directions[1]);
    add_light(light, 0u, sprite.light, first);
    add_light(light, 1u, sprite.light, second);
}

// Adds all sprites of the sky that come near eight pixels.
fn add_from_sky(light: ptr<function, Light8>, view: GlareView, directions: array<Directions4, 2>) {
    let first = vec3(directions[0].x.x, directions[0].y.x, directions[0].z.x);
    let last = chords_squared(directions[1], first);
    // Beyond a rim pixels have no direction: a chord of 1, which is large enough.
    let chord = sqrt(max(max(last.x, last.y), max(last.z, last.w)));
    for (var r = 0u; r < sky.regions; r++) {
        let region = regions[r];
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

fn scattered_towards(viewport: Viewport, tile: Tile, at: vec3<u32>) -> Light8 {
    let view = views[tile.viewport];
    let top = vec2<f32>(vec2(at.x, tile.first_row + at.y)) + 0.5;
    let directions = array<Directions4, 2>(
        directions_of(viewport, top), directions_of(viewport, top + vec2(0.0, 4.0)));
    var light = column_from_map(view, viewport, top, directions);
    let first = vec3(directions[0].x.x, directions[0].y.x, directions[0].z.x);
    for (var i = view.first_near; i < view.first_near + view.near_count; i++) {
        let extended = (near[i].parts & IS_EXTENDED) != 0u;
        let parts = select(near[i].parts, 0u, extended);
        if parts > 0u {
            if length(first - near[i].direction) < near[i].reach {
                continue;
            }
        }
        let soft = select(near[i].reach, 0.0, parts > 0u);
        for (var four = 0u; four < 2u; four++) {
            let own = chords_squared(directions[four], near[i].direction);
            let squared = own + soft;
            var kernel = shown(view, squared, angle_squared(squared));
            if extended {
                // What is left out lies on the source: a bump of twice its radius whose integral is 1.
                let inside = max(1.0 - own / (4.0 * soft), vec4(0.0));
                kernel += f32(near[i].parts & SHARE_PARTS) / f32(SHARE_PARTS) * 3.0 / (PI * 4.0 * soft) * inside * inside;
            }
            add_light(&light, four, near[i].light, kernel);
        }
        i += parts;
    }
    let block = vec3(at.xy / BLOCK_SIDE, at.z);
    let list = ((block.z * sky.rows + block.y) * sky.columns + block.x) * sky.list_words;
    let squares = square_grid(sky);
    let square = ((block.z * squares.y + block.y / SQUARE_BLOCKS) * squares.x + block.x / SQUARE_BLOCKS) * sky.square_words;
    // Too many for the block's list: those of the square. Too many for that: whatever comes near.
    var count = lists[list];
    let from_square = count >= sky.list_words;
    if from_square {
        count = square_lists[square];
    }
    let from_sky = from_square && count >= sky.square_words;
    if from_sky {
        count = 0u;
    }
    for (var i = 1u; i <= count; i++) {
        var index = lists[list + select(i, 0u, from_square)];
        if from_square {
            index = square_lists[square + i];
        }
        add_sprite(&light, view, sprites[index], directions);
    }
    if from_sky {
        add_from_sky(&light, view, directions);
    }
    // Where the map is steep its interpolation may fall below 0 by a little.
    for (var four = 0u; four < 2u; four++) {
        light.red[four] = max(light.red[four], vec4(0.0));
        light.green[four] = max(light.green[four], vec4(0.0));
        light.blue[four] = max(light.blue[four], vec4(0.0));
    }
    return light;
}

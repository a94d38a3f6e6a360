// Adds ground and air around an observer to the bodies and asteroids that the pixels of a tile show. The air attenuates their light and adds
// scattered light, and the ground covers everything below the horizon. The model is that of crates/sky/src/photometry/sky_light.rs and
// crates/render/src/scene/surroundings.rs; the f64 twin is crates/render/src/reference/air/light.rs.

#import air/scattered
#import constants/air
#import constants/frame_lists
#import constants/workgroups
#import shared/air_mass
#import shared/cover
#import shared/math
#import shared/plain_block
#import shared/point_grid
#import shared/projection
#import shared/viewport

@group(0) @binding(0) var<uniform> parameters: AirParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> geometry: array<vec4<u32>>;
// Sine of the horizon's altitude at evenly spaced azimuths, from north through east.
@group(0) @binding(4) var<storage, read> horizon: array<f32>;
// See air/scattered.wgsl.
@group(0) @binding(5) var<storage, read> sky: array<vec4<f32>>;
// Picture of the ground, all levels, the finest first: crates/render/src/scene/landscape.rs.
@group(0) @binding(6) var<storage, read> landscape: array<u32>;
// Light added by the air, at the points of a grid over each picture.
@group(0) @binding(7) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
@group(0) @binding(8) var<storage, read> grid_points: array<vec4<f32>>;
// Flags of plain blocks: see shared/plain_block.wgsl.
@group(0) @binding(9) var<storage, read> counters: array<u32>;
@group(0) @binding(10) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;

// Distance from the horizon, as a sine, within which a pixel's share of ground is computed; pixels are at most this
// large.
const NEAR_HORIZON: f32 = 0.1;

// Whether the ground has a picture.
override HAS_LANDSCAPE: bool = false;
// Whether the light added by the air is interpolated between the points of the grid.
override FROM_GRID: bool = false;

fn horizon_sine(heading: vec2<f32>) -> f32 {
    if parameters.is_flat != 0u {
        return parameters.level_sine;
    }
    let azimuth = precise_atan2(heading.y, heading.x);
    let position = (azimuth / (2.0 * PI) + 1.0) * f32(HORIZON_STEPS);
    let first = u32(position);
    return mix(horizon[first % HORIZON_STEPS], horizon[(first + 1u) % HORIZON_STEPS], position - f32(first));
}

fn landscape_texel(index: u32) -> vec4<f32> {
    let word = unpack4x8unorm(landscape[index]);
    return vec4(word.xyz * word.xyz, word.w);
}

// Interpolates one level of the ground picture between its four nearest texels.
fn landscape_level(first: u32, size: vec2<u32>, place: vec2<f32>) -> vec4<f32> {
    let position = place * vec2<f32>(size) - 0.5;
    let low = floor(position);
    let part = position - low;
    let width = i32(size.x);
    let x = vec2((i32(low.x) % width + width) % width, (i32(low.x) + 1 + width) % width);
    let y = clamp(vec2(i32(low.y), i32(low.y) + 1), vec2(0), vec2(i32(size.y) - 1)) * width;
    let upper = mix(landscape_texel(first + u32(y.x + x.x)), landscape_texel(first + u32(y.x + x.y)), part.x);
    let lower = mix(landscape_texel(first + u32(y.y + x.x)), landscape_texel(first + u32(y.y + x.y)), part.x);
    return mix(upper, lower, part.y);
}

// Returns the reflectance times opacity, and opacity, of the ground picture in a pixel of the given angular size.
fn landscape_at(sine: f32, heading: vec2<f32>, pixel_rad: f32) -> vec4<f32> {
    let azimuth = precise_atan2(heading.y, heading.x);
    let altitude = precise_atan2(sine, length(heading));
    let place = vec2(fract((azimuth - parameters.landscape_azimuth) / (2.0 * PI) + 0.5), 0.5 - altitude / PI);
    var size = parameters.landscape_size;
    var first = 0u;
    var level = clamp(log2(max(pixel_rad * f32(size.y) / PI, 1.0)), 0.0, 31.0);
    while level >= 1.0 && min(size.x, size.y) > 1u {
        first += size.x * size.y;
        size = max(size / 2u, vec2(1u));
        level -= 1.0;
    }
    let fine = landscape_level(first, size, place);
    if level <= 0.0 || min(size.x, size.y) == 1u {
        return fine;
    }
    return mix(fine, landscape_level(first + size.x * size.y, max(size / 2u, vec2(1u)), place), min(level, 1.0));
}

// Whether the grid cells around a run of pixels of one column are above both the ground and the altitude limit of the grid.
fn is_clear(column: GridColumn, first_row: u32, rows: u32) -> bool {
    let grid = column.grid;
    let least = max(GRID_FROM, parameters.above_ground);
    let last = ((first_row + rows - 1u) >> grid.spacing_log2) + 1u;
    for (var row = first_row >> grid.spacing_log2; row <= last; row++) {
        let point = grid.first + row * grid.columns + column.left;
        if !(grid_points[point].w > least && grid_points[point + 1u].w > least) {
            return false;
        }
    }
    return true;
}

@compute @workgroup_size(RAY_SIDE, RAY_SIDE)
fn add_air(@builtin(global_invocation_id) id: vec3<u32>) {
    let tile = tiles[parameters.tile];
    let viewport = viewports[tile.viewport];
    let first_row = id.y * AIR_ROWS;
    if id.x >= viewport.size.x || first_row >= tile.rows {
        return;
    }
    var column: GridColumn;
    if FROM_GRID {
        column = grid_column(point_grids[tile.viewport], id.x);
    }
    let top = vec2(id.x, tile.first_row + first_row);
    let rows = min(AIR_ROWS, tile.rows - first_row);
    // The grid of plain blocks already contains their light.
    let flags = block_flags(tile.viewport, top);
    if (flags & BLOCK_IS_MIXED) == 0u {
        return;
    }
    let is_steep = (flags & BLOCK_HAS_STEEP_AIR) != 0u;
    // In most of a dome the grid is sufficient. An air mass is needed only in directions in which bodies are visible.
    if FROM_GRID && !is_steep && is_clear(column, top.y, rows) {
        for (var row = 0u; row < rows; row++) {
            let pixel = top + vec2(0u, row);
            if !contains(viewport, vec2<i32>(pixel)) {
                continue;
            }
            let index = tile.first_pixel + (first_row + row) * viewport.size.x + id.x;
            let before = geometry[index];
            var light = bitcast<vec3<f32>>(before.xyz);
            if parameters.has_air != 0u {
                if any(light > vec3(0.0)) {
                    let towards = normalize(world_direction(viewport, direction_of_pixel(viewport, vec2<i32>(pixel))));
                    light *= exp2(parameters.extinction * air_mass(mirrored(dot(towards, parameters.zenith), parameters.has_ground != 0u)));
                }
                light += parameters.light_share * grid_in_row(&column, pixel.y);
            }
            geometry[index] = vec4(bitcast<vec3<u32>>(light), before.w);
        }
        return;
    }
    var next = direction_of_pixel(viewport, vec2<i32>(top));
    for (var row = 0u; row < rows; row++) {
        let pixel = vec2<i32>(top + vec2(0u, row));
        let own = next;
        next = direction_of_pixel(viewport, pixel + vec2(0, 1));
        if !contains(viewport, pixel) {
            continue;
        }
        let index = tile.first_pixel + (first_row + row) * viewport.size.x + id.x;
        let before = geometry[index];
        var light = bitcast<vec3<f32>>(before.xyz);
        var word = before.w;
        let towards = normalize(world_direction(viewport, own));
        let sine = dot(towards, parameters.zenith);
        let heading = vec2(-dot(towards, parameters.south), dot(towards, parameters.east));
        if parameters.has_air != 0u {
            let passed = exp2(parameters.extinction * air_mass(mirrored(sine, parameters.has_ground != 0u)));
            var added: vec3<f32>;
            if FROM_GRID {
                added = grid_in_row(&column, u32(pixel.y));
                if is_steep || sine < GRID_FROM {
                    added = added_light(towards);
                }
            } else {
                added = added_light(towards);
            }
            light = light * passed + parameters.light_share * added;
        }
        if parameters.has_ground != 0u {
            let right = direction_of_pixel(viewport, pixel + vec2(1, 0));
            var share = 0.0;
            var ground = parameters.ground;
            if HAS_LANDSCAPE {
                let seen = landscape_at(sine, heading, length(cross(own, right)) / max(dot(own, own), 1e-12));
                share = seen.w;
                ground = parameters.white * seen.xyz / max(seen.w, 1e-6);
            } else {
                let above = sine - horizon_sine(heading);
                // Pixels across the horizon show both ground and sky.
                let slopes = vec2(
                    dot(world_direction(viewport, right - own), parameters.zenith),
                    dot(world_direction(viewport, next - own), parameters.zenith));
                let across = clamp(0.5 - above / max(abs(slopes.x) + abs(slopes.y), 1e-7), 0.0, 1.0);
                share = select(select(0.0, 1.0, above < 0.0), across, abs(above) < NEAR_HORIZON);
            }
            if share > 0.0 {
                light = mix(light, parameters.light_share * ground, share);
                let flags = word & (COVER_LIMB | COVER_MESH);
                word = cover_word(1.0 - (1.0 - share) * (1.0 - coverage_of(word)), select(flags, 0u, share >= 1.0), 0.0);
            }
        }
        geometry[index] = vec4(bitcast<vec3<u32>>(light), word);
    }
}

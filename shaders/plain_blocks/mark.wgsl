// Marks the blocks of a picture that are not plain. These blocks show ground or the air near the horizon, or a second difference between the points
// of the grid shows that interpolation is not accurate enough. The passes over bodies mark further blocks. The pass also finds where the cells of
// plain blocks are in the map of faint light.

#import constants/frame_lists
#import constants/plain_blocks
#import constants/rec709
#import constants/workgroups
#import display/encode
#import shared/projection
#import shared/sky_cell
#import shared/sky_map
#import shared/viewport
#import structs/PlainGrid
#import structs/PlainParameters

@group(0) @binding(0) var<uniform> parameters: PlainParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;
@group(0) @binding(3) var<storage, read_write> grid_points: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> counters: array<u32>;
@group(0) @binding(5) var<storage, read> sky_texels: array<u32>;

// Margin above the highest ground, pixels.
const PIXELS_ABOVE_GROUND: f32 = 2.0;
// Maximum error of a position in a picture of the sky, rad: a twentieth of a texel of the finest map.
const MOST_PLACE_ERROR: f32 = 2e-4;
// Maximum error of the share of light that passes the air.
const MOST_PASSED_ERROR: f32 = 4e-3;

// Second differences of values around a point.
struct Differences {
    // Along its row, and along its column.
    along: vec4<f32>,
    across: vec4<f32>,
}

// `first`: index of the first point of a part. The points of the part are `stride` entries apart. Software drivers compile each read of a point for a
// long time, so the four neighbours are read in a loop.
fn differences_at(viewport: Viewport, first: u32, point: u32, columns: u32, stride: u32) -> Differences {
    let own = first + stride * point;
    let centre = grid_points[own];
    var found = Differences(-2.0 * centre, -2.0 * centre);
    for (var i = 0; i < turns(viewport, 4); i++) {
        let offset = select(stride, stride * columns, i >= 2);
        let neighbour = grid_points[select(own - offset, own + offset, (i & 1) == 1)];
        found.along += select(vec4(0.0), neighbour, i < 2);
        found.across += select(vec4(0.0), neighbour, i >= 2);
    }
    return found;
}

// Returns the error of interpolation: an eighth of each second difference.
fn error_of(differences: Differences) -> vec4<f32> {
    return 0.125 * (abs(differences.along) + abs(differences.across));
}

// Whether the image is a display image, whose errors are codes.
override JUDGES_CODES: bool;

// Whether an error of the light is significant if the sum of all light is `light`. Software drivers compile a copy of the encoding for each call and
// for each unrolled iteration. Therefore this loop and those of the callers must not be unrolled.
fn is_visible(viewport: Viewport, light: vec3<f32>, error: vec3<f32>) -> bool {
    if !JUDGES_CODES {
        let most = max(parameters.most_error * dot(light, LUMINANCE_WEIGHTS), parameters.floor_cd_m2);
        return !(max(error.x, max(error.y, error.z)) <= most);
    }
    // First the encoded light. Then the difference between the encoded sum of light and error, and the encoded light.
    var change = vec3(0.0);
    for (var i = 0; i < turns(viewport, 2); i++) {
        change = encoded_display(light + f32(i) * error, parameters.display_per_cd_m2, parameters.shown) - change;
    }
    return !(255.0 * max(abs(change.x), max(abs(change.y), abs(change.z))) <= parameters.most_error);
}

// Returns a point of a block's grid that has neighbours on all sides. `i` = 0: near the block's first corner; `i` = 1: near the opposite one.
fn inner_point(grid: PlainGrid, block: vec2<u32>, i: u32) -> u32 {
    let last = vec2(grid.columns, grid.rows) - 1u;
    let place = clamp(min((block + i) * (PLAIN_BLOCK >> grid.spacing_log2), last), vec2(1u), max(last, vec2(2u)) - 1u);
    return place.y * grid.columns + place.x;
}

// What interpolation would change around a point.
struct Judgement {
    // Whether the light, the solid angle of a pixel or the place in a picture of the sky changes too much.
    is_mixed: bool,
    // Whether this is because of the light of the air.
    is_steep: bool,
    // Whether the light that bodies scatter changes too much.
    has_rough_glare: bool,
    // Number of times that the spacing is halved until the rough part of diffuse light is smooth.
    halvings: u32,
    // Whether all neighbours are in the same picture of the sky, so that the error of places in it is known.
    has_place: bool,
}

// What is judged around a point, in this order.
const JUDGED_ROUGH: u32 = 0u;
const JUDGED_LIGHT: u32 = 1u;
const JUDGED_AIR: u32 = 2u;
const JUDGED_PLACE: u32 = 3u;
const JUDGED_PASSED: u32 = 4u;
const JUDGED_GLARE: u32 = 5u;
const JUDGED_PARTS: i32 = 6;

// Whether pixels read a map of the sky if the spacing is halved this often.
fn reads_place(halvings: u32) -> bool {
    return halvings > 0u || parameters.reads_faint_map != 0u;
}

// Returns the first point of a part, or NO_POINTS if the part is not judged.
fn points_of_part(grid: PlainGrid, part: u32, found: Judgement) -> u32 {
    switch part {
        case JUDGED_ROUGH: {
            return grid.rough;
        }
        case JUDGED_LIGHT: {
            return grid.first;
        }
        case JUDGED_AIR: {
            return select(NO_POINTS, grid.air, found.is_mixed);
        }
        case JUDGED_GLARE: {
            return grid.near;
        }
        default: {
            return select(NO_POINTS, grid.sky + part - JUDGED_PLACE, reads_place(found.halvings));
        }
    }
}

// Judges interpolation around a point. `first_part`: earlier parts are not judged. Software drivers compile a copy of every read of a point and of the
// encoding for each call, so there is one loop over the parts.
fn judgement_at(grid: PlainGrid, viewport: Viewport, point: u32, least_halvings: u32, first_part: u32) -> Judgement {
    var found = Judgement(false, false, false, least_halvings, false);
    let own = grid_points[grid.first + point];
    var is_curved = false;
    var of_rough: Differences;
    let end = u32(turns(viewport, JUDGED_PARTS));
    var part = first_part;
    while part < end {
        let first = points_of_part(grid, part, found);
        if first == NO_POINTS {
            part++;
            continue;
        }
        let stride = select(1u, 2u, part == JUDGED_PLACE || part == JUDGED_PASSED);
        var differences = differences_at(viewport, first, point, grid.columns, stride);
        if part == JUDGED_ROUGH {
            of_rough = Differences(vec4(differences.along.xyz, 0.0), vec4(differences.across.xyz, 0.0));
        }
        if part == JUDGED_LIGHT && found.halvings > 0u {
            // The rough part is read from its map, so only the rest is interpolated.
            differences = Differences(differences.along - of_rough.along, differences.across - of_rough.across);
        }
        let error = error_of(differences);
        if part == JUDGED_PLACE {
            // If a neighbour is in another picture, the error of positions in this one is unknown.
            found.has_place = error.z == 0.0;
            is_curved = is_curved || (found.has_place && !(max(error.x, error.y) <= MOST_PLACE_ERROR));
        } else if part == JUDGED_PASSED {
            is_curved = is_curved || !(max(error.x, max(error.y, error.z)) <= MOST_PASSED_ERROR);
        } else {
            // At half the distance the error is a quarter.
            let halvings = select(0u, found.halvings, part == JUDGED_ROUGH);
            let is_seen = is_visible(viewport, own.xyz, error.xyz / f32(1u << (2u * halvings)));
            if part == JUDGED_ROUGH && is_seen && halvings < MOST_HALVINGS {
                found.halvings++;
                continue;
            }
            if part == JUDGED_LIGHT {
                found.is_mixed = is_seen;
                is_curved = !(error.w <= parameters.most_solid_angle_error * own.w);
            }
            found.is_steep = found.is_steep || (part == JUDGED_AIR && is_seen);
            found.has_rough_glare = found.has_rough_glare || (part == JUDGED_GLARE && is_seen);
        }
        part++;
    }
    found.is_mixed = found.is_mixed || is_curved;
    return found;
}

// Returns the direction of a point in terms of the pictures of the sky.
fn direction_at(grid: PlainGrid, point: u32) -> PictureDirection {
    let place = grid_points[grid.sky + 2u * point];
    return PictureDirection(u32(place.z), place.xy);
}

// Finds the picture of the map of faint light that contains the middle of a cell, and the places of the cell's corners in the picture. `first`: the
// cell's first point.
fn place_cell(grid: PlainGrid, viewport: Viewport, first: u32) {
    let corner = direction_at(grid, first);
    let opposite = direction_at(grid, first + grid.columns + 1u);
    let middle = PictureDirection(corner.number, 0.5 * (corner.offset + opposite.offset));
    let picture = sky_picture(parameters.faint_map, middle);
    let entry = grid.faint + SKY_CELL_ENTRIES * first;
    grid_points[entry] = index_entry(picture.first, picture.width);
    // The left and the right corner above, then those below.
    for (var row = 0; row < turns(viewport, 2); row++) {
        let left = first + u32(row) * grid.columns;
        var places = vec4(0.0);
        for (var column = 0; column < turns(viewport, 2); column++) {
            let place = place_in_picture(parameters.faint_map, picture, direction_at(grid, left + u32(column)));
            places = vec4(select(places.xy, place, column == 0), place);
        }
        grid_points[entry + 1u + u32(row)] = places;
    }
}

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn mark_blocks(@builtin(global_invocation_id) id: vec3<u32>) {
    let grid = plain_grids[id.z];
    if id.x >= grid.block_columns || id.y >= grid.block_rows {
        return;
    }
    let viewport = viewports[id.z];
    let flag = grid.first_flag + id.y * grid.block_columns + id.x;
    if grid.first == NO_POINTS {
        counters[flag] = BLOCK_IS_MIXED;
        return;
    }
    // A block is outside of a round picture if its pixel nearest to the centre is outside.
    let first_pixel = vec2<i32>(id.xy * PLAIN_BLOCK);
    let last_pixel = min(first_pixel + i32(PLAIN_BLOCK) - 1, vec2<i32>(viewport.size) - 1);
    if !contains(viewport, clamp(vec2<i32>(viewport.size) / 2, first_pixel, last_pixel)) {
        counters[flag] = BLOCK_IS_OUTSIDE;
        return;
    }
    let cells = PLAIN_BLOCK >> grid.spacing_log2;
    let least_sine = parameters.ground_sine + PIXELS_ABOVE_GROUND * grid.spacing_rad / f32(grid.spacing);
    let last = vec2(grid.columns, grid.rows) - 1u;
    var is_mixed = false;
    var is_steep = false;
    // Whether the block is next to a body.
    var is_beside = false;
    // Number of times that the spacing is halved until the rough part of diffuse light is smooth.
    var halvings = 0u;
    // Whether the block is at an edge between two pictures of the sky.
    var is_edge = false;
    // Values at the corners of the block's cells.
    let first_number = grid_points[grid.sky + 2u * (id.y * cells * grid.columns + id.x * cells)].z;
    for (var row = 0u; row <= cells; row++) {
        for (var column = 0u; column <= cells; column++) {
            let place = min(id.xy * cells + vec2(column, row), last);
            let point = place.y * grid.columns + place.x;
            is_mixed = is_mixed || !(grid_points[grid.first + point].w > 0.0);
            if grid.air != NO_POINTS {
                is_mixed = is_mixed || !(grid_points[grid.air + point].w > least_sine);
            }
            if grid.near != NO_POINTS {
                is_beside = is_beside || grid_points[grid.near + point].w > 0.0;
            }
            if grid.rough != NO_POINTS {
                halvings = max(halvings, u32(grid_points[grid.diffuse + point].w));
            }
            if grid.rough != NO_POINTS || parameters.reads_faint_map != 0u {
                is_edge = is_edge || grid_points[grid.sky + 2u * point].z != first_number;
            }
        }
    }
    // Judge two opposite corners. Of a block that is mixed already, only the light that bodies scatter is judged. Positions are valid if the neighbours
    // of at least one corner are in the same picture.
    let judges_all = !(is_mixed || is_beside);
    let first_part = select(JUDGED_GLARE, JUDGED_ROUGH, judges_all);
    var has_place = false;
    var has_rough_glare = is_beside;
    for (var i = 0; i < turns(viewport, 2); i++) {
        let found = judgement_at(grid, viewport, inner_point(grid, id.xy, u32(i)), halvings, first_part);
        is_mixed = is_mixed || found.is_mixed;
        is_steep = is_steep || found.is_steep;
        halvings = found.halvings;
        has_place = has_place || found.has_place;
        has_rough_glare = has_rough_glare || found.has_rough_glare;
    }
    // The air near the horizon is steep.
    is_steep = is_steep || !judges_all;
    is_mixed = is_mixed || is_beside || (reads_place(halvings) && (is_edge || !has_place));
    var flags = select(0u, BLOCK_IS_MIXED, is_mixed) | select(0u, BLOCK_HAS_STEEP_AIR, is_steep)
        | (halvings << BLOCK_HALVINGS_SHIFT);
    if is_mixed && grid.near != NO_POINTS && !has_rough_glare {
        flags |= BLOCK_HAS_SMOOTH_GLARE;
    }
    counters[flag] = flags;
    if is_mixed || parameters.reads_faint_map == 0u {
        return;
    }
    for (var row = 0u; row < cells; row++) {
        for (var column = 0u; column < cells; column++) {
            let place = id.xy * cells + vec2(column, row);
            if all(place < last) {
                place_cell(grid, viewport, place.y * grid.columns + place.x);
            }
        }
    }
}

// Marks the blocks of a picture that are not plain: those that show ground or the air near the horizon, and those where a
// second difference between the points of the grid says that interpolation is not accurate enough. The passes over bodies
// mark further blocks.

#import constants/frame_lists
#import constants/plain_blocks
#import constants/workgroups
#import shared/projection
#import shared/viewport
#import structs/PlainGrid
#import structs/PlainParameters

@group(0) @binding(0) var<uniform> parameters: PlainParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;
@group(0) @binding(3) var<storage, read> grid_points: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> counters: array<u32>;

// Relative error of the inverse solid angle that a plain block may have.
const MOST_SOLID_ANGLE_ERROR: f32 = 5e-4;

// Error of interpolation beside a point, from second differences along rows and columns: an eighth of each. `first`: index of
// the first point of a part.
fn error_at(first: u32, point: u32, columns: u32) -> vec4<f32> {
    let centre = 2.0 * grid_points[first + point];
    let along = grid_points[first + point - 1u] + grid_points[first + point + 1u] - centre;
    let across = grid_points[first + point - columns] + grid_points[first + point + columns] - centre;
    return 0.125 * (abs(along) + abs(across));
}

fn largest(light: vec4<f32>) -> f32 {
    return max(light.x, max(light.y, light.z));
}

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn mark_blocks(@builtin(global_invocation_id) id: vec3<u32>) {
    let grid = plain_grids[id.z];
    if id.x >= grid.block_columns || id.y >= grid.block_rows {
        return;
    }
    let viewport = viewports[id.z];
    let flag = grid.first_flag + id.y * grid.block_columns + id.x;
    // A block outside of a round picture: its pixel nearest to the centre is outside.
    let first_pixel = vec2<i32>(id.xy * PLAIN_BLOCK);
    let last_pixel = min(first_pixel + i32(PLAIN_BLOCK) - 1, vec2<i32>(viewport.size) - 1);
    if !contains(viewport, clamp(vec2<i32>(viewport.size) / 2, first_pixel, last_pixel)) {
        counters[flag] = BLOCK_IS_OUTSIDE;
        return;
    }
    let cells = PLAIN_BLOCK / grid.spacing;
    let last = vec2(grid.columns, grid.rows) - 1u;
    var is_mixed = false;
    var is_steep = false;
    for (var i = 0u; i < (cells + 1u) * (cells + 1u); i++) {
        let place = min(id.xy * cells + vec2(i % (cells + 1u), i / (cells + 1u)), last);
        let point = place.y * grid.columns + place.x;
        // Second differences need neighbours.
        let inner = clamp(place, vec2(1u), max(last, vec2(2u)) - 1u);
        let inner_point = inner.y * grid.columns + inner.x;
        let own = grid_points[grid.first + point];
        let error = error_at(grid.first, inner_point, grid.columns);
        is_mixed = is_mixed || !(own.w > 0.0 && error.w <= MOST_SOLID_ANGLE_ERROR * own.w) || !(largest(error) <= parameters.most_error);
        if grid.air != NO_POINTS {
            is_mixed = is_mixed || !(grid_points[grid.air + point].w > parameters.least_sine);
            is_steep = is_steep || !(largest(error_at(grid.air, inner_point, grid.columns)) <= parameters.most_error);
        }
        if grid.diffuse != NO_POINTS {
            is_mixed = is_mixed || grid_points[grid.diffuse + point].w >= 1.0;
        }
        if grid.near != NO_POINTS {
            is_mixed = is_mixed || grid_points[grid.near + point].w > 0.0;
        }
    }
    counters[flag] = select(0u, BLOCK_IS_MIXED, is_mixed || is_steep) | select(0u, BLOCK_HAS_STEEP_AIR, is_steep);
}

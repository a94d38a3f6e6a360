// Sharpens a level of the glare map, to compensate for the smoothing by quadratic B-splines, which add one eighth of each neighbour along either
// axis. The rim shrinks by one point.

#import constants/workgroups
#import structs/GlareSharpenParameters

@group(0) @binding(0) var<uniform> parameters: GlareSharpenParameters;
@group(0) @binding(1) var<storage, read> scattered: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> sharpened: array<vec4<f32>>;

@compute @workgroup_size(MAP_SIDE, MAP_SIDE)
fn sharpen(@builtin(global_invocation_id) point: vec3<u32>) {
    let row_points = parameters.edge_cells + 2u;
    if any(point.xy >= vec2(row_points)) {
        return;
    }
    let wide = row_points + 2u;
    let middle = (point.z * wide + point.y + 1u) * wide + point.x + 1u;
    let around = scattered[middle - 1u] + scattered[middle + 1u] + scattered[middle - wide] + scattered[middle + wide];
    let index = (point.z * row_points + point.y) * row_points + point.x;
    sharpened[parameters.first_point + index] = scattered[middle] - (around - 4.0 * scattered[middle]) / 8.0;
}

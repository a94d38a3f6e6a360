// Adds up light from the cells of the sky at the points of a level of the glare map. The chosen source provides three functions: the weight of a cell
// as a function of its distance, the light of a cell, and the light to which the sum is added. The input is described in
// crates/render/src/plan/glare/sky_cube.

#import constants/glare_map
#import constants/workgroups
#import glare/sky_cube/map_points
#import source = glare/sky_cube/map_kernel | glare/sky_cube/map_bump
#import structs/GlareCell

@group(0) @binding(1) var<storage, read> cells: array<GlareCell>;
@group(0) @binding(4) var<storage, read_write> summed: array<vec4<f32>>;

@compute @workgroup_size(MAP_SIDE, MAP_ROWS)
fn sum_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let n = parameters.edge_cells;
    let row_points = n + 2u * RIM;
    let points = points_of(n, group, local);
    if any(points.first.xy >= vec2(row_points)) {
        return;
    }
    var red = vec4(0.0);
    var green = vec4(0.0);
    var blue = vec4(0.0);
    let centre = direction_of_group(n, group);
    for (var face = 0u; face < 6u; face++) {
        let range = cells_reached(n, face, centre, parameters.group_end_sine);
        if range.is_empty {
            continue;
        }
        for (var row = range.first.y; row <= range.last.y; row++) {
            for (var column = range.first.x; column <= range.last.x; column++) {
                let index = (face * n + row) * n + column;
                let cell = cells[index];
                let weight = weights(squared_chords(points, cell.direction));
                let light = light_of(index, cell);
                red += weight * light.x;
                green += weight * light.y;
                blue += weight * light.z;
            }
        }
    }
    // Software drivers would unroll a loop of at most four iterations, and compile four copies for seconds. `n` is never 0.
    let end = select(min(4u, row_points - points.first.y), 0u, n == 0u);
    for (var i = 0u; i < end; i++) {
        let own = index_of(n, points, i);
        let before = light_before(own, vec3(points.x[i], points.y[i], points.z[i]));
        summed[own] = vec4(before + vec3(red[i], green[i], blue[i]), 0.0);
    }
}

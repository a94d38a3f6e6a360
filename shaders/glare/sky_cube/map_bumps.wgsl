// Adds to the finest level of the glare map the light near sources that are too faint to be drawn individually: a bump around
// each cell.

#import constants/glare_map
#import constants/workgroups
#import glare/sky_cube/map_points
#import structs/GlareBumpParameters
#import structs/GlareCell

@group(0) @binding(0) var<uniform> parameters: GlareBumpParameters;
@group(0) @binding(1) var<storage, read> cells: array<GlareCell>;
// Light of the bump of each cell, lx per sr.
@group(0) @binding(2) var<storage, read> bumps: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> scattered: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> with_bumps: array<vec4<f32>>;

@compute @workgroup_size(MAP_SIDE, MAP_ROWS)
fn add_bumps(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
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
                let squared = squared_chords(points, cells[index].direction);
                let inside = max(1.0 - squared * parameters.inverse_squared, vec4(0.0));
                let weight = inside * inside;
                let bump = bumps[index].xyz;
                red += weight * bump.x;
                green += weight * bump.y;
                blue += weight * bump.z;
            }
        }
    }
    for (var i = 0u; i < min(4u, row_points - points.first.y); i++) {
        let own = index_of(n, points, i);
        with_bumps[own] = scattered[own] + vec4(red[i], green[i], blue[i], 0.0);
    }
}

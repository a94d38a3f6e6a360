// Computes a level of the glare map: for each of its points, the light scattered towards it by the cells of the sky
// within reach of the level's kernel, plus the light of coarser levels. Its input is described in
// crates/render/src/plan/glare/sky_cube.

#import constants/glare_map
#import constants/workgroups
#import glare/sky_cube/cells
#import glare/sky_cube/map_points
#import structs/GlareCell
#import structs/GlareLevelParameters

@group(0) @binding(0) var<uniform> parameters: GlareLevelParameters;
@group(0) @binding(1) var<storage, read> cells: array<GlareCell>;
// Kernel, 1/sr, as a function of the squared chord.
@group(0) @binding(2) var<storage, read> kernel_table: array<f32>;
// The coarser level, sharpened, with a rim of one point.
@group(0) @binding(3) var<storage, read> map: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> scattered: array<vec4<f32>>;

// Kernel at squared chords.
fn kernel(squared: vec4<f32>) -> vec4<f32> {
    let place = min(squared, vec4(parameters.end_squared)) * parameters.entries;
    let entry = vec4<u32>(place);
    let low = vec4(kernel_table[entry.x], kernel_table[entry.y], kernel_table[entry.z], kernel_table[entry.w]);
    let next = entry + 1u;
    let high = vec4(kernel_table[next.x], kernel_table[next.y], kernel_table[next.z], kernel_table[next.w]);
    let within = mix(low, high, place - vec4<f32>(entry));
    return select(vec4(0.0), within, squared < vec4(parameters.end_squared));
}

@compute @workgroup_size(MAP_SIDE, MAP_ROWS)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
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
                let cell = cells[(face * n + row) * n + column];
                let weight = kernel(squared_chords(points, cell.direction));
                red += weight * cell.light.x;
                green += weight * cell.light.y;
                blue += weight * cell.light.z;
            }
        }
    }
    for (var i = 0u; i < min(4u, row_points - points.first.y); i++) {
        var sum = vec3(red[i], green[i], blue[i]);
        if parameters.coarser_cells > 0u {
            sum += read_map(0u, parameters.coarser_cells, vec3(points.x[i], points.y[i], points.z[i]));
        }
        scattered[index_of(n, points, i)] = vec4(sum, 0.0);
    }
}

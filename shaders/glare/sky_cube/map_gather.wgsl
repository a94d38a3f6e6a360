// Computes a level of the glare map: for each of its points, the light scattered towards it by the cells of the sky
// within reach of the level's kernel, plus the light of coarser levels. Points are at the centres of cells, and in a
// rim of two more points around each face. Its input is described in crates/render/src/plan/glare/sky_cube.

#import constants/glare_map
#import constants/workgroups
#import glare/sky_cube/cells
#import shared/math
#import shared/projection
#import structs/GlareCell
#import structs/GlareLevelParameters

@group(0) @binding(0) var<uniform> parameters: GlareLevelParameters;
@group(0) @binding(1) var<storage, read> cells: array<GlareCell>;
// Kernel, 1/sr, as a function of the squared chord.
@group(0) @binding(2) var<storage, read> kernel_table: array<f32>;
// Light of the bump of each cell, lx per sr.
@group(0) @binding(3) var<storage, read> bumps: array<vec4<f32>>;
// The coarser level, sharpened, with a rim of one point.
@group(0) @binding(4) var<storage, read> map: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> scattered: array<vec4<f32>>;

// Range of tangents along one axis of a face that a cone around a direction covers; `along` and `forward` are
// components of the direction. If the cone does not reach the face, the first value is larger.
fn reached(along: f32, forward: f32, sine: f32) -> vec2<f32> {
    let size = length(vec2(along, forward));
    if sine >= size {
        return vec2(-1.0, 1.0);
    }
    let middle = precise_atan2(along, forward);
    let share = sine / size;
    let half = precise_atan2(share, sqrt(1.0 - share * share));
    let from_angle = middle - half;
    let to_angle = middle + half;
    if from_angle > 0.25 * PI || to_angle < -0.25 * PI {
        return vec2(1.0, -1.0);
    }
    return tan(clamp(vec2(from_angle, to_angle), vec2(-0.25 * PI), vec2(0.25 * PI)));
}

@compute @workgroup_size(MAP_SIDE, MAP_SIDE)
fn gather(@builtin(global_invocation_id) point: vec3<u32>) {
    let n = parameters.edge_cells;
    let row_points = n + 2u * RIM;
    if any(point.xy >= vec2(row_points)) {
        return;
    }
    let tangents = (2.0 * (vec2<f32>(point.xy) - f32(RIM)) + 1.0) / f32(n) - 1.0;
    let direction = normalize(face_from_face(0u, point.z, vec3(tangents.x, -tangents.y, -1.0)));
    var sum = vec3(0.0);
    if parameters.coarser_cells > 0u {
        sum = read_map(0u, parameters.coarser_cells, direction);
    }
    for (var face = 0u; face < 6u; face++) {
        let on_face = face_from_face(face, 0u, direction);
        let columns = reached(on_face.x, -on_face.z, parameters.end_sine);
        let rows = reached(-on_face.y, -on_face.z, parameters.end_sine);
        if columns.x > columns.y || rows.x > rows.y {
            continue;
        }
        let first = vec2<u32>(0.5 * f32(n) * (1.0 + vec2(columns.x, rows.x)));
        let last = min(vec2<u32>(0.5 * f32(n) * (1.0 + vec2(columns.y, rows.y))), vec2(n - 1u));
        for (var row = first.y; row <= last.y; row++) {
            for (var column = first.x; column <= last.x; column++) {
                let index = (face * n + row) * n + column;
                let apart = direction - cells[index].direction;
                let squared = dot(apart, apart);
                if squared >= parameters.end_squared {
                    continue;
                }
                let place = squared * parameters.entries;
                let entry = u32(place);
                let weight = mix(kernel_table[entry], kernel_table[entry + 1u], place - f32(entry));
                sum += weight * cells[index].light;
                let inside = 1.0 - squared * parameters.bump_inverse;
                if parameters.bump_inverse > 0.0 && inside > 0.0 {
                    sum += inside * inside * bumps[index].xyz;
                }
            }
        }
    }
    scattered[(point.z * row_points + point.y) * row_points + point.x] = vec4(sum, 0.0);
}

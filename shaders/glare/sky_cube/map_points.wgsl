// Points of a level of the glare map, and the cells around a workgroup of points. Points are at the centres of cells, and in
// a rim of RIM more points around each face.
//
// A workgroup has MAP_SIDE by MAP_SIDE points, four of a column per invocation. All of them visit the same cells, so that a
// software driver reads a cell once for several points.

#import constants/glare_map
#import constants/workgroups
#import shared/math
#import shared/projection

// Returns the unit vector to a position on a face with `edge` cells along an edge. The position is in points, from the first one of the face's rim.
fn direction_at(edge: u32, face: u32, place: vec2<f32>) -> vec3<f32> {
    let tangents = (2.0 * (place - f32(RIM)) + 1.0) / f32(edge) - 1.0;
    return normalize(face_from_face(0u, face, vec3(tangents.x, -tangents.y, -1.0)));
}

// Returns the unit vector to the centre of a workgroup's points.
fn direction_of_group(edge: u32, group: vec3<u32>) -> vec3<f32> {
    return direction_at(edge, group.z, vec2<f32>(group.xy * MAP_SIDE) + 0.5 * f32(MAP_SIDE - 1u));
}

// Four points of a column.
struct Points {
    // Columns and rows from the first point of the rim, and the face.
    first: vec3<u32>,
    // Components of their directions.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Returns the points of an invocation.
fn points_of(edge: u32, group: vec3<u32>, local: vec3<u32>) -> Points {
    var points: Points;
    points.first = group * vec3(MAP_SIDE, MAP_SIDE, 1u) + vec3(local.x, 4u * local.y, 0u);
    for (var i = 0u; i < 4u; i++) {
        let direction = direction_at(edge, group.z, vec2<f32>(points.first.xy + vec2(0u, i)));
        points.x[i] = direction.x;
        points.y[i] = direction.y;
        points.z[i] = direction.z;
    }
    return points;
}

// Returns the index of one of the points.
fn index_of(edge: u32, points: Points, i: u32) -> u32 {
    let row_points = edge + 2u * RIM;
    return (points.first.z * row_points + points.first.y + i) * row_points + points.first.x;
}

// Returns the squared chords from the points to a direction.
fn squared_chords(points: Points, direction: vec3<f32>) -> vec4<f32> {
    let x = points.x - direction.x;
    let y = points.y - direction.y;
    let z = points.z - direction.z;
    return x * x + y * y + z * z;
}

// Returns the range of tangents along one axis of a face that a cone around a direction covers; `along` and `forward` are components of the
// direction. If the cone does not reach the face, the first value is larger.
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

// Columns and rows of cells of a face, from the first to the last.
struct CellRange {
    first: vec2<u32>,
    last: vec2<u32>,
    is_empty: bool,
}

// Returns the cells of a face with `edge` cells along an edge that a cone around a direction reaches. `sine`: sine of the cone's half angle; 2: all
// cells.
fn cells_reached(edge: u32, face: u32, direction: vec3<f32>, sine: f32) -> CellRange {
    let on_face = face_from_face(face, 0u, direction);
    let columns = reached(on_face.x, -on_face.z, sine);
    let rows = reached(-on_face.y, -on_face.z, sine);
    let first = vec2<u32>(0.5 * f32(edge) * (1.0 + vec2(columns.x, rows.x)));
    let last = min(vec2<u32>(0.5 * f32(edge) * (1.0 + vec2(columns.y, rows.y))), vec2(edge - 1u));
    return CellRange(first, last, columns.x > columns.y || rows.x > rows.y);
}

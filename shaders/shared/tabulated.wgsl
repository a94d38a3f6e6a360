// Tabulated projections: directions at the centres of pixels, and start points of the search for the pixel of a
// direction. Tables are built, checked and described in crates/render/src/view/projection/tabulated/, whose search.rs and nodes.rs do
// the same in f64.

#import constants/tabulated
#import shared/math
#import shared/viewport
#import tables = shared/tables_buffer | shared/tables_texture

// Returns the direction at a node, and solid angle of its pixel in sr, 0 outside the picture. All 0 if the node has no direction.
fn tabulated_node(viewport: Viewport, node: vec2<i32>) -> vec4<f32> {
    let counts = vec2<i32>(viewport.size) + 2 * TABLE_FRINGE;
    if any(node < vec2(0)) || any(node >= counts) {
        return vec4(0.0);
    }
    return bitcast<vec4<f32>>(mapping_table(viewport.face + TABLE_HEADER + u32(node.y * counts.x + node.x)));
}

// Returns the solid angle of a pixel, sr; 0 outside the picture or the image.
fn tabulated_solid_angle(viewport: Viewport, pixel: vec2<i32>) -> f32 {
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(viewport.size)) {
        return 0.0;
    }
    return tabulated_node(viewport, pixel + TABLE_FRINGE).w;
}

// Whether all pixels of a rectangle are in the picture.
fn tabulated_holds(viewport: Viewport, first: vec2<i32>, last: vec2<i32>) -> bool {
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            if tabulated_solid_angle(viewport, vec2(x, y)) <= 0.0 {
                return false;
            }
        }
    }
    return true;
}

// Directions at the four nodes around a position, row by row.
struct TableQuad {
    directions: array<vec3<f32>, 4>,
    exists: bool,
}

fn is_direction(v: vec3<f32>) -> bool {
    return dot(v, v) > 0.0;
}

fn table_quad(viewport: Viewport, place: vec2<f32>) -> TableQuad {
    let first = vec2<i32>(floor(place));
    let a = tabulated_node(viewport, first).xyz;
    let b = tabulated_node(viewport, first + vec2(1, 0)).xyz;
    let c = tabulated_node(viewport, first + vec2(0, 1)).xyz;
    let d = tabulated_node(viewport, first + vec2(1, 1)).xyz;
    let exists = is_direction(a) && is_direction(b) && is_direction(c) && is_direction(d);
    return TableQuad(array<vec3<f32>, 4>(a, b, c, d), exists);
}

fn linear_in_quad(quad: TableQuad, part: vec2<f32>) -> vec3<f32> {
    return mix(
        mix(quad.directions[0], quad.directions[1], part.x), mix(quad.directions[2], quad.directions[3], part.x), part.y);
}

// Returns the weights of a cubic convolution (Keys 1981, with a = -1/2) at a fraction of the way between the second and the third node.
fn cubic_weights(part: f32) -> array<f32, 4> {
    let rest = 1.0 - part;
    return array<f32, 4>(
        -0.5 * part * rest * rest,
        1.0 + part * part * (1.5 * part - 2.5),
        1.0 + rest * rest * (1.5 * rest - 2.5),
        -0.5 * rest * part * part);
}

// Returns the direction at a position by cubic convolution, of approximately unit length; w = 0 if a node is missing.
fn cubic_in_table(viewport: Viewport, place: vec2<f32>) -> vec4<f32> {
    let first = floor(place);
    var across = cubic_weights(place.x - first.x);
    var down = cubic_weights(place.y - first.y);
    let corner = vec2<i32>(first) - 1;
    var sum = vec3(0.0);
    let nodes = turns(viewport, 4);
    for (var j = 0; j < nodes; j++) {
        for (var i = 0; i < nodes; i++) {
            let direction = tabulated_node(viewport, corner + vec2(i, j)).xyz;
            if !is_direction(direction) {
                return vec4(0.0);
            }
            sum += direction * (across[i] * down[j]);
        }
    }
    return vec4(sum, 1.0);
}

// Returns the unit direction of a pixel coordinate, including a fringe beyond the picture; w = 0 if the table has none.
fn tabulated_at(viewport: Viewport, pixel: vec2<f32>) -> vec4<f32> {
    let place = pixel - 0.5 + f32(TABLE_FRINGE);
    if all(place == floor(place)) {
        let own = tabulated_node(viewport, vec2<i32>(place)).xyz;
        return vec4(own, select(0.0, 1.0, is_direction(own)));
    }
    let cubic = cubic_in_table(viewport, place);
    if cubic.w > 0.0 {
        return vec4(normalize(cubic.xyz), 1.0);
    }
    let quad = table_quad(viewport, place);
    if quad.exists {
        return vec4(normalize(linear_in_quad(quad, place - floor(place))), 1.0);
    }
    return vec4(0.0);
}

// Returns the unit direction of a pixel coordinate of the image; w = 0 outside the picture.
fn tabulated_direction(viewport: Viewport, pixel: vec2<f32>) -> vec4<f32> {
    let holder = min(vec2<i32>(pixel), vec2<i32>(viewport.size) - 1);
    let own = tabulated_node(viewport, holder + TABLE_FRINGE);
    if own.w <= 0.0 {
        return vec4(0.0);
    }
    let found = tabulated_at(viewport, pixel);
    return select(vec4(own.xyz, 1.0), found, found.w > 0.0);
}

// Differences between the direction of a node and those of its neighbours towards the centre of the picture.
struct TableSteps {
    own: vec3<f32>,
    // Column and row step to the neighbours, 1 or -1 each, and the differences in direction.
    sides: vec2<i32>,
    across: vec3<f32>,
    down: vec3<f32>,
    exists: bool,
}

fn steps_from(viewport: Viewport, node: vec2<i32>) -> TableSteps {
    let sides = select(vec2(1), vec2(-1), node * 2 > vec2<i32>(viewport.size) + 2 * TABLE_FRINGE);
    let own = tabulated_node(viewport, node).xyz;
    let across = tabulated_node(viewport, node + vec2(sides.x, 0)).xyz;
    let down = tabulated_node(viewport, node + vec2(0, sides.y)).xyz;
    let exists = is_direction(own) && is_direction(across) && is_direction(down);
    return TableSteps(own, sides, across - own, down - own, exists);
}

// Returns the larger and the smaller singular value of a linear map from the plane into space, given by its columns.
fn singular_values(a: vec3<f32>, b: vec3<f32>) -> vec2<f32> {
    let squares = vec2(dot(a, a), dot(b, b));
    let larger = sqrt(0.5 * (squares.x + squares.y + length(vec2(squares.x - squares.y, 2.0 * dot(a, b)))));
    return vec2(larger, length(cross(a, b)) / max(larger, 1e-30));
}

// Returns the direction of a point of the plane by linear continuation of the table from a pixel (column and row), of approximately unit length; w =
// 0 if the table has no direction there.
fn continued_from(viewport: Viewport, pixel: vec2<i32>, to: vec2<f32>) -> vec4<f32> {
    let steps = steps_from(viewport, pixel + TABLE_FRINGE);
    let by = (to - vec2<f32>(pixel) - 0.5) * vec2<f32>(steps.sides);
    return vec4(steps.own + steps.across * by.x + steps.down * by.y, select(0.0, 1.0, steps.exists));
}

// Search for a direction around a point that has none: number of steps, and pixels per step.
const LOOK_STEPS: i32 = 5;
const LOOK_STEP_PX: i32 = 4;

// Returns the unit direction of a point of the plane. Beyond the picture, the table is continued from a nearby position.
fn tabulated_beyond(viewport: Viewport, pixel: vec2<f32>) -> vec3<f32> {
    let last = vec2<i32>(viewport.size) - 1;
    let own = clamp(vec2<i32>(floor(pixel)), vec2(0), last);
    var found = continued_from(viewport, own, pixel);
    if found.w > 0.0 {
        return normalize(found.xyz);
    }
    var least = 1e30;
    for (var j = -LOOK_STEPS; j <= LOOK_STEPS; j++) {
        for (var i = -LOOK_STEPS; i <= LOOK_STEPS; i++) {
            let other = clamp(own + vec2(i, j) * LOOK_STEP_PX, vec2(0), last);
            let away = vec2<f32>(other) + 0.5 - pixel;
            if dot(away, away) < least {
                let from_there = continued_from(viewport, other, pixel);
                if from_there.w > 0.0 {
                    least = dot(away, away);
                    found = from_there;
                }
            }
        }
    }
    // No visible object is near such a point.
    return select(vec3(0.0, 0.0, -1.0), normalize(found.xyz), found.w > 0.0);
}

// Start of the search for the image of a unit vector.
struct TableStart {
    // Column of a node in the lower half, row in the upper half; NO_START; or PATCH_BIT and the index of a patch's
    // first group.
    word: u32,
    // Position of the vector in the cell, from (0, 0) to (1, 1).
    part: vec2<f32>,
}

// Cell of a unit vector: its words, the position in it, and whether it exists. Outside the grid, the first component of
// the position is the angle to the grid, rad.
struct TableCell {
    words: vec4<u32>,
    part: vec2<f32>,
    exists: bool,
}

fn cell_in_table(viewport: Viewport, direction: vec3<f32>) -> TableCell {
    let grid = mapping_table(viewport.face).xy;
    let axis = bitcast<vec4<f32>>(mapping_table(viewport.face + 1u));
    let right = bitcast<vec4<f32>>(mapping_table(viewport.face + 2u)).xyz;
    let up = bitcast<vec4<f32>>(mapping_table(viewport.face + 3u)).xyz;
    let across = vec2(dot(direction, right), dot(direction, up));
    let sine = length(across);
    var azimuth = vec2(1.0, 0.0);
    if sine > 1e-18 {
        azimuth = across / sine;
    }
    let side = f32(grid.x);
    let from_axis = precise_atan2(sine, dot(direction, axis.xyz)) * axis.w;
    let place = azimuth * from_axis + 0.5 * side;
    if any(place < vec2(0.0)) || any(place >= vec2(side)) {
        return TableCell(vec4(NO_START, NO_START, NO_START, 0u), vec2((from_axis - 0.5 * side) / axis.w, 0.0), false);
    }
    let held = floor(place);
    let words = mapping_table(viewport.face + grid.y + u32(held.y) * grid.x + u32(held.x));
    return TableCell(words, place - held, true);
}

fn start_in_table(viewport: Viewport, direction: vec3<f32>) -> TableStart {
    let cell = cell_in_table(viewport, direction);
    // A cut divides the cell: the side of the direction selects the word.
    let beyond = dot(unpack2x16snorm(cell.words.z), cell.part - 0.5) <= bitcast<f32>(cell.words.w);
    return TableStart(select(cell.words.x, cell.words.y, cell.words.y != NO_START && beyond), cell.part);
}

// Position of the picture near a unit vector, found without a search.
struct TableNear {
    // Lower bound of the angle from the vector to the picture, rad; 0 if the vector has an image.
    outside: f32,
    // The position, pixels, and its direction.
    pixel: vec2<f32>,
    direction: vec3<f32>,
    // Smaller angle that a pixel subtends there, rad; 0 if no position is known.
    shorter: f32,
}

fn near_in_table(viewport: Viewport, direction: vec3<f32>) -> TableNear {
    let cell = cell_in_table(viewport, direction);
    if !cell.exists {
        return TableNear(max(cell.part.x, 0.0), vec2(0.0), vec3(0.0), 0.0);
    }
    let empty = cell.words.x == NO_START;
    var near = TableNear(select(0.0, bitcast<f32>(cell.words.w), empty), vec2(0.0), vec3(0.0), 0.0);
    let word = select(cell.words.x, cell.words.z, empty);
    // Next to a cut there are two positions.
    if (word & PATCH_BIT) != 0u || (!empty && cell.words.y != NO_START) {
        return near;
    }
    let node = vec2<i32>(vec2(word & 0xffffu, word >> 16u));
    near.pixel = vec2<f32>(node) + 0.5 - f32(TABLE_FRINGE);
    let steps = steps_from(viewport, node);
    near.direction = steps.own;
    near.shorter = select(0.0, singular_values(steps.across, steps.down).y, steps.exists);
    return near;
}

// Returns the image interpolated in a patch, given the index of its first group.
fn image_in_patch(viewport: Viewport, first: u32, part: vec2<f32>) -> vec2<f32> {
    let place = clamp(part, vec2(0.0), vec2(1.0)) * f32(PATCH_STEPS);
    let held = min(floor(place), vec2(f32(PATCH_STEPS) - 1.0));
    let index = viewport.face + first + u32(held.y) * (PATCH_STEPS + 1u) + u32(held.x);
    let a = bitcast<vec2<f32>>(mapping_table(index).xy);
    let b = bitcast<vec2<f32>>(mapping_table(index + 1u).xy);
    let c = bitcast<vec2<f32>>(mapping_table(index + PATCH_STEPS + 1u).xy);
    let d = bitcast<vec2<f32>>(mapping_table(index + PATCH_STEPS + 2u).xy);
    let inside = place - held;
    return mix(mix(a, b, inside.x), mix(c, d, inside.x), inside.y);
}

// Returns the continuous pixel coordinates of the image of a direction (any length but 0); z = 1 if it exists.
fn tabulated_pixel(viewport: Viewport, towards: vec3<f32>) -> vec3<f32> {
    let direction = normalize(towards);
    let start = start_in_table(viewport, direction);
    if start.word == NO_START {
        return vec3(0.0);
    }
    if (start.word & PATCH_BIT) != 0u {
        return vec3(image_in_patch(viewport, start.word & ~PATCH_BIT, start.part), 1.0);
    }
    var place = vec2(f32(start.word & 0xffffu), f32(start.word >> 16u)) + 0.5;
    var held = place;
    var near = false;
    // If the search leaves the table, there is no image. If the picture shows the full sphere, however, the last position is the image.
    let exists = f32(viewport.full_sphere);
    for (var i = 0u; i < MOST_STEPS; i++) {
        let quad = table_quad(viewport, place);
        if !quad.exists {
            return vec3(held + 0.5 - f32(TABLE_FRINGE), exists);
        }
        held = place;
        let part = place - floor(place);
        let along_x = mix(quad.directions[1] - quad.directions[0], quad.directions[3] - quad.directions[2], part.y);
        let along_y = mix(quad.directions[2] - quad.directions[0], quad.directions[3] - quad.directions[1], part.x);
        var current = linear_in_quad(quad, part);
        if near {
            let cubic = cubic_in_table(viewport, place);
            current = select(current, cubic.xyz, cubic.w > 0.0);
        }
        // Find x and y for which at + x along_x + y along_y is parallel to the direction: Cramer's rule, ignoring the component along it.
        let missing = direction - normalize(current);
        let across = cross(along_y, direction);
        let determinant = dot(along_x, across);
        if determinant == 0.0 {
            return vec3(held + 0.5 - f32(TABLE_FRINGE), exists);
        }
        let step = vec2(dot(missing, across), dot(missing, cross(direction, along_x))) / determinant;
        place += clamp(step, vec2(-LONGEST_STEP_PX), vec2(LONGEST_STEP_PX));
        let squared = dot(step, step);
        if near && squared < DONE_PX * DONE_PX {
            break;
        }
        near = squared < NEAR_PX * NEAR_PX;
    }
    return vec3(place + 0.5 - f32(TABLE_FRINGE), 1.0);
}

// Returns the larger and the smaller angle that a pixel subtends around a position, rad: singular values of the derivative.
fn tabulated_extent(viewport: Viewport, pixel: vec2<f32>) -> vec2<f32> {
    // The middle, then a step ahead and a step back along each axis, in one loop: drivers insert a copy of the code of a place at each call.
    var middle = vec3(0.0);
    var ahead = vec4(0.0);
    var along = array<vec3<f32>, 2>();
    let places = turns(viewport, 5);
    for (var i = 0; i < places; i++) {
        let half = select(vec2(0.0, 0.5), vec2(0.5, 0.0), i < 3);
        let steps = select(select(-1.0, 1.0, (i & 1) == 1), 0.0, i == 0);
        let found = tabulated_at(viewport, pixel + steps * half);
        if i == 0 {
            middle = found.xyz;
        } else if (i & 1) == 1 {
            ahead = found;
        } else {
            // At a border, only the side that exists is used.
            let back = middle - found.xyz;
            along[(i - 1) / 2] = (ahead.xyz - middle) * ahead.w * (2.0 - found.w) + back * found.w * (2.0 - ahead.w);
        }
    }
    return singular_values(along[0], along[1]);
}

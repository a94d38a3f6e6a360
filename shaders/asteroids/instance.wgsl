// Groups and fields of asteroids, and the unpacking of an instance. An instance is six words: PackedAsteroid in
// crates/render/src/scene/asteroids/mod.rs.

#import constants/asteroid_instances
#import structs/AsteroidField
#import structs/AsteroidItem

// Rotates a vector from the field's axes to world axes.
fn world_from_field(field: AsteroidField, v: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(field.world_from_field_x.xyz, v), dot(field.world_from_field_y.xyz, v), dot(field.world_from_field_z.xyz, v));
}

// Returns the position of an instance minus camera, world axes, m. The large parts cancel first; then the rounding error of the origin is added.
fn place_of(item: AsteroidItem, field: AsteroidField, offset: vec3<f32>) -> vec3<f32> {
    return (item.origin + world_from_field(field, offset)) + item.origin_low;
}

// Returns the mean radius, m.
fn radius_of(field: AsteroidField, radius_and_shape: u32) -> f32 {
    return f32(radius_and_shape & 65535u) * field.world_from_field_x.w;
}

// Returns the index of the shape among the shapes of all fields.
fn shape_of(field: AsteroidField, radius_and_shape: u32) -> u32 {
    return field.first_shape + min((radius_and_shape >> 16u) & 255u, field.shape_count - 1u);
}

// Returns the spin axis in integers, of any length, from an octahedral pair. The sign of z selects the frame around the axis, so it must not be
// rounded.
fn whole_axis(packed: u32) -> vec3<i32> {
    let pair = max(vec2(bitcast<i32>(packed << 16u), bitcast<i32>(packed)) >> vec2(16u), vec2(-AXIS_PARTS));
    let height = AXIS_PARTS - abs(pair.x) - abs(pair.y);
    let folded = (AXIS_PARTS - abs(pair.yx)) * select(vec2(-1), vec2(1), pair >= vec2(0));
    return vec3(select(pair, folded, height < 0), height);
}

// Returns the rotation from a shape's axes to the field's: a rotation about +z, which is then mapped to the spin axis. The basis around the axis is
// that of Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017.
fn field_from_shape(field: AsteroidField, packed_axis: u32, spin: u32) -> mat3x3<f32> {
    let whole = whole_axis(packed_axis);
    let axis = normalize(vec3<f32>(whole));
    let side = select(-1.0, 1.0, whole.z >= 0);
    let a = -1.0 / (side + axis.z);
    let b = axis.x * axis.y * a;
    let first = vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x);
    let second = vec3(b, side + axis.y * axis.y * a, -axis.y);
    // Whole rotations vanish in the 32-bit product.
    let rate = u32(bitcast<i32>(spin) >> 16u);
    let turn = (spin << 16u) + rate * field.time_parts;
    let angle = f32(bitcast<i32>(turn)) * (3.14159265358979 / 2147483648.0);
    let cosine = cos(angle);
    let sine = sin(angle);
    return mat3x3(cosine * first + sine * second, cosine * second - sine * first, axis);
}

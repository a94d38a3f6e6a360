// Shapes of asteroids in the table that pictures and shapes share: crates/render/src/render/asteroids/held.rs. The importer
// binds `asteroid_tables`.

#import constants/asteroid_classes

struct AsteroidShape {
    // Kind of list of its finest mesh; the coarser ones follow.
    first_kind: u32,
    // Number of levels of detail.
    levels: u32,
    // Radius of the bounding sphere, mean radii.
    bound: f32,
    // Entry of its finest level: error and longest edge, mean radii.
    first_level: u32,
    // Entry of its first projected area.
    first_area: u32,
}

fn asteroid_shape(index: u32) -> AsteroidShape {
    let first = FIRST_SHAPE + 3u * index;
    let kinds = asteroid_tables[first];
    let bound_and_level = asteroid_tables[first + 1u];
    return AsteroidShape(
        u32(kinds.x), u32(kinds.y), bound_and_level.x, u32(bound_and_level.y), u32(asteroid_tables[first + 2u].x));
}

// Returns the bound of a shape, mean radii.
fn bound_of_shape(index: u32) -> f32 {
    return asteroid_tables[FIRST_SHAPE + 3u * index + 1u].x;
}

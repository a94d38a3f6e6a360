// Bakes an atlas: one block of tiles at a time, in samples.

struct ImpostorBakeParameters {
    // Samples along the side of the block, and per bounding radius.
    side: f32,
    scale: f32,
    // Radius of the bounding sphere, mean radii.
    bound: f32,
    // Factor on the albedo that is stored as 1.
    albedo_scale: f32,
}

struct ImpostorBakeTile {
    // The picture's axes in the shape's axes.
    right: vec3<f32>,
    unused_0: f32,
    up: vec3<f32>,
    unused_1: f32,
    direction: vec3<f32>,
    unused_2: f32,
    // Its middle on the block, samples from the top left.
    middle: vec2<f32>,
    unused_3: vec2<f32>,
}

struct BakedCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) surface: vec2<f32>,
}

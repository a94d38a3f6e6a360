// Bakes an atlas: one block of tiles at a time, in samples.

#import structs/ImpostorBakeParameters
#import structs/ImpostorBakeTile

struct BakedCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) surface: vec2<f32>,
}

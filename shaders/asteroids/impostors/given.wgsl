// Single asteroids in view axes, to test impostors in isolation. Provides the same functions as asteroids/listed.wgsl, for flat pictures only.

#import shared/viewport
#import structs/GivenAsteroid
#import structs/GivenTarget

@group(0) @binding(0) var<uniform> given_target: GivenTarget;
@group(0) @binding(1) var<storage, read> given: array<GivenAsteroid>;

struct Asteroid {
    centre: vec3<f32>,
    radius: f32,
    shape: u32,
    view_from_shape: mat3x3<f32>,
    sun: vec3<f32>,
    luminance: vec3<f32>,
    law: u32,
    fade: f32,
}

fn slot_of(instance_index: u32) -> u32 {
    return instance_index;
}

fn load_asteroid(slot: u32) -> Asteroid {
    let asteroid = given[slot];
    let view_from_shape = mat3x3(asteroid.view_from_shape_x, asteroid.view_from_shape_y, asteroid.view_from_shape_z);
    return Asteroid(
        asteroid.centre,
        asteroid.radius,
        asteroid.shape,
        view_from_shape,
        asteroid.sun,
        asteroid.luminance,
        asteroid.law,
        1.0);
}

fn clip_from_view(place: vec3<f32>) -> vec4<f32> {
    let viewport = given_target.viewport;
    let w = -place.z;
    let pixel_w = viewport.plane_offset * w + viewport.plane_scale * place.xy;
    let size = vec2<f32>(viewport.size);
    return vec4(2.0 * pixel_w.x / size.x - w, w - 2.0 * pixel_w.y / size.y, given_target.near, w);
}

fn faded(fade: f32, pixel: vec2<u32>) -> bool {
    return fade < 0.0 && pixel.x == 0u;
}

// What is scattered towards a pixel, by the method `sky_cube`.

@group(1) @binding(0) var<storage, read> veil: array<vec4<f32>>;

fn scattered_towards(viewport: Viewport, tile: Tile, group: vec3<u32>, at: vec2<i32>) -> vec3<f32> {
    return veil[0].xyz;
}

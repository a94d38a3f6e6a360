// What the corners of asteroids' meshes hand to the fragments.

struct Corner {
    @builtin(position) clip: vec4<f32>,
    // Relative to the eye, in radii, view axes.
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) sun: vec3<f32>,
    // Times the albedo's factor there.
    @location(3) luminance: vec3<f32>,
    @location(4) @interpolate(flat) fade_and_law: vec2<f32>,
}

// Interface between the vertex and fragment shaders of asteroid meshes.

struct Corner {
    @builtin(position) clip: vec4<f32>,
    // Position relative to the eye, in radii, view axes.
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) sun: vec3<f32>,
    // Includes the local factor of the albedo.
    @location(3) luminance: vec3<f32>,
    @location(4) @interpolate(flat) fade_and_law: vec2<f32>,
}

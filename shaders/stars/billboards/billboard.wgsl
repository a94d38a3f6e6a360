// Stars that the graphics pipeline draws on a flat image plane: the interface between vertex and fragment shader, and their common parameters.
// Footprints are in stars/billboards/place.wgsl, profiles in profile_*.wgsl.

#import shared/viewport
#import structs/BillboardParameters

@group(0) @binding(0) var<uniform> parameters: BillboardParameters;
@group(0) @binding(1) var<uniform> plane: Viewport;

struct Splat {
    @builtin(position) position: vec4<f32>,
    // Factor by which the profile is multiplied: luminance, cd/m^2.
    @location(0) @interpolate(flat) light: vec3<f32>,
    // Footprints in the sky: unit direction in the plane's axes. Footprints on the plane: pixel coordinates.
    @location(1) @interpolate(flat) centre: vec3<f32>,
    // Footprints in the sky: direction to the right of the billboard.
    @location(2) @interpolate(flat) right: vec3<f32>,
    // Size of the footprint: tangent of the half side in the sky, or half side in pixels; then a parameter of the law.
    @location(3) @interpolate(flat) size: vec2<f32>,
}

// Interface between the vertex and fragment shaders of impostors, and the atlas.
//
// Lengths are in bounding radii of the asteroid: mean radius times the bound of its shape. A tile is T texels wide with
// an empty border of one texel, so the bounding sphere spans T - 2.

#import structs/ImpostorAtlas

override METHOD: u32;

@group(1) @binding(0) var<uniform> atlas: ImpostorAtlas;
// Bounds of the shapes, mean radii.
@group(1) @binding(1) var<storage, read> bounds: array<f32>;
// One layer per shape. RGB: normal in the shape's axes, mapped from -1..1 to 0..1; alpha: coverage.
@group(1) @binding(2) var normals: texture_2d_array<f32>;
// Red: albedo divided by its scale. Green: depth along the tile's direction, 0.5 at the centre, 1 at one bounding
// radius towards the eye. Blue: coverage.
@group(1) @binding(3) var surfaces: texture_2d_array<f32>;
@group(1) @binding(4) var trilinear: sampler;

struct ImpostorCorner {
    @builtin(position) clip: vec4<f32>,
    // Position on the square relative to the centre, view axes.
    @location(0) offset: vec3<f32>,
    // Right and up on the tile, 1 at the bounding sphere; not used by blends.
    @location(1) place: vec2<f32>,
    // Centre relative to the eye, view axes; w: bounding radius, m.
    @location(2) @interpolate(flat) centre: vec4<f32>,
    // Columns of the rotation from the shape's axes to those of the view.
    @location(3) @interpolate(flat) view_from_shape_x: vec3<f32>,
    @location(4) @interpolate(flat) view_from_shape_y: vec3<f32>,
    @location(5) @interpolate(flat) view_from_shape_z: vec3<f32>,
    // Unit vector towards the sun; w: fade.
    @location(6) @interpolate(flat) sun: vec4<f32>,
    // Luminance; w: number of the reflection law.
    @location(7) @interpolate(flat) luminance: vec4<f32>,
    // Up to three tiles: column in the low half of the word, row in the high half; w: layer.
    @location(8) @interpolate(flat) tiles: vec4<u32>,
    // Their weights.
    @location(9) @interpolate(flat) weights: vec3<f32>,
}

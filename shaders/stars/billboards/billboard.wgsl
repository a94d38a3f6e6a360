// Stars drawn by the graphics pipeline on a flat image plane: interface between vertex and fragment shader, and their
// common parameters. Footprints are in stars/billboards/place.wgsl, profiles in profile_*.wgsl.

#import shared/viewport

struct BillboardParameters {
    // Rows of the rotation from the axes of the plane to those of the view; they differ for the faces of a cube.
    view_from_plane_x: vec4<f32>,
    view_from_plane_y: vec4<f32>,
    view_from_plane_z: vec4<f32>,
    // ICRS, pc.
    camera: vec3<f32>,
    // Fainter stars are not drawn, lx.
    faintest_lx: f32,
    // Discs and sprites: radius, rad, and solid angle, sr.
    radius_rad: f32,
    solid_angle_sr: f32,
    // Stars of this magnitude or brighter are drawn largest.
    brightest_magnitude: f32,
    // Stars of this magnitude or fainter are drawn smallest.
    faintest_magnitude: f32,
    // screen_billboard: half of the side, pixels.
    half_side_px: f32,
    // Gaussians, under the names of the proposal.
    limiting_magnitude: f32,
    saturation_magnitude: f32,
    sigma2_px2: f32,
    glare_sigma2_px2: f32,
    glare_brightness: f32,
    // cd/m^2 per unit of relative brightness.
    white_cd_m2: f32,
    // psf_texture: half of the angle that it covers, angle of a texel, rad.
    half_width_rad: f32,
    texel_rad: f32,
    // Half of the angle that a star of 1 lx is cropped to, rad per sqrt(lx), and the least such angle.
    crop_rad: f32,
    least_crop_rad: f32,
    // Added to the square of the angle that the stored function is divided by, rad^2.
    softening_rad2: f32,
}

@group(0) @binding(0) var<uniform> parameters: BillboardParameters;
@group(0) @binding(1) var<uniform> plane: Viewport;

struct Splat {
    @builtin(position) position: vec4<f32>,
    // Factor on the profile: luminance, cd/m^2.
    @location(0) @interpolate(flat) light: vec3<f32>,
    // Footprints in the sky: unit direction in the plane's axes. Footprints on the plane: pixel coordinates.
    @location(1) @interpolate(flat) centre: vec3<f32>,
    // Footprints in the sky: direction to the right of the billboard.
    @location(2) @interpolate(flat) right: vec3<f32>,
    // Size of the footprint: tangent of the half side in the sky, or half side in pixels; and a parameter of the law.
    @location(3) @interpolate(flat) size: vec2<f32>,
}

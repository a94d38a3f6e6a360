// The procedural sky: evaluated in the direction of every pixel's centre, in any projection. It does not read the result of an earlier pass.

#import shared/projection
#import shared/viewport
#import stars/cell_sky
#import structs/CellSkyParameters

@group(1) @binding(0) var<uniform> cell_sky: CellSkyParameters;

fn luminance_of(viewport: Viewport, index: u32, pixel: vec2<i32>) -> vec3<f32> {
    let in_view = direction_from_pixel(viewport, vec2<f32>(pixel) + 0.5).xyz;
    return cell_sky_brightness(
        world_direction(viewport, in_view), cell_sky.pixel_rad, cell_sky.cells, cell_sky.layers, cell_sky.radius_px, cell_sky.seed);
}

// Directions of eight pixels of a column.

#import glare/sky_cube/kernel
#import shared/projection
#import shared/viewport

// Whether all views are flat, with pixels far smaller than the map's cells.
override FLAT: bool = false;
// Returns the direction of a pixel's centre. On a flat plane it is also defined outside the picture.
fn direction_of(viewport: Viewport, pixel: vec2<f32>) -> vec3<f32> {
    if FLAT {
        let on_plane = vec3((pixel - viewport.plane_offset) / viewport.plane_scale, -1.0);
        return world_direction(viewport, normalize(on_plane));
    }
    return world_direction(viewport, direction_from_pixel(viewport, pixel).xyz);
}

fn directions_of(viewport: Viewport, top: vec2<f32>) -> Directions4 {
    var four: Directions4;
    for (var one = 0u; one < u32(turns(viewport, 4)); one++) {
        set_lane(&four, one, direction_of(viewport, top + vec2(0.0, f32(one))));
    }
    return four;
}

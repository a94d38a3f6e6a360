// Light of the stars that are in the map of faint light. The importer binds `parameters.sky`.

#import shared/map_caps
#import shared/sky_map

@group(0) @binding(13) var<storage, read> sky_texels: array<u32>;

// Returns the luminance that a pixel reads from the map, cd/m^2. `in_view`: its direction in view space; `direction`: where it reads the map.
fn faint_luminance(viewport: Viewport, in_view: vec3<f32>, direction: PictureDirection) -> vec3<f32> {
    let share = share_of_map(viewport, parameters.caps, in_view);
    if share == 0.0 {
        return vec3(0.0);
    }
    let picture = sky_picture(parameters.sky, direction);
    return share * faint_light(picture.first, picture.width, place_in_picture(parameters.sky, picture, direction));
}

// Returns the luminance at a place in a picture of the map: see `light_in_picture`.
fn faint_light(first: u32, width: u32, place: vec2<f32>) -> vec3<f32> {
    return light_in_picture(parameters.sky, first, width, place);
}

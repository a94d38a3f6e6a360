// Light of the stars that are in the map of faint light. The importer binds `parameters.sky`.

#import shared/sky_map

@group(0) @binding(13) var<storage, read> sky_texels: array<u32>;

// Returns the luminance of the map in a direction, cd/m^2.
fn faint_luminance(direction: PictureDirection) -> vec3<f32> {
    let picture = sky_picture(parameters.sky, direction);
    return faint_light(picture.first, picture.width, place_in_picture(parameters.sky, picture, direction));
}

// Returns the luminance at a place in a picture of the map: see `light_in_picture`.
fn faint_light(first: u32, width: u32, place: vec2<f32>) -> vec3<f32> {
    return light_in_picture(parameters.sky, first, width, place);
}

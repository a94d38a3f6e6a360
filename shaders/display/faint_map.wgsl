// Light of the stars that are in the map of faint light. The importer has `parameters.sky`.

#import shared/sky_map

@group(0) @binding(13) var<storage, read> sky_texels: array<u32>;

fn faint_picture(direction: PictureDirection) -> SkyPicture {
    return sky_picture(parameters.sky, direction);
}

fn faint_place(picture: SkyPicture, direction: PictureDirection) -> vec2<f32> {
    return place_in_picture(parameters.sky, picture, direction);
}

fn faint_light(picture: SkyPicture, place: vec2<f32>) -> vec3<f32> {
    return light_in_picture(parameters.sky, picture, place);
}

// Light of the stars that are in the map of faint light. The importer has `parameters.sky`.

#import shared/sky_map

@group(0) @binding(13) var<storage, read> sky_texels: array<u32>;

fn faint_light(direction: PictureDirection) -> vec3<f32> {
    return sky_luminance(parameters.sky, direction);
}

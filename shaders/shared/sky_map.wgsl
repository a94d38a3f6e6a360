// Reads the map of faint light in a direction. The importer binds `sky_texels`.

#import shared/sky_place
#import shared/sky_texel

// Luminance in a direction, cd/m^2, interpolated between four texels.
fn sky_luminance(map: SkyMap, direction: PictureDirection) -> vec3<f32> {
    let place = sky_place(map, direction);
    let start = place.first;
    let upper = mix(light_of_texel(sky_texels[start]), light_of_texel(sky_texels[start + 1u]), place.share.x);
    let below = start + map.side;
    let lower = mix(light_of_texel(sky_texels[below]), light_of_texel(sky_texels[below + 1u]), place.share.x);
    return map.unit_cd_m2 * mix(upper, lower, place.share.y);
}

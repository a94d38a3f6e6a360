// For adapters that bind too few buffers for a map of faint light: every star is drawn individually.

#import shared/sky_place

struct SkyPicture {
    unused_0: u32,
}

fn faint_picture(direction: PictureDirection) -> SkyPicture {
    return SkyPicture(0u);
}

fn faint_place(picture: SkyPicture, direction: PictureDirection) -> vec2<f32> {
    return vec2(0.0);
}

fn faint_light(picture: SkyPicture, place: vec2<f32>) -> vec3<f32> {
    return vec3(0.0);
}

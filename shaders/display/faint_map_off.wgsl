// Replaces display/faint_map.wgsl on adapters that bind too few buffers for a map of faint light. Every star is then drawn individually.

#import shared/sky_place

fn faint_luminance(viewport: Viewport, in_view: vec3<f32>, direction: PictureDirection) -> vec3<f32> {
    return vec3(0.0);
}

fn faint_light(first: u32, width: u32, place: vec2<f32>) -> vec3<f32> {
    return vec3(0.0);
}

// hardware_smooth_point: the share of a pixel covered by a disc with a diameter of one pixel, as drivers estimate it:
// from the distance between the pixel's centre and the disc's edge only. The shares do not sum to 1.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    return vec3(clamp(1.0 - length(pixels_from_star(star)), 0.0, 1.0));
}

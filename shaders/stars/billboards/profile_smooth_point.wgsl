// hardware_smooth_point: the share of a pixel that is covered by a disc with a diameter of one pixel. Drivers estimate it only from the distance
// between the pixel's centre and the disc's edge, so the shares do not sum to 1.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    return vec3(clamp(1.0 - length(pixels_from_star(star)), 0.0, 1.0));
}

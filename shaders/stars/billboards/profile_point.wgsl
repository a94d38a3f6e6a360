// hardware_point: the whole pixel.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    return vec3(1.0);
}

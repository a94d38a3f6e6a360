// disc: constant luminance.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    return vec3(select(0.0, 1.0, length(on_billboard(star)) < 1.0));
}

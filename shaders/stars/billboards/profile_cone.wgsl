// smooth_disc and scaled_disc: a cone, three times as high as a cylinder of the same volume.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    return vec3(3.0 * max(0.0, 1.0 - length(on_billboard(star))));
}

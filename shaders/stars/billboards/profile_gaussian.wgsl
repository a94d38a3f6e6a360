// gaussian_psf: both Gaussians at the pixel's centre, within the published point size.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    let offset = pixels_from_star(star);
    if any(abs(offset) > vec2(star.size.x)) {
        return vec3(0.0);
    }
    let r2 = dot(offset, offset);
    return vec3(exp(-r2 / (2.0 * parameters.sigma2_px2))
        + parameters.glare_brightness * exp(-r2 / (2.0 * parameters.glare_sigma2_px2)));
}

// gaussian_psf_integrated: both Gaussians averaged over the pixel, in every pixel that the published point size
// touches.

#import stars/billboards/billboard

// 1 - erf(x) for x >= 0, with a relative error of 1.2e-7 in exact arithmetic, so that tails stay accurate. It is the Chebyshev fit of Numerical
// Recipes (Press, Teukolsky, Vetterling, Flannery), chapter 6.2.
fn erfc_positive(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.5 * x);
    let low = 0.27886807 + t * (-1.13520398 + t * (1.48851587 + t * (-0.82215223 + t * 0.17087277)));
    let series = -1.26551223 + t * (1.00002368 + t * (0.37409196 + t * (0.09678418 + t * (-0.18628806 + t * low))));
    return t * exp(series - x * x);
}

// Returns the mean of exp(-u^2 / (2 sigma^2)) over the pixel from u - 1/2 to u + 1/2.
fn mean_of_gaussian(u: f32, sigma2: f32) -> f32 {
    let scale = inverseSqrt(2.0 * sigma2);
    let a = (abs(u) - 0.5) * scale;
    let b = (abs(u) + 0.5) * scale;
    var share = erfc_positive(max(a, 0.0)) - erfc_positive(b);
    if a < 0.0 {
        share = 2.0 - erfc_positive(-a) - erfc_positive(b);
    }
    // sqrt(pi) / 2
    return 0.886226925 / scale * share;
}

fn profile(star: Splat) -> vec3<f32> {
    let offset = pixels_from_star(star);
    if any(abs(offset) > vec2(star.size.x + 0.5)) {
        return vec3(0.0);
    }
    let core = mean_of_gaussian(offset.x, parameters.sigma2_px2) * mean_of_gaussian(offset.y, parameters.sigma2_px2);
    let glare = mean_of_gaussian(offset.x, parameters.glare_sigma2_px2)
        * mean_of_gaussian(offset.y, parameters.glare_sigma2_px2);
    return vec3(core + parameters.glare_brightness * glare);
}

// psf_texture: a point-spread function as a function of angles in the sky. It is stored after multiplication by the squared angle from its centre,
// and cropped according to the star's brightness.

#import stars/billboards/billboard
#import stars/billboards/star_image

fn profile(star: Splat) -> vec3<f32> {
    let on_plane = on_billboard(star) * star.size.x;
    let tangent = length(on_plane);
    // atan(t) / t, whose limit at 0 is 1.
    let angles = on_plane * select(atan(tangent) / tangent, 1.0 - tangent * tangent / 3.0, tangent < 1e-2);
    if any(abs(angles) > vec2(star.size.y)) {
        return vec3(0.0);
    }
    let middle = 0.5 * vec2<f32>(textureDimensions(star_image));
    let stored = sample_star_image(middle + vec2(1.0, -1.0) * angles / parameters.texel_rad);
    return stored / (dot(angles, angles) + parameters.softening_rad2);
}

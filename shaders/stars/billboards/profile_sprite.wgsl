// sprite: an image on the billboard.

#import stars/billboards/billboard
#import stars/billboards/star_image

fn profile(star: Splat) -> vec3<f32> {
    let place = on_billboard(star);
    if any(abs(place) > vec2(1.0)) {
        return vec3(0.0);
    }
    let size = vec2<f32>(textureDimensions(star_image));
    return sample_star_image((0.5 + vec2(0.5, -0.5) * place) * size);
}

// screen_billboard: a spot that is round on the screen, like the small texture that planetariums draw.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    let offset = pixels_from_star(star) / star.size.x;
    let inside = max(0.0, 1.0 - dot(offset, offset));
    return vec3(inside * inside);
}

// glare_disc: 0.8 of a cone of the same size for every star, and 0.2 of a glare that falls with the inverse square of the angle and grows with the
// billboard. The weights are those of the published program.

#import stars/billboards/billboard

fn profile(star: Splat) -> vec3<f32> {
    let from_centre = min(1.0, length(on_billboard(star)));
    let scale = star.size.y;
    let core = 3.0 * max(0.0, 1.0 - from_centre * scale);
    let softened = from_centre + 0.1;
    let glare = 0.5 * max(0.0, 0.5 / (softened * softened) - 0.5) / (scale * scale);
    return vec3(0.8 * core + 0.2 * glare);
}

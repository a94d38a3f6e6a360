// Fragment shader of all blending star methods. The profile is an import slot.

#import profile = stars/billboards/profile_*
#import stars/billboards/billboard

// Returns the position on the billboard in units of its half side, to the right and up; far away for points behind the eye.
fn on_billboard(star: Splat) -> vec2<f32> {
    let direction = normalize(vec3((star.position.xy - plane.plane_offset) / plane.plane_scale, -1.0));
    let along = dot(direction, star.centre);
    if along <= 0.0 {
        return vec2(1e9);
    }
    let up = cross(star.right, star.centre);
    return vec2(dot(direction, star.right), dot(direction, up)) / (along * star.size.x);
}

// Returns the offset of the pixel's centre from the star's image, pixels.
fn pixels_from_star(star: Splat) -> vec2<f32> {
    return star.position.xy - star.centre.xy;
}

@fragment
fn shade_star(star: Splat) -> @location(0) vec4<f32> {
    return vec4(star.light * profile(star), 0.0);
}

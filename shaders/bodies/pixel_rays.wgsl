// Rays through a pixel, and bodies and coronas along them. The importer binds `view_bodies`.

#import constants/bodies
#import constants/corona
#import constants/projections
#import shared/ellipsoid
#import shared/math
#import shared/projection
#import shared/viewport

// Whether the eye of the picture is on a viewing circle. Without the code for this case, the shaders of bodies compile in half the time.
override HAS_CIRCLE: bool = false;

// Returns the body as seen by the eye that looks along a ray. One eye is used for the whole pixel, so that limbs are as smooth as elsewhere.
fn body_for(viewport: Viewport, number: u32, ray: vec3<f32>) -> ViewBody {
    if HAS_CIRCLE {
        return seen_from(view_bodies[number], eye_on_circle(viewport, normalize(ray)));
    }
    return view_bodies[number];
}

// Returns the direction of a point of the picture; outside a round picture, `otherwise`.
fn ray_of(viewport: Viewport, pixel: vec2<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    if viewport.kind <= KIND_CUBE_FACE {
        return vec3((pixel - viewport.plane_offset) / viewport.plane_scale, -1.0);
    }
    let direction = direction_from_pixel(viewport, pixel);
    return select(otherwise, direction.xyz, direction.w > 0.0);
}

// Returns half the diagonal of a pixel in units of the ray through its centre, enlarged by a third for pixels that are not square.
fn extent_of(viewport: Viewport, corner: vec2<f32>, ray: vec3<f32>) -> f32 {
    var diagonal = 0.0;
    for (var i = 0; i < turns(viewport, 2); i++) {
        diagonal = max(diagonal, length(ray_of(viewport, corner + f32(i), ray) - ray));
    }
    return 1.35 * diagonal;
}

// Returns the luminance of a corona relative to the disc's mean, at a distance from the sun's centre in radii: see
// crates/sky/src/photometry/corona.rs.
fn corona_over_disc(s: f32) -> f32 {
    if s < 1.0 || s >= CORONA_OUTER {
        return 0.0;
    }
    let q = 1.0 / s;
    let q2 = q * q;
    let q4 = q2 * q2;
    let q8 = q4 * q4;
    let t = clamp((s - CORONA_FADES) / (CORONA_OUTER - CORONA_FADES), 0.0, 1.0);
    return (1.0 - t * t * (3.0 - 2.0 * t)) * (CORONA_PARTS.x * q2 * sqrt(q) + CORONA_PARTS.y * q4 * q2 * q + CORONA_PARTS.z * q8 * q8 * q);
}

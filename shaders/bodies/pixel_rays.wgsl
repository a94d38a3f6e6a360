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

#when shared/tabulated
// Rays through nine points of a pixel of a tabulated picture, row by row: corners, middles of the sides, and the centre.
var<private> table_rays: array<vec3<f32>, 9>;

// Returns the weights of the left, middle and right column of these points, or of the rows, at a place of the pixel from 0 to 1.
fn parabola(place: f32) -> vec3<f32> {
    return vec3((1.0 - place) * (1.0 - 2.0 * place), 4.0 * place * (1.0 - place), place * (2.0 * place - 1.0));
}
#end

// Prepares `ray_at` for a pixel with its upper left corner at `corner`. `ray`: the ray through its centre. In tabulated pictures the rays of a pixel
// are interpolated between nine of them: drivers insert the long code of a direction of the table at each call. `needed`: whether `ray_at` is called.
fn prepare_rays(viewport: Viewport, corner: vec2<f32>, ray: vec3<f32>, needed: bool) {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        let points = select(0, turns(viewport, 9), needed);
        for (var i = 0; i < points; i++) {
            let found = tabulated_at(viewport, corner + 0.5 * vec2(f32(i % 3), f32(i / 3)));
            table_rays[i] = select(ray, found.xyz, found.w > 0.0);
        }
    }
#end
}

// Returns the ray through the centre of a pixel of the picture.
fn centre_ray(viewport: Viewport, corner: vec2<f32>) -> vec3<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        return tabulated_node(viewport, vec2<i32>(corner) + TABLE_FRINGE).xyz;
    }
#end
    return closed_ray(viewport, corner + 0.5, vec3(0.0, 0.0, -1.0));
}

// Returns the ray through a point of a pixel, (0, 0) to (1, 1) from its upper left corner; outside a round picture, `otherwise`. Call
// `prepare_rays` for the pixel before.
fn ray_at(viewport: Viewport, corner: vec2<f32>, point: vec2<f32>, otherwise: vec3<f32>) -> vec3<f32> {
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        let across = parabola(point.x);
        let down = parabola(point.y);
        let upper = across.x * table_rays[0] + across.y * table_rays[1] + across.z * table_rays[2];
        let middle = across.x * table_rays[3] + across.y * table_rays[4] + across.z * table_rays[5];
        let lower = across.x * table_rays[6] + across.y * table_rays[7] + across.z * table_rays[8];
        return down.x * upper + down.y * middle + down.z * lower;
    }
#end
    return closed_ray(viewport, corner + point, otherwise);
}

// Returns the ray of a point of a picture whose projection has a closed form; outside a round picture, `otherwise`.
fn closed_ray(viewport: Viewport, pixel: vec2<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    if viewport.kind <= KIND_CUBE_FACE {
        return vec3((pixel - viewport.plane_offset) / viewport.plane_scale, -1.0);
    }
    let direction = closed_direction_from_pixel(viewport, pixel);
    return select(otherwise, direction.xyz, direction.w > 0.0);
}

// Returns half the diagonal of a pixel in units of the ray through its centre, enlarged by a third for pixels that are not square. Call
// `prepare_rays` for the pixel before.
fn extent_of(viewport: Viewport, corner: vec2<f32>, ray: vec3<f32>) -> f32 {
    var diagonal = 0.0;
    for (var i = 0; i < turns(viewport, 2); i++) {
        diagonal = max(diagonal, length(ray_at(viewport, corner, vec2(f32(i)), ray) - ray));
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

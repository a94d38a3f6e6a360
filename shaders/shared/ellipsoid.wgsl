// Ellipsoids seen from an eye.
//
// A ray is c + e: c points to the centre of the body, and e is the offset of the ray from c. On a flat picture c + e has
// unit depth (e is a difference of tangents), so that e is accurate in narrow fields; otherwise c and c + e are unit
// vectors. In the axes of the body and in units of its semi-axes, the body is the unit sphere, and the ray passes its
// centre at the distance s.

#import structs/ViewBody

// Moves the eye to a position relative to the old one, view axes, m, for a body whose `centre` is a unit vector.
fn seen_from(body: ViewBody, eye: vec3<f32>) -> ViewBody {
    var seen = body;
    let place = body.centre - eye / body.distance_m;
    let part = length(place);
    seen.centre = place / part;
    seen.distance_m = part * body.distance_m;
    seen.unit_from_view_x *= part;
    seen.unit_from_view_y *= part;
    seen.unit_from_view_z *= part;
    seen.unit_centre = in_body_axes(seen, seen.centre);
    return seen;
}

// Passage of a ray by a body.
struct Passage {
    // The ray, view axes: a unit vector, or with z = -1 for flat pictures.
    ray: vec3<f32>,
    // e and c + e in the body's axes.
    beside: vec3<f32>,
    along: vec3<f32>,
    // Distance from the centre, in semi-axes; very large behind the eye.
    s: f32,
}

fn in_body_axes(body: ViewBody, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(body.unit_from_view_x, v), dot(body.unit_from_view_y, v), dot(body.unit_from_view_z, v));
}

// `direction` of any length but 0, view axes.
fn passage_of(body: ViewBody, direction: vec3<f32>) -> Passage {
    var passage: Passage;
    passage.s = 1e18;
    if body.on_plane != 0u {
        if direction.z >= 0.0 {
            return passage;
        }
        passage.ray = direction / -direction.z;
    } else {
        passage.ray = normalize(direction);
    }
    passage.beside = in_body_axes(body, passage.ray - body.centre);
    passage.along = body.unit_centre + passage.beside;
    let ahead = dot(body.unit_centre, passage.along);
    // The eye is outside the body, so visible points are in front of it.
    if ahead > 0.0 {
        passage.s = length(cross(body.unit_centre, passage.beside)) * inverseSqrt(dot(passage.along, passage.along));
    }
    return passage;
}

// Returns the entry point of a ray that passes within s <= 1. xyz: in the body's axes and semi-axes; w: distance from the eye, m. If the ray is
// beyond the limb, it is the nearest point of the limb.
fn entry_of(body: ViewBody, passage: Passage) -> vec4<f32> {
    let a = dot(passage.along, passage.along);
    let half = sqrt(max(1.0 - passage.s * passage.s, 0.0) / a);
    // Offset from the distance of the body's centre, as a fraction of that distance.
    let nearer = -dot(passage.beside, passage.along) / a - half;
    let point = nearer * passage.along + passage.beside;
    return vec4(normalize(point), body.distance_m * (1.0 + nearer) * length(passage.ray));
}

// Whether a body hides an object in a direction at a distance.
fn hides(body: ViewBody, direction: vec3<f32>, distance_m: f32) -> bool {
    let passage = passage_of(body, direction);
    return passage.s <= 1.0 && entry_of(body, passage).w < distance_m;
}

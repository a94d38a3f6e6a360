// Luminance of the surface of a body at the entry point of a ray: texture, reflected light of its suns, shadows of other
// bodies and of its rings. The importer binds `suns` and `texels`.

#import constants/bodies
#import constants/rings
#import shared/ellipsoid
#import shared/math
#import shared/reflection
#import structs/BodySun

// Square root of the distance from the limb, in semi-axes, up to which a part's luminance is integrated along the radius.
const MOST_INNER_ROOT: f32 = 0.7;

fn texel(index: u32) -> vec3<f32> {
    let word = texels[index];
    let root = vec3(f32(word & 1023u), f32((word >> 10u) & 1023u), f32((word >> 20u) & 1023u)) * (1.0 / 1023.0);
    return root * root;
}

// Interpolates one level of a texture between its four nearest texels. Longitude wraps.
fn level_texel(first: u32, size: vec2<u32>, place: vec2<f32>) -> vec3<f32> {
    let position = place * vec2<f32>(size) - 0.5;
    let low = floor(position);
    let part = position - low;
    let width = i32(size.x);
    let x = vec2((i32(low.x) % width + width) % width, (i32(low.x) + 1 + width) % width);
    let y = clamp(vec2(i32(low.y), i32(low.y) + 1), vec2(0), vec2(i32(size.y) - 1));
    let top = mix(texel(first + u32(y.x * width + x.x)), texel(first + u32(y.x * width + x.y)), part.x);
    let bottom = mix(texel(first + u32(y.y * width + x.x)), texel(first + u32(y.y * width + x.y)), part.x);
    return mix(top, bottom, part.y);
}

// Returns the factor on the albedo at a point of the unit sphere, for a pixel of angular size `footprint`, rad.
fn surface_factor(body: ViewBody, point: vec3<f32>, footprint: f32) -> vec3<f32> {
    if body.texture == NO_TEXTURE {
        return vec3(1.0);
    }
    let place = vec2(
        precise_atan2(point.y, point.x) / (2.0 * PI) + 0.5,
        precise_atan2(length(point.xy), point.z) / PI);
    // Each level has half as many texels along each side as the previous one, but at least one.
    var size = body.texture_size;
    var first = body.texture;
    var level = clamp(log2(max(footprint * f32(size.x) / (2.0 * PI), 1.0)), 0.0, 31.0);
    while level >= 1.0 && size.x * size.y > 1u {
        first += size.x * size.y;
        size = max(size / 2u, vec2(1u));
        level -= 1.0;
    }
    let fine = level_texel(first, size, place);
    if level <= 0.0 || size.x * size.y == 1u {
        return fine;
    }
    return mix(fine, level_texel(first + size.x * size.y, max(size / 2u, vec2(1u)), place), level);
}

// A circle of radius `own` has an arc inside another circle of radius `other`, whose centre is at the distance `apart`. Returns sine, cosine and
// value of half the angle of this arc.
fn half_angle(own: f32, other: f32, apart: f32) -> vec3<f32> {
    let cosine = clamp((apart * apart + own * own - other * other) / (2.0 * apart * own), -1.0, 1.0);
    let sine = sqrt(1.0 - cosine * cosine);
    return vec3(sine, cosine, precise_atan2(sine, cosine));
}

// Returns the share of a sun's light that reaches a point of the unit sphere: see crates/render/src/scene/bodies/shadow.rs.
fn open_share(sun: BodySun, point: vec3<f32>) -> vec3<f32> {
    if sun.occluder_radius <= 0.0 {
        return vec3(1.0);
    }
    let towards = sun.occluder - point * sun.shape;
    let squared = dot(towards, towards);
    // Outline of a flattened occluder.
    let across = towards - sun.to_sun * dot(towards, sun.to_sun);
    let raised = dot(sun.pole, across);
    let tilt = dot(sun.pole, sun.to_sun);
    let narrower = raised * raised / max(dot(across, across), 1e-30) / (1.0 + sun.oblate * tilt * tilt);
    let radius = sun.occluder_radius * inverseSqrt(1.0 + sun.oblate * narrower);
    let own = precise_atan2(radius, sqrt(max(squared - radius * radius, 0.0)));
    let apart = precise_atan2(length(cross(towards, sun.to_sun)), dot(towards, sun.to_sun));
    var hidden = 0.0;
    if apart <= abs(own - sun.sun_radius) {
        let share = own / sun.sun_radius;
        hidden = select(share * share, 1.0, own >= sun.sun_radius);
    } else if apart < own + sun.sun_radius {
        let sun_arc = half_angle(sun.sun_radius, own, apart);
        let own_arc = half_angle(own, sun.sun_radius, apart);
        let ratio = own / sun.sun_radius;
        hidden = (sun_arc.z - sun_arc.x * sun_arc.y + ratio * ratio * (own_arc.z - own_arc.x * own_arc.y)) / PI;
    }
    return 1.0 - hidden * (1.0 - sun.refracted);
}

// Returns the share of the first sun's light that passes the rings towards a point of the unit sphere, blurred over a part of the radius.
fn through_rings(body: ViewBody, point: vec3<f32>, blur: f32) -> f32 {
    let along = normalize(body.to_sun / vec3(1.0, 1.0, body.flattening));
    let steps = -point.z / along.z;
    if body.around != AROUND_RINGS || !(steps > 0.0) {
        return 1.0;
    }
    let radius = length(point.xy + steps * along.xy);
    let cosine = max(abs(body.to_sun.z), 1e-3);
    var zones = RING_ZONES;
    var hidden = 0.0;
    var inner = RING_INNER;
    for (var i = 0u; i < 4u; i++) {
        let within = clamp(radius + blur, inner, zones[i].x) - clamp(radius - blur, inner, zones[i].x);
        hidden += within / (2.0 * blur) * (1.0 - exp(-zones[i].y / cosine));
        inner = zones[i].x;
    }
    return 1.0 - hidden;
}

// Returns the normal of a body at an entry point, view axes.
fn normal_at(body: ViewBody, entry: vec4<f32>) -> vec3<f32> {
    return normalize(entry.x * body.unit_from_view_x + entry.y * body.unit_from_view_y + entry.z * body.unit_from_view_z);
}

// Returns the luminance of a body at the entry point of a ray, lit by all of its suns.
fn luminance_at(body: ViewBody, passage: Passage, entry: vec4<f32>, footprint: f32) -> vec3<f32> {
    return luminance_by(body, passage, entry, footprint, 0u, body.sun_count, body.emission);
}

// Returns the luminance of a body at the entry point of a ray, lit by some of its suns, with an emission.
fn luminance_by(
    body: ViewBody, passage: Passage, entry: vec4<f32>, footprint: f32, from_sun: u32, to_sun: u32, emission: vec3<f32>,
) -> vec3<f32> {
    let normal = normal_at(body, entry);
    let cos_e = clamp(-dot(normal, normalize(passage.ray)), 0.0, 1.0);
    var luminance = emission * (1.0 - body.limb_darkening * (1.0 - cos_e));
    var lit = vec3(0.0);
    for (var i = body.first_sun + from_sun; i < body.first_sun + to_sun; i++) {
        var arriving = suns[i].illuminance * open_share(suns[i], entry.xyz);
        if i == body.first_sun && body.around == AROUND_RINGS {
            arriving *= through_rings(body, entry.xyz, max(0.5 * footprint, 1e-4));
        }
        lit += arriving * reflected(body.law, dot(normal, suns[i].direction), cos_e);
    }
    if any(lit > vec3(0.0)) {
        luminance += body.reflectance * lit * surface_factor(body, entry.xyz, footprint / max(cos_e, 0.1));
    }
    return luminance;
}

// Returns the share of a unit square in which a linear function with this central value and these slopes is positive.
fn positive_share(middle: f32, slopes: vec2<f32>) -> f32 {
    let half = 0.5 * vec2(max(abs(slopes.x), abs(slopes.y)), min(abs(slopes.x), abs(slopes.y)));
    let size = abs(middle);
    var share = 1.0;
    if size < half.x + half.y {
        if size <= half.x - half.y {
            share = 0.5 + 0.5 * size / half.x;
        } else {
            let missing = half.x + half.y - size;
            share = 1.0 - missing * missing / max(8.0 * half.x * half.y, 1e-30);
        }
    }
    return select(1.0 - share, share, middle >= 0.0);
}

// Returns a passage that is moved along its radius. Its distance from the limb is then the square of `root`. If `root` is negative, the passage is
// not moved.
fn moved_to(body: ViewBody, passage: Passage, root: f32) -> Passage {
    var moved = passage;
    if root < 0.0 {
        return moved;
    }
    let inside = clamp((1.0 - root * root) / max(passage.s, 1e-6), 0.0, 1.0 / max(passage.s, 1e-6));
    moved.beside *= inside;
    moved.along = body.unit_centre + moved.beside;
    moved.s *= inside;
    return moved;
}

// Returns the cosine of the incidence of the first sun's light, at a distance from the limb that is the square of `root`, along the radius of a
// passage.
fn incidence_at(body: ViewBody, passage: Passage, root: f32) -> f32 {
    return dot(normal_at(body, entry_of(body, moved_to(body, passage, root))), suns[body.first_sun].direction);
}

// Where the luminance of a part of a pixel is computed: see `moved_to`.
struct LitPlace {
    root: f32,
    // Share of the part.
    weight: f32,
    // Whether the first sun, the other suns, and the emission are included.
    first: bool,
    others: bool,
}

// Light of a part of a pixel: mean luminance times the share that the body covers. `slopes`: slopes of the distance from the centre across the part.
// Near the limb (`steep`), if the terminator of the first sun is in the part, only the lit band is integrated. It is divided into two halves, which
// are weighted by their areas in the part. Otherwise a crescent that is thinner than a part would get too much light or none.
//
// The luminance is computed in one loop, because drivers insert a copy of its code at each call. With several calls they would compile for half a
// minute.
fn light_of_part(body: ViewBody, passage: Passage, share: f32, slopes: vec2<f32>, steep: bool, footprint: f32) -> vec3<f32> {
    var places: array<LitPlace, 3>;
    places[0] = LitPlace(-1.0, share, true, true);
    var count = 1u;
    if steep {
        count = places_near_limb(body, passage, share, slopes, &places);
    }
    var sum = vec3(0.0);
    for (var i = 0u; i < count; i++) {
        let place = places[i];
        let moved = moved_to(body, passage, place.root);
        let from_sun = select(1u, 0u, place.first);
        let to_sun = select(1u, body.sun_count, place.others);
        let emission = select(vec3(0.0), body.emission, place.others);
        sum += place.weight * luminance_by(body, moved, entry_of(body, moved), footprint, from_sun, to_sun, emission);
    }
    return sum;
}

// Finds the places of a part near the limb, and returns their number.
fn places_near_limb(
    body: ViewBody, passage: Passage, share: f32, slopes: vec2<f32>, places: ptr<function, array<LitPlace, 3>>,
) -> u32 {
    let depth = 1.0 - passage.s;
    // The covered part is between these distances from the limb. Over it, the square root of the distance has the mean `mean`.
    let half = 0.5 * length(slopes);
    let near = max(depth - half, 0.0);
    let far = max(depth + half, near + 1e-6);
    let mean = (2.0 / 3.0) * (far * sqrt(far) - near * sqrt(near)) / (far - near);
    (*places)[0] = LitPlace(mean, share, true, true);
    let reach = 0.5 * (abs(slopes.x) + abs(slopes.y));
    let roots = sqrt(max(vec2(depth - reach, depth + reach), vec2(0.0)));
    if body.sun_count > 0u && roots.y < MOST_INNER_ROOT {
        let outer = incidence_at(body, passage, roots.x);
        let inner = incidence_at(body, passage, roots.y);
        if (outer > 0.0) != (inner > 0.0) {
            // The cosine is nearly linear in the root.
            var border = mix(roots.x, roots.y, outer / (outer - inner));
            let between = incidence_at(body, passage, border);
            border = clamp(mix(roots.x, border, clamp(outer / (outer - between), 0.0, 2.0)), roots.x, roots.y);
            let lit = select(vec2(border, roots.y), vec2(roots.x, border), outer > 0.0);
            (*places)[0].first = false;
            // Share of the part that is deeper than one end of a half.
            var deeper = min(positive_share(depth - lit.x * lit.x, slopes), share);
            for (var i = 0u; i < 2u; i++) {
                let ends = lit.x + (lit.y - lit.x) * 0.5 * vec2(f32(i), f32(i + 1u));
                let beyond = positive_share(depth - ends.y * ends.y, slopes);
                // The mean of the root over the half.
                let root = (2.0 / 3.0) * (dot(ends, ends) + ends.x * ends.y) / max(ends.x + ends.y, 1e-12);
                (*places)[i + 1u] = LitPlace(root, max(deeper - beyond, 0.0), true, false);
                deeper = beyond;
            }
            return 3u;
        }
    }
    return 1u;
}

// The geometry pass: light and coverage of bodies and asteroids in each pixel of a tile.
//
// Bodies are ellipsoids, intersected by one ray per pixel in every projection. If the limb crosses a pixel, the pixel is divided into parts, each
// weighted by the area that a straight limb covers. Asteroids come from layers of samples that were drawn earlier: a layer of the picture itself, or
// layers of cube faces if the projection bends straight edges. In pixels with asteroids, each sample shows the nearest object. The f64 twin is
// crates/render/src/reference/bodies/mod.rs.

#import bodies/pixel_rays
#import bodies/surface
#import constants/bodies
#import constants/corona
#import constants/faces
#import constants/frame_lists
#import constants/plain_blocks
#import constants/projections
#import constants/rings
#import constants/workgroups
#import shared/cover
#import shared/ellipsoid
#import shared/math
#import shared/plain_flag
#import shared/projection
#import shared/reflection
#import shared/viewport
#import structs/BodySun
#import structs/GeometryParameters

@group(0) @binding(0) var<uniform> parameters: GeometryParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> geometry: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> view_bodies: array<ViewBody>;
@group(0) @binding(5) var<uniform> body_runs: array<vec4<u32>, MAX_VIEWPORTS>;
@group(0) @binding(6) var<storage, read> suns: array<BodySun>;
@group(0) @binding(7) var<storage, read> texels: array<u32>;
// First column and row, within the tile, of the blocks of pixels that are drawn; other blocks are dark.
@group(0) @binding(8) var<storage, read> blocks: array<vec2<u32>>;
// Flags of plain blocks: see shared/plain_block.wgsl.
@group(0) @binding(9) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(10) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;
@group(1) @binding(0) var colour: texture_2d<f32>;
@group(1) @binding(1) var depth: texture_depth_2d;
@group(1) @binding(2) var faces_colour: texture_2d_array<f32>;
@group(1) @binding(3) var faces_depth: texture_depth_2d_array;

// Whether the frame has plain blocks. Frames with layers have none.
override HAS_PLAIN: bool = false;
// Whether there are layers of asteroids.
override HAS_LAYERS: bool = false;

// Minimum and maximum number of parts along a side of a pixel on the limb.
const LEAST_LIMB_PARTS: f32 = 4.0;
const MOST_LIMB_PARTS: f32 = 12.0;
// Largest half diagonal of a part, in semi-axes, for which one ray through its centre is sufficient.
const SMALL_PART: f32 = 0.05;
// Width of the parts of a corona pixel, relative to the distance from the sun's centre. With this width, the steepest part of the light is accurate
// to 2 %.
const CORONA_STEP: f32 = 0.04;
// Two limits for a corona that is too steep: behind a limb, its light differs from its mean over the pixel. The first is the distance from the sun's
// centre, in its radii, up to which this is always so. The second is the size of a pixel, relative to this distance, from which on this is also so
// farther out. The pixel is then divided into parts of one ray each, which would miss most of a thin crescent.
const STEEP_CORONA: f32 = 4.0;
const COARSE_CORONA: f32 = 0.25;
// Maximum number of these parts along a side.
const MOST_CORONA_PARTS: f32 = 24.0;
// Maximum number of bodies that one pixel can show.
const MOST_HITS: u32 = 4u;
// Distance from the limb, in half diagonals of a pixel, within which a body is sampled more finely.
const STEEP_REACHES: f32 = 6.0;
// Size of the parts of a pixel in which rings are computed, equatorial radii, and greatest number of these parts along each side.
const RING_PART: f32 = 0.3;
const MOST_RING_PARTS: f32 = 8.0;
// Minimum number of these parts along each side at the limb of the globe.
const LEAST_RING_PARTS_AT_LIMB: f32 = 4.0;

// Contribution of a body to a pixel: luminance times coverage, and coverage.
struct Contribution {
    light: vec3<f32>,
    coverage: f32,
    distance_m: f32,
    limb: bool,
    rings: bool,
    // Coverage by rings of the part of a pixel in which they are in front of their globe; otherwise 0.
    before_globe: f32,
}

// Returns the contribution of a body to a pixel. `extent`: half the diagonal of the pixel in units of the ray.
fn body_in_pixel(viewport: Viewport, body: ViewBody, corner: vec2<f32>, ray: vec3<f32>, extent: f32) -> Contribution {
    var contribution: Contribution;
    let middle = passage_of(body, ray);
    let scale = body.distance_m * body.inverse_smallest * length(body.unit_centre) * inverseSqrt(max(dot(middle.along, middle.along), 1e-30));
    let reach = extent * scale;
    if middle.s > 1.0 + reach {
        return contribution;
    }
    let footprint = 1.4 * extent * body.distance_m * body.inverse_smallest;
    let entry = entry_of(body, middle);
    contribution.distance_m = entry.w;
    contribution.limb = middle.s >= 1.0 - reach;
    // Near the limb, cosines vary with the square root of the distance from it.
    let steep = middle.s >= 1.0 - STEEP_REACHES * reach;
    let parts = u32(clamp(ceil(reach / SMALL_PART), select(select(1.0, 2.0, steep), LEAST_LIMB_PARTS, contribution.limb), MOST_LIMB_PARTS));
    let step = 1.0 / f32(parts);
    // The centre of a part and the middles of its sides: right, left, bottom, top. A whole pixel needs only its own ray.
    var places = array<vec2<f32>, 5>(vec2(0.0), vec2(0.5, 0.0), vec2(-0.5, 0.0), vec2(0.0, 0.5), vec2(0.0, -0.5));
    let ray_count = select(5u, 0u, parts == 1u);
    var whole = 0.0;
    var is_covered = true;
    for (var i = 0u; i < parts * parts; i++) {
        let point = (vec2(f32(i % parts), f32(i / parts)) + 0.5) * step;
        var own = ray;
        var passage = middle;
        // Differences between opposite sides: of the rays, and of the distance from the body's centre.
        var across = array<vec3<f32>, 2>();
        var slopes = vec2(0.0);
        for (var k = 0u; k < ray_count; k++) {
            let found = ray_at(viewport, corner, point + places[k] * step, own);
            let found_passage = passage_of(body, found);
            if k == 0u {
                own = found;
                passage = found_passage;
            } else {
                let sign = select(-1.0, 1.0, (k & 1u) != 0u);
                across[(k - 1u) / 2u] += sign * found;
                slopes[(k - 1u) / 2u] += sign * found_passage.s;
            }
        }
        // Near a pole, the parts of a pixel cover less and less sky.
        let weight = select(length(cross(across[0], across[1])), 1.0, parts == 1u);
        let share = select(1.0, positive_share(1.0 - passage.s, slopes), steep);
        whole += weight;
        is_covered = is_covered && share >= 1.0;
        if share > 0.0 {
            let part_entry = entry_of(body, passage);
            let part = weight * before_globe(body, passage, part_entry, footprint * step);
            contribution.light += part * light_of_part(body, passage, share, slopes, steep, footprint * step);
            contribution.coverage += weight * share;
        }
    }
    contribution.light /= whole;
    // The value is at most 1, and exactly 1 if the whole pixel is covered: on some GPUs x / x is not exactly 1.
    contribution.coverage = select(min(contribution.coverage / whole, 1.0), 1.0, is_covered);
    return contribution;
}

// Returns the intersection of a ray with a body's equatorial plane: xy in equatorial radii, distance from the eye in m, and whether it is in front of
// the eye.
fn on_equator(body: ViewBody, ray: vec3<f32>) -> vec4<f32> {
    let passage = passage_of(body, ray);
    let parts = -passage.beside.z / passage.along.z;
    let ahead = passage.s < 1e17 && abs(passage.along.z) > 0.0 && parts > -1.0;
    let place = passage.beside + parts * passage.along;
    return vec4(place.xy, body.distance_m * (1.0 + parts) * length(passage.ray), select(0.0, 1.0, ahead));
}

// Returns the reflected light and coverage of rings around a place in their plane, blurred over `half` along the radius. The luminance of the rings
// is not included. `mu`: cosines of the directions to the eye and to the sun with the pole.
fn rings_around(body: ViewBody, place: vec2<f32>, half: f32, mu: vec2<f32>) -> vec2<f32> {
    let radius = length(place);
    var zones = RING_ZONES;
    var inner = RING_INNER;
    var reflected = 0.0;
    var coverage = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let zone = zones[i];
        let within = (clamp(radius + half, inner, zone.x) - clamp(radius - half, inner, zone.x)) / (2.0 * half);
        coverage += within * (1.0 - exp(-zone.y / mu.x));
        reflected += within * zone.z * mu.y / (4.0 * (mu.x + mu.y)) * (1.0 - exp(-zone.y * (1.0 / mu.x + 1.0 / mu.y)));
        inner = zone.x;
    }
    // Shadow of the globe. Its edge is blurred too.
    let to_sun = normalize(body.to_sun / vec3(1.0, 1.0, body.flattening));
    let towards = dot(vec3(place, 0.0), to_sun);
    let beside = sqrt(max(radius * radius - towards * towards, 0.0));
    let open = select(clamp(0.5 + (beside - 1.0) / (2.0 * half), 0.0, 1.0), 1.0, towards >= 0.0);
    return vec2(reflected * open, coverage);
}

// Returns the share of the light of a globe that its rings let pass on the way to the eye, in a part of a pixel with a footprint in units of the
// globe. The shadow of the rings is close behind them, so a larger part would not give the right light.
fn before_globe(body: ViewBody, passage: Passage, entry: vec4<f32>, footprint: f32) -> f32 {
    if body.around != AROUND_RINGS {
        return 1.0;
    }
    let place = on_equator(body, passage.ray);
    if place.w == 0.0 || place.z >= entry.w {
        return 1.0;
    }
    let in_world = passage.along * vec3(1.0, 1.0, body.flattening);
    let mu_eye = max(abs(in_world.z) * inverseSqrt(dot(in_world, in_world)), 1e-3);
    return 1.0 - rings_around(body, place.xy, clamp(0.5 * footprint / mu_eye, 1e-5, 1.0), vec2(mu_eye, 1.0)).y;
}

// Returns the contribution of a body's rings to a pixel, without the parts behind the globe: the mean of parts that are narrower than the rings.
fn rings_in_pixel(viewport: Viewport, body: ViewBody, corner: vec2<f32>, ray: vec3<f32>, at_limb: bool) -> Contribution {
    var contribution: Contribution;
    contribution.rings = true;
    let own = on_equator(body, ray);
    // To the right and below.
    var beyond: array<vec4<f32>, 2>;
    for (var i = 0; i < turns(viewport, 2); i++) {
        let side = select(vec2(1.0, 0.5), vec2(0.5, 1.0), i == 1);
        beyond[i] = on_equator(body, ray_at(viewport, corner, side, ray));
    }
    let right = beyond[0];
    let down = beyond[1];
    if own.w * right.w * down.w == 0.0 {
        return contribution;
    }
    // Half the size of a pixel along the radius. Near the centre the radius hardly changes, but the position does.
    let radius = length(own.xy);
    let reach = max(length(right.xy - own.xy) + length(down.xy - own.xy), 1e-5);
    if radius + reach < RING_INNER || radius - reach > RING_OUTER {
        return contribution;
    }
    let passage = passage_of(body, ray);
    let in_world = passage.along * vec3(1.0, 1.0, body.flattening);
    let mu = max(vec2(abs(in_world.z) * inverseSqrt(dot(in_world, in_world)), abs(body.to_sun.z)), vec2(1e-3));
    // Rays that come from above go down.
    let is_lit = -in_world.z * body.to_sun.z > 0.0;
    let least = select(1.0, LEAST_RING_PARTS_AT_LIMB, at_limb);
    let parts = u32(clamp(ceil(reach / RING_PART), least, MOST_RING_PARTS));
    var sum = vec2(0.0);
    for (var i = 0u; i < parts * parts; i++) {
        let point = (vec2(f32(i % parts), f32(i / parts)) + 0.5) / f32(parts);
        let part_ray = ray_at(viewport, corner, point, ray);
        let place = on_equator(body, part_ray);
        let on_globe = passage_of(body, part_ray);
        if on_globe.s < 1.0 && entry_of(body, on_globe).w < place.z {
            continue;
        }
        let beside = abs(length(place.xy + (right.xy - own.xy) / f32(parts)) - length(place.xy));
        let below = abs(length(place.xy + (down.xy - own.xy) / f32(parts)) - length(place.xy));
        let part = place.w * rings_around(body, place.xy, clamp(beside + below, 1e-5, 1.0), mu);
        sum += part;
        contribution.before_globe += select(0.0, part.y, on_globe.s < 1.0);
    }
    sum /= f32(parts * parts);
    contribution.before_globe /= f32(parts * parts);
    contribution.coverage = sum.y;
    contribution.light = body.around_light * select(0.0, sum.x, is_lit);
    contribution.distance_m = own.z;
    return contribution;
}

// Returns the contribution of a globe and of its rings in a pixel that shows both. The light of the globe is already dimmed by the rings in front of
// it.
fn globe_with_rings(globe: Contribution, rings: Contribution) -> Contribution {
    var both = globe;
    both.light += rings.light;
    both.coverage = min(globe.coverage + rings.coverage - rings.before_globe, 1.0);
    both.distance_m = min(globe.distance_m, rings.distance_m);
    return both;
}

// Returns the mean luminance of a body's corona over a pixel, without occlusion.
fn corona_in_pixel(viewport: Viewport, body: ViewBody, corner: vec2<f32>, ray: vec3<f32>, extent: f32) -> vec3<f32> {
    let s = passage_of(body, ray).s;
    let reach = extent * body.distance_m * body.inverse_smallest;
    if s > CORONA_OUTER + reach {
        return vec3(0.0);
    }
    let parts = u32(clamp(ceil(2.0 * reach / (CORONA_STEP * max(s, 1.0))), 1.0, MOST_CORONA_PARTS));
    var sum = 0.0;
    for (var i = 0u; i < parts * parts; i++) {
        let point = (vec2(f32(i % parts), f32(i / parts)) + 0.5) / f32(parts);
        sum += corona_over_disc(passage_of(body, ray_at(viewport, corner, point, ray)).s);
    }
    return body.around_light * (sum / f32(parts * parts));
}

// Inserts a body or its rings into the list of a pixel, sorted from near to far. If the list is full, the farthest is
// dropped.
fn insert_hit(hits: ptr<function, array<Contribution, MOST_HITS>>, count: u32, contribution: Contribution) -> u32 {
    var index = min(count, MOST_HITS - 1u);
    if count == MOST_HITS && (*hits)[index].distance_m <= contribution.distance_m {
        return count;
    }
    while index > 0u && (*hits)[index - 1u].distance_m > contribution.distance_m {
        (*hits)[index] = (*hits)[index - 1u];
        index--;
    }
    (*hits)[index] = contribution;
    return min(count + 1u, MOST_HITS);
}

// Returns the luminance and the distance of the layers at a sample; w = 0: empty.
fn layers_at(viewport: Viewport, texel: vec2<u32>, ray: vec3<f32>) -> vec4<f32> {
    var found = vec4(0.0);
    let unit = normalize(ray);
    let own = textureLoad(depth, texel, 0);
    if own > 0.0 {
        // Flat pictures store the distance along the view axis.
        let along = select(1.0, -unit.z, viewport.kind <= KIND_CUBE_FACE);
        found = vec4(textureLoad(colour, texel, 0).xyz * parameters.luminance_scale, parameters.near_m / own / along);
    }
    if parameters.faces != 0u {
        let face = cube_face_of(unit);
        if (parameters.faces & (1u << face)) != 0u {
            var forwards = FACE_FORWARD;
            var ups = FACE_UP;
            let along = dot(unit, forwards[face]);
            let right = cross(forwards[face], ups[face]);
            let tangents = vec2(dot(unit, right), -dot(unit, ups[face])) / along;
            let size = i32(parameters.face_size);
            let face_texel = clamp(vec2<i32>(floor((0.5 + 0.5 * tangents) * f32(size))), vec2(0), vec2(size - 1));
            let other = textureLoad(faces_depth, face_texel, face, 0);
            let distance_m = parameters.near_m / max(other, 1e-38) / along;
            if other > 0.0 && (found.w == 0.0 || distance_m < found.w) {
                found = vec4(textureLoad(faces_colour, face_texel, face, 0).xyz * parameters.luminance_scale, distance_m);
            }
        }
    }
    return found;
}

// Returns the index of the first body, from a given index on, that may be visible in the pixel around a unit vector; the end index if there is none.
// Most pixels show no body. A loop that ends at once costs a software driver nothing, but a branch would.
fn next_near(from_body: u32, end: u32, unit: vec3<f32>) -> u32 {
    var b = from_body;
    while b < end {
        let beside = unit - view_bodies[b].towards;
        if dot(beside, beside) <= view_bodies[b].reach * view_bodies[b].reach {
            break;
        }
        b++;
    }
    return b;
}

fn write(index: u32, light: vec3<f32>, word: u32) {
    geometry[index] = vec4(bitcast<vec3<u32>>(light), word);
}

@compute @workgroup_size(RAY_SIDE, RAY_SIDE)
fn draw_geometry(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let id = blocks[invocation.z] + invocation.xy;
    let tile = tiles[parameters.tile];
    let viewport = viewports[tile.viewport];
    if id.x >= viewport.size.x || id.y >= tile.rows {
        return;
    }
    let index = tile.first_pixel + id.y * viewport.size.x + id.x;
    let pixel = vec2(id.x, tile.first_row + id.y);
    if !contains(viewport, vec2<i32>(pixel)) {
        write(index, vec3(0.0), 0u);
        return;
    }
    let corner = vec2<f32>(pixel);
    let ray = centre_ray(viewport, corner);
    let run = body_runs[tile.viewport].xy;
    var covered = 0.0;
    if HAS_LAYERS {
        prepare_rays(viewport, corner, ray, true);
        let extent = extent_of(viewport, corner, ray);
        let samples = parameters.samples;
        var light = vec3(0.0);
        var nearest = 3e38;
        var body_covered = 0.0;
        var limb = false;
        for (var i = 0u; i < samples * samples; i++) {
            let within = vec2(i % samples, i / samples);
            let point = (vec2<f32>(within) + 0.5) / f32(samples);
            let found = layers_at(viewport, vec2(id.x, id.y) * samples + within, ray_at(viewport, corner, point, ray));
            if found.w > 0.0 {
                covered += 1.0;
                light += found.xyz;
                nearest = min(nearest, found.w);
            }
        }
        if covered > 0.0 {
            if run.y > 0u {
                // Include bodies, sample by sample.
                light = vec3(0.0);
                nearest = 3e38;
                var covered_share = 0.0;
                for (var i = 0u; i < samples * samples; i++) {
                    let within = vec2(i % samples, i / samples);
                    let own = ray_at(viewport, corner, (vec2<f32>(within) + 0.5) / f32(samples), ray);
                    var found = layers_at(viewport, vec2(id.x, id.y) * samples + within, own);
                    var share = select(0.0, 1.0, found.w > 0.0);
                    for (var b = run.x; b < run.x + run.y; b++) {
                        let body = body_for(viewport, b, ray);
                        let passage = passage_of(body, own);
                        if passage.s <= 1.0 {
                            let entry = entry_of(body, passage);
                            if found.w == 0.0 || entry.w < found.w {
                                let footprint = extent / f32(samples) * body.distance_m * body.inverse_smallest;
                                // A body drawn half as a point lets half of the light behind it pass.
                                let part = body.part;
                                let contribution = luminance_at(body, passage, entry, footprint);
                                found = vec4(mix(found.xyz, contribution, part), entry.w);
                                share = mix(share, 1.0, part);
                            }
                        }
                        limb = limb || abs(passage.s - 1.0) < extent * body.distance_m * body.inverse_smallest;
                    }
                    if found.w > 0.0 {
                        covered_share += share;
                        light += found.xyz;
                        nearest = min(nearest, found.w);
                    }
                }
                covered = covered_share;
            }
            let share = 1.0 / f32(samples * samples);
            write(index, light * share, cover_word(covered * share, COVER_MESH | select(0u, COVER_LIMB, limb), nearest));
            return;
        }
    }

    // Bodies only, sorted from near to far along the ray.
    var hits: array<Contribution, MOST_HITS>;
    var count = 0u;
    var flags = 0u;
    // A corona hides nothing. Bodies that are nearer than its sun hide it.
    var corona = vec3(0.0);
    var corona_m = 3e38;
    var is_corona_steep = false;
    let unit = normalize(ray);
    let end = run.x + run.y;
    let first = next_near(run.x, end, unit);
    prepare_rays(viewport, corner, ray, first < end);
    for (var b = first; b < end; b = next_near(b + 1u, end, unit)) {
        let body = body_for(viewport, b, ray);
        let extent = extent_of(viewport, corner, ray);
        var contribution = body_in_pixel(viewport, body, corner, ray, extent);
        var rings: Contribution;
        if body.around == AROUND_RINGS {
            rings = rings_in_pixel(viewport, body, corner, ray, contribution.limb);
            if contribution.coverage > 0.0 && rings.coverage > 0.0 {
                contribution = globe_with_rings(contribution, rings);
                rings.coverage = 0.0;
            }
        }
        if contribution.coverage > 0.0 || contribution.limb {
            if contribution.limb || body.part < 1.0 {
                flags |= COVER_LIMB;
            }
            contribution.light *= body.part;
            contribution.coverage *= body.part;
            count = insert_hit(&hits, count, contribution);
        }
        if body.around == AROUND_CORONA {
            corona += corona_in_pixel(viewport, body, corner, ray, extent);
            let reach = extent * body.distance_m * body.inverse_smallest;
            let s = passage_of(body, ray).s;
            is_corona_steep = is_corona_steep || s < STEEP_CORONA || 2.0 * reach > COARSE_CORONA * s;
            corona_m = min(corona_m, body.distance_m * length(body.centre) - 1.0 / body.inverse_smallest);
        }
        if rings.coverage > 0.0 {
            rings.light *= body.part;
            rings.coverage *= body.part;
            count = insert_hit(&hits, count, rings);
        }
    }
    var light = vec3(0.0);
    var open = 1.0;
    var before_corona = 1.0;
    var nearest = 3e38;
    for (var i = 0u; i < count; i++) {
        light += open * hits[i].light;
        open *= 1.0 - hits[i].coverage;
        nearest = min(nearest, hits[i].distance_m);
        if hits[i].distance_m < corona_m {
            before_corona = open;
        }
    }
    light += before_corona * corona;
    // If the limb of a body crosses another body, the covered area is not a product of shares: `crossed.wgsl` draws the pixel again.
    let partly = count > 0u && !hits[0].rings && hits[0].coverage > 0.0 && hits[0].coverage < 1.0;
    let crossed = count > 1u && !hits[1].rings && hits[1].coverage > 0.0;
    // The same applies to a body in front of a corona, since a corona is brightest at the limb of its sun.
    let is_crossed = partly && (crossed || (before_corona < 1.0 && is_corona_steep && any(corona > vec3(0.0))));
    var word = 0u;
    if nearest < 3e38 {
        word = cover_word(1.0 - open, flags, nearest);
    }
    // A negative zero would be a mark.
    light = max(light, vec3(0.0));
    write(index, light, word);
    if is_crossed {
        geometry[index].x |= CROSSED_MARK;
    }
    let shows_surface = word != 0u || any(light != vec3(0.0));
    if HAS_PLAIN {
        if shows_surface {
            atomicOr(&counters[flag_of_pixel(plain_grids[tile.viewport], pixel)], BLOCK_IS_MIXED);
        }
    }
}

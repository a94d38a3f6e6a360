// Whether bodies and asteroids stand before a point of light.

#import shared/cover
#import shared/ellipsoid
#import shared/splat
#import shared/viewport

@group(2) @binding(0) var<storage, read> geometry: array<vec4<u32>>;
@group(2) @binding(1) var<storage, read> view_bodies: array<ViewBody>;
// First body of each viewport, and how many it has.
@group(2) @binding(2) var<storage, read> body_runs: array<vec2<u32>>;

// Whether there is anything but stars.
override HAS_GEOMETRY: bool = false;
// What is at infinity, m.
const INFINITELY_FAR_M: f32 = 3e38;

// Share of a point of light that is seen, whose image is at `pixel` and which is `distance_m` away: bodies hide it or not, exactly; of
// asteroids the pixel tells.
fn visible_share(tile: Tile, viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, distance_m: f32) -> f32 {
    let at = settle(viewport, vec2<i32>(floor(pixel)));
    let row = at.y - i32(tile.first_row);
    var word = COVER_LIMB;
    if at.x >= 0 {
        // What lies in another tile is asked of the bodies; of asteroids the next row of this one tells.
        let inside = row >= 0 && row < i32(tile.rows);
        let held = clamp(row, 0, i32(tile.rows) - 1);
        let own = geometry[tile.first_pixel + u32(held) * viewport.size.x + u32(at.x)].w;
        if inside {
            word = own;
            if word == 0u || distance_of(word) >= distance_m {
                return 1.0;
            }
        } else if (own & COVER_MESH) != 0u && distance_of(own) < distance_m {
            word |= own;
        }
    }
    if (word & COVER_LIMB) != 0u {
        let run = body_runs[tile.viewport];
        for (var i = run.x; i < run.x + run.y; i++) {
            var body = view_bodies[i];
            if viewport.viewing_circle_m != 0.0 {
                body = seen_from(body, eye_on_circle(viewport, normalize(direction)));
            }
            if hides(body, direction, distance_m) {
                return 1.0 - body.part;
            }
        }
        if (word & COVER_MESH) == 0u {
            return 1.0;
        }
    }
    return 1.0 - coverage_of(word);
}

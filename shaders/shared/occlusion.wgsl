// Occlusion of points of light by bodies and asteroids. The importer binds `counters`.

#import constants/frame_lists
#import constants/plain_blocks
#import shared/cover
#import shared/ellipsoid
#import shared/plain_flag
#import shared/splat
#import shared/viewport

@group(2) @binding(0) var<storage, read> geometry: array<vec4<u32>>;
@group(2) @binding(1) var<storage, read> view_bodies: array<ViewBody>;
// First body and number of bodies of each viewport; two words are unused.
@group(2) @binding(2) var<uniform> body_runs: array<vec4<u32>, MAX_VIEWPORTS>;
// Grids of plain blocks, or grids without points: see shared/plain_block.wgsl.
@group(2) @binding(3) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;

// Whether the scene has surfaces in addition to stars.
override HAS_GEOMETRY: bool = false;
// Distance of objects at infinity, m.
const INFINITELY_FAR_M: f32 = 3e38;

// Whether the block that contains a pixel of a tile is plain, so that nothing hides a star in it. The flag of a block is more often in the cache of a
// CPU than the geometry of a pixel.
fn is_in_plain_block(viewport: u32, pixel: vec2<u32>) -> bool {
    let grid = plain_grids[viewport];
    if grid.first == NO_POINTS {
        return false;
    }
    let flags = atomicLoad(&counters[flag_of_pixel(grid, pixel)]);
    return (flags & (BLOCK_IS_MIXED | BLOCK_IS_OUTSIDE)) == 0u;
}

// Returns the visible share of a point of light at the distance `distance_m` whose image is at `pixel`. Occlusion by bodies is exact, 0 or 1;
// occlusion by asteroids is the coverage of the pixel.
fn visible_share(tile: Tile, viewport: Viewport, direction: vec3<f32>, pixel: vec2<f32>, distance_m: f32) -> f32 {
    let own_pixel = settle(viewport, vec2<i32>(floor(pixel)));
    let row = own_pixel.y - i32(tile.first_row);
    var word = COVER_LIMB;
    if own_pixel.x >= 0 {
        // If the image is in another tile, occlusion is tested against the bodies. For asteroids, the nearest row of this tile is used.
        let inside = row >= 0 && row < i32(tile.rows);
        if inside && is_in_plain_block(tile.viewport, vec2<u32>(own_pixel)) {
            return 1.0;
        }
        let held = clamp(row, 0, i32(tile.rows) - 1);
        let own = geometry[tile.first_pixel + u32(held) * viewport.size.x + u32(own_pixel.x)].w;
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
        let run = body_runs[tile.viewport].xy;
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

// Draws the pixels in which the limb of a body crosses another body, or in which a body is in front of a steep corona. `rays.wgsl` marks them by the
// sign of their first word. In these pixels the covered area is not a product of shares: in an eclipse one disc is inside the other.
//
// The geometry pass and this pass are separate shaders, because drivers compile the two in half the time that a single one would take. The f64 twin
// is crates/render/src/reference/bodies/mod.rs.

#import bodies/pixel_rays
#import bodies/surface
#import constants/bodies
#import constants/frame_lists
#import constants/workgroups
#import shared/cover
#import shared/ellipsoid
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
// First column and row, within the tile, of the blocks of pixels that are drawn.
@group(0) @binding(8) var<storage, read> blocks: array<vec2<u32>>;

// Parts along a side of a pixel.
const CROSSED_PARTS: u32 = 12u;

// Returns the light and coverage of a pixel that several bodies partly cover: each part of the pixel shows the nearest body.
fn nearest_of_parts(viewport: Viewport, run: vec2<u32>, corner: vec2<f32>, ray: vec3<f32>, extent: f32) -> vec4<f32> {
    var sum = vec4(0.0);
    for (var i = 0u; i < CROSSED_PARTS * CROSSED_PARTS; i++) {
        let point = (vec2(f32(i % CROSSED_PARTS), f32(i / CROSSED_PARTS)) + 0.5) / f32(CROSSED_PARTS);
        let own = ray_at(viewport, corner, point, ray);
        var nearest = 3e38;
        var front = vec4(0.0);
        var corona = vec3(0.0);
        for (var b = run.x; b < run.x + run.y; b++) {
            let body = body_for(viewport, b, ray);
            let passage = passage_of(body, own);
            if body.around == AROUND_CORONA {
                corona += body.around_light * corona_over_disc(passage.s);
            }
            if passage.s <= 1.0 {
                let entry = entry_of(body, passage);
                if entry.w < nearest {
                    nearest = entry.w;
                    let footprint = extent / f32(CROSSED_PARTS) * body.distance_m * body.inverse_smallest;
                    front = body.part * vec4(luminance_at(body, passage, entry, footprint), 1.0);
                }
            }
        }
        sum += front + vec4((1.0 - front.w) * corona, 0.0);
    }
    return sum / f32(CROSSED_PARTS * CROSSED_PARTS);
}

@compute @workgroup_size(RAY_SIDE, RAY_SIDE)
fn draw_crossed(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let id = blocks[invocation.z] + invocation.xy;
    let tile = tiles[parameters.tile];
    let viewport = viewports[tile.viewport];
    if id.x >= viewport.size.x || id.y >= tile.rows {
        return;
    }
    let index = tile.first_pixel + id.y * viewport.size.x + id.x;
    let drawn = geometry[index];
    if (drawn.x & CROSSED_MARK) == 0u {
        return;
    }
    let corner = vec2<f32>(vec2(id.x, tile.first_row + id.y));
    let ray = centre_ray(viewport, corner);
    prepare_rays(viewport, corner, ray, true);
    let extent = extent_of(viewport, corner, ray);
    let sampled = nearest_of_parts(viewport, body_runs[tile.viewport].xy, corner, ray, extent);
    // Rounded as in `rays.wgsl`, which stores the complement of the open share.
    let open = 1.0 - sampled.w;
    geometry[index] = vec4(bitcast<vec3<u32>>(sampled.xyz), with_coverage(drawn.w, 1.0 - open));
}

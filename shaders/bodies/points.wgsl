// The point pass: splats bodies that are too small for a disc, and groups of asteroids that are too small to be resolved. Like stars, they are
// splatted in illuminance.
//
// One invocation takes one point and splats it into all tiles that may show it.

#import constants/frame_lists
#import constants/rec709
#import constants/units
#import constants/workgroups
#import shared/occlusion
#import shared/projection
#import shared/splat
#import shared/viewport
#import structs/Point
#import structs/PointParameters

@group(0) @binding(0) var<uniform> parameters: PointParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(1) @binding(0) var<storage, read> points: array<Point>;

@compute @workgroup_size(POINT_THREADS)
fn splat_points(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.y * parameters.per_row + id.x;
    if id.x >= parameters.per_row || index >= parameters.count {
        return;
    }
    let point = points[index];
    var remaining = point.tiles;
    while remaining != 0u {
        let tile = tiles[firstTrailingBit(remaining)];
        remaining &= remaining - 1u;
        let viewport = viewports[tile.viewport];
        target_tile = vec3(tile.first_pixel, viewport.size.x, tile.first_flag);
        let relative = point.offset - PARSEC_M * eye_of(viewport);
        // Squares of metres overflow f32 beyond 600 pc.
        let largest = max(abs(relative.x), max(abs(relative.y), abs(relative.z)));
        if !(largest > 0.0) {
            continue;
        }
        let scaled = relative / largest;
        let distance_m = largest * length(scaled);
        let unit = normalize(scaled);
        let light = point.intensity / distance_m / distance_m;
        let illuminance = dot(light, LUMINANCE_WEIGHTS);
        if !(illuminance >= parameters.faintest_lx && illuminance < parameters.brightest_lx) {
            continue;
        }
        let direction = direction_from_circle(viewport, view_direction(viewport, unit), distance_m);
        let projected = pixel_from_direction(viewport, direction);
        let image = image_of(viewport, direction, projected.xy, illuminance);
        let margin = select(1.5, viewport.gaussian_reach_px, image.peak >= viewport.gaussian_from_cd_m2);
        let first_row = f32(tile.first_row);
        if !(illuminance > 0.0) || projected.z == 0.0 || any(projected.xy < vec2(0.0, first_row) - margin)
            || any(projected.xy > vec2(f32(viewport.size.x), first_row + f32(tile.rows)) + margin) {
            continue;
        }
        let visible = visible_share(tile, viewport, direction, projected.xy, distance_m - point.radius);
        if visible > 0.0 {
            let scale = illuminance * visible * parameters.units_per_lx;
            splat(tile, viewport, image, light / illuminance, scale, index);
        }
    }
}

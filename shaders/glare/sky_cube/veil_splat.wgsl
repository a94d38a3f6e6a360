// Adds the veil of bright single sources to the sums of light of a batch. One or several invocations take one source and one tile, and process four
// pixels of a row at a time. Sources are sorted by reach, so that invocations of a workgroup have similar amounts of work.

#import constants/frame_lists
#import constants/rec709
#import constants/veil
#import glare/sky_cube/kernel
#import glare/sky_cube/sprites
#import shared/gaussian
#import shared/projection
#import shared/splat
#import shared/viewport
#import structs/VeilSplatParameters

@group(0) @binding(0) var<uniform> parameters: VeilSplatParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(1) @binding(0) var<uniform> sky: SkyCubeParameters;
@group(1) @binding(1) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(1) @binding(2) var<storage, read> sprites: array<GlareSprite>;
@group(1) @binding(3) var<storage, read> kernel_table: array<f32>;

override WORKGROUP: u32;

// Whether a direction outside a round picture is farther from the picture than the given chord. The nearest point of the picture is on the rim.
fn lies_beyond_rim(viewport: Viewport, direction: vec3<f32>, projected: vec3<f32>, chord: f32) -> bool {
    if !is_fisheye(viewport) || viewport.full_sphere != 0u || projected.z == 0.0 {
        return false;
    }
    let outwards = (projected.xy - viewport.plane_offset) / viewport.plane_scale;
    let rho = length(outwards);
    let at_rim = direction_of_point(viewport, viewport.plane_offset + outwards / rho * viewport.plane_scale);
    return rho > 1.0 && length(direction - at_rim) > chord;
}

// Whether a unit direction is outside one of the planes through the eye and the edges of a flat picture, by more than an angle whose sine is given.
// Without this test, the veil would seem to reach all pixels near the eye's plane, because pixel coordinates grow there without bound.
fn lies_beside(viewport: Viewport, direction: vec3<f32>, sine: f32) -> bool {
    let first = -viewport.plane_offset / viewport.plane_scale;
    let last = (vec2<f32>(viewport.size) - viewport.plane_offset) / viewport.plane_scale;
    let least = min(first, last);
    let most = max(first, last);
    let before = (direction.xy + least * direction.z) * inverseSqrt(1.0 + least * least);
    let beyond = -(direction.xy + most * direction.z) * inverseSqrt(1.0 + most * most);
    return any(min(before, beyond) < vec2(-sine));
}

// Returns the range of pixels that the veil of a source may reach.
fn reached_pixels(viewport: Viewport, direction: vec3<f32>, chord: f32) -> Gaussian {
    // Chords of sprites are so short that 1.01 times the chord exceeds the angle.
    let cut = 1.01 * chord;
    var reached: Gaussian;
    reached.last = vec2<i32>(viewport.size) - 1;
#when shared/tabulated
    if viewport.kind == KIND_TABULATED {
        let near = near_in_table(viewport, direction);
        if near.outside > cut {
            reached.last.y = -1;
        } else if near.shorter > 0.0 {
            // The region within `cut` of the source is inside the region around a nearby position, if `cut` is enlarged by the distance of the two.
            let around = cut + 2.0 * asin(min(0.5 * length(near.direction - direction), 1.0));
            let reach = gaussian_reach(viewport, near.direction, near.shorter, around);
            reached = gaussian_around(viewport, near.direction, near.pixel, reach, 1.0, around);
            reached.first = max(reached.first, vec2(0));
            reached.last = min(reached.last, vec2<i32>(viewport.size) - 1);
        }
        return reached;
    }
#end
    let projected = pixel_from_direction(viewport, direction);
    if lies_beyond_rim(viewport, direction, projected, chord)
        || (viewport.kind <= KIND_CUBE_FACE && lies_beside(viewport, direction, cut)) {
        reached.last.y = -1;
    } else if projected.z > 0.0 {
        let reach = gaussian_reach(viewport, direction, pixel_extent(viewport, direction, projected.xy).y, cut);
        reached = gaussian_around(viewport, direction, projected.xy, reach, 1.0, cut);
    } else if direction.z > cut {
        // The source has no image and is too far outside the region of directions that have images.
        reached.last.y = -1;
    }
    if viewport.kind != KIND_EQUIRECTANGULAR {
        reached.first.x = max(reached.first.x, 0);
        reached.last.x = min(reached.last.x, i32(viewport.size.x) - 1);
    }
    return reached;
}

@compute @workgroup_size(WORKGROUP)
fn splat_veils(@builtin(global_invocation_id) place: vec3<u32>) {
    let number = place.y * parameters.per_row + place.x / parameters.shared_by;
    let tile = tiles[place.z];
    if number >= parameters.count || (parameters.viewport != EVERY_VIEWPORT && parameters.viewport != tile.viewport) {
        return;
    }
    let sprite = sprites[parameters.first + number];
    let view = views[tile.viewport];
    let illuminance = dot(sprite.light, LUMINANCE_WEIGHTS);
    if sprite.inverse_squared > view.greatest_inverse
        || !(illuminance >= parameters.faintest_lx && illuminance < parameters.brightest_lx) {
        return;
    }
    let viewport = viewports[tile.viewport];
    let direction = view_direction(viewport, sprite.direction);
    let row_0 = i32(tile.first_row);
    let reached = reached_pixels(viewport, direction, inverseSqrt(sprite.inverse_squared));
    let first = vec2(reached.first.x, max(reached.first.y, row_0));
    let last = vec2(reached.last.x, min(reached.last.y, row_0 + i32(tile.rows) - 1));
    if any(last < first) {
        return;
    }
    target_tile = vec3(tile.first_pixel, viewport.size.x, tile.first_flag);
    var in_view = sprite;
    in_view.direction = direction;
    let threshold = rounding_threshold(parameters.first + number);
    let quads = (last.x - first.x) / 4 + 1;
    let count = quads * (last.y - first.y + 1);
    let lanes = turns(viewport, 4);
    for (var i = i32(place.x % parameters.shared_by); i < count; i += i32(parameters.shared_by)) {
        let row = i / quads;
        let position = vec2(first.x + 4 * (i - row * quads), first.y + row);
        var four: Directions4;
        for (var lane = 0; lane < lanes; lane++) {
            let pixel = gaussian_pixel(viewport, vec2(position.x + lane, position.y));
            set_lane(&four, u32(lane), direction_of_pixel(viewport, pixel));
        }
        let kernel = sprite_kernel(view, in_view, four);
        for (var lane = 0; lane < lanes; lane++) {
            let pixel = gaussian_pixel(viewport, vec2(position.x + lane, position.y));
            if position.x + lane <= last.x && kernel[lane] > 0.0 && contains(viewport, pixel) {
                let light = sprite.light * (kernel[lane] * solid_angle(viewport, pixel) * parameters.units_per_lx);
                // Many pixels receive a fraction of a unit. With a single threshold for all of them, rounding would bias their sum.
                let tap = f32(4 * i + lane);
                let index = tile.first_pixel + u32((pixel.y - row_0) * i32(viewport.size.x) + pixel.x);
                accumulate(index, floor(light + fract(threshold + tap * 0.61803399)));
            }
        }
    }
}

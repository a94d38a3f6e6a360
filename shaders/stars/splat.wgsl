// The star pass: every star of every visible chunk, splatted in illuminance into all tiles that may see it.
//
// One workgroup takes one item: a run of stars of one chunk, and the set of tiles. The f64 twin is
// crates/render/src/reference/stars/splat.rs.

#import constants/counters
#import constants/frame_lists
#import constants/rec709
#import constants/star_forms
#import constants/star_light
#import constants/units
#import shared/air_mass
#import shared/map_caps
#import shared/occlusion
#import shared/projection
#import shared/refraction
#import shared/splat
#import shared/viewport
#import stars/relativity
#import stars/star
#import structs/StarParameters

@group(0) @binding(0) var<uniform> parameters: StarParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> colours: array<vec4<f32>>;
@group(1) @binding(0) var<storage, read> stars: array<Star>;
@group(1) @binding(1) var<storage, read> items: array<StarItem>;

// Invocations that share an item. A GPU is fastest with one or two full waves. A software driver runs a workgroup as a loop of SIMD steps, and
// reloads the item and its viewports in each step, so a single step is best.
override WORKGROUP: u32;
// Whether the stars are those of pages of a deep store.
override FROM_PAGES: bool;
// Whether the camera is in air.
override HAS_AIR: bool;

// Returns the light of a composite star, linear Rec. 709, lx: crates/sky/src/catalogue/deep/composite.rs.
fn composite_light(word: u32) -> vec3<f32> {
    let unit = bitcast<f32>(u32(i32(word & 31u) + 127 + COMPOSITE_UNIT_LOG2) << 23u);
    return vec3(f32(word >> 23u), f32((word >> 14u) & 511u), f32((word >> 5u) & 511u)) * unit;
}

@compute @workgroup_size(WORKGROUP)
fn splat_stars(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let item_index = group.y * parameters.items_per_row + group.x;
    if item_index >= parameters.item_count {
        return;
    }
    let item = items[item_index];
    var remaining = item.tiles;
    while remaining != 0u {
        let tile = tiles[firstTrailingBit(remaining)];
        remaining &= remaining - 1u;
        let viewport = viewports[tile.viewport];
        let origin = item.origin - select(eye_of(viewport), vec3(0.0), item.form == STARS_AT_INFINITY);
        // The axes of a page: crates/sky/src/catalogue/deep/live/page.rs.
        let observer = parameters.camera + eye_of(viewport);
        let pole = select(vec3(1.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), abs(item.origin.z) < 0.9);
        let axis_x = normalize(cross(pole, item.origin));
        let axis_y = cross(item.origin, axis_x);
        target_tile = vec3(tile.first_pixel, viewport.size.x, tile.first_flag);
        let size = vec2<f32>(viewport.size);
        let first_row = f32(tile.first_row);
        var drawn = 0u;
        for (var i = local; i < item.count; i += WORKGROUP) {
            let star = stars[item.first + i];
            var relative = origin + vec3(star.offset_x, star.offset_y, star.offset_z);
            var at_barycentre = 1.0;
            if FROM_PAGES {
                let towards = item.origin + axis_x * star.offset_x + axis_y * star.offset_y;
                relative = towards - observer * star.offset_z;
                at_barycentre = dot(towards, towards);
            }
            let distance_squared = dot(relative, relative);
            var illuminance = illuminance_at_1_pc(star) * at_barycentre / distance_squared;
            var colour_index = star.light & LAST_TEMPERATURE_STEP;
            if moves(parameters.camera_motion) && distance_squared > 0.0 {
                let seen = apparent_place(parameters.camera_motion, relative);
                relative = seen.xyz;
                illuminance *= light_factor(colour_index, seen.w);
                colour_index = table_index(i32(round(f32(colour_index) + doppler_steps(seen.w))));
            }
            var colour = colours[colour_index].xyz;
            if FROM_PAGES && item.form == COMPOSITES_OF_PAGE {
                let light = composite_light(star.light);
                let total = dot(light, LUMINANCE_WEIGHTS);
                illuminance = total * at_barycentre / distance_squared;
                colour = light / total;
            }
            // Limits refer to the light before it passes the air. They divide the stars between the sums, and between a frame and the map of faint
            // light. Composite stars are not divided. A star at the camera's position has no direction; the comparison is also false for NaN.
            let is_composite = FROM_PAGES && item.form == COMPOSITES_OF_PAGE;
            let is_within = illuminance >= parameters.faintest_lx && illuminance < parameters.brightest_lx;
            if !((is_within || is_composite) && distance_squared > 0.0) {
                continue;
            }
            if HAS_AIR {
                let distance = sqrt(dot(relative, relative));
                let seen = refracted(parameters.air, relative / distance);
                relative = seen * distance;
                colour *= through_air(parameters.air, seen);
                let kept = dot(colour, LUMINANCE_WEIGHTS);
                illuminance *= kept;
                colour /= kept;
            }
            let direction = view_direction(viewport, relative);
            var share = 1.0;
            if !FROM_PAGES && parameters.caps.y > 0.0 {
                share -= share_of_map(viewport, parameters.caps, direction);
                if share <= 0.0 {
                    continue;
                }
            }
            let projected = pixel_from_direction(viewport, direction);
            var image = image_of(viewport, direction, projected.xy, illuminance);
            if FROM_PAGES {
                // The tent is not used: its pattern would interfere with that of the cells of composite stars. Stars use the same kernel as composite
                // stars, so that they look alike.
                image.peak = max(image.peak, viewport.tent_below_cd_m2);
                // The light of a cell is spread, unlike that of a bright star.
                let spread = min(image.peak, 0.999 * viewport.gaussian_from_cd_m2);
                image.peak = select(image.peak, spread, item.form == COMPOSITES_OF_PAGE);
            }
            let bright = image.peak >= viewport.gaussian_from_cd_m2;
            let margin = select(1.5, viewport.gaussian_reach_px, bright);
            if projected.z == 0.0 || any(projected.xy < vec2(0.0, first_row) - margin)
                || any(projected.xy > vec2(size.x, first_row + f32(tile.rows)) + margin) {
                continue;
            }
            let pixel = projected.xy;
            var visible = 1.0;
            if HAS_GEOMETRY {
                let distance_m = select(INFINITELY_FAR_M, PARSEC_M * sqrt(distance_squared), item.form == STARS_IN_SPACE);
                visible = visible_share(tile, viewport, direction, pixel, distance_m);
                if visible <= 0.0 {
                    continue;
                }
            }
            let scale = illuminance * share * visible * parameters.units_per_lx;
            splat(tile, viewport, image, colour, scale, item.first_number + i);
            drawn += select(0u, 1u, holds_image(tile, viewport, pixel));
        }
        if drawn > 0u {
            atomicAdd(&counters[FIRST_VIEW_COUNTER + viewport.view], drawn);
        }
    }
}

// The published splat on culled and sorted stars, to measure the cost of the splat without the cost of drawing the whole unsorted catalogue.

#import constants/star_forms
#import constants/star_light
#import shared/math
#import stars/packed_splat
#import stars/star
#import structs/PackedParameters

@group(0) @binding(0) var<uniform> parameters: PackedParameters;
@group(1) @binding(0) var<storage, read> stars: array<Star>;
@group(1) @binding(1) var<storage, read> items: array<StarItem>;

override WORKGROUP: u32;

@compute @workgroup_size(WORKGROUP)
fn splat_sorted(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
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
        let eye = vec3(viewport.view_from_world_x.w, viewport.view_from_world_y.w, viewport.view_from_world_z.w);
        let origin = item.origin - select(eye, vec3(0.0), item.form == STARS_AT_INFINITY);
        for (var i = local; i < item.count; i += WORKGROUP) {
            let star = stars[item.first + i];
            let relative = origin + vec3(star.offset_x, star.offset_y, star.offset_z);
            let distance_squared = dot(relative, relative);
            let illuminance = illuminance_at_1_pc(star) / distance_squared;
            if !(illuminance >= parameters.faintest_lx && distance_squared > 0.0) {
                continue;
            }
            let direction = view_direction(viewport, relative);
            let temperature = temperature_of_step(star.light & LAST_TEMPERATURE_STEP);
            splat_packed(tile, viewport, direction, illuminance, temperature);
        }
    }
}

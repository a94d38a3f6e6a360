// Splats asteroids drawn as points in illuminance, like stars. A workgroup takes a group and loops over the tiles of the batch whose pictures may
// show it. The light is that of a sphere, p E (r / D)^2 times the phase function, times the shape's projected area towards the eye divided by pi r^2
// (from a table), times the share of its classes that belongs to the point.

#import asteroids/class
#import asteroids/instance
#import asteroids/phase
#import constants/asteroid_instances
#import constants/asteroid_points
#import constants/frame_lists
#import constants/rec709
#import shared/math
#import shared/occlusion
#import shared/projection
#import shared/splat
#import shared/viewport
#import structs/AsteroidPointParameters

@group(0) @binding(0) var<uniform> parameters: AsteroidPointParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> items: array<AsteroidItem>;
@group(1) @binding(0) var<storage, read> instances: array<u32>;
@group(1) @binding(1) var<uniform> fields: array<AsteroidField, MAX_FIELDS>;
@group(1) @binding(2) var<uniform> views: array<AsteroidView, MAX_VIEWPORTS>;
// Tables of pictures and shapes.
@group(1) @binding(3) var<storage, read> asteroid_tables: array<vec2<f32>>;

override WORKGROUP: u32;

@compute @workgroup_size(WORKGROUP)
fn splat_asteroids(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let item_index = group.y * parameters.row + group.x;
    if item_index >= parameters.items {
        return;
    }
    let item = items[item_index];
    if (item.flags & ITEM_HOLDS_POINTS) == 0u {
        return;
    }
    let field = fields[item.field];
    for (var t = 0u; t < parameters.tiles; t++) {
        let tile = tiles[t];
        let word_of_view = select(item.viewports.x, item.viewports.y, tile.viewport >= 32u);
        if (word_of_view & (1u << (tile.viewport & 31u))) == 0u {
            continue;
        }
        let viewport = viewports[tile.viewport];
        let view = views[tile.viewport];
        target_tile = vec3(tile.first_pixel, viewport.size.x, tile.first_flag);
        let size = vec2<f32>(viewport.size);
        let first_row = f32(tile.first_row);
        let last_row = i32(viewport.size.y) - 1;
        var drawn = 0u;
        for (var i = local; i < item.count; i += WORKGROUP) {
            let word = INSTANCE_WORDS * (item.first + i);
            let offset = bitcast<vec3<f32>>(vec3(instances[word], instances[word + 1u], instances[word + 2u]));
            let direction = view_from_camera(view, place_of(item, field, offset));
            let distance = length(direction);
            let radius_and_shape = instances[word + 3u];
            let shape = asteroid_shape(shape_of(field, radius_and_shape));
            let radius = radius_of(field, radius_and_shape);
            if !(distance > 0.0) || !touches(view, direction, shape.bound * radius) {
                continue;
            }
            let projected = pixel_from_direction(viewport, direction);
            let pixel_rad = pixel_at(view, table_place(view, direction, distance));
            let classes = classes_of(view, shape, radius, distance, pixel_rad);
            if classes.current != CLASS_POINT {
                continue;
            }
            // The point is counted by the tile that contains its row, or by the tile with the nearest row.
            let row = select(0, clamp(i32(clamp(projected.y, -1.0, size.y)), 0, last_row), projected.z > 0.0);
            drawn += select(0u, 1u, row >= i32(tile.first_row) && row < i32(tile.first_row + tile.rows));
            let margin = viewport.gaussian_reach_px + 1.5;
            if projected.z == 0.0 || any(projected.xy < vec2(0.0, first_row) - margin)
                || any(projected.xy > vec2(size.x, first_row + f32(tile.rows)) + margin) {
                continue;
            }
            // Rotate back to the field's axes and then to those of the shape.
            let to_eye = -direction / distance;
            let world = to_eye.x * view.view_from_world_x.xyz + to_eye.y * view.view_from_world_y.xyz
                + to_eye.z * view.view_from_world_z.xyz;
            let in_field = world.x * field.world_from_field_x.xyz + world.y * field.world_from_field_y.xyz
                + world.z * field.world_from_field_z.xyz;
            let in_shape = transpose(field_from_shape(field, instances[word + 4u], instances[word + 5u])) * in_field;
            let cosine = dot(world, item.sun);
            let sine = length(cross(world, item.sun));
            let size_over_distance = radius / distance;
            let full = size_over_distance * size_over_distance * phase_function(field.law, precise_atan2(sine, cosine))
                * area_towards(shape, in_shape) * classes.share;
            let light = field.albedo * item.illuminance * full;
            let illuminance = dot(light, LUMINANCE_WEIGHTS);
            if !(illuminance > 0.0) {
                continue;
            }
            // The rest of the asteroid's light is drawn as a mesh or impostor, which must not hide the point. The distances stored per pixel are
            // rounded down.
            let foremost = (distance - shape.bound * radius) * 0.9999;
            let visible = visible_share(tile, viewport, direction, projected.xy, foremost);
            if visible > 0.0 {
                let scale = illuminance * visible * parameters.units_per_lx;
                let image = image_of(viewport, direction, projected.xy, illuminance);
                splat(tile, viewport, image, light / illuminance, scale, item.first + i);
            }
        }
        if drawn > 0u {
            // Visible points per viewport; from MAX_VIEWPORTS on, visible asteroids of point-only groups.
            atomicAdd(&counters[parameters.first_drawn + tile.viewport], drawn);
            if (item.flags & ITEM_HOLDS_SHAPES) == 0u {
                atomicAdd(&counters[parameters.first_drawn + MAX_VIEWPORTS + tile.viewport], drawn);
            }
        }
    }
}

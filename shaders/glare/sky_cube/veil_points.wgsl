// Evaluates the smooth part of scattered light at the points of a grid over each picture: the map of the sky, and the
// part of the eye's own sources that the map's kernel covers.

#import constants/frame_lists
#import constants/workgroups
#import glare/sky_cube/cells
#import glare/sky_cube/kernel
#import glare/sky_cube/sprites
#import shared/projection
#import shared/point_grid
#import shared/viewport
#import structs/VeilParameters

@group(0) @binding(0) var<uniform> parameters: VeilParameters;
@group(0) @binding(1) var<uniform> sky: SkyCubeParameters;
@group(0) @binding(2) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(3) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
@group(0) @binding(4) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(0) @binding(5) var<storage, read> map: array<vec4<f32>>;
// Sources of all viewports, one viewport after the other.
@group(0) @binding(6) var<storage, read> near: array<GlareSprite>;
@group(0) @binding(7) var<storage, read> kernel_table: array<f32>;
@group(0) @binding(8) var<storage, read_write> grid_points: array<vec4<f32>>;

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn place_veil(@builtin(global_invocation_id) place: vec3<u32>) {
    let grid = point_grids[place.z];
    if place.x >= grid.columns || place.y >= grid.rows {
        return;
    }
    let viewport = viewports[place.z];
    let view = views[place.z];
    let direction = world_direction(viewport, direction_of_point(viewport, vec2<f32>(place.xy * grid.spacing)));
    // Where the map is steep, its interpolation can be slightly negative.
    var light = max(read_map(view.first_point, sky.edge_cells, direction), vec3(0.0));
    for (var i = view.first_near; i < view.first_near + view.near_count; i++) {
        let beside = direction - near[i].direction;
        let squared = vec4(dot(beside, beside));
        let u = squared.x * sky.soft_inverse;
        let soft = sky.soft.x + u * (sky.soft.y + u * sky.soft.z);
        light += near[i].light * select(kernel_in_view(view, squared, angle_squared(squared)).x, soft, u < 1.0);
    }
    grid_points[grid.first + place.y * grid.columns + place.x] = vec4(parameters.fraction * light, 0.0);
}

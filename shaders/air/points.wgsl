// Evaluates the light added by the air at the points of a grid over each picture, and the sines of their altitudes.

#import air/scattered
#import constants/frame_lists
#import constants/workgroups
#import shared/point_grid
#import shared/projection
#import shared/viewport

@group(0) @binding(0) var<uniform> parameters: AirParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
@group(0) @binding(3) var<storage, read> sky: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> grid_points: array<vec4<f32>>;

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn place_air(@builtin(global_invocation_id) place: vec3<u32>) {
    let grid = point_grids[place.z];
    if place.x >= grid.columns || place.y >= grid.rows {
        return;
    }
    let viewport = viewports[place.z];
    let towards = normalize(world_direction(viewport, direction_of_point(viewport, vec2<f32>(place.xy * grid.spacing))));
    var light = vec3(0.0);
    if parameters.has_air != 0u {
        light = added_light(towards);
    }
    grid_points[grid.first + place.y * grid.columns + place.x] = vec4(light, dot(towards, parameters.zenith));
}

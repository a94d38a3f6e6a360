// Evaluates the light that bodies scatter in the eye at the points of a grid over each picture, and marks the points next to a source, at which this
// light is too steep for interpolation.

#import constants/frame_lists
#import constants/workgroups
#import glare/light8
#import glare/sky_cube/near
#import shared/point_grid
#import shared/projection
#import shared/viewport
#import structs/NearPointParameters

@group(0) @binding(0) var<uniform> parameters: NearPointParameters;
@group(0) @binding(1) var<uniform> sky: SkyCubeParameters;
@group(0) @binding(2) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(3) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
@group(0) @binding(4) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(0) @binding(5) var<storage, read> near: array<GlareNear>;
@group(0) @binding(6) var<storage, read> kernel_table: array<f32>;
@group(0) @binding(7) var<storage, read_write> grid_points: array<vec4<f32>>;

// Returns the directions of four points, one below the other.
fn directions_down(viewport: Viewport, top: vec2<u32>, spacing: u32) -> Directions4 {
    var four: Directions4;
    for (var one = 0u; one < u32(turns(viewport, 4)); one++) {
        let point = vec2<f32>(top + vec2(0u, one * spacing));
        set_lane(&four, one, world_direction(viewport, direction_of_point(viewport, point)));
    }
    return four;
}

// One invocation evaluates eight points of a column.
@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn place_near(@builtin(global_invocation_id) place: vec3<u32>) {
    let grid = point_grids[place.z];
    let first_row = 8u * place.y;
    if place.x >= grid.columns || first_row >= grid.rows {
        return;
    }
    let viewport = viewports[place.z];
    let view = views[place.z];
    let top = vec2(place.x, first_row) * grid.spacing;
    let directions =
        array<Directions4, 2>(directions_down(viewport, top, grid.spacing), directions_down(viewport, top + vec2(0u, 4u * grid.spacing), grid.spacing));
    var light: Light8;
    add_near(&light, view, directions);
    // 1: next to a source, or inside the region in which its parts replace it.
    var steep: array<vec4<f32>, 2>;
    for (var i = view.first_near; i < view.first_near + view.near_count; i++) {
        let parts = select(near[i].parts, 0u, (near[i].parts & IS_EXTENDED) != 0u);
        let reach = max(parameters.spacings_beside * grid.spacing_rad, select(0.0, near[i].reach, parts > 0u));
        for (var four = 0u; four < 2u; four++) {
            let is_near = chords_squared(directions[four], near[i].direction) < vec4(reach * reach);
            steep[four] = select(steep[four], vec4(1.0), is_near);
        }
        i += parts;
    }
    for (var i = 0u; i < min(8u, grid.rows - first_row); i++) {
        let four = i / 4u;
        let one = i % 4u;
        let scattered = vec3(light.red[four][one], light.green[four][one], light.blue[four][one]);
        grid_points[grid.first + (first_row + i) * grid.columns + place.x] = vec4(parameters.fraction * scattered, steep[four][one]);
    }
}

// Adds the smooth lights of a frame at each point of a grid. Also finds the inverse of the solid angle of a pixel at the point, and the point's place
// in the pictures of the sky.

#import constants/frame_lists
#import constants/plain_blocks
#import constants/workgroups
#import shared/air_mass
#import shared/projection
#import shared/refraction
#import shared/sky_place
#import shared/viewport
#import structs/PlainGrid
#import structs/PlainParameters

@group(0) @binding(0) var<uniform> parameters: PlainParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;
@group(0) @binding(3) var<storage, read_write> grid_points: array<vec4<f32>>;

// Returns the light of one part at a point; 0 if the frame does not have this part.
fn part_at(first: u32, point: u32) -> vec3<f32> {
    if first == NO_POINTS {
        return vec3(0.0);
    }
    return grid_points[first + point].xyz;
}

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn gather_light(@builtin(global_invocation_id) place: vec3<u32>) {
    let grid = plain_grids[place.z];
    if place.x >= grid.columns || place.y >= grid.rows || grid.first == NO_POINTS {
        return;
    }
    let point = place.y * grid.columns + place.x;
    let light = part_at(grid.veil, point) + part_at(grid.air, point) + part_at(grid.diffuse, point) + part_at(grid.near, point);
    // The point is the corner of four pixels. Their mean is accurate to second order.
    let viewport = viewports[place.z];
    let corner = vec2<i32>(place.xy * grid.spacing);
    var solid_angles = 0.0;
    var least = 1.0;
    for (var i = 0; i < turns(viewport, 4); i++) {
        let own = solid_angle(viewport, corner - vec2(i & 1, i >> 1u));
        solid_angles += own;
        least = min(least, own);
    }
    // 0: a pixel at the point is outside of the picture.
    let inverse = select(0.0, 4.0 / max(solid_angles, 1e-30), least > 0.0);
    grid_points[grid.first + point] = vec4(light, inverse);
    // Place in the pictures of the sky, and share of their light that passes the air.
    if grid.rough != NO_POINTS || parameters.reads_faint_map != 0u {
        let towards = normalize(world_direction(viewport, direction_of_point(viewport, vec2<f32>(corner))));
        var arriving = towards;
        var passed = vec3(1.0);
        if parameters.air.present != 0u {
            arriving = arriving_from(parameters.air, towards);
            passed = through_air(parameters.air, towards);
        }
        let direction = picture_direction(arriving);
        grid_points[grid.sky + 2u * point] = vec4(direction.offset, f32(direction.number), 0.0);
        grid_points[grid.sky + 2u * point + 1u] = vec4(passed, 0.0);
    }
}

// Evaluates diffuse light, attenuated by air, at the points of a grid over each picture. Also marks whether the light
// of the cell to the right and below is too rough for interpolation between its points.

#import constants/diffuse
#import constants/frame_lists
#import constants/rec709
#import constants/workgroups
#import shared/air_mass
#import shared/diffuse_light
#import shared/point_grid
#import shared/projection
#import shared/refraction
#import shared/viewport
#import structs/DiffusePointParameters

@group(0) @binding(0) var<uniform> parameters: DiffusePointParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
@group(0) @binding(3) var<storage, read> diffuse_texels: array<u32>;
// Roughness per block of texels: crates/sky/src/catalogue/diffuse.rs.
@group(0) @binding(4) var<storage, read> roughness: array<f32>;
@group(0) @binding(5) var<storage, read_write> grid_points: array<vec4<f32>>;

// Each point states how often the spacing must be halved, at most three times, until the light of the cell to the right and below is smooth. If only
// the extinction of low air is rough, the value of the point is IS_LOW.
const IS_LOW: f32 = 0.5;
// Sine of the altitude of a cell's corner below which the extinction in the cell is too curved for interpolation.
const LEAST_SINE: f32 = 0.12;

@compute @workgroup_size(VEIL_SIDE, VEIL_SIDE)
fn place_diffuse(@builtin(global_invocation_id) place: vec3<u32>) {
    let grid = point_grids[place.z];
    if place.x >= grid.columns || place.y >= grid.rows {
        return;
    }
    let viewport = viewports[place.z];
    let towards = normalize(world_direction(viewport, direction_of_point(viewport, vec2<f32>(place.xy * grid.spacing))));
    var arriving = towards;
    var passed = vec3(1.0);
    if parameters.air.present != 0u {
        arriving = arriving_from(parameters.air, towards);
        passed = through_air(parameters.air, towards);
    }
    let direction = picture_direction(arriving);
    let rough = passed * luminance_beyond(parameters.light, arriving, direction);
    let light = rough + passed * zodiacal_luminance(parameters.light, arriving);
    let is_low = parameters.air.present != 0u && dot(towards, parameters.air.zenith) < LEAST_SINE;
    var why = select(0.0, IS_LOW, is_low);
    // The roughness of a block includes its surroundings, up to the extent of a cell from its corner. The zodiacal light is smooth everywhere.
    let map = parameters.light.map;
    if map.side > 0u {
        let texel = vec2<u32>(max(0.5 * f32(map.side) + direction.offset * map.texels_per_rad, vec2(0.0)));
        let blocks = (map.side + ROUGHNESS_BLOCK - 1u) / ROUGHNESS_BLOCK;
        let block = min(texel / ROUGHNESS_BLOCK, vec2(blocks - 1u));
        let of_block = roughness[(direction.number * blocks + block.y) * blocks + block.x];
        let most_rough = parameters.most_rough + parameters.most_rough_per_cd_m2 * dot(light, LUMINANCE_WEIGHTS);
        // Roughness grows with the square of the distance.
        let own = of_block * grid.spacing_rad * grid.spacing_rad;
        let exceeds = select(vec3(1.0), vec3(0.0), vec3(own) <= vec3(1.0, 4.0, 16.0) * most_rough);
        why = max(why, exceeds.x + exceeds.y + exceeds.z);
    }
    let point = grid.first + place.y * grid.columns + place.x;
    if parameters.rough_points > 0u {
        grid_points[point + parameters.rough_points] = vec4(rough, 0.0);
    }
    grid_points[point] = vec4(light, why);
}

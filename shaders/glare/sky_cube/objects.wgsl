// Glare of surfaces in display images whose veil is in their sums of light: removes the scattered part of the light of
// surfaces, and adds the light scattered by bodies. This is done per pixel as in shaders/glare/composite.wgsl, since
// the veil of a bright body is too curved for the grid of points used for the rest.

#import constants/frame_lists
#import constants/glare_composite
#import constants/pixel_grid
#import glare/light8
#import glare/sky_cube/columns
#import glare/sky_cube/near
#import shared/viewport
#import structs/ObjectGlareParameters

@group(0) @binding(0) var<uniform> parameters: ObjectGlareParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
// See shared/cover.wgsl.
@group(0) @binding(3) var<storage, read_write> geometry: array<vec4<u32>>;
@group(1) @binding(0) var<uniform> sky: SkyCubeParameters;
@group(1) @binding(1) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(1) @binding(2) var<storage, read> near: array<GlareNear>;
@group(1) @binding(3) var<storage, read> kernel_table: array<f32>;

// Runs of ROWS rows per workgroup, with one invocation per column.
override ROW_GROUPS: u32;

@compute @workgroup_size(BLOCK_COLUMNS, ROW_GROUPS)
fn scatter_objects(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * BLOCK_COLUMNS + local.x;
    let row_group = group.y * ROW_GROUPS + local.y;
    let end_row = min(tile.rows, (row_group + 1u) * ROWS);
    if x >= viewport.size.x || row_group * ROWS >= tile.rows {
        return;
    }
    let view = views[tile.viewport];
    for (var first_row = row_group * ROWS; first_row < end_row; first_row += 8u) {
        var light: Light8;
        if view.near_count > 0u {
            let top = vec2<f32>(vec2(x, tile.first_row + first_row)) + 0.5;
            let directions = array<Directions4, 2>(
                directions_of(viewport, top), directions_of(viewport, top + vec2(0.0, 4.0)));
            add_near(&light, view, directions);
        }
        for (var i = 0u; i < min(8u, end_row - first_row); i++) {
            let index = tile.first_pixel + (first_row + i) * viewport.size.x + x;
            let before = geometry[index];
            let four = i / 4u;
            let one = i % 4u;
            var luminance = parameters.fraction * vec3(light.red[four][one], light.green[four][one], light.blue[four][one]);
            if parameters.fraction < 1.0 {
                luminance += (1.0 - parameters.fraction) * bitcast<vec3<f32>>(before.xyz);
            }
            geometry[index] = vec4(bitcast<vec3<u32>>(luminance), before.w);
        }
    }
}

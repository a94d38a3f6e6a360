// Glare of surfaces in display images whose veil is in their sums of light: removes the scattered part of the light of surfaces, and adds the light
// scattered by bodies. Next to a source the glare is computed per pixel as in shaders/glare/composite.wgsl, since the veil of a bright body is too
// curved there for a grid of points.

#import constants/frame_lists
#import constants/pixel_grid
#import glare/light8
#import glare/sky_cube/columns
#import glare/sky_cube/near
#import shared/plain_block
#import shared/point_grid
#import shared/viewport
#import structs/ObjectGlareParameters

@group(0) @binding(0) var<uniform> parameters: ObjectGlareParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
// See shared/cover.wgsl.
@group(0) @binding(3) var<storage, read_write> geometry: array<vec4<u32>>;
// Flags of plain blocks: see shared/plain_block.wgsl.
@group(0) @binding(4) var<storage, read> counters: array<u32>;
@group(0) @binding(5) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;
// The light that bodies scatter, at the points of the grids.
@group(0) @binding(6) var<storage, read> grid_points: array<vec4<f32>>;
@group(1) @binding(0) var<uniform> sky: SkyCubeParameters;
@group(1) @binding(1) var<uniform> views: array<GlareView, MAX_VIEWPORTS>;
@group(1) @binding(2) var<storage, read> near: array<GlareNear>;
@group(1) @binding(3) var<storage, read> kernel_table: array<f32>;

// Runs of ROWS rows per workgroup, with one invocation per column.
override ROW_GROUPS: u32;

// Removes the scattered fraction of a pixel's own light, and adds the light that is scattered towards the pixel.
fn scatter_in_pixel(index: u32, scattered: vec3<f32>) {
    let before = geometry[index];
    if all(before.xyz == vec3(0u)) && all(scattered == vec3(0.0)) {
        return;
    }
    var luminance = scattered;
    if parameters.fraction < 1.0 {
        luminance += (1.0 - parameters.fraction) * bitcast<vec3<f32>>(before.xyz);
    }
    geometry[index] = vec4(bitcast<vec3<u32>>(luminance), before.w);
}

// Interpolates the scattered light of a run of pixels between the points of the grid. `run`: column, first row in the tile, and
// number of rows.
fn scatter_from_grid(viewport: Viewport, tile: Tile, run: vec3<u32>) {
    let plain = plain_grids[tile.viewport];
    var grid: PointGrid;
    grid.first = plain.near;
    grid.columns = plain.columns;
    grid.spacing = plain.spacing;
    grid.spacing_log2 = plain.spacing_log2;
    var column = grid_column(grid, run.x);
    for (var i = 0u; i < run.z; i++) {
        let index = tile.first_pixel + (run.y + i) * viewport.size.x + run.x;
        scatter_in_pixel(index, grid_in_row(&column, tile.first_row + run.y + i));
    }
}

// Computes the scattered light of a run of pixels.
fn scatter_in_run(viewport: Viewport, view: GlareView, tile: Tile, run: vec3<u32>) {
    var light: Light8;
    if view.near_count > 0u {
        let top = vec2<f32>(vec2(run.x, tile.first_row + run.y)) + 0.5;
        let directions = array<Directions4, 2>(
            directions_of(viewport, top), directions_of(viewport, top + vec2(0.0, 4.0)));
        add_near(&light, view, directions);
    }
    for (var i = 0u; i < run.z; i++) {
        let index = tile.first_pixel + (run.y + i) * viewport.size.x + run.x;
        let four = i / 4u;
        let one = i % 4u;
        let scattered = vec3(light.red[four][one], light.green[four][one], light.blue[four][one]);
        scatter_in_pixel(index, parameters.fraction * scattered);
    }
}

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
        // The grid of plain blocks already contains their light.
        let flags = block_flags(tile.viewport, vec2(x, tile.first_row + first_row));
        let run = vec3(x, first_row, min(8u, end_row - first_row));
        if (flags & BLOCK_HAS_SMOOTH_GLARE) != 0u {
            scatter_from_grid(viewport, tile, run);
        } else if (flags & BLOCK_IS_MIXED) != 0u {
            scatter_in_run(viewport, view, tile, run);
        }
    }
}

// The resolve pass: converts sums of illuminance to luminance. Each pixel's fixed-point sum, in units of `lx_per_unit`, is divided by the pixel's
// solid angle. If HDR output is requested, R, G, B in cd/m^2 and the solid angle in sr replace the sums; if the exposure is known, the display image
// is also written. The pixel's illuminance (luminance times solid angle) is summed for the exposure.

#import constants/frame_lists
#import constants/pixel_grid
#import constants/rec709
#import decode = display/decode_u32 | display/decode_u64
#import display/encode
#import faint = display/faint_map | display/faint_map_off
#import shared/air_mass
#import shared/cover
#import shared/diffuse_light
#import shared/pixel_grid
#import shared/plain_block
#import shared/projection
#import shared/refraction
#import shared/point_grid
#import shared/sky_cell
#import shared/viewport
#import shown = display/shown | display/shown_off
#import structs/ResolveParameters

@group(0) @binding(0) var<uniform> parameters: ResolveParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(4) var<storage, read_write> partial_sums: array<vec2<f32>>;

// Surfaces of bodies and asteroids: see shared/cover.wgsl.
@group(0) @binding(10) var<storage, read> geometry: array<vec4<u32>>;

// Smooth part of scattered light.
@group(0) @binding(11) var<uniform> point_grids: array<PointGrid, MAX_VIEWPORTS>;
// Points of all grids. The points of diffuse light, which is attenuated by the air, also state whether the cell to the right and below is rough:
// shaders/diffuse/points.wgsl.
@group(0) @binding(12) var<storage, read> grid_points: array<vec4<f32>>;

// Diffuse light.
@group(0) @binding(14) var<storage, read> diffuse_texels: array<u32>;
@group(0) @binding(15) var<uniform> diffuse_grids: array<PointGrid, MAX_VIEWPORTS>;

// Grids of plain blocks: see shared/plain_block.wgsl.
@group(0) @binding(16) var<uniform> plain_grids: array<PlainGrid, MAX_VIEWPORTS>;

override WRITE_HDR: bool = true;
override WRITE_DISPLAY: bool = false;
// Whether dark pixels are written with their solid angle, for HDR images that are read back. Otherwise they keep their
// zero sums, which mark them as dark: see shared/pixel_grid.wgsl.
override WRITE_DARK: bool = true;
// Whether the scene has surfaces in addition to stars.
override HAS_GEOMETRY: bool = false;
// Whether the smooth part of scattered light is added; the rest is part of the sums.
override HAS_VEIL: bool = false;
// Whether the map of faint light is added.
override HAS_SKY: bool = false;
// Whether the camera is in air.
override HAS_AIR: bool = false;

// Values of a column of pixels between two rows of grid points.
struct DiffuseCell {
    // Index of the row of points above; negative: no values.
    held: f32,
    is_rough: bool,
    top: vec3<f32>,
    bottom: vec3<f32>,
}

fn diffuse_cell(grid: PointGrid, x: u32, above: f32) -> DiffuseCell {
    let left = x >> grid.spacing_log2;
    let share = (f32(x - left * grid.spacing) + 0.5) / f32(grid.spacing);
    let first = grid.first + u32(above) * grid.columns + left;
    let corner = grid_points[first];
    let below = first + grid.columns;
    return DiffuseCell(
        above,
        corner.w > 0.0,
        mix(corner.xyz, grid_points[first + 1u].xyz, share),
        mix(grid_points[below].xyz, grid_points[below + 1u].xyz, share));
}

// Returns the light from behind the surfaces and the air of a pixel, read in the pixel's own direction.
fn light_behind(viewport: Viewport, pixel: vec2<u32>, reads_diffuse: bool) -> vec3<f32> {
    let in_view = direction_of_pixel(viewport, vec2<i32>(pixel));
    let towards = normalize(world_direction(viewport, in_view));
    var arriving = towards;
    var passed = vec3(1.0);
    if HAS_AIR {
        arriving = arriving_from(parameters.air, towards);
        passed = through_air(parameters.air, towards);
    }
    let direction = picture_direction(arriving);
    var behind = vec3(0.0);
    if HAS_SKY {
        behind += faint_luminance(viewport, in_view, direction);
    }
    if reads_diffuse {
        behind += diffuse_luminance(parameters.diffuse, arriving, direction);
    }
    return passed * behind;
}

// Returns the values of a column of pixels, between the points of a row of a grid. `first`: index of the first point of the block. Its points are
// `stride` entries apart. The block has one cell, or two if it `is_halved`.
fn block_points(first: u32, stride: u32, is_halved: bool, is_second: bool, share: f32) -> vec4<f32> {
    var value = mix(grid_points[first], grid_points[first + stride], share);
    if is_halved {
        value = select(value, mix(grid_points[first + stride], grid_points[first + 2u * stride], share), is_second);
    }
    return value;
}

// Returns where the cell of an invocation is in the map of faint light. `entry`: entry of the first cell of the block's row. If the block
// `is_halved`, it has a second cell next to this one.
fn block_cell(entry: u32, is_second: bool, is_halved: bool) -> SkyCell {
    var cell = sky_cell(entry);
    if is_halved {
        let second = sky_cell(entry + SKY_CELL_ENTRIES);
        cell.first = select(cell.first, second.first, is_second);
        cell.width = select(cell.width, second.width, is_second);
        cell.top = select(cell.top, second.top, is_second);
        cell.bottom = select(cell.bottom, second.bottom, is_second);
    }
    return cell;
}

// Writes the light and the display value of a pixel, inside or outside a plain block.
fn write(index: u32, luminance: vec4<f32>, word: u32) {
    if WRITE_HDR {
        store_luminance(index, luminance);
    }
    if WRITE_DISPLAY {
        show(index, word);
    }
}

// Returns the illuminance of a pixel's stars, lx.
fn starlight(index: u32, high: bool) -> vec3<f32> {
    var illuminance = sums(index, high) * parameters.lx_per_unit;
    if parameters.lx_per_bright_unit > 0.0 {
        illuminance += bright_sums(index) * parameters.lx_per_bright_unit;
    }
    return illuminance;
}

// Number of runs of ROWS rows per workgroup, with one invocation per column. A full wave is fastest on a GPU, one SIMD step on a software driver.
override ROW_GROUPS: u32 = 1u;
// Number of runs per invocation. A software driver spends a microsecond on each workgroup.
override RUNS: u32 = 1u;

@compute @workgroup_size(BLOCK_COLUMNS, ROW_GROUPS)
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * BLOCK_COLUMNS + local.x;
    if x >= viewport.size.x {
        return;
    }
    let first_run = (group.y * ROW_GROUPS + local.y) * RUNS;
    let end_run = min(first_run + RUNS, (tile.rows + ROWS - 1u) / ROWS);
    for (var run = first_run; run < end_run; run++) {
        resolve_run(tile, viewport, group, local.x, run);
    }
}

// Resolves a run of ROWS rows of one column.
fn resolve_run(tile: Tile, viewport: Viewport, group: vec3<u32>, local: u32, row_group: u32) {
    let x = group.x * BLOCK_COLUMNS + local;
    // One flag covers a block of COLUMNS by ROWS pixels.
    let columns = (viewport.size.x + COLUMNS - 1u) / COLUMNS;
    let high = has_high_words(tile.first_flag + row_group * columns + group.x * BLOCK_COLUMNS / COLUMNS);
    var sum = 0.0;
    var veil: GridColumn;
    if HAS_VEIL {
        veil = grid_column(point_grids[tile.viewport], x);
    }
    // A map side of 0 means that there is no diffuse light. This is a run-time value because shaders are created before the stars are loaded.
    let has_diffuse = parameters.diffuse.map.side > 0u || parameters.diffuse.zodiacal.side > 0u;
    let reads_points = parameters.diffuse_is_smooth != 0u;
    var diffuse_grid: PointGrid;
    diffuse_grid.spacing = 1u;
    if reads_points {
        diffuse_grid = diffuse_grids[tile.viewport];
    }
    var cell: DiffuseCell;
    cell.held = -1.0;
    let plain_grid = plain_grids[tile.viewport];
    let end_row = min(tile.rows, (row_group + 1u) * ROWS);
    for (var first_row = row_group * ROWS; first_row < end_row; first_row += PLAIN_BLOCK) {
        let end_block = min(end_row, first_row + PLAIN_BLOCK);
        let flags = block_flags(tile.viewport, vec2(group.x * BLOCK_COLUMNS, tile.first_row + first_row));
        if (flags & BLOCK_IS_OUTSIDE) != 0u {
            for (var row = first_row; row < end_block; row++) {
                write(tile.first_pixel + row * viewport.size.x + x, vec4(0.0), BLACK);
            }
            continue;
        }
        if (flags & BLOCK_IS_MIXED) == 0u {
            // Draws stars in front of light that is interpolated between the points of one grid. A block has one or two cells along each side. All
            // addresses of points are the same for the whole workgroup.
            let halvings = flags >> BLOCK_HALVINGS_SHIFT;
            let is_rough = halvings > 0u;
            let spacing = plain_grid.spacing;
            let is_second = local >= spacing;
            let share = (f32(select(local, local - spacing, is_second)) + 0.5) / f32(spacing);
            let step = 1.0 / f32(spacing);
            let is_halved = spacing < BLOCK_COLUMNS;
            for (var cell_row = first_row; cell_row < end_block; cell_row += spacing) {
                let corner = vec2(group.x * BLOCK_COLUMNS, tile.first_row + cell_row) >> vec2(plain_grid.spacing_log2);
                let point = corner.y * plain_grid.columns + corner.x;
                let below = plain_grid.columns;
                var top = block_points(plain_grid.first + point, 1u, is_halved, is_second, share);
                var bottom = block_points(plain_grid.first + point + below, 1u, is_halved, is_second, share);
                // Number of rows between two places at which the map of diffuse light is read.
                let rough_rows = max(spacing >> halvings, 1u);
                var rough = vec3(0.0);
                var rough_slope = vec3(0.0);
                // Places in the maps of the sky.
                var place = vec2(0.0);
                var place_slope = vec2(0.0);
                var passed = vec3(1.0);
                var passed_slope = vec3(0.0);
                var number = 0u;
                var faint: SkyCell;
                var faint_at = vec2(0.0);
                var faint_slope = vec2(0.0);
                if HAS_SKY || is_rough {
                    let sky = plain_grid.sky + 2u * point;
                    if HAS_AIR {
                        let passed_top = block_points(sky + 1u, 2u, is_halved, is_second, share).xyz;
                        let passed_bottom = block_points(sky + 2u * below + 1u, 2u, is_halved, is_second, share).xyz;
                        passed_slope = (passed_bottom - passed_top) * step;
                        passed = passed_top + 0.5 * passed_slope;
                    }
                    if HAS_SKY {
                        faint = block_cell(plain_grid.faint + SKY_CELL_ENTRIES * point, is_second, is_halved);
                        let faint_top = mix(faint.top.xy, faint.top.zw, share);
                        faint_slope = (mix(faint.bottom.xy, faint.bottom.zw, share) - faint_top) * step;
                        faint_at = faint_top + 0.5 * faint_slope;
                    }
                    if is_rough {
                        let place_top = block_points(sky, 2u, is_halved, is_second, share);
                        let place_bottom = block_points(sky + 2u * below, 2u, is_halved, is_second, share);
                        number = u32(grid_points[sky].z);
                        place_slope = (place_bottom.xy - place_top.xy) * step;
                        place = place_top.xy + 0.5 * place_slope;
                        // The map is read instead of the grid.
                        let points = plain_grid.rough + point;
                        top -= block_points(points, 1u, is_halved, is_second, share);
                        bottom -= block_points(points + below, 1u, is_halved, is_second, share);
                        rough = map_luminance(parameters.diffuse.map, 0u, PictureDirection(number, place));
                    }
                }
                let slope = (bottom - top) * step;
                var smooth_light = top + 0.5 * slope;
                var cell_sum = 0.0;
                for (var row = cell_row; row < min(end_block, cell_row + spacing); row++) {
                    let index = tile.first_pixel + row * viewport.size.x + x;
                    var luminance = starlight(index, high) * smooth_light.w + smooth_light.xyz;
                    if HAS_SKY {
                        luminance += passed * faint_light(faint.first, faint.width, faint_at);
                    }
                    if is_rough {
                        if ((row - cell_row) & (rough_rows - 1u)) == 0u {
                            let ahead = place + f32(rough_rows) * place_slope;
                            let next = map_luminance(parameters.diffuse.map, 0u, PictureDirection(number, ahead));
                            rough_slope = (next - rough) / f32(rough_rows);
                        }
                        luminance += passed * rough;
                        rough += rough_slope;
                    }
                    cell_sum += dot(luminance, LUMINANCE_WEIGHTS);
                    var word = BLACK;
                    if WRITE_DISPLAY {
                        word = display_word(luminance, parameters.display_per_cd_m2, parameters.shown, x, tile.first_row + row);
                    }
                    write(index, vec4(luminance, 1.0 / smooth_light.w), word);
                    smooth_light += slope;
                    place += place_slope;
                    faint_at += faint_slope;
                    passed += passed_slope;
                }
                sum += cell_sum * 2.0 / (top.w + bottom.w);
            }
            continue;
        }
        for (var row = first_row; row < end_block; row++) {
            let index = tile.first_pixel + row * viewport.size.x + x;
            let image_row = tile.first_row + row;
            let illuminance = starlight(index, high);
            var surface_light = vec3(0.0);
            var free = 1.0;
            if HAS_GEOMETRY {
                let before = geometry[index];
                surface_light = bitcast<vec3<f32>>(before.xyz);
                free = 1.0 - coverage_of(before.w);
            }
            var scattered = vec3(0.0);
            if HAS_VEIL {
                scattered = grid_in_row(&veil, image_row);
            }
            let lit = HAS_VEIL || HAS_SKY || has_diffuse || any(illuminance > vec3(0.0)) || any(surface_light > vec3(0.0));
            if !(lit || WRITE_DARK || WRITE_DISPLAY) {
                continue;
            }
            var luminance = vec4(0.0);
            if lit || (WRITE_HDR && WRITE_DARK) {
                luminance.w = solid_angle(viewport, vec2(i32(x), i32(image_row)));
            }
            if lit && luminance.w > 0.0 {
                var surface = surface_light + scattered;
                var reads_diffuse = has_diffuse;
                if reads_points {
                    let grid_row = (f32(image_row) + 0.5) / f32(diffuse_grid.spacing);
                    let above = floor(grid_row);
                    if above != cell.held {
                        cell = diffuse_cell(diffuse_grid, x, above);
                    }
                    if !cell.is_rough {
                        reads_diffuse = false;
                        surface += free * mix(cell.top, cell.bottom, grid_row - above);
                    }
                }
                if HAS_SKY || reads_diffuse {
                    surface += free * light_behind(viewport, vec2(x, image_row), reads_diffuse);
                }
                sum += dot(illuminance + surface * luminance.w, LUMINANCE_WEIGHTS);
                luminance = vec4(illuminance * (1.0 / luminance.w) + surface, luminance.w);
            }
            if WRITE_HDR && (lit || WRITE_DARK) {
                store_luminance(index, luminance);
            }
            if WRITE_DISPLAY {
                var word = BLACK;
                if lit {
                    word = display_word(luminance.xyz, parameters.display_per_cd_m2, parameters.shown, x, image_row);
                }
                show(index, word);
            }
        }
    }
    // Sums are integers times a unit, so no pixel is non-finite or excluded.
    partial_sums[tile.first_partial + row_group * viewport.size.x + x] = vec2(sum, 0.0);
}

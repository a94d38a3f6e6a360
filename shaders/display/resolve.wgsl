// The resolve pass: converts sums of illuminance to luminance. Each pixel's fixed-point sum, in units of `lx_per_unit`,
// is divided by the pixel's solid angle. If HDR output is requested, R, G, B in cd/m^2 and the solid angle in sr
// replace the sums; if the exposure is known, the display image is written too. The pixel's illuminance (luminance
// times solid angle) is summed for the exposure.

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
#import shared/projection
#import shared/refraction
#import shared/point_grid
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
// Points of all grids. Those of diffuse light, after extinction, also say whether the cell to the right and below is
// rough: shaders/diffuse/points.wgsl.
@group(0) @binding(12) var<storage, read> grid_points: array<vec4<f32>>;

// Diffuse light.
@group(0) @binding(14) var<storage, read> diffuse_texels: array<u32>;
@group(0) @binding(15) var<uniform> diffuse_grids: array<PointGrid, MAX_VIEWPORTS>;

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
    let left = x / grid.spacing;
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

@compute @workgroup_size(COLUMNS)
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * COLUMNS + local;
    if x >= viewport.size.x || group.y * ROWS >= tile.rows {
        return;
    }
    // One flag for the block of this workgroup.
    let columns = (viewport.size.x + COLUMNS - 1u) / COLUMNS;
    let high = has_high_words(tile.first_flag + group.y * columns + group.x);
    var sum = 0.0;
    var veil: GridColumn;
    if HAS_VEIL {
        veil = grid_column(point_grids[tile.viewport], x);
    }
    // A map side of 0 means no diffuse light. This is a run-time value because shaders are created before the stars are
    // loaded.
    let has_diffuse = parameters.diffuse.map.side > 0u || parameters.diffuse.zodiacal.side > 0u;
    let reads_points = parameters.diffuse_is_smooth != 0u;
    var diffuse_grid = PointGrid(0u, 0u, 0u, 1u);
    if reads_points {
        diffuse_grid = diffuse_grids[tile.viewport];
    }
    var cell: DiffuseCell;
    cell.held = -1.0;
    let end_row = min(tile.rows, (group.y + 1u) * ROWS);
    for (var row = group.y * ROWS; row < end_row; row++) {
        let index = tile.first_pixel + row * viewport.size.x + x;
        let image_row = tile.first_row + row;
        var illuminance = sums(index, high) * parameters.lx_per_unit;
        if parameters.lx_per_bright_unit > 0.0 {
            illuminance += bright_sums(index) * parameters.lx_per_bright_unit;
        }
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
                let in_view = direction_of_point(viewport, vec2(f32(x), f32(image_row)) + 0.5);
                let towards = normalize(world_direction(viewport, in_view));
                var arriving = towards;
                var passed = vec3(free);
                if HAS_AIR {
                    arriving = arriving_from(parameters.air, towards);
                    passed *= through_air(parameters.air, towards);
                }
                let direction = picture_direction(arriving);
                var behind = vec3(0.0);
                if HAS_SKY {
                    behind += faint_light(direction);
                }
                if reads_diffuse {
                    behind += diffuse_luminance(parameters.diffuse, arriving, direction);
                }
                surface += passed * behind;
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
    // Sums are integers times a unit, so no pixel is non-finite or excluded.
    partial_sums[tile.first_partial + group.y * viewport.size.x + x] = vec2(sum, 0.0);
}

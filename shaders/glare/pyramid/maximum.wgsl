// Finds the brightest channel in the pictures of a batch, as the bits of the number. The bits of non-negative numbers have the same order as the
// numbers, so an atomic maximum works on them. It does not depend on the order of the threads.

#import constants/frame_lists
#import constants/pixel_grid
#import shared/pixel_grid
#import shared/viewport
#import structs/GlareMaximumParameters

@group(0) @binding(0) var<uniform> parameters: GlareMaximumParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read> pixels: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> maximum: array<atomic<u32>>;

var<workgroup> group_maximum: atomic<u32>;

@compute @workgroup_size(COLUMNS)
fn find_maximum(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&group_maximum, 0u);
    }
    workgroupBarrier();
    let tile = tiles[group.z];
    let width = viewports[tile.viewport].size.x;
    let x = group.x * COLUMNS + local;
    var greatest = 0.0;
    if x < width {
        let end_row = min(tile.rows, (group.y + 1u) * ROWS);
        for (var row = group.y * ROWS; row < end_row; row++) {
            let index = tile.first_pixel + row * width + x;
            let blue_omega = pixels[parameters.plane_pixels + index];
            let brightest = max(blue_omega.x, max(pixels[index].x, pixels[index].y));
            // Non-finite pixels cause no glare.
            if blue_omega.y > 0.0 && brightest < 3e38 {
                greatest = max(greatest, brightest);
            }
        }
    }
    atomicMax(&group_maximum, bitcast<u32>(greatest));
    workgroupBarrier();
    if local == 0u {
        atomicMax(&maximum[0], atomicLoad(&group_maximum));
    }
}

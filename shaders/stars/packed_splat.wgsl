// The published splat: it lights four pixels, each with luminance and temperature as two half floats in one word. A word is updated by
// compare-exchange, repeated until no other thread has interfered.

#import constants/counters
#import constants/frame_lists
#import shared/projection
#import shared/viewport
#import stars/triangle_solid_angle

@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> packed: array<atomic<u32>>;

// Greatest half float.
const MOST: f32 = 65504.0;

// Adds luminance (cd/m^2) to a pixel. The pixel's temperature (K) becomes the mean of the old and the new one, weighted by luminance.
fn add_packed(pixel: u32, luminance: f32, temperature: f32) {
    var old = atomicLoad(&packed[pixel]);
    loop {
        let before = unpack2x16float(old);
        let sum = before.x + luminance;
        var mixed = temperature;
        if sum > 0.0 {
            mixed = (before.x * before.y + luminance * temperature) / sum;
        }
        // WGSL does not define the result beyond the range of half floats, so the values are clamped.
        let word = pack2x16float(min(vec2(sum, mixed), vec2(MOST)));
        let result = atomicCompareExchangeWeak(&packed[pixel], old, word);
        if result.exchanged {
            break;
        }
        old = result.old_value;
    }
}

// Splats a star of `illuminance` (lx) into one tile.
fn splat_packed(tile: Tile, viewport: Viewport, direction: vec3<f32>, illuminance: f32, temperature: f32) {
    let projected = pixel_from_direction(viewport, direction);
    let size = vec2<i32>(viewport.size);
    let own = vec2<i32>(floor(projected.xy));
    if projected.z == 0.0 || any(projected.xy < vec2(0.0)) || any(own >= size) {
        return;
    }
    let first_row = i32(tile.first_row);
    let end_row = first_row + i32(tile.rows);
    if own.y < first_row - 1 || own.y > end_row || !contains(viewport, own) {
        return;
    }
    // All four pixels get the luminance that the star's own pixel would get, times their weight, regardless of their
    // own solid angle.
    let luminance = illuminance / pixel_of_triangles(viewport, own);
    let first = floor(projected.xy - 0.5);
    let part = projected.xy - 0.5 - first;
    for (var j = 0; j < 2; j++) {
        for (var i = 0; i < 2; i++) {
            let position = vec2<i32>(first) + vec2(i, j);
            let weight = select(1.0 - part.x, part.x, i == 1) * select(1.0 - part.y, part.y, j == 1);
            if all(position >= vec2(0, first_row)) && all(position < vec2(size.x, end_row)) {
                add_packed(tile.first_pixel + u32((position.y - first_row) * size.x + position.x), luminance * weight, temperature);
            }
        }
    }
    if own.y >= first_row && own.y < end_row {
        atomicAdd(&counters[FIRST_VIEW_COUNTER + viewport.view], 1u);
    }
}

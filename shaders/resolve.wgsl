// The resolve pass: sums of illuminance become luminance. Each pixel's fixed-point sum, in units of `lx_per_unit`, is
// divided by the pixel's solid angle and written in place as R, G, B in cd/m^2 and the solid angle in sr. The pixel's
// illuminance, which is its luminance times its solid angle, is summed for the exposure.
// Needs viewport.wgsl, math.wgsl, projection.wgsl and one of decode_*.wgsl.

struct ResolveParameters {
    lx_per_unit: f32,
    // The same for the sums of the few stars that outshine the rest; 0 if there are none.
    lx_per_bright_unit: f32,
    unused_0: u32,
    unused_1: u32,
}

@group(0) @binding(0) var<uniform> parameters: ResolveParameters;
@group(0) @binding(1) var<storage, read> viewports: array<Viewport>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> pixels: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> partial_sums: array<f32>;
@group(0) @binding(5) var<storage, read> bright_pixels: array<vec4<u32>>;

const COLUMNS: u32 = 64u;
const ROWS: u32 = 16u;

@compute @workgroup_size(COLUMNS)
fn resolve(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let tile = tiles[group.z];
    let viewport = viewports[tile.viewport];
    let x = group.x * COLUMNS + local;
    if x >= viewport.size.x || group.y * ROWS >= tile.rows {
        return;
    }
    var sum = 0.0;
    for (var j = 0u; j < ROWS; j++) {
        let row = group.y * ROWS + j;
        if row >= tile.rows {
            break;
        }
        let index = tile.first_pixel + row * viewport.size.x + x;
        let omega = solid_angle(viewport, vec2(i32(x), i32(tile.first_row + row)));
        var luminance = vec3(0.0);
        if omega > 0.0 {
            let words = pixels[index];
            var illuminance = vec3(0.0);
            if any(words != vec4(0u)) {
                illuminance = decode(words) * parameters.lx_per_unit;
            }
            if parameters.lx_per_bright_unit > 0.0 {
                illuminance += decode(bright_pixels[index]) * parameters.lx_per_bright_unit;
            }
            if any(illuminance > vec3(0.0)) {
                sum += dot(illuminance, vec3(0.2126, 0.7152, 0.0722));
                luminance = illuminance / omega;
            }
        }
        pixels[index] = bitcast<vec4<u32>>(vec4(luminance, omega));
    }
    partial_sums[tile.first_partial + group.y * viewport.size.x + x] = sum;
}

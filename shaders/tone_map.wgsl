// The tone-mapping pass: luminance over display white to 8 bits, dithered. The f64 twin is src/photometry/tone_map.rs.
// Needs viewport.wgsl and math.wgsl.

struct ToneMapParameters {
    // 0: filmic, 1: sRGB.
    operator_number: u32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}

struct Exposure {
    ev100: f32,
    metered_ev100: f32,
    mean_luminance_cd_m2: f32,
    display_per_cd_m2: f32,
}

@group(0) @binding(0) var<uniform> parameters: ToneMapParameters;
@group(0) @binding(1) var<storage, read> viewports: array<Viewport>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
// R, G, B in cd/m^2 and the solid angle.
@group(0) @binding(3) var<storage, read> luminances: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> exposure: Exposure;
@group(0) @binding(5) var<storage, read_write> display: array<u32>;

const OPERATOR_FILMIC: u32 = 0u;
const COLUMNS: u32 = 64u;
const ROWS: u32 = 16u;

fn filmic(value: vec3<f32>) -> vec3<f32> {
    // Beyond 1e4 the curve is within 2e-5 of 1, and the products stay finite.
    let x = clamp(value, vec3(0.0), vec3(1e4));
    return x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06);
}

fn srgb_from_linear(value: vec3<f32>) -> vec3<f32> {
    let x = clamp(value, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3(0.0031308));
}

@compute @workgroup_size(COLUMNS)
fn tone_map(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let tile = tiles[group.z];
    let size = viewports[tile.viewport].size;
    let x = group.x * COLUMNS + local;
    if x >= size.x || group.y * ROWS >= tile.rows {
        return;
    }
    for (var j = 0u; j < ROWS; j++) {
        let row = group.y * ROWS + j;
        if row >= tile.rows {
            break;
        }
        let index = tile.first_pixel + row * size.x + x;
        let luminance = luminances[index].xyz;
        var word = 0xff000000u;
        if any(luminance > vec3(0.0)) {
            let value = luminance * exposure.display_per_cd_m2;
            var encoded = vec3(0.0);
            if parameters.operator_number == OPERATOR_FILMIC {
                encoded = filmic(value);
            } else {
                encoded = srgb_from_linear(value);
            }
            // One threshold for the three channels, from the place in the image alone: no colour noise, no flicker.
            let threshold = f32(hash(x + 65536u * (tile.first_row + row)) >> 8u) / 16777216.0;
            let bytes = vec3<u32>(min(encoded * 255.0 + threshold, vec3(255.0)));
            word |= bytes.x | (bytes.y << 8u) | (bytes.z << 16u);
        }
        display[index] = word;
    }
}

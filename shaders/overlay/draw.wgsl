// The overlay pass: draws lines and text onto display images. There is one workgroup per block of pixels with items. Each pixel loops over the items
// of its block in order. The items of one stroke are drawn as one shape: their greatest coverage is blended in linear light. Bodies and asteroids
// hide items behind them in proportion to their coverage of the pixel. The f64 twin is crates/render/src/reference/overlay/draw.rs.

#import constants/frame_lists
#import constants/overlay
#import shared/cover
#import shared/projection
#import shared/srgb
#import shared/viewport
#import structs/OverlayBlock
#import structs/OverlayItem
#import structs/OverlayParameters

const NO_STROKE: u32 = 0xffffffffu;

@group(0) @binding(0) var<uniform> parameters: OverlayParameters;
@group(0) @binding(1) var<uniform> viewports: array<Viewport, MAX_VIEWPORTS>;
@group(0) @binding(2) var<uniform> tiles: array<Tile, MAX_TILES>;
@group(0) @binding(3) var<storage, read_write> display: array<u32>;
@group(0) @binding(4) var<storage, read> geometry: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> items: array<OverlayItem>;
@group(0) @binding(6) var<storage, read> texels: array<u32>;
@group(0) @binding(7) var<storage, read> entries: array<u32>;
@group(0) @binding(8) var<storage, read> blocks: array<OverlayBlock>;

// Whether the scene has surfaces in addition to stars.
override HAS_GEOMETRY: bool = false;

// Returns the coverage of a pixel by an item, and inverse distance of the item.
fn item_coverage(item: OverlayItem, pixel: vec2<u32>) -> vec2<f32> {
    if item.shape == SHAPE_LINE {
        let along = item.end - item.begin;
        let offset = vec2<f32>(pixel) + 0.5 - item.begin;
        let part = clamp(dot(offset, along) / max(dot(along, along), 1e-30), 0.0, 1.0);
        let distance = length(offset - along * part);
        return vec2(clamp(item.half_width_px + 0.5 - distance, 0.0, 1.0), mix(item.nearness.x, item.nearness.y, part));
    }
    let corner = vec2<i32>(item.begin);
    let size = vec2<i32>(item.end) - corner;
    let within = vec2<i32>(pixel) - corner;
    if any(within < vec2(0)) || any(within >= size) {
        return vec2(0.0);
    }
    var coverage = 1.0;
    if item.shape == SHAPE_CHECKERS {
        coverage = f32(1u - ((pixel.x + pixel.y) & 1u));
    } else if item.shape == SHAPE_GLYPH {
        let texel = item.first_texel + u32(within.y * size.x + within.x);
        coverage = f32((texels[texel / 4u] >> (8u * (texel % 4u))) & 0xffu) / 255.0;
    }
    return vec2(coverage, item.nearness.x);
}

// Returns a texel of a picture: linear light times alpha, and alpha. Outside of the picture it is transparent.
fn picture_texel(first: u32, size: vec2<u32>, at: vec2<i32>) -> vec4<f32> {
    if any(at < vec2(0)) || any(at >= vec2<i32>(size)) {
        return vec4(0.0);
    }
    let word = texels[first + u32(at.y) * size.x + u32(at.x)];
    let alpha = f32(word >> 24u) / 255.0;
    return vec4(light_of(word) * alpha, alpha);
}

// Returns the value of a picture in a direction, view axes: linear light and alpha, interpolated between four texels.
fn picture_in(header: u32, direction: vec3<f32>) -> vec4<f32> {
    var along = vec3(0.0);
    for (var i = 0u; i < 3u; i++) {
        let row = header + 3u * i;
        let axis = bitcast<vec3<f32>>(vec3(texels[row], texels[row + 1u], texels[row + 2u]));
        along[i] = dot(axis, direction);
    }
    if along.z <= 0.0 {
        return vec4(0.0);
    }
    let extent = bitcast<vec2<f32>>(vec2(texels[header + 9u], texels[header + 10u]));
    let size = vec2(texels[header + 11u], texels[header + 12u]);
    let first = texels[header + 13u];
    let place = (along.xy / along.z + 0.5) * extent - 0.5;
    // Far outside the picture, the conversion to integers would overflow.
    if any(place < vec2(-1.0)) || any(place > vec2<f32>(size)) {
        return vec4(0.0);
    }
    let corner = floor(place);
    let part = place - corner;
    let at = vec2<i32>(corner);
    let top = mix(picture_texel(first, size, at), picture_texel(first, size, at + vec2(1, 0)), part.x);
    let bottom = mix(picture_texel(first, size, at + vec2(0, 1)), picture_texel(first, size, at + vec2(1, 1)), part.x);
    let sum = mix(top, bottom, part.y);
    return vec4(sum.rgb / max(sum.a, 1e-6), sum.a);
}

fn light_of(codes: u32) -> vec3<f32> {
    return linear_from_srgb(vec3<f32>(vec3(codes, codes >> 8u, codes >> 16u) & vec3(0xffu)) / 255.0);
}

@compute @workgroup_size(OVERLAY_BLOCK_PX, OVERLAY_BLOCK_PX)
fn draw_overlay(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let number = group.y * groups.x + group.x;
    if number >= parameters.blocks {
        return;
    }
    let block = blocks[number];
    let tile = tiles[block.tile];
    let viewport = viewports[tile.viewport];
    let pixel = block.corner + local.xy;
    if pixel.y < tile.first_row || pixel.y >= tile.first_row + tile.rows || !contains(viewport, vec2<i32>(pixel)) {
        return;
    }
    let index = tile.first_pixel + (pixel.y - tile.first_row) * viewport.size.x + pixel.x;
    var word = 0u;
    if HAS_GEOMETRY {
        word = geometry[index].w;
    }
    let before_m = distance_of(word);
    let open = 1.0 - coverage_of(word);

    let below = display[index];
    var light = light_of(below);
    var touched = false;
    var stroke = NO_STROKE;
    var share = 0.0;
    var ink = vec3(0.0);
    var opacity = 0.0;
    for (var i = 0u; i <= block.entries; i++) {
        var item: OverlayItem;
        item.stroke = NO_STROKE;
        if i < block.entries {
            item = items[entries[block.first_entry + i]];
        }
        if item.stroke != stroke {
            if share > 0.0 {
                light = mix(light, ink, share * opacity);
                touched = true;
            }
            stroke = item.stroke;
            ink = light_of(item.colour);
            opacity = item.opacity;
            share = 0.0;
        }
        if i < block.entries {
            var covered = item_coverage(item, pixel);
            if item.shape == SHAPE_PICTURE && covered.x > 0.0 {
                let towards = direction_from_pixel(viewport, vec2<f32>(pixel) + 0.5);
                let sample = picture_in(item.first_texel, towards.xyz);
                covered.x = sample.a * towards.w;
                ink = select(ink, sample.rgb, covered.x > 0.0);
            }
            let hidden = word != 0u && before_m * covered.y < 1.0;
            share = max(share, covered.x * select(1.0, open, hidden));
        }
    }
    if touched {
        let codes = vec3<u32>(srgb_from_linear(light) * 255.0 + 0.5);
        display[index] = (below & 0xff000000u) | codes.x | (codes.y << 8u) | (codes.z << 16u);
    }
}

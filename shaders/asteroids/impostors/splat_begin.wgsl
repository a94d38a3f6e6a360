// Initialises samples with the depth already drawn. Impostors may then be in front of it or behind it.

#import asteroids/impostors/splat_band

@group(0) @binding(0) var<uniform> band: SplatBand;
@group(0) @binding(1) var drawn: texture_depth_2d;
@group(0) @binding(2) var<storage, read_write> sample_words: array<vec2<u32>>;

@compute @workgroup_size(8, 8)
fn begin_splat(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= band.width || id.y >= band.rows {
        return;
    }
    let depth = textureLoad(drawn, vec2(id.x, id.y + band.first_row), 0);
    sample_words[place_in_blocks(id.xy, band.blocks)] = vec2(0u, bitcast<u32>(depth));
}

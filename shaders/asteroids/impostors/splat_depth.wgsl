// Writes the depth of splatted samples to the rasteriser's target. One triangle covers the band.

#import asteroids/impostors/splat_band

@group(0) @binding(0) var<uniform> band: SplatBand;
@group(0) @binding(1) var<storage, read> sample_words: array<vec2<u32>>;

@fragment
fn hand_on_depth(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let sample_position = vec2<u32>(position.xy);
    let words = sample_words[place_in_blocks(sample_position - vec2(0u, band.first_row), band.blocks)];
    if words.x == 0u {
        discard;
    }
    return bitcast<f32>(words.y);
}

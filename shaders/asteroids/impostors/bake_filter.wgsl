// Texels of a block of an atlas from its samples: means over what is covered, and the share that is.
//
// First word: mean normal, halved and moved to 0..1, and coverage, 8 bits each. Second word: albedo over its scale and
// depth, 16 bits each. Both 0 where nothing is covered.

#import constants/workgroups

struct ImpostorFilterParameters {
    // Texels along the side of the block, samples along the side of a texel.
    side: u32,
    samples: u32,
    unused_0: u32,
    unused_1: u32,
}

@group(0) @binding(0) var<uniform> parameters: ImpostorFilterParameters;
@group(0) @binding(1) var normals: texture_2d<f32>;
@group(0) @binding(2) var surfaces: texture_2d<f32>;
@group(0) @binding(3) var<storage, read_write> texels: array<vec2<u32>>;

@compute @workgroup_size(FILTER_SIDE, FILTER_SIDE)
fn filter_samples(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(parameters.side)) {
        return;
    }
    var normal = vec3(0.0);
    var surface = vec2(0.0);
    var count = 0.0;
    for (var j = 0u; j < parameters.samples; j++) {
        for (var i = 0u; i < parameters.samples; i++) {
            let at = vec2<i32>(id.xy * parameters.samples + vec2(i, j));
            let sample = textureLoad(normals, at, 0);
            if sample.w > 0.5 {
                normal += sample.xyz;
                surface += textureLoad(surfaces, at, 0).xy;
                count += 1.0;
            }
        }
    }
    var words = vec2(0u);
    if count > 0.0 {
        let coverage = count / f32(parameters.samples * parameters.samples);
        words = vec2(pack4x8unorm(vec4(0.5 * normal / count + 0.5, coverage)), pack2x16unorm(surface / count));
    }
    texels[id.y * parameters.side + id.x] = words;
}

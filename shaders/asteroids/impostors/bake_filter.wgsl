// Filters the samples of an atlas block to texels: means over covered samples, and the covered share.
//
// First word: mean normal, mapped from -1..1 to 0..1, and coverage, 8 bits each. Second word: albedo divided by its
// scale, and depth, 16 bits each. Both are 0 if no sample is covered.

#import constants/workgroups
#import structs/ImpostorFilterParameters

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
            let position = vec2<i32>(id.xy * parameters.samples + vec2(i, j));
            let sample = textureLoad(normals, position, 0);
            if sample.w > 0.5 {
                normal += sample.xyz;
                surface += textureLoad(surfaces, position, 0).xy;
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

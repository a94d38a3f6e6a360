// Same interface as asteroids/impostors/samples_u64.wgsl, with two words and two stages: in the first every sample keeps the greatest depth, in the
// second the entry with that depth. Both stages run the same code, so their depths are bit-identical.

@group(2) @binding(1) var<storage, read_write> sample_words: array<atomic<u32>>;

fn depth_there(index: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&sample_words[2u * index + 1u]));
}

fn is_own(index: u32, entry: u32) -> bool {
    return atomicLoad(&sample_words[2u * index]) == entry + 1u;
}

fn claim(index: u32, depth: u32, entry: u32, stage: u32) -> bool {
    if stage == 0u {
        return atomicMax(&sample_words[2u * index + 1u], depth) < depth;
    }
    if atomicLoad(&sample_words[2u * index + 1u]) == depth {
        atomicMax(&sample_words[2u * index], entry + 1u);
    }
    return true;
}

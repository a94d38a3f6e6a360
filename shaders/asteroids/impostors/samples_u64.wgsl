// Samples of a band: the low word is 1 + the entry that owns the sample, the high word is its depth. So one atomic operation keeps the nearest entry,
// or the later one of two entries with equal depths.

#requires u64

@group(2) @binding(1) var<storage, read_write> sample_words: array<atomic<u64>>;

fn depth_there(index: u32) -> f32 {
    return bitcast<f32>(u32(atomicLoad(&sample_words[index]) >> 32u));
}

// Whether an entry owns a sample.
fn is_own(index: u32, entry: u32) -> bool {
    return u32(atomicLoad(&sample_words[index]) & 0xfffffffflu) == entry + 1u;
}

// Assigns a sample to an entry unless a nearer entry owns it. Returns whether it did.
fn claim(index: u32, depth: u32, entry: u32, stage: u32) -> bool {
    let claimed = (u64(depth) << 32u) | u64(entry + 1u);
    return atomicMax(&sample_words[index], claimed) < claimed;
}

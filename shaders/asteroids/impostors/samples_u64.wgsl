// The samples of a band: 1 + the entry whose it is in the low word, its depth in the high one. So one atomic operation keeps the nearest, and
// of equal ones the later entry.

#requires u64

@group(2) @binding(1) var<storage, read_write> sample_words: array<atomic<u64>>;

fn depth_there(at: u32) -> f32 {
    return bitcast<f32>(u32(atomicLoad(&sample_words[at]) >> 32u));
}

// Whether a sample is an entry's own.
fn is_own(at: u32, entry: u32) -> bool {
    return u32(atomicLoad(&sample_words[at]) & 0xfffffffflu) == entry + 1u;
}

// Gives a sample to an entry if nothing nearer has it yet; whether that is so.
fn claim(at: u32, depth: u32, entry: u32, stage: u32) -> bool {
    let claimed = (u64(depth) << 32u) | u64(entry + 1u);
    return atomicMax(&sample_words[at], claimed) < claimed;
}

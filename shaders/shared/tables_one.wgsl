// The tables of all viewports, in groups of four words, in one buffer: `viewport.face` is the number of the first group of its own.

@group(3) @binding(0) var<storage, read> mapping_tables: array<vec4<u32>>;

// A group of words.
fn mapping_table(at: u32) -> vec4<u32> {
    return mapping_tables[at];
}

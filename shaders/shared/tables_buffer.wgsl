// Tables of all viewports in a buffer, in groups of four words. `viewport.face` is the index of a table's first group.

@group(3) @binding(0) var<storage, read> mapping_tables: array<vec4<u32>>;

// Returns a group of words.
fn mapping_table(index: u32) -> vec4<u32> {
    return mapping_tables[index];
}

// The same in two buffers, of which the number stands in the uppermost bit.

#import constants/tables

@group(3) @binding(0) var<storage, read> mapping_tables_0: array<vec4<u32>>;
@group(3) @binding(1) var<storage, read> mapping_tables_1: array<vec4<u32>>;

// Both are read: a branch at every place that reads makes drivers take minutes for a shader.
fn mapping_table(at: u32) -> vec4<u32> {
    let group = at & ~SECOND_TABLE_BUFFER;
    return select(mapping_tables_0[group], mapping_tables_1[group], (at & SECOND_TABLE_BUFFER) != 0u);
}

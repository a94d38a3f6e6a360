// Tables of all viewports in two buffers. The highest bit of an index selects the buffer.

#import constants/tables

@group(3) @binding(0) var<storage, read> mapping_tables_0: array<vec4<u32>>;
@group(3) @binding(1) var<storage, read> mapping_tables_1: array<vec4<u32>>;

// Reads both buffers: a branch at every read makes some drivers compile a shader for minutes.
fn mapping_table(index: u32) -> vec4<u32> {
    let group = index & ~SECOND_TABLE_BUFFER;
    return select(mapping_tables_0[group], mapping_tables_1[group], (index & SECOND_TABLE_BUFFER) != 0u);
}

// Tables of all viewports in a texture, for adapters whose buffers are too small or too few: a group of four words per
// texel, row by row.

#import constants/tables

@group(3) @binding(0) var mapping_tables: texture_2d<u32>;

// Returns a group of words.
fn mapping_table(index: u32) -> vec4<u32> {
    return textureLoad(mapping_tables, vec2(index % TABLE_COLUMNS, index / TABLE_COLUMNS), 0);
}

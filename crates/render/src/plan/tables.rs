//! Decides where the tables of tabulated pictures are held: in a storage buffer, or in a texture if the adapter's bindings are too small or too few.
//! A software driver binds at most 128 MiB, and the tables of six projectors of 1920 x 1080 pixels take 236 MiB.

/// Groups of four words in a row of the texture.
pub(crate) const TABLE_COLUMNS: u32 = 4096;
/// Bytes of a group.
const GROUP_BYTES: u64 = 16;

/// Where shaders read tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum TableForm {
    /// There are no tables.
    #[default]
    None,
    /// In a storage buffer.
    Buffer,
    /// In a texture.
    Texture,
}

/// Returns the place for tables of `bytes` bytes in all. `in_buffer_bytes` is the maximum size of a buffer for them.
pub(crate) fn table_form(bytes: u64, in_buffer_bytes: u64) -> TableForm {
    match bytes {
        0 => TableForm::None,
        bytes if bytes <= in_buffer_bytes => TableForm::Buffer,
        _ => TableForm::Texture,
    }
}

/// Rows of the texture for this number of groups.
pub(crate) fn table_rows(groups: usize) -> u32 {
    groups.div_ceil(TABLE_COLUMNS as usize).max(1) as u32
}

/// Greatest size of tables, bytes, for an adapter with textures of at most `side_px` rows.
pub(crate) fn table_limit_bytes(side_px: u32) -> u64 {
    GROUP_BYTES * u64::from(TABLE_COLUMNS) * u64::from(side_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_in_a_buffer_if_they_fit() {
        let forms = [0, 100, 101].map(|bytes| table_form(bytes, 100));
        assert_eq!(forms, [TableForm::None, TableForm::Buffer, TableForm::Texture]);
        assert_eq!(table_form(1, 0), TableForm::Texture);
        assert_eq!([0, 1, 4096, 4097].map(table_rows), [1, 1, 1, 2]);
        assert_eq!(table_limit_bytes(8192), 512 << 20);
    }
}

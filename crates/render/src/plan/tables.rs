//! Tables of tabulated pictures in one buffer, or in two where an adapter does not bind so many bytes as one: the software driver binds 128 MiB, and the tables of six projectors of
//! 1920 x 1080 pixels have 236. Shaders that read two take the driver longer to make.

/// Where tables are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TableBuffers {
    /// The buffer of each table.
    pub(crate) of: Vec<usize>,
    /// The bytes of each buffer; there are one or two.
    pub(crate) bytes: Vec<u64>,
}

impl TableBuffers {
    /// Of tables by their sizes in bytes, with at most `limit` bytes in a buffer if they fit at all. Where there are two, a table goes to where less is.
    pub(crate) fn new(tables: &[u64], limit: u64) -> Self {
        let sum = tables.iter().sum();
        if sum <= limit {
            return Self { of: vec![0; tables.len()], bytes: vec![sum] };
        }
        let mut bytes = vec![0; 2];
        let place = |table: &u64| {
            let least = usize::from(bytes[1] < bytes[0]);
            bytes[least] += table;
            least
        };
        let of = tables.iter().map(place).collect();
        Self { of, bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_share_a_buffer_or_go_to_where_less_is() {
        let tables = [5, 1, 1, 1, 1, 9, 2];
        assert_eq!(TableBuffers::new(&tables, 20), TableBuffers { of: vec![0; 7], bytes: vec![20] });
        let two = TableBuffers { of: vec![0, 1, 1, 1, 1, 1, 0], bytes: vec![7, 13] };
        assert_eq!(TableBuffers::new(&tables, 19), two);
        assert_eq!(TableBuffers::new(&[], 0).bytes, [0]);
    }
}

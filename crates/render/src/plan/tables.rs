//! Distribution of the tables of tabulated pictures over one buffer, or two if the adapter's binding size is too small: the software
//! driver binds 128 MiB, and the tables of six projectors of 1920 x 1080 pixels take 236. The driver needs longer to compile shaders that
//! read two buffers.

/// Positions of tables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TableBuffers {
    /// Buffer of each table.
    pub(crate) buffers: Vec<usize>,
    /// Size of each buffer, bytes; there are one or two.
    pub(crate) bytes: Vec<u64>,
}

impl TableBuffers {
    /// Distributes tables of the given sizes in bytes, with at most `limit` bytes in a buffer if they fit. With two buffers, each table is
    /// put into the one with less content.
    pub(crate) fn new(tables: &[u64], limit: u64) -> Self {
        let sum = tables.iter().sum();
        if sum <= limit {
            return Self { buffers: vec![0; tables.len()], bytes: vec![sum] };
        }
        let mut bytes = vec![0; 2];
        let place = |table: &u64| {
            let least = usize::from(bytes[1] < bytes[0]);
            bytes[least] += table;
            least
        };
        let buffers = tables.iter().map(place).collect();
        Self { buffers, bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_share_a_buffer_or_go_to_the_emptier_one() {
        let tables = [5, 1, 1, 1, 1, 9, 2];
        assert_eq!(TableBuffers::new(&tables, 20), TableBuffers { buffers: vec![0; 7], bytes: vec![20] });
        let two = TableBuffers { buffers: vec![0, 1, 1, 1, 1, 1, 0], bytes: vec![7, 13] };
        assert_eq!(TableBuffers::new(&tables, 19), two);
        assert_eq!(TableBuffers::new(&[], 0).bytes, [0]);
    }
}

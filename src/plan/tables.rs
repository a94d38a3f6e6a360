//! Tables of tabulated pictures over several buffers: an adapter binds no more than so many bytes as one. The software driver binds 128 MiB, and the tables of six projectors of
//! 1920 x 1080 pixels have 236.

/// Buffers that passes bind.
pub(crate) const TABLE_BUFFERS: usize = 4;

/// The buffer of each table, in the order of their sizes in bytes, and the bytes of each buffer. A table goes to where the least is.
pub(crate) fn spread(tables: impl Iterator<Item = u64>) -> (Vec<usize>, [u64; TABLE_BUFFERS]) {
    let mut held = [0; TABLE_BUFFERS];
    let place = |bytes: u64| {
        let least = (1..TABLE_BUFFERS).fold(0, |least, buffer| if held[buffer] < held[least] { buffer } else { least });
        held[least] += bytes;
        least
    };
    (tables.map(place).collect(), held)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_go_to_where_the_least_is() {
        assert_eq!(spread([5, 1, 1, 1, 1, 9, 2].into_iter()), (vec![0, 1, 2, 3, 1, 2, 3], [5, 2, 10, 3]));
        assert_eq!(spread(std::iter::empty()), (vec![], [0; TABLE_BUFFERS]));
    }
}

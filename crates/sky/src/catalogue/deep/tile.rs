//! Encoding of a tile: the composite stars of a plane in one cell of the plane's tile order.
//!
//! A tile with stars consists of 64-bit words, little-endian. The first words have one bit for each cell of the plane in the tile, which is set if
//! the cell has a composite star (from the lowest bit of the first word, in nested order; at least one word). The composite stars of these cells
//! follow. A tile without stars has no bytes.

/// Order of the tiles for a plane of this order. Tiles have at most 4,096 cells and are not larger than a bucket of the import.
pub const fn tile_order(order: u8) -> u8 {
    let order = order.saturating_sub(6);
    if order < 4 { 4 } else { order }
}

/// Number of cells of a plane in each of its tiles.
pub const fn cells_per_tile(order: u8) -> usize {
    1 << (2 * (order - tile_order(order)))
}

/// Number of words for the bits of a tile.
pub const fn words_of_bits(order: u8) -> usize {
    cells_per_tile(order).div_ceil(64)
}

/// Number of words of a tile with this number of composite stars.
pub const fn words_of_tile(order: u8, stars: u32) -> u64 {
    if stars == 0 { 0 } else { words_of_bits(order) as u64 + stars as u64 }
}

/// Composite stars of a tile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tile {
    /// Index of each composite star's cell in the tile, in increasing order.
    pub cells: Vec<u32>,
    /// The composite stars; see [`Composite::from_bits`](super::composite::Composite::from_bits).
    pub bits: Vec<u64>,
}

impl Tile {
    /// Adds a composite star; cells must be added in increasing order.
    pub fn push(&mut self, cell: u32, bits: u64) {
        self.cells.push(cell);
        self.bits.push(bits);
    }

    /// Encodes the tile of a plane of this order as words.
    pub fn to_words(&self, order: u8) -> Vec<u64> {
        if self.cells.is_empty() {
            return Vec::new();
        }
        let mut words = vec![0; words_of_bits(order)];
        for cell in &self.cells {
            words[*cell as usize / 64] |= 1_u64 << (cell % 64);
        }
        words.extend_from_slice(&self.bits);
        words
    }

    /// Inverse of [`Tile::to_words`]; `None` if the number of set bits differs from the number of composite stars, or if a set bit has no cell.
    pub fn from_words(order: u8, words: &[u64]) -> Option<Self> {
        if words.is_empty() {
            return Some(Self::default());
        }
        let (places, bits) = words.split_at_checked(words_of_bits(order))?;
        let mut cells = Vec::with_capacity(bits.len());
        for (index, word) in places.iter().enumerate() {
            let mut left = *word;
            while left != 0 {
                cells.push(index as u32 * 64 + left.trailing_zeros());
                left &= left - 1;
            }
        }
        let is_valid =
            cells.len() == bits.len() && cells.last().is_some_and(|cell| (*cell as usize) < cells_per_tile(order));
        is_valid.then(|| Self { cells, bits: bits.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_survive_their_words_and_wrong_ones_are_refused() {
        for order in 6..=12 {
            let all = cells_per_tile(order) as u32;
            for step in [1, 3, 16] {
                let mut tile = Tile::default();
                (0..all).step_by(step).for_each(|cell| tile.push(cell, u64::from(cell) << 20 | 5));
                let words = tile.to_words(order);
                assert_eq!(words.len() as u64, words_of_tile(order, tile.bits.len() as u32));
                assert_eq!(Tile::from_words(order, &words).as_ref(), Some(&tile));
                assert_eq!(Tile::from_words(order, &words[..words.len() - 1]), None);
                assert_eq!(Tile::from_words(order, &[&words[..], &[1]].concat()), None);
            }
        }
        assert_eq!(Tile::default().to_words(12), Vec::<u64>::new());
        assert_eq!(Tile::from_words(12, &[]), Some(Tile::default()));
        // In order 6 a tile has 16 cells, but the word has 64 bits.
        assert_eq!(Tile::from_words(6, &[1 << 16, 7]), None);
        assert_eq!(Tile::from_words(12, &[0; 64]), None);
    }
}

//! Selects the pieces of a map that are drawn, and the places of their texels in the map's buffer.
//!
//! No shader: places in a buffer, which `shaders/shared/sky_pieces.wgsl` reads.
//! No twin: places in a buffer.

use std::{collections::HashMap, ops::Range};

use range_alloc::RangeAllocator;

use crate::plan::{
    smooth_light::{
        PIECE_WORDS, piece_words,
        pieces::{PieceFrame, PieceGrid, SkyPicture, WantedPicture},
        words_needed,
    },
    stars::deep::{Lack, Residual},
};

/// Number of frames over which all pieces that could be better are drawn again: first while a view rests, then while it moves.
const FRAMES_OF_IMPROVEMENT: [usize; 2] = [16, 64];
/// While a view moves, at most one of the pieces whose level is wrong by less than this is drawn again in a frame, because most of them soon leave
/// the view.
const LEVELS_IN_MOTION: f32 = 3.0;
/// Least number of words for pieces, unless the buffer must be smaller.
const LEAST_WORDS: u64 = 10_000_000;

/// A piece with a place in the buffer.
#[derive(Debug)]
struct Piece {
    /// Its words in the buffer.
    words: Range<u32>,
    level: u8,
    /// Number of the last frame that read it.
    used: u64,
    /// Stars that were missing when it was drawn.
    lack: Option<Lack>,
}

/// Places of the pieces of a map. The buffer begins with the first word of each piece of the sky.
#[derive(Debug)]
pub(super) struct Pieces {
    grid: PieceGrid,
    words: u32,
    free: RangeAllocator<u32>,
    held: HashMap<u32, Piece>,
    last_read: Vec<WantedPicture>,
    frame: u64,
}

impl Pieces {
    /// Reserves room for twice the pieces that a frame reads, if the buffer may be that large.
    pub(super) fn new(grid: PieceGrid, read: &[WantedPicture], most_bytes: u64) -> Self {
        let of_table = grid.pieces();
        let wished = (2 * words_needed(&grid, read)).max(LEAST_WORDS);
        let words = wished.min(most_bytes / 4).min(u32::MAX.into()) as u32;
        let free = RangeAllocator::new(of_table..words.max(of_table));
        Self { grid, words, free, held: HashMap::new(), last_read: Vec::new(), frame: 0 }
    }

    /// Returns the size of the buffer, bytes.
    pub(super) fn bytes(&self) -> u64 {
        4 * u64::from(self.words)
    }

    /// Whether all pieces of a frame have places.
    pub(super) fn have_room(&self, read: &[WantedPicture]) -> bool {
        words_needed(&self.grid, read) <= self.words.into()
    }

    /// Records the pieces that a frame reads, and returns those that must be drawn: all absent ones, and some of those whose missing stars have been
    /// read by now (`are_read`) or whose texels have another size. A piece whose texels have a very different size counts as absent.
    pub(super) fn missing(
        &mut self,
        read: &[WantedPicture],
        mut are_read: impl FnMut(&Lack) -> bool,
    ) -> Vec<SkyPicture> {
        self.frame += 1;
        let moves = self.last_read != read;
        self.last_read = read.to_vec();
        let mut absent = Vec::new();
        // Pieces that could be better, each with the number of levels by which it is wrong; those that lacked stars come first.
        let mut improved: Vec<(f32, SkyPicture)> = Vec::new();
        for wanted in read {
            match self.held.get_mut(&wanted.number) {
                None => absent.push(wanted.drawn()),
                Some(piece) => {
                    piece.used = self.frame;
                    if !wanted.accepts(piece.level) {
                        absent.push(wanted.drawn());
                    } else if piece.lack.as_ref().is_some_and(&mut are_read) {
                        improved.push((f32::INFINITY, wanted.drawn()));
                    } else if !wanted.keeps(piece.level) {
                        improved.push((wanted.off_by(piece.level), wanted.drawn()));
                    }
                }
            }
        }
        improved.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut most = read.len().div_ceil(FRAMES_OF_IMPROVEMENT[usize::from(moves)]);
        if moves {
            most = most.min(improved.iter().take_while(|(off, _)| *off > LEVELS_IN_MOTION).count().max(1));
        }
        absent.extend(improved.into_iter().take(most).map(|(_, picture)| picture));
        absent
    }

    /// Whether all of these pieces have been drawn.
    pub(super) fn are_drawn(&self, read: &[WantedPicture]) -> bool {
        read.iter().all(|wanted| self.held.get(&wanted.number).is_some_and(|piece| wanted.accepts(piece.level)))
    }

    /// Returns the error that missing pages cause in these pieces, and the number of these pages.
    pub(super) fn lack(&self, read: &[WantedPicture]) -> Residual {
        let mut all = Residual::default();
        read.iter()
            .filter_map(|wanted| self.held.get(&wanted.number)?.lack.as_ref())
            .for_each(|lack| all.add(lack.residual));
        all
    }

    /// Gives a piece that is about to be drawn a place. Returns its first word, and the pieces that lost their places. Pieces that were not read for
    /// the longest time lose their places first, until there is room. If the free words are too fragmented, some pieces that are being read lose
    /// theirs.
    pub(super) fn draw(&mut self, picture: SkyPicture, lack: Option<Lack>) -> (u32, Vec<u32>) {
        let SkyPicture { number, level } = picture;
        self.release(number);
        let length = piece_words(&self.grid, picture);
        let mut lost = Vec::new();
        let words = loop {
            if let Ok(words) = self.free.allocate_range(length) {
                break words;
            }
            let unread = self.held.iter().filter(|(_, piece)| piece.used < self.frame);
            let oldest = unread.min_by_key(|(number, piece)| (piece.used, **number)).map(|(number, _)| *number);
            let leaving = oldest.map_or_else(|| self.in_the_way(length), |number| vec![number]);
            assert!(!leaving.is_empty(), "a buffer has room for a piece");
            for number in leaving {
                self.release(number);
                lost.push(number);
            }
        };
        let first = words.start;
        self.held.insert(number, Piece { words, level, used: self.frame, lack });
        (first, lost)
    }

    /// Frees the place of a piece, if it has one.
    fn release(&mut self, number: u32) {
        if let Some(piece) = self.held.remove(&number) {
            self.free.free_range(piece.words);
        }
    }

    /// Returns the neighbouring pieces with the fewest words that leave room for `length` words if they lose their places.
    fn in_the_way(&self, length: u32) -> Vec<u32> {
        let mut held: Vec<(u32, &Range<u32>)> =
            self.held.iter().map(|(number, piece)| (*number, &piece.words)).collect();
        held.sort_by_key(|(_, words)| words.start);
        // Returns the pieces that must be removed from `first` on, with their total number of words.
        let from = |first: usize| {
            let start = first.checked_sub(1).map_or(self.grid.pieces(), |before| held[before].1.end);
            let end = |next: usize| held.get(next).map_or(self.words, |(_, words)| words.start);
            let next = (first..=held.len()).find(|next| end(*next) - start >= length)?;
            let leaving = &held[first..next];
            Some((leaving.iter().map(|(_, words)| words.len()).sum::<usize>(), leaving))
        };
        let best = (0..=held.len()).filter_map(from).min_by_key(|(words, _)| *words);
        best.map_or_else(Vec::new, |(_, leaving)| leaving.iter().map(|(number, _)| *number).collect())
    }

    /// Returns the width of a piece's picture, texels, and the words before its texels. These are four words for each axis of the picture (right and
    /// down, in texels, and outwards): a vector in world axes and a fourth word. The three fourth words are the two coordinates of the centre,
    /// measured from the centre of the first texel, and the width.
    pub(super) fn words(&self, picture: SkyPicture) -> (u32, [u32; PIECE_WORDS as usize]) {
        let PieceFrame { world_from_piece, size: [width, height], texel } = self.grid.frame(picture);
        let per_texel = 1.0 / texel;
        let right = (per_texel * world_from_piece.x_axis).as_vec3();
        let down = (-per_texel * world_from_piece.y_axis).as_vec3();
        let outwards = (-world_from_piece.z_axis).as_vec3();
        let centre = |side: u32| 0.5 * side as f32 - 0.5;
        let numbers = [
            [right.x, right.y, right.z, centre(width)],
            [down.x, down.y, down.z, centre(height)],
            [outwards.x, outwards.y, outwards.z, 0.0],
        ];
        let mut words = [0; PIECE_WORDS as usize];
        for (word, number) in words.iter_mut().zip(numbers.as_flattened()) {
            *word = number.to_bits();
        }
        words[PIECE_WORDS as usize - 1] = width;
        (width, words)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::catalogue::deep::live::PageKey;

    fn wanted(numbers: &[u32]) -> Vec<WantedPicture> {
        numbers.iter().map(|number| WantedPicture { number: *number, level: 0.0 }).collect()
    }

    fn numbers(pictures: Vec<SkyPicture>) -> Vec<u32> {
        pictures.into_iter().map(|picture| picture.number).collect()
    }

    fn finest(number: u32) -> SkyPicture {
        SkyPicture { number, level: 0 }
    }

    #[test]
    fn the_pieces_that_were_not_read_for_the_longest_time_lose_their_places() {
        let grid = PieceGrid::of_texels(1e-2).unwrap();
        // In a grid with one piece along an edge, all pieces have the same size.
        let (first, size) = (grid.pieces(), piece_words(&grid, finest(1)));
        let places = [first, first + size, first + 2 * size];
        let mut pieces = Pieces::new(grid, &wanted(&[1]), 4 * u64::from(first + 3 * size));
        assert!(pieces.have_room(&wanted(&[1, 2])) && !pieces.have_room(&wanted(&[1, 2, 3])));
        assert_eq!(numbers(pieces.missing(&wanted(&[1, 2]), |_| true)), [1, 2]);
        assert_eq!([1, 2].map(|number| pieces.draw(finest(number), None).0), places[..2]);
        assert!(pieces.are_drawn(&wanted(&[1, 2])) && !pieces.are_drawn(&wanted(&[1, 3])));
        assert_eq!(numbers(pieces.missing(&wanted(&[2, 3]), |_| true)), [3]);
        assert_eq!(pieces.draw(finest(3), None), (places[2], vec![]));
        assert_eq!(numbers(pieces.missing(&wanted(&[3, 4]), |_| true)), [4]);
        assert_eq!(pieces.draw(finest(4), None), (places[0], vec![1]));
        assert_eq!(numbers(pieces.missing(&wanted(&[3, 4, 5]), |_| true)), [5]);
        assert_eq!(pieces.draw(finest(5), None), (places[1], vec![2]));
    }

    #[test]
    fn pieces_of_several_sizes_find_room_at_the_cost_of_few_others() {
        let grid = PieceGrid::of_texels(1e-2).unwrap();
        let (first, size) = (grid.pieces(), piece_words(&grid, finest(1)));
        let mut pieces = Pieces::new(grid, &[], 4 * words_needed(&grid, &wanted(&[1, 3, 4])));
        assert!(pieces.words < first + 4 * size);
        let at = |level: f32, numbers: [u32; 3]| numbers.map(|number| WantedPicture { number, level });
        let draw_all = |pieces: &mut Pieces, read: &[WantedPicture]| {
            let missing = pieces.missing(read, |_| true);
            missing.into_iter().map(|picture| pieces.draw(picture, None)).collect::<Vec<_>>()
        };
        // Small pieces; the middle one is no longer read.
        let small = at(16.0, [1, 2, 3]);
        draw_all(&mut pieces, &small);
        assert!(pieces.are_drawn(&small));
        // Two large pieces fit after the piece that is no longer read was removed.
        let large = at(0.0, [1, 4, 3]);
        let lost: Vec<u32> = draw_all(&mut pieces, &large[..2]).into_iter().flat_map(|(_, lost)| lost).collect();
        assert!(lost.iter().all(|number| [2, 3].contains(number)), "{lost:?}");
        for _ in 0..4 {
            draw_all(&mut pieces, &large);
        }
        assert!(pieces.are_drawn(&large));
        // No two of them share a word.
        let mut words: Vec<_> = pieces.held.values().map(|piece| piece.words.clone()).collect();
        words.sort_by_key(|words| words.start);
        assert!(words.windows(2).all(|pair| pair[0].end <= pair[1].start) && words[0].start >= first);
    }

    #[test]
    fn a_piece_without_all_stars_is_drawn_again_when_they_have_been_read() {
        let grid = PieceGrid::of_texels(1e-2).unwrap();
        let mut pieces = Pieces::new(grid, &wanted(&[7, 8]), u64::MAX);
        let keys = vec![PageKey::Leaf { layer: 1, cell: 9 }];
        let residual = Residual { cd_m2: 3e-7, missing: 1 };
        let read = wanted(&[7, 8]);
        pieces.missing(&read, |_| true);
        pieces.draw(finest(7), Some(Lack { residual, keys }));
        pieces.draw(finest(8), None);
        assert_eq!((pieces.lack(&read), pieces.lack(&read[1..])), (residual, Residual::default()));
        assert_eq!(numbers(pieces.missing(&read, |_| false)), [0; 0]);
        assert_eq!(numbers(pieces.missing(&read, |lack| lack.keys.len() == 1)), [7]);
        pieces.draw(finest(7), None);
        assert_eq!(pieces.lack(&read), Residual::default());
        assert_eq!(numbers(pieces.missing(&read, |_| true)), [0; 0]);
    }

    #[test]
    fn a_piece_with_texels_of_another_size_is_drawn_again_in_its_place() {
        let grid = PieceGrid::of_texels(1e-2).unwrap();
        let mut pieces = Pieces::new(grid, &wanted(&[7]), u64::MAX);
        let at = |level: f32| vec![WantedPicture { number: 7, level }];
        pieces.missing(&at(0.2), |_| true);
        let (place, _) = pieces.draw(finest(7), None);
        assert_eq!(pieces.missing(&at(0.7), |_| true), []);
        assert_eq!(pieces.missing(&at(3.9), |_| true), [SkyPicture { number: 7, level: 4 }]);
        assert!(pieces.are_drawn(&at(5.9)) && !pieces.are_drawn(&at(6.1)));
        assert_eq!(pieces.draw(SkyPicture { number: 7, level: 4 }, None), (place, vec![]));
        assert_eq!(pieces.missing(&at(3.9), |_| true), []);
        assert!(pieces.are_drawn(&at(6.1)));
    }

    #[test]
    fn a_moving_view_improves_pieces_that_are_far_off_and_one_other() {
        let grid = PieceGrid::of_texels(1e-3).unwrap();
        let at = |level: f32, count: u32| (0..count).map(|number| WantedPicture { number, level }).collect::<Vec<_>>();
        let mut pieces = Pieces::new(grid, &at(8.0, 256), u64::MAX);
        let draw_all = |pieces: &mut Pieces, read: &[WantedPicture]| {
            let drawn = pieces.missing(read, |_| true);
            drawn.iter().for_each(|picture| {
                pieces.draw(*picture, None);
            });
            drawn.len()
        };
        assert_eq!(draw_all(&mut pieces, &at(8.0, 256)), 256);
        // While the view moves, the levels of all pieces are first slightly wrong, then clearly wrong, then unacceptable.
        assert_eq!(draw_all(&mut pieces, &at(9.0, 256)), 1);
        assert_eq!(draw_all(&mut pieces, &at(11.5, 256)), 4);
        assert_eq!(draw_all(&mut pieces, &at(14.5, 256)), 251 + 1);
        assert_eq!(draw_all(&mut pieces, &at(16.0, 256)), 4);
        // While the view rests, pieces whose level is slightly wrong are drawn again too.
        assert_eq!(draw_all(&mut pieces, &at(16.0, 256)), 16);
    }
}

//! Which pieces of a map are drawn, and where their texels are in its buffer.
//!
//! No shader: places in a buffer, which `shaders/shared/sky_pieces.wgsl` reads.
//! No twin: places in a buffer.

use std::collections::HashMap;

use crate::plan::{
    smooth_light::{
        PIECE_WORDS, piece_words,
        pieces::{PieceFrame, PieceGrid, SkyPicture, WantedPicture},
    },
    stars::deep::{Lack, Residual},
};

/// Frames in which all pieces are drawn again that could be better.
const FRAMES_OF_IMPROVEMENT: usize = 16;
/// Least number of places.
const LEAST_PLACES: u64 = 64;

/// A piece that has a place.
#[derive(Debug)]
struct Piece {
    place: u32,
    level: u8,
    /// Number of the last frame that read it.
    used: u64,
    /// Stars that were missing when it was drawn.
    lack: Option<Lack>,
}

/// Places of the pieces of a map.
#[derive(Debug)]
pub(super) struct Pieces {
    grid: PieceGrid,
    places: u32,
    free: Vec<u32>,
    held: HashMap<u32, Piece>,
    frame: u64,
}

impl Pieces {
    /// Places for twice the pieces that a frame reads, if the buffer may be so large.
    pub(super) fn new(grid: PieceGrid, read: usize, most_bytes: u64) -> Self {
        let words_of_one = piece_words(&grid, 1) - piece_words(&grid, 0);
        let most = (most_bytes / 4).saturating_sub(piece_words(&grid, 0)) / words_of_one;
        let places = (2 * read as u64).max(LEAST_PLACES).min(most) as u32;
        Self { grid, places, free: (0..places).rev().collect(), held: HashMap::new(), frame: 0 }
    }

    /// Bytes of the buffer.
    pub(super) fn bytes(&self) -> u64 {
        4 * piece_words(&self.grid, u64::from(self.places))
    }

    /// Whether all pieces of a frame have places.
    pub(super) fn have_room(&self, read: usize) -> bool {
        read <= self.places as usize
    }

    /// Notes the pieces that a frame reads, and returns those that are to be drawn: absent ones, then some of those whose stars `are_read` by now.
    /// A piece with texels of a quite different size is absent, and others with texels of another size are drawn again too.
    pub(super) fn missing(
        &mut self,
        read: &[WantedPicture],
        mut are_read: impl FnMut(&Lack) -> bool,
    ) -> Vec<SkyPicture> {
        self.frame += 1;
        let mut absent = Vec::new();
        let mut improved = Vec::new();
        for wanted in read {
            match self.held.get_mut(&wanted.number) {
                None => absent.push(wanted.drawn()),
                Some(piece) => {
                    piece.used = self.frame;
                    if !wanted.accepts(piece.level) {
                        absent.push(wanted.drawn());
                    } else if piece.lack.as_ref().is_some_and(&mut are_read) || !wanted.keeps(piece.level) {
                        improved.push(wanted.drawn());
                    }
                }
            }
        }
        improved.truncate(read.len().div_ceil(FRAMES_OF_IMPROVEMENT));
        absent.extend(improved);
        absent
    }

    /// Whether all of these pieces have been drawn.
    pub(super) fn are_drawn(&self, read: &[WantedPicture]) -> bool {
        read.iter().all(|wanted| self.held.get(&wanted.number).is_some_and(|piece| wanted.accepts(piece.level)))
    }

    /// Error and number of the pages that these pieces lack.
    pub(super) fn lack(&self, read: &[WantedPicture]) -> Residual {
        let mut all = Residual::default();
        read.iter()
            .filter_map(|wanted| self.held.get(&wanted.number)?.lack.as_ref())
            .for_each(|lack| all.add(lack.residual));
        all
    }

    /// Gives a piece that is drawn now a place. Returns it, and the piece that has lost it.
    pub(super) fn draw(&mut self, SkyPicture { number, level }: SkyPicture, lack: Option<Lack>) -> (u32, Option<u32>) {
        let used = self.frame;
        if let Some(piece) = self.held.get_mut(&number) {
            (piece.level, piece.lack) = (level, lack);
            return (piece.place, None);
        }
        let (place, lost) = match self.free.pop() {
            Some(place) => (place, None),
            None => {
                let oldest = self.held.iter().min_by_key(|(number, piece)| (piece.used, **number));
                let lost = oldest.map(|(number, piece)| (piece.place, *number));
                if let Some((_, number)) = lost {
                    self.held.remove(&number);
                }
                lost.map_or((0, None), |(place, number)| (place, Some(number)))
            }
        };
        self.held.insert(number, Piece { place, level, used, lack });
        (place, lost)
    }

    /// Index of the first word of a place.
    pub(super) fn first_word(&self, place: u32) -> u32 {
        piece_words(&self.grid, place.into()) as u32
    }

    /// Width of a piece's picture, texels, and the words before its texels: for each axis of the picture, right and down in texels and outwards, a
    /// vector in world axes and a fourth word. Those are the position of the centre, from the centre of the first texel on, and the width.
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
        let mut pieces = Pieces::new(grid, 1, 4 * piece_words(&grid, 3));
        assert_eq!((pieces.places, pieces.have_room(3), pieces.have_room(4)), (3, true, false));
        assert_eq!(numbers(pieces.missing(&wanted(&[1, 2]), |_| true)), [1, 2]);
        assert_eq!([1, 2].map(|number| pieces.draw(finest(number), None)), [(0, None), (1, None)]);
        assert!(pieces.are_drawn(&wanted(&[1, 2])) && !pieces.are_drawn(&wanted(&[1, 3])));
        assert_eq!(numbers(pieces.missing(&wanted(&[2, 3]), |_| true)), [3]);
        assert_eq!(pieces.draw(finest(3), None), (2, None));
        assert_eq!(numbers(pieces.missing(&wanted(&[3, 4]), |_| true)), [4]);
        assert_eq!(pieces.draw(finest(4), None), (0, Some(1)));
        assert_eq!(numbers(pieces.missing(&wanted(&[3, 4, 5]), |_| true)), [5]);
        assert_eq!(pieces.draw(finest(5), None), (1, Some(2)));
        assert_eq!(pieces.first_word(1) - pieces.first_word(0), 12 + 384 * 384);
    }

    #[test]
    fn a_piece_without_all_stars_is_drawn_again_when_they_have_been_read() {
        let grid = PieceGrid::of_texels(1e-2).unwrap();
        let mut pieces = Pieces::new(grid, 4, u64::MAX);
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
        let mut pieces = Pieces::new(grid, 4, u64::MAX);
        let at = |level: f32| vec![WantedPicture { number: 7, level }];
        pieces.missing(&at(0.2), |_| true);
        let (place, _) = pieces.draw(finest(7), None);
        assert_eq!(pieces.missing(&at(0.7), |_| true), []);
        assert_eq!(pieces.missing(&at(1.9), |_| true), [SkyPicture { number: 7, level: 2 }]);
        assert!(pieces.are_drawn(&at(1.9)) && !pieces.are_drawn(&at(2.1)));
        assert_eq!(pieces.draw(SkyPicture { number: 7, level: 2 }, None), (place, None));
        assert_eq!(pieces.missing(&at(1.9), |_| true), []);
        assert!(pieces.are_drawn(&at(2.1)));
    }
}

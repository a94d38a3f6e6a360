//! A synthetic Milky Way that does not fit in memory: the stars are delivered one after the other, in blocks of the sky.
//!
//! A block has the same stars here and in [`generate`](super::generate). The model is drawn a little deeper than the requested number of stars needs;
//! the caller counts the magnitudes beyond [`GalaxyStream::counted_from`], and finally leaves out the faintest stars.

use super::sampling::{BLOCKS, MagnitudeRange, Sky};
use super::{GalaxyError, GalaxyParameters};
use crate::catalogue::StarRecord;

/// Largest number of stars that can be streamed.
pub const MOST_STREAMED: u64 = 2_000_000_000;

/// Faintest apparent V magnitude of streamed stars: that of Gaia.
pub const FAINTEST_STREAMED_MAGNITUDE: f64 = 21.5;

/// The model, prepared to draw a number of stars.
pub struct GalaxyStream {
    sky: Sky,
    seed: u64,
    stars: f64,
    brightest: f64,
    left_out: f64,
    available: u64,
}

impl GalaxyStream {
    /// Prepares the model; the light of fainter stars is not computed.
    ///
    /// # Errors
    /// [`GalaxyError`] if a parameter is out of range, or if the model does not have enough stars.
    pub fn new(parameters: &GalaxyParameters) -> Result<Self, GalaxyError> {
        let &GalaxyParameters { stars, seed, fainter_than, .. } = parameters;
        if stars == 0 || stars as u64 > MOST_STREAMED {
            return Err(GalaxyError::StreamedStarCount { stars });
        }
        if let Some(fainter_than) = fainter_than.filter(|v| !v.is_finite()) {
            return Err(GalaxyError::NotFinite { fainter_than });
        }
        let sky = Sky::new();
        let brightest = fainter_than.unwrap_or(f64::NEG_INFINITY);
        let left_out = sky.brighter_than(brightest);
        let available = (sky.brighter_than(FAINTEST_STREAMED_MAGNITUDE) - left_out).max(0.0);
        let stream = Self { sky, seed, stars: stars as f64, brightest, left_out, available: available as u64 };
        if available < stream.stars { Err(stream.too_few()) } else { Ok(stream) }
    }

    fn too_few(&self) -> GalaxyError {
        GalaxyError::TooFewStreamedStars {
            stars: self.stars as usize,
            fainter_than: self.brightest,
            available: self.available,
        }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        BLOCKS
    }

    /// Returns the range of magnitudes of a round. The first round almost always has enough stars.
    fn range(&self, round: u32) -> Result<MagnitudeRange, GalaxyError> {
        let mut aim = 1.003 * self.stars + 5.0 * self.stars.sqrt() + 5.0;
        let mut range = MagnitudeRange { brightest: self.brightest, faintest: self.brightest };
        for _ in 0..=round {
            if range.faintest >= FAINTEST_STREAMED_MAGNITUDE {
                return Err(self.too_few());
            }
            range.brightest = range.faintest;
            range.faintest = self.sky.magnitude_with(self.left_out + aim, FAINTEST_STREAMED_MAGNITUDE);
            aim = 1.01 * aim + 10.0;
        }
        Ok(range)
    }

    /// Returns the magnitude beyond which stars must be counted by magnitude. The number of brighter stars is certainly smaller than the requested
    /// number.
    pub fn counted_from(&self) -> f32 {
        let surely_kept = 0.98 * self.stars - 10.0 * self.stars.sqrt() - 10.0;
        if surely_kept <= 0.0 {
            return f32::NEG_INFINITY;
        }
        self.sky.magnitude_with(self.left_out + surely_kept, FAINTEST_STREAMED_MAGNITUDE) as f32
    }

    /// Delivers the stars of a block in a round. Rounds after the first one are needed only if all blocks together have too few stars.
    ///
    /// # Errors
    /// The model does not have enough stars for this round.
    pub fn draw(&self, block: usize, round: u32, sink: &mut dyn FnMut(StarRecord)) -> Result<(), GalaxyError> {
        self.sky.draw_blocks(block..block + 1, self.range(round)?, (self.seed, round), sink);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::with_light;
    use super::*;

    #[test]
    fn streamed_stars_are_those_of_the_galaxy_in_memory() {
        let parameters = GalaxyParameters { stars: 20_000, seed: 4, fainter_than: Some(5.0), unresolved_light: false };
        let stream = GalaxyStream::new(&parameters).expect("enough stars");
        let mut streamed = Vec::new();
        (0..stream.blocks())
            .try_for_each(|block| stream.draw(block, 0, &mut |star| streamed.push(star)))
            .expect("enough stars");
        let kept = with_light(&parameters).expect("enough stars").stars;
        assert!(streamed.len() > 20_000 && streamed.len() < 21_000, "{}", streamed.len());
        let mut left = streamed.iter();
        assert!(kept.iter().all(|star| left.any(|other| other == star)), "the same stars in the same order");
        let counted_from = stream.counted_from();
        let surely = streamed.iter().filter(|star| (star.apparent_magnitude() as f32) < counted_from).count();
        assert!((15_000..20_000).contains(&surely), "{surely}");
    }

    #[test]
    fn numbers_of_stars_that_cannot_be_streamed_are_refused() {
        let parameters =
            |stars: usize, fainter_than| GalaxyParameters { stars, seed: 4, fainter_than, unresolved_light: false };
        let message = |parameters| GalaxyStream::new(&parameters).map(|_| ()).unwrap_err().to_string();
        assert!(message(parameters(0, None)).contains("1 to 2000000000"));
        assert!(message(parameters(2_000_000_001, None)).contains("1 to 2000000000"));
        assert!(message(parameters(1, Some(f64::NAN))).contains("fainter_than"));
        assert!(message(parameters(100_000, Some(21.499999))).contains("about"));
    }
}

//! The border of a raster's content. Beyond the edge of the picture that a calibration refers to, no light is sent.
//!
//! Each sample of a grid has its place in that picture. Places are interpolated like directions, so the content may end inside a cell of the grid, at
//! the position where the interpolated place leaves the picture.

use glam::{DVec2, DVec3};

use super::{
    filled,
    spline::{Interpolation, Surface},
};

/// Points along a side of a cell at which [`Border::is_reached`] looks for the content.
const POINTS: usize = 8;

/// The part of a plane of coordinates that a content fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContentShape {
    /// Least coordinates.
    pub low: DVec2,
    /// Greatest coordinates.
    pub high: DVec2,
    /// Centre and radii of the ellipse around a round content, whose axes are those of the coordinates.
    pub ellipse: Option<[DVec2; 2]>,
}

impl ContentShape {
    /// Whether a place lies in the content; false for NaN.
    pub fn holds(&self, place: DVec2) -> bool {
        let round = |[centre, radii]: [DVec2; 2]| ((place - centre) / radii).length_squared() <= 1.0;
        place.cmpge(self.low).all() && place.cmple(self.high).all() && self.ellipse.is_none_or(round)
    }
}

/// The places of a grid's samples in a content.
#[derive(Clone, Debug, PartialEq)]
pub struct Border {
    /// Coordinates in the content, in the order of the grid's samples; `None` if unknown.
    pub places: Vec<Option<DVec2>>,
    /// The content.
    pub shape: ContentShape,
}

impl Border {
    /// Bytes that identify it: those of any other border are different.
    pub fn identity(&self) -> Vec<u8> {
        let ContentShape { low, high, ellipse } = self.shape;
        let mut bytes = Vec::with_capacity(65 + 17 * self.places.len());
        let mut add = |at: Option<DVec2>| {
            bytes.push(u8::from(at.is_some()));
            at.unwrap_or_default().to_array().iter().for_each(|part| bytes.extend(part.to_le_bytes()));
        };
        [Some(low), Some(high), ellipse.map(|[centre, _]| centre), ellipse.map(|[_, radii]| radii)]
            .into_iter()
            .for_each(&mut add);
        self.places.iter().copied().for_each(&mut add);
        bytes
    }

    /// Whether the content covers any sample of a grid of `columns` columns, or any tested point between four samples.
    pub fn is_reached(&self, columns: usize) -> bool {
        let holds = |place: DVec2| self.shape.holds(place);
        if self.places.iter().flatten().any(|place| holds(*place)) {
            return true;
        }
        let share = |index: usize| (index as f64 + 0.5) / POINTS as f64;
        let in_cell = |first: usize| {
            let sample = |index: usize| self.places.get(index).copied().flatten();
            let (Some(a), Some(b), Some(c), Some(d)) =
                (sample(first), sample(first + 1), sample(first + columns), sample(first + columns + 1))
            else {
                return false;
            };
            let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
            if !(low.cmple(self.shape.high).all() && high.cmpge(self.shape.low).all()) {
                return false;
            }
            let between = |x: f64, y: f64| a.lerp(b, x).lerp(c.lerp(d, x), y);
            (0..POINTS * POINTS).any(|index| holds(between(share(index % POINTS), share(index / POINTS))))
        };
        (0..self.places.len()).filter(|first| first % columns + 1 < columns).any(in_cell)
    }
}

/// A border with its places interpolated.
#[derive(Debug)]
pub(super) struct Ends {
    places: Surface,
    shape: ContentShape,
}

impl Ends {
    pub(super) fn new(border: &Border, samples: [usize; 2], interpolation: Interpolation) -> Self {
        let places: Vec<Option<DVec3>> = border.places.iter().map(|place| place.map(|at| at.extend(0.0))).collect();
        Self { places: Surface::new(&filled(&places, samples[0]), samples, interpolation), shape: border.shape }
    }

    /// Whether the content covers a position, in sample units.
    pub(super) fn holds(&self, at: [f64; 2]) -> bool {
        self.shape.holds(self.places.evaluate(at).value.truncate())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: ContentShape = ContentShape { low: DVec2::ZERO, high: DVec2::ONE, ellipse: None };
    const HALF: DVec2 = DVec2::splat(0.5);

    #[test]
    fn a_content_is_a_rectangle_or_the_part_of_an_ellipse_in_it() {
        assert!(SQUARE.holds(DVec2::new(0.0, 1.0)) && !SQUARE.holds(DVec2::new(-1e-6, 0.5)));
        assert!(!SQUARE.holds(DVec2::new(f64::NAN, 0.5)));
        let round = ContentShape { ellipse: Some([HALF, DVec2::new(0.5, 1.0)]), ..SQUARE };
        assert!(round.holds(DVec2::new(0.999, 0.5)) && round.holds(DVec2::new(0.9, 0.9)));
        assert!(!round.holds(DVec2::new(0.99, 0.99)) && !round.holds(DVec2::new(0.5, 1.1)));
    }

    #[test]
    fn a_content_between_samples_is_found_and_one_beside_them_is_not() {
        let border = |low: f64, high: f64| {
            let places = [(low, low), (high, low), (low, high), (high, high)];
            Border { places: places.map(|(x, y)| Some(DVec2::new(x, y))).to_vec(), shape: SQUARE }
        };
        assert!(border(-0.1, 1.1).is_reached(2) && border(0.0, 1.0).is_reached(2));
        assert!(!border(2.0, 3.0).is_reached(2) && !border(20.0, 800.0).is_reached(2));
        let unknown = Border { places: vec![None; 4], shape: SQUARE };
        assert!(!unknown.is_reached(2));
    }

    #[test]
    fn borders_that_differ_have_other_bytes() {
        let one = Border { places: vec![Some(HALF); 4], shape: SQUARE };
        let mut unknown = one.clone();
        unknown.places[2] = None;
        let round = Border { shape: ContentShape { ellipse: Some([HALF, HALF]), ..SQUARE }, ..one.clone() };
        assert_eq!(one.identity(), one.clone().identity());
        assert!(one.identity() != unknown.identity() && one.identity() != round.identity());
    }
}

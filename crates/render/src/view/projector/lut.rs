//! Colour look-up tables: codes in, codes out.

/// Dimensions of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LutKind {
    /// One table for each channel.
    One,
    /// A cube of colours.
    Three,
}

/// A look-up table.
#[derive(Clone, Debug, PartialEq)]
pub struct Lut {
    /// Kind of table.
    pub kind: LutKind,
    /// Entries along each dimension, at least two.
    pub size: usize,
    /// Input of the first and of the last entry, for red, green and blue.
    pub domain: [[f32; 3]; 2],
    /// Outputs: `size` values for separate channels, `size`^3 for a cube, in which red varies fastest and blue slowest.
    pub values: Vec<[f32; 3]>,
}

impl Lut {
    /// Looks up a colour: linear between entries (trilinear within a cube), clamped at the border of the domain.
    pub fn look_up(&self, codes: [f64; 3]) -> [f64; 3] {
        let last = self.size - 1;
        let [first, end] = self.domain.map(|bound| bound.map(f64::from));
        let places: [(usize, f64); 3] = std::array::from_fn(|c| {
            let position = ((codes[c] - first[c]) / (end[c] - first[c]) * last as f64).clamp(0.0, last as f64);
            let entry = (position as usize).min(last - 1);
            (entry, position - entry as f64)
        });
        if self.kind == LutKind::One {
            return std::array::from_fn(|c| {
                let (entry, share) = places[c];
                let [low, high] = [entry, entry + 1].map(|entry| f64::from(self.values[entry][c]));
                low + (high - low) * share
            });
        }
        let mut sum = [0.0; 3];
        for corner in 0..8 {
            let (mut index, mut weight) = (0, 1.0);
            for c in (0..3).rev() {
                let (entry, share) = places[c];
                let upper = corner >> c & 1;
                index = index * self.size + entry + upper;
                weight *= if upper == 1 { share } else { 1.0 - share };
            }
            for (sum, value) in sum.iter_mut().zip(self.values[index]) {
                *sum += weight * f64::from(value);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(size: usize, function: impl Fn([f64; 3]) -> [f64; 3]) -> Lut {
        let entries = |index: usize| [index % size, index / size % size, index / size / size];
        let share = |index: usize| entries(index).map(|entry| entry as f64 / (size - 1) as f64);
        let values = (0..size.pow(3)).map(|index| function(share(index)).map(|value| value as f32)).collect();
        Lut { kind: LutKind::Three, size, domain: [[0.0; 3], [1.0; 3]], values }
    }

    #[test]
    fn a_cube_of_products_is_interpolated_exactly() {
        // Linear along each axis: interpolation between the entries is exact.
        let function = |[r, g, b]: [f64; 3]| [0.1 + 0.5 * r * g, 0.9 - 0.7 * g * b, r * g * b];
        let lut = cube(5, function);
        for n in 0..200 {
            let codes = [7.0_f64, 11.0, 13.0].map(|prime| (f64::from(n) * prime.sqrt()).fract());
            for (found, expected) in lut.look_up(codes).into_iter().zip(function(codes)) {
                assert!((found - expected).abs() < 1e-6, "{codes:?}: {found} {expected}");
            }
        }
        assert!(
            lut.look_up([2.0, 1.0, -1.0]).into_iter().zip(function([1.0, 1.0, 0.0])).all(|(a, b)| (a - b).abs() < 1e-6)
        );
    }

    #[test]
    fn each_channel_has_its_own_table_and_domain() {
        let values = vec![[0.0, 1.0, 0.0], [0.25, 0.5, 0.5], [1.0, 0.0, 1.0]];
        let lut = Lut { kind: LutKind::One, size: 3, domain: [[0.0, 0.0, -1.0], [1.0, 2.0, 1.0]], values };
        assert_eq!(lut.look_up([0.25, 0.5, 0.0]), [0.125, 0.75, 0.5]);
        assert_eq!(lut.look_up([0.75, 2.0, -3.0]), [0.625, 0.0, 0.0]);
    }
}

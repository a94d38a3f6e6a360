//! Colour matching functions of the CIE 1931 standard colorimetric observer (2 degree field), 360 to 830 nm in steps
//! of 5 nm: the values of CIE 15 and ISO/CIE 11664-1, with the last digit (5e-7) rounded in a few of them.
//! Dimensionless; the second column is also V(lambda), the photopic luminous efficiency.
//!
//! A tristimulus value is the sum of spectrum times function times [`STEP_M`]. At 5 nm this sum is accurate to 4e-6
//! in x and y for black bodies (compared with an integration in finer steps); if it were cut at 380 and 780 nm, its
//! error would be 1.4e-4.

/// Wavelength of the first row, metres.
pub const FIRST_WAVELENGTH_M: f64 = 360e-9;

/// Distance between two rows, metres.
pub const STEP_M: f64 = 5e-9;

/// Wavelength of row `index` of [`COLOUR_MATCHING`], metres.
pub fn wavelength_m(index: usize) -> f64 {
    FIRST_WAVELENGTH_M + STEP_M * index as f64
}

/// One row per wavelength: x-bar, y-bar, z-bar.
#[rustfmt::skip] // one wavelength per line, for comparison with the published table
pub const COLOUR_MATCHING: [[f64; 3]; 95] = [
    [1.299e-4, 3.917e-6, 6.061e-4],
    [2.321e-4, 6.965e-6, 0.001086],
    [4.149e-4, 1.239e-5, 0.001946],
    [7.416e-4, 2.202e-5, 0.003486],
    [0.001368, 3.9e-5, 0.00645],
    [0.002236, 6.4e-5, 0.01055],
    [0.004243, 1.2e-4, 0.02005],
    [0.00765, 2.17e-4, 0.03621],
    [0.01431, 3.96e-4, 0.06785],
    [0.02319, 6.4e-4, 0.1102],
    [0.04351, 0.00121, 0.2074],
    [0.07763, 0.00218, 0.3713],
    [0.13438, 0.004, 0.6456],
    [0.21477, 0.0073, 1.03905],
    [0.2839, 0.0116, 1.3856],
    [0.3285, 0.01684, 1.62296],
    [0.34828, 0.023, 1.74706],
    [0.34806, 0.0298, 1.7826],
    [0.3362, 0.038, 1.77211],
    [0.3187, 0.048, 1.7441],
    [0.2908, 0.06, 1.6692],
    [0.2511, 0.0739, 1.5281],
    [0.19536, 0.09098, 1.28764],
    [0.1421, 0.1126, 1.0419],
    [0.09564, 0.13902, 0.81295],
    [0.05795, 0.1693, 0.6162],
    [0.03201, 0.20802, 0.46518],
    [0.0147, 0.2586, 0.3533],
    [0.0049, 0.323, 0.272],
    [0.0024, 0.4073, 0.2123],
    [0.0093, 0.503, 0.1582],
    [0.0291, 0.6082, 0.1117],
    [0.06327, 0.71, 0.07825],
    [0.1096, 0.7932, 0.05725],
    [0.1655, 0.862, 0.04216],
    [0.22575, 0.91485, 0.02984],
    [0.2904, 0.954, 0.0203],
    [0.3597, 0.9803, 0.0134],
    [0.43345, 0.99495, 0.00875],
    [0.51205, 1.0, 0.00575],
    [0.5945, 0.995, 0.0039],
    [0.6784, 0.9786, 0.00275],
    [0.7621, 0.952, 0.0021],
    [0.8425, 0.9154, 0.0018],
    [0.9163, 0.87, 0.00165],
    [0.9786, 0.8163, 0.0014],
    [1.0263, 0.757, 0.0011],
    [1.0567, 0.6949, 0.001],
    [1.0622, 0.631, 8.0e-4],
    [1.0456, 0.5668, 6.0e-4],
    [1.0026, 0.503, 3.4e-4],
    [0.9384, 0.4412, 2.4e-4],
    [0.85445, 0.381, 1.9e-4],
    [0.7514, 0.321, 1.0e-4],
    [0.6424, 0.265, 5.0e-5],
    [0.5419, 0.217, 3.0e-5],
    [0.4479, 0.175, 2.0e-5],
    [0.3608, 0.1382, 1.0e-5],
    [0.2835, 0.107, 0.0],
    [0.2187, 0.0816, 0.0],
    [0.1649, 0.061, 0.0],
    [0.1212, 0.04458, 0.0],
    [0.0874, 0.032, 0.0],
    [0.0636, 0.0232, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0329, 0.01192, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.01584, 0.005723, 0.0],
    [0.01135916, 0.004102, 0.0],
    [0.008110916, 0.002929, 0.0],
    [0.005790346, 0.002091, 0.0],
    [0.004109457, 0.001484, 0.0],
    [0.002899327, 0.001047, 0.0],
    [0.00204919, 7.4e-4, 0.0],
    [0.001439971, 5.2e-4, 0.0],
    [9.999493e-4, 3.611e-4, 0.0],
    [6.900786e-4, 2.492e-4, 0.0],
    [4.760213e-4, 1.719e-4, 0.0],
    [3.323011e-4, 1.2e-4, 0.0],
    [2.348261e-4, 8.48e-5, 0.0],
    [1.661505e-4, 6.0e-5, 0.0],
    [1.17413e-4, 4.24e-5, 0.0],
    [8.307527e-5, 3.0e-5, 0.0],
    [5.870652e-5, 2.12e-5, 0.0],
    [4.150994e-5, 1.499e-5, 0.0],
    [2.935326e-5, 1.06e-5, 0.0],
    [2.067383e-5, 7.4657e-6, 0.0],
    [1.455977e-5, 5.2578e-6, 0.0],
    [1.025398e-5, 3.7029e-6, 0.0],
    [7.221456e-6, 2.6078e-6, 0.0],
    [5.085868e-6, 1.8366e-6, 0.0],
    [3.581652e-6, 1.2934e-6, 0.0],
    [2.522525e-6, 9.1093e-7, 0.0],
    [1.776509e-6, 6.4153e-7, 0.0],
    [1.251141e-6, 4.5181e-7, 0.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_the_published_sums() {
        // The three functions are normalised to the same integral; the CIE's table gives the sums from 380 to 780 nm.
        for (column, published) in [21.371_524, 21.371_327, 21.371_540].into_iter().enumerate() {
            let sum: f64 = COLOUR_MATCHING[4..=84].iter().map(|row| row[column]).sum();
            assert!((sum - published).abs() < 1e-5, "column {column}: {sum}");
        }
    }

    #[test]
    fn luminous_efficiency_is_one_at_555_nm_and_smaller_elsewhere() {
        let brightest: Vec<usize> = (0..COLOUR_MATCHING.len()).filter(|&i| COLOUR_MATCHING[i][1] >= 1.0).collect();
        assert_eq!(brightest.len(), 1);
        assert!((wavelength_m(brightest[0]) - 555e-9).abs() < 1e-15);
        assert!((wavelength_m(COLOUR_MATCHING.len() - 1) - 830e-9).abs() < 1e-15);
    }
}

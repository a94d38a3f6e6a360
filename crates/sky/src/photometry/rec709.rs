//! Linear RGB with the primaries and the D65 white of ITU-R BT.709: luminance, and conversion to and from CIE 1931
//! XYZ.
//!
//! There are two definitions of luminance. The crate uses [`luminance`], with the four-digit weights of BT.709: a
//! pixel's photopic luminance is exactly this sum. The matrices are derived from the chromaticities; their Y row
//! agrees with the weights to 4e-5, so colours are computed with the matrices and then normalised with [`luminance`].

/// Chromaticities x, y of red, green and blue (ITU-R BT.709-6, item 1.3).
pub const PRIMARIES_XY: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Chromaticity x, y of the white D65 (ITU-R BT.709-6, item 1.4).
pub const WHITE_XY: [f64; 2] = [0.3127, 0.3290];

/// Shares of linear red, green and blue in the luminance (ITU-R BT.709-6, item 3.2). Their sum is 1.
pub const LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Rows X, Y, Z; columns red, green, blue. White (1, 1, 1) is mapped to D65 with Y = 1.
pub const XYZ_FROM_REC709: [[f64; 3]; 3] = xyz_from_rec709_matrix();

/// Inverse of [`XYZ_FROM_REC709`].
pub const REC709_FROM_XYZ: [[f64; 3]; 3] = inverse(&XYZ_FROM_REC709);

/// Luminance Y of linear RGB, in the unit of its channels.
#[inline]
pub fn luminance(rgb: [f64; 3]) -> f64 {
    LUMINANCE_WEIGHTS[0] * rgb[0] + LUMINANCE_WEIGHTS[1] * rgb[1] + LUMINANCE_WEIGHTS[2] * rgb[2]
}

/// CIE XYZ from linear RGB.
pub fn xyz_from_rec709(rgb: [f64; 3]) -> [f64; 3] {
    product(&XYZ_FROM_REC709, rgb)
}

/// Linear RGB from CIE XYZ; negative if the colour is outside the gamut.
pub fn rec709_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    product(&REC709_FROM_XYZ, xyz)
}

/// CIE 1976 chromaticity u', v' from linear RGB: 4 X / (X + 15 Y + 3 Z) and 9 Y / (X + 15 Y + 3 Z) (CIE 15). Black
/// has no chromaticity and gives NaN.
pub fn uv_prime(rgb: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = xyz_from_rec709(rgb);
    let sum = x + 15.0 * y + 3.0 * z;
    [4.0 * x / sum, 9.0 * y / sum]
}

/// XYZ of a colour of chromaticity `xy` with Y = 1.
const fn xyz_at_unit_luminance(xy: [f64; 2]) -> [f64; 3] {
    [xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]]
}

/// Scales the three primaries so that equal amounts of them make white (SMPTE RP 177).
const fn xyz_from_rec709_matrix() -> [[f64; 3]; 3] {
    let red = xyz_at_unit_luminance(PRIMARIES_XY[0]);
    let green = xyz_at_unit_luminance(PRIMARIES_XY[1]);
    let blue = xyz_at_unit_luminance(PRIMARIES_XY[2]);
    let primaries = [[red[0], green[0], blue[0]], [red[1], green[1], blue[1]], [red[2], green[2], blue[2]]];
    let scale = product(&inverse(&primaries), xyz_at_unit_luminance(WHITE_XY));
    let mut matrix = primaries;
    let mut row = 0;
    while row < 3 {
        let mut column = 0;
        while column < 3 {
            matrix[row][column] *= scale[column];
            column += 1;
        }
        row += 1;
    }
    matrix
}

const fn product(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    [
        m[0][0] * v[0] + m[0][1] * v[1] + m[0][2] * v[2],
        m[1][0] * v[0] + m[1][1] * v[1] + m[1][2] * v[2],
        m[2][0] * v[0] + m[2][1] * v[1] + m[2][2] * v[2],
    ]
}

/// Inverse by cofactors. Rows of the inverse are the cross products of the columns, divided by the determinant.
const fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut cofactors = [[0.0; 3]; 3];
    let mut row = 0;
    while row < 3 {
        let mut column = 0;
        while column < 3 {
            let (r1, r2, c1, c2) = ((row + 1) % 3, (row + 2) % 3, (column + 1) % 3, (column + 2) % 3);
            cofactors[row][column] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
            column += 1;
        }
        row += 1;
    }
    let determinant = m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2];
    let mut result = [[0.0; 3]; 3];
    row = 0;
    while row < 3 {
        let mut column = 0;
        while column < 3 {
            result[row][column] = cofactors[column][row] / determinant;
            column += 1;
        }
        row += 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_are_inverse_and_map_white_to_d65() {
        let white = xyz_from_rec709([1.0; 3]);
        let sum: f64 = white.iter().sum();
        assert!((white[1] - 1.0).abs() < 1e-14);
        assert!((white[0] / sum - WHITE_XY[0]).abs() < 1e-14 && (white[1] / sum - WHITE_XY[1]).abs() < 1e-14);
        for rgb in [[1.0, 0.0, 0.0], [0.2, 3.0, -0.5], [0.0, 0.0, 7.0]] {
            let back = rec709_from_xyz(xyz_from_rec709(rgb));
            assert!((0..3).all(|c| (back[c] - rgb[c]).abs() < 1e-13), "{rgb:?} became {back:?}");
        }
    }

    #[test]
    fn luminance_weights_are_the_luminance_row_rounded_and_sum_to_one() {
        for (weight, exact) in LUMINANCE_WEIGHTS.iter().zip(XYZ_FROM_REC709[1]) {
            assert!((weight - exact).abs() < 5e-5);
        }
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-15);
        assert!((luminance([10.0, 20.0, 30.0]) - 18.596).abs() < 1e-12);
    }

    #[test]
    fn chromaticities_of_white_and_red_match_published_ones() {
        // u', v' of D65 and of the red primary, from their x, y: 4 x / (12 y - 2 x + 3), 9 y / (12 y - 2 x + 3).
        for (rgb, [u, v]) in [([2.5; 3], [0.197_83, 0.468_32]), ([0.3, 0.0, 0.0], [0.450_70, 0.522_89])] {
            let found = uv_prime(rgb);
            assert!((found[0] - u).abs() < 1e-5 && (found[1] - v).abs() < 1e-5, "{found:?}");
        }
        assert!(uv_prime([0.0; 3])[0].is_nan());
    }
}

//! The eye's response to dim light: colours fade, red darkens and blue brightens (Purkinje shift), because rods take
//! over from cones.
//!
//! Three published formulas, per pixel and in cd/m^2:
//!
//! - The scotopic luminance of a colour from its X, Y, Z: V = Y (1.33 (1 + (Y + Z) / X) - 1.68), by G. W. Larson, H.
//!   Rushmeier and C. Piatko, "A visibility matching tone reproduction operator for high dynamic range scenes", IEEE
//!   TVCG 1997. It is divided here by its value for white, so that white keeps its luminance.
//! - Light seen by rods is displayed as bluish, at the chromaticity x = y = 0.25 of H. W. Jensen, F. Durand, M. M.
//!   Stark, S. Premože, J. Dorsey and P. Shirley, "A physically-based night sky model", SIGGRAPH 2001.
//! - The share of the cones at luminance Y is m = 0.767 + 0.3334 log10(Y), clamped to 0 to 1: the coefficient of
//!   adaptation of CIE 191:2010 (system MES 2), 0 below 0.005 and 1 above 5 cd/m^2.
//!
//! | cd/m^2 | 0.005 | 0.05 | 0.5 | 5 |
//! |---|---|---|---|---|
//! | share of cones | 0 | 0.333 | 0.667 | 1 |
//!
//! The eye is assumed to be adapted to the pixel that it looks at. So a star in a fine pixel keeps its colour, and the
//! Milky Way has no colour. In a coarse pixel, whose luminance is lower, the same star has less colour. If a display
//! reproduces the scene's luminance (`calibrated`), the viewer's eye does all this itself.

use crate::photometry::rec709::{luminance, rec709_from_xyz, xyz_from_rec709};

/// Chromaticity of the displayed light of rods: x = y = 0.25, scaled to Y = 1.
const ROD_XYZ: [f64; 3] = [1.0, 1.0, 2.0];

/// Ratio of scotopic to photopic luminance of a colour, by Larson's approximation.
fn rod_ratio([x, y, z]: [f64; 3]) -> f64 {
    1.33 * (1.0 + (y + z) / x) - 1.68
}

/// Share of the cones in vision at a luminance.
pub fn cone_share(luminance_cd_m2: f64) -> f64 {
    (0.767 + 0.3334 * luminance_cd_m2.log10()).clamp(0.0, 1.0)
}

/// Linear Rec. 709 in cd/m^2 (no channel below 0) as seen by the eye; `amount` from 0 (unchanged) to 1. Black stays
/// black.
pub fn shifted(rgb_cd_m2: [f64; 3], amount: f64) -> [f64; 3] {
    let y = luminance(rgb_cd_m2);
    if y <= 0.0 {
        return [0.0; 3];
    }
    let seen_by_rods = y * rod_ratio(xyz_from_rec709(rgb_cd_m2)) / rod_ratio(xyz_from_rec709([1.0; 3]));
    let rods = rec709_from_xyz(ROD_XYZ).map(|channel| channel * seen_by_rods);
    let share = amount * (1.0 - cone_share(y));
    std::array::from_fn(|c| rgb_cd_m2[c] + share * (rods[c] - rgb_cd_m2[c]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::rec709::uv_prime;

    fn scaled(rgb: [f64; 3], y: f64) -> [f64; 3] {
        rgb.map(|channel| channel * y / luminance(rgb))
    }

    #[test]
    fn shares_of_the_cones_match_the_standard() {
        for (cd_m2, share) in [(0.005, 0.0), (0.05, 1.0 / 3.0), (0.5, 2.0 / 3.0), (5.0, 1.0), (1e-9, 0.0), (1e9, 1.0)] {
            assert!((cone_share(cd_m2) - share).abs() < 1e-3, "{cd_m2}: {}", cone_share(cd_m2));
        }
        assert_eq!(cone_share(0.0), 0.0);
    }

    #[test]
    fn daylight_is_unchanged_and_the_night_has_one_colour() {
        let colours = [[1.0, 1.0, 1.0], [1.0, 0.3, 0.1], [0.3, 0.5, 1.0], [0.0, 0.0, 1.0]];
        for rgb in colours {
            assert_eq!(shifted(scaled(rgb, 10.0), 1.0), scaled(rgb, 10.0));
            assert_eq!(shifted(scaled(rgb, 1e-4), 0.0), scaled(rgb, 1e-4), "amount 0");
            let [u, v] = uv_prime(shifted(scaled(rgb, 1e-4), 1.0));
            // u', v' of x = y = 0.25: 4 x / (12 y - 2 x + 3), 9 y / (12 y - 2 x + 3).
            assert!((u - 1.0 / 5.5).abs() < 1e-9 && (v - 2.25 / 5.5).abs() < 1e-9, "{rgb:?}: {u} {v}");
        }
        assert_eq!(shifted([0.0; 3], 1.0), [0.0; 3]);
    }

    #[test]
    fn red_darkens_blue_brightens_and_white_keeps_its_luminance() {
        let kept = |rgb: [f64; 3]| luminance(shifted(scaled(rgb, 1e-4), 1.0)) / 1e-4;
        assert!((kept([1.0; 3]) - 1.0).abs() < 2e-4, "{}", kept([1.0; 3]));
        // By hand from the primaries' X, Y, Z: red 1.33 (1 + 0.2319 / 0.4124) - 1.68 = 0.398, blue 7.19, white 2.573.
        assert!((kept([1.0, 0.0, 0.0]) - 0.398 / 2.573).abs() < 2e-3, "{}", kept([1.0, 0.0, 0.0]));
        assert!((kept([0.0, 0.0, 1.0]) - 7.19 / 2.573).abs() < 1e-2, "{}", kept([0.0, 0.0, 1.0]));
    }

    #[test]
    fn seen_luminance_increases_with_light() {
        for rgb in [[1.0; 3], [1.0, 0.1, 0.0], [0.0, 0.0, 1.0], [0.2, 1.0, 0.4]] {
            let mut previous = 0.0;
            for step in -400..200 {
                let seen = luminance(shifted(scaled(rgb, 10f64.powf(f64::from(step) / 100.0)), 1.0));
                assert!(seen > previous, "{rgb:?} {step}");
                previous = seen;
            }
        }
    }
}

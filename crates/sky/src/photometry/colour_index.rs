//! Conversion of catalogued colour indices to V magnitudes and effective temperatures.
//!
//! Colour indices are magnitudes, temperatures kelvin. The temperature relations interpolate log T linearly between
//! tabulated points of the dwarf sequence of Pecaut & Mamajek (2013, ApJS 208, 9, Table 5, with the Gaia colours of
//! the table's later versions). A polynomial would be shorter, but is meaningless outside its range; straight lines
//! between points are monotone and end where the table ends. Colours outside it get the temperature of its nearer
//! end. Interstellar reddening is not removed: a star gets the temperature of its observed colour.

/// Range of BP-RP, in magnitudes, for which [`v_from_gaia`] was fitted (Riello et al. 2021, A&A 649, A3, Table C.1).
pub const GAIA_V_BP_RP_RANGE: (f64, f64) = (-0.5, 5.0);

/// V and B-V of Johnson from the magnitudes BT and VT of Tycho (ESA 1997, SP-1200, volume 1, equation 1.3.20; fitted for BT-VT from -0.2 to
/// 1.8).
pub fn johnson_from_tycho(bt: f64, vt: f64) -> [f64; 2] {
    let colour = bt - vt;
    [vt - 0.090 * colour, 0.850 * colour]
}

/// (BP-RP in magnitudes, temperature in kelvin). For stars hotter than B9, where the source has no Gaia colour, the
/// points continue the slope of V-I.
const BP_RP_TEMPERATURE: [(f64, f64); 29] = [
    (-0.60, 45_000.0),
    (-0.45, 33_000.0),
    (-0.36, 25_000.0),
    (-0.28, 18_500.0),
    (-0.20, 14_000.0),
    (-0.12, 10_700.0),
    (-0.037, 9_700.0),
    (0.068, 8_840.0),
    (0.194, 8_080.0),
    (0.377, 7_220.0),
    (0.587, 6_510.0),
    (0.719, 6_060.0),
    (0.823, 5_770.0),
    (0.90, 5_490.0),
    (0.98, 5_280.0),
    (1.10, 5_040.0),
    (1.21, 4_830.0),
    (1.32, 4_600.0),
    (1.45, 4_410.0),
    (1.58, 4_230.0),
    (1.84, 3_870.0),
    (1.97, 3_700.0),
    (2.16, 3_550.0),
    (2.43, 3_410.0),
    (2.84, 3_200.0),
    (3.36, 3_030.0),
    (3.95, 2_850.0),
    (4.40, 2_650.0),
    (5.00, 2_400.0),
];

/// (B-V in magnitudes, temperature in kelvin). Beyond 1.4, B-V hardly changes along the M dwarfs. There the points
/// follow giants and supergiants, because nearly all naked-eye stars of that colour belong to them, and end with carbon
/// stars.
const B_V_TEMPERATURE: [(f64, f64); 29] = [
    (-0.330, 44_900.0),
    (-0.315, 32_500.0),
    (-0.295, 29_000.0),
    (-0.252, 24_500.0),
    (-0.210, 20_600.0),
    (-0.178, 17_000.0),
    (-0.156, 15_700.0),
    (-0.128, 14_000.0),
    (-0.109, 12_500.0),
    (-0.070, 10_700.0),
    (0.000, 9_700.0),
    (0.070, 8_840.0),
    (0.160, 8_080.0),
    (0.290, 7_220.0),
    (0.440, 6_510.0),
    (0.552, 6_060.0),
    (0.650, 5_770.0),
    (0.730, 5_490.0),
    (0.816, 5_280.0),
    (0.884, 5_040.0),
    (0.986, 4_830.0),
    (1.100, 4_600.0),
    (1.240, 4_230.0),
    (1.400, 3_950.0),
    (1.540, 3_800.0),
    (1.650, 3_650.0),
    (1.850, 3_500.0),
    (3.000, 2_800.0),
    (5.000, 2_200.0),
];

/// V magnitude of a source of Gaia magnitude `g` and colour `bp_rp` (both magnitudes, Gaia EDR3 and DR3).
///
/// V - G is the cubic of Riello et al. 2021 (A&A 649, A3, Table C.2), which scatters by 0.03 mag. Colours are clamped
/// to [`GAIA_V_BP_RP_RANGE`], so that the cubic does not diverge for a wrong colour.
pub fn v_from_gaia(g: f64, bp_rp: f64) -> f64 {
    let c = bp_rp.clamp(GAIA_V_BP_RP_RANGE.0, GAIA_V_BP_RP_RANGE.1);
    g + 0.027_04 + c * (-0.014_24 + c * (0.215_6 - c * 0.014_26))
}

/// Effective temperature in kelvin of a star of Gaia colour `bp_rp` (magnitudes): falls monotonically from 45000 K at
/// -0.6 to 2400 K at 5, constant beyond. Source: see the module.
pub fn temperature_k_from_bp_rp(bp_rp: f64) -> f64 {
    interpolate_log(&BP_RP_TEMPERATURE, bp_rp)
}

/// Effective temperature in kelvin of a star of colour `b_v` (Johnson B-V, magnitudes): falls monotonically from 44900 K
/// at -0.33 to 2200 K at 5, constant beyond. Source: see the module.
pub fn temperature_k_from_b_v(b_v: f64) -> f64 {
    interpolate_log(&B_V_TEMPERATURE, b_v)
}

/// Value at `x` of the points `(x, y)`, sorted by x, with log y linear between them and constant outside.
fn interpolate_log(points: &[(f64, f64)], x: f64) -> f64 {
    let next = points.partition_point(|&(px, _)| px <= x);
    if next == 0 {
        return points[0].1;
    }
    let Some(&(x1, y1)) = points.get(next) else { return points[points.len() - 1].1 };
    let (x0, y0) = points[next - 1];
    y0 * (y1 / y0).powf((x - x0) / (x1 - x0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_relations_decrease_strictly_and_stay_in_bounds() {
        for points in [&BP_RP_TEMPERATURE, &B_V_TEMPERATURE] {
            assert!(points.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 > w[1].1), "points out of order");
        }
        for (relation, low, high) in
            [(temperature_k_from_bp_rp as fn(f64) -> f64, -0.6, 5.0), (temperature_k_from_b_v, -0.33, 5.0)]
        {
            let mut last = f64::INFINITY;
            for i in 0..=10_000 {
                let t = relation(low + (high - low) * f64::from(i) / 10_000.0);
                assert!(t < last, "temperature must fall with colour");
                assert!((2_000.0..=45_000.0).contains(&t));
                last = t;
            }
            assert_eq!(relation(-100.0), relation(low));
            assert_eq!(relation(100.0), relation(high));
        }
    }

    #[test]
    fn known_stars_have_their_published_temperatures() {
        // (B-V, BP-RP where well measured, effective temperature): Vega, Procyon, the Sun, Arcturus, Betelgeuse, Rigel.
        for (b_v, t, tolerance) in [
            (0.00, 9_600.0, 0.05),
            (0.42, 6_530.0, 0.05),
            (0.653, 5_772.0, 0.01),
            (1.23, 4_290.0, 0.05),
            (1.85, 3_600.0, 0.06),
            (-0.03, 12_100.0, 0.25),
        ] {
            let got = temperature_k_from_b_v(b_v);
            assert!((got / t - 1.0).abs() < tolerance, "B-V {b_v}: {got} K instead of {t} K");
        }
        // The Sun; Proxima Centauri.
        assert!((temperature_k_from_bp_rp(0.82) / 5_772.0 - 1.0).abs() < 0.01);
        assert!((temperature_k_from_bp_rp(3.80) / 2_950.0 - 1.0).abs() < 0.05);
        // A published cubic gives 0.8 K here.
        assert!((3_000.0..3_300.0).contains(&temperature_k_from_bp_rp(3.0)));
    }

    #[test]
    fn v_follows_from_g_and_the_colour_is_clamped() {
        // Values of the cubic computed by hand.
        assert!((v_from_gaia(10.0, 0.0) - 10.027_04).abs() < 1e-12);
        assert!((v_from_gaia(10.0, 1.0) - 10.214_14).abs() < 1e-9);
        // The Sun: G = -26.90, BP-RP = 0.82 gives V = -26.76.
        assert!((v_from_gaia(-26.90, 0.82) + 26.76).abs() < 0.03);
        assert_eq!(v_from_gaia(10.0, 9.0), v_from_gaia(10.0, 5.0));
        assert_eq!(v_from_gaia(10.0, -3.0), v_from_gaia(10.0, -0.5));
        assert!(v_from_gaia(0.0, 5.0) < 4.0);
    }
}

//! Conversion of civil time to the time of the Earth's rotation (UT1) and the time of planetary motion (TT).

use sofars::{cal::jd2cal, ts::dat};

use crate::{
    polynomial::polynomial,
    units::{DAY_S, J2000_JD, JULIAN_YEAR_S},
};

/// TT - TAI, s.
const TT_TAI_S: f64 = 32.184;
/// Start of leap seconds, 1972-01-01T00:00:00Z, s since 2000-01-01T12:00:00Z.
const LEAP_SECONDS_BEGIN_S: f64 = -10_227.5 * DAY_S;

/// Year until which leap seconds have been announced.
const LEAP_SECONDS_END_YEAR: f64 = 2027.0;
/// Year from which the published prediction holds unchanged.
const PREDICTED_YEAR: f64 = 2150.0;

/// Parameters of the Earth's rotation. Times are s since 2000-01-01T12:00:00 with days of 86,400 s, as in
/// [`SceneObjects::time_s`](crate::scene::SceneObjects::time_s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// UT1 minus civil time, s; below 0.9 from 1972 on, where civil time is UTC.
    pub ut1_minus_utc_s: f64,
    /// TT - UT1, s. `None`: derived from the leap seconds from 1972 to 2026, and estimated before and after.
    pub delta_t_s: Option<f64>,
}

impl Clock {
    /// UT1.
    pub fn ut1_s(&self, time_s: f64) -> f64 {
        time_s + self.ut1_minus_utc_s
    }

    /// TT, s since J2000.0.
    pub fn tt_s(&self, time_s: f64) -> f64 {
        match self.delta_t_s {
            Some(delta_t_s) => self.ut1_s(time_s) + delta_t_s,
            None if year_of(time_s) >= LEAP_SECONDS_END_YEAR => {
                self.ut1_s(time_s) + predicted_delta_t_s(year_of(time_s))
            }
            None if time_s >= LEAP_SECONDS_BEGIN_S => time_s + leap_seconds_s(time_s) + TT_TAI_S,
            None => self.ut1_s(time_s) + estimated_delta_t_s(time_s),
        }
    }
}

fn year_of(time_s: f64) -> f64 {
    2000.0 + time_s / JULIAN_YEAR_S
}

/// TT - UT1 after the announced leap seconds, s, by the same source as [`estimated_delta_t_s`]. The source's curve for this century is from 2005, and
/// has turned out to be 6.5 s too high. The correction for this fades to zero at the year from which the curve is a parabola.
fn predicted_delta_t_s(year: f64) -> f64 {
    let published = |year: f64| {
        let parabola = polynomial(&[-20.0, 0.0, 32.0], (year - 1820.0) / 100.0);
        match year {
            ..2050.0 => polynomial(&[62.92, 0.322_17, 0.005_589], year - 2000.0),
            2050.0..PREDICTED_YEAR => parabola - 0.5628 * (PREDICTED_YEAR - year),
            _ => parabola,
        }
    };
    let begin = LEAP_SECONDS_END_YEAR;
    let known_s = leap_seconds_s((begin - 2000.0) * JULIAN_YEAR_S) + TT_TAI_S;
    let left = ((PREDICTED_YEAR - year) / (PREDICTED_YEAR - begin)).clamp(0.0, 1.0);
    published(year) + (known_s - published(begin)) * left
}

/// TAI - UTC, s, from 1972 on; after the announced leap seconds, the last known value.
fn leap_seconds_s(time_s: f64) -> f64 {
    let date = jd2cal(J2000_JD, time_s / DAY_S);
    date.and_then(|(year, month, day, _)| dat(year, month, day, 0.0)).unwrap_or(37.0)
}

/// TT - UT1 before leap seconds, s, by polynomials (F. Espenak and J. Meeus, "Five Millennium Canon of Solar
/// Eclipses", NASA/TP-2006-214141); within 1 s from 1800 on, within minutes in antiquity.
fn estimated_delta_t_s(time_s: f64) -> f64 {
    let year = year_of(time_s);
    let series = |from: f64, unit: f64, coefficients: &[f64]| polynomial(coefficients, (year - from) / unit);
    match year {
        ..-500.0 => series(1820.0, 100.0, &[-20.0, 0.0, 32.0]),
        -500.0..500.0 => series(
            0.0,
            100.0,
            &[10_583.6, -1_014.41, 33.783_11, -5.952_053, -0.179_845_2, 0.022_174_192, 0.009_031_652_1],
        ),
        500.0..1600.0 => series(
            1000.0,
            100.0,
            &[1_574.2, -556.01, 71.234_72, 0.319_781, -0.850_346_3, -0.005_050_998, 0.008_357_207_3],
        ),
        1600.0..1700.0 => series(1600.0, 1.0, &[120.0, -0.9808, -0.015_32, 1.0 / 7129.0]),
        1700.0..1800.0 => series(1700.0, 1.0, &[8.83, 0.1603, -0.005_928_5, 0.000_133_36, -1.0 / 1_174_000.0]),
        1800.0..1860.0 => series(
            1800.0,
            1.0,
            &[
                13.72,
                -0.332_447,
                0.006_861_2,
                0.004_111_6,
                -0.000_374_36,
                0.000_012_127_2,
                -0.000_000_169_9,
                0.000_000_000_875,
            ],
        ),
        1860.0..1900.0 => {
            series(1860.0, 1.0, &[7.62, 0.5737, -0.251_754, 0.016_806_68, -0.000_447_362_4, 1.0 / 233_174.0])
        }
        1900.0..1920.0 => series(1900.0, 1.0, &[-2.79, 1.494_119, -0.059_893_9, 0.006_196_6, -0.000_197]),
        1920.0..1941.0 => series(1920.0, 1.0, &[21.20, 0.844_93, -0.076_1, 0.002_093_6]),
        1941.0..1961.0 => series(1950.0, 1.0, &[29.07, 0.407, -1.0 / 233.0, 1.0 / 2547.0]),
        _ => series(1975.0, 1.0, &[45.45, 1.067, -1.0 / 260.0, -1.0 / 718.0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leap_seconds_match_their_dates_and_delta_t_is_continuous() {
        for (jd, seconds) in
            [(2_441_317.5, 10.0), (2_451_544.5, 32.0), (2_457_753.5, 36.0), (2_457_754.5, 37.0), (2_461_400.5, 37.0)]
        {
            let time_s = (jd - J2000_JD) * DAY_S;
            let clock = Clock::default();
            assert!((clock.tt_s(time_s) - time_s - seconds - TT_TAI_S).abs() < 1e-6, "{jd}");
            let custom = Clock { ut1_minus_utc_s: 0.3, delta_t_s: Some(60.0) };
            assert!((custom.tt_s(time_s) - time_s - 60.3).abs() < 1e-6);
        }
        // Measured: 1900 -2.7 s, 1950 29.1, 1971 41.2 (IERS).
        for (year, seconds) in [(1900.0, -2.7), (1950.0, 29.1), (1971.0, 41.2)] {
            let estimated_s = estimated_delta_t_s((year - 2000.0) * JULIAN_YEAR_S);
            assert!((estimated_s - seconds).abs() < 0.3, "{year} {estimated_s}");
        }
        // The published table has 203 s for 2100, 442 s for 2200 and 1.1 h for 3000. The correction, which is not in the table, is -2.6 s in 2100
        // and zero in 2200.
        for (year, seconds) in
            [(2027.0, 69.18), (2100.0, 202.7 - 2.65), (2200.0, 442.1), (3000.0, 4435.7), (10_000.0, 214_105.0)]
        {
            let time_s = (year - 2000.0) * JULIAN_YEAR_S;
            let delta_t_s = Clock::default().tt_s(time_s) - time_s;
            assert!((delta_t_s - seconds).abs() < 1.0 + 1e-3 * seconds, "{year} {delta_t_s}");
        }
        for border in [2027.0, 2050.0, 2150.0] {
            let of = |year: f64| {
                let time_s = (year - 2000.0) * JULIAN_YEAR_S;
                Clock::default().tt_s(time_s) - time_s
            };
            assert!((of(border - 1e-6) - of(border + 1e-6)).abs() < 0.5, "{border}");
        }
        for border in [-500.0, 500.0, 1600.0, 1700.0, 1800.0, 1860.0, 1900.0, 1920.0, 1941.0, 1961.0] {
            let [before, after] = [-1e-6, 1e-6].map(|by| estimated_delta_t_s((border + by - 2000.0) * JULIAN_YEAR_S));
            assert!((before - after).abs() < 3.0, "{border} {before} {after}");
        }
    }
}

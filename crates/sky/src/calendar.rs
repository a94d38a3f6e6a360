//! Dates, and the moments that a scene may have.
//!
//! Dates are of the Gregorian calendar, even before its introduction in 1582 (proleptic, as in ISO 8601), or on request of the Julian calendar. Years
//! are astronomical: the year before 1 is 0, and -566 is 567 BC. Days have 86,400 s.

use crate::units::{DAY_S, J2000_JD};

/// First and last year.
pub const YEARS: [i64; 2] = [-6000, 10_000];
/// The first and the last moment of a scene, s since 2000-01-01T12:00:00Z: the beginning of the first year and the end of the last.
pub const MOMENTS_S: [f64; 2] = [new_year_s(YEARS[0]), new_year_s(YEARS[1] + 1)];

/// Days from 1970-01-01 to 2000-01-01.
const DAYS_TO_2000: i64 = 10_957;
/// Julian day number of 1970-01-01, at noon.
const JDN_1970: i64 = 2_440_588;
/// A day, microseconds.
const DAY_US: i64 = 86_400_000_000;
/// Forms of a moment, for messages.
pub const FORMS: &str = "2026-01-01T00:00:00Z, -0567-07-04T12:00:00Z or +10000-01-01T00:00:00Z (Gregorian calendar, year 0 is 1 BC), 1133-08-02T12:00:00Z julian, JD 2451545.0, or MJD 51544.5";
/// Julian date at which modified Julian dates begin (2,400,000.5), without the half day.
const MJD_DAYS: f64 = 2_400_000.0;
/// Julian dates in the years -4713 to -4439. The same numbers are modified Julian dates in the years 1858 to 2132.
const LIKE_MJD: std::ops::Range<f64> = 0.0..100_000.0;
/// Modified Julian dates in the years 8429 to 8703. The same numbers are Julian dates in the years 1858 to 2132.
const LIKE_JD: std::ops::Range<f64> = 2_400_000.0..2_500_000.0;

const fn new_year_s(year: i64) -> f64 {
    (gregorian_days(year, 1, 1) - DAYS_TO_2000) as f64 * DAY_S - 0.5 * DAY_S
}

/// A calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Calendar {
    Gregorian,
    Julian,
}

impl Calendar {
    fn is_leap(self, year: i64) -> bool {
        let every = |count: i64| year.rem_euclid(count) == 0;
        every(4) && (self == Self::Julian || !every(100) || every(400))
    }

    fn days_of(self, year: i64, month: i64) -> i64 {
        match month {
            2 => 28 + i64::from(self.is_leap(year)),
            4 | 6 | 9 | 11 => 30,
            _ => 31,
        }
    }

    /// Days from 1970-01-01 (Gregorian) to a date.
    fn days(self, year: i64, month: i64, day: i64) -> i64 {
        match self {
            Self::Gregorian => gregorian_days(year, month, day),
            Self::Julian => julian_days(year, month, day),
        }
    }
}

/// Day of a year that begins in March.
const fn day_from_march(month: i64, day: i64) -> i64 {
    (153 * ((month + 9) % 12) + 2) / 5 + day - 1
}

/// Days from 1970-01-01 to a date of the Gregorian calendar, by eras of 400 years that begin in March (H. Hinnant,
/// "chrono-Compatible Low-Level Date Algorithms").
pub const fn gregorian_days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_from_march(month, day) - 719_468
}

/// Days from 1970-01-01 (Gregorian) to a date of the Julian calendar, by years that begin in March.
fn julian_days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    // March 1 of the year 0 is day number 1,721,118 (at noon) of the Julian period.
    1_721_118 + 365 * year + year.div_euclid(4) + day_from_march(month, day) - JDN_1970
}

/// The Gregorian date of a number of days from 1970-01-01: the inverse of [`gregorian_days`].
fn gregorian_date(days: i64) -> [i64; 3] {
    let from_march = days + 719_468;
    let era = from_march.div_euclid(146_097);
    let day_of_era = from_march.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let (day, month) = (day_of_year - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    [era * 400 + year_of_era + i64::from(month <= 2), month, day]
}

/// Name of the calendar that applies to dates without the name of a calendar.
const GREGORIAN: &str = "gregorian";
/// Name of the calendar that was used before 1582.
const JULIAN: &str = "julian";

/// Whether a date was skipped when the Gregorian calendar replaced the Julian one. Such a date has to name its calendar.
pub fn is_left_out([year, month, day]: [i64; 3]) -> bool {
    (year, month) == (1582, 10) && (5..=14).contains(&day)
}

/// A Gregorian date and time of day (UTC).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DateTime {
    /// Year, month and day.
    pub date: [i64; 3],
    /// Hour, minute and second.
    pub time: [i64; 3],
    /// Microsecond.
    pub microsecond: i64,
}

impl DateTime {
    /// A moment, s since 2000-01-01T12:00:00Z, rounded to microseconds, which is about the resolution of a 64-bit float; `None` if it is
    /// further than 30,000 years away.
    pub fn new(time_s: f64) -> Option<Self> {
        let since_noon_us = (time_s * 1e6).round();
        if since_noon_us.is_nan() || since_noon_us.abs() > 1e18 {
            return None;
        }
        let unix_us = since_noon_us as i64 + DAYS_TO_2000 * DAY_US + DAY_US / 2;
        let of_day_us = unix_us.rem_euclid(DAY_US);
        let second = of_day_us / 1_000_000;
        Some(Self {
            date: gregorian_date(unix_us.div_euclid(DAY_US)),
            time: [second / 3600, second / 60 % 60, second % 60],
            microsecond: of_day_us % 1_000_000,
        })
    }
}

/// Writes the date in the form that [`moment`] reads; years outside 0 to 9999 have a sign.
impl std::fmt::Display for DateTime {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { date: [year, month, day], time: [hour, minute, second], microsecond } = *self;
        match year {
            0..=9999 => write!(f, "{year:04}")?,
            _ => write!(f, "{}{:04}", if year < 0 { '-' } else { '+' }, year.abs())?,
        }
        write!(f, "-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}")?;
        match microsecond {
            0 => f.write_str("Z"),
            _ => write!(f, ".{}Z", format!("{microsecond:06}").trim_end_matches('0')),
        }?;
        if is_left_out(self.date) { write!(f, " {GREGORIAN}") } else { Ok(()) }
    }
}

/// Text of a moment, s since 2000-01-01T12:00:00Z.
pub fn written(time_s: f64) -> String {
    DateTime::new(time_s).map_or_else(|| format!("{time_s} s from 2000-01-01T12:00:00Z"), |time| time.to_string())
}

/// Checks that a moment, s since 2000-01-01T12:00:00Z, is allowed in a scene.
///
/// # Errors
///
/// The moment is before the first or after the last allowed one, or not a number; the error states the allowed years.
pub fn check(time_s: f64) -> Result<f64, String> {
    let [first, last] = MOMENTS_S;
    if (first..=last).contains(&time_s) {
        return Ok(time_s);
    }
    let [from, to] = YEARS;
    Err(format!("{}: must be in the years {from} to {to}, for which ephemerides are computed", written(time_s)))
}

/// Reads a moment, s since 2000-01-01T12:00:00Z. The text has one of these forms: that of RFC 3339 with years of any length, which need a sign unless
/// they have four or five digits; the same, followed by `julian` (the calendar before 1582) or `gregorian`; `JD` and a Julian date of UTC; or `MJD`
/// and a modified Julian date. The case of letters does not matter. Second 60 is the first second of the next minute.
///
/// # Errors
///
/// The text has another form, its date or time does not exist, or [`check`] refuses it. Two more errors are probable confusions: a Julian date from 0
/// to 100,000 was most likely meant as a modified one, and a modified one from 2,400,000 to 2,500,000 was most likely meant as a Julian date.
pub fn moment(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let after = |prefix: &str| {
        let (start, number) = text.split_at_checked(prefix.len())?;
        start.eq_ignore_ascii_case(prefix).then(|| number.trim())
    };
    let time_s = match (after("JD"), after("MJD")) {
        (Some(number), _) => julian_date_s(number),
        (None, Some(number)) => modified_julian_date_s(number),
        (None, None) => date_time_s(text),
    };
    time_s.map_err(|problem| format!("`{text}`: {problem}")).and_then(check)
}

/// A Julian date. Whole days are subtracted before its fraction is added, which keeps microseconds.
fn julian_date_s(number: &str) -> Result<f64, String> {
    let wrong = || "a Julian date is a decimal number, as in JD 2451545.0".to_owned();
    let [days, part] = days_and_part(number).ok_or_else(wrong)?;
    let time_s = (days - J2000_JD) * DAY_S + part * DAY_S;
    if LIKE_MJD.contains(&(days + part)) {
        return Err(format!(
            "this Julian date is {}; for a modified Julian date write MJD {number}; if this day is meant, write its calendar date",
            written(time_s)
        ));
    }
    Ok(time_s)
}

/// A modified Julian date: the Julian date less 2,400,000.5.
fn modified_julian_date_s(number: &str) -> Result<f64, String> {
    let wrong = || "a modified Julian date is a decimal number, as in MJD 51544.5".to_owned();
    let [days, part] = days_and_part(number).ok_or_else(wrong)?;
    let time_s = (days + MJD_DAYS - J2000_JD) * DAY_S + (part + 0.5) * DAY_S;
    if LIKE_JD.contains(&(days + part)) {
        return Err(format!(
            "this modified Julian date is {}; for a Julian date write JD {number}; if this day is meant, write its calendar date",
            written(time_s)
        ));
    }
    Ok(time_s)
}

/// Splits a decimal number of days into whole days and fraction, both with its sign.
fn days_and_part(number: &str) -> Option<[f64; 2]> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let unsigned = whole.strip_prefix('-').unwrap_or(whole);
    if !digits(unsigned) || !digits(fraction) || unsigned.len() > 9 {
        return None;
    }
    let days: f64 = unsigned.parse().ok()?;
    let part: f64 = format!("0.{fraction}").parse().ok()?;
    let sign = if whole.starts_with('-') { -1.0 } else { 1.0 };
    Some([sign * days, sign * part])
}

/// Reads a number with exactly the given count of digits at the beginning of a text; also returns the rest.
fn digits(text: &str, count: usize) -> Option<(i64, &str)> {
    let (number, rest) = text.split_at_checked(count)?;
    number.bytes().all(|byte| byte.is_ascii_digit()).then(|| number.parse().ok().map(|number| (number, rest)))?
}

/// Reads a year with its sign at the beginning of a text; also returns the rest, from the hyphen on.
fn year(text: &str) -> Option<(i64, &str)> {
    let sign = text.chars().next().filter(|first| matches!(first, '+' | '-'));
    let unsigned = if sign.is_some() { text.get(1..)? } else { text };
    let count = unsigned.bytes().take_while(u8::is_ascii_digit).count();
    let fits = if sign.is_some() { (4..=6).contains(&count) } else { (4..=5).contains(&count) };
    let (year, rest) = digits(unsigned, count).filter(|_| fits)?;
    Some((if sign == Some('-') { -year } else { year }, rest))
}

/// Reads hour and minute of a text `HH:MM`; also returns the rest.
fn hour_and_minute(text: &str) -> Option<([i64; 2], &str)> {
    let (hour, rest) = digits(text, 2)?;
    let (minute, rest) = digits(rest.strip_prefix(':')?, 2)?;
    Some(([hour, minute], rest))
}

fn date_time_s(text: &str) -> Result<f64, String> {
    let wrong = || format!("must be a date with time and offset: {FORMS}");
    let (written, calendar) = match text.split_once(' ').map(|(date, rest)| (date, rest.trim())) {
        None => (text, Calendar::Gregorian),
        Some((date, name)) if name.eq_ignore_ascii_case(GREGORIAN) => (date, Calendar::Gregorian),
        Some((date, name)) if name.eq_ignore_ascii_case(JULIAN) => (date, Calendar::Julian),
        Some(_) => return Err(wrong()),
    };
    let parts = || {
        let (year, rest) = year(written)?;
        let (month, rest) = digits(rest.strip_prefix('-')?, 2)?;
        let (day, rest) = digits(rest.strip_prefix('-')?, 2)?;
        let (time, rest) = hour_and_minute(rest.strip_prefix(['T', 't'])?)?;
        Some(([year, month, day], time, rest))
    };
    let ([year, month, day], [hour, minute], mut rest) = parts().ok_or_else(wrong)?;
    let mut second = 0;
    let mut fraction = 0.0;
    if let Some(after) = rest.strip_prefix(':') {
        (second, rest) = digits(after, 2).ok_or_else(wrong)?;
        if let Some(after) = rest.strip_prefix('.') {
            let count = after.bytes().take_while(u8::is_ascii_digit).count();
            fraction = format!("0.{}", &after[..count]).parse().map_err(|_| wrong())?;
            rest = if count == 0 { return Err(wrong()) } else { &after[count..] };
        }
    }
    let offset_min = match rest {
        "Z" | "z" => 0,
        _ => {
            let sign = if rest.starts_with('-') { -1 } else { 1 };
            let ([hours, minutes], end) = rest.strip_prefix(['+', '-']).and_then(hour_and_minute).ok_or_else(wrong)?;
            if !end.is_empty() {
                return Err(wrong());
            }
            if hours > 23 || minutes > 59 {
                return Err(format!("offset {rest}: must be at most 23:59"));
            }
            sign * (hours * 60 + minutes)
        }
    };
    if !(1..=12).contains(&month) {
        return Err(format!("month {month}: must be 01 to 12"));
    }
    if is_left_out([year, month, day]) && written == text {
        return Err(format!(
            "no calendar in use had this date: in {year}-{month}, day 4 was followed by day 15; append {GREGORIAN} or {JULIAN}"
        ));
    }
    let most = calendar.days_of(year, month);
    if !(1..=most).contains(&day) {
        return Err(format!("day {day}: this month has the days 01 to {most}"));
    }
    if hour > 23 || minute > 59 || second > 60 {
        return Err(format!("time {hour:02}:{minute:02}:{second:02}: must be between 00:00:00 and 23:59:60"));
    }
    let days = calendar.days(year, month, day) - DAYS_TO_2000;
    let seconds = days * 86_400 + (hour * 60 + minute - offset_min - 12 * 60) * 60 + second;
    Ok(seconds as f64 + fraction)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn dates_of_both_calendars_have_their_published_julian_dates() {
        // J. Meeus, "Astronomical Algorithms", chapter 7. The eclipse of 1133-08-02 is dated by the Julian calendar.
        for (text, jd) in [
            ("2000-01-01T12:00:00Z", 2_451_545.0),
            ("1987-06-19T12:00:00Z", 2_446_966.0),
            ("1600-12-31T00:00:00Z", 2_305_812.5),
            ("1582-10-15T00:00:00Z", 2_299_160.5),
            ("1582-10-04T24:00:00Z julian", f64::NAN),
            ("1582-10-05T00:00:00Z julian", 2_299_160.5),
            ("0837-04-10T07:12:00Z julian", 2_026_871.8),
            ("-0123-12-31T00:00:00Z julian", 1_676_496.5),
            ("-1000-07-12T12:00:00Z julian", 1_356_001.0),
            ("-1000-02-29T00:00:00Z julian", 1_355_866.5),
            ("-4712-01-01T12:00:00Z julian", 0.0),
            ("-4713-11-24T12:00:00Z", 0.0),
            ("-4713-11-24T14:00:00+02:00 gregorian", 0.0),
            ("1133-08-02T12:00:00Z julian", 2_135_100.0),
            ("1133-08-09T12:00:00Z", 2_135_100.0),
            ("-0567-07-04T12:00:00Z julian", 1_514_146.0),
            ("+10000-01-01T00:00:00Z", 5_373_484.5),
            ("10000-01-01T00:00:00Z", 5_373_484.5),
            ("1582-10-14T00:00:00Z gregorian", 2_299_159.5),
            ("1582-10-14T00:00:00Z julian", 2_299_169.5),
            ("JD 2451545.0", 2_451_545.0),
            ("JD 2451545", 2_451_545.0),
            ("jd -100000.25", -100_000.25),
            ("Jd 100000", 100_000.0),
            ("JD 999999.5", 999_999.5),
            ("MJD 51544.5", 2_451_545.0),
            ("mjd 51544.5", 2_451_545.0),
            ("MJD61353.83", 2_461_354.33),
            ("MJD 0", 2_400_000.5),
            ("Mjd -678941.25", 1_721_059.25),
            ("1133-08-02T12:00:00Z Julian", 2_135_100.0),
            ("1133-08-09T12:00:00Z  GREGORIAN", 2_135_100.0),
        ] {
            match moment(text) {
                Ok(time_s) => {
                    assert!((time_s / DAY_S + J2000_JD - jd).abs() < 1e-9, "{text}: {}", time_s / DAY_S + J2000_JD);
                }
                Err(problem) => assert!(jd.is_nan() && problem.contains("23:59:60"), "{problem}"),
            }
        }
        // Whole modified Julian dates are at midnight, whole Julian dates at noon.
        assert_eq!(moment("MJD 61353.83"), moment("JD 2461354.33"));
        assert_eq!(moment("MJD 61353"), moment("2026-11-09T00:00:00Z"));
        // Microseconds survive.
        assert!((moment("JD 2461041.500001").unwrap() - moment("2026-01-01T00:00:00.0864Z").unwrap()).abs() < 2e-7);
    }

    #[test]
    fn dates_that_never_were_and_other_texts_are_refused_with_the_reason() {
        for (text, part) in [
            ("2026-02-30T00:00:00Z", "day 30: this month has the days 01 to 28"),
            ("1900-02-29T00:00:00Z", "01 to 28"),
            ("2026-13-01T00:00:00Z", "month 13"),
            ("2026-00-01T00:00:00Z", "month 0"),
            ("2026-04-31T00:00:00Z", "01 to 30"),
            ("2026-04-30T24:00:00Z", "23:59:60"),
            ("2026-04-30T00:00:00+24:00", "at most 23:59"),
            ("100000-01-01T00:00:00Z", "+10000-01-01T00:00:00Z"),
            ("1582-10-05T00:00:00Z", "day 4 was followed by day 15; append gregorian or julian"),
            ("1582-10-14T23:00:00-05:00", "append gregorian"),
            ("567-07-04T00:00:00Z", "must be a date"),
            ("-567-07-04T00:00:00Z", "must be a date"),
            ("2026-01-01T00:00:00", "must be a date with time and offset"),
            ("2026-01-01", "must be a date"),
            ("2026-01-01T00:00:00.Z", "must be a date"),
            ("2026-01-01T00:00:00Zulu", "must be a date"),
            ("2026-01-01T00:00:00Z mayan", "must be a date"),
            ("noon", "must be a date"),
            ("", "must be a date"),
            ("-", "must be a date"),
            ("é026-01-01T00:00:00Z", "must be a date"),
            ("JD", "decimal number"),
            ("JD 1e3", "decimal number"),
            ("JD 2451545.", "decimal number"),
            ("JD inf", "decimal number"),
            ("MJD", "a modified Julian date is a decimal number, as in MJD 51544.5"),
            ("MJD 1e3", "modified Julian date is a decimal number"),
            ("JD 61353.83", "-4545-11-18T07:55:12Z; for a modified Julian date write MJD 61353.83"),
            ("jd 0", "write MJD 0; if this day is meant, write its calendar date"),
            ("JD 99999.9", "write MJD 99999.9"),
            ("MJD 2451545", "8570-12-24T00:00:00Z; for a Julian date write JD 2451545"),
            ("MJD 999999999", "years -6000 to 10000"),
            ("2026-01-01T00:00:00Z Julians", "MJD 51544.5"),
            ("J", "must be a date"),
            ("MJ", "must be a date"),
            ("MJé 1", "must be a date"),
            ("+10001-01-02T00:00:00Z", "years -6000 to 10000"),
            ("-6001-12-31T23:59:59Z", "-6001-12-31T23:59:59Z: must be in the years -6000 to 10000"),
            ("JD 999999999", "years -6000 to 10000"),
        ] {
            let problem = moment(text).unwrap_err();
            assert!(problem.contains(part), "{text}: {problem}");
        }
        // A leap day that only the Julian calendar had.
        assert!(moment("1900-02-29T00:00:00Z julian").is_ok() && moment("2000-02-29T00:00:00Z").is_ok());
        assert!(check(f64::NAN).is_err() && check(f64::INFINITY).is_err());
    }

    #[test]
    fn the_limits_are_exactly_those_of_the_years_and_written_moments_are_read_again() {
        assert_eq!(moment("-6000-01-01T00:00:00Z"), Ok(MOMENTS_S[0]));
        assert_eq!(moment("+10000-12-31T23:59:60Z"), Ok(MOMENTS_S[1]));
        assert!(check(MOMENTS_S[0] - 1e-4).is_err() && check(MOMENTS_S[1] + 1e-4).is_err());
        for time_s in [0.0, MOMENTS_S[0], MOMENTS_S[1], -6.308_23e10, -6.3e10, -1e9 + 0.25, 2.5247e11, 5_097_600.5] {
            assert_eq!(moment(&written(time_s)), Ok(time_s), "{}", written(time_s));
        }
        assert_eq!(written(f64::NAN), "NaN s from 2000-01-01T12:00:00Z");
        // Every day of 400 years around the year 0, and of the years 1887 to 2002.
        for days in (-780_000..-634_000).chain(-30_000..12_000) {
            let [year, month, day] = gregorian_date(days);
            assert_eq!(gregorian_days(year, month, day), days);
            assert!((1..=Calendar::Gregorian.days_of(year, month)).contains(&day), "{year} {month} {day}");
        }
    }
}

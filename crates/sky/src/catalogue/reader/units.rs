//! Numbers and units as files write them.
//!
//! A column is read in one unit: parallaxes in mas, distances in pc, proper motions in mas/yr, radial velocities in km/s, temperatures in K,
//! magnitudes in mag, epochs in years. If a file states another unit of the same kind, numbers are converted. Known spellings are those of the
//! VOUnits recommendation (IVOA 1.1), of FITS, and of the CDS standard for catalogues 2.0 (`10+3K`, `0.01mag`, `[K]` for a logarithm), and those that
//! the Gaia archive used at first (`Angular Velocity[mas/year]`).

use crate::units::{ASTRONOMICAL_UNIT_M, JULIAN_YEAR_S, LIGHT_M_S, PARSEC_M};

/// A light-year, m: the distance that light travels in a Julian year.
const LIGHT_YEAR_M: f64 = LIGHT_M_S * JULIAN_YEAR_S;

/// Physical quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Parallax,
    Distance,
    ProperMotion,
    RadialVelocity,
    Temperature,
    Magnitude,
    Epoch,
}

/// Conversion of a stored number to the unit in which its column is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
    factor: f64,
    /// Whether the stored number is a logarithm of base 10.
    is_log10: bool,
}

impl Default for Conversion {
    fn default() -> Self {
        Self { factor: 1.0, is_log10: false }
    }
}

impl Conversion {
    pub fn apply(self, stored: f64) -> f64 {
        self.factor * if self.is_log10 { 10_f64.powf(stored) } else { stored }
    }
}

/// Units: spellings in lower case, and the size relative to the first unit of the list.
type Spellings = &'static [(&'static [&'static str], f64)];

/// Milliarcseconds.
const ANGLES: Spellings = &[
    (&["mas", "marcsec", "milliarcsec", "milliarcsecond", "milliarcseconds"], 1.0),
    (&["arcsec", "arcsecond", "arcseconds", "as", "\""], 1e3),
    (&["uas", "muas", "\u{b5}as", "\u{3bc}as", "uarcsec", "microarcsec"], 1e-3),
    (&["arcmin"], 6e4),
    (&["deg", "degree", "degrees"], 3.6e6),
];
/// Years.
const TIMES: Spellings =
    &[(&["yr", "a", "year", "years", "julianyear", "julianyears", "jyr"], 1.0), (&["cy", "century"], 100.0)];
/// Parsecs.
const LENGTHS: Spellings = &[
    (&["pc", "parsec", "parsecs"], 1.0),
    (&["kpc"], 1e3),
    (&["mpc"], 1e6),
    (&["ly", "lyr", "lightyear", "lightyears", "light-year", "light-years"], LIGHT_YEAR_M / PARSEC_M),
    (&["au"], ASTRONOMICAL_UNIT_M / PARSEC_M),
];
/// Kilometres per second.
const SPEEDS: Spellings = &[(&["km/s"], 1.0), (&["m/s"], 1e-3)];
/// Kelvin.
const TEMPERATURES: Spellings = &[(&["k", "kelvin"], 1.0), (&["kk"], 1e3)];
const MAGNITUDES: Spellings = &[(&["mag", "mags", "magnitude", "magnitudes"], 1.0), (&["mmag"], 1e-3)];

impl Quantity {
    /// Valid units, for messages.
    fn valid(self) -> &'static str {
        match self {
            Self::Parallax => "mas, arcsec or uas",
            Self::Distance => "pc, kpc, Mpc or lyr",
            Self::ProperMotion => "mas/yr, arcsec/yr, uas/yr or deg/yr",
            Self::RadialVelocity => "km/s or m/s",
            Self::Temperature => "K, kK or [K]",
            Self::Magnitude => "mag or mmag",
            Self::Epoch => "Julian years",
        }
    }

    /// Returns the conversion from a unit; the error lists the valid units.
    pub fn conversion(self, unit: &str) -> Result<Conversion, String> {
        self.converted(unit).ok_or_else(|| format!("is in {}; it must be in {}", super::excerpt(unit), self.valid()))
    }

    fn converted(self, unit: &str) -> Option<Conversion> {
        let unit = unit.to_lowercase().replace([' ', '\'', '_'], "");
        let unit = described(&unit);
        // A logarithm: `[K]`, `log(K)`, `dex(K)`.
        let logarithm = [("[", "]"), ("log(", ")"), ("log10(", ")"), ("dex(", ")")]
            .iter()
            .find_map(|(begin, end)| unit.strip_prefix(begin)?.strip_suffix(end));
        let is_log10 = logarithm.is_some();
        let (number, unit) = leading_number(logarithm.unwrap_or(unit))?;
        let size = match self {
            Self::Parallax => size(unit, ANGLES),
            Self::Distance => size(unit, LENGTHS),
            Self::ProperMotion => {
                let (angle, time) = quotient(unit)?;
                Some(size(&angle, ANGLES)? / size(&time, TIMES)?)
            }
            Self::RadialVelocity => {
                let (length, time) = quotient(unit)?;
                size(&format!("{length}/{time}"), SPEEDS)
            }
            Self::Temperature => size(unit, TEMPERATURES),
            // Some files add the photometric system: `mag(AB)`.
            Self::Magnitude => size(unit.split_once('(').map_or(unit, |(unit, _)| unit), MAGNITUDES),
            Self::Epoch => size(unit, TIMES).filter(|size| *size == 1.0),
        };
        let is_possible = !is_log10 || self == Self::Temperature;
        size.filter(|_| is_possible).map(|size| Conversion { factor: number * size, is_log10 })
    }
}

/// Unit of a right ascension or declination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DirectionUnit {
    Degrees,
    Hours,
    Radians,
}

/// Returns the unit of a right ascension or declination from its spelling; `None` if it is unknown.
pub(super) fn direction_unit(unit: &str) -> Option<DirectionUnit> {
    let unit = unit.to_lowercase().replace([' ', '"', '\''], "");
    Some(match described(&unit) {
        "deg" | "degree" | "degrees" | "\u{b0}" | "d:m:s" | "dms" => DirectionUnit::Degrees,
        "h" | "hr" | "hour" | "hours" | "hourangle" | "15deg" | "h:m:s" | "hms" => DirectionUnit::Hours,
        "rad" | "radian" | "radians" => DirectionUnit::Radians,
        _ => return None,
    })
}

/// Returns the unit in brackets after a word, such as `mas` in `angle[mas]`; otherwise the same text.
fn described(unit: &str) -> &str {
    match unit.split_once('[') {
        Some((word, rest)) if !word.is_empty() && word.bytes().all(|c| c.is_ascii_alphabetic()) => {
            rest.strip_suffix(']').unwrap_or(unit)
        }
        _ => unit,
    }
}

/// Splits a leading number off: `0.01` in `0.01mag`, and 1000 in the form of the CDS, `10+3K`.
fn leading_number(unit: &str) -> Option<(f64, &str)> {
    let end = unit.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '+' && c != '-').unwrap_or(unit.len());
    let (number, rest) = unit.split_at(end);
    let value = match number {
        "" => 1.0,
        number => match number.strip_prefix("10").filter(|power| power.starts_with(['+', '-'])) {
            Some(power) => 10_f64.powi(power.parse().ok().filter(|power: &i32| power.abs() <= 30)?),
            None => number.parse().ok()?,
        },
    };
    Some((value, rest.trim_start_matches(['*', '.'])))
}

/// Returns numerator and denominator of a unit such as `mas/yr`, `mas.yr-1`, `mas yr^-1` or `mas*yr**-1`.
fn quotient(unit: &str) -> Option<(String, String)> {
    if let Some((above, below)) = unit.split_once('/') {
        return Some((above.to_owned(), below.to_owned()));
    }
    let plain = unit.replace(['.', '*', '^', '(', ')', '{', '}', '$'], "");
    let product = plain.strip_suffix("-1")?;
    let below = ["year", "yr", "cy", "a", "s"].into_iter().find(|time| product.ends_with(time))?;
    Some((product[..product.len() - below.len()].to_owned(), below.to_owned()))
}

fn size(unit: &str, spellings: Spellings) -> Option<f64> {
    spellings.iter().find(|(names, _)| names.contains(&unit)).map(|(_, size)| *size)
}

/// Parses a decimal number. Its sign may be the typographic minus. Its exponent may have the letter D, as Fortran writes it, if it has a sign.
pub(super) fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let mut text = text.replace('\u{2212}', "-");
    if let Some(letter) = text.find(['d', 'D'])
        && text[letter + 1..].starts_with(['+', '-'])
    {
        text.replace_range(letter..=letter, "e");
    }
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_one_kind_are_converted() {
        use Quantity::{Distance, Epoch, Magnitude, Parallax, ProperMotion, RadialVelocity, Temperature};
        for (quantity, unit, stored, expected) in [
            (Parallax, "mas", 2.0, 2.0),
            (Parallax, "arcsec", 0.379, 379.0),
            (Parallax, "Angle[mas]", 2.0, 2.0),
            (Parallax, "uas", 2000.0, 2.0),
            (Distance, "kpc", 1.5, 1500.0),
            (Distance, "lyr", 8.6, 2.636_771_986_579),
            (ProperMotion, "mas/yr", 3.0, 3.0),
            (ProperMotion, "mas / year", 3.0, 3.0),
            (ProperMotion, "mas yr^-1", 3.0, 3.0),
            (ProperMotion, "mas.yr**-1", 3.0, 3.0),
            (ProperMotion, "mas a-1", 3.0, 3.0),
            (ProperMotion, "Angular Velocity[mas/year]", 3.0, 3.0),
            (ProperMotion, "milliarcsec/yr", 3.0, 3.0),
            (ProperMotion, "arcsec/year", 3.0, 3000.0),
            (ProperMotion, "arcsec.yr-1", 3.0, 3000.0),
            (ProperMotion, "arcsec/cy", 3.0, 30.0),
            (ProperMotion, "deg/yr", 1e-6, 3.6),
            (RadialVelocity, "km/s", 7.0, 7.0),
            (RadialVelocity, "km.s**-1", 7.0, 7.0),
            (RadialVelocity, "m s-1", 7.0, 0.007),
            (Temperature, "K", 5000.0, 5000.0),
            (Temperature, "10+3K", 9.9, 9900.0),
            (Temperature, "[K]", 4.0, 10_000.0),
            (Temperature, "log(K)", 3.0, 1000.0),
            (Magnitude, "mag", 5.0, 5.0),
            (Magnitude, "0.01mag", 512.0, 5.12),
            (Magnitude, "mmag", 5120.0, 5.12),
            (Magnitude, "mag(AB)", 5.0, 5.0),
            (Epoch, "Time[Julian Years]", 2016.0, 2016.0),
        ] {
            let found = quantity.conversion(unit).unwrap_or_else(|error| panic!("{unit}: {error}")).apply(stored);
            assert!((found / expected - 1.0_f64).abs() < 1e-9, "{quantity:?} in {unit}: {found}");
        }
    }

    #[test]
    fn units_of_another_kind_are_refused() {
        for (quantity, unit) in [
            (Quantity::Parallax, "pc"),
            (Quantity::Distance, "mas"),
            (Quantity::ProperMotion, "mas"),
            (Quantity::ProperMotion, "km/s"),
            (Quantity::ProperMotion, "mas/d"),
            (Quantity::RadialVelocity, "mas/yr"),
            (Quantity::Temperature, "eV"),
            (Quantity::Magnitude, "[mag]"),
            (Quantity::Magnitude, "Jy"),
            (Quantity::Epoch, "d"),
        ] {
            let error = quantity.conversion(unit).expect_err(unit);
            assert!(error.contains(unit) && error.contains("must be in"), "{error}");
        }
    }

    #[test]
    fn directions_have_units_of_their_own() {
        for (unit, expected) in [
            ("deg", Some(DirectionUnit::Degrees)),
            ("Angle[deg]", Some(DirectionUnit::Degrees)),
            ("\"d:m:s\"", Some(DirectionUnit::Degrees)),
            ("d:m:s", Some(DirectionUnit::Degrees)),
            ("h:m:s", Some(DirectionUnit::Hours)),
            ("15deg", Some(DirectionUnit::Hours)),
            ("rad", Some(DirectionUnit::Radians)),
            ("mas", None),
        ] {
            assert_eq!(direction_unit(unit), expected, "{unit}");
        }
    }

    #[test]
    fn numbers_of_fortran_and_with_a_typographic_minus_are_read() {
        for (text, expected) in [
            ("1.0D+01", Some(10.0)),
            ("-2.5d-1", Some(-0.25)),
            ("\u{2212}16.716", Some(-16.716)),
            ("10d30", None),
            ("D+1", None),
            ("1D+1D+1", None),
        ] {
            assert_eq!(number(text), expected, "{text}");
        }
    }
}

//! Parses angles in catalogues: decimal numbers, and hours or degrees with minutes and seconds.
//!
//! Accepted forms: `06 45 08.9`, `06:45:08.9`, `6h45m08.9s`, `-16 42 58`, `-16d42m58s` and `-16°42'58"`; missing trailing parts are zero. The sign is
//! taken from the text and not from the first number, so that `-00 30 10` stays negative.

use super::units;

/// An angle as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Angle {
    /// A decimal number; the caller knows its unit.
    Decimal(f64),
    /// An angle of two or three parts, or of one part with a unit mark. The value is in the unit of the first part (hours or degrees).
    Sexagesimal {
        /// Value in hours or degrees, with its sign.
        value: f64,
        /// The unit, if the text marks it.
        unit: Option<Unit>,
    },
}

/// Unit of the first part of a sexagesimal angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    /// Marked `h`.
    Hours,
    /// Marked `d` or `°`.
    Degrees,
}

/// Parses one angle. The error describes the problem without repeating the text.
pub(super) fn parse(text: &str) -> Result<Angle, String> {
    let text = text.trim();
    if let Some(value) = units::number(text) {
        return if value.is_finite() { Ok(Angle::Decimal(value)) } else { Err("is not finite".into()) };
    }
    // Parse the sign, and the unit of the first part.
    let (negative, digits) = match text.as_bytes().first() {
        Some(b'-') => (true, &text[1..]),
        Some(b'+') => (false, &text[1..]),
        _ => match text.strip_prefix('\u{2212}') {
            Some(rest) => (true, rest),
            None => (false, text),
        },
    };
    let unit = match digits.find(|c: char| !c.is_ascii_digit() && c != '.').and_then(|i| digits[i..].chars().next()) {
        Some('h' | 'H') => Some(Unit::Hours),
        Some('d' | 'D' | '°') => Some(Unit::Degrees),
        _ => None,
    };
    let is_separator = |c: char| c.is_whitespace() || matches!(c, ':' | '\'' | '"' | '′' | '″' | '°') || unit_letter(c);
    // Parse up to three parts; only the last one may have a fraction.
    let mut parts = [0.0; 3];
    let mut count = 0;
    let mut whole = true;
    for part in digits.split(is_separator).filter(|part| !part.is_empty()) {
        if count == 3 {
            return Err("has more than three parts".into());
        }
        if !whole {
            return Err("has a fraction before its last part".into());
        }
        if !part.bytes().all(|b| b.is_ascii_digit() || b == b'.') {
            return Err("is neither a number nor an angle such as 06 45 08.9".into());
        }
        parts[count] =
            part.parse::<f64>().map_err(|_| String::from("is neither a number nor an angle such as 06 45 08.9"))?;
        whole = !part.contains('.');
        count += 1;
    }
    if count == 0 || (count == 1 && unit.is_none()) {
        return Err("is neither a number nor an angle such as 06 45 08.9".into());
    }
    // Rounding in catalogues may produce 60 seconds; more is an error.
    if parts[1] >= 60.0 || parts[2] > 60.0 {
        return Err("has 60 minutes or more, or more than 60 seconds".into());
    }
    let magnitude = parts[0] + parts[1] / 60.0 + parts[2] / 3600.0;
    Ok(Angle::Sexagesimal { value: if negative { -magnitude } else { magnitude }, unit })
}

/// Letters that separate parts: hours, degrees, minutes, seconds.
fn unit_letter(c: char) -> bool {
    matches!(c, 'h' | 'H' | 'd' | 'D' | 'm' | 'M' | 's' | 'S')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        match parse(text).unwrap() {
            Angle::Decimal(v) | Angle::Sexagesimal { value: v, .. } => v,
        }
    }

    #[test]
    fn every_form_of_one_angle_gives_the_same_value() {
        let hours = 6.0 + 45.0 / 60.0 + 8.9 / 3600.0;
        for text in [
            "06 45 08.9",
            "06:45:08.9",
            "6h45m08.9s",
            "6h 45m 08.9s",
            " +06  45  08.9 ",
            "6.752472222222222",
            "67.52472222222222D-01",
        ] {
            assert!((value(text) - hours).abs() < 1e-12, "{text}");
        }
        let degrees = -(16.0 + 42.0 / 60.0 + 58.0 / 3600.0);
        for text in [
            "-16 42 58",
            "-16:42:58",
            "-16d42m58s",
            "-16°42'58\"",
            "\u{2212}16 42 58",
            "-16.71611111111111",
            "\u{2212}16.71611111111111",
        ] {
            assert!((value(text) - degrees).abs() < 1e-12, "{text}");
        }
    }

    #[test]
    fn minus_zero_degrees_stay_negative() {
        assert!((value("-00 30 10") + (30.0 / 60.0 + 10.0 / 3600.0)).abs() < 1e-12);
    }

    #[test]
    fn units_are_read_from_the_text() {
        assert!(matches!(parse("6h"), Ok(Angle::Sexagesimal { unit: Some(Unit::Hours), .. })));
        assert!(matches!(parse("101d17m"), Ok(Angle::Sexagesimal { unit: Some(Unit::Degrees), .. })));
        assert!(matches!(parse("06 45"), Ok(Angle::Sexagesimal { unit: None, .. })));
        assert_eq!(parse("6"), Ok(Angle::Decimal(6.0)));
    }

    #[test]
    fn nonsense_is_refused() {
        for text in
            ["", "-", "abc", "1 2 3 4", "06 60 00", "06 00 61", "6.5 30 0", "1-2-3", "h", "inf", "nan", "--5", "1..2 3"]
        {
            assert!(parse(text).is_err(), "{text:?} was read as {:?}", parse(text));
        }
    }
}

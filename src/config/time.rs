//! Times in configurations: TOML dates, or text for years that TOML does not support and for Julian dates.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::value::{Date, Datetime, Offset, Time};

use crate::calendar::{self, DateTime};

/// A time, and the form in which it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenTime {
    time_s: f64,
    form: Form,
}

#[derive(Clone, Debug, PartialEq)]
enum Form {
    Date(Datetime),
    Text(String),
}

impl WrittenTime {
    /// Writes a time, s since 2000-01-01T12:00:00Z, rounded to microseconds: as a TOML date in the years 0 to 9999, otherwise as text. `None`: the
    /// time is outside the range of a scene.
    pub fn new(time_s: f64) -> Option<Self> {
        calendar::check(time_s).ok()?;
        let written = DateTime::new(time_s)?;
        let form = toml_date(&written).map_or_else(|| Form::Text(written.to_string()), Form::Date);
        Some(Self { time_s, form })
    }

    /// The moment, s since 2000-01-01T12:00:00Z. Days have 86,400 s: leap seconds are left out, and a 60th second is the first of the next
    /// minute.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The time as TOML; text has quotation marks.
    pub fn to_toml(&self) -> String {
        match &self.form {
            Form::Date(date) => date.to_string(),
            Form::Text(text) => format!("\"{text}\""),
        }
    }

    /// The time as a value in a TOML document.
    pub(super) fn to_value(&self) -> toml::Value {
        match &self.form {
            Form::Date(date) => toml::Value::Datetime(*date),
            Form::Text(text) => toml::Value::String(text.clone()),
        }
    }

    fn from_date(date: Datetime) -> Result<Self, String> {
        if date.date.is_none() || date.time.is_none() || date.offset.is_none() {
            return Err(format!("{date}: date, time and offset are needed, for instance 2026-01-01T00:00:00Z"));
        }
        Ok(Self { time_s: calendar::moment(&date.to_string())?, form: Form::Date(date) })
    }

    fn from_text(text: &str) -> Result<Self, String> {
        Ok(Self { time_s: calendar::moment(text)?, form: Form::Text(text.to_owned()) })
    }
}

/// The time as it was written, without quotation marks.
impl fmt::Display for WrittenTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.form {
            Form::Date(date) => date.fmt(f),
            Form::Text(text) => f.write_str(text),
        }
    }
}

/// Converts a date to TOML's type; `None` outside the years 0 to 9999, and for dates that must name their calendar.
fn toml_date(DateTime { date: [year, month, day], time, microsecond }: &DateTime) -> Option<Datetime> {
    let small = |value: &i64| u8::try_from(*value).ok();
    // A date that does not exist in the default calendar has to name its calendar.
    if calendar::is_left_out([*year, *month, *day]) {
        return None;
    }
    let [hour, minute, second] = time;
    Some(Datetime {
        date: Some(Date {
            year: u16::try_from(*year).ok().filter(|year| *year <= 9999)?,
            month: small(month)?,
            day: small(day)?,
        }),
        time: Some(Time {
            hour: small(hour)?,
            minute: small(minute)?,
            second: small(second),
            nanosecond: u32::try_from(microsecond * 1000).ok().filter(|nanoseconds| *nanoseconds > 0),
        }),
        offset: Some(Offset::Z),
    })
}

impl Serialize for WrittenTime {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.form {
            Form::Date(date) => date.serialize(serializer),
            Form::Text(text) => text.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for WrittenTime {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Written;
        impl<'de> Visitor<'de> for Written {
            type Value = WrittenTime;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(formatter, "a date with time and offset, or text: {}", calendar::FORMS)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<WrittenTime, E> {
                WrittenTime::from_text(text).map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<WrittenTime, A::Error> {
                let date = Datetime::deserialize(MapAccessDeserializer::new(map))?;
                WrittenTime::from_date(date).map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(Written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Holder {
        time: WrittenTime,
    }

    fn read(value: &str) -> Result<WrittenTime, String> {
        let holder: Result<Holder, _> = toml::from_str(&format!("time = {value}"));
        holder.map(|holder| holder.time).map_err(|error| error.to_string())
    }

    #[test]
    fn times_count_from_noon_of_the_first_of_january_2000() {
        // These are Unix times as printed by `date -d`, minus 946,728,000.
        for (text, unix_s) in [
            ("2000-01-01T12:00:00Z", 946_728_000.0),
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-02-29T00:00:00Z", 951_782_400.0),
            ("2026-01-01 00:00:00Z", 1_767_225_600.0),
            ("2031-05-06T07:08:09.5+02:00", 1_935_810_489.5),
            ("1900-03-01T00:00:00-01:30", -2_203_885_800.0),
            ("2016-12-31T23:59:60Z", 1_483_228_800.0),
            ("'+2031-05-06T07:08:09.5+02:00'", 1_935_810_489.5),
            ("'JD 2451545.0'", 946_728_000.0),
        ] {
            assert_eq!(read(text).map(|time| time.time_s()), Ok(unix_s - 946_728_000.0), "{text}");
        }
    }

    #[test]
    fn written_times_are_read_as_the_same_moments() {
        for time_s in [
            0.0,
            -1e9 + 0.25,
            8.2e8 + 0.125,
            5_097_600.0,
            5_184_000.0,
            -6e10,
            2.4e11,
            -8.1e10,
            2.5247e11,
            -1.316_640_96e10,
        ] {
            let time = WrittenTime::new(time_s).expect("a scene may have it");
            let read = read(&time.to_toml()).expect("it is TOML");
            assert_eq!((read.time_s(), &read), (time_s, &time), "{time}");
        }
        let new_year = WrittenTime::new(820_497_600.0).map(|time| time.to_toml());
        assert_eq!(new_year.as_deref(), Some("2026-01-01T00:00:00Z"));
        let early = WrittenTime::new(-8.1e10).map(|time| time.to_toml());
        assert_eq!(early.as_deref(), Some("\"-0567-03-19T12:00:00Z\""));
        for beyond_s in [-3e11, 2.6e11, f64::NAN, f64::INFINITY] {
            assert_eq!(WrittenTime::new(beyond_s), None, "{beyond_s}");
        }
    }

    #[test]
    fn other_values_are_refused_with_the_valid_forms() {
        for (value, part) in [
            ("3", "JD 2451545.0"),
            ("2026-01-01", "offset are needed"),
            ("'2026-02-30T00:00:00Z'", "day 30"),
            ("'1582-02-29T00:00:00Z'", "01 to 28"),
            ("1582-10-10T00:00:00Z", "append gregorian or julian"),
            ("'noon'", "julian"),
            ("'-6001-01-01T00:00:00Z'", "years -6000 to 10000"),
        ] {
            let problem = read(value).expect_err(value);
            assert!(problem.contains(part), "{value}: {problem}");
        }
    }
}

//! Values of a JSON document with their location, for messages.

use glam::{DMat3, DMat4, DQuat, DVec2, DVec3};
use serde_json::Value;

use super::{
    content::yaw_pitch_roll,
    fault::{Fault, rounded},
};

/// The keys of yaw, pitch and roll. The current name comes first, then the names in SGCT's XML configurations, from which older JSON configurations
/// were converted.
pub(super) const ANGLES: [&[&str]; 3] = [&["yaw", "heading", "azimuth"], &["pitch", "elevation"], &["roll", "bank"]];
const QUATERNION: [&[&str]; 4] = [&["x"], &["y"], &["z"], &["w"]];

/// A value with its location for messages. Keys are case-insensitive.
#[derive(Clone)]
pub(super) struct Field<'a> {
    pub value: &'a Value,
    pub place: String,
}

impl<'a> Field<'a> {
    pub fn get(&self, key: &str) -> Result<Option<Self>, Fault> {
        let Value::Object(map) = self.value else {
            return Err(Fault::new(&self.place, "not an object", "must be an object"));
        };
        let mut found = map.iter().filter(|(name, _)| name.eq_ignore_ascii_case(key));
        let place = if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) };
        match (found.next(), found.next()) {
            (Some(_), Some(_)) => Err(Fault::new(place, "it occurs twice", "must occur once")),
            (Some((_, value)), None) if !value.is_null() => Ok(Some(Self { value, place })),
            _ => Ok(None),
        }
    }

    pub fn needed(&self, key: &str) -> Result<Self, Fault> {
        let place = if self.place.is_empty() { "configuration" } else { &self.place };
        self.get(key)?.ok_or_else(|| Fault::new(place, format!("`{key}` is missing"), "it is required"))
    }

    pub fn number(&self) -> Result<f64, Fault> {
        self.value
            .as_f64()
            .filter(|number| number.is_finite())
            .ok_or_else(|| Fault::new(&self.place, "not a number", "must be a finite number"))
    }

    pub fn optional_number(&self, key: &str) -> Result<Option<f64>, Fault> {
        self.get(key)?.map(|field| field.number()).transpose()
    }

    /// Returns whether an optional key is present and true.
    pub fn flag(&self, key: &str, default: bool) -> Result<bool, Fault> {
        let Some(field) = self.get(key)? else { return Ok(default) };
        field.value.as_bool().ok_or_else(|| Fault::new(&field.place, "neither true nor false", "must be one of them"))
    }

    pub fn text(&self) -> Result<&'a str, Fault> {
        self.value.as_str().ok_or_else(|| Fault::new(&self.place, "not a text", "must be a text"))
    }

    pub fn list(&self) -> Result<Vec<Self>, Fault> {
        let Value::Array(values) = self.value else {
            return Err(Fault::new(&self.place, "not a list", "must be a list"));
        };
        Ok(values.iter().enumerate().map(|(i, value)| Self { value, place: format!("{}[{i}]", self.place) }).collect())
    }

    pub fn pair(&self) -> Result<DVec2, Fault> {
        Ok(DVec2::new(self.needed("x")?.number()?, self.needed("y")?.number()?))
    }

    pub fn vector(&self) -> Result<DVec3, Fault> {
        Ok(DVec3::new(self.needed("x")?.number()?, self.needed("y")?.number()?, self.needed("z")?.number()?))
    }

    /// 16 numbers, column by column.
    pub fn matrix(&self) -> Result<DMat4, Fault> {
        let numbers = self.list()?.iter().map(Field::number).collect::<Result<Vec<f64>, _>>()?;
        let sixteen: [f64; 16] = numbers.try_into().map_err(|numbers: Vec<f64>| {
            let problem = format!("{} numbers", numbers.len());
            Fault::new(&self.place, problem, "must be a matrix of 16 numbers, column by column")
        })?;
        Ok(DMat4::from_cols_array(&sixteen))
    }

    /// Returns the number of a key that has had several names.
    fn named_number(&self, names: &[&str]) -> Result<Option<f64>, Fault> {
        let mut found = None;
        for name in names {
            let Some(field) = self.get(name)? else { continue };
            if found.replace(field.number()?).is_some() {
                let problem = format!("it occurs twice: {} have the same meaning", names.join(", "));
                return Err(Fault::new(field.place, problem, "must occur once"));
            }
        }
        Ok(found)
    }

    /// Returns the numbers of several keys, each of which may have several names; `None` if none of the keys is present. An error if only some are
    /// present.
    fn all_numbers<const N: usize>(&self, keys: [&[&str]; N]) -> Result<Option<[f64; N]>, Fault> {
        let mut numbers = [0.0; N];
        let mut missing = Vec::new();
        for (number, names) in numbers.iter_mut().zip(keys) {
            match self.named_number(names)? {
                Some(found) => *number = found,
                None => missing.push(names[0]),
            }
        }
        if missing.is_empty() {
            return Ok(Some(numbers));
        }
        if missing.len() == N {
            return Ok(None);
        }
        let all = keys.map(|names| names[0]).join(", ");
        Err(Fault::new(&self.place, format!("{} is missing", missing.join(" and ")), format!("must have all of {all}")))
    }

    /// A quaternion, or yaw, pitch and roll in degrees.
    pub fn rotation(&self) -> Result<DMat3, Fault> {
        match (self.all_numbers(ANGLES)?, self.all_numbers(QUATERNION)?) {
            (Some(angles), None) => {
                let [yaw, pitch, roll] = angles.map(f64::to_radians);
                Ok(yaw_pitch_roll(yaw, pitch, roll))
            }
            (None, Some(parts)) => {
                let quaternion = DQuat::from_xyzw(parts[0], parts[1], parts[2], parts[3]);
                if quaternion.length().is_nan() || (quaternion.length() - 1.0).abs() >= 1e-3 {
                    let problem = format!("it has the length {}", rounded(quaternion.length()));
                    return Err(Fault::new(&self.place, problem, "must be a unit quaternion"));
                }
                Ok(DMat3::from_quat(quaternion.normalize()))
            }
            (angles, _) => {
                let problem = match angles {
                    Some(_) => "yaw, pitch and roll and also a quaternion",
                    None => "neither yaw, pitch and roll nor a quaternion",
                };
                Err(Fault::new(
                    &self.place,
                    problem,
                    "must have either yaw, pitch and roll in degrees, or x, y, z and w",
                ))
            }
        }
    }
}

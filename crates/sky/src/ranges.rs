//! Ranges of numbers. Each is written once, as attributes of the field in settings and specifications, and is part of the JSON schema.
//!
//! ```ignore
//! #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "of the light"))]
//! pub fraction: f64,
//! ```
//!
//! `extend("exclusiveMinimum" = 0.0)` excludes the lower bound itself; `inner(range(..))` is the range of each element of a list. [`check`] compares
//! a value with the schema of its type, and refuses NaN, infinities and numbers out of range. [`Ranges::of`] lists all ranges of a schema for
//! documentation and tests.

use std::{
    any::TypeId,
    collections::HashMap,
    fmt,
    sync::{LazyLock, Mutex, PoisonError},
};

use schemars::{JsonSchema, generate::SchemaSettings};
use serde_json::Value as Schema;
use toml::Value;

/// The unit of a number, as messages name it. The documentation shows it unless the suffix of the key already states it.
const UNIT: &str = "x-unit";
/// Further condition on a number: `a power of two`.
const ALSO: &str = "x-also";

/// Range of a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// Lower bound; `None`: there is none.
    pub least: Option<f64>,
    /// Whether the lower bound itself is excluded.
    pub above: bool,
    /// Upper bound; `None`: there is none. Infinities are refused in any case.
    pub most: Option<f64>,
    /// Unit for messages; empty if the name of the key states it.
    pub unit: String,
    /// Further condition for messages, such as `a power of two`; empty if there is none.
    pub also: String,
}

impl Range {
    /// The range in the schema of a number; `None` if the schema sets no bound.
    pub fn of_schema(schema: &Schema) -> Option<Self> {
        let bound = |key: &str| schema.get(key).and_then(Schema::as_f64);
        let text = |key: &str| schema.get(key).and_then(Schema::as_str).unwrap_or_default().to_owned();
        let (above, most) = (bound("exclusiveMinimum"), bound("maximum"));
        let least = above.or(bound("minimum"));
        // The lower bound 0, which every unsigned integer has, does not count as a range.
        let by_type = least == Some(0.0) && most.is_none() && schema.get("type").is_some_and(is_integer);
        let is_bounded = (least.is_some() && !by_type) || most.is_some();
        is_bounded.then(|| Self { least, above: above.is_some(), most, unit: text(UNIT), also: text(ALSO) })
    }

    /// Whether the range contains the number. NaN and infinities are in no range.
    pub fn contains(&self, value: f64) -> bool {
        let above = self.least.is_none_or(|least| if self.above { value > least } else { value >= least });
        value.is_finite() && above && self.most.is_none_or(|most| value <= most)
    }

    /// The range as the documentation writes it, without the unit: `0 to 1`, `above 0 up to 10`, `from 0`.
    pub fn short(&self) -> String {
        let bounds = match (self.least.map(number), self.above, self.most.map(number)) {
            (Some(least), true, Some(most)) => format!("above {least} up to {most}"),
            (Some(least), true, None) => format!("above {least}"),
            (Some(least), false, Some(most)) => format!("{least} to {most}"),
            (Some(least), false, None) => format!("from {least}"),
            (None, _, Some(most)) => format!("up to {most}"),
            (None, _, None) => String::new(),
        };
        if self.also.is_empty() { bounds } else { format!("{bounds}, {}", self.also) }
    }
}

/// `must be between 0 and 1 of the light`, `must be above 0 and at most 10 pixels`, `must be at least 0 s`.
impl fmt::Display for Range {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.least.map(number), self.above, self.most.map(number)) {
            (Some(least), true, Some(most)) => write!(formatter, "must be above {least} and at most {most}")?,
            (Some(least), true, None) => write!(formatter, "must be above {least}")?,
            (Some(least), false, Some(most)) => write!(formatter, "must be between {least} and {most}")?,
            (Some(least), false, None) => write!(formatter, "must be at least {least}")?,
            (None, _, Some(most)) => write!(formatter, "must be at most {most}")?,
            (None, _, None) => formatter.write_str("must be a finite number")?,
        }
        if !self.unit.is_empty() {
            write!(formatter, " {}", self.unit)?;
        }
        if self.also.is_empty() { Ok(()) } else { write!(formatter, ", {}", self.also) }
    }
}

/// A bound as people write it: 1e12, not 1000000000000.
pub fn number(value: f64) -> String {
    let (plain, short) = (format!("{value}"), format!("{value:e}"));
    if short.len() + 4 < plain.len() { short } else { plain }
}

/// A key that is unknown or missing, or whose value is not valid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", joined(.key, .problem))]
pub struct KeyError {
    /// Path of the key within the checked value: `fov.left_deg`, `position_m[2]`; empty for the value itself.
    pub key: String,
    /// The problem, and the valid values.
    pub problem: String,
}

fn joined(key: &str, problem: &str) -> String {
    if key.is_empty() { problem.to_owned() } else { format!("{key}: {problem}") }
}

impl KeyError {
    /// An error of `key`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { key: key.into(), problem: problem.into() }
    }

    /// The same error with the path `prefix` before its key.
    #[must_use]
    pub fn within(self, prefix: &str) -> Self {
        Self { key: key_below(prefix, &self.key), ..self }
    }
}

/// Path of `key` below `prefix`.
pub fn key_below(prefix: &str, key: &str) -> String {
    match (prefix.is_empty(), key.is_empty()) {
        (true, _) => key.to_owned(),
        (_, true) => prefix.to_owned(),
        _ if key.starts_with('[') => format!("{prefix}{key}"),
        _ => format!("{prefix}.{key}"),
    }
}

/// JSON schema of a type, draft 7, without references. It is made once for each type.
pub fn schema_of<T: JsonSchema + 'static>() -> &'static Schema {
    static SCHEMAS: LazyLock<Mutex<HashMap<TypeId, &'static Schema>>> = LazyLock::new(Mutex::default);
    let mut schemas = SCHEMAS.lock().unwrap_or_else(PoisonError::into_inner);
    schemas.entry(TypeId::of::<T>()).or_insert_with(|| {
        let mut settings = SchemaSettings::draft07();
        settings.inline_subschemas = true;
        let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
        normalise(&mut schema);
        Box::leak(Box::new(schema))
    })
}

fn is_integer(kind: &Schema) -> bool {
    kind == "integer" || kind.as_array().is_some_and(|kinds| kinds.iter().any(|kind| kind == "integer"))
}

/// Moves the bounds of a list to its elements, and writes bounds of integers as integers.
fn normalise(schema: &mut Schema) {
    match schema {
        Schema::Array(values) => values.iter_mut().for_each(normalise),
        Schema::Object(object) => {
            if object.contains_key("items") {
                let moved: Vec<_> =
                    ["exclusiveMinimum", UNIT, ALSO].iter().filter_map(|key| object.remove_entry(*key)).collect();
                if let Some(Schema::Object(items)) = object.get_mut("items") {
                    items.extend(moved);
                }
            }
            if object.contains_key("exclusiveMinimum") {
                object.remove("minimum");
            }
            if object.get("type").is_some_and(is_integer) {
                for key in ["minimum", "maximum"] {
                    if let Some(bound) = object.get_mut(key)
                        && let Some(value) = bound.as_f64()
                    {
                        *bound = Schema::from(value as i64);
                    }
                }
            }
            object.values_mut().for_each(normalise);
        }
        _ => {}
    }
}

/// Checks all numbers of a value against the schema of its type.
///
/// # Errors
///
/// The first number that is out of range, NaN or infinite.
pub fn check<T: JsonSchema + 'static>(value: &Value) -> Result<(), KeyError> {
    walk(schema_of::<T>(), value, "")
}

fn walk(schema: &Schema, value: &Value, path: &str) -> Result<(), KeyError> {
    // If the schema allows several forms, or no value, check the form that fits the value.
    for forms in ["oneOf", "anyOf"] {
        if let Some(forms) = schema.get(forms).and_then(Schema::as_array)
            && let Some(form) = forms.iter().find(|form| fits(form, value))
        {
            walk(form, value, path)?;
        }
    }
    match value {
        Value::Float(value) => check_number(schema, *value, path),
        Value::Integer(value) => check_number(schema, *value as f64, path),
        Value::Array(values) => {
            let Some(items) = schema.get("items") else { return Ok(()) };
            let mut values = values.iter().enumerate();
            values.try_for_each(|(index, value)| walk(items, value, &format!("{path}[{index}]")))
        }
        Value::Table(table) => table.iter().try_for_each(|(key, value)| {
            let Some(inner) = schema.get("properties").and_then(|keys| keys.get(key)) else { return Ok(()) };
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            walk(inner, value, &path)
        }),
        _ => Ok(()),
    }
}

fn check_number(schema: &Schema, value: f64, path: &str) -> Result<(), KeyError> {
    let refused = |problem: String| Err(KeyError::new(path, problem));
    if !value.is_finite() {
        return refused(format!("{value}: must be a finite number"));
    }
    match Range::of_schema(schema) {
        Some(range) if !range.contains(value) => refused(format!("{}: {range}", number(value))),
        _ => Ok(()),
    }
}

/// Whether a form of a schema fits the value, judged by its type and, for a table, by its keys.
fn fits(form: &Schema, value: &Value) -> bool {
    let kind = match value {
        Value::Float(_) => "number",
        Value::Integer(_) => "integer",
        Value::Array(_) => "array",
        Value::Table(_) => "object",
        Value::Boolean(_) => "boolean",
        Value::String(_) | Value::Datetime(_) => "string",
    };
    let named = |name: &Schema| name == kind || (kind == "integer" && name == "number");
    let of_kind = match form.get("type") {
        Some(Schema::Array(kinds)) => kinds.iter().any(named),
        Some(name) => named(name),
        None => form.get("oneOf").or(form.get("anyOf")).is_some(),
    };
    let Value::Table(table) = value else { return of_kind };
    let tagged = |(key, inner): (&String, &Schema)| match (inner.get("const"), table.get(key)) {
        (Some(tag), Some(Value::String(value))) => tag == value,
        (Some(_), _) => false,
        (None, _) => true,
    };
    let tags = form.get("properties").and_then(Schema::as_object).is_none_or(|keys| keys.iter().all(tagged));
    let required = form.get("required").and_then(Schema::as_array).into_iter().flatten();
    of_kind && tags && required.filter_map(Schema::as_str).all(|key| table.contains_key(key))
}

/// All ranges of a schema.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ranges(Vec<(String, Range)>);

impl Ranges {
    /// Collects the ranges of a schema.
    pub fn of(schema: &Schema) -> Self {
        let mut found = Self::default();
        found.collect(schema, "");
        found
    }

    /// Paths of keys with their ranges. `[]` is any element of a list of tables; the range of a list of numbers is that of each of its elements.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Range)> {
        self.0.iter().map(|(key, range)| (key.as_str(), range))
    }

    fn collect(&mut self, schema: &Schema, path: &str) {
        if let Some(range) = Range::of_schema(schema)
            && !self.0.iter().any(|known| known.0 == path && known.1 == range)
        {
            self.0.push((path.to_owned(), range));
        }
        for form in ["oneOf", "anyOf"].into_iter().filter_map(|forms| schema.get(forms)?.as_array()).flatten() {
            self.collect(form, path);
        }
        if let Some(items) = schema.get("items") {
            let holds_tables = ["properties", "oneOf", "anyOf"].iter().any(|key| items.get(key).is_some());
            self.collect(items, &if holds_tables { format!("{path}[]") } else { path.to_owned() });
        }
        for (key, inner) in schema.get("properties").and_then(Schema::as_object).into_iter().flatten() {
            self.collect(inner, &if path.is_empty() { key.clone() } else { format!("{path}.{key}") });
        }
    }
}

/// Settings in which every key is optional.
pub trait PartialSettings: Clone + Default + PartialEq {
    /// Names of all keys.
    const NAMES: &'static [&'static str];

    /// Names of the keys that are given.
    fn given(&self) -> Vec<&'static str>;

    /// Sets the keys that `other` gives.
    fn extend(&mut self, other: Self);

    /// Removes a key; a name that is not a key has no effect.
    fn remove(&mut self, name: &str);

    /// Whether no key is given.
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Settings in which some keys have an effect only together with certain values of others.
pub trait KeyEffects: Sized {
    /// Their partial form.
    type Keys: PartialSettings;

    /// Returns these settings with the values that `keys` gives.
    #[must_use]
    fn with_keys(&self, keys: &Self::Keys) -> Self;

    /// Reason why a key has no effect in these settings: the present value that prevents it, and a value with which the key has an effect. `None` if
    /// the key has an effect.
    fn obstacle(&self, key: &str) -> Option<Obstacle>;

    /// Names of the given keys that have no effect after they have been applied to these settings.
    fn without_effect(&self, keys: &Self::Keys) -> Vec<&'static str> {
        let all = self.with_keys(keys);
        keys.given().into_iter().filter(|key| all.obstacle(key).is_some()).collect()
    }

    /// Refuses given keys that have no effect after they have been applied to these settings.
    ///
    /// # Errors
    ///
    /// The first such key, and the value that it needs.
    fn check_effects(&self, keys: &Self::Keys) -> Result<(), KeyError> {
        let all = self.with_keys(keys);
        let refused = |key: &'static str| Some(KeyError::new(key, all.obstacle(key)?.to_string()));
        keys.given().into_iter().find_map(refused).map_or(Ok(()), Err)
    }
}

/// Reason why a key has no effect. Both values are as a configuration writes them: `kernel = "cie"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// The present value that prevents it.
    pub present: String,
    /// A value with which the key has an effect.
    pub needed: &'static str,
}

/// `has no effect with method = "none": leave it out, or set method = "auto"`.
impl fmt::Display for Obstacle {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "has no effect with {}: leave it out, or set {}", self.present, self.needed)
    }
}

/// Declares settings together with their partial form, in which every key may be left out.
///
/// Documentation, range and default of a key are written once. The settings have every key; the keys that are declared as `optional` may have no value.
/// `with` replaces the keys of settings that a partial form gives.
#[doc(hidden)]
#[macro_export]
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident, $keys:ident {
            $($(#[$attribute:meta])* pub $field:ident: $kind:ty = $default:expr,)*
        }
        optional {
            $($(#[$optional_attribute:meta])* pub $optional:ident: $optional_kind:ty,)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[$attribute])* pub $field: $kind,)*
            $($(#[$optional_attribute])* pub $optional: Option<$optional_kind>,)*
        }

        #[doc = concat!("Some of the keys of [`", stringify!($name), "`].")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $keys {
            $($(#[$attribute])* #[serde(skip_serializing_if = "Option::is_none")] pub $field: Option<$kind>,)*
            $($(#[$optional_attribute])* #[serde(skip_serializing_if = "Option::is_none")]
            pub $optional: Option<$optional_kind>,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* $($optional: None,)* }
            }
        }

        impl $name {
            /// Returns these settings with the values that `keys` gives.
            #[must_use]
            pub fn with(&self, keys: &$keys) -> Self {
                Self {
                    $($field: keys.$field.clone().unwrap_or_else(|| self.$field.clone()),)*
                    $($optional: keys.$optional.clone().or_else(|| self.$optional.clone()),)*
                }
            }
        }

        impl From<&$name> for $keys {
            fn from(all: &$name) -> Self {
                Self { $($field: Some(all.$field.clone()),)* $($optional: all.$optional.clone(),)* }
            }
        }

        impl $crate::ranges::PartialSettings for $keys {
            const NAMES: &'static [&'static str] = &[$(stringify!($field),)* $(stringify!($optional),)*];

            fn given(&self) -> Vec<&'static str> {
                let given = [
                    $((stringify!($field), self.$field.is_some()),)*
                    $((stringify!($optional), self.$optional.is_some()),)*
                ];
                given.into_iter().filter(|(_, given)| *given).map(|(name, _)| name).collect()
            }

            fn extend(&mut self, other: Self) {
                $(self.$field = other.$field.or(self.$field.take());)*
                $(self.$optional = other.$optional.or(self.$optional.take());)*
            }

            fn remove(&mut self, name: &str) {
                match name {
                    $(stringify!($field) => self.$field = None,)*
                    $(stringify!($optional) => self.$optional = None,)*
                    _ => {}
                }
            }
        }
    };
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    settings! {
        /// Test settings.
        pub struct Test, TestKeys {
            /// A share.
            #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "of the light"))]
            pub share: f64 = 0.5,
            /// A count.
            #[schemars(range(min = 1, max = 64), extend("x-also" = "a power of two"))]
            pub count: u32 = 2,
            /// Widths.
            #[schemars(inner(range(max = 10.0)), extend("exclusiveMinimum" = 0.0, "x-unit" = "pixels"))]
            pub widths: Vec<f64> = Vec::new(),
        }
        optional {
            /// A time.
            #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
            pub time_s: f64,
        }
    }

    fn problem(text: &str) -> String {
        let value = Value::Table(text.parse().unwrap());
        let [whole, partial] = [check::<Test>(&value), check::<TestKeys>(&value)];
        assert_eq!(whole, partial);
        whole.err().map(|error| error.to_string()).unwrap_or_default()
    }

    #[test]
    fn numbers_out_of_range_are_refused_with_key_value_and_range() {
        for (text, expected) in [
            ("share = 0.0\ncount = 64\nwidths = [10, 1e-9]\ntime_s = 0", ""),
            ("share = 2", "share: 2: must be between 0 and 1 of the light"),
            ("share = nan", "share: NaN: must be a finite number"),
            ("count = 65", "count: 65: must be between 1 and 64, a power of two"),
            ("widths = [1, 0]", "widths[1]: 0: must be above 0 and at most 10 pixels"),
            ("time_s = -1", "time_s: -1: must be at least 0 s"),
            ("time_s = inf", "time_s: inf: must be a finite number"),
        ] {
            assert_eq!(problem(text), expected, "{text}");
        }
    }

    #[test]
    fn partial_settings_are_merged_over_whole_ones() {
        let mut keys: TestKeys = toml::from_str("share = 0.25\ntime_s = 3.0").unwrap();
        assert_eq!(Test::default().with(&keys), Test { share: 0.25, time_s: Some(3.0), ..Test::default() });
        assert_eq!((keys.given(), TestKeys::NAMES.len()), (vec!["share", "time_s"], 4));
        keys.extend(TestKeys { share: Some(1.0), count: Some(4), ..TestKeys::default() });
        keys.remove("time_s");
        assert_eq!(toml::to_string(&keys).unwrap(), "share = 1.0\ncount = 4\n");
        assert!(toml::from_str::<TestKeys>("shar = 1").is_err());
    }

    #[test]
    fn bounds_are_written_as_people_write_them() {
        let ranges = Ranges::of(schema_of::<Test>());
        let text: Vec<String> = ranges.iter().map(|(key, range)| format!("{key}: {}", range.short())).collect();
        for expected in
            ["share: 0 to 1", "count: 1 to 64, a power of two", "widths: above 0 up to 10", "time_s: from 0"]
        {
            assert!(text.iter().any(|range| range == expected), "{expected} in {text:?}");
        }
        assert_eq!([1e-6, 1e12, 0.25].map(number), ["0.000001", "1e12", "0.25"]);
    }
}

//! Overrides: `--set key=value` changes the tables of a configuration before they are interpreted, so that an override is checked in the same way as
//! the file.
//!
//! The key is a dotted path. An element of a list is named by its index from 0. A view can also be named by its name, which takes precedence if it is
//! a number: `exposure.ev100=2`, `views.dome.fov_deg=210`, `scene.catalogues.0=my.csv`. The value is TOML; text that is not a TOML value, and does
//! not begin like one, is a string.

use toml::{Table, Value};

use super::error::ConfigError;

/// An override that has been applied.
pub(super) struct Applied {
    /// The override as given.
    pub argument: String,
    /// The path of the key that it set, in the form of messages: `views[0].fov_deg`.
    pub key: String,
}

/// Applies `argument` (`key=value`) to the table.
pub(super) fn apply(table: &mut Table, argument: &str) -> Result<Applied, ConfigError> {
    let wrong = |problem: String| ConfigError::Override { argument: argument.to_owned(), problem };
    let (path, text) = argument
        .split_once('=')
        .ok_or_else(|| wrong("the form is key=value, for instance exposure.ev100=2".to_owned()))?;
    let steps: Vec<&str> = path.trim().split('.').map(str::trim).collect();
    if steps.iter().any(|step| step.is_empty()) {
        return Err(wrong(format!("`{path}` is not a path of a key, such as views.dome.fov_deg")));
    }
    let value = value_from(text.trim()).map_err(wrong)?;
    let key = set(table, &steps, value).map_err(wrong)?;
    Ok(Applied { argument: argument.to_owned(), key })
}

fn value_from(text: &str) -> Result<Value, String> {
    match text.parse::<Value>() {
        Ok(value) => Ok(value),
        Err(_) if !text.is_empty() && !text.starts_with(['[', '{', '"', '\'']) && !text.contains(['\n', '\r']) => {
            Ok(Value::String(text.to_owned()))
        }
        Err(error) => {
            let problem = error.message().trim().replace('\n', "; ");
            Err(format!(
                "`{text}` is not a TOML value ({problem}): must be one of numbers, true, false, dates, \"strings\", bare words, [lists] and {{ tables }}"
            ))
        }
    }
}

/// Sets the value at the path given by the steps, and returns the path in the form of messages.
fn set(table: &mut Table, steps: &[&str], value: Value) -> Result<String, String> {
    let mut written = steps[0].to_owned();
    let mut place: &mut Value = table.entry(steps[0]).or_insert_with(|| Value::Table(Table::new()));
    for (depth, step) in steps.iter().enumerate().skip(1) {
        place = match place {
            Value::Table(inner) => {
                written = format!("{written}.{step}");
                inner.entry(*step).or_insert_with(|| Value::Table(Table::new()))
            }
            Value::Array(list) => {
                let index = index_of(list, step, &written)?;
                written = format!("{written}[{index}]");
                &mut list[index]
            }
            _ => return Err(format!("{} is a single value and has no keys", steps[..depth].join("."))),
        };
    }
    *place = value;
    Ok(written)
}

fn index_of(list: &[Value], step: &str, written: &str) -> Result<usize, String> {
    let name_of = |entry: &Value| entry.get("name").and_then(Value::as_str).map(str::to_owned);
    if let Some(index) = list.iter().position(|entry| name_of(entry).as_deref() == Some(step)) {
        return Ok(index);
    }
    if let Some(index) = step.parse::<usize>().ok().filter(|&index| index < list.len()) {
        return Ok(index);
    }
    let names: Vec<String> = list.iter().filter_map(name_of).collect();
    let last = list.len().checked_sub(1);
    let indexes = last.map_or("left out, the list is empty".to_owned(), |last| format!("0 to {last}"));
    let names = if names.is_empty() { String::new() } else { format!(", or by name {}", names.join(", ")) };
    Err(format!("{written} has no `{step}`: must be {indexes}{names}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        "[scene]\ncatalogues = ['a.csv', { galaxy = { stars = 5 } }]\n[[views]]\nname = 'flat'\n[[views]]\nname = '0'\n"
            .parse()
            .unwrap()
    }

    #[test]
    fn paths_lead_through_tables_lists_and_names() {
        let mut table = table();
        let keys = [
            "exposure.ev100=2",
            "views.flat.fov_deg=7",
            "views.0.fov_deg=8",
            "views.1.size=[1, 2]",
            "scene.catalogues.1.galaxy.stars=6",
        ]
        .map(|argument| apply(&mut table, argument).unwrap().key);
        // The view named `0` takes precedence over the view with index 0.
        assert_eq!(
            keys,
            [
                "exposure.ev100",
                "views[0].fov_deg",
                "views[1].fov_deg",
                "views[1].size",
                "scene.catalogues[1].galaxy.stars"
            ]
        );
        assert_eq!(table["views"][0]["fov_deg"].as_integer(), Some(7));
        assert_eq!(table["views"][1]["fov_deg"].as_integer(), Some(8));
        assert_eq!(table["scene"]["catalogues"][1]["galaxy"]["stars"].as_integer(), Some(6));
    }

    #[test]
    fn values_are_toml_and_bare_words_are_strings() {
        for (text, expected) in [
            ("2", Value::Integer(2)),
            ("-3.5", Value::Float(-3.5)),
            ("true", Value::Boolean(true)),
            ("manual", Value::String("manual".to_owned())),
            ("'x'", Value::String("x".to_owned())),
            ("stars/bright stars.csv", Value::String("stars/bright stars.csv".to_owned())),
            ("127.0.0.1:0", Value::String("127.0.0.1:0".to_owned())),
        ] {
            assert_eq!(value_from(text).unwrap(), expected, "{text}");
        }
        for text in ["", "[1,", "{ a = }", "\"open", "1\nfoo = 2"] {
            assert!(value_from(text).is_err(), "{text}");
        }
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused_with_what_is_there() {
        for (argument, expected) in [
            ("novalue", "key=value"),
            ("=3", "not a path"),
            ("a..b=3", "not a path"),
            ("views.2.size=3", "0 to 1, or by name flat, 0"),
            ("views.round.size=3", "views has no `round`"),
            ("views.flat.name.x=3", "single value"),
        ] {
            let message = apply(&mut table(), argument).err().unwrap().to_string();
            assert!(message.contains(expected) && message.contains("--set"), "{message}");
        }
    }
}

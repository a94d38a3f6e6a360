//! Keys of an exposure that lose their effect when an override changes mode or metering.
//!
//! A key without effect in a file is refused. After `--set exposure.mode=manual` the keys of the file that belong to the other mode are left out
//! instead, because the override means the mode. Keys that overrides give stay, and are checked like all others.

use toml::{Table, Value};

use super::document::deserialise;
use super::overrides::Applied;
use crate::plan::settings::{ExposureKeys, ExposureSettings, StarSettings};

/// Leaves out the keys of `[exposure]` and of the views' `exposure` tables that an override has deprived of their effect, and logs each. A document that is
/// wrong in another way stays as it is.
pub(super) fn leave_out_overridden(document: &mut Table, applied: &[Applied], origin: &str) {
    let changes_mode = |applied: &&Applied| {
        let key = applied.key.as_str();
        key == "stars.method" || key.ends_with("exposure.mode") || key.ends_with("exposure.metering")
    };
    let Some(cause) = applied.iter().find(changes_mode) else { return };
    let stars: Option<StarSettings> = parsed(document.get("stars"));
    let general: Option<ExposureKeys> = parsed(document.get("exposure"));
    let (Some(stars), Some(general)) = (stars, general) else { return };
    let is_relative = stars.method.is_relative();
    let leave_out = |table: &mut Value, path: &str, general: &ExposureSettings| {
        let Some(keys) = parsed::<ExposureKeys>(Some(table)) else { return };
        let mode = keys.over(general).mode().name();
        let by_override = |key: &str| applied.iter().any(|applied| applied.key == format!("{path}.{key}"));
        for key in keys.without_effect(general, is_relative).into_iter().filter(|key| !by_override(key)) {
            if let Value::Table(table) = table {
                table.remove(key);
            }
            let cause = &cause.argument;
            tracing::info!(
                "{origin}: {path}.{key} is left out: it has no effect with mode = \"{mode}\" (--set {cause})"
            );
        }
    };
    if let Some(table) = document.get_mut("exposure") {
        leave_out(table, "exposure", &ExposureSettings::default());
    }
    let general = general.over(&ExposureSettings::default());
    let Some(Value::Array(views)) = document.get_mut("views") else { return };
    for (index, view) in views.iter_mut().enumerate() {
        if let Some(table) = view.get_mut("exposure") {
            leave_out(table, &format!("views[{index}].exposure"), &general);
        }
    }
}

fn parsed<T: serde::de::DeserializeOwned + Default>(value: Option<&Value>) -> Option<T> {
    value.map_or_else(|| Some(T::default()), |value| deserialise(value.clone(), "").ok())
}

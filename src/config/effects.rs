//! Keys of an exposure that have no effect with its mode and metering. Whoever gives one expects an effect, so it is refused; one that an
//! override or a later change leaves without effect is left out instead, because who changes the mode means the mode.

use toml::{Table, Value};

use super::document::deserialise;
use super::error::Fault;
use super::overrides::Applied;
use super::view_tables::merged;
use crate::plan::settings::{ExposureMode, ExposureSettings, Metering, StarMethod, StarSettings};

/// Each key that may be without effect, whether it has one, and what it needs.
fn effects(exposure: &ExposureSettings, stars: StarMethod) -> [(&'static str, bool, &'static str); 9] {
    let is_auto = exposure.mode == ExposureMode::Auto;
    let [limiting, mean, spot] =
        [Metering::LimitingMagnitude, Metering::Mean, Metering::Spot].map(|metering| exposure.goes_by(metering));
    [
        ("metering", is_auto, "mode = \"auto\""),
        ("limiting_magnitude", limiting, "metering = \"limiting_magnitude\""),
        ("key", mean || spot, "metering = \"mean\" or \"spot\""),
        ("spot_deg", spot, "metering = \"spot\""),
        ("compensation_ev", is_auto, "mode = \"auto\""),
        ("min_ev100", is_auto, "mode = \"auto\""),
        ("max_ev100", is_auto, "mode = \"auto\""),
        ("adaptation_s", is_auto, "mode = \"auto\""),
        // The unit of methods whose brightness is relative, whatever the mode.
        ("ev100", !is_auto || stars.is_relative(), "mode = \"manual\""),
    ]
}

/// Whether a key of an exposure has an effect.
pub fn has_effect(key: &str, exposure: &ExposureSettings, stars: StarMethod) -> bool {
    effects(exposure, stars).iter().all(|(name, has_effect, _)| *name != key || *has_effect)
}

fn mode_of(exposure: &ExposureSettings) -> &'static str {
    match exposure.mode {
        ExposureMode::Auto => "mode = \"auto\"",
        ExposureMode::Manual => "mode = \"manual\"",
    }
}

/// Refuses keys without effect among those `given`; a fault names the key.
pub(super) fn check(exposure: &ExposureSettings, given: &Table, stars: StarMethod) -> Result<(), Fault> {
    for (key, has_effect, needs) in effects(exposure, stars) {
        if !has_effect && given.contains_key(key) {
            let is = match exposure.mode {
                ExposureMode::Auto if needs.starts_with("metering") => {
                    format!("metering = \"{}\"", exposure.metering.name())
                }
                _ => mode_of(exposure).to_owned(),
            };
            return Err(Fault::new(key, format!("has no effect with {is}: leave it out, or set {needs}")));
        }
    }
    Ok(())
}

/// Leaves out the keys without effect, but those that are to be `kept`; returns them.
pub(super) fn leave_out(
    given: &mut Table,
    exposure: &ExposureSettings,
    stars: StarMethod,
    kept: impl Fn(&str) -> bool,
) -> Vec<&'static str> {
    let without = effects(exposure, stars).into_iter().filter(|(key, has_effect, _)| !has_effect && !kept(key));
    without.filter(|(key, ..)| given.remove(*key).is_some()).map(|(key, ..)| key).collect()
}

/// Where overrides have changed the mode of an exposure, leaves the file's keys out that belong to the other mode, and says so. What overrides
/// give stays, and is checked as everything is. A document that is wrong in another way stays as it is.
pub(super) fn leave_out_overridden(document: &mut Table, applied: &[Applied], origin: &str) {
    let changes_mode = |applied: &&Applied| {
        let key = applied.key.as_str();
        key == "stars.method" || key.ends_with("exposure.mode") || key.ends_with("exposure.metering")
    };
    let Some(cause) = applied.iter().find(changes_mode) else { return };
    let table_of = |value: Option<&Value>| value.and_then(Value::as_table).cloned().unwrap_or_default();
    let stars = deserialise::<StarSettings>(Value::Table(table_of(document.get("stars"))), "");
    let general = deserialise::<ExposureSettings>(Value::Table(table_of(document.get("exposure"))), "");
    let (Ok(stars), Ok(general)) = (stars, general) else { return };
    let tell = |path: &str, keys: Vec<&str>, exposure: &ExposureSettings| {
        for key in keys {
            let mode = mode_of(exposure);
            let cause = &cause.argument;
            tracing::info!("{origin}: {path}.{key} is left out: it has no effect with {mode} (--set {cause})");
        }
    };
    let given_by_override =
        |path: &str, key: &str| applied.iter().any(|applied| applied.key == format!("{path}.{key}"));
    if let Some(Value::Table(given)) = document.get_mut("exposure") {
        let keys = leave_out(given, &general, stars.method, |key| given_by_override("exposure", key));
        tell("exposure", keys, &general);
    }
    let Some(Value::Array(views)) = document.get_mut("views") else { return };
    for (index, view) in views.iter_mut().enumerate() {
        let path = format!("views[{index}].exposure");
        if let Some(Value::Table(given)) = view.get_mut("exposure")
            && let Ok(own) = merged(&general, given, "")
        {
            let keys = leave_out(given, &own, stars.method, |key| given_by_override(&path, key));
            tell(&path, keys, &own);
        }
    }
}

//! Keys that have no effect.
//!
//! Such a key in a file is refused ([`super::limits`]). The exception is a key that lost its effect through an override: after
//! `--set exposure.mode=manual`, the keys in the file that belong to the other mode are left out, because the user wants this mode. The same holds
//! for the method and the kernel of `[glare]` and the operator of `[tone_map]`. Keys given by overrides stay, and are checked like all others.
//!
//! A key without effect is kept, with a warning, if a client can put it into effect at run time, and either cannot set this key itself or gets it
//! back unchanged.

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::document::deserialise;
use super::limits::useless_keys;
use super::overrides::Applied;
use super::{Config, ViewSpec, names};
use crate::catalogue::deep::is_deep_store;
use crate::photometry::glare::GlareKernelName;
use crate::plan::settings::{
    ExposureKeys, ExposureSettings, GlareMethod, GlareSettings, StarSettings, ToneMapSettings,
};
use crate::ranges::{KeyEffects, KeyError, Obstacle};
use crate::scene::loader::StarSource;

/// Removes the keys that an override has deprived of their effect, and logs each of them. The keys are those of `[exposure]`, `[glare]` and
/// `[tone_map]`, in the general tables and in those of views. A document with another error stays unchanged.
pub(super) fn leave_out_overridden(document: &mut Table, applied: &[Applied], origin: &str) {
    leave_out_of_exposure(document, applied, origin);
    leave_out_of::<GlareSettings>(document, "glare", &["method", "kernel", "absolute"], applied, origin);
    leave_out_of::<ToneMapSettings>(document, "tone_map", &["operator"], applied, origin);
}

fn leave_out_of_exposure(document: &mut Table, applied: &[Applied], origin: &str) {
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
        let present = format!("mode = \"{}\"", keys.over(general).mode().name());
        let useless = keys.without_effect(general, is_relative).into_iter().map(|key| (key, present.clone()));
        remove(table, path, useless, (cause, applied), origin);
    };
    if let Some(table) = document.get_mut("exposure") {
        leave_out(table, "exposure", &ExposureSettings::default());
    }
    let general = general.over(&ExposureSettings::default());
    for (path, table) in tables_of_views(document, "exposure") {
        leave_out(table, &path, &general);
    }
}

/// Removes keys without effect from a section and from the views' tables of this name, after an override of one of `causes`.
fn leave_out_of<S>(document: &mut Table, section: &str, causes: &[&str], applied: &[Applied], origin: &str)
where
    S: KeyEffects + Default,
    S::Keys: DeserializeOwned,
{
    let is_cause = |applied: &&Applied| causes.iter().any(|key| applied.key.ends_with(&format!("{section}.{key}")));
    let Some(cause) = applied.iter().find(is_cause) else { return };
    let Some(keys) = parsed::<S::Keys>(document.get(section)) else { return };
    let general = S::default().with_keys(&keys);
    for (path, table) in tables_of_views(document, section) {
        let Some(own) = parsed::<S::Keys>(Some(table)) else { return };
        let all = general.with_keys(&own);
        let useless = general.without_effect(&own).into_iter();
        let useless = useless.filter_map(|key| Some((key, all.obstacle(key)?.present)));
        remove(table, &path, useless, (cause, applied), origin);
    }
    let own: Vec<S::Keys> = tables_of_views(document, section).filter_map(|(_, table)| parsed(Some(table))).collect();
    let useless = useless_keys(&general, &keys, &own.iter().collect::<Vec<_>>());
    if let Some(table) = document.get_mut(section) {
        let useless = useless.into_iter().map(|(key, Obstacle { present, .. })| (key, present));
        remove(table, section, useless, (cause, applied), origin);
    }
}

/// Removes keys unless an override sets them. Each key is paired with the setting that prevents its effect, for the log.
fn remove(
    table: &mut Value,
    path: &str,
    useless: impl Iterator<Item = (&'static str, String)>,
    (cause, applied): (&Applied, &[Applied]),
    origin: &str,
) {
    for (key, present) in useless {
        if applied.iter().any(|applied| applied.key == format!("{path}.{key}")) {
            continue;
        }
        if let Value::Table(table) = table {
            table.remove(key);
        }
        let cause = &cause.argument;
        tracing::info!("{origin}: {path}.{key} is left out: it has no effect with {present} (--set {cause})");
    }
}

/// Returns the tables with this name in the views, with their paths.
fn tables_of_views<'a>(document: &'a mut Table, name: &'a str) -> impl Iterator<Item = (String, &'a mut Value)> {
    let views = document.get_mut("views").and_then(Value::as_array_mut).into_iter().flatten().enumerate();
    views.filter_map(move |(index, view)| Some((format!("views[{index}].{name}"), view.get_mut(name)?)))
}

fn parsed<T: DeserializeOwned + Default>(value: Option<&Value>) -> Option<T> {
    value.map_or_else(|| Some(T::default()), |value| deserialise(value.clone(), "").ok())
}

/// The table at a path of keys; `None` if there is no such table.
fn table_at<'a>(document: &'a Table, path: &[&str]) -> Option<&'a Table> {
    path.iter().try_fold(document, |table, key| table.get(*key)?.as_table())
}

/// Names of the keys that a document gives in the table at a path.
fn given<'a>(document: &'a Table, path: &[&str]) -> impl Iterator<Item = &'a str> + use<'a> {
    table_at(document, path).into_iter().flat_map(Table::keys).map(String::as_str)
}

/// Refuses keys that can never have an effect, in tables whose types do not record which keys were given.
pub(super) fn check_given(document: &Table) -> Result<(), KeyError> {
    let ground = ["scene", "observer", "ground"];
    let has = |path: &[&str], key: &str| given(document, path).any(|given| given == key);
    if has(&ground, "landscape_azimuth_deg") && !has(&ground, "landscape") {
        let problem = "has no effect without a landscape: leave it out, or give landscape a file";
        return Err(KeyError::new("scene.observer.ground.landscape_azimuth_deg", problem));
    }
    let hdr = table_at(document, &["accuracy"]).and_then(|accuracy| accuracy.get("hdr"));
    let is_exact = hdr.is_none_or(|hdr| hdr.as_float() == Some(0.0) || hdr.as_integer() == Some(0));
    if has(&["accuracy"], "hdr_floor_cd_m2") && is_exact {
        let problem = "has no effect with hdr = 0: leave it out, or set hdr to the error that a pixel may have";
        return Err(KeyError::new("accuracy.hdr_floor_cd_m2", problem));
    }
    Ok(())
}

/// Warns of keys that have no effect for now, and of names that some file systems do not distinguish.
pub(super) fn warn(config: &Config) {
    for (key, reason) in idle_keys(config) {
        tracing::warn!("{}: {key}: has no effect {reason}", config.origin);
    }
    let names: Vec<&str> = config.views.iter().map(|view| view.name.as_str()).collect();
    for (index, problem) in names::faults_in_files(&names) {
        tracing::warn!("{}: views[{index}].name (view `{}`): {problem}", config.origin, names[index]);
    }
}

/// Given keys that have no effect for now, each with the reason.
fn idle_keys(config: &Config) -> Vec<(String, String)> {
    let document: Table = config.pictured.parse().unwrap_or_default();
    let mut idle = idle_keys_of_stars(config, &document);
    idle.extend(idle_keys_of_glare(config, &document));
    idle.extend(idle_keys_of_observer(config, &document));
    if config.asteroids.drawn_impostors().is_none() {
        let keys = given(&document, &["asteroids"]).filter(|key| ["tiles", "tile_px"].contains(key));
        let reason = "without impostors: it is kept, and has an effect once asteroids.impostor selects impostors";
        idle.extend(keys.map(|key| (format!("asteroids.{key}"), reason.to_owned())));
    }
    idle
}

fn idle_keys_of_stars(config: &Config, document: &Table) -> Vec<(String, String)> {
    let stars = &config.stars;
    let mut idle = Vec::new();
    for table in ["pixel_gaussian", "billboard", "gaussian_psf", "cell_sky", "psf_texture"] {
        for key in given(document, &["stars", table]) {
            let methods = StarSettings::methods_with(table, key);
            let reason = if !methods.contains(&stars.method) {
                let names: Vec<String> = methods.iter().map(|method| format!("`{}`", method.name())).collect();
                format!(
                    "with stars.method = \"{}\": it is kept, and has an effect once the method is {}",
                    stars.method.name(),
                    names.join(", ")
                )
            } else if key == "sigma_px" && stars.pixel_gaussian.sigma_arcmin.is_some() {
                "with sigma_arcmin: leave one of them out".to_owned()
            } else if ["aperture", "diameter_mm"].contains(&key) && stars.psf_texture.file.is_some() {
                "with file: leave one of them out".to_owned()
            } else {
                continue;
            };
            idle.push((format!("stars.{table}.{key}"), reason));
        }
    }
    let mut of_stores =
        given(document, &["stars"]).filter(|key| ["memory", "every_star", "skip_damaged"].contains(key)).peekable();
    let is_store = |source: &StarSource| matches!(source, StarSource::File(path) if is_deep_store(path));
    if of_stores.peek().is_some() && !config.star_sources().iter().any(is_store) {
        let reason = "without a deep store among scene.catalogues";
        idle.extend(of_stores.map(|key| (format!("stars.{key}"), reason.to_owned())));
    }
    idle
}

fn idle_keys_of_glare(config: &Config, document: &Table) -> Vec<(String, String)> {
    let mut idle = Vec::new();
    let mut check = |path: String, glare: &GlareSettings, has_file: bool, has_weights: bool| {
        if has_file && (glare.kernel != GlareKernelName::Psf || glare.method == GlareMethod::None) {
            let kernel = glare.kernel.name();
            let reason = match glare.method {
                GlareMethod::None => {
                    "with method = \"none\": it is kept, and has an effect once glare is drawn with kernel = \"psf\""
                        .to_owned()
                }
                _ => format!("with kernel = \"{kernel}\": it is kept, and has an effect once kernel is \"psf\""),
            };
            idle.push((format!("{path}.psf_file"), reason));
        }
        if has_weights && glare.method == GlareMethod::Auto && config.stars.method.draws_catalogue() {
            let stars = config.stars.method.name();
            let reason = format!(
                "with method = \"auto\" and stars.method = \"{stars}\": it is kept, and has an effect once pyramids are drawn, as with `cell_sky`"
            );
            idle.push((format!("{path}.weights"), reason));
        }
    };
    let has = |name: &str| given(document, &["glare"]).any(|key| key == name);
    let is_inherited = |view: &ViewSpec| {
        let glare = view.glare.as_ref().map_or_else(|| config.glare.clone(), |own| config.glare.with(own));
        glare.kernel == GlareKernelName::Psf && glare.method != GlareMethod::None
    };
    check("glare".to_owned(), &config.glare, has("psf_file") && !config.views.iter().any(is_inherited), has("weights"));
    for (index, view) in config.views.iter().enumerate() {
        let Some(own) = &view.glare else { continue };
        let path = format!("views[{index}].glare");
        check(path, &config.glare.with(own), own.psf_file.is_some(), own.weights.is_some());
    }
    idle
}

fn idle_keys_of_observer(config: &Config, document: &Table) -> Vec<(String, String)> {
    let Some(observer) = &config.scene.observer else { return Vec::new() };
    let mut idle = Vec::new();
    for (table, enabled) in [("air", observer.air.enabled), ("ground", observer.ground.enabled)] {
        if !enabled {
            let keys = given(document, &["scene", "observer", table]).filter(|key| *key != "enabled");
            let reason = "with enabled = false: it is kept, and has an effect once enabled is true";
            idle.extend(keys.map(|key| (format!("scene.observer.{table}.{key}"), reason.to_owned())));
        }
    }
    if observer.air.enabled {
        let idle_in_air = |key: &str| observer.air.why_idle(key, observer.height_m);
        let keys = given(document, &["scene", "observer", "air"]);
        idle.extend(keys.filter_map(|key| Some((format!("scene.observer.air.{key}"), idle_in_air(key)?))));
    }
    idle
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn idle(text: &str) -> Vec<String> {
        let config = Config::from_text(text, "test.toml", Path::new("/none"), &[]).expect("a configuration");
        idle_keys(&config).into_iter().map(|(key, reason)| format!("{key} {reason}")).collect()
    }

    #[test]
    fn keys_that_clients_can_put_into_effect_are_reported_while_they_have_none() {
        let place = "[scene.observer]\nlatitude_deg = 50\nlongitude_deg = 8\n";
        for (text, expected) in [
            ("[stars.billboard]\ndiameter_arcmin = 3", "stars.billboard.diameter_arcmin with stars.method = \"auto\""),
            (
                "[stars]\nmethod = 'disc'\n[stars.billboard]\nscreen_size_px = 3",
                "once the method is `screen_billboard`",
            ),
            ("[stars.psf_texture]\nwidth_arcmin = 90", "stars.psf_texture.width_arcmin with"),
            (
                "[stars]\nmethod = 'psf_texture'\npsf_texture = { file = 'x.exr', aperture = 'jwst' }",
                "aperture with file",
            ),
            ("[stars]\nevery_star = true", "stars.every_star without a deep store"),
            ("[glare]\npsf_file = 'eye.csv'", "glare.psf_file with kernel = \"inverse_square\""),
            ("[glare]\nweights = 'halved'", "glare.weights with method = \"auto\""),
            ("[asteroids]\nimpostor = 'none'\ntiles = 8", "asteroids.tiles without impostors"),
            (
                &format!("{place}[scene.observer.air]\nenabled = false\nnight_sky_mag = 21"),
                "observer.air.night_sky_mag",
            ),
            (&format!("{place}[scene.observer.ground]\nenabled = false\nalbedo = 0.2"), "observer.ground.albedo with"),
            (
                &format!("{place}[scene.observer.air]\nextinction_mag = 0\nnight_sky_mag = 18"),
                "air.night_sky_mag with extinction_mag = 0",
            ),
            (
                &format!("{place}[scene.observer.air]\npressure_hpa = 0\ntemperature_c = 9"),
                "air.temperature_c with pressure_hpa = 0",
            ),
            (
                &format!("{place}height_m = 60000\n[scene.observer.air]\npressure_hpa = 1000"),
                "air.pressure_hpa at a height of 60000 m",
            ),
        ] {
            let idle = idle(text);
            assert!(idle.len() == 1 && idle[0].contains(expected), "{text}: {idle:?}");
        }
        for text in [
            "",
            "[stars]\nmethod = 'scaled_disc'\nmagnitude_limit = 6\n[stars.billboard]\nfaintest_magnitude = 9",
            "[stars]\nmethod = 'cell_sky'\n[glare]\nweights = 'halved'",
            "[glare]\nkernel = 'psf'\npsf_file = 'eye.csv'",
            "[asteroids]\ntiles = 8",
            &format!("{place}[scene.observer.air]\nnight_sky_mag = 21\n[scene.observer.ground]\nenabled = false"),
        ] {
            assert_eq!(idle(text), [""; 0], "{text}");
        }
        // The kernel of a view uses the file of the general table.
        let view = "[[views]]\nname = 'v'\ntype = 'equirectangular'\nsize = [8, 4]\nglare = { kernel = 'psf' }\n";
        assert_eq!(idle(&format!("{view}[glare]\npsf_file = 'eye.csv'")), [""; 0]);
    }
}

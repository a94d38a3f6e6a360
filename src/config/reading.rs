//! From the text of a configuration to [`Config`]: its tables, its overrides, and the checks of everything except the views.

use std::{path::Path, sync::Arc, time::SystemTime};

use schemars::JsonSchema;
use serde::Deserialize;
use toml::{Table, Value};

use super::{
    BODIES, BodyConfig, ClusterConfig, Config, ConfigError, FIELDS, FieldConfig, NODES, Named, NodeConfig,
    OverlayConfig, SceneConfig, ServerConfig, VIEWS, ViewSpec, WINDOWS, WindowConfig, asteroids, document, effects,
    headset, limits, memo::Memo, overrides, scene, server, views,
};
use crate::{
    files,
    plan::settings::{
        AccuracySettings, AsteroidSettings, ExposureKeys, ExposureSettings, ExposureValues, GlareKeys, GlareSettings,
        HeadsetSettings, StarSettings, ToneMapKeys, ToneMapSettings,
    },
    ranges::KeyError,
    scene::{
        asteroids::check_fields,
        bodies::{MOST_BODIES, check_names},
    },
    solar_system::SolarBody,
};

/// The configuration of `serve` without a file.
const BUILT_IN: &str = include_str!("built_in.toml");

/// Everything except the views, bodies, fields, windows and nodes. These are read one by one, so that messages can give their names.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Sections {
    /// Objects of the scene, time, and camera.
    #[serde(default)]
    scene: SceneConfig,
    #[serde(default)]
    #[schemars(with = "Vec<views::ViewTable>")]
    views: Vec<Table>,
    #[serde(default)]
    #[schemars(with = "Vec<BodyConfig>")]
    bodies: Vec<Table>,
    #[serde(default)]
    #[schemars(with = "Vec<FieldConfig>")]
    asteroid_fields: Vec<Table>,
    #[serde(default)]
    overlay: OverlayConfig,
    #[serde(default)]
    asteroids: AsteroidSettings,
    #[serde(default)]
    stars: StarSettings,
    #[serde(default)]
    #[schemars(with = "GlareSettings")]
    glare: GlareKeys,
    #[serde(default)]
    #[schemars(with = "ExposureValues")]
    exposure: ExposureKeys,
    #[serde(default)]
    #[schemars(with = "ToneMapSettings")]
    tone_map: ToneMapKeys,
    #[serde(default)]
    accuracy: AccuracySettings,
    #[serde(default)]
    headset: HeadsetSettings,
    #[serde(default)]
    #[schemars(with = "Vec<WindowConfig>")]
    windows: Vec<Table>,
    cluster: Option<ClusterConfig>,
    #[serde(default)]
    #[schemars(with = "Vec<NodeConfig>")]
    nodes: Vec<Table>,
    #[serde(default)]
    server: ServerConfig,
}

/// Maximum size of a configuration, bytes.
const MOST_BYTES: u64 = 4 << 20;

impl Config {
    /// Loads a file and applies overrides (`key=value`) in their order.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        let (text, folder) = Self::text_of(path)?;
        Self::from_text(&text, &path.display().to_string(), folder, overrides)
    }

    /// Reads the text of a file; returns it with the folder of the file.
    fn text_of(path: &Path) -> Result<(String, &Path), ConfigError> {
        let text = files::read_text_bounded(path, MOST_BYTES)
            .map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        Ok((text, path.parent().unwrap_or(Path::new(""))))
    }

    /// The built-in configuration (a dome and a flat view of the bright stars and a synthetic galaxy), with overrides;
    /// relative paths in them start at the working directory.
    pub fn built_in(overrides: &[String]) -> Result<Self, ConfigError> {
        Self::from_text(BUILT_IN, "built-in configuration", Path::new(""), overrides)
    }

    /// Loads a file, or the built-in configuration if no file is given.
    pub fn load_or_built_in(path: Option<&Path>, overrides: &[String]) -> Result<Self, ConfigError> {
        path.map_or_else(|| Self::built_in(overrides), |path| Self::load(path, overrides))
    }

    /// Reads TOML; `origin` names it in messages; relative paths refer to `folder`.
    pub fn from_text(text: &str, origin: &str, folder: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        Self::read(text, origin, folder, overrides, Self::check_views)
    }

    /// Like [`Self::load`], but without checking that the views can be built, for callers that check each view themselves or need no views.
    ///
    /// # Errors
    ///
    /// Those of [`Self::load`], except errors of views.
    pub fn load_unbuilt(path: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        let (text, folder) = Self::text_of(path)?;
        Self::read(&text, &path.display().to_string(), folder, overrides, Ok)
    }

    fn read(
        text: &str,
        origin: &str,
        folder: &Path,
        overrides: &[String],
        check_views: fn(Self) -> Result<Self, KeyError>,
    ) -> Result<Self, ConfigError> {
        let mut table = document::parse(text, origin)?;
        let applied = overrides
            .iter()
            .map(|argument| overrides::apply(&mut table, argument))
            .collect::<Result<Vec<_>, ConfigError>>()?;
        effects::leave_out_overridden(&mut table, &applied, origin);
        let mut shared = table.clone();
        shared.remove("server");
        scene::set_now(&mut table, SystemTime::now());
        let mut pictured = table.clone();
        // These tables do not affect pictures, and their credentials must not be published with pictures.
        for section in ["server", "headset", "windows", "cluster", "nodes"] {
            pictured.remove(section);
        }
        let loaded = Self::from_table(table, origin, folder);
        let written = |config| Self { pictured: pictured.to_string(), shared: shared.to_string(), ..config };
        let loaded = loaded.and_then(check_views).map(written).inspect(effects::warn);
        loaded.map_err(|fault| {
            // Name the last override that set the key; for an unknown table, the one that created it.
            let key = fault.key.split_once(" (").map_or(fault.key.as_str(), |(key, _)| key);
            let below = |inner: &str, outer: &str| {
                inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
            };
            let unknown = fault.problem.starts_with("unknown key");
            let reaches = |set: &str| below(key, set) || (unknown && below(set, key));
            let blamed = applied.iter().rev().find(|applied| reaches(&applied.key));
            let origin = blamed.map_or(origin.to_owned(), |applied| format!("{origin}, --set {}", applied.argument));
            ConfigError::Key { origin, key: fault.key, problem: fault.problem }
        })
    }

    fn from_table(table: Table, origin: &str, folder: &Path) -> Result<Self, KeyError> {
        let sections: Sections = document::deserialise(Value::Table(table.clone()), "")?;
        // The entries of lists are checked one by one, so that messages can give their names.
        let mut unlisted = table;
        [VIEWS, BODIES, FIELDS, WINDOWS, NODES].iter().for_each(|named| drop(unlisted.remove(named.list)));
        let unlisted = Value::Table(unlisted);
        document::check_ranges::<Sections>(&unlisted)?;
        unlisted.as_table().map_or(Ok(()), effects::check_given)?;
        let views = each(&VIEWS, sections.views, ViewSpec::from_table)?;
        let mut bodies = each(&BODIES, sections.bodies, BodyConfig::from_table)?;
        if sections.scene.has_solar_system() {
            let stands_on = sections.scene.observer.as_ref().map(|_| SolarBody::Earth);
            let missing = SolarBody::ALL
                .into_iter()
                .filter(|of| stands_on != Some(*of) && !bodies.iter().any(|body| body.stands_for(*of)));
            bodies.extend(missing.map(BodyConfig::of_solar_system).collect::<Vec<_>>());
        }
        let asteroid_fields = each(&FIELDS, sections.asteroid_fields, FieldConfig::from_table)?;
        let windows = each(&WINDOWS, sections.windows, |table| document::read(Value::Table(table)))?;
        let nodes = each(&NODES, sections.nodes, |table| document::read(Value::Table(table)))?;
        let mut stars = sections.stars;
        stars.psf_texture.file = stars.psf_texture.file.map(|file| folder.join(file));
        let of_views: Vec<&GlareKeys> = views.iter().filter_map(|view| view.glare.as_ref()).collect();
        let mut glare: GlareSettings =
            limits::general_settings(&sections.glare, &of_views).map_err(|fault| fault.within("glare"))?;
        glare.psf_file = glare.psf_file.map(|file| folder.join(file));
        let of_views: Vec<&ToneMapKeys> = views.iter().filter_map(|view| view.tone_map.as_ref()).collect();
        let tone_map: ToneMapSettings =
            limits::general_settings(&sections.tone_map, &of_views).map_err(|fault| fault.within("tone_map"))?;
        let exposure = limits::check_exposure(&sections.exposure, &ExposureSettings::default(), stars.method)
            .map_err(|fault| fault.within("exposure"))?;
        let config = Self {
            origin: origin.to_owned(),
            folder: folder.to_owned(),
            computed_blends: Memo::default(),
            built_rig: Memo::default(),
            pictured: String::new(),
            shared: String::new(),
            scene: sections.scene,
            views,
            bodies,
            asteroid_fields,
            overlay: sections.overlay,
            asteroids: sections.asteroids,
            stars,
            glare,
            exposure,
            tone_map,
            accuracy: sections.accuracy,
            headset: sections.headset,
            windows,
            cluster: sections.cluster,
            nodes,
            server: sections.server,
        };
        config.scene.check().map_err(|fault| fault.within("scene"))?;
        config.camera_of(config.scene.time_s()).map_err(|fault| fault.within("scene"))?;
        check_names(config.bodies.iter().map(|body| body.name.as_str()), MOST_BODIES)
            .map_err(|(index, error)| config.fault_of_body(index, error))?;
        let specs = config.specs()?;
        check_fields(specs.iter().map(Arc::as_ref)).map_err(|(index, error)| config.fault_of_field(index, error))?;
        asteroids::check_settings(&config.asteroids).map_err(|fault| fault.within("asteroids"))?;
        limits::check_stars(&config.stars).map_err(|fault| fault.within("stars"))?;
        limits::check_glare(&config.glare).map_err(|fault| fault.within("glare"))?;
        limits::check_tone_map(&config.tone_map).map_err(|fault| fault.within("tone_map"))?;
        headset::check(&config.headset).map_err(|fault| fault.within("headset"))?;
        server::check(&config.server).map_err(|fault| fault.within("server"))?;
        config.cluster.as_ref().map_or(Ok(()), |cluster| cluster.check().map_err(|fault| fault.within("cluster")))?;
        Ok(config)
    }
}

/// Reads tables one by one.
fn each<T>(named: &Named, tables: Vec<Table>, read: impl Fn(Table) -> Result<T, KeyError>) -> Result<Vec<T>, KeyError> {
    let read = |(index, table): (usize, Table)| {
        let name = table.get("name").and_then(Value::as_str).map(str::to_owned);
        read(table).map_err(|fault| named.fault(index, name.as_deref(), fault))
    };
    tables.into_iter().enumerate().map(read).collect()
}

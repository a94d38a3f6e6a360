//! Configuration: strict TOML. Unknown keys are refused.
//!
//! A configuration is loaded in four steps, each with its own errors: text to tables ([`document`]), overrides ([`overrides`]), tables to the types
//! below (serde, with the path of the key at fault), and checks. These are checks of ranges, which are attributes of the fields, and of rules that
//! involve several keys. The result is plain data; [`Config::rig`], [`Config::camera`], [`Config::render_settings`], [`Config::objects`] and
//! [`Config::star_sources`] convert it to the types of the other modules. Degrees, and quaternions as lists x, y, z, w, are used only in
//! configurations.

mod asteroids;
mod bodies;
mod camera;
mod cluster;
mod document;
mod dome;
mod effects;
mod error;
mod film;
mod headset;
mod keys;
mod limits;
mod look;
mod memo;
mod names;
mod observer;
mod overlay;
mod overrides;
mod projector;
mod reading;
pub mod reference;
mod scene;
mod server;
mod surroundings;
mod time;
mod view_settings;
mod views;
mod windows;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

pub use asteroids::{FieldConfig, FieldShape};
pub use bodies::{BodyConfig, EmissionConfig, SpinConfig};
pub use cluster::{AtDeadline, ClusterConfig, ClusterTls, DIRECTOR, NodeConfig};
pub use dome::{DomeFault, DomeProjector};
pub use error::ConfigError;
pub use film::{Easing, ExposureKey, FilmPath, FovKey, FrameValues, Keyframe};
pub use keys::{with_keys_of, with_same_keys};
pub use look::Look;
pub(crate) use look::{MOST_ABOVE_DEG, MOST_TURN_DEG};
use memo::Memo;
pub use observer::ObserverConfig;
pub use overlay::{LabelConfig, OverlayConfig};
pub use projector::{BlendConfig, ProjectorConfig, ProjectorMethod, RowsConfig};
pub use scene::{CameraConfig, CatalogueConfig, LightConfig, LightUnit, SceneConfig};
use serde::Deserialize;
#[cfg(feature = "cli")]
pub(crate) use server::check_holder;
pub(crate) use server::hidden_character;
pub use server::{CertificateConfig, Role, ServerConfig, Sha256Hex, TlsConfig, TokenConfig, UNIX_PREFIX, parse_listen};
pub use surroundings::{AirConfig, GroundConfig, MOST_POINTS as MOST_HORIZON_POINTS};
use toml::{Table, Value};
pub use view_settings::{ViewSettingsError, resolve_views};
pub use views::{
    CubemapSpec, DomeMasterSpec, EquirectangularSpec, FisheyeSpec, FovSpec, MappingConfig, PackingConfig,
    PerspectiveSpec, StereoSpec, VIEW_TYPES, ViewGeometry, ViewKindSpec, ViewSpec,
};
pub use windows::{MOST_WINDOWS, MonitorChoice, WindowConfig, WindowFormat};

use crate::catalogue::bright;
use crate::catalogue::deep::{self, is_deep_store};
use crate::catalogue::epoch::Epoch;
use crate::catalogue::healpix::LightMap;
use crate::ephemeris::{Ephemeris, Kernels};
use crate::observer::{Moment, Observer};
use crate::plan::settings::{
    AccuracySettings, AsteroidSettings, ExposureSettings, GlareSettings, HeadsetSettings, RenderSettings, StarSettings,
    ToneMapSettings,
};
use crate::plan::view_settings::{FrameGroup, ViewSettings, frame_groups};
pub use crate::ranges::KeyError;
use crate::ranges::key_below;
use crate::scene::asteroids::{FieldSpec, SpecError, make_fields};
use crate::scene::bodies::check_suns;
use crate::scene::loader::StarSource;
use crate::scene::overlay::Overlay;
use crate::scene::{SceneClock, SceneObjects};
use crate::units::JULIAN_YEAR_S;
use crate::view::Rig;
use crate::view::projector::{Beam, Blend};

/// A configuration whose every key and range has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Name of its file in messages.
    pub origin: String,
    /// The folder to which relative paths refer.
    pub folder: PathBuf,
    /// The part of the configuration that determines pictures, as TOML: all tables with overrides applied, except those of the daemon, the cluster,
    /// the headset and windows, without comments and with sorted keys. Reading it gives these tables again. The content of the files that it names is
    /// not included.
    pub pictured: String,
    /// The part of the configuration that all machines of a cluster have in common, as TOML: everything except `[server]`, with overrides applied. A
    /// time `now` is left as written.
    pub shared: String,
    /// `[scene]`.
    pub scene: SceneConfig,
    /// `[[views]]`.
    pub views: Vec<ViewSpec>,
    /// `[[bodies]]`.
    pub bodies: Vec<BodyConfig>,
    /// `[[asteroid_fields]]`.
    pub asteroid_fields: Vec<FieldConfig>,
    /// `[overlay]`.
    pub overlay: OverlayConfig,
    /// `[asteroids]`.
    pub asteroids: AsteroidSettings,
    /// `[stars]`.
    pub stars: StarSettings,
    /// `[glare]`.
    pub glare: GlareSettings,
    /// `[exposure]`.
    pub exposure: ExposureSettings,
    /// `[tone_map]`.
    pub tone_map: ToneMapSettings,
    /// `[accuracy]`.
    pub accuracy: AccuracySettings,
    /// `[headset]`.
    pub headset: HeadsetSettings,
    /// `[[windows]]`.
    pub windows: Vec<WindowConfig>,
    /// `[cluster]`, if there is one.
    pub cluster: Option<ClusterConfig>,
    /// `[[nodes]]`.
    pub nodes: Vec<NodeConfig>,
    /// `[server]`.
    pub server: ServerConfig,
    computed_blends: Memo<Vec<Beam>, Vec<Blend>>,
    built_rig: Memo<Vec<ViewSpec>, Rig>,
}

impl Config {
    /// Returns the files that pictures depend on and that the configuration names: catalogues, point-spread functions, textures, a landscape,
    /// kernels, shapes and calibrations. Paths are absolute or relative to the working directory. Files that these files name in turn are not
    /// included.
    pub fn named_files(&self) -> Vec<PathBuf> {
        let catalogues = self.star_sources().into_iter().filter_map(|source| match source {
            // The index of a deep store contains checksums of everything else in the store.
            StarSource::File(path) if is_deep_store(&path) => Some(path.join(deep::index::NAME)),
            StarSource::File(path) | StarSource::Light(LightMap { path, .. }) => Some(path),
            StarSource::Bright | StarSource::BrightVariable | StarSource::Galaxy(_) => None,
        });
        let of_views =
            self.views.iter().filter_map(|view| Some(self.folder.join(view.glare.as_ref()?.psf_file.as_ref()?)));
        let calibrations = self.views.iter().flat_map(|view| match &view.geometry.kind {
            ViewKindSpec::Projector(projector) => {
                let files = [Some(&projector.file), projector.lut.as_ref()];
                files.into_iter().flatten().map(|file| self.folder.join(file)).collect()
            }
            _ => Vec::new(),
        });
        let textures = self.bodies.iter().filter_map(|body| Some(self.folder.join(body.texture.as_ref()?)));
        let landscape = self.scene.observer.as_ref().and_then(|observer| observer.ground.landscape.as_ref());
        let landscape = landscape.map(|file| self.folder.join(file));
        let mut files: Vec<PathBuf> = catalogues.collect();
        files.extend(self.stars.psf_texture.file.clone());
        files.extend(self.glare.psf_file.clone());
        let kernels = self.scene.kernels.iter().map(|file| self.folder.join(file));
        files.extend(of_views.chain(calibrations).chain(textures).chain(landscape).chain(kernels));
        files.extend(self.shape_files());
        files
    }

    /// Returns the keys of a view's geometry as written in the configuration, on one line. If a film has changed the field of view, the line has the
    /// new value.
    pub fn geometry_line(&self, view: usize) -> String {
        let document: Table = self.pictured.parse().unwrap_or_default();
        let table = document.get("views").and_then(|views| views.get(view)).and_then(Value::as_table);
        let mut keys = table.cloned().unwrap_or_default();
        let shared = ViewSpec::shared_keys();
        keys.retain(|key, _| !shared.contains(&key));
        if let Some(ViewKindSpec::Perspective(now)) = self.views.get(view).map(|view| &view.geometry.kind)
            && let Ok(given) =
                PerspectiveSpec::deserialize(Value::Table(without(&keys, &["type", "orientation", "position_m"])))
            && (given.fov_y_deg, given.fov) != (now.fov_y_deg, now.fov)
        {
            keys.extend(keys::table_of(now).unwrap_or_default().into_iter().filter(|(key, _)| key != "size"));
        }
        let keys: Vec<String> = keys.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        keys.join("; ")
    }

    /// The glTF files of asteroid fields.
    pub fn shape_files(&self) -> Vec<PathBuf> {
        let shapes = self.asteroid_fields.iter().flat_map(|field| field.shapes.iter().flatten());
        shapes.map(|file| self.folder.join(file)).collect()
    }

    fn check_views(mut self) -> Result<Self, KeyError> {
        let rig = self.build_rig()?;
        let settings = self.resolve_views()?;
        self.build_overlay(None)?;
        let patterned: Vec<&str> =
            self.views.iter().filter(|view| view.test_pattern).map(|view| view.name.as_str()).collect();
        self.windows = windows::windows(std::mem::take(&mut self.windows), &rig, &self.overlay, &patterned)
            .map_err(|(index, fault)| WINDOWS.fault(index, None, fault))?;
        headset::check_views(&self.headset, &self.views).map_err(|fault| fault.within("headset"))?;
        cluster::check_nodes(&self.nodes, &self.views, &self.windows)
            .map_err(|(index, fault)| NODES.fault(index, None, fault))?;
        match (&self.cluster, self.nodes.is_empty()) {
            (Some(_), false) => {
                cluster::check_exposures(&self.exposure, &settings).map_err(|fault| fault.within("cluster"))?;
            }
            (Some(_), true) => return Err(KeyError::new("nodes", "a cluster must have at least one node")),
            (None, false) => return Err(KeyError::new("nodes", "has no effect without [cluster]")),
            (None, true) => {}
        }
        Ok(self)
    }

    fn build_rig(&self) -> Result<Rig, KeyError> {
        self.built_rig.of(&self.views, || self.new_rig())
    }

    fn new_rig(&self) -> Result<Rig, KeyError> {
        let mut views = Vec::with_capacity(self.views.len());
        for (index, config) in self.views.iter().enumerate() {
            if let Some(first) = self.views[..index].iter().position(|other| other.name == config.name) {
                let problem = format!("views[{first}] also has this name: names must be unique");
                return Err(VIEWS.fault(index, Some(&config.name), KeyError::new("name", problem)));
            }
            views.push(config.view(Some(&self.folder)).map_err(|fault| VIEWS.fault(index, Some(&config.name), fault))?);
        }
        dome::match_projectors(&self.views, &mut views, &self.computed_blends)
            .map_err(|(index, fault)| VIEWS.fault(index, Some(&self.views[index].name), fault))?;
        Rig::new(views).map_err(|error| KeyError::new("views", error.to_string()))
    }

    fn resolve_views(&self) -> Result<Vec<ViewSettings>, KeyError> {
        resolve_views(&self.render_settings(), &self.views, &self.folder).map_err(
            |ViewSettingsError { view, key, problem }| {
                VIEWS.fault(view, Some(&self.views[view].name), KeyError::new(key, problem))
            },
        )
    }

    /// The overlay. The paths of its files are relative to `folder`; if it is `None`, no file is read.
    fn build_overlay(&self, folder: Option<&Path>) -> Result<Overlay, KeyError> {
        let patterned = self.views.iter().filter(|view| view.test_pattern);
        let names = patterned.map(|view| view.name.clone()).collect();
        let overlay = self.overlay.overlay(names, folder).map_err(|fault| fault.within("overlay"))?;
        let checked = overlay.check_observer(self.scene.observer.is_some());
        checked.map_err(|(key, problem)| KeyError::new(format!("overlay.{key}"), problem))?;
        Ok(overlay)
    }

    fn error(&self, fault: KeyError) -> ConfigError {
        ConfigError::Key { origin: self.origin.clone(), key: fault.key, problem: fault.problem }
    }

    /// The rig of all views.
    pub fn rig(&self) -> Result<Rig, ConfigError> {
        self.build_rig().map_err(|fault| self.error(fault))
    }

    /// The scene's time, which runs in `serve`, `show` and `xr`.
    pub fn clock(&self) -> SceneClock {
        SceneClock::running(self.scene.time_s(), self.scene.time_rate, SystemTime::now())
    }

    /// The observer on the Earth, if the scene has one.
    pub fn observer(&self) -> Option<Observer> {
        self.scene.observer()
    }

    /// The time for which stars are placed, and the observer.
    pub fn epoch(&self) -> Epoch {
        let observer = self.observer();
        match observer {
            Some(Observer { epoch, .. }) => epoch.of_stars(),
            None => Epoch { years: self.scene.time_s() / JULIAN_YEAR_S, seen_from: None },
        }
    }

    /// The general settings of drawing.
    pub fn render_settings(&self) -> RenderSettings {
        RenderSettings {
            stars: self.stars.clone(),
            asteroids: self.asteroids.clone(),
            glare: self.glare.clone(),
            exposure: self.exposure,
            tone_map: self.tone_map,
            accuracy: self.accuracy,
        }
    }

    /// The settings of every view: the general settings, changed by its own tables.
    pub fn view_settings(&self) -> Result<Vec<ViewSettings>, ConfigError> {
        self.resolve_views().map_err(|fault| self.error(fault))
    }

    /// The groups of views, each drawn as one frame, one after the other. There is a single group unless views have their own settings.
    pub fn frame_groups(&self) -> Result<Vec<FrameGroup>, ConfigError> {
        Ok(frame_groups(&self.rig()?, &self.render_settings(), &self.view_settings()?))
    }

    fn fault_of_body(&self, index: usize, fault: KeyError) -> KeyError {
        BODIES.fault(index, self.bodies.get(index).map(|body| body.name.as_str()), fault)
    }

    fn fault_of_field(&self, index: usize, fault: KeyError) -> KeyError {
        FIELDS.fault(index, self.asteroid_fields.get(index).map(|field| field.name.as_str()), fault)
    }

    fn specs(&self) -> Result<Vec<Arc<FieldSpec>>, KeyError> {
        let spec = |(index, field): (usize, &FieldConfig)| {
            field.spec(&self.folder).map(Arc::new).map_err(|fault| self.fault_of_field(index, fault))
        };
        self.asteroid_fields.iter().enumerate().map(spec).collect()
    }

    /// Specifications of the asteroid fields. Paths are absolute or relative to the working directory.
    pub fn field_specs(&self) -> Result<Vec<Arc<FieldSpec>>, ConfigError> {
        self.specs().map_err(|fault| self.error(fault))
    }

    /// Bodies and asteroid fields at the configuration's time. Reads textures and shapes, and places the asteroids, which
    /// takes about a second for each million.
    pub fn objects(&self) -> Result<SceneObjects, ConfigError> {
        let body = |(index, config): (usize, &BodyConfig)| {
            let loaded = config.load(&self.folder).map_err(|fault| self.fault_of_body(index, fault));
            loaded.map(Arc::new).map_err(|fault| self.error(fault))
        };
        let bodies = self.bodies.iter().enumerate().map(body).collect::<Result<Vec<_>, _>>()?;
        check_suns(bodies.iter().map(Arc::as_ref))
            .map_err(|(index, error)| self.error(self.fault_of_body(index, error)))?;
        let made = make_fields(&self.field_specs()?, &[]).map_err(|(index, error): (usize, SpecError)| {
            self.error(self.fault_of_field(index, asteroids::spec_fault(&error)))
        })?;
        let fields = made.into_iter().map(|made| made.field).collect();
        let overlay = Arc::new(self.build_overlay(Some(&self.folder)).map_err(|fault| self.error(fault))?);
        let observer = self.observer();
        let kernels = self.kernels().map_err(|fault| self.error(fault))?;
        self.check_kernels(kernels.as_deref(), observer.as_ref()).map_err(|fault| self.error(fault))?;
        let of_observer = |observer: &ObserverConfig| observer.surroundings(&self.folder);
        let surroundings = self.scene.observer.as_ref().map(of_observer).transpose();
        let surroundings =
            surroundings.map_err(|fault| self.error(fault.within("scene.observer")))?.flatten().map(Arc::new);
        let time_s = self.scene.time_s();
        let objects = SceneObjects {
            bodies,
            fields,
            time_s,
            observer,
            kernels,
            surroundings,
            local_sky: None,
            earth_m: None,
            zodiacal_light: self.scene.has_zodiacal_light(),
            overlay,
        };
        Ok(objects.placed())
    }

    /// The kernels of `scene.kernels`; `None`: the list is empty.
    fn kernels(&self) -> Result<Option<Arc<Kernels>>, KeyError> {
        let files: Vec<PathBuf> = self.scene.kernels.iter().map(|file| self.folder.join(file)).collect();
        if files.is_empty() {
            return Ok(None);
        }
        Kernels::load(&files).map(Some).map_err(|error| KeyError::new("scene.kernels", error.to_string()))
    }

    /// Checks that the kernels cover all bodies that need them, at the scene's time.
    fn check_kernels(&self, kernels: Option<&Kernels>, observer: Option<&Observer>) -> Result<(), KeyError> {
        let moment = Moment::new(self.scene.time_s(), observer);
        for (index, body) in self.bodies.iter().enumerate() {
            let Some(of) = body.ephemeris else { continue };
            check_place(of, kernels, &moment)
                .map_err(|problem| self.fault_of_body(index, KeyError::new("ephemeris", problem)))?;
        }
        Ok(())
    }

    /// The star catalogues. Paths are absolute or relative to the working directory.
    pub fn star_sources(&self) -> Vec<StarSource> {
        self.scene
            .catalogues
            .iter()
            .map(|catalogue| match catalogue {
                CatalogueConfig::Named(name) if name == bright::NAME && self.scene.variable_stars => {
                    StarSource::BrightVariable
                }
                CatalogueConfig::Named(name) if name == bright::NAME => StarSource::Bright,
                CatalogueConfig::Named(name) => StarSource::File(self.folder.join(name)),
                CatalogueConfig::Light(light) => StarSource::Light(light.map(&self.folder)),
                CatalogueConfig::Galaxy(galaxy) => StarSource::Galaxy(*galaxy),
            })
            .collect()
    }
}

/// Returns a table without the given keys.
fn without(table: &Table, keys: &[&str]) -> Table {
    let others = table.iter().filter(|(key, _)| !keys.contains(&key.as_str()));
    others.map(|(key, value)| (key.clone(), value.clone())).collect()
}

/// A list of named tables.
struct Named {
    /// Key of the list.
    list: &'static str,
    /// Noun for one entry.
    one: &'static str,
}

const VIEWS: Named = Named { list: "views", one: "view" };
const BODIES: Named = Named { list: "bodies", one: "body" };
const FIELDS: Named = Named { list: "asteroid_fields", one: "field" };
const WINDOWS: Named = Named { list: "windows", one: "window" };
const NODES: Named = Named { list: "nodes", one: "node" };

impl Named {
    /// Completes an error of one entry: its path has the index, followed by the name.
    fn fault(&self, index: usize, name: Option<&str>, fault: KeyError) -> KeyError {
        let key = key_below(&format!("{}[{index}]", self.list), &fault.key);
        KeyError { key: name.map_or(key.clone(), |name| format!("{key} ({} `{name}`)", self.one)), ..fault }
    }
}

/// Checks that kernels cover an ephemeris at a time. The error gives the reason, and the times that they cover.
pub(crate) fn check_place(of: Ephemeris, kernels: Option<&Kernels>, moment: &Moment) -> Result<(), String> {
    let Ephemeris::Spk(number) = of else { return Ok(()) };
    moment.place(of, kernels)?;
    let covered_s = kernels.and_then(|kernels| kernels.covered_s(number));
    match covered_s.filter(|[first, last]| !(*first..=*last).contains(&moment.tdb_s())) {
        None => Ok(()),
        Some(covered_s) => {
            let [first, last] = covered_s.map(crate::calendar::written);
            Err(format!("{of}: scene.time is outside the times that its kernel covers: {first} to {last} (TDB)"))
        }
    }
}

//! Configuration: strict TOML, unknown keys refused.
//!
//! A configuration is loaded in four steps, each with its own errors: text to tables ([`document`]), overrides
//! ([`overrides`]), tables to the types below (serde, with the path of the key at fault), and the ranges that types do not
//! express. What comes out is plain data; [`Config::rig`], [`Config::camera`], [`Config::render_settings`], [`Config::objects`] and
//! [`Config::star_sources`] turn it into what the other modules work with. Degrees and quaternions as (x, y, z, w) end here.

mod asteroids;
mod bodies;
mod document;
mod dome;
mod effects;
mod error;
mod film;
mod headset;
mod limits;
mod look;
mod observer;
mod overlay;
mod overrides;
mod projector;
pub mod ranges;
pub mod reference;
mod scene;
mod server;
mod surroundings;
mod view_tables;
mod views;
mod windows;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

pub use asteroids::{FieldConfig, FieldShape};
pub use bodies::{BodyConfig, EmissionConfig, SpinConfig};
pub use dome::{DomeFault, DomeProjector};
pub use effects::has_effect;
pub use error::ConfigError;
use error::{Fault, join};
pub use film::{Easing, ExposureKey, FilmPath, FovKey, FrameValues, Keyframe};
use glam::{DQuat, DVec3};
pub use look::Look;
use look::{Aim, Towards};
pub use observer::ObserverConfig;
pub use overlay::{GridConfig, LabelConfig, OverlayConfig, TrajectoryConfig};
pub use projector::{BlendConfig, ProjectorConfig, ProjectorMethod, RowsConfig};
pub use scene::{CameraConfig, CatalogueConfig, GalaxyConfig, LightConfig, LightUnit, SceneConfig};
use schemars::JsonSchema;
use serde::Deserialize;
pub use server::{CertificateConfig, Role, ServerConfig, Sha256Hex, TlsConfig, TokenConfig, UNIX_PREFIX, parse_listen};
pub use surroundings::{AirConfig, GroundConfig, MOST_POINTS as MOST_HORIZON_POINTS};
use toml::{Table, Value};
pub use view_tables::{ViewTables, ViewTablesError, resolve_views};
pub use views::{
    CubemapConfig, DefinitionError, DomeMasterConfig, EquirectangularConfig, FisheyeConfig, FovConfig, MappingConfig,
    PackingConfig, PerspectiveConfig, StereoConfig, VIEW_TYPES, ViewConfig, ViewKindConfig,
};
pub use windows::{MOST_WINDOWS, MonitorChoice, WindowConfig, WindowFormat};

use crate::catalogue::bright;
use crate::catalogue::epoch::Epoch;
use crate::catalogue::galaxy::GalaxyParameters;
use crate::catalogue::healpix::LightMap;
use crate::coordinates::lon_lat_from_direction;
use crate::ephemeris::{Ephemeris, Kernels};
use crate::files;
use crate::observer::{Moment, Observer, Refraction, frame_from_camera};
use crate::plan::settings::{
    AccuracySettings, AsteroidSettings, ExposureSettings, GlareSettings, HeadsetSettings, RenderSettings, StarSettings,
    ToneMapSettings,
};
use crate::plan::view_settings::{FrameGroup, ViewSettings, frame_groups};
use crate::scene::asteroids::{FieldSpec, SpecError, check_fields, make_fields};
use crate::scene::bodies::{MOST_BODIES, check_names, check_suns};
use crate::scene::loader::StarSource;
use crate::scene::overlay::Overlay;
use crate::scene::surroundings::BEYOND_AIR_M;
use crate::scene::{Camera, SceneClock, SceneObjects};
use crate::solar_system::SolarBody;
use crate::units::JULIAN_YEAR_S;
use crate::view::Rig;

/// What `serve` shows without a configuration file.
const BUILT_IN: &str = include_str!("built_in.toml");

/// A configuration whose every key and range has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The file it came from, as messages name it.
    pub origin: String,
    /// The folder at which relative paths start.
    pub folder: PathBuf,
    /// What determines the pictures, as TOML: the tables with overrides, but those of the daemon and the headset, without comments and in the order of their
    /// keys. The same wherever the file lies; reading it gives this configuration again. What stands in the files that it names is not in it.
    pub pictured: String,
    /// `[scene]`.
    pub scene: SceneConfig,
    /// `[[views]]`.
    pub views: Vec<ViewConfig>,
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
    /// `[server]`.
    pub server: ServerConfig,
    computed_blends: dome::Computed,
}

/// Everything but the views, bodies, fields and windows, which are read one by one, so that messages have their names.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Sections {
    /// What there is to see, when, and from where.
    #[serde(default)]
    scene: SceneConfig,
    #[serde(default)]
    #[schemars(with = "Vec<ViewConfig>")]
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
    glare: GlareSettings,
    #[serde(default)]
    exposure: ExposureSettings,
    #[serde(default)]
    tone_map: ToneMapSettings,
    #[serde(default)]
    accuracy: AccuracySettings,
    #[serde(default)]
    headset: HeadsetSettings,
    #[serde(default)]
    #[schemars(with = "Vec<WindowConfig>")]
    windows: Vec<Table>,
    #[serde(default)]
    server: ServerConfig,
}

/// Bytes of a configuration, at most.
const MOST_BYTES: u64 = 4 << 20;

impl Config {
    /// Loads a file and applies overrides (`key=value`) in their order.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        let (text, folder) = Self::text_of(path)?;
        Self::from_text(&text, &path.display().to_string(), folder, overrides)
    }

    /// What a file says, and the folder that it is in.
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

    /// A file, or without one the built-in configuration.
    pub fn load_or_built_in(path: Option<&Path>, overrides: &[String]) -> Result<Self, ConfigError> {
        path.map_or_else(|| Self::built_in(overrides), |path| Self::load(path, overrides))
    }

    /// Reads TOML; `origin` names it in messages, relative paths start at `folder`.
    pub fn from_text(text: &str, origin: &str, folder: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        Self::read(text, origin, folder, overrides, Self::check_views)
    }

    /// The same as [`Self::load`], but that its views can be built is not looked at: for what judges each of them.
    ///
    /// # Errors
    ///
    /// Those of [`Self::load`], but for those of views.
    pub fn load_unbuilt(path: &Path, overrides: &[String]) -> Result<Self, ConfigError> {
        let (text, folder) = Self::text_of(path)?;
        Self::read(&text, &path.display().to_string(), folder, overrides, Ok)
    }

    fn read(
        text: &str,
        origin: &str,
        folder: &Path,
        overrides: &[String],
        check_views: fn(Self) -> Result<Self, Fault>,
    ) -> Result<Self, ConfigError> {
        let mut table = document::parse(text, origin)?;
        let applied = overrides
            .iter()
            .map(|argument| overrides::apply(&mut table, argument))
            .collect::<Result<Vec<_>, ConfigError>>()?;
        effects::leave_out_overridden(&mut table, &applied, origin);
        scene::set_now(&mut table, SystemTime::now());
        let mut pictured = table.clone();
        // Neither is in a picture, and who may call is nobody's business who has one.
        for section in ["server", "headset", "windows"] {
            pictured.remove(section);
        }
        let loaded = Self::from_table(table, origin, folder);
        loaded.and_then(check_views).map(|config| Self { pictured: pictured.to_string(), ..config }).map_err(|fault| {
            // The last override that touches the key is to blame, if there is one; for an unknown table, one that put it there.
            let key = fault.key.split(" (").next().unwrap_or_default();
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

    /// The files that it names and that pictures depend on: catalogues, point-spread functions, textures, a landscape, kernels, shapes and calibrations, with paths that start at
    /// the working directory or the root. What those name in turn is not among them.
    pub fn named_files(&self) -> Vec<PathBuf> {
        let catalogues = self.star_sources().into_iter().filter_map(|source| match source {
            StarSource::File(path) | StarSource::Light(LightMap { path, .. }) => Some(path),
            StarSource::Bright | StarSource::Galaxy(_) => None,
        });
        let of_views = self.views.iter().filter_map(|view| {
            let file = view.tables.glare.as_ref()?.get("psf_file")?.as_str()?;
            Some(self.folder.join(file))
        });
        let calibrations = self.views.iter().flat_map(|view| match &view.kind {
            ViewKindConfig::Projector(projector) => {
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

    /// The glTF files of asteroid fields.
    pub fn shape_files(&self) -> Vec<PathBuf> {
        let shapes = self.asteroid_fields.iter().flat_map(|field| field.shapes.iter().flatten());
        shapes.map(|file| self.folder.join(file)).collect()
    }

    fn from_table(table: Table, origin: &str, folder: &Path) -> Result<Self, Fault> {
        let sections: Sections = document::deserialise(Value::Table(table.clone()), "")?;
        ranges::check(&table)?;
        let views = each(&VIEWS, sections.views, ViewConfig::from_table)?;
        let mut bodies = each(&BODIES, sections.bodies, BodyConfig::from_table)?;
        if sections.scene.has_solar_system() {
            let stands_on = sections.scene.observer.as_ref().map(|_| SolarBody::Earth);
            let missing = SolarBody::ALL
                .into_iter()
                .filter(|of| stands_on != Some(*of) && !bodies.iter().any(|body| body.stands_for(*of)));
            bodies.extend(missing.map(BodyConfig::of_solar_system).collect::<Vec<_>>());
        }
        let asteroid_fields = each(&FIELDS, sections.asteroid_fields, FieldConfig::from_table)?;
        let windows = each(&WINDOWS, sections.windows, |table| document::deserialise(Value::Table(table), ""))?;
        let mut asteroids = sections.asteroids;
        if !asteroids.cache.as_os_str().is_empty() {
            asteroids.cache = folder.join(&asteroids.cache);
        }
        let mut stars = sections.stars;
        stars.psf_texture.file = stars.psf_texture.file.map(|file| folder.join(file));
        let mut glare = sections.glare;
        glare.psf_file = glare.psf_file.map(|file| folder.join(file));
        let config = Self {
            origin: origin.to_owned(),
            folder: folder.to_owned(),
            computed_blends: dome::Computed::default(),
            pictured: String::new(),
            scene: sections.scene,
            views,
            bodies,
            asteroid_fields,
            overlay: sections.overlay,
            asteroids,
            stars,
            glare,
            exposure: sections.exposure,
            tone_map: sections.tone_map,
            accuracy: sections.accuracy,
            headset: sections.headset,
            windows,
            server: sections.server,
        };
        config.scene.check().map_err(|fault| fault.within("scene"))?;
        config.camera_of(config.scene.time_s()).map_err(|fault| fault.within("scene"))?;
        check_names(config.bodies.iter().map(|body| body.name.as_str()), MOST_BODIES)
            .map_err(|(index, error)| config.fault_of_body(index, bodies::body_fault(&error)))?;
        let specs = config.specs()?;
        check_fields(specs.iter().map(Arc::as_ref))
            .map_err(|(index, error)| config.fault_of_field(index, bodies::body_fault(&error)))?;
        asteroids::check_settings(&config.asteroids).map_err(|fault| fault.within("asteroids"))?;
        limits::check_stars(&config.stars).map_err(|fault| fault.within("stars"))?;
        limits::check_glare(&config.glare).map_err(|fault| fault.within("glare"))?;
        let exposure = table.get("exposure").and_then(Value::as_table).cloned().unwrap_or_default();
        limits::check_exposure(&config.exposure, &exposure, config.stars.method)
            .map_err(|fault| fault.within("exposure"))?;
        limits::check_tone_map(&config.tone_map).map_err(|fault| fault.within("tone_map"))?;
        headset::check(&config.headset).map_err(|fault| fault.within("headset"))?;
        server::check(&config.server).map_err(|fault| fault.within("server"))?;
        Ok(config)
    }

    fn check_views(mut self) -> Result<Self, Fault> {
        let rig = self.build_rig()?;
        self.resolve_views()?;
        self.build_overlay()?;
        let patterned: Vec<&str> =
            self.views.iter().filter(|view| view.test_pattern).map(|view| view.name.as_str()).collect();
        self.windows = windows::windows(std::mem::take(&mut self.windows), &rig, &self.overlay, &patterned)
            .map_err(|(index, fault)| WINDOWS.fault(index, None, fault))?;
        headset::check_views(&self.headset, &self.views).map_err(|fault| fault.within("headset"))?;
        Ok(self)
    }

    fn build_rig(&self) -> Result<Rig, Fault> {
        let mut views = Vec::with_capacity(self.views.len());
        for (index, config) in self.views.iter().enumerate() {
            if let Some(first) = self.views[..index].iter().position(|other| other.name == config.name) {
                let problem = format!("views[{first}] has this name too: names must be unique");
                return Err(VIEWS.fault(index, Some(&config.name), Fault::new("name", problem)));
            }
            views.push(config.view(Some(&self.folder)).map_err(|fault| VIEWS.fault(index, Some(&config.name), fault))?);
        }
        dome::match_projectors(&self.views, &mut views, &self.computed_blends)
            .map_err(|(index, fault)| VIEWS.fault(index, Some(&self.views[index].name), fault))?;
        Rig::new(views).map_err(|error| Fault::new("views", error.to_string()))
    }

    fn resolve_views(&self) -> Result<Vec<ViewSettings>, Fault> {
        let views: Vec<(&str, &ViewTables)> = self.views.iter().map(|view| (&view.name[..], &view.tables)).collect();
        view_tables::resolve_views(&self.render_settings(), &views, &self.folder).map_err(
            |ViewTablesError { view, key, problem }| VIEWS.fault(view, Some(views[view].0), Fault::new(key, problem)),
        )
    }

    fn build_overlay(&self) -> Result<Overlay, Fault> {
        let patterned = self.views.iter().filter(|view| view.test_pattern);
        let names = patterned.map(|view| view.name.clone()).collect();
        let overlay = self.overlay.overlay(names).map_err(|fault| fault.within("overlay"))?;
        let checked = overlay.check_observer(self.scene.observer.is_some());
        checked.map_err(|(index, problem)| Fault::new(format!("overlay.grids[{index}].kind"), problem))?;
        Ok(overlay)
    }

    fn error(&self, fault: Fault) -> ConfigError {
        ConfigError::Key { origin: self.origin.clone(), key: fault.key, problem: fault.problem }
    }

    /// The rig of all views.
    pub fn rig(&self) -> Result<Rig, ConfigError> {
        self.build_rig().map_err(|fault| self.error(fault))
    }

    /// The camera at the start, with revision 0.
    pub fn camera(&self) -> Result<Camera, ConfigError> {
        self.camera_at(self.scene.time_s())
    }

    /// The camera at a moment, s since 2000-01-01T12:00:00Z, with revision 0: one that hangs on the horizon turns with the Earth.
    pub fn camera_at(&self, time_s: f64) -> Result<Camera, ConfigError> {
        self.camera_of(time_s).map_err(|fault| self.error(fault.within("scene")))
    }

    /// The scene's time, which runs in `serve`, `show` and `xr`.
    pub fn clock(&self) -> SceneClock {
        SceneClock::running(self.scene.time_s(), self.scene.time_rate, SystemTime::now())
    }

    /// Who looks at the scene.
    pub fn observer(&self) -> Option<Observer> {
        self.scene.observer()
    }

    /// The moment for which its stars are placed, and who sees them.
    pub fn epoch(&self) -> Epoch {
        let observer = self.observer();
        match observer {
            Some(Observer { epoch, .. }) => epoch.of_stars(),
            None => Epoch { years: self.scene.time_s() / JULIAN_YEAR_S, seen_from: None },
        }
    }

    /// A fault names the key below `scene`.
    fn camera_of(&self, time_s: f64) -> Result<Camera, Fault> {
        let observer = self.observer();
        let camera = &self.scene.camera;
        let of_camera = |fault: Fault| fault.within("camera");
        let at_rest = camera.camera(observer.map(|observer| observer.epoch.position_m), None).map_err(of_camera)?;
        let Some(aim) = self.scene.aim()? else { return Ok(at_rest) };
        let of_look = if observer.is_some() { "observer.look" } else { "camera.look" };
        let turned = self
            .turned(&aim, (time_s, observer.as_ref()), at_rest.position_m)
            .map_err(|fault| fault.within(of_look))?;
        let turned = camera.camera(Some(at_rest.position_m), Some(turned)).map_err(of_camera)?;
        Ok(Camera { frame: aim.frame, as_of_s: time_s, ..turned })
    }

    /// Rotation from camera axes to those of ICRS.
    fn turned(&self, aim: &Aim, seen: (f64, Option<&Observer>), camera_m: DVec3) -> Result<DQuat, Fault> {
        let (time_s, observer) = seen;
        let Some(icrs_from_frame) = aim.frame.icrs_from(observer, time_s) else {
            return Err(Fault::new("frame", "horizon: there is none without [scene.observer]"));
        };
        let frame_from_camera = match &aim.towards {
            Towards::Direction([longitude_rad, latitude_rad]) => {
                frame_from_camera(*longitude_rad, *latitude_rad, aim.roll_rad)
            }
            Towards::Body(name) => {
                let Some(body) = self.bodies.iter().find(|body| body.name == *name) else {
                    let names: Vec<&str> = self.bodies.iter().map(|body| &body.name[..]).collect();
                    let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                    return Err(Fault::new("at", format!("`{name}`: there is no such body; there are: {names}")));
                };
                let place_m = match body.ephemeris {
                    Some(of) => {
                        let kernels = self.kernels()?;
                        let placed = Moment::new(time_s, observer).place(of, kernels.as_deref());
                        placed.map_err(|problem| Fault::new("at", format!("`{name}`: {problem}")))?.0
                    }
                    None => body.body()?.position_m,
                };
                if place_m == camera_m {
                    return Err(Fault::new("at", format!("`{name}`: the camera is at its centre")));
                }
                let seen_m = self.seen_m(place_m - camera_m, seen);
                let in_frame = icrs_from_frame.transpose() * seen_m;
                let (longitude_rad, latitude_rad) = lon_lat_from_direction(in_frame);
                frame_from_camera(longitude_rad, latitude_rad, aim.roll_rad)
            }
        };
        Ok(DQuat::from_mat3(&icrs_from_frame) * frame_from_camera)
    }

    /// Where what lies far away at a place relative to the camera is seen at a moment through the air of an observer, m.
    fn seen_m(&self, place_m: DVec3, (time_s, observer): (f64, Option<&Observer>)) -> DVec3 {
        let air = self.scene.observer.as_ref().and_then(ObserverConfig::refracting);
        let (Some(observer), Some(air)) = (observer, air) else { return place_m };
        let zenith = observer.icrs_from_horizon(time_s) * DVec3::Y;
        if place_m.length() > BEYOND_AIR_M {
            Refraction { zenith, density: air.density() }.seen(place_m)
        } else {
            place_m
        }
    }

    /// How frames are drawn.
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

    /// The settings of every view: its own tables over the general ones.
    pub fn view_settings(&self) -> Result<Vec<ViewSettings>, ConfigError> {
        self.resolve_views().map_err(|fault| self.error(fault))
    }

    /// The frames that the views make, which are drawn one after the other: one, unless views have settings of their own.
    pub fn frame_groups(&self) -> Result<Vec<FrameGroup>, ConfigError> {
        Ok(frame_groups(&self.rig()?, &self.render_settings(), &self.view_settings()?))
    }

    fn fault_of_body(&self, index: usize, fault: Fault) -> Fault {
        BODIES.fault(index, self.bodies.get(index).map(|body| body.name.as_str()), fault)
    }

    fn fault_of_field(&self, index: usize, fault: Fault) -> Fault {
        FIELDS.fault(index, self.asteroid_fields.get(index).map(|field| field.name.as_str()), fault)
    }

    fn specs(&self) -> Result<Vec<Arc<FieldSpec>>, Fault> {
        let spec = |(index, field): (usize, &FieldConfig)| {
            field.spec(&self.folder).map(Arc::new).map_err(|fault| self.fault_of_field(index, fault))
        };
        self.asteroid_fields.iter().enumerate().map(spec).collect()
    }

    /// What the asteroid fields are made from, with paths that start at the working directory or the root.
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
            .map_err(|(index, error)| self.error(self.fault_of_body(index, bodies::body_fault(&error))))?;
        let made = make_fields(&self.field_specs()?, &[]).map_err(|(index, error): (usize, SpecError)| {
            self.error(self.fault_of_field(index, asteroids::spec_fault(&error)))
        })?;
        let fields = made.into_iter().map(|made| made.field).collect();
        let overlay = Arc::new(self.build_overlay().map_err(|fault| self.error(fault))?);
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
            overlay,
        };
        Ok(objects.placed())
    }

    /// The kernels of `scene.kernels`; `None`: there are none.
    fn kernels(&self) -> Result<Option<Arc<Kernels>>, Fault> {
        let files: Vec<PathBuf> = self.scene.kernels.iter().map(|file| self.folder.join(file)).collect();
        if files.is_empty() {
            return Ok(None);
        }
        Kernels::load(&files).map(Some).map_err(|error| Fault::new("scene.kernels", error.to_string()))
    }

    /// That the kernels have all bodies that need them, at the scene's time.
    fn check_kernels(&self, kernels: Option<&Kernels>, observer: Option<&Observer>) -> Result<(), Fault> {
        let moment = Moment::new(self.scene.time_s(), observer);
        for (index, body) in self.bodies.iter().enumerate() {
            let Some(of) = body.ephemeris else { continue };
            check_place(of, kernels, &moment)
                .map_err(|problem| self.fault_of_body(index, Fault::new("ephemeris", problem)))?;
        }
        Ok(())
    }

    /// The star catalogues, with paths that start at the working directory or the root.
    pub fn star_sources(&self) -> Vec<StarSource> {
        self.scene
            .catalogues
            .iter()
            .map(|catalogue| match catalogue {
                CatalogueConfig::Named(name) if name == bright::NAME => StarSource::Bright,
                CatalogueConfig::Named(name) => StarSource::File(self.folder.join(name)),
                CatalogueConfig::Light(light) => StarSource::Light(light.map(&self.folder)),
                CatalogueConfig::Galaxy(galaxy) => StarSource::Galaxy(GalaxyParameters {
                    unresolved_light: galaxy.unresolved_light,
                    stars: galaxy.stars,
                    seed: galaxy.seed,
                    fainter_than: galaxy.fainter_than,
                }),
            })
            .collect()
    }
}

/// A list of named tables.
struct Named {
    /// Key of the list.
    list: &'static str,
    /// What one of them is.
    one: &'static str,
}

const VIEWS: Named = Named { list: "views", one: "view" };
const BODIES: Named = Named { list: "bodies", one: "body" };
const FIELDS: Named = Named { list: "asteroid_fields", one: "field" };
const WINDOWS: Named = Named { list: "windows", one: "window" };

impl Named {
    /// A fault of one of them: the path by index, and the name after it.
    fn fault(&self, index: usize, name: Option<&str>, fault: Fault) -> Fault {
        let key = join(&format!("{}[{index}]", self.list), &fault.key);
        Fault { key: name.map_or(key.clone(), |name| format!("{key} ({} `{name}`)", self.one)), ..fault }
    }
}

/// Reads tables one by one.
fn each<T>(named: &Named, tables: Vec<Table>, read: impl Fn(Table) -> Result<T, Fault>) -> Result<Vec<T>, Fault> {
    let read = |(index, table): (usize, Table)| {
        let name = table.get("name").and_then(Value::as_str).map(str::to_owned);
        read(table).map_err(|fault| named.fault(index, name.as_deref(), fault))
    };
    tables.into_iter().enumerate().map(read).collect()
}

/// That kernels have a place for an ephemeris at a scene's moment, and cover it. The error tells why not, and which times they cover.
pub(crate) fn check_place(of: Ephemeris, kernels: Option<&Kernels>, moment: &Moment) -> Result<(), String> {
    let Ephemeris::Spk(number) = of else { return Ok(()) };
    moment.place(of, kernels)?;
    let covered_s = kernels.and_then(|kernels| kernels.covered_s(number));
    match covered_s.filter(|[first, last]| !(*first..=*last).contains(&moment.tdb_s())) {
        None => Ok(()),
        Some(covered_s) => {
            let written =
                |tdb_s| scene::written_time(tdb_s).map_or_else(|| format!("{tdb_s} s"), |time| time.to_string());
            let [first, last] = covered_s.map(written);
            Err(format!("{of}: scene.time is not among the times of its kernel: {first} to {last} (TDB)"))
        }
    }
}

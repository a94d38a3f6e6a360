//! `type = "projector"`: a projector's raster, from the calibration that its installer has delivered. What projectors have to agree on stands in [`super::dome`].

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{Fault, finite};
use crate::{
    scene::finite_vector,
    theatre::{Axes, Calibration, Mask, ReadOptions, Region, RowOrder, ScreenSums, read, read_lut},
    view::{
        ViewKind,
        projection::{TabulatedMapping, TabulationError, Warp},
        projector::{Blend, Lut, ProjectorOutput, Resampling, Response},
    },
};

/// Order of the rows of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RowsConfig {
    /// As the format says.
    #[default]
    AsFormat,
    /// The first row of the file is the top one of the raster.
    TopFirst,
    /// The first row of the file is the bottom one of the raster.
    BottomFirst,
}

impl From<RowsConfig> for RowOrder {
    fn from(rows: RowsConfig) -> Self {
        match rows {
            RowsConfig::AsFormat => Self::AsFormat,
            RowsConfig::TopFirst => Self::TopFirst,
            RowsConfig::BottomFirst => Self::BottomFirst,
        }
    }
}

/// How a projector's picture is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProjectorMethod {
    /// Everything is drawn straight into the projector's pixels.
    #[default]
    Direct,
    /// A flat picture that covers its field (a round one where it is too wide) is drawn and bent as a texture: what others do, for comparison.
    Resampled,
}

/// Where a projector's share of the light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlendConfig {
    /// The masks and black levels of the file, as far as it has some.
    #[default]
    File,
    /// Computed from the overlap of all projectors of the configuration.
    Computed,
    /// It gives all of its light.
    None,
}

/// A projector's raster.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProjectorConfig {
    /// The calibration: `.mpcdi`, SGCT's JSON, meshes, or directions as `.pfm` or `.exr`; told by its content.
    pub file: PathBuf,
    /// Where the file has several: the name of one, which the error tells where it is missing.
    pub region: Option<String>,
    /// How the picture is made.
    #[serde(default)]
    pub method: ProjectorMethod,
    /// `resampled`: pixels of the flat picture along a mean pixel of the projector, 0.25 to 4; 1 where it is not given.
    pub source_scale: Option<f64>,
    /// Width and height of the raster, where the file has none.
    pub size: Option<[u32; 2]>,
    /// Order of the rows in the file, where it is known to differ from the format's.
    #[serde(default)]
    pub rows: RowsConfig,
    /// Axes of the file, as `x=x,y=z,z=-y`: each axis of the dome (+x right, +y up, -z forward) is one of the file's. Absent: as the format says.
    pub axes: Option<String>,
    /// Where the spectator is, in the units and axes of the dome, m.
    #[serde(default)]
    pub eye_m: [f64; 3],
    /// Field of view of the fisheye that a mesh takes its picture from.
    #[serde(default = "half_turn_deg")]
    pub fov_deg: f64,
    /// Tilt of that fisheye towards the front.
    #[serde(default)]
    pub tilt_deg: f64,
    /// Its share of the light.
    #[serde(default)]
    pub blend: BlendConfig,
    /// Its light is the code to this power, 1 to 4. Absent: it follows the sRGB curve.
    pub gamma: Option<f64>,
    /// A look-up table (`.cube`) for the codes that it is sent, in place of the file's.
    pub lut: Option<PathBuf>,
    /// Luminance of its white on the dome, as measured, 0.001 to 1e6: where projectors have it, all are dimmed to the darkest, each by one factor.
    pub white_cd_m2: Option<f64>,
    /// Luminance of its black on the dome, 0 to 1e6, for `blend = "computed"`: black is lifted to the level where most projectors overlap.
    pub black_cd_m2: Option<f64>,
    #[serde(skip)]
    loaded: Loaded,
}

fn half_turn_deg() -> f64 {
    180.0
}

/// Pixels of the picture that a projector's is bent from, along one of the projector's.
const SOURCE_SCALES: [f64; 2] = [0.25, 4.0];
/// Exponents of projectors.
const GAMMAS: [f64; 2] = [1.0, 4.0];
/// Luminances of their white and black on a dome, cd/m^2.
const WHITES_CD_M2: [f64; 2] = [1e-3, 1e6];
const BLACKS_CD_M2: [f64; 2] = [0.0, 1e6];

/// How messages on warps without an inverse begin.
pub(super) const FOLDS: &str = "the warp folds";

/// Reading and baking takes seconds, so once for all who ask.
#[derive(Clone, Debug, Default)]
struct Loaded(Arc<OnceLock<Result<Calibrated, Fault>>>);

/// What a calibration has made: the view, and the points of the screen where it has some.
#[derive(Clone, Debug)]
struct Calibrated {
    kind: ViewKind,
    screen: Option<ScreenSums>,
}

impl PartialEq for Loaded {
    /// It follows from the keys.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl ProjectorConfig {
    /// The view's kind. `folder` is where relative paths start; the calibration is read and its table made by the first call.
    pub(super) fn kind(&self, folder: &Path) -> Result<ViewKind, Fault> {
        self.calibrated(folder).map(|calibrated| calibrated.kind)
    }

    /// The points of the screen in view axes, where the calibration has some and can be read.
    pub(super) fn screen(&self, folder: &Path) -> Option<ScreenSums> {
        self.calibrated(folder).ok()?.screen
    }

    fn calibrated(&self, folder: &Path) -> Result<Calibrated, Fault> {
        self.loaded.0.get_or_init(|| self.load(folder)).clone()
    }

    /// What the calibration has, with everything that was assumed.
    fn region(&self, folder: &Path) -> Result<(Region, Vec<String>), Fault> {
        finite("fov_deg", self.fov_deg)?;
        finite("tilt_deg", self.tilt_deg)?;
        let eye_m = finite_vector("eye_m", self.eye_m).map_err(|error| Fault::new("eye_m", error.to_string()))?;
        let axes = match &self.axes {
            None => Axes::AsFormat,
            Some(axes) => Axes::parse(axes).map_err(|problem| Fault::new("axes", problem))?,
        };
        let options = ReadOptions {
            region: self.region.clone(),
            size_px: self.size,
            rows: self.rows.into(),
            axes,
            eye_m,
            fov_deg: self.fov_deg,
            tilt_deg: self.tilt_deg,
        };
        let path = folder.join(&self.file);
        let Calibration { format, regions, notes } =
            read(&path, &options).map_err(|error| Fault::new("file", error.to_string()))?;
        let region = match <[Region; 1]>::try_from(regions) {
            Ok([region]) => region,
            Err(regions) => {
                let names: Vec<&str> = regions.iter().map(|region| region.name.as_str()).collect();
                let problem =
                    format!("{} has {} regions, one is needed: {}", path.display(), names.len(), names.join(", "));
                return Err(Fault::new("region", problem));
            }
        };
        let notes =
            notes.iter().map(|note| format!("{} ({format}), {}: {note}", path.display(), region.name)).collect();
        Ok((region, notes))
    }

    fn load(&self, folder: &Path) -> Result<Calibrated, Fault> {
        self.check_keys()?;
        let (region, notes) = self.region(folder)?;
        for note in notes {
            tracing::info!("{note}");
        }
        let lut = self.lut.as_ref().map(|path| read_lut(&folder.join(path)));
        let lut = lut.transpose().map_err(|error| Fault::new("lut", error.to_string()))?;
        let path = folder.join(&self.file);
        self.view_of(&region, lut)
            .map(|kind| Calibrated { kind, screen: region.screen })
            .map_err(|problem| Fault::new("file", format!("{}, {}: {problem}", path.display(), region.name)))
    }

    /// Numbers that are out of range, and keys that would do nothing.
    fn check_keys(&self) -> Result<(), Fault> {
        let ranges = [
            ("source_scale", self.source_scale, SOURCE_SCALES),
            ("gamma", self.gamma, GAMMAS),
            ("white_cd_m2", self.white_cd_m2, WHITES_CD_M2),
            ("black_cd_m2", self.black_cd_m2, BLACKS_CD_M2),
        ];
        for (key, value, [least, most]) in ranges {
            if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
                return Err(Fault::new(key, format!("{value}: allowed are {least} to {most}")));
            }
        }
        if self.source_scale.is_some() && self.method != ProjectorMethod::Resampled {
            return Err(Fault::new("source_scale", "belongs to method = \"resampled\""));
        }
        match (self.black_cd_m2, self.white_cd_m2) {
            (None, _) => Ok(()),
            (Some(_), _) if self.blend != BlendConfig::Computed => {
                Err(Fault::new("black_cd_m2", "belongs to blend = \"computed\""))
            }
            (Some(black), Some(white)) if black < white => Ok(()),
            _ => Err(Fault::new("black_cd_m2", "a white_cd_m2 above it is needed beside it")),
        }
    }

    fn view_of(&self, region: &Region, lut: Option<Lut>) -> Result<ViewKind, String> {
        let warp = Warp::new(region.size_px, &region.grid).map_err(|error| error.to_string())?;
        let mapping = TabulatedMapping::new(warp).map_err(|error| match error {
            TabulationError::Folded { .. } | TabulationError::NotInverse { .. } | TabulationError::Junction { .. } => {
                format!("{FOLDS}: {error}")
            }
            _ => error.to_string(),
        });
        let mapping = Arc::new(mapping?);
        let [alpha, beta] = [&region.alpha, &region.beta]
            .map(|mask| mask.as_ref().filter(|_| self.blend == BlendConfig::File).map(Mask::weights));
        let blend = (alpha.is_some() || beta.is_some()).then(|| Blend::new(region.size_px, alpha, beta));
        let blend = blend.transpose().map_err(|error| error.to_string())?;
        let resampling = match self.method {
            ProjectorMethod::Direct => None,
            ProjectorMethod::Resampled => {
                let resampling = Resampling::new(&mapping, self.source_scale.unwrap_or(1.0));
                Some(resampling.map_err(|error| format!("the picture that it is bent from: {error}"))?)
            }
        };
        let response = Response { gamma: self.gamma, lut: lut.or_else(|| region.lut.clone()) };
        let output = Arc::new(ProjectorOutput::new(region.size_px, resampling, blend, response)?);
        Ok(ViewKind::Projector { mapping, output })
    }
}

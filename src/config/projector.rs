//! `type = "projector"`: a projector's raster, from the calibration of its installer. [`super::dome`] has the rules that involve several projectors.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ranges::KeyError;
use crate::{
    scene::finite_vector,
    theatre::{Axes, Calibration, Mask, ReadOptions, Region, RowOrder, ScreenSums, read, read_lut},
    view::{
        ViewKind,
        projection::{TabulatedMapping, TabulationError},
        projector::{Blend, Lut, ProjectorOutput, Resampling, Response},
    },
};

/// Order of the rows of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RowsConfig {
    /// As defined by the format.
    #[default]
    AsFormat,
    /// The first row of the file is the top row of the raster.
    TopFirst,
    /// The first row of the file is the bottom row of the raster.
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
    /// Everything is drawn directly in the projector's pixels.
    #[default]
    Direct,
    /// A flat picture that covers the projector's field of view (a round one if the field is too wide) is drawn, and then warped as a texture. Other
    /// programs do this; it is available for comparison.
    Resampled,
}

/// Where a projector's share of the light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlendConfig {
    /// The masks and black levels of the file, if it has any.
    #[default]
    File,
    /// Computed from the overlap of all projectors of the configuration.
    Computed,
    /// No blend: full light everywhere.
    None,
}

/// A projector's raster.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProjectorConfig {
    /// The calibration: `.mpcdi`, SGCT's JSON, meshes, or directions as `.pfm` or `.exr`; the content determines the format.
    pub file: PathBuf,
    /// Name of a region, required if the file has several. The error without it lists them.
    pub region: Option<String>,
    /// How the picture is made.
    #[serde(default)]
    pub method: ProjectorMethod,
    /// `resampled`: number of pixels of the flat picture along a mean pixel of the projector; 1 by default.
    #[schemars(range(min = 0.25, max = 4.0))]
    pub source_scale: Option<f64>,
    /// Width and height of the raster, at least 2 each, if the file does not give them.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: Option<[u32; 2]>,
    /// Order of the rows in the file, if it differs from the order that the format defines.
    #[serde(default)]
    pub rows: RowsConfig,
    /// Axes of the file, as `x=x,y=z,z=-y`: each axis of the dome (+x right, +y up, -z forward) is an axis of the file. Absent: as defined by the format.
    pub axes: Option<String>,
    /// Position of the spectator in the units and axes of the dome, m.
    #[serde(default)]
    pub eye_m: [f64; 3],
    /// Field of view of the fisheye picture that a mesh samples.
    #[serde(default = "half_turn_deg")]
    #[schemars(range(max = 360.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "degrees"))]
    pub fov_deg: f64,
    /// Tilt of that fisheye towards the front.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub tilt_deg: f64,
    /// Source of the projector's share of the light.
    #[serde(default)]
    pub blend: BlendConfig,
    /// Exponent of the projector's response: its light is the code to this power. Absent: it follows the sRGB curve.
    #[schemars(range(min = 1.0, max = 4.0))]
    pub gamma: Option<f64>,
    /// A look-up table (`.cube`) for the projector's codes. It replaces the table of the calibration file.
    pub lut: Option<PathBuf>,
    /// Measured luminance of the projector's white on the dome. Each projector is dimmed by a constant factor to match the darkest one.
    #[schemars(range(min = 1e-3, max = 1e6), extend("x-unit" = "cd/m^2"))]
    pub white_cd_m2: Option<f64>,
    /// Luminance of the projector's black on the dome, for `blend = "computed"`. Everywhere black is raised to the level of the place where most
    /// projectors overlap.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "cd/m^2"))]
    pub black_cd_m2: Option<f64>,
    #[serde(skip)]
    loaded: Loaded,
}

fn half_turn_deg() -> f64 {
    180.0
}

/// Beginning of messages about warps without an inverse.
pub(super) const FOLDS: &str = "the warp folds";

/// Result of reading the calibration and computing its table, which takes seconds and is done once.
#[derive(Clone, Debug, Default)]
struct Loaded(Arc<OnceLock<Result<Calibrated, KeyError>>>);

/// Data from a calibration: the kind of the view, and the points of the screen if there are any.
#[derive(Clone, Debug)]
struct Calibrated {
    kind: ViewKind,
    screen: Option<ScreenSums>,
}

impl PartialEq for Loaded {
    /// Always equal, because the result is a function of the keys.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl ProjectorConfig {
    /// Returns the kind of the view. Relative paths refer to `folder`. The first call reads the calibration and makes its table.
    pub(super) fn kind(&self, folder: &Path) -> Result<ViewKind, KeyError> {
        self.calibrated(folder).map(|calibrated| calibrated.kind)
    }

    /// The points of the screen in view axes, if the calibration can be read and has any.
    pub(super) fn screen(&self, folder: &Path) -> Option<ScreenSums> {
        self.calibrated(folder).ok()?.screen
    }

    fn calibrated(&self, folder: &Path) -> Result<Calibrated, KeyError> {
        self.loaded.0.get_or_init(|| self.load(folder)).clone()
    }

    /// The region of the calibration, with a note on every assumption.
    fn region(&self, folder: &Path) -> Result<(Region, Vec<String>), KeyError> {
        let eye_m = finite_vector("eye_m", self.eye_m).map_err(|error| KeyError::new("eye_m", error.to_string()))?;
        let axes = match &self.axes {
            None => Axes::AsFormat,
            Some(axes) => Axes::parse(axes).map_err(|problem| KeyError::new("axes", problem))?,
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
        let Calibration { format, regions, notes, .. } =
            read(&path, &options).map_err(|error| KeyError::new("file", error.to_string()))?;
        let region = match <[Region; 1]>::try_from(regions) {
            Ok([region]) => region,
            Err(regions) => {
                let names: Vec<&str> = regions.iter().map(|region| region.name.as_str()).collect();
                let problem =
                    format!("{} has {} regions; name one of them: {}", path.display(), names.len(), names.join(", "));
                return Err(KeyError::new("region", problem));
            }
        };
        let notes =
            notes.iter().map(|note| format!("{} ({format}), {}: {note}", path.display(), region.name)).collect();
        Ok((region, notes))
    }

    fn load(&self, folder: &Path) -> Result<Calibrated, KeyError> {
        self.check_keys()?;
        let (region, notes) = self.region(folder)?;
        for note in notes {
            tracing::info!("{note}");
        }
        let lut = self.lut.as_ref().map(|path| read_lut(&folder.join(path)));
        let lut = lut.transpose().map_err(|error| KeyError::new("lut", error.to_string()))?;
        let path = folder.join(&self.file);
        self.view_of(&region, lut)
            .map(|kind| Calibrated { kind, screen: region.screen })
            .map_err(|problem| KeyError::new("file", format!("{}, {}: {problem}", path.display(), region.name)))
    }

    /// Refuses keys without effect, and an empty name.
    fn check_keys(&self) -> Result<(), KeyError> {
        if self.file.as_os_str().is_empty() {
            return Err(KeyError::new("file", "it is empty: must be the name of a file"));
        }
        if self.source_scale.is_some() && self.method != ProjectorMethod::Resampled {
            return Err(KeyError::new("source_scale", "has an effect only with method = \"resampled\""));
        }
        match (self.black_cd_m2, self.white_cd_m2) {
            (None, _) => Ok(()),
            (Some(_), _) if self.blend != BlendConfig::Computed => {
                Err(KeyError::new("black_cd_m2", "has an effect only with blend = \"computed\""))
            }
            (Some(black), Some(white)) if black < white => Ok(()),
            _ => Err(KeyError::new("black_cd_m2", "must be below white_cd_m2, which must be given")),
        }
    }

    fn view_of(&self, region: &Region, lut: Option<Lut>) -> Result<ViewKind, String> {
        let warp = region.warp().map_err(|error| error.to_string())?;
        let mapping = TabulatedMapping::kept(warp, &region.identity()).map_err(|error| match error {
            TabulationError::Folded { .. } | TabulationError::NotInverse { .. } | TabulationError::Junction { .. } => {
                format!("{FOLDS}: {error}")
            }
            TabulationError::Coarse { .. } => {
                format!("{error}; a mesh with more nodes may help; around the antipode of a fisheye, a smaller field of view may help")
            }
            _ => error.to_string(),
        });
        let mapping = mapping?;
        let [alpha, beta] = [&region.alpha, &region.beta]
            .map(|mask| mask.as_ref().filter(|_| self.blend == BlendConfig::File).map(Mask::weights));
        let blend = (alpha.is_some() || beta.is_some()).then(|| Blend::new(region.size_px, alpha, beta));
        let blend = blend.transpose().map_err(|error| error.to_string())?;
        let blend = blend.map(|blend| if region.multiplies_codes { blend.of_codes() } else { blend });
        let resampling = match self.method {
            ProjectorMethod::Direct => None,
            ProjectorMethod::Resampled => {
                let resampling = Resampling::new(&mapping, self.source_scale.unwrap_or(1.0));
                Some(resampling.map_err(|error| format!("the flat picture that is warped: {error}"))?)
            }
        };
        let response = Response { gamma: self.gamma, lut: lut.or_else(|| region.lut.clone()) };
        let output = Arc::new(ProjectorOutput::new(region.size_px, resampling, blend, response)?);
        Ok(ViewKind::Projector { mapping, output })
    }
}

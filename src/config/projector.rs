//! `type = "projector"`: a projector's raster, from the calibration that its installer has delivered.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{Fault, finite};
use crate::{
    scene::finite_vector,
    theatre::{Axes, Calibration, Mask, ReadOptions, Region, RowOrder, read},
    view::{
        Blend, ViewKind, Weights,
        projection::{TabulatedMapping, Warp},
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
}

/// A projector's raster: everything is drawn straight into its pixels.
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
    /// Whether masks and black levels of the file are used.
    #[serde(default = "yes")]
    pub blend: bool,
    #[serde(skip)]
    loaded: Loaded,
}

fn half_turn_deg() -> f64 {
    180.0
}

fn yes() -> bool {
    true
}

/// The view that a calibration has made: reading and baking takes seconds, so once for all who ask.
#[derive(Clone, Debug, Default)]
struct Loaded(Arc<OnceLock<Result<ViewKind, Fault>>>);

impl PartialEq for Loaded {
    /// It follows from the keys.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl ProjectorConfig {
    /// The view's kind. `folder` is where relative paths start; the calibration is read and its table made by the first call.
    pub(super) fn kind(&self, folder: &Path) -> Result<ViewKind, Fault> {
        self.loaded.0.get_or_init(|| self.load(folder)).clone()
    }

    fn load(&self, folder: &Path) -> Result<ViewKind, Fault> {
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
        for note in &notes {
            tracing::info!("{} ({format}), {}: {note}", path.display(), region.name);
        }
        self.view_of(&region)
            .map_err(|problem| Fault::new("file", format!("{}, {}: {problem}", path.display(), region.name)))
    }

    fn view_of(&self, region: &Region) -> Result<ViewKind, String> {
        if region.lut.is_some() {
            return Err("it has a look-up table of colours, which is not applied: take it out of the calibration, or let the projector apply it".into());
        }
        let warp = Warp::new(region.size_px, &region.grid).map_err(|error| error.to_string())?;
        let mapping = Arc::new(TabulatedMapping::new(warp).map_err(|error| error.to_string())?);
        let [alpha, beta] = [&region.alpha, &region.beta].map(|mask| mask.as_ref().filter(|_| self.blend).map(weights));
        let blend = (alpha.is_some() || beta.is_some()).then(|| Blend::new(region.size_px, alpha, beta));
        let blend = blend.transpose().map_err(|error| error.to_string())?.map(Arc::new);
        Ok(ViewKind::Projector { mapping, blend })
    }
}

fn weights(mask: &Mask) -> Weights<'_> {
    Weights { size: [mask.width, mask.height], values: &mask.values }
}

//! `[overlay]`: pictures, grids, trajectories and labels that are drawn over display images. Test patterns are keys of views (`test_pattern = true`).

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::coordinates::direction_from_lon_lat;
use crate::ranges::KeyError;
use crate::scene::bodies::FARTHEST_M;
use crate::scene::overlay::{
    Anchor, Colour, Grid, Label, Lists, Overlay, PICTURE_WIDTHS_DEG, Picture, PictureLevels, SIZES_PX, Trajectory,
};

/// `[overlay]`: lines and text over display images. They never change the light of HDR images.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OverlayConfig {
    /// Pictures on the sky, 16 at most with at most 16777216 texels together, under everything else.
    pub pictures: Vec<PictureConfig>,
    /// Grids of coordinates, 8 at most; later ones are drawn over earlier ones.
    pub grids: Vec<Grid>,
    /// Polylines in space, 256 at most with at most 32768 points together.
    pub trajectories: Vec<Trajectory>,
    /// Text next to directions and points, 1024 at most.
    pub labels: Vec<LabelConfig>,
    /// Whether N, NE, E, SE, S, SW, W and NW are written above the ground; needs `scene.observer`.
    pub cardinal_points: bool,
}

/// Text next to a direction (`ra_deg` and `dec_deg`, or `azimuth_deg` and `altitude_deg`) or a point (`position_m`).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Text, one line of at most 64 characters; the name by default.
    pub text: Option<String>,
    /// Right ascension (ICRS) of a direction.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub ra_deg: Option<f64>,
    /// Declination (ICRS) of a direction.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub dec_deg: Option<f64>,
    /// Azimuth from north through east of a direction of `scene.observer`.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub azimuth_deg: Option<f64>,
    /// Apparent altitude of a direction of `scene.observer`.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub altitude_deg: Option<f64>,
    /// A point, ICRS, barycentric, instead of a direction.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)), extend("x-unit" = "m"))]
    pub position_m: Option<[f64; 3]>,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "label_colour")]
    #[schemars(with = "String")]
    pub colour: Colour,
    /// Height of the font.
    #[serde(default = "label_size_px")]
    #[schemars(range(min = SIZES_PX[0], max = SIZES_PX[1]), extend("x-unit" = "pixels"))]
    pub size_px: f64,
    /// Share of the background that the text replaces, in linear light.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

/// A picture around a direction (`ra_deg` and `dec_deg`, or `azimuth_deg` and `altitude_deg`), flat, in display codes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PictureConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// A PNG of 8 bits per channel, with or without alpha. Relative paths start at the configuration's folder.
    pub file: PathBuf,
    /// Right ascension (ICRS) of its middle; north is up.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub ra_deg: Option<f64>,
    /// Declination (ICRS) of its middle.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub dec_deg: Option<f64>,
    /// Azimuth of its middle, from north through east, for `scene.observer`; the zenith is up.
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub azimuth_deg: Option<f64>,
    /// Apparent altitude of its middle, for `scene.observer`.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub altitude_deg: Option<f64>,
    /// Angle across its width, seen from the middle of the view.
    #[schemars(range(min = PICTURE_WIDTHS_DEG[0], max = PICTURE_WIDTHS_DEG[1]), extend("x-unit" = "degrees"))]
    pub width_deg: f64,
    /// Angle by which its top is turned to the left.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub roll_deg: f64,
    /// Share of the background that its opaque parts replace, in linear light.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

fn label_colour() -> Colour {
    Label::COLOUR
}

fn label_size_px() -> f64 {
    Label::SIZE_PX
}

fn one() -> f64 {
    1.0
}

impl LabelConfig {
    fn label(&self) -> Result<Label, KeyError> {
        let anchor = anchor([self.ra_deg, self.dec_deg], [self.azimuth_deg, self.altitude_deg], self.position_m)
            .ok_or_else(|| {
                let problem =
                    "exactly one is required: ra_deg and dec_deg, azimuth_deg and altitude_deg, or position_m";
                KeyError::new("position_m", problem)
            })?;
        Ok(Label {
            name: self.name.clone(),
            text: self.text.clone().unwrap_or_else(|| self.name.clone()),
            anchor,
            colour: self.colour,
            size_px: self.size_px,
            opacity: self.opacity,
        })
    }
}

/// Returns the anchor if exactly one of three forms is given: right ascension and declination, degrees; azimuth and altitude, degrees; or a point, m.
fn anchor(sky: [Option<f64>; 2], horizon: [Option<f64>; 2], position_m: Option<[f64; 3]>) -> Option<Anchor> {
    let radians = |[first, second]: [f64; 2]| [first.to_radians(), second.to_radians()];
    match (sky, horizon, position_m) {
        ([Some(ra_deg), Some(dec_deg)], [None, None], None) => {
            let [longitude, latitude] = radians([ra_deg, dec_deg]);
            Some(Anchor::Direction(direction_from_lon_lat(longitude, latitude)))
        }
        ([None, None], [Some(azimuth_deg), Some(altitude_deg)], None) => {
            Some(Anchor::Horizon(radians([azimuth_deg, altitude_deg])))
        }
        ([None, None], [None, None], Some(position_m)) => Some(Anchor::Point(DVec3::from_array(position_m))),
        _ => None,
    }
}

impl PictureConfig {
    /// The picture, whose path is relative to `folder`; with `None`, the picture has a single texel and its file is not read.
    fn picture(&self, folder: Option<&Path>) -> Result<Picture, KeyError> {
        let anchor =
            anchor([self.ra_deg, self.dec_deg], [self.azimuth_deg, self.altitude_deg], None).ok_or_else(|| {
                KeyError::new("ra_deg", "exactly one is required: ra_deg and dec_deg, or azimuth_deg and altitude_deg")
            })?;
        let levels = match folder {
            Some(folder) => PictureLevels::from_png(&folder.join(&self.file)),
            None => Ok(PictureLevels::new([1, 1], vec![[0; 4]])),
        };
        Ok(Picture {
            name: self.name.clone(),
            levels: Arc::new(levels.map_err(|error| KeyError::new("file", error.to_string()))?),
            png: None,
            anchor,
            width_rad: self.width_deg.to_radians(),
            roll_rad: self.roll_deg.to_radians(),
            opacity: self.opacity,
        })
    }
}

impl OverlayConfig {
    /// Whether it adds nothing to display images. Test patterns are not counted: they are keys of views.
    pub fn is_empty(&self) -> bool {
        let Self { pictures, grids, trajectories, labels, cardinal_points } = self;
        pictures.is_empty() && grids.is_empty() && trajectories.is_empty() && labels.is_empty() && !cardinal_points
    }

    /// Returns the overlay, with test patterns in the views with these names. Paths of files are relative to `folder` (`None`: no file is read); an
    /// error names the key below `overlay`.
    pub(super) fn overlay(&self, test_patterns: Vec<String>, folder: Option<&Path>) -> Result<Overlay, KeyError> {
        fn all<T, U>(list: Lists, from: &[T], make: impl Fn(&T) -> Result<U, KeyError>) -> Result<Vec<U>, KeyError> {
            let make = |(index, one): (usize, &T)| {
                make(one).map_err(|fault| fault.within(&format!("{}[{index}]", list.key())))
            };
            from.iter().enumerate().map(make).collect()
        }
        let overlay = Overlay {
            pictures: all(Lists::Pictures, &self.pictures, |picture| picture.picture(folder))?,
            grids: self.grids.clone(),
            trajectories: self.trajectories.clone(),
            labels: all(Lists::Labels, &self.labels, LabelConfig::label)?,
            cardinal_points: self.cardinal_points,
            test_patterns,
        };
        overlay.check().map_err(|wrong| wrong.error.within(&format!("{}[{}]", wrong.list.key(), wrong.index)))?;
        Ok(overlay)
    }
}

//! `[overlay]`: grids, trajectories and labels over display images. Test patterns are `test_pattern = true` of a view.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::Fault;
use crate::coordinates::direction_from_lon_lat;
use crate::scene::bodies::FARTHEST_M;
use crate::scene::overlay::{
    Anchor, Colour, Grid, GridKind, Label, LineStyle, Lists, Overlay, SIZES_PX, Trajectory, WIDTHS_PX,
};

/// `[overlay]`: lines and text over display images, never in light.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OverlayConfig {
    /// Grids of coordinates, 8 at most; later ones are drawn over earlier ones.
    pub grids: Vec<GridConfig>,
    /// Polylines in space, 256 at most with at most 32768 points together.
    pub trajectories: Vec<TrajectoryConfig>,
    /// Text next to directions and points, 1024 at most.
    pub labels: Vec<LabelConfig>,
}

/// Circles of longitude and latitude.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridConfig {
    /// Coordinates that it shows.
    pub kind: GridKind,
    /// Angle between neighbouring circles; 90 is a whole multiple of it.
    #[serde(default = "grid_spacing_deg")]
    #[schemars(range(min = 1.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub spacing_deg: f64,
    /// Whether the circles are numbered.
    #[serde(default = "yes")]
    pub numbers: bool,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "grid_colour")]
    pub colour: String,
    /// Width of the lines.
    #[serde(default = "grid_width_px")]
    #[schemars(range(min = WIDTHS_PX[0], max = WIDTHS_PX[1]), extend("x-unit" = "pixels"))]
    pub width_px: f64,
    /// Share of the background that it replaces, in linear light.
    #[serde(default = "grid_opacity")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

/// A polyline in space.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Corners, ICRS, barycentric, at least 2.
    pub points_m: Vec<[f64; 3]>,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "trajectory_colour")]
    pub colour: String,
    /// Width of the line.
    #[serde(default = "trajectory_width_px")]
    #[schemars(range(min = WIDTHS_PX[0], max = WIDTHS_PX[1]), extend("x-unit" = "pixels"))]
    pub width_px: f64,
    /// Share of the background that it replaces, in linear light.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

/// Text next to a direction (`ra_deg` and `dec_deg`) or a point (`position_m`).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Text, one line of at most 64 characters; the name by default.
    pub text: Option<String>,
    /// Right ascension (ICRS) of a direction.
    pub ra_deg: Option<f64>,
    /// Declination (ICRS) of a direction.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub dec_deg: Option<f64>,
    /// A point, ICRS, barycentric, instead of `ra_deg` and `dec_deg`.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)), extend("x-unit" = "m"))]
    pub position_m: Option<[f64; 3]>,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "label_colour")]
    pub colour: String,
    /// Height of the font.
    #[serde(default = "label_size_px")]
    #[schemars(range(min = SIZES_PX[0], max = SIZES_PX[1]), extend("x-unit" = "pixels"))]
    pub size_px: f64,
    /// Share of the background that it replaces, in linear light.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

fn grid_spacing_deg() -> f64 {
    Grid::SPACING_DEG
}

fn yes() -> bool {
    true
}

fn grid_colour() -> String {
    Grid::STYLE.colour.to_hex()
}

fn grid_width_px() -> f64 {
    Grid::STYLE.width_px
}

fn grid_opacity() -> f64 {
    Grid::STYLE.opacity
}

fn trajectory_colour() -> String {
    Trajectory::STYLE.colour.to_hex()
}

fn trajectory_width_px() -> f64 {
    Trajectory::STYLE.width_px
}

fn label_colour() -> String {
    Label::COLOUR.to_hex()
}

fn label_size_px() -> f64 {
    Label::SIZE_PX
}

fn one() -> f64 {
    1.0
}

fn colour(text: &str) -> Result<Colour, Fault> {
    Colour::from_hex(text).map_err(|problem| Fault::new("colour", problem))
}

impl GridConfig {
    fn grid(&self) -> Result<Grid, Fault> {
        Grid::check_spacing(self.kind, self.spacing_deg).map_err(|problem| Fault::new("spacing_deg", problem))?;
        let divisions =
            Grid::divisions_from_spacing_deg(self.spacing_deg).map_err(|problem| Fault::new("spacing_deg", problem))?;
        let style = LineStyle { colour: colour(&self.colour)?, width_px: self.width_px, opacity: self.opacity };
        Ok(Grid { kind: self.kind, divisions, numbers: self.numbers, style })
    }
}

impl TrajectoryConfig {
    fn trajectory(&self) -> Result<Trajectory, Fault> {
        let style = LineStyle { colour: colour(&self.colour)?, width_px: self.width_px, opacity: self.opacity };
        let points_m = self.points_m.iter().copied().map(DVec3::from_array).collect();
        Ok(Trajectory { name: self.name.clone(), points_m, style })
    }
}

impl LabelConfig {
    fn label(&self) -> Result<Label, Fault> {
        let anchor = match (self.ra_deg, self.dec_deg, self.position_m) {
            (Some(ra_deg), Some(dec_deg), None) => {
                Anchor::Direction(direction_from_lon_lat(ra_deg.to_radians(), dec_deg.to_radians()))
            }
            (None, None, Some(position_m)) => Anchor::Point(DVec3::from_array(position_m)),
            _ => {
                let problem = "exactly one is needed: ra_deg and dec_deg, or position_m";
                return Err(Fault::new("position_m", problem));
            }
        };
        Ok(Label {
            name: self.name.clone(),
            text: self.text.clone().unwrap_or_else(|| self.name.clone()),
            anchor,
            colour: colour(&self.colour)?,
            size_px: self.size_px,
            opacity: self.opacity,
        })
    }
}

impl OverlayConfig {
    /// The overlay, with test patterns in the views of these names; a fault names the key below `overlay`.
    pub(super) fn overlay(&self, test_patterns: Vec<String>) -> Result<Overlay, Fault> {
        fn all<T, U>(list: Lists, from: &[T], make: impl Fn(&T) -> Result<U, Fault>) -> Result<Vec<U>, Fault> {
            let make = |(index, one): (usize, &T)| {
                make(one).map_err(|fault| fault.within(&format!("{}[{index}]", list.key())))
            };
            from.iter().enumerate().map(make).collect()
        }
        let overlay = Overlay {
            grids: all(Lists::Grids, &self.grids, GridConfig::grid)?,
            trajectories: all(Lists::Trajectories, &self.trajectories, TrajectoryConfig::trajectory)?,
            labels: all(Lists::Labels, &self.labels, LabelConfig::label)?,
            test_patterns,
        };
        overlay.check().map_err(|wrong| {
            let fault = Fault::new(wrong.error.key, wrong.error.problem);
            fault.within(&format!("{}[{}]", wrong.list.key(), wrong.index))
        })?;
        Ok(overlay)
    }
}

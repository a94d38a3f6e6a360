//! Overlays: lines and text drawn over display images; they do not add light.
//!
//! Plain data. Colours are display codes (sRGB); widths and sizes are in pixels of the image, independent of the
//! projection.

mod check;
mod font;
mod picture;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::{
    check::{
        LONGEST_TEXT, Lists, MOST_DIVISIONS, MOST_GRIDS, MOST_LABELS, MOST_PICTURES, MOST_POINTS, MOST_TRAJECTORIES,
        OverlayError, PICTURE_WIDTHS_DEG, SIZES_PX, WIDTHS_PX,
    },
    font::{font, missing_character},
    picture::{Level, MOST_PICTURE_TEXELS, Picture, PictureLevels},
};

/// A display colour: sRGB codes of red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub [u8; 3]);

impl Colour {
    /// Parses `#rrggbb`; the error states the valid form.
    pub fn from_hex(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}`: must be a colour as `#rrggbb`, with two hexadecimal digits for each channel");
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6).ok_or_else(wrong)?;
        if !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        let number = u32::from_str_radix(digits, 16).map_err(|_| wrong())?;
        let [_, red, green, blue] = number.to_be_bytes();
        Ok(Self([red, green, blue]))
    }

    /// The colour as `#rrggbb`.
    pub fn to_hex(self) -> String {
        let [red, green, blue] = self.0;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

/// Style of lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineStyle {
    /// Their colour.
    pub colour: Colour,
    /// Their width, pixels.
    pub width_px: f64,
    /// Fraction of the background that a line replaces, 0 to 1, in linear light.
    pub opacity: f64,
}

/// Coordinate system of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GridKind {
    /// Right ascension and declination (ICRS).
    Equatorial,
    /// Galactic longitude and latitude.
    Galactic,
    /// Longitude and latitude of the mean ecliptic and equinox of J2000.0.
    Ecliptic,
    /// Azimuth, from north through east, and altitude of the scene's observer, which must exist.
    Horizon,
    /// Borders of the constellations, along meridians and parallels of B1875.0, with their names instead of numbers; it
    /// has no spacing.
    Constellations,
    /// Azimuth and altitude in the camera's own axes: the zenith is its +y, azimuth 0 its -z, increasing to the right.
    Altitude,
}

named!(GridKind {
    Equatorial = "equatorial",
    Galactic = "galactic",
    Ecliptic = "ecliptic",
    Horizon = "horizon",
    Constellations = "constellations",
    Altitude = "altitude",
});

/// Circles of longitude and latitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Coordinate system.
    pub kind: GridKind,
    /// Number of intervals between the equator and a pole: circles are 90 degrees divided by this apart.
    pub divisions: u32,
    /// Whether the circles are labelled with numbers.
    pub numbers: bool,
    /// Style of its lines.
    pub style: LineStyle,
}

impl Grid {
    /// Default line style.
    pub const STYLE: LineStyle = LineStyle { colour: Colour([79, 127, 191]), width_px: 1.5, opacity: 0.7 };
    /// Default angle between neighbouring circles, degrees.
    pub const SPACING_DEG: f64 = 15.0;

    /// Refuses a spacing for a kind that has none.
    ///
    /// # Errors
    ///
    /// The kind is [`GridKind::Constellations`], and the spacing is not [`Grid::SPACING_DEG`].
    pub fn check_spacing(kind: GridKind, spacing_deg: f64) -> Result<(), String> {
        if kind == GridKind::Constellations && spacing_deg != Self::SPACING_DEG {
            return Err(format!("{spacing_deg}: borders of constellations have no spacing; omit the key"));
        }
        Ok(())
    }

    /// Number of intervals between the equator and a pole for circles that are `spacing_deg` apart; the error states
    /// the valid values.
    pub fn divisions_from_spacing_deg(spacing_deg: f64) -> Result<u32, String> {
        let divisions = (90.0 / spacing_deg).round();
        let allowed = (90.0 / f64::from(MOST_DIVISIONS)..=90.0).contains(&spacing_deg);
        if allowed && (divisions * spacing_deg - 90.0).abs() <= 1e-6 {
            return Ok(divisions as u32);
        }
        let least = 90.0 / f64::from(MOST_DIVISIONS);
        Err(format!("{spacing_deg}: must be between {least} and 90 degrees and divide 90"))
    }

    /// Angle between neighbouring circles, degrees.
    pub fn spacing_deg(&self) -> f64 {
        90.0 / f64::from(self.divisions)
    }
}

/// A polyline in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Unique among trajectories.
    pub name: String,
    /// Its vertices: ICRS, barycentric, m.
    pub points_m: Vec<DVec3>,
    /// Line style.
    pub style: LineStyle,
}

impl Trajectory {
    /// Default line style.
    pub const STYLE: LineStyle = LineStyle { colour: Colour([255, 176, 64]), width_px: 2.0, opacity: 1.0 };
}

/// Position of a label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anchor {
    /// A direction of the sky: a unit vector, ICRS.
    Direction(DVec3),
    /// A point: ICRS, barycentric, m.
    Point(DVec3),
    /// A direction of the scene's observer, who must exist: azimuth from north through east, and apparent altitude, rad.
    Horizon([f64; 2]),
}

/// Text next to a direction or a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Unique among labels.
    pub name: String,
    /// Text: one line.
    pub text: String,
    /// Position.
    pub anchor: Anchor,
    /// Its colour.
    pub colour: Colour,
    /// Height of the font, pixels.
    pub size_px: f64,
    /// Opacity, as for lines.
    pub opacity: f64,
}

impl Label {
    /// Default colour.
    pub const COLOUR: Colour = Colour([224; 3]);
    /// Default height of the font, pixels.
    pub const SIZE_PX: f64 = 16.0;
}

/// Everything drawn over the display images of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlay {
    /// Pictures, drawn first. Only configurations have them.
    pub pictures: Vec<Picture>,
    /// Grids; later ones are drawn over earlier ones.
    pub grids: Vec<Grid>,
    /// Trajectories, drawn over grids.
    pub trajectories: Vec<Trajectory>,
    /// Labels, drawn over lines.
    pub labels: Vec<Label>,
    /// Whether N, NE, E and so on are written above the ground of the scene's observer, who must exist.
    pub cardinal_points: bool,
    /// Names of the views that show a test pattern, drawn over everything.
    pub test_patterns: Vec<String>,
}

impl Overlay {
    /// Whether a part is drawn in the axes of the observer's horizon.
    pub fn shows_horizon(&self) -> bool {
        self.needs_observer().is_some()
    }

    /// Key of the first part that needs an observer.
    fn needs_observer(&self) -> Option<String> {
        let grid = self.grids.iter().position(|grid| grid.kind == GridKind::Horizon);
        let label = self.labels.iter().position(|label| matches!(label.anchor, Anchor::Horizon(_)));
        let cardinal_points = || self.cardinal_points.then(|| "cardinal_points".to_owned());
        let label = || label.map(|index| format!("labels[{index}].azimuth_deg"));
        let picture = self.pictures.iter().position(|picture| matches!(picture.anchor, Anchor::Horizon(_)));
        let picture = || picture.map(|index| format!("pictures[{index}].azimuth_deg"));
        grid.map(|index| format!("grids[{index}].kind")).or_else(label).or_else(picture).or_else(cardinal_points)
    }

    /// Checks that there is an observer if a part needs one.
    ///
    /// # Errors
    ///
    /// A part needs an observer, and `has_observer` is false: its key below `overlay` and the problem.
    pub fn check_observer(&self, has_observer: bool) -> Result<(), (String, String)> {
        let Some(key) = self.needs_observer().filter(|_| !has_observer) else { return Ok(()) };
        let problem = match key.starts_with("grids") {
            true => "horizon: the scene has no observer; use `altitude` for the camera's own axes",
            false => "the scene has no observer, whose horizon this needs: add [scene.observer]",
        };
        Err((key, problem.to_owned()))
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.grids.is_empty()
            && self.trajectories.is_empty()
            && self.labels.is_empty()
            && self.test_patterns.is_empty()
            && !self.cardinal_points
            && self.pictures.is_empty()
    }
}

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

/// A display colour: sRGB codes of red, green and blue. Its text is `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
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

    /// Formats the colour as `#rrggbb`.
    pub fn to_hex(self) -> String {
        let [red, green, blue] = self.0;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

impl TryFrom<String> for Colour {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Self::from_hex(&text)
    }
}

impl From<Colour> for String {
    fn from(colour: Colour) -> Self {
        colour.to_hex()
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
    /// Azimuth (from north through east) and altitude for the scene's observer. The scene must have an observer.
    Horizon,
    /// Borders of the constellations, which run along meridians and parallels of B1875.0. The names of the constellations replace the numbers. This
    /// grid has no spacing.
    Constellations,
    /// Azimuth and altitude in the camera's own axes: the zenith is +y, and azimuth 0 is -z and increases to the right.
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Coordinate system of the circles.
    pub kind: GridKind,
    /// Angle between neighbouring circles; it must divide 90 degrees.
    #[serde(default = "grid_spacing_deg")]
    #[schemars(range(min = 1.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub spacing_deg: f64,
    /// Whether the circles are numbered.
    #[serde(default = "yes")]
    pub numbers: bool,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "grid_colour")]
    #[schemars(with = "String")]
    pub colour: Colour,
    /// Width of the lines.
    #[serde(default = "grid_width_px")]
    #[schemars(range(min = WIDTHS_PX[0], max = WIDTHS_PX[1]), extend("x-unit" = "pixels"))]
    pub width_px: f64,
    /// Share of the background that it replaces, in linear light.
    #[serde(default = "grid_opacity")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

fn grid_spacing_deg() -> f64 {
    Grid::SPACING_DEG
}

fn yes() -> bool {
    true
}

fn grid_colour() -> Colour {
    Grid::STYLE.colour
}

fn grid_width_px() -> f64 {
    Grid::STYLE.width_px
}

fn grid_opacity() -> f64 {
    Grid::STYLE.opacity
}

impl Grid {
    /// Default line style.
    pub const STYLE: LineStyle = LineStyle { colour: Colour([79, 127, 191]), width_px: 1.5, opacity: 0.7 };
    /// Default angle between neighbouring circles, degrees.
    pub const SPACING_DEG: f64 = 15.0;

    /// Creates a grid with numbers and the given number of intervals between the equator and a pole.
    pub fn new(kind: GridKind, divisions: u32, style: LineStyle) -> Self {
        let LineStyle { colour, width_px, opacity } = style;
        Self { kind, spacing_deg: 90.0 / f64::from(divisions), numbers: true, colour, width_px, opacity }
    }

    /// Number of intervals between the equator and a pole.
    pub fn divisions(&self) -> u32 {
        (90.0 / self.spacing_deg).round() as u32
    }

    /// Style of its lines.
    pub fn style(&self) -> LineStyle {
        LineStyle { colour: self.colour, width_px: self.width_px, opacity: self.opacity }
    }
}

/// A polyline in space.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trajectory {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Corners, ICRS, barycentric, at least 2.
    #[serde(with = "points")]
    #[schemars(with = "Vec<[f64; 3]>")]
    pub points_m: Vec<DVec3>,
    /// Colour, `#rrggbb` in sRGB codes.
    #[serde(default = "trajectory_colour")]
    #[schemars(with = "String")]
    pub colour: Colour,
    /// Width of the line.
    #[serde(default = "trajectory_width_px")]
    #[schemars(range(min = WIDTHS_PX[0], max = WIDTHS_PX[1]), extend("x-unit" = "pixels"))]
    pub width_px: f64,
    /// Share of the background that it replaces, in linear light.
    #[serde(default = "trajectory_opacity")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity: f64,
}

fn trajectory_colour() -> Colour {
    Trajectory::STYLE.colour
}

fn trajectory_width_px() -> f64 {
    Trajectory::STYLE.width_px
}

fn trajectory_opacity() -> f64 {
    Trajectory::STYLE.opacity
}

/// Points as lists of three numbers.
mod points {
    use glam::DVec3;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(points: &[DVec3], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(points.iter().map(DVec3::to_array))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<DVec3>, D::Error> {
        Ok(Vec::<[f64; 3]>::deserialize(deserializer)?.into_iter().map(DVec3::from_array).collect())
    }
}

impl Trajectory {
    /// Default line style.
    pub const STYLE: LineStyle = LineStyle { colour: Colour([255, 176, 64]), width_px: 2.0, opacity: 1.0 };

    /// A polyline through points, ICRS, barycentric, m.
    pub fn new(name: impl Into<String>, points_m: Vec<DVec3>, style: LineStyle) -> Self {
        let LineStyle { colour, width_px, opacity } = style;
        Self { name: name.into(), points_m, colour, width_px, opacity }
    }

    /// Style of the line.
    pub fn style(&self) -> LineStyle {
        LineStyle { colour: self.colour, width_px: self.width_px, opacity: self.opacity }
    }
}

/// Position of a label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anchor {
    /// A direction of the sky: a unit vector, ICRS.
    Direction(DVec3),
    /// A point: ICRS, barycentric, m.
    Point(DVec3),
    /// A direction as seen by the scene's observer: azimuth from north through east, and apparent altitude, rad. An observer is required.
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
    /// Pictures, drawn first.
    pub pictures: Vec<Picture>,
    /// Grids; later ones are drawn over earlier ones.
    pub grids: Vec<Grid>,
    /// Trajectories, drawn over grids.
    pub trajectories: Vec<Trajectory>,
    /// Labels, drawn over lines.
    pub labels: Vec<Label>,
    /// Whether N, NE, E and so on are written above the ground of the scene's observer. An observer is required.
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
    /// A part needs an observer, and `has_observer` is false. The error has the part's key below `overlay` and the problem.
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

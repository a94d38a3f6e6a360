//! Limits of overlays, shared by configurations and clients.

use glam::DVec3;

use super::{
    Anchor, Grid, GridKind, Label, LineStyle, MOST_PICTURE_TEXELS, Overlay, Picture, Trajectory, missing_character,
};
use crate::ranges::KeyError;
use crate::scene::bodies::{check_names, check_position};

/// Maximum number of grids.
pub const MOST_GRIDS: usize = 8;
/// Maximum number of intervals of a grid between the equator and a pole: circles 1 degree apart.
pub const MOST_DIVISIONS: u32 = 90;
/// Maximum number of trajectories.
pub const MOST_TRAJECTORIES: usize = 256;
/// Maximum number of points of all trajectories together.
pub const MOST_POINTS: usize = 32_768;
/// Maximum number of labels.
pub const MOST_LABELS: usize = 1024;
/// Longest text of a label, characters.
pub const LONGEST_TEXT: usize = 64;
/// Narrowest and widest line, pixels. Below one pixel, coverage no longer represents the width.
pub const WIDTHS_PX: [f64; 2] = [1.0, 32.0];
/// Smallest and largest font, pixels.
pub const SIZES_PX: [f64; 2] = [6.0, 200.0];

/// Maximum number of pictures.
pub const MOST_PICTURES: usize = 16;
/// Least and greatest width of a picture, degrees: a plane cannot show half of the sky.
pub const PICTURE_WIDTHS_DEG: [f64; 2] = [0.01, 150.0];

/// The lists of an overlay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lists {
    /// Grids.
    Grids,
    /// Trajectories.
    Trajectories,
    /// Labels.
    Labels,
    /// Pictures.
    Pictures,
}

impl Lists {
    /// Key in configurations.
    pub fn key(self) -> &'static str {
        match self {
            Self::Grids => "grids",
            Self::Trajectories => "trajectories",
            Self::Labels => "labels",
            Self::Pictures => "pictures",
        }
    }
}

/// Error of an overlay.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("overlay.{}[{index}].{error}", list.key())]
pub struct OverlayError {
    /// The list.
    pub list: Lists,
    /// Index in the list.
    pub index: usize,
    /// The invalid part, the problem, and the valid values.
    pub error: KeyError,
}

fn between(key: &'static str, value: f64, [least, most]: [f64; 2], unit: &str) -> Result<(), KeyError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(KeyError::new(key, format!("{value}: must be between {least} and {most}{unit}")))
}

/// Checks an angle in radians against a range in degrees, with a margin for the rounding of the conversion.
fn angle_between(key: &'static str, angle_rad: f64, range_deg: [f64; 2]) -> Result<(), KeyError> {
    let degrees = angle_rad.to_degrees();
    let nearest = degrees.clamp(range_deg[0], range_deg[1]);
    let rounded = if (degrees - nearest).abs() <= 1e-12 * nearest.abs() { nearest } else { degrees };
    between(key, rounded, range_deg, " degrees")
}

impl LineStyle {
    /// Checks its ranges.
    pub fn check(&self) -> Result<(), KeyError> {
        between("width_px", self.width_px, WIDTHS_PX, " pixels")?;
        between("opacity", self.opacity, [0.0, 1.0], "")
    }
}

impl Grid {
    /// Checks its ranges.
    pub fn check(&self) -> Result<(), KeyError> {
        let (spacing_deg, least_deg) = (self.spacing_deg, 90.0 / f64::from(MOST_DIVISIONS));
        let refused = |problem: String| Err(KeyError::new("spacing_deg", format!("{spacing_deg}: {problem}")));
        if self.kind == GridKind::Constellations && spacing_deg != Self::SPACING_DEG {
            return refused("borders of constellations have no spacing; omit the key".to_owned());
        }
        let divides = (f64::from(self.divisions()) * spacing_deg - 90.0).abs() <= 1e-6;
        if !((least_deg..=90.0).contains(&spacing_deg) && divides) {
            return refused(format!("must be between {least_deg} and 90 degrees and divide 90"));
        }
        self.style().check()
    }
}

impl Trajectory {
    /// Checks the ranges of its values, but not its name and the total number of points.
    pub fn check(&self) -> Result<(), KeyError> {
        if !(2..=MOST_POINTS).contains(&self.points_m.len()) {
            let problem = format!("{} points: must be between 2 and {MOST_POINTS}", self.points_m.len());
            return Err(KeyError::new("points_m", problem));
        }
        for (index, point) in self.points_m.iter().enumerate() {
            check_position(*point)
                .map_err(|error| KeyError::new("points_m", format!("[{index}]: {}", error.problem)))?;
        }
        self.style().check()
    }
}

impl Label {
    /// Checks the ranges of its values, but not its name.
    pub fn check(&self) -> Result<(), KeyError> {
        if !(1..=LONGEST_TEXT).contains(&self.text.chars().count()) {
            let problem = format!("{} characters: must be between 1 and {LONGEST_TEXT}", self.text.chars().count());
            return Err(KeyError::new("text", problem));
        }
        if let Some(character) = missing_character(&self.text) {
            let problem =
                format!("{:?}: the font has no {character:?}; must be one line of characters of the font", self.text);
            return Err(KeyError::new("text", problem));
        }
        self.anchor.check()?;
        between("size_px", self.size_px, SIZES_PX, " pixels")?;
        between("opacity", self.opacity, [0.0, 1.0], "")
    }

    /// Returns the direction of a vector of any nonzero length; the error states the valid values.
    pub fn direction(vector: DVec3) -> Result<Anchor, KeyError> {
        let length = vector.length();
        if !vector.is_finite() || !(1e-100..=1e100).contains(&length) {
            let problem = format!("{:?}: must be a nonzero vector of finite numbers", vector.to_array());
            return Err(KeyError::new("direction", problem));
        }
        Ok(Anchor::Direction(vector / length))
    }
}

impl Picture {
    /// Checks the ranges of its values, but not its name and the total number of texels.
    pub fn check(&self) -> Result<(), KeyError> {
        angle_between("width_deg", self.width_rad, PICTURE_WIDTHS_DEG)?;
        if !self.roll_rad.is_finite() {
            return Err(KeyError::new("roll_deg", format!("{}: must be finite", self.roll_rad.to_degrees())));
        }
        between("opacity", self.opacity, [0.0, 1.0], "")?;
        self.anchor.check()
    }
}

impl Anchor {
    /// Checks its ranges.
    pub fn check(&self) -> Result<(), KeyError> {
        match *self {
            Self::Point(point) => check_position(point),
            Self::Horizon([azimuth_rad, altitude_rad]) => {
                angle_between("azimuth_deg", azimuth_rad, [-360.0, 360.0])?;
                angle_between("altitude_deg", altitude_rad, [-90.0, 90.0])
            }
            Self::Direction(direction) => {
                if direction.is_finite() && (direction.length() - 1.0).abs() < 1e-6 {
                    return Ok(());
                }
                Err(KeyError::new("direction", format!("{:?}: must be a unit vector", direction.to_array())))
            }
        }
    }
}

impl Overlay {
    /// Checks everything except whether the views of test patterns exist: only the rig knows the views.
    ///
    /// # Errors
    ///
    /// A part is out of range, or there are too many; the error names it and the valid values.
    pub fn check(&self) -> Result<(), OverlayError> {
        let in_list = |list: Lists| move |(index, error)| OverlayError { list, index, error };
        for (index, grid) in self.grids.iter().enumerate() {
            if index >= MOST_GRIDS {
                let error = KeyError::new("kind", format!("one grid too many: must be at most {MOST_GRIDS}"));
                return Err(OverlayError { list: Lists::Grids, index, error });
            }
            grid.check().map_err(|error| OverlayError { list: Lists::Grids, index, error })?;
        }
        check_names(self.trajectories.iter().map(|one| one.name.as_str()), MOST_TRAJECTORIES)
            .map_err(in_list(Lists::Trajectories))?;
        let mut points = 0;
        for (index, trajectory) in self.trajectories.iter().enumerate() {
            points += trajectory.points_m.len();
            let too_many = || {
                let problem =
                    format!("{points} points of all trajectories up to this one: must be at most {MOST_POINTS}");
                Err(KeyError::new("points_m", problem))
            };
            let checked = trajectory.check().and_then(|()| if points > MOST_POINTS { too_many() } else { Ok(()) });
            checked.map_err(|error| OverlayError { list: Lists::Trajectories, index, error })?;
        }
        check_names(self.labels.iter().map(|label| label.name.as_str()), MOST_LABELS)
            .map_err(in_list(Lists::Labels))?;
        for (index, label) in self.labels.iter().enumerate() {
            label.check().map_err(|error| OverlayError { list: Lists::Labels, index, error })?;
        }
        check_names(self.pictures.iter().map(|picture| picture.name.as_str()), MOST_PICTURES)
            .map_err(in_list(Lists::Pictures))?;
        let mut texels = 0;
        for (index, picture) in self.pictures.iter().enumerate() {
            let [width, height] = picture.levels.size();
            texels += width as usize * height as usize;
            let too_many = || {
                let problem =
                    format!("{texels} texels of all pictures up to this one: must be at most {MOST_PICTURE_TEXELS}");
                Err(KeyError::new("file", problem))
            };
            let checked = picture.check().and_then(|()| if texels > MOST_PICTURE_TEXELS { too_many() } else { Ok(()) });
            checked.map_err(|error| OverlayError { list: Lists::Pictures, index, error })?;
        }
        Ok(())
    }
}

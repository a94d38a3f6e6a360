//! What an overlay may be, and how much of it. Configurations and clients are refused by the same rules.

use glam::DVec3;

use super::{Anchor, Grid, Label, LineStyle, Overlay, Trajectory, missing_character};
use crate::scene::bodies::{BodyError, check_names, check_position};

/// Most grids.
pub const MOST_GRIDS: usize = 8;
/// Most spaces of a grid between the equator and a pole: circles 1 degree apart.
pub const MOST_DIVISIONS: u32 = 90;
/// Most trajectories.
pub const MOST_TRAJECTORIES: usize = 256;
/// Most points of all trajectories together.
pub const MOST_POINTS: usize = 32_768;
/// Most labels.
pub const MOST_LABELS: usize = 1024;
/// Longest text of a label, characters.
pub const LONGEST_TEXT: usize = 64;
/// Narrowest and widest line, pixels. Narrower than a pixel, coverage would no longer tell the width.
pub const WIDTHS_PX: [f64; 2] = [1.0, 32.0];
/// Smallest and largest font, pixels.
pub const SIZES_PX: [f64; 2] = [6.0, 200.0];

/// The lists of an overlay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lists {
    /// Grids.
    Grids,
    /// Trajectories.
    Trajectories,
    /// Labels.
    Labels,
}

impl Lists {
    /// Its key in configurations.
    pub fn key(self) -> &'static str {
        match self {
            Self::Grids => "grids",
            Self::Trajectories => "trajectories",
            Self::Labels => "labels",
        }
    }
}

/// What is wrong with an overlay.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("overlay.{}[{index}].{error}", list.key())]
pub struct OverlayError {
    /// In which list.
    pub list: Lists,
    /// Which of the list.
    pub index: usize,
    /// The part at fault, what is wrong and what is allowed.
    pub error: BodyError,
}

fn between(key: &'static str, value: f64, [least, most]: [f64; 2], unit: &str) -> Result<(), BodyError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(BodyError::new(key, format!("{value}: allowed are {least} to {most}{unit}")))
}

impl LineStyle {
    /// Checks its ranges.
    pub fn check(&self) -> Result<(), BodyError> {
        between("width_px", self.width_px, WIDTHS_PX, " pixels")?;
        between("opacity", self.opacity, [0.0, 1.0], "")
    }
}

impl Grid {
    /// Checks its ranges.
    pub fn check(&self) -> Result<(), BodyError> {
        if !(1..=MOST_DIVISIONS).contains(&self.divisions) {
            let problem = format!("{} spaces up to the pole: allowed are 1 to {MOST_DIVISIONS}", self.divisions);
            return Err(BodyError::new("spacing_deg", problem));
        }
        self.style.check()
    }
}

impl Trajectory {
    /// Checks its ranges, but neither its name nor the number of points of all trajectories.
    pub fn check(&self) -> Result<(), BodyError> {
        if !(2..=MOST_POINTS).contains(&self.points_m.len()) {
            let problem = format!("{} points: allowed are 2 to {MOST_POINTS}", self.points_m.len());
            return Err(BodyError::new("points_m", problem));
        }
        for (index, point) in self.points_m.iter().enumerate() {
            check_position(*point)
                .map_err(|error| BodyError::new("points_m", format!("[{index}]: {}", error.problem)))?;
        }
        self.style.check()
    }
}

impl Label {
    /// Checks its ranges, but not its name.
    pub fn check(&self) -> Result<(), BodyError> {
        if !(1..=LONGEST_TEXT).contains(&self.text.chars().count()) {
            let problem = format!("{} characters: allowed are 1 to {LONGEST_TEXT}", self.text.chars().count());
            return Err(BodyError::new("text", problem));
        }
        if let Some(character) = missing_character(&self.text) {
            let problem = format!("{:?}: the font has no {character:?}; allowed is one line of what it has", self.text);
            return Err(BodyError::new("text", problem));
        }
        match self.anchor {
            Anchor::Point(point) => check_position(point)?,
            Anchor::Direction(direction) => {
                if !(direction.is_finite() && (direction.length() - 1.0).abs() < 1e-6) {
                    let problem = format!("{:?}: a unit vector is needed", direction.to_array());
                    return Err(BodyError::new("direction", problem));
                }
            }
        }
        between("size_px", self.size_px, SIZES_PX, " pixels")?;
        between("opacity", self.opacity, [0.0, 1.0], "")
    }

    /// A direction from a vector of any length but 0; the error says what is allowed.
    pub fn direction(vector: DVec3) -> Result<Anchor, BodyError> {
        let length = vector.length();
        if !vector.is_finite() || !(1e-100..=1e100).contains(&length) {
            let problem = format!("{:?}: a vector of finite numbers is needed, and not 0", vector.to_array());
            return Err(BodyError::new("direction", problem));
        }
        Ok(Anchor::Direction(vector / length))
    }
}

impl Overlay {
    /// Checks everything but whether the views of test patterns exist, which the rig knows.
    ///
    /// # Errors
    ///
    /// A part is out of range, or there is too much of it; the error says where and what is allowed.
    pub fn check(&self) -> Result<(), OverlayError> {
        let at = |list: Lists| move |(index, error)| OverlayError { list, index, error };
        for (index, grid) in self.grids.iter().enumerate() {
            if index >= MOST_GRIDS {
                let error = BodyError::new("kind", format!("one grid too many: allowed are {MOST_GRIDS}"));
                return Err(OverlayError { list: Lists::Grids, index, error });
            }
            grid.check().map_err(|error| OverlayError { list: Lists::Grids, index, error })?;
        }
        check_names(self.trajectories.iter().map(|one| one.name.as_str()), MOST_TRAJECTORIES)
            .map_err(at(Lists::Trajectories))?;
        let mut points = 0;
        for (index, trajectory) in self.trajectories.iter().enumerate() {
            points += trajectory.points_m.len();
            let enough = || {
                let problem = format!("{points} points of all trajectories up to here: allowed are {MOST_POINTS}");
                Err(BodyError::new("points_m", problem))
            };
            let checked = trajectory.check().and_then(|()| if points > MOST_POINTS { enough() } else { Ok(()) });
            checked.map_err(|error| OverlayError { list: Lists::Trajectories, index, error })?;
        }
        check_names(self.labels.iter().map(|label| label.name.as_str()), MOST_LABELS).map_err(at(Lists::Labels))?;
        for (index, label) in self.labels.iter().enumerate() {
            label.check().map_err(|error| OverlayError { list: Lists::Labels, index, error })?;
        }
        Ok(())
    }
}

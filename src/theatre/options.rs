//! Options of `read`: information that is missing in a file, or that replaces what its format specifies.

use glam::{DMat3, DVec3};

use super::fault::{Fault, shown};

/// Position in the raster of the first row of a grid of samples in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowOrder {
    /// As the format specifies: the bottom row in PFM (Netpbm), the top row in OpenEXR.
    #[default]
    AsFormat,
    /// The top row of the raster.
    TopFirst,
    /// The bottom row of the raster.
    BottomFirst,
}

/// Axes of the points or directions of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Axes {
    /// As the file or the format specifies.
    #[default]
    AsFormat,
    /// Takes a vector of the file to dome axes (+x right, +y up, -z forward): see [`Axes::parse`].
    Map(DMat3),
}

impl Axes {
    /// Parses an explicit map such as `x=x,y=z,z=-y`: each axis of the dome is an axis of the file or its opposite,
    /// each used once. A map may mirror.
    ///
    /// # Errors
    ///
    /// The problem, and the valid form.
    pub fn parse(text: &str) -> Result<Self, String> {
        let bad = |problem: &str| {
            Err(format!(
                "axes `{text}`: {problem}; must be three entries such as `x=x,y=z,z=-y`, every axis once on each side"
            ))
        };
        let index = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
        // Each row has the file's axis for an axis of the dome.
        let mut rows: [Option<DVec3>; 3] = [None; 3];
        let mut used = [false; 3];
        for entry in text.split(',') {
            let Some((dome, file)) = entry.split_once('=') else {
                return bad("an entry has no `=`");
            };
            let file = file.trim();
            let (sign, name) = match file.strip_prefix('-') {
                Some(name) => (-1.0, name),
                None => (1.0, file.strip_prefix('+').unwrap_or(file)),
            };
            let (Some(to), Some(from)) = (index(dome.trim()), index(name)) else {
                return bad("an axis is not x, y or z");
            };
            if rows[to].is_some() || used[from] {
                return bad("an axis occurs twice");
            }
            used[from] = true;
            rows[to] = Some(DVec3::AXES[from] * sign);
        }
        let [Some(x), Some(y), Some(z)] = rows else {
            return bad("an axis is missing");
        };
        Ok(Self::Map(DMat3::from_cols(x, y, z).transpose()))
    }

    /// Rotation from the axes of the file to dome axes; the identity unless there is a map.
    pub(super) fn dome_from_file(&self) -> DMat3 {
        match self {
            Self::AsFormat => DMat3::IDENTITY,
            Self::Map(matrix) => *matrix,
        }
    }

    /// Description for notes.
    pub(super) fn describe(&self, format_axes: &str) -> String {
        match self {
            Self::AsFormat => format!("{format_axes}, as the format specifies"),
            Self::Map(matrix) => format!("{}, from the options", map_text(matrix)),
        }
    }
}

/// Formats a map of axes for [`Axes::parse`].
fn map_text(matrix: &DMat3) -> String {
    let row = |i: usize| {
        let row = matrix.row(i);
        let part = |k: usize| match row[k] {
            0.0 => None,
            1.0 => Some(["x", "y", "z"][k].to_owned()),
            -1.0 => Some(["-x", "-y", "-z"][k].to_owned()),
            value => Some(format!("{value} {}", ["x", "y", "z"][k])),
        };
        (0..3).filter_map(part).collect::<Vec<_>>().join(" + ")
    };
    format!("x={},y={},z={}", row(0), row(1), row(2))
}

/// The options on which the directions of a region depend. An option on which no region depends is refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uses {
    /// [`ReadOptions::rows`]: the region has a picture of samples.
    pub rows: bool,
    /// [`ReadOptions::axes`]: the region has points, directions, or a frustum in axes of the file.
    pub axes: bool,
    /// [`ReadOptions::eye_m`]: the region has points or planes in space, and the file has no eye point.
    pub eye: bool,
    /// [`ReadOptions::fov_deg`] and [`ReadOptions::tilt_deg`]: the picture of the region is a fisheye that the file does not describe.
    pub fisheye: bool,
}

/// Information that the caller provides for a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Name of the region to read; `None` for all regions.
    pub region: Option<String>,
    /// Width and height of the raster, pixels, if the file has none. If the file has one, they must agree; for a
    /// picture of directions this replaces the picture's own size.
    pub size_px: Option<[u32; 2]>,
    /// The order of rows.
    pub rows: RowOrder,
    /// The axes of points and directions.
    pub axes: Axes,
    /// The eye point, m, in dome axes, relative to the origin of the file's points (and of its frame, if it specifies
    /// one).
    pub eye_m: DVec3,
    /// Field of view of a fisheye content that a mesh refers to, degrees.
    pub fov_deg: f64,
    /// Tilt of the apex of that fisheye to the front, degrees.
    pub tilt_deg: f64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            region: None,
            size_px: None,
            rows: RowOrder::AsFormat,
            axes: Axes::AsFormat,
            eye_m: DVec3::ZERO,
            fov_deg: 180.0,
            tilt_deg: 0.0,
        }
    }
}

/// An option without effect: its key and value, the reason, and what to do.
type Idle = (String, &'static str, &'static str);

impl ReadOptions {
    /// Returns the first given option on which no region depends. `is_used` returns whether any region depends on an option.
    pub(super) fn idle(&self, is_used: impl Fn(fn(&Uses) -> bool) -> bool) -> Option<Idle> {
        const OPEN_FISHEYE: &str = "do not come from a fisheye whose field of view and tilt are missing in the file";
        const TILT: &str = "omit it; to tilt a dome of projectors, use the orientation of the views, which `projectors import --dome-tilt-deg` writes";
        let standard = Self::default();
        let has_fisheye = is_used(|uses| uses.fisheye);
        if !has_fisheye && self.fov_deg != standard.fov_deg {
            return Some((format!("fov_deg = {}", self.fov_deg), OPEN_FISHEYE, TILT));
        }
        if !has_fisheye && self.tilt_deg != standard.tilt_deg {
            return Some((format!("tilt_deg = {}", self.tilt_deg), OPEN_FISHEYE, TILT));
        }
        if self.rows != standard.rows && !is_used(|uses| uses.rows) {
            let order = if self.rows == RowOrder::TopFirst { "top_first" } else { "bottom_first" };
            let reason = "do not come from rows of samples";
            return Some((
                format!("rows = {order}"),
                reason,
                "omit it; it is for PFM (including PFM in MPCDI) and OpenEXR",
            ));
        }
        if let Axes::Map(matrix) = &self.axes
            && !is_used(|uses| uses.axes)
        {
            let reason = "are in axes that the format defines";
            let allowed = "omit it; it is for MPCDI, and for directions as PFM or OpenEXR";
            return Some((format!("axes = {}", map_text(matrix)), reason, allowed));
        }
        if self.eye_m != standard.eye_m && !is_used(|uses| uses.eye) {
            let reason = "do not depend on the place of the eye";
            let allowed = "omit it; it is for MPCDI of the profiles a3 and sl, and for planes of SGCT";
            return Some((format!("eye_m = {}", shown(self.eye_m.to_array())), reason, allowed));
        }
        None
    }

    /// Checks the ranges of the options.
    pub(super) fn check(&self) -> Result<(), Fault> {
        let place = "options";
        if !(self.fov_deg > 0.0 && self.fov_deg <= 360.0) {
            return Err(Fault::new(
                place,
                format!("fov_deg = {}", self.fov_deg),
                "must be more than 0 and at most 360",
            ));
        }
        if self.tilt_deg.is_nan() || self.tilt_deg.abs() > 180.0 {
            return Err(Fault::new(place, format!("tilt_deg = {}", self.tilt_deg), "must be between -180 and 180"));
        }
        if !(self.eye_m.abs().max_element() <= 1e6 && self.eye_m.is_finite()) {
            return Err(Fault::new(place, format!("eye_m = {}", self.eye_m), "must be at most 1e6 m along each axis"));
        }
        if let Axes::Map(matrix) = &self.axes
            && !(matrix.is_finite() && (*matrix * matrix.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6))
        {
            return Err(Fault::new(place, "axes: not orthonormal", "must be three orthogonal axes of length 1"));
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn a_map_of_axes_takes_vectors_of_the_file_to_the_dome() {
        let axes = Axes::parse("x=-y, y=z, z=-x").unwrap();
        assert_eq!(axes.dome_from_file() * DVec3::new(1.0, 2.0, 3.0), DVec3::new(-2.0, 3.0, -1.0));
        assert_eq!(axes.describe(""), "x=-y,y=z,z=-x, from the options");
        for wrong in ["", "x=x", "x=x,y=y,z=y", "x=x,x=y,z=z", "x=x,y=y,z=w", "x=x,y=y,z=--z", "x=x,y=y,z=z,x=x"] {
            assert!(Axes::parse(wrong).unwrap_err().contains("must be three entries"), "{wrong}");
        }
    }
}

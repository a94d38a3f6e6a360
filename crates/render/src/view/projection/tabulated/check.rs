//! Compares a table with its mapping.

use glam::{DVec2, DVec3};

use super::{
    super::{PlaneMapping, pixel_centre},
    bake::{INVERSE_PX, derivatives, is_within, singular_values},
    error::TabulationError,
    nodes::{Nodes, place_of_pixel},
    pole::is_sliver,
    rows::by_rows,
};

/// Largest allowed distance between the image of a direction in the mapping and in the table, pixels.
pub const LIMIT_PX: f64 = 0.01;
/// The same limit at kinks, where the mapping has no derivative.
const KINK_LIMIT_PX: f64 = 0.25;
/// The same limit at the edges of a mapping of flat facets. The table rounds these edges, with an error of a sixteenth of the change of slope.
const FACET_LIMIT_PX: f64 = 1.0;
/// The same limit in slivers, in units of their longer side. Along the shorter side, pixels are finer than needed.
const SLIVER_LIMIT: f64 = 0.1;
/// Criterion for a kink: distance of a direction from the mean of the directions one pixel away on both sides, pixels.
const KINK_PX: f64 = 0.05;
/// Points with a larger error are refined with patches if there are not too many of them, so that the errors of points between the tested ones are
/// also within [`LIMIT_PX`], pixels.
const REFINED_PX: f64 = LIMIT_PX / 4.0;
/// Maximum number of points to refine: a fraction of the pixels, or the absolute number if that is larger.
const MOST_OFF: (f64, usize) = (0.01, 2048);

/// Accuracy of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TableAccuracy {
    /// Greatest distance between the mapping and the table where the mapping is smooth, pixels.
    pub smooth_px: f64,
    /// The same distance at kinks and in slivers of pixels, pixels; 0 if there are none. In a sliver, the error of the direction is at most a tenth
    /// of the longer side.
    pub kink_px: f64,
}

/// A point where the table differs from the mapping.
pub(super) struct Off {
    pub(super) pixel: DVec2,
    pub(super) direction: DVec3,
    pub(super) off_px: f64,
    /// Whether the pixel is a sliver whose longer side is much longer than the error.
    in_sliver: bool,
}

/// Result of a comparison.
pub(super) struct Found {
    smooth_px: f64,
    /// Points with an error of more than [`REFINED_PX`].
    off: Vec<Off>,
    /// A pixel next to which the table interpolates across a tear.
    torn: Option<[u32; 2]>,
}

/// Four test points of a pixel: its centre, a corner, and two points that vary from pixel to pixel (multiples of the
/// golden ratio and of the square root of 2).
fn points_of(x: u32, y: u32) -> [DVec2; 4] {
    let corner = DVec2::new(f64::from(x), f64::from(y));
    let number = corner.x + 1021.0 * corner.y;
    let other =
        |step: f64| corner + DVec2::new(number * 0.618_033_988_75 + step, number * 0.414_213_562_37 + step).fract();
    [pixel_centre(x, y), corner, other(0.0), other(0.37)]
}

/// Shortest distance between neighbours of four nodes, row by row.
fn shortest_side([a, b, c, d]: [DVec3; 4]) -> f64 {
    a.distance(b).min(c.distance(d)).min(a.distance(c)).min(b.distance(d))
}

/// Compares the results of `lookup` with the mapping, at four points of every pixel.
pub(super) fn compare(
    source: &(dyn PlaneMapping + Send),
    nodes: &Nodes,
    lookup: impl Fn(DVec3) -> Option<DVec2> + Sync,
) -> Found {
    let [width, height] = nodes.size;
    let compare_point = |pixel: DVec2| {
        let direction = source.direction_from_pixel(pixel)?.try_normalize()?;
        nodes.quad(place_of_pixel(pixel))?;
        let found = lookup(direction);
        let off_px = found.map_or(f64::INFINITY, |found| found.distance(pixel));
        // A corner on a cut may be on either side of it. The inverse takes long, so it is computed only where the table differs.
        if !is_within(off_px, REFINED_PX)
            && !is_within(source.pixel_from_direction(direction)?.distance(pixel), INVERSE_PX)
        {
            return None;
        }
        let in_sliver = off_px > REFINED_PX
            && found.is_some_and(|found| {
                // The table continues beyond the end of the mapping.
                let shown = source.direction_from_pixel(found).or_else(|| nodes.between(place_of_pixel(found)));
                is_in_sliver(source, pixel, shown.map_or(f64::NAN, |shown| shown.distance(direction)))
            });
        Some(Off { pixel, direction, off_px, in_sliver })
    };
    let is_torn = |point: &Off| {
        let place = place_of_pixel(point.pixel);
        let between = nodes.between(place).and_then(DVec3::try_normalize);
        let (Some(between), Some(quad)) = (between, nodes.quad(place)) else { return false };
        let off_rad = between.distance(point.direction);
        // At nearly all points the error is a small part of a pixel, so the size of the pixel need not be computed.
        if off_rad <= 0.25 * shortest_side(quad) {
            return false;
        }
        derivatives(source, point.pixel)
            .is_some_and(|[along_x, along_y]| off_rad > singular_values(along_x, along_y)[0])
    };
    let compare_row = |y: u32| {
        let mut row = Found { smooth_px: 0.0, off: Vec::new(), torn: None };
        let points = (0..width).filter(|x| nodes.contains(*x, y)).flat_map(|x| points_of(x, y));
        for point in points.filter_map(compare_point) {
            if row.torn.is_none() && is_torn(&point) {
                row.torn = Some(point.place());
            }
            if point.off_px <= REFINED_PX {
                row.smooth_px = row.smooth_px.max(point.off_px);
            } else {
                row.off.push(point);
            }
        }
        row
    };
    let nothing = Found { smooth_px: 0.0, off: Vec::new(), torn: None };
    by_rows(height, compare_row).into_iter().fold(nothing, |mut all, row| {
        all.smooth_px = all.smooth_px.max(row.smooth_px);
        all.off.extend(row.off);
        all.torn = all.torn.or(row.torn);
        all
    })
}

/// Whether a pixel is a sliver, as around the antipode of a fisheye of 360 degrees, and an error of its direction is at
/// most [`SLIVER_LIMIT`] of its longer side.
fn is_in_sliver(source: &dyn PlaneMapping, pixel: DVec2, off_rad: f64) -> bool {
    let sides = derivatives(source, pixel).map(|[along_x, along_y]| singular_values(along_x, along_y));
    sides.is_some_and(|sides| is_sliver(sides) && is_within(off_rad, SLIVER_LIMIT * sides[0]))
}

impl Off {
    /// Whether the error exceeds the limit; NaN does.
    fn is_beyond(&self, limit_px: f64) -> bool {
        !is_within(self.off_px, limit_px)
    }

    /// Whether every table of such a mapping has an error like this one, because the point is in a sliver or at an edge of flat facets.
    fn is_allowed(&self, source: &dyn PlaneMapping) -> bool {
        self.in_sliver || (source.is_faceted() && !self.is_beyond(FACET_LIMIT_PX))
    }

    /// The pixel that contains the point.
    fn place(&self) -> [u32; 2] {
        [self.pixel.x as u32, self.pixel.y as u32]
    }

    fn error(&self) -> TabulationError {
        TabulationError::Coarse { pixel: self.place(), off_px: self.off_px, limit_px: LIMIT_PX }
    }
}

impl Found {
    /// Directions to refine in a picture of `pixels` pixels. Fails if there are too many points for them to be kinks. If the mapping consists of
    /// facets, it does not fail: the edges then stay rounded, as in the table.
    pub(super) fn to_refine(&self, source: &dyn PlaneMapping, pixels: u64) -> Result<Vec<DVec3>, TabulationError> {
        if let Some(pixel) = self.torn {
            return Err(TabulationError::Torn { pixel });
        }
        let allowed = ((pixels as f64 * MOST_OFF.0) as usize).max(MOST_OFF.1);
        let limits: &[f64] =
            if source.is_faceted() { &[REFINED_PX, LIMIT_PX, KINK_LIMIT_PX] } else { &[REFINED_PX, LIMIT_PX] };
        for limit_px in limits.iter().copied() {
            let beyond = || self.off.iter().filter(|off| off.is_beyond(limit_px));
            if beyond().count() <= allowed {
                return Ok(beyond().map(|off| off.direction).collect());
            }
        }
        let is_wrong = |off: &&Off| off.is_beyond(LIMIT_PX) && !off.is_allowed(source);
        self.off.iter().find(is_wrong).map_or(Ok(Vec::new()), |off| Err(off.error()))
    }

    /// Returns the accuracy of the table. Fails if the table is wrong where the mapping is smooth, or if its error at a kink is too large.
    pub(super) fn accuracy(&self, source: &dyn PlaneMapping) -> Result<TableAccuracy, TabulationError> {
        let mut accuracy = TableAccuracy { smooth_px: self.smooth_px, kink_px: 0.0 };
        for off in &self.off {
            if !off.is_beyond(LIMIT_PX) {
                accuracy.smooth_px = accuracy.smooth_px.max(off.off_px);
            } else if off.is_allowed(source) || (!off.is_beyond(KINK_LIMIT_PX) && is_kink(source, off.pixel)) {
                accuracy.kink_px = accuracy.kink_px.max(off.off_px);
            } else {
                return Err(off.error());
            }
        }
        Ok(accuracy)
    }
}

/// Whether the mapping has a kink around a point of the picture.
fn is_kink(source: &dyn PlaneMapping, pixel: DVec2) -> bool {
    let Some(middle) = source.direction_from_pixel(pixel) else { return false };
    let Some([along_x, along_y]) = derivatives(source, pixel) else { return true };
    let [_, shorter_rad] = singular_values(along_x, along_y);
    let bent = |step: DVec2| {
        let (ahead, behind) = (source.direction_from_pixel(pixel + step), source.direction_from_pixel(pixel - step));
        let (Some(ahead), Some(behind)) = (ahead, behind) else { return true };
        ((ahead + behind).normalize_or_zero() - middle).length() > KINK_PX * shorter_rad
    };
    [DVec2::X, DVec2::Y, DVec2::ONE, DVec2::new(1.0, -1.0)].into_iter().any(bent)
}

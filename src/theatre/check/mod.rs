//! Checks a set of projectors: whether they cover the dome, whether their shares of light add up to one, and whether
//! one of them is mirrored or collapsed.
//!
//! Directions are sampled evenly over the dome (a Fibonacci lattice); each is looked up in every projector's raster.

mod reflection;
mod rules;
mod sky;
#[cfg(test)]
mod tests;

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

pub use self::reflection::{CrossReflection, GreyedPicture};
use self::{rules::DomeSamples, sky::percentiles};
use super::ScreenSums;
use crate::view::{projection::PlaneMapping, projector::Blend};

/// One projector.
#[derive(Clone, Copy)]
pub struct Projector<'a> {
    /// Name of the view.
    pub name: &'a str,
    /// Directions of its pixels, in view axes.
    pub mapping: &'a dyn PlaneMapping,
    /// Rotation from view axes to dome axes.
    pub dome_from_view: DQuat,
    /// Its share of the light.
    pub blend: Option<&'a Blend>,
    /// Factor that dims its white to that of the darkest projector; 1 if it is not dimmed. Sums of shares are computed
    /// without this factor.
    pub dimmed_to: f64,
    /// The points of the screen in view axes, if the calibration has some.
    pub screen: Option<&'a ScreenSums>,
}

/// The part of a sphere that the screen covers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Dome {
    /// Angle across, degrees.
    pub fov_deg: f64,
    /// Tilt of its axis from +y towards -z, degrees.
    pub tilt_deg: f64,
}

impl Dome {
    fn axis(self) -> DVec3 {
        DQuat::from_rotation_x(-self.tilt_deg.to_radians()) * DVec3::Y
    }
}

/// A rule with its result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the rule.
    pub rule: &'static str,
    /// The projector; `None` if the rule is about all projectors together.
    pub projector: Option<String>,
    /// Whether the rule is satisfied.
    pub passed: bool,
    /// The result, and the valid values.
    pub what: String,
}

impl Finding {
    /// Returns `pass` or `FAIL`.
    pub fn outcome(&self) -> &'static str {
        if self.passed { "pass" } else { "FAIL" }
    }

    /// The projector, or `all`.
    pub fn subject(&self) -> &str {
        self.projector.as_deref().unwrap_or("all")
    }
}

/// Figures of one projector.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProjectorFigures {
    /// Name of the view.
    pub name: String,
    /// Fraction of the dome that it reaches.
    pub coverage: f64,
    /// Longer side of its pixels, arcminutes: 5th, 50th and 95th percentile.
    pub arcmin_per_pixel: [f64; 3],
}

/// Result of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DomeReport {
    /// The dome.
    pub dome: Dome,
    /// Fractions of the dome that at least one projector lights, and that at least two projectors light.
    pub coverage: [f64; 2],
    /// Centre of the widest gap, as azimuth from the front to the right and elevation, and its radius, degrees; `None`
    /// without a gap.
    pub widest_gap_deg: Option<[f64; 3]>,
    /// Sum of the shares of light over the lit directions: 1st, 50th and 99th percentile.
    pub blend_sum: [f64; 3],
    /// Figures of each projector.
    pub projectors: Vec<ProjectorFigures>,
    /// All rules.
    pub findings: Vec<Finding>,
    /// The effect of the light that the screen reflects back onto itself, if its reflectivity is known.
    pub cross_reflection: Option<CrossReflection>,
    /// Map with the results at each point of the dome.
    #[serde(skip)]
    pub map: DomeMap,
}

/// Map of the dome as a domemaster, row by row from the top, with the front at the bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct DomeMap {
    /// Number of points per row, and number of rows.
    pub side: usize,
    /// The points; `None` beyond the rim of the dome.
    pub points: Vec<Option<MapPoint>>,
}

/// A point of the dome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Number of projectors that reach it.
    pub projectors: usize,
    /// Sum of their shares of light.
    pub sum: f64,
    /// Longer side of the finest of their pixels there, arcminutes.
    pub arcmin: f64,
}

impl DomeReport {
    /// Whether all rules are satisfied.
    pub fn passed(&self) -> bool {
        self.findings.iter().all(|finding| finding.passed)
    }
}

/// Position of a direction in the raster of a projector.
#[derive(Clone, Copy)]
struct Hit {
    pixel: DVec2,
    /// Share of its light, and its black level, as fractions of white.
    share: f64,
    black: f64,
    longer_rad: f64,
}

impl Projector<'_> {
    /// Returns the position of a direction of the dome in the raster of this projector.
    fn hit(&self, direction: DVec3) -> Option<Hit> {
        let direction = self.dome_from_view.inverse() * direction;
        let pixel = self.mapping.pixel_from_direction(direction)?;
        let [width, height] = self.mapping.size();
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(width) && pixel.y < f64::from(height);
        if !inside || !self.mapping.contains(pixel.x as u32, pixel.y as u32) {
            return None;
        }
        let [share, black] = self.blend.map_or([1.0, 0.0], |blend| blend.weights_at(pixel));
        let longer_rad = self.mapping.pixel_extent_rad(direction)?[0];
        Some(Hit { pixel, share: share / self.dimmed_to, black, longer_rad })
    }
}

/// Checks a set of projectors, which must not be empty.
pub fn check(dome: Dome, projectors: &[Projector<'_>]) -> DomeReport {
    let directions = sky::lattice(dome);
    let hits: Vec<Vec<Option<Hit>>> =
        projectors.iter().map(|projector| directions.par_iter().map(|d| projector.hit(*d)).collect()).collect();
    let covers = |direction: usize| hits.iter().filter(|projector_hits| projector_hits[direction].is_some()).count();
    let counts: Vec<usize> = (0..directions.len()).map(covers).collect();
    let share_of =
        |least: usize| counts.iter().filter(|count| **count >= least).count() as f64 / directions.len() as f64;
    let sum = |direction: usize| {
        hits.iter().filter_map(|projector_hits| projector_hits[direction]).map(|hit| hit.share).sum::<f64>()
    };
    let sums: Vec<f64> = (0..directions.len()).filter(|index| counts[*index] > 0).map(sum).collect();
    let figures = |(projector, hits): (&Projector<'_>, &Vec<Option<Hit>>)| {
        let sides: Vec<f64> = hits.iter().flatten().map(|hit| hit.longer_rad.to_degrees() * 60.0).collect();
        let coverage = sides.len() as f64 / directions.len() as f64;
        let arcmin_per_pixel = percentiles(sides, [0.05, 0.5, 0.95]);
        ProjectorFigures { name: projector.name.to_owned(), coverage, arcmin_per_pixel }
    };
    let widest_gap_deg = sky::widest_gap(&directions, &counts);
    let samples = DomeSamples { dome, projectors, directions: &directions, hits: &hits, counts: &counts };
    let mut findings = vec![rules::coverage(&samples, widest_gap_deg)];
    findings.extend(rules::rim(&samples));
    findings.extend(rules::blend(&samples));
    findings.extend(rules::black_level(&samples));
    findings.push(rules::tilt(&samples));
    findings.extend(rules::screen(projectors));
    findings.extend(projectors.iter().zip(&hits).flat_map(|(projector, hits)| rules::for_one(projector, hits)));
    findings.extend(rules::twice(&samples));
    DomeReport {
        dome,
        coverage: [share_of(1), share_of(2)],
        widest_gap_deg,
        blend_sum: percentiles(sums, [0.01, 0.5, 0.99]),
        projectors: projectors.iter().zip(&hits).map(figures).collect(),
        findings,
        cross_reflection: None,
        map: sky::map(dome, projectors),
    }
}

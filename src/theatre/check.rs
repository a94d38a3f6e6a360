//! Judges projectors together: do they cover the dome, do their shares of light add up, is one of them mirrored or collapsed.
//!
//! Directions are sampled evenly over the dome (a Fibonacci lattice); each is looked up in every projector's raster.

use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3};
use serde::Serialize;

use crate::view::{
    Blend,
    projection::{PlaneMapping, pixel_centre},
};

/// Directions over the dome.
const SAMPLES: usize = 20_000;
/// Share of the dome that has to have light.
const LEAST_COVERAGE: f64 = 0.995;
/// How far from 1 shares of light may add up, at 99 of 100 directions.
const MOST_BLEND_ERROR: f64 = 0.02;
/// A picture that spans less is taken for a collapsed one, degrees.
const LEAST_SPAN_DEG: f64 = 2.0;
/// Two projectors that have more in common show the same region.
const MOST_COMMON: f64 = 0.95;
/// How much larger a pixel may be than its neighbour: beyond, the warp has facets.
const MOST_STEP: f64 = 1.02;

/// One projector.
#[derive(Clone, Copy)]
pub struct Projector<'a> {
    /// Name of the view.
    pub name: &'a str,
    /// Where its pixels look, in view axes.
    pub mapping: &'a dyn PlaneMapping,
    /// View axes to those of the dome.
    pub dome_from_view: DQuat,
    /// Its share of the light.
    pub blend: Option<&'a Blend>,
}

/// The part of the sky that is screen.
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

/// One rule and what it has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the rule.
    pub rule: &'static str,
    /// The projector; `None`: all of them together.
    pub projector: Option<String>,
    /// Whether it is kept.
    pub passed: bool,
    /// What was found and what is allowed.
    pub what: String,
}

impl Finding {
    /// `pass` or `FAIL`.
    pub fn outcome(&self) -> &'static str {
        if self.passed { "pass" } else { "FAIL" }
    }

    /// The projector, or `all`.
    pub fn of(&self) -> &str {
        self.projector.as_deref().unwrap_or("all")
    }
}

/// Figures of one projector.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProjectorFigures {
    /// Name of the view.
    pub name: String,
    /// Share of the dome that it reaches.
    pub coverage: f64,
    /// Longer side of its pixels, arcminutes: 5th, 50th and 95th percentile.
    pub arcmin_per_pixel: [f64; 3],
}

/// What a check has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DomeReport {
    /// The dome.
    pub dome: Dome,
    /// Share of it with light of one projector at least, and of two.
    pub coverage: [f64; 2],
    /// Where the middle of the widest gap is, azimuth from the front to the right and elevation, and its radius, degrees; `None`: there is none.
    pub widest_gap_deg: Option<[f64; 3]>,
    /// Sum of the shares of light where there is some: 1st, 50th and 99th percentile.
    pub blend_sum: [f64; 3],
    /// Of each projector.
    pub projectors: Vec<ProjectorFigures>,
    /// All rules.
    pub findings: Vec<Finding>,
    /// Points of the dome for a picture.
    #[serde(skip)]
    pub map: Vec<MapPoint>,
}

/// A point of the dome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Place in a domemaster: -1 to 1, x to the right, y upwards, the front at the bottom.
    pub place: DVec2,
    /// Projectors that reach it.
    pub projectors: usize,
    /// Sum of their shares of light.
    pub sum: f64,
    /// Longer side of the finest pixel there, arcminutes.
    pub arcmin: f64,
}

impl DomeReport {
    /// Whether all rules are kept.
    pub fn passed(&self) -> bool {
        self.findings.iter().all(|finding| finding.passed)
    }
}

/// Where a direction falls on a projector.
#[derive(Clone, Copy)]
struct Hit {
    share: f64,
    longer_rad: f64,
}

/// Judges projectors; there is one at least.
pub fn check(dome: Dome, projectors: &[Projector<'_>]) -> DomeReport {
    let directions = lattice(dome);
    let hits: Vec<Vec<Option<Hit>>> =
        projectors.iter().map(|projector| directions.iter().map(|d| hit(projector, *d)).collect()).collect();
    let covers = |direction: usize| hits.iter().filter(|of| of[direction].is_some()).count();
    let counts: Vec<usize> = (0..directions.len()).map(covers).collect();
    let share_of =
        |least: usize| counts.iter().filter(|count| **count >= least).count() as f64 / directions.len() as f64;
    let sum = |direction: usize| hits.iter().filter_map(|of| of[direction]).map(|hit| hit.share).sum::<f64>();
    let sums: Vec<f64> = (0..directions.len()).filter(|at| counts[*at] > 0).map(sum).collect();
    let figures = |(projector, hits): (&Projector<'_>, &Vec<Option<Hit>>)| {
        let sides: Vec<f64> = hits.iter().flatten().map(|hit| hit.longer_rad.to_degrees() * 60.0).collect();
        let coverage = sides.len() as f64 / directions.len() as f64;
        let arcmin_per_pixel = percentiles(sides, [0.05, 0.5, 0.95]);
        ProjectorFigures { name: projector.name.to_owned(), coverage, arcmin_per_pixel }
    };
    let mut report = DomeReport {
        dome,
        coverage: [share_of(1), share_of(2)],
        widest_gap_deg: widest_gap(&directions, &counts),
        blend_sum: percentiles(sums.clone(), [0.01, 0.5, 0.99]),
        projectors: projectors.iter().zip(&hits).map(figures).collect(),
        findings: Vec::new(),
        map: map(dome, &directions, &hits),
    };
    let together = |rule, passed, what| Finding { rule, projector: None, passed, what };
    let [lit, _] = report.coverage;
    let gap = report.widest_gap_deg.map_or(String::new(), |[azimuth, elevation, radius]| {
        format!("; the widest gap is {radius:.1} degrees around azimuth {azimuth:.0}, elevation {elevation:.0}")
    });
    let what =
        format!("{:.2} % of the dome has light, at least {:.1} % is needed{gap}", 100.0 * lit, 100.0 * LEAST_COVERAGE);
    report.findings.push(together("coverage", lit >= LEAST_COVERAGE, what));
    let off = percentiles(sums.iter().map(|sum| (sum - 1.0).abs()).collect(), [0.99; 3])[0];
    let unblended = projectors.iter().all(|projector| projector.blend.is_none());
    let why = if unblended && off > MOST_BLEND_ERROR { ": no projector has a blend mask" } else { "" };
    let what = format!(
        "shares of light are off 1 by {off:.3} at 99 % of the dome, at most {MOST_BLEND_ERROR} is allowed{why}"
    );
    report.findings.push(together("blend", off <= MOST_BLEND_ERROR, what));
    for (projector, hits) in projectors.iter().zip(&hits) {
        report.findings.extend(of_one(projector, hits));
    }
    for (at, [first, second]) in pairs(projectors.len()).map(|pair| (pair, pair.map(|index| &hits[index]))) {
        let count = |of: &[Option<Hit>]| of.iter().flatten().count();
        let common = first.iter().zip(second).filter(|(a, b)| a.is_some() && b.is_some()).count();
        let share = common as f64 / count(first).min(count(second)).max(1) as f64;
        if share > MOST_COMMON {
            let [first, second] = at.map(|index| projectors[index].name);
            let what = format!("{:.0} % of `{second}` is what `{first}` shows: the same region twice?", 100.0 * share);
            report.findings.push(Finding { rule: "twice", projector: Some(second.to_owned()), passed: false, what });
        }
    }
    report
}

/// Every third direction.
fn map(dome: Dome, directions: &[DVec3], hits: &[Vec<Option<Hit>>]) -> Vec<MapPoint> {
    let axis = dome.axis();
    // The front is where the dome's axis would be tilted further.
    let front = (DVec3::NEG_Z - axis * axis.dot(DVec3::NEG_Z)).normalize_or(axis.any_orthonormal_vector());
    let right = front.cross(axis);
    let point = |at: usize| {
        let direction = directions[at];
        let of: Vec<Hit> = hits.iter().filter_map(|of| of[at]).collect();
        let radius = direction.angle_between(axis) / (0.5 * dome.fov_deg.to_radians());
        let across = DVec2::new(direction.dot(right), -direction.dot(front)).normalize_or_zero();
        let arcmin = of.iter().map(|hit| hit.longer_rad.to_degrees() * 60.0).fold(f64::INFINITY, f64::min);
        MapPoint { place: across * radius, projectors: of.len(), sum: of.iter().map(|hit| hit.share).sum(), arcmin }
    };
    (0..directions.len()).step_by(3).map(point).collect()
}

fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..count).flat_map(move |first| (first + 1..count).map(move |second| [first, second]))
}

/// Directions over the dome, each of the same solid angle.
fn lattice(dome: Dome) -> Vec<DVec3> {
    let axis = dome.axis();
    let (right, up) = axis.any_orthonormal_pair();
    let least = (0.5 * dome.fov_deg.to_radians()).cos();
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let at = |index: usize| {
        let along = 1.0 - (1.0 - least) * (index as f64 + 0.5) / SAMPLES as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let across = (1.0 - along * along).max(0.0).sqrt();
        axis * along + (right * cos + up * sin) * across
    };
    (0..SAMPLES).map(at).collect()
}

fn hit(projector: &Projector<'_>, direction: DVec3) -> Option<Hit> {
    let direction = projector.dome_from_view.inverse() * direction;
    let pixel = projector.mapping.pixel_from_direction(direction)?;
    let [width, height] = projector.mapping.size();
    let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(width) && pixel.y < f64::from(height);
    if !inside || !projector.mapping.contains(pixel.x as u32, pixel.y as u32) {
        return None;
    }
    let share = projector.blend.map_or(1.0, |blend| blend.alpha_at(pixel));
    let longer_rad = projector.mapping.pixel_extent_rad(direction)?[0];
    Some(Hit { share, longer_rad })
}

/// The rules of one projector.
fn of_one(projector: &Projector<'_>, hits: &[Option<Hit>]) -> Vec<Finding> {
    let finding =
        |rule, passed, what: String| Finding { rule, projector: Some(projector.name.to_owned()), passed, what };
    let mut findings = Vec::new();
    let mapping = projector.mapping;
    let [width, height] = mapping.size();
    let places: Vec<(DVec2, DVec3)> = (0..400_u32)
        .map(|at| pixel_centre((at % 20 * 2 + 1) * width / 40, (at / 20 * 2 + 1) * height / 40))
        .filter_map(|pixel| Some((pixel, mapping.direction_from_pixel(pixel)?)))
        .collect();
    let widest = |first: &DVec3| places.iter().map(|(_, other)| first.angle_between(*other)).fold(0.0, f64::max);
    let span_deg = places.first().map_or(0.0, |(_, first)| widest(first)).to_degrees();
    let what = format!(
        "the picture spans {span_deg:.1} degrees, at least {LEAST_SPAN_DEG} are expected: offsets taken for absolutes, or other units?"
    );
    findings.push(finding("span", span_deg >= LEAST_SPAN_DEG, what));
    let on_dome = hits.iter().flatten().count();
    let what = match on_dome {
        0 => "nothing of it falls on the dome: other axes, or rows upside down?".to_owned(),
        _ => format!("{:.1} % of the dome", 100.0 * on_dome as f64 / hits.len() as f64),
    };
    findings.push(finding("reaches", on_dome > 0, what));
    // Seen from the middle of the dome: columns to the right, rows downwards.
    let turns: Vec<(bool, bool)> = places.iter().filter_map(|(pixel, _)| turn(mapping, *pixel, projector)).collect();
    let share = |of: &dyn Fn(&(bool, bool)) -> bool| {
        turns.iter().filter(|turn| of(turn)).count() as f64 / turns.len().max(1) as f64
    };
    let mirrored = share(&|(mirrored, _)| *mirrored);
    let downwards = share(&|(_, upwards)| !*upwards);
    let what = match (mirrored > 0.5, downwards > 0.5) {
        (true, true) => {
            "the picture is mirrored and its upper border is low: rows upside down? (rows = \"bottom_first\" or \"top_first\")"
        }
        (true, false) => {
            "the picture is mirrored: columns in the wrong order, or an axis with the wrong sign? (axes = ...)"
        }
        (false, _) => "the picture is as seen from inside",
    };
    findings.push(finding("mirrored", mirrored < 0.5, what.to_owned()));
    let (step, at) = largest_step(mapping);
    let what = format!(
        "a pixel is {step:.3} times as large as its neighbour at ({}, {}), at most {MOST_STEP} is allowed",
        at[0], at[1]
    );
    findings.push(finding("facets", step <= MOST_STEP, what));
    findings
}

/// Whether the picture is mirrored at a pixel, and whether its rows go down, away from +y.
fn turn(mapping: &dyn PlaneMapping, pixel: DVec2, projector: &Projector<'_>) -> Option<(bool, bool)> {
    let at = |by: DVec2| mapping.direction_from_pixel(pixel + by);
    let (here, right, down) = (at(DVec2::ZERO)?, at(DVec2::X * 0.5)?, at(DVec2::Y * 0.5)?);
    let mirrored = (right - here).cross(down - here).dot(here) < 0.0;
    let downwards = projector.dome_from_view * (down - here);
    Some((mirrored, downwards.y < 0.0))
}

/// The largest ratio of the solid angles of neighbouring pixels, and where.
fn largest_step(mapping: &dyn PlaneMapping) -> (f64, [u32; 2]) {
    let [width, height] = mapping.size();
    let mut largest = (1.0, [0, 0]);
    // Every row would be more than is needed to find the border of a cell.
    let rows = (1..24).map(|row| row * height / 24);
    for y in rows.filter(|y| *y < height) {
        let mut before = 0.0;
        for x in 0..width {
            let here = mapping.solid_angle_sr(x, y);
            let step = f64::max(here / before, before / here);
            if before > 0.0 && here > 0.0 && step > largest.0 {
                largest = (step, [x, y]);
            }
            before = here;
        }
    }
    largest
}

fn percentiles(mut values: Vec<f64>, shares: [f64; 3]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    shares.map(|share| {
        let at = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
        values.get(at).copied().unwrap_or(f64::NAN)
    })
}

/// Middle and radius of the largest circle without light, about: the dark direction that is farthest from all that are lit.
fn widest_gap(directions: &[DVec3], counts: &[usize]) -> Option<[f64; 3]> {
    let lit: Vec<DVec3> = directions.iter().zip(counts).filter(|(_, count)| **count > 0).map(|(d, _)| *d).collect();
    let dark = directions.iter().zip(counts).filter(|(_, count)| **count == 0).map(|(d, _)| *d);
    // A few hundred of them are enough to find the middle.
    let dark: Vec<DVec3> = dark.collect();
    let stride = dark.len().div_ceil(400).max(1);
    let radius =
        |direction: &DVec3| lit.iter().map(|lit| lit.dot(*direction)).fold(-1.0, f64::max).clamp(-1.0, 1.0).acos();
    let widest = dark.iter().step_by(stride).map(|direction| (radius(direction), direction));
    let (radius, middle) = widest.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let azimuth = middle.x.atan2(-middle.z).to_degrees();
    Some([azimuth, middle.y.asin().to_degrees(), radius.to_degrees()])
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;
    use crate::view::{
        Weights,
        projection::{DirectionGrid, Interpolation, Placement, Warp},
    };

    const DOME: Dome = Dome { fov_deg: 120.0, tilt_deg: 90.0 };
    const SIZE: [u32; 2] = [160, 120];

    /// Direction of a point of the raster (0 to 1): bands of the dome from one side to the other, the upper border towards the zenith's far side.
    fn of_band(from_deg: f64, to_deg: f64) -> impl Fn(f64, f64) -> DVec3 {
        move |u: f64, v: f64| {
            let across = (from_deg + (to_deg - from_deg) * u).to_radians();
            let along = (65.0 - 130.0 * v).to_radians();
            DVec3::new(across.sin() * along.cos(), along.sin(), -across.cos() * along.cos())
        }
    }

    fn warp(direction: impl Fn(f64, f64) -> DVec3, samples: usize, interpolation: Interpolation) -> Warp {
        let at = |index: usize| index as f64 / (samples - 1) as f64;
        let directions = (0..samples * samples).map(|n| Some(direction(at(n % samples), at(n / samples)))).collect();
        let (columns, rows, placement) = (samples, samples, Placement::Corners);
        Warp::new(SIZE, &DirectionGrid { columns, rows, samples: directions, placement, interpolation }).unwrap()
    }

    /// Two halves that overlap by 10 degrees, with shares that add up.
    struct SetUp {
        warps: [Warp; 2],
        blends: [Option<Blend>; 2],
    }

    impl SetUp {
        fn right() -> Self {
            let warps = [of_band(-65.0, 5.0), of_band(-5.0, 65.0)].map(|of| warp(of, 33, Interpolation::Smooth));
            let ramp = |first: bool| {
                let width = SIZE[0] as usize;
                let values: Vec<f32> = (0..width)
                    .map(|x| {
                        let across = (x as f32 + 0.5) / width as f32 * 70.0 + if first { -65.0 } else { -5.0 };
                        let share = ((across + 5.0) / 10.0).clamp(0.0, 1.0);
                        if first { 1.0 - share } else { share }
                    })
                    .collect();
                Some(Blend::new(SIZE, Some(Weights { size: [width, 1], values: &values }), None).unwrap())
            };
            Self { warps, blends: [ramp(true), ramp(false)] }
        }

        fn check(&self) -> DomeReport {
            let names = ["left", "right"];
            let of = |at: usize| Projector {
                name: names[at],
                mapping: &self.warps[at],
                dome_from_view: DQuat::IDENTITY,
                blend: self.blends[at].as_ref(),
            };
            check(DOME, &[of(0), of(1)])
        }
    }

    fn failed(report: &DomeReport) -> Vec<&'static str> {
        report.findings.iter().filter(|finding| !finding.passed).map(|finding| finding.rule).collect()
    }

    #[test]
    fn a_good_set_up_keeps_all_rules() {
        let report = SetUp::right().check();
        assert!(report.passed(), "{:#?}", report.findings);
        assert!(report.coverage[0] > 0.999 && (0.05..0.15).contains(&report.coverage[1]), "{:?}", report.coverage);
        assert!((report.blend_sum[1] - 1.0).abs() < 1e-6);
        let pixel_arcmin = 130.0 * 60.0 / 120.0;
        assert!(
            (report.projectors[0].arcmin_per_pixel[1] / pixel_arcmin - 1.0).abs() < 0.02,
            "{:?}",
            report.projectors
        );
    }

    #[test]
    fn each_mistake_is_found_by_its_name() {
        let mistake = |change: &dyn Fn(&mut SetUp)| {
            let mut set_up = SetUp::right();
            change(&mut set_up);
            set_up.check()
        };
        let smooth = Interpolation::Smooth;
        let right = || of_band(-5.0, 65.0);
        let upside_down = mistake(&|s| s.warps[1] = warp(|u, v| right()(u, 1.0 - v), 33, smooth));
        assert_eq!(failed(&upside_down), ["mirrored"]);
        assert!(upside_down.findings.iter().any(|finding| finding.what.contains("rows upside down")));
        let columns = mistake(&|s| s.warps[1] = warp(|u, v| right()(1.0 - u, v), 33, smooth));
        assert_eq!(failed(&columns), ["blend", "mirrored"]);
        let gap = mistake(&|s| s.warps[1] = warp(of_band(15.0, 85.0), 33, smooth));
        assert_eq!(failed(&gap), ["coverage", "blend"]);
        let [azimuth, _, radius] = gap.widest_gap_deg.unwrap();
        assert!((0.0..120.0).contains(&azimuth.abs()) && (3.0..8.0).contains(&radius), "{azimuth} {radius}");
        let unblended = mistake(&|s| s.blends = [None, None]);
        assert_eq!(failed(&unblended), ["blend"]);
        assert!(unblended.findings.iter().any(|finding| finding.what.contains("no projector has a blend mask")));
        let swapped = mistake(&|s| s.blends.swap(0, 1));
        assert_eq!(failed(&swapped), ["blend"]);
        // Offsets in place of directions: all of the picture near one point.
        let collapsed =
            mistake(&|s| s.warps[1] = warp(|u, v| (right()(0.5, 0.5) + 1e-2 * right()(u, v)).normalize(), 33, smooth));
        assert!(failed(&collapsed).contains(&"span"), "{:?}", failed(&collapsed));
        let twice = mistake(&|s| s.warps[1] = warp(of_band(-65.0, 5.0), 33, smooth));
        assert!(failed(&twice).contains(&"twice") && failed(&twice).contains(&"coverage"));
        // Cells of different widths: between them the size of pixels jumps.
        let uneven = |u: f64, v: f64| right()(u + 0.04 * (7.0 * u).sin(), v);
        let facets = mistake(&|s| s.warps[1] = warp(uneven, 9, Interpolation::Linear));
        assert!(failed(&facets).contains(&"facets"), "{:?}", failed(&facets));
        let below = mistake(&|s| s.warps[1] = warp(|u, v| -right()(1.0 - u, v), 33, smooth));
        assert!(failed(&below).contains(&"reaches"));
    }
}

//! The rules, each with its name.

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3};

use super::{
    super::screen::ScreenSums,
    Dome, Finding, Hit, Projector,
    sky::{pairs, percentiles},
};
use crate::view::{
    projection::{PlaneMapping, pixel_centre},
    projector::Blend,
};

/// Minimum fraction of the dome that must be lit.
const LEAST_COVERAGE: f64 = 0.995;
/// Largest deviation of the sum of shares from 1. One direction in a hundred may deviate more.
const MOST_BLEND_ERROR: f64 = 0.02;
/// Smallest span of a picture, degrees; below it the picture is considered collapsed.
const LEAST_SPAN_DEG: f64 = 2.0;
/// Above this common fraction, two projectors are considered to show the same region.
const MOST_COMMON: f64 = 0.95;
/// Largest ratio of the sizes of neighbouring pixels; above it, the warp has facets.
const MOST_STEP: f64 = 1.02;
/// Largest distance of the eye from the centre of the screen, relative to its radius: spectators sit within it.
const MOST_OFF_CENTRE: f64 = 0.35;
/// Smallest and largest expected radius of a dome, m.
const RADII_M: [f64; 2] = [0.5, 60.0];
/// Largest rms deviation of the points from a sphere, relative to its radius; above it they belong to another kind of
/// screen.
const MOST_ROUGH: f64 = 0.03;
/// Largest angle between the mean direction of the light and the dome's axis, degrees. It applies if more than this
/// fraction of the light falls beyond the rim.
const MOST_LEAN_DEG: f64 = 4.0;
const MOST_BEYOND: f64 = 0.05;
/// Largest median ratio of the longer to the shorter side of pixels.
const MOST_ASPECT: f64 = 1.7;
/// Exponents that some programs forget to remove from masks, or apply twice.
const GAMMAS: [f64; 6] = [2.2, 1.0 / 2.2, 1.8, 1.0 / 1.8, 2.4, 1.0 / 2.4];
/// Shares below this count as no light.
const LEAST_SHARE: f64 = 0.01;

/// Returns the result, with a hint at the cause if the rule is violated.
fn with_hint(found: String, passed: bool, hint: &str) -> String {
    if passed { found } else { format!("{found}: {hint}") }
}

fn together(rule: &'static str, passed: bool, what: String) -> Finding {
    Finding { rule, projector: None, passed, what }
}

fn for_projector(projector: &Projector<'_>, rule: &'static str, passed: bool, what: String) -> Finding {
    Finding { rule, projector: Some(projector.name.to_owned()), passed, what }
}

/// Directions over the dome, and their positions on each projector.
pub(super) struct DomeSamples<'a> {
    pub(super) dome: Dome,
    pub(super) projectors: &'a [Projector<'a>],
    pub(super) directions: &'a [DVec3],
    /// By projector and direction.
    pub(super) hits: &'a [Vec<Option<Hit>>],
    /// Number of projectors that reach each direction.
    pub(super) counts: &'a [usize],
}

impl DomeSamples<'_> {
    /// Returns the largest deviation of the sum of shares from 1, except at one in a hundred of the lit directions.
    /// `share` computes the share of a projector (by index) for a hit.
    fn blend_error(&self, share: impl Fn(usize, &Hit) -> f64) -> f64 {
        let sum = |direction: usize| {
            let reached =
                self.hits.iter().enumerate().filter_map(|(projector, hits)| Some((projector, hits[direction]?)));
            reached.map(|(projector, hit)| share(projector, &hit)).sum::<f64>()
        };
        let lit = (0..self.directions.len()).filter(|at| self.counts[*at] > 0);
        percentiles(lit.map(|at| (sum(at) - 1.0).abs()).collect(), [0.99; 3])[0]
    }

    /// Describes the region in which the sum of the masks differs most from 1: the projectors that reach it, and the sum.
    fn where_off(&self) -> String {
        let mut regions: BTreeMap<Vec<usize>, Vec<f64>> = BTreeMap::new();
        for direction in 0..self.directions.len() {
            let reached = self.hits.iter().enumerate().filter_map(|(at, hits)| Some((at, hits[direction]?.share)));
            let (projectors, shares): (Vec<usize>, Vec<f64>) = reached.unzip();
            if !projectors.is_empty() {
                regions.entry(projectors).or_default().push(shares.iter().sum());
            }
        }
        let off = |sums: &[f64]| sums.iter().map(|sum| (sum - 1.0).abs()).sum::<f64>();
        let worst = regions.iter().max_by(|(_, a), (_, b)| off(a).total_cmp(&off(b)));
        worst.map_or(String::new(), |(projectors, sums)| {
            let names: Vec<String> = projectors.iter().map(|at| format!("`{}`", self.projectors[*at].name)).collect();
            let [low, median, high] = percentiles(sums.clone(), [0.01, 0.5, 0.99]);
            format!(
                "; most where the light comes from {}: the masks there add up to {low:.2} (1st percentile), {median:.2} (median), {high:.2} (99th percentile)",
                names.join(" and ")
            )
        })
    }

    fn lit(&self) -> f64 {
        self.counts.iter().filter(|count| **count > 0).count() as f64 / self.counts.len() as f64
    }
}

/// `coverage`: light everywhere.
pub(super) fn coverage(samples: &DomeSamples<'_>, widest_gap_deg: Option<[f64; 3]>) -> Finding {
    let gap = widest_gap_deg.map_or(String::new(), |[azimuth, elevation, radius]| {
        format!("; the widest gap is {radius:.1} degrees around azimuth {azimuth:.0}, elevation {elevation:.0}")
    });
    let lit = samples.lit();
    let what =
        format!("{:.2} % of the dome has light; must be at least {:.1} %{gap}", 100.0 * lit, 100.0 * LEAST_COVERAGE);
    together("coverage", lit >= LEAST_COVERAGE, what)
}

/// `rim`: the dark part of the dome is a ring along its rim.
pub(super) fn rim(samples: &DomeSamples<'_>) -> Option<Finding> {
    let axis = samples.dome.axis();
    let half_rad = 0.5 * samples.dome.fov_deg.to_radians();
    // The outer part of the dome, in sixteen sectors.
    let (right, up) = axis.any_orthonormal_pair();
    let mut parts = [[0_u32; 2]; 16];
    let mut inside_dark = 0;
    for (direction, count) in samples.directions.iter().zip(samples.counts) {
        if direction.angle_between(axis) > 0.95 * half_rad {
            let around = direction.dot(up).atan2(direction.dot(right)) / std::f64::consts::TAU + 0.5;
            parts[((around * 16.0) as usize).min(15)][usize::from(*count > 0)] += 1;
        } else if direction.angle_between(axis) < 0.7 * half_rad && *count == 0 {
            inside_dark += 1;
        }
    }
    let is_ring = inside_dark == 0 && parts.iter().all(|[dark, lit]| *dark > 2 * *lit);
    (is_ring && samples.lit() < LEAST_COVERAGE).then(|| {
        let what =
            "the dark part is a ring along the rim: either the fields of view of the projectors are too small, or --dome-fov-deg is not that of this dome";
        together("rim", false, what.to_owned())
    })
}

/// `blend`: the shares of light must add up to 1. If they do not, `gamma` and `swapped` give the cause, if it can be
/// identified.
pub(super) fn blend(samples: &DomeSamples<'_>) -> Vec<Finding> {
    let off = samples.blend_error(|_, hit| hit.share);
    let unblended = samples.projectors.iter().all(|projector| projector.blend.is_none());
    let why = if unblended && off > MOST_BLEND_ERROR { ": no projector has a blend mask" } else { "" };
    let what = format!(
        "the sum of the shares of light differs from 1 by {off:.3} at the 99th percentile of the lit dome; must be at most {MOST_BLEND_ERROR}{why}{}",
        if off > MOST_BLEND_ERROR && !unblended { samples.where_off() } else { String::new() }
    );
    let mut findings = vec![together("blend", off <= MOST_BLEND_ERROR, what)];
    if off <= MOST_BLEND_ERROR || unblended {
        return findings;
    }
    let by_gamma = GAMMAS.map(|gamma| (samples.blend_error(|_, hit| hit.share.powf(gamma)), gamma));
    let best = by_gamma.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
    if let Some((_, gamma)) = best.filter(|(error, _)| *error <= MOST_BLEND_ERROR.max(0.25 * off)) {
        let what = format!(
            "the shares would add up to 1 if the masks were raised to the power {gamma:.2}: check gammaEmbedded"
        );
        findings.push(together("gamma", false, what));
    }
    let swapped = pairs(samples.projectors.len()).filter_map(|[first, second]| {
        let [a, b] = [first, second].map(|index| &samples.projectors[index]);
        let (blend_a, blend_b) = (a.blend?, b.blend?);
        let error = samples.blend_error(|index, hit| match index {
            _ if index == first => at_share(blend_b, a.mapping, hit.pixel),
            _ if index == second => at_share(blend_a, b.mapping, hit.pixel),
            _ => hit.share,
        });
        (error <= MOST_BLEND_ERROR).then_some([a, b])
    });
    findings.extend(swapped.map(|[a, b]| {
        for_projector(
            b,
            "swapped",
            false,
            format!("the shares would add up to 1 if the masks of `{}` and `{}` were exchanged", a.name, b.name),
        )
    }));
    findings
}

/// Returns the alpha of a mask at the corresponding pixel of another raster.
fn at_share(blend: &Blend, mapping: &dyn PlaneMapping, pixel: DVec2) -> f64 {
    let [blend_size, own] = [blend.size(), mapping.size()].map(|[x, y]| DVec2::new(f64::from(x), f64::from(y)));
    blend.alpha_at(pixel * blend_size / own)
}

/// `black_level`: black must be raised where few projectors reach, not where many do.
pub(super) fn black_level(samples: &DomeSamples<'_>) -> Option<Finding> {
    let counts = samples.counts.iter().copied().filter(|count| *count > 0);
    let (fewest, most) = (counts.clone().min()?, counts.max()?);
    let lift = |wanted: usize| {
        let indices = (0..samples.directions.len()).filter(|index| samples.counts[*index] == wanted);
        let levels: Vec<f64> = indices
            .flat_map(|index| samples.hits.iter().filter_map(move |hits| hits[index]))
            .map(|hit| hit.black)
            .collect();
        levels.iter().sum::<f64>() / levels.len().max(1) as f64
    };
    let [few, many] = [fewest, most].map(lift);
    if fewest == most || (few == 0.0 && many == 0.0) {
        return None;
    }
    let what = format!(
        "black is raised by {few:.5} of white where {fewest} projectors reach and by {many:.5} where {most} reach; must be raised more where fewer projectors reach"
    );
    Some(together("black_level", many <= few, what))
}

/// `twice`: two projectors show the same region.
pub(super) fn twice(samples: &DomeSamples<'_>) -> Vec<Finding> {
    let found = pairs(samples.projectors.len()).filter_map(|pair| {
        let [first, second] = pair.map(|index| &samples.hits[index]);
        let count = |hits: &[Option<Hit>]| hits.iter().flatten().count();
        let common = first.iter().zip(second).filter(|(a, b)| a.is_some() && b.is_some()).count();
        let share = common as f64 / count(first).min(count(second)).max(1) as f64;
        let [first, second] = pair.map(|index| &samples.projectors[index]);
        let what = || {
            format!(
                "{:.0} % of the region of `{}` is also shown by `{}`: is the same region used twice?",
                100.0 * share,
                second.name,
                first.name
            )
        };
        (share > MOST_COMMON).then(|| for_projector(second, "twice", false, what()))
    });
    found.collect()
}

/// `tilt`: the light must be centred on the axis of the dome.
pub(super) fn tilt(samples: &DomeSamples<'_>) -> Finding {
    let axis = samples.dome.axis();
    let rim_rad = 0.5 * samples.dome.fov_deg.to_radians();
    let (mut sum, mut whole, mut beyond) = (DVec3::ZERO, 0.0, 0.0);
    for projector in samples.projectors {
        for (pixel, direction) in places(projector.mapping, 40) {
            if projector.blend.is_some_and(|blend| blend.alpha_at(pixel) < LEAST_SHARE) {
                continue;
            }
            let solid_angle_sr = projector.mapping.solid_angle_sr(pixel.x as u32, pixel.y as u32);
            let direction = projector.dome_from_view * direction;
            // If several projectors reach the direction, each counts as a fraction.
            let reaches = |other: &&Projector<'_>| other.hit(direction).is_some_and(|hit| hit.share >= LEAST_SHARE);
            let weight = solid_angle_sr / samples.projectors.iter().filter(reaches).count().max(1) as f64;
            sum += direction * weight;
            whole += weight;
            beyond += if direction.angle_between(axis) > rim_rad { weight } else { 0.0 };
        }
    }
    let lean_deg = sum.angle_between(axis).to_degrees();
    let beyond = beyond / f64::max(whole, f64::MIN_POSITIVE);
    // In dome axes, the light leans to the front or away from it.
    let front = (sum.normalize_or_zero() - axis).dot(DVec3::NEG_Z);
    let side = if front > 0.0 { "front" } else { "back" };
    let what = format!(
        "the light is centred {lean_deg:.1} degrees from the dome's axis (to the {side}), {:.1} % of it falls beyond the rim: must be at most {MOST_LEAN_DEG} degrees or {} % \
         respectively",
        100.0 * beyond,
        100.0 * MOST_BEYOND
    );
    together("tilt", !(lean_deg > MOST_LEAN_DEG && beyond > MOST_BEYOND), what)
}

/// `eye` and `unit`: the eye must be near the centre of the screen on which the points of the files lie, and the screen
/// must be as large as a dome.
pub(super) fn screen(projectors: &[Projector<'_>]) -> Vec<Finding> {
    let mut sums = ScreenSums::default();
    for (projector, screen) in projectors.iter().filter_map(|projector| Some((projector, projector.screen?))) {
        sums.merge(&screen.turned(DMat3::from_quat(projector.dome_from_view)));
    }
    let Some(sphere) = sums.sphere().filter(|sphere| sphere.rough_m <= MOST_ROUGH * sphere.radius_m) else {
        return Vec::new();
    };
    let radius_m = sphere.radius_m;
    let (off_m, most_m) = (sphere.centre_m.length(), MOST_OFF_CENTRE * radius_m);
    let [x, y, z] = (-sphere.centre_m).to_array();
    let position = if off_m < 0.005 {
        "in the centre".to_owned()
    } else {
        format!("at [{x:.2}, {y:.2}, {z:.2}] m from the centre")
    };
    let centred = off_m <= most_m;
    let eye = format!(
        "the eye is {position} of the screen, whose radius is {radius_m:.2} m; its distance from the centre must be at most {most_m:.2} m"
    );
    let [least, most] = RADII_M;
    let sized = (least..=most).contains(&radius_m);
    let unit = format!("the radius of the screen is {radius_m:.2} m; must be between {least} and {most} m");
    vec![
        together("eye", centred, with_hint(eye, centred, "does the file have a different eye point or origin?")),
        together("unit", sized, with_hint(unit, sized, "does the file have a different unit?")),
    ]
}

/// Returns points spread over a raster, at most `side` x `side`, with their directions. Points without a direction are left out.
fn places(mapping: &dyn PlaneMapping, side: u32) -> Vec<(DVec2, DVec3)> {
    let [width, height] = mapping.size();
    let coordinate = |index: u32, size: u32| (2 * index + 1) * size / (2 * side);
    (0..side * side)
        .map(|index| pixel_centre(coordinate(index % side, width), coordinate(index / side, height)))
        .filter_map(|pixel| Some((pixel, mapping.direction_from_pixel(pixel)?)))
        .collect()
}

/// `span`, `reaches`, `mirrored`, `raster` and `facets` of one projector.
pub(super) fn for_one(projector: &Projector<'_>, hits: &[Option<Hit>]) -> Vec<Finding> {
    let mapping = projector.mapping;
    let mut findings = Vec::new();
    let places = places(mapping, 20);
    // `span`: largest angle from the first point to another one.
    let widest = |first: &DVec3| places.iter().map(|(_, other)| first.angle_between(*other)).fold(0.0, f64::max);
    let span_deg = places.first().map_or(0.0, |(_, first)| widest(first)).to_degrees();
    let spans = span_deg >= LEAST_SPAN_DEG;
    let what = format!("the picture spans {span_deg:.1} degrees; must be at least {LEAST_SPAN_DEG}");
    let what = with_hint(
        what,
        spans,
        "are these offsets that were read as absolute values, or does the file have a different unit?",
    );
    findings.push(for_projector(projector, "span", spans, what));
    // `reaches`: the directions of the dome that fall on the raster.
    let on_dome = hits.iter().flatten().count();
    let what = match on_dome {
        0 => "no part of it falls on the dome: does the file have different axes, or are its rows upside down?"
            .to_owned(),
        _ => format!("{:.1} % of the dome", 100.0 * on_dome as f64 / hits.len() as f64),
    };
    findings.push(for_projector(projector, "reaches", on_dome > 0, what));
    // As seen from the centre of the dome: columns to the right, rows downwards.
    let turns: Vec<(bool, bool)> = places.iter().filter_map(|(pixel, _)| turn(mapping, *pixel, projector)).collect();
    let share = |holds: &dyn Fn(&(bool, bool)) -> bool| {
        turns.iter().filter(|turn| holds(turn)).count() as f64 / turns.len().max(1) as f64
    };
    // `mirrored`: the majority of the points decides.
    let mirrored = share(&|(mirrored, _)| *mirrored);
    let downwards = share(&|(_, upwards)| !*upwards);
    let what = match (mirrored > 0.5, downwards > 0.5) {
        (true, true) => {
            "the picture is mirrored, and its upper border is at the bottom: are the rows upside down? (rows = \"bottom_first\" or \"top_first\")"
        }
        (true, false) => {
            "the picture is mirrored: are the columns in the wrong order, or does an axis have the wrong sign? (axes = ...)"
        }
        (false, _) => "the picture has the right orientation, as seen from inside the dome",
    };
    findings.push(for_projector(projector, "mirrored", mirrored < 0.5, what.to_owned()));
    // `raster`: a wrong width or height stretches all pixels.
    let aspects = places.iter().filter_map(|(_, direction)| mapping.pixel_extent_rad(*direction));
    let [_, aspect, _] = percentiles(aspects.map(|[longer, shorter]| longer / shorter).collect(), [0.5; 3]);
    let [width, height] = mapping.size();
    let shaped = aspect <= MOST_ASPECT;
    let what = format!("the median aspect ratio of pixels is {aspect:.2}; must be at most {MOST_ASPECT}");
    let what = with_hint(what, shaped, &format!("is the raster {width} x {height}?"));
    findings.push(for_projector(projector, "raster", shaped, what));
    // `facets`: in a smooth map, the size of pixels changes gradually.
    let (step, [x, y]) = largest_step(mapping);
    let smooth = step <= MOST_STEP;
    let what =
        format!("a pixel is {step:.3} times as large as its neighbour at ({x}, {y}); must be at most {MOST_STEP}");
    findings.push(for_projector(
        projector,
        "facets",
        smooth,
        with_hint(what, smooth, "the grid is too coarse for interpolation without splines, or its values are noisy"),
    ));
    findings
}

/// Returns whether the picture is mirrored at a pixel, and whether its rows go down, away from +y.
fn turn(mapping: &dyn PlaneMapping, pixel: DVec2, projector: &Projector<'_>) -> Option<(bool, bool)> {
    let direction_at = |by: DVec2| mapping.direction_from_pixel(pixel + by);
    let (here, right, down) =
        (direction_at(DVec2::ZERO)?, direction_at(DVec2::X * 0.5)?, direction_at(DVec2::Y * 0.5)?);
    let mirrored = (right - here).cross(down - here).dot(here) < 0.0;
    let downwards = projector.dome_from_view * (down - here);
    Some((mirrored, downwards.y < 0.0))
}

/// The largest ratio of the solid angles of neighbouring pixels, and its position.
fn largest_step(mapping: &dyn PlaneMapping) -> (f64, [u32; 2]) {
    let [width, height] = mapping.size();
    let mut largest = (1.0, [0, 0]);
    // A few rows are enough to find the border of a cell.
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

//! The rules, each by its name.

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
/// How far the eye may be from the middle of the screen, parts of its radius: spectators sit within.
const MOST_OFF_CENTRE: f64 = 0.35;
/// Radii of domes, m.
const RADII_M: [f64; 2] = [0.5, 60.0];
/// Points that are farther from a sphere, parts of its radius, are those of another screen.
const MOST_ROUGH: f64 = 0.03;
/// How far the middle of the light may lean from the dome's axis, degrees, if more than a share of it falls beyond the rim.
const MOST_LEAN_DEG: f64 = 4.0;
const MOST_BEYOND: f64 = 0.05;
/// Longer over shorter side of pixels, in the median.
const MOST_ASPECT: f64 = 1.7;
/// Powers that forgetful programs leave in masks, or apply twice.
const GAMMAS: [f64; 6] = [2.2, 1.0 / 2.2, 1.8, 1.0 / 1.8, 2.4, 1.0 / 2.4];
/// Light below this share is none.
const LEAST_SHARE: f64 = 0.01;

/// What was found, and what it hints at where the rule is not kept.
fn with_hint(found: String, passed: bool, hint: &str) -> String {
    if passed { found } else { format!("{found}: {hint}") }
}

fn together(rule: &'static str, passed: bool, what: String) -> Finding {
    Finding { rule, projector: None, passed, what }
}

fn of(projector: &Projector<'_>, rule: &'static str, passed: bool, what: String) -> Finding {
    Finding { rule, projector: Some(projector.name.to_owned()), passed, what }
}

/// Directions over the dome, and where each falls on each projector.
pub(super) struct Seen<'a> {
    pub(super) dome: Dome,
    pub(super) projectors: &'a [Projector<'a>],
    pub(super) directions: &'a [DVec3],
    /// By projector and direction.
    pub(super) hits: &'a [Vec<Option<Hit>>],
    /// Projectors that reach each direction.
    pub(super) counts: &'a [usize],
}

impl Seen<'_> {
    /// Off 1 of the sums of shares at 99 of 100 lit directions, with shares as `share` of the projector and the hit has them.
    fn blend_error(&self, share: impl Fn(usize, &Hit) -> f64) -> f64 {
        let sum = |direction: usize| {
            let of = self.hits.iter().enumerate().filter_map(|(projector, hits)| Some((projector, hits[direction]?)));
            of.map(|(projector, hit)| share(projector, &hit)).sum::<f64>()
        };
        let lit = (0..self.directions.len()).filter(|at| self.counts[*at] > 0);
        percentiles(lit.map(|at| (sum(at) - 1.0).abs()).collect(), [0.99; 3])[0]
    }

    fn lit(&self) -> f64 {
        self.counts.iter().filter(|count| **count > 0).count() as f64 / self.counts.len() as f64
    }
}

/// `coverage`: light everywhere.
pub(super) fn coverage(seen: &Seen<'_>, widest_gap_deg: Option<[f64; 3]>) -> Finding {
    let gap = widest_gap_deg.map_or(String::new(), |[azimuth, elevation, radius]| {
        format!("; the widest gap is {radius:.1} degrees around azimuth {azimuth:.0}, elevation {elevation:.0}")
    });
    let lit = seen.lit();
    let what =
        format!("{:.2} % of the dome has light, at least {:.1} % is needed{gap}", 100.0 * lit, 100.0 * LEAST_COVERAGE);
    together("coverage", lit >= LEAST_COVERAGE, what)
}

/// `rim`: the dark part of the dome is a ring along its rim.
pub(super) fn rim(seen: &Seen<'_>) -> Option<Finding> {
    let axis = seen.dome.axis();
    let half_rad = 0.5 * seen.dome.fov_deg.to_radians();
    // The outer quarter of the angle, in sixteen parts around.
    let (right, up) = axis.any_orthonormal_pair();
    let mut parts = [[0_u32; 2]; 16];
    let mut inside_dark = 0;
    for (direction, count) in seen.directions.iter().zip(seen.counts) {
        if direction.angle_between(axis) > 0.95 * half_rad {
            let around = direction.dot(up).atan2(direction.dot(right)) / std::f64::consts::TAU + 0.5;
            parts[((around * 16.0) as usize).min(15)][usize::from(*count > 0)] += 1;
        } else if direction.angle_between(axis) < 0.7 * half_rad && *count == 0 {
            inside_dark += 1;
        }
    }
    let is_ring = inside_dark == 0 && parts.iter().all(|[dark, lit]| *dark > 2 * *lit);
    (is_ring && seen.lit() < LEAST_COVERAGE).then(|| {
        let what = "the dark part is a ring along the whole rim: a field of view that is too small, or another dome?";
        together("rim", false, what.to_owned())
    })
}

/// `blend`: shares of light that add up; where they do not, `gamma` and `swapped` say why, if they can.
pub(super) fn blend(seen: &Seen<'_>) -> Vec<Finding> {
    let off = seen.blend_error(|_, hit| hit.share);
    let unblended = seen.projectors.iter().all(|projector| projector.blend.is_none());
    let why = if unblended && off > MOST_BLEND_ERROR { ": no projector has a blend mask" } else { "" };
    let what = format!(
        "shares of light are off 1 by {off:.3} at 99 % of the dome, at most {MOST_BLEND_ERROR} is allowed{why}"
    );
    let mut findings = vec![together("blend", off <= MOST_BLEND_ERROR, what)];
    if off <= MOST_BLEND_ERROR || unblended {
        return findings;
    }
    let of_gamma = GAMMAS.map(|gamma| (seen.blend_error(|_, hit| hit.share.powf(gamma)), gamma));
    let best = of_gamma.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
    if let Some((_, gamma)) = best.filter(|(error, _)| *error <= MOST_BLEND_ERROR.max(0.25 * off)) {
        let what = format!("the shares would add up if the masks were taken to the power {gamma:.2}: gammaEmbedded?");
        findings.push(together("gamma", false, what));
    }
    let swapped = pairs(seen.projectors.len()).filter_map(|[first, second]| {
        let [a, b] = [first, second].map(|index| &seen.projectors[index]);
        let (of_a, of_b) = (a.blend?, b.blend?);
        let error = seen.blend_error(|index, hit| match index {
            _ if index == first => at_share(of_b, a.mapping, hit.pixel),
            _ if index == second => at_share(of_a, b.mapping, hit.pixel),
            _ => hit.share,
        });
        (error <= MOST_BLEND_ERROR).then_some([a, b])
    });
    findings.extend(swapped.map(|[a, b]| {
        of(
            b,
            "swapped",
            false,
            format!("the shares would add up if `{}` and `{}` had each other's mask", a.name, b.name),
        )
    }));
    findings
}

/// Alpha of a mask that belongs to another raster.
fn at_share(blend: &Blend, mapping: &dyn PlaneMapping, pixel: DVec2) -> f64 {
    let [of_blend, own] = [blend.size(), mapping.size()].map(|[x, y]| DVec2::new(f64::from(x), f64::from(y)));
    blend.alpha_at(pixel * of_blend / own)
}

/// `black_level`: black is lifted where few projectors reach, not where many do.
pub(super) fn black_level(seen: &Seen<'_>) -> Option<Finding> {
    let counts = seen.counts.iter().copied().filter(|count| *count > 0);
    let (fewest, most) = (counts.clone().min()?, counts.max()?);
    let lift = |wanted: usize| {
        let at = (0..seen.directions.len()).filter(|at| seen.counts[*at] == wanted);
        let of: Vec<f64> =
            at.flat_map(|at| seen.hits.iter().filter_map(move |hits| hits[at])).map(|hit| hit.black).collect();
        of.iter().sum::<f64>() / of.len().max(1) as f64
    };
    let [few, many] = [fewest, most].map(lift);
    if fewest == most || (few == 0.0 && many == 0.0) {
        return None;
    }
    let what = format!(
        "black is lifted by {few:.5} of white where {fewest} projectors reach, by {many:.5} where {most} do: it has to be more where fewer reach"
    );
    Some(together("black_level", many <= few, what))
}

/// `twice`: two projectors with the same region.
pub(super) fn twice(seen: &Seen<'_>) -> Vec<Finding> {
    let found = pairs(seen.projectors.len()).filter_map(|pair| {
        let [first, second] = pair.map(|index| &seen.hits[index]);
        let count = |of: &[Option<Hit>]| of.iter().flatten().count();
        let common = first.iter().zip(second).filter(|(a, b)| a.is_some() && b.is_some()).count();
        let share = common as f64 / count(first).min(count(second)).max(1) as f64;
        let [first, second] = pair.map(|index| &seen.projectors[index]);
        let what = || {
            format!(
                "{:.0} % of `{}` is what `{}` shows: the same region twice?",
                100.0 * share,
                second.name,
                first.name
            )
        };
        (share > MOST_COMMON).then(|| of(second, "twice", false, what()))
    });
    found.collect()
}

/// `tilt`: the light lies around the axis of the dome.
pub(super) fn tilt(seen: &Seen<'_>) -> Finding {
    let axis = seen.dome.axis();
    let rim_rad = 0.5 * seen.dome.fov_deg.to_radians();
    let (mut sum, mut whole, mut beyond) = (DVec3::ZERO, 0.0, 0.0);
    for projector in seen.projectors {
        for (pixel, direction) in places(projector.mapping, 40) {
            if projector.blend.is_some_and(|blend| blend.alpha_at(pixel) < LEAST_SHARE) {
                continue;
            }
            let solid_angle_sr = projector.mapping.solid_angle_sr(pixel.x as u32, pixel.y as u32);
            let direction = projector.dome_from_view * direction;
            // Where several reach, each counts in part.
            let reaches = |other: &&Projector<'_>| other.hit(direction).is_some_and(|hit| hit.share >= LEAST_SHARE);
            let weight = solid_angle_sr / seen.projectors.iter().filter(reaches).count().max(1) as f64;
            sum += direction * weight;
            whole += weight;
            beyond += if direction.angle_between(axis) > rim_rad { weight } else { 0.0 };
        }
    }
    let lean_deg = sum.angle_between(axis).to_degrees();
    let beyond = beyond / f64::max(whole, f64::MIN_POSITIVE);
    // In the axes of the dome: towards the front, or away from it.
    let front = (sum.normalize_or_zero() - axis).dot(DVec3::NEG_Z);
    let side = if front > 0.0 { "front" } else { "back" };
    let what = format!(
        "the middle of the light leans {lean_deg:.1} degrees from the dome's axis (to the {side}), {:.1} % of it falls beyond the rim: up to {MOST_LEAN_DEG} degrees or {} % \
         are allowed",
        100.0 * beyond,
        100.0 * MOST_BEYOND
    );
    together("tilt", !(lean_deg > MOST_LEAN_DEG && beyond > MOST_BEYOND), what)
}

/// `eye` and `unit`: the eye is near the middle of the screen that the points of the files lie on, which is as large as a dome.
pub(super) fn screen(projectors: &[Projector<'_>]) -> Vec<Finding> {
    let mut sums = ScreenSums::default();
    for (projector, of) in projectors.iter().filter_map(|projector| Some((projector, projector.screen?))) {
        sums.merge(&of.turned(DMat3::from_quat(projector.dome_from_view)));
    }
    let Some(sphere) = sums.sphere().filter(|sphere| sphere.rough_m <= MOST_ROUGH * sphere.radius_m) else {
        return Vec::new();
    };
    let radius_m = sphere.radius_m;
    let (off_m, most_m) = (sphere.centre_m.length(), MOST_OFF_CENTRE * radius_m);
    let [x, y, z] = (-sphere.centre_m).to_array();
    let at = if off_m < 0.005 {
        "in the middle".to_owned()
    } else {
        format!("at [{x:.2}, {y:.2}, {z:.2}] m from the middle")
    };
    let centred = off_m <= most_m;
    let eye =
        format!("the eye is {at} of the screen, whose radius is {radius_m:.2} m; up to {most_m:.2} m are expected");
    let [least, most] = RADII_M;
    let sized = (least..=most).contains(&radius_m);
    let unit = format!("the radius of the screen is {radius_m:.2} m, {least} to {most} are expected");
    vec![
        together("eye", centred, with_hint(eye, centred, "another eye point, or another origin?")),
        together("unit", sized, with_hint(unit, sized, "another unit?")),
    ]
}

/// Points over a raster that have a direction, with it: at most `side` each way.
fn places(mapping: &dyn PlaneMapping, side: u32) -> Vec<(DVec2, DVec3)> {
    let [width, height] = mapping.size();
    let at = |index: u32, size: u32| (2 * index + 1) * size / (2 * side);
    (0..side * side)
        .map(|index| pixel_centre(at(index % side, width), at(index / side, height)))
        .filter_map(|pixel| Some((pixel, mapping.direction_from_pixel(pixel)?)))
        .collect()
}

/// `span`, `reaches`, `mirrored`, `raster` and `facets` of one projector.
pub(super) fn of_one(projector: &Projector<'_>, hits: &[Option<Hit>]) -> Vec<Finding> {
    let mapping = projector.mapping;
    let mut findings = Vec::new();
    let places = places(mapping, 20);
    let widest = |first: &DVec3| places.iter().map(|(_, other)| first.angle_between(*other)).fold(0.0, f64::max);
    let span_deg = places.first().map_or(0.0, |(_, first)| widest(first)).to_degrees();
    let spans = span_deg >= LEAST_SPAN_DEG;
    let what = format!("the picture spans {span_deg:.1} degrees, at least {LEAST_SPAN_DEG} are expected");
    let what = with_hint(what, spans, "offsets taken for absolutes, or other units?");
    findings.push(of(projector, "span", spans, what));
    let on_dome = hits.iter().flatten().count();
    let what = match on_dome {
        0 => "nothing of it falls on the dome: other axes, or rows upside down?".to_owned(),
        _ => format!("{:.1} % of the dome", 100.0 * on_dome as f64 / hits.len() as f64),
    };
    findings.push(of(projector, "reaches", on_dome > 0, what));
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
    findings.push(of(projector, "mirrored", mirrored < 0.5, what.to_owned()));
    let aspects = places.iter().filter_map(|(_, direction)| mapping.pixel_extent_rad(*direction));
    let [_, aspect, _] = percentiles(aspects.map(|[longer, shorter]| longer / shorter).collect(), [0.5; 3]);
    let [width, height] = mapping.size();
    let shaped = aspect <= MOST_ASPECT;
    let what = format!("pixels are {aspect:.2} times as long as wide in the median, at most {MOST_ASPECT} is expected");
    let what = with_hint(what, shaped, &format!("is the raster {width} x {height}?"));
    findings.push(of(projector, "raster", shaped, what));
    let (step, [x, y]) = largest_step(mapping);
    let smooth = step <= MOST_STEP;
    let what =
        format!("a pixel is {step:.3} times as large as its neighbour at ({x}, {y}), at most {MOST_STEP} is allowed");
    findings.push(of(projector, "facets", smooth, with_hint(what, smooth, "a coarse grid without splines, or noise")));
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

//! Arcs through a projection: straight pieces in the image that follow the curve.
//!
//! An arc is halved until its image lies within [`TOLERANCE_PX`] of a chord. This is tested at three points between the ends; they must also be at
//! about the expected positions along the chord. At a jump of the projection (behind a flat picture, at the rim of a whole sphere, at a pole) the
//! test never passes: halving ends at [`LEAST_SPAN_RAD`], and the last piece is left out. An equirectangular image continues across its left and
//! right borders, so its seam is not a jump: a piece that touches a border is drawn on both sides.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::arc::Arc;
use crate::view::projection::{BoundingCone, PlaneMapping, Projection};

/// Greatest distance of a piece from its curve.
pub const TOLERANCE_PX: f64 = 0.05;
/// Greatest length of a piece, so that no bend is missed between the tested points.
const MOST_SPAN_RAD: f64 = PI / 32.0;
/// Initial number of pieces of an arc.
const FIRST_SPAN_RAD: f64 = PI / 4.0;
/// Shorter pieces are not halved.
const LEAST_SPAN_RAD: f64 = 1e-8;
/// Distance beyond the border up to which lines are kept, pixels.
const BORDER_PX: f64 = 16.0;
/// The shortest piece that may be a jump, pixels.
const JUMP_PX: f64 = 1.0;

/// A straight piece of a line in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Both ends, continuous pixel coordinates.
    pub ends: [DVec2; 2],
    /// Inverse distance at both ends, 1/m.
    pub nearness: [f64; 2],
}

/// A point of an arc.
#[derive(Clone, Copy, Debug)]
struct Sample {
    angle: f64,
    /// View axes.
    direction: DVec3,
    pixel: Option<DVec2>,
}

/// Traces arcs into one image.
pub struct Tracer<'a> {
    mapping: &'a dyn PlaneMapping,
    /// Maps the arcs' axes to view axes.
    map: &'a dyn Fn(DVec3) -> DVec3,
    size: DVec2,
    /// Width of an image that continues at its sides, pixels.
    wrap_px: Option<f64>,
    margin_px: f64,
    /// Visible cone, and greatest change of angles by the map; `None` if the change is large.
    cone: Option<BoundingCone>,
    pieces: Vec<Piece>,
}

impl<'a> Tracer<'a> {
    /// Creates a tracer. Lines farther than `margin_px` from the image are left out. `map` maps arcs to view axes, and changes angles by at most
    /// `bends_rad`: 0 for a rotation, `None` for any amount.
    pub fn new(
        projection: &'a Projection,
        margin_px: f64,
        map: &'a dyn Fn(DVec3) -> DVec3,
        bends_rad: Option<f64>,
    ) -> Self {
        let mapping = projection.mapping();
        let [width, height] = mapping.size().map(f64::from);
        Self {
            mapping,
            map,
            size: DVec2::new(width, height),
            wrap_px: matches!(projection, Projection::Equirectangular(_)).then_some(width),
            margin_px,
            cone: bends_rad.map(|bends_rad| {
                let cone = mapping.bounding_cone(margin_px);
                BoundingCone { half_angle_rad: cone.half_angle_rad + bends_rad, ..cone }
            }),
            pieces: Vec::new(),
        }
    }

    /// Pieces of an arc.
    pub fn trace(&mut self, arc: &Arc) -> Vec<Piece> {
        let [from, to] = arc.angles;
        let count = ((to - from) / FIRST_SPAN_RAD).ceil().max(1.0);
        let sample_at = |index: f64| self.sample(arc, from + (to - from) * index / count);
        let ends: Vec<Sample> = (0..=count as usize).map(|index| sample_at(index as f64)).collect();
        for ends in ends.windows(2) {
            self.halve(arc, ends[0], ends[1]);
        }
        std::mem::take(&mut self.pieces)
    }

    fn sample(&self, arc: &Arc, angle: f64) -> Sample {
        let direction = (self.map)(arc.direction(angle));
        Sample { angle, direction, pixel: self.mapping.pixel_from_direction(direction) }
    }

    /// The pixel, shifted to the copy of the image in which it is nearest to `to`.
    fn near(&self, pixel: DVec2, to: DVec2) -> DVec2 {
        match self.wrap_px {
            Some(width) => DVec2::new(pixel.x - width * ((pixel.x - to.x) / width).round(), pixel.y),
            None => pixel,
        }
    }

    /// Whether the image of a piece with these points is outside the picture, even if it bulges by `bulge_px` beyond them.
    fn is_outside(&self, points: &[DVec2], bulge_px: f64) -> bool {
        let margin = DVec2::splat(self.margin_px + bulge_px);
        let least = points.iter().copied().fold(DVec2::INFINITY, DVec2::min) - margin;
        let most = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max) + margin;
        let sides = self.wrap_px.is_none() && (least.x > self.size.x || most.x < 0.0);
        sides || least.y > self.size.y || most.y < 0.0
    }

    fn halve(&mut self, arc: &Arc, a: Sample, b: Sample) {
        let span = b.angle - a.angle;
        let middle = self.sample(arc, a.angle + span / 2.0);
        if let Some(cone) = self.cone {
            let reach = cone.half_angle_rad + arc.radius() * span / 2.0 + 1e-9;
            if reach < PI && cone.axis.dot(middle.direction) < reach.cos() {
                return;
            }
        }
        let last = span <= LEAST_SPAN_RAD;
        if span <= MOST_SPAN_RAD {
            match (a.pixel, middle.pixel, b.pixel) {
                (None, None, None) => return,
                (Some(start), Some(m), Some(end)) => {
                    let m = self.near(m, start);
                    let end = self.near(end, m);
                    let bulge_px = distance_to_chord(m, start, end);
                    if self.is_outside(&[start, m, end], 2.0 * bulge_px) {
                        return;
                    }
                    let straight = is_on_chord(m, start, end, 0.5)
                        && [0.25, 0.75].into_iter().all(|part| {
                            let pixel = self.sample(arc, a.angle + span * part).pixel;
                            pixel.is_some_and(|pixel| is_on_chord(self.near(pixel, m), start, end, part))
                        });
                    if straight || (last && start.distance(end) < JUMP_PX) {
                        self.add([start, end], [a.angle, b.angle].map(|angle| arc.nearness(angle)));
                        return;
                    }
                }
                _ => {}
            }
            if last {
                return;
            }
        }
        self.halve(arc, a, middle);
        self.halve(arc, middle, b);
    }

    fn add(&mut self, [mut start, mut end]: [DVec2; 2], nearness: [f64; 2]) {
        let Some(width) = self.wrap_px else {
            self.push([start, end], nearness);
            return;
        };
        let turns = ((start.x + end.x) / 2.0 / width).floor() * width;
        start.x -= turns;
        end.x -= turns;
        for shift in [0.0, width, -width] {
            let ends = [start, end].map(|point| point + DVec2::new(shift, 0.0));
            let (least, most) = (ends[0].x.min(ends[1].x), ends[0].x.max(ends[1].x));
            if shift == 0.0 || (least - self.margin_px < width && most + self.margin_px > 0.0) {
                self.push(ends, nearness);
            }
        }
    }

    /// Adds the part of a piece within [`BORDER_PX`] of the visible area, so that all coordinates are in range of f32.
    fn push(&mut self, [start, end]: [DVec2; 2], nearness: [f64; 2]) {
        let margin = DVec2::splat(self.margin_px + BORDER_PX);
        let (least, most) = (-margin, self.size + margin);
        let along = end - start;
        let mut parts = [0.0_f64, 1.0];
        for axis in 0..2 {
            if along[axis] == 0.0 {
                if !(least[axis]..=most[axis]).contains(&start[axis]) {
                    return;
                }
                continue;
            }
            let crossings = [least[axis], most[axis]].map(|border| (border - start[axis]) / along[axis]);
            parts[0] = parts[0].max(crossings[0].min(crossings[1]));
            parts[1] = parts[1].min(crossings[0].max(crossings[1]));
        }
        if parts[0] > parts[1] {
            return;
        }
        let ends = parts.map(|part| if part == 1.0 { end } else { start + along * part });
        let between = |part: f64| {
            if nearness[0] == nearness[1] { nearness[0] } else { nearness[0] + (nearness[1] - nearness[0]) * part }
        };
        self.pieces.push(Piece { ends, nearness: parts.map(between) });
    }
}

fn distance_to_chord(point: DVec2, start: DVec2, end: DVec2) -> f64 {
    let chord = end - start;
    let part = (point - start).dot(chord) / chord.length_squared().max(1e-300);
    point.distance(start + chord * part.clamp(0.0, 1.0))
}

/// Whether a point of a curve is near the curve's chord, and at about the fraction `part` of the way along the chord.
fn is_on_chord(point: DVec2, start: DVec2, end: DVec2, part: f64) -> bool {
    let chord = end - start;
    let along = (point - start).dot(chord) / chord.length_squared().max(1e-300);
    let short = chord.length() < TOLERANCE_PX;
    distance_to_chord(point, start, end) <= TOLERANCE_PX && (short || (along - part).abs() <= 0.2)
}

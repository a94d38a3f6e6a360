//! Text: glyphs as bitmaps of exact coverage.
//!
//! The outline of a glyph is placed, rotated and filled by area, for each quarter of a pixel and each 1024th of a turn; the bitmap is then placed on
//! whole pixels. Text next to lines has a dark edge, which is drawn first, so that the text is readable on any background. Text next to a direction
//! is upright towards the camera's +y axis, so that it is readable all around a dome.

use std::{collections::HashMap, f64::consts::TAU};

use ab_glyph::{Font, GlyphId, OutlineCurve};
use ab_glyph_rasterizer::{Point, Rasterizer};
use glam::{DVec2, DVec3};

use super::{Drawing, Eye, Ink, OverlayPlanError, Shape};
use crate::{
    scene::overlay::{Colour, font},
    view::projection::Projection,
};

/// Steps per turn.
const TURNS: f64 = 1024.0;
/// Sub-pixel positions of a glyph, along each axis.
const PLACES: f64 = 4.0;
/// Maximum number of bitmaps that are kept from frame to frame.
const MOST_KEPT: usize = 8192;
/// Width of the dark edge as a fraction of the font's height, and its minimum, pixels.
const EDGE: f64 = 0.1;
const LEAST_EDGE_PX: f64 = 1.5;
/// Opacity of the dark edge, as a fraction of the text's.
const EDGE_OPACITY: f64 = 0.75;
/// Step along the upward direction, to find the image of this direction, rad.
const UP_STEP_RAD: f64 = 1e-4;

/// Position of text relative to its anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Above and to the right of the anchor.
    Beside {
        /// Gap along both axes of the text, pixels.
        gap_px: f64,
    },
    /// Centred on the anchor.
    Centred,
}

/// A line of text.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Characters.
    pub text: &'a str,
    /// Height of the font, pixels.
    pub size_px: f64,
    /// Colour and opacity.
    pub ink: Ink,
    /// Inverse distance, 1/m.
    pub nearness: f64,
    /// Position relative to its anchor.
    pub place: Place,
    /// Whether it has a dark edge.
    pub edged: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    glyph: u16,
    /// Bits of the size.
    size: u64,
    turn: u16,
    place: [u8; 2],
    /// Whether it is the dark edge under the glyph.
    edge: bool,
}

/// Coverage of a glyph.
#[derive(Clone, Debug, Default, PartialEq)]
struct Bitmap {
    /// First column and row, relative to the pixel of the pen.
    from: [i32; 2],
    size: [u32; 2],
    coverage: Vec<u8>,
}

/// Cached bitmaps of glyphs.
#[derive(Debug, Default)]
pub struct GlyphCache {
    bitmaps: HashMap<Key, Bitmap>,
    /// First texel in the plan under construction.
    first_texels: HashMap<Key, u32>,
}

impl GlyphCache {
    /// Begins a plan.
    pub(super) fn begin(&mut self) {
        self.first_texels.clear();
        if self.bitmaps.len() > MOST_KEPT {
            self.bitmaps.clear();
        }
    }
}

/// Right and up axes of text that is rotated clockwise from upright by an angle.
fn text_axes(turn_rad: f64) -> [DVec2; 2] {
    let (sin, cos) = turn_rad.sin_cos();
    [DVec2::new(cos, sin), DVec2::new(sin, -cos)]
}

/// Widens a bitmap by `reach_px` on all sides.
fn widened(inner: &Bitmap, reach_px: f64) -> Bitmap {
    let margin = reach_px.ceil() as i32;
    let size = inner.size.map(|side| side + 2 * margin as u32);
    let mut coverage = vec![0_u8; (size[0] * size[1]) as usize];
    for (index, &covered) in inner.coverage.iter().enumerate().filter(|(_, covered)| **covered > 0) {
        let (x, y) = (index as i32 % inner.size[0] as i32, index as i32 / inner.size[0] as i32);
        for dy in -margin..=margin {
            for dx in -margin..=margin {
                let share = (reach_px + 0.5 - f64::from(dx).hypot(f64::from(dy))).clamp(0.0, 1.0);
                let index = (y + margin + dy) as usize * size[0] as usize + (x + margin + dx) as usize;
                coverage[index] = coverage[index].max((f64::from(covered) * share).round() as u8);
            }
        }
    }
    Bitmap { from: inner.from.map(|first| first - margin), size, coverage }
}

fn bitmap(key: Key) -> Bitmap {
    if key.edge {
        let inner = bitmap(Key { edge: false, ..key });
        let reach_px = (EDGE * f64::from_bits(key.size)).max(LEAST_EDGE_PX);
        return if inner.coverage.is_empty() { inner } else { widened(&inner, reach_px) };
    }
    let font = font();
    let Some(outline) = font.outline(GlyphId(key.glyph)) else { return Bitmap::default() };
    let scale = f64::from_bits(key.size) / f64::from(font.units_per_em().unwrap_or(1000.0));
    let [right, up] = text_axes(f64::from(key.turn) / TURNS * TAU);
    let pen = DVec2::from_array(key.place.map(|place| f64::from(place) / PLACES));
    let placed = |point: &ab_glyph::Point| pen + (right * f64::from(point.x) + up * f64::from(point.y)) * scale;
    let controls = |curve: &OutlineCurve| match curve {
        OutlineCurve::Line(a, b) => vec![placed(a), placed(b)],
        OutlineCurve::Quad(a, b, c) => vec![placed(a), placed(b), placed(c)],
        OutlineCurve::Cubic(a, b, c, d) => vec![placed(a), placed(b), placed(c), placed(d)],
    };
    let curves: Vec<Vec<DVec2>> = outline.curves.iter().map(controls).collect();
    let all = || curves.iter().flatten().copied();
    let least = all().fold(DVec2::INFINITY, DVec2::min).floor();
    let most = all().fold(DVec2::NEG_INFINITY, DVec2::max).ceil();
    if !(least.is_finite() && most.is_finite()) {
        return Bitmap::default();
    }
    let size = (most - least).max(DVec2::ONE).as_uvec2().to_array();
    let mut rasterizer = Rasterizer::new(size[0] as usize, size[1] as usize);
    let local = |point: DVec2| Point { x: (point.x - least.x) as f32, y: (point.y - least.y) as f32 };
    for curve in &curves {
        match curve[..] {
            [a, b] => rasterizer.draw_line(local(a), local(b)),
            [a, b, c] => rasterizer.draw_quad(local(a), local(b), local(c)),
            [a, b, c, d] => rasterizer.draw_cubic(local(a), local(b), local(c), local(d)),
            _ => {}
        }
    }
    let mut coverage = vec![0; size[0] as usize * size[1] as usize];
    rasterizer.for_each_pixel(|index, covered| coverage[index] = (covered.clamp(0.0, 1.0) * 255.0).round() as u8);
    Bitmap { from: least.as_ivec2().to_array(), size, coverage }
}

/// Width of a text, pixels.
pub fn width_px(text: &str, size_px: f64) -> f64 {
    let font = font();
    let units: f64 = text.chars().map(|one| f64::from(font.h_advance_unscaled(font.glyph_id(one)))).sum();
    units * size_px / f64::from(font.units_per_em().unwrap_or(1000.0))
}

/// A line of upright text, independent of an image.
#[derive(Clone, Debug)]
pub struct Line {
    glyphs: Vec<(i32, Bitmap)>,
}

impl Line {
    /// The line with the given height, pixels. Characters that the font lacks are drawn as the font's box.
    pub fn new(text: &str, size_px: f64) -> Self {
        let font = font();
        let scale = size_px / f64::from(font.units_per_em().unwrap_or(1000.0));
        let mut pen_px = 0.0;
        let mut glyphs = Vec::new();
        for character in text.chars() {
            let glyph = font.glyph_id(character);
            let place = (pen_px * PLACES).round() / PLACES;
            let within = ((place - place.floor()) * PLACES) as u8;
            let key = Key { glyph: glyph.0, size: size_px.to_bits(), turn: 0, place: [within, 0], edge: false };
            glyphs.push((place.floor() as i32, bitmap(key)));
            pen_px += f64::from(font.h_advance_unscaled(glyph)) * scale;
        }
        Self { glyphs }
    }

    /// Columns and rows from its start on the baseline, and the coverage of each pixel, 0 to 255.
    pub fn pixels(&self) -> impl Iterator<Item = (i32, i32, u8)> {
        self.glyphs.iter().flat_map(|(pen, bitmap)| {
            let width = bitmap.size[0].max(1) as usize;
            let place = move |index: usize| [(index % width) as i32, (index / width) as i32];
            bitmap.coverage.iter().enumerate().map(move |(index, covered)| {
                let [x, y] = place(index);
                (pen + bitmap.from[0] + x, bitmap.from[1] + y, *covered)
            })
        })
    }
}

/// Height of capitals as a fraction of the font's height.
const CAPITALS: f64 = 0.73;

impl Drawing<'_> {
    /// Draws text next to an apparent direction in view axes (of any length but 0).
    pub(super) fn text_at(&mut self, eye: &Eye<'_>, direction: DVec3, run: &Run<'_>) -> Result<(), OverlayPlanError> {
        let mapping = eye.viewport.projection.mapping();
        let direction = direction.normalize();
        let Some(anchor) = mapping.pixel_from_direction(direction) else { return Ok(()) };
        let up = eye.up - direction * eye.up.dot(direction);
        let above = mapping.pixel_from_direction((direction + up.normalize_or_zero() * UP_STEP_RAD).normalize());
        let upward = above.map_or(DVec2::ZERO, |above| above - anchor);
        // At the zenith no direction is up: use that of the image.
        let turn_rad =
            if up.length() < 1e-6 || upward.length_squared() == 0.0 { 0.0 } else { upward.x.atan2(-upward.y) };
        self.text(eye, anchor, turn_rad, run)
    }

    /// Draws text next to a position in the image, rotated clockwise.
    pub(super) fn text(
        &mut self,
        eye: &Eye<'_>,
        anchor: DVec2,
        turn_rad: f64,
        run: &Run<'_>,
    ) -> Result<(), OverlayPlanError> {
        let [width, height] = eye.viewport.size().map(f64::from);
        let length_px = width_px(run.text, run.size_px);
        let reach = length_px + 2.0 * run.size_px;
        let inside =
            |pixel: DVec2| pixel.x > -reach && pixel.x < width + reach && pixel.y > -reach && pixel.y < height + reach;
        if !inside(anchor) {
            return Ok(());
        }
        let turn = (turn_rad / TAU * TURNS).round().rem_euclid(TURNS);
        let [right, up] = text_axes(turn / TURNS * TAU);
        let start = anchor
            + match run.place {
                Place::Beside { gap_px } => (right + up) * gap_px,
                Place::Centred => right * (-length_px / 2.0) - up * (CAPITALS / 2.0 * run.size_px),
            };
        // In an image without left and right borders, text that crosses one side continues at the opposite side.
        let wraps = matches!(eye.viewport.projection, Projection::Equirectangular(_));
        for edge in [true, false] {
            if edge && !run.edged {
                continue;
            }
            self.next_stroke();
            for shift in if wraps { &[0.0, 1.0, -1.0][..] } else { &[0.0] } {
                let shifted = start + DVec2::new(shift * width, 0.0);
                if *shift == 0.0 || inside(shifted) {
                    self.glyphs_of(shifted, turn as u16, right, run, edge)?;
                }
            }
        }
        Ok(())
    }

    fn glyphs_of(
        &mut self,
        start: DVec2,
        turn: u16,
        right: DVec2,
        run: &Run<'_>,
        edge: bool,
    ) -> Result<(), OverlayPlanError> {
        let font = font();
        let scale = run.size_px / f64::from(font.units_per_em().unwrap_or(1000.0));
        let ink = if edge { Ink { colour: Colour([0; 3]), opacity: EDGE_OPACITY * run.ink.opacity } } else { run.ink };
        let mut pen = start;
        for character in run.text.chars() {
            let glyph = font.glyph_id(character);
            let place = (pen * PLACES).round() / PLACES;
            let pixel = place.floor();
            let within = ((place - pixel) * PLACES).to_array().map(|part| part as u8);
            let key = Key { glyph: glyph.0, size: run.size_px.to_bits(), turn, place: within, edge };
            let bitmap = self.glyphs.bitmaps.entry(key).or_insert_with(|| bitmap(key));
            if !bitmap.coverage.is_empty() {
                let first_texel = *self.glyphs.first_texels.entry(key).or_insert_with(|| {
                    let first = self.texels.len() as u32;
                    self.texels.extend_from_slice(&bitmap.coverage);
                    first
                });
                let (from, size) = (bitmap.from, bitmap.size);
                let from = [pixel.x as i32 + from[0], pixel.y as i32 + from[1]];
                self.push(ink, Shape::Glyph { from, size, first_texel, nearness: run.nearness })?;
            }
            pen += right * (f64::from(font.h_advance_unscaled(glyph)) * scale);
        }
        Ok(())
    }
}

//! Ground truth: the sky in f64. The light of every star is spread by an exact kernel, and every pixel receives the
//! light that falls into its exact solid angle, in any projection.
//!
//! - *Point*: all light goes to the pixel that contains the star's direction (shared if it lies on a border).
//! - *Spread*: a [`PointSpread`] integrated over the pixel by Gauss-Legendre quadrature of the kernel times the area
//!   element |d dir/du x d dir/dv| of the mapping. The weights of the nodes are scaled so that they sum to the pixel's
//!   closed-form solid angle: a constant sky is exact, and the remaining error of the kernel's mean over the pixel is
//!   below 1e-7.
//!
//! The axes of a spread are those of the view, transported along the great circle from the optical axis to the star.
//!
//! The picture is divided recursively into rectangles down to 8 x 8 pixels; each rectangle passes on the stars that may reach it, which are found
//! with a cone around its directions. Only the directions of a mapping are used, so wraps, poles, rims and the edges of a cube need no special
//! treatment. Every pixel sums its stars in a fixed order, so that the picture does not depend on the number of threads.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::stars::{
    point_spread::{FIVE_POINTS, PointSpread},
    splat::{Eye, ReferenceImage, SeenStar, seen_by},
};
use crate::{
    catalogue::chunks::StarSet,
    photometry::blackbody::rec709_in_gamut,
    view::projection::{PlaneMapping, pixel_centre},
};

/// A star as an eye sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyStar {
    /// Unit direction in view space.
    pub direction: DVec3,
    /// Illuminance at the eye in linear Rec. 709, lx.
    pub rgb_lx: [f64; 3],
}

/// How stars are spread.
#[derive(Clone, Copy)]
pub enum SkyKernel<'a> {
    /// Not spread.
    Point,
    /// Spread by a function on the sphere.
    Spread(&'a dyn PointSpread),
}

/// Returns the stars of a set that are at least as bright as `faintest_lx` for the eye. A star at the exact position of the eye has no direction and
/// is left out.
pub fn stars_for(set: &StarSet, eye: Eye, faintest_lx: f64) -> Vec<SkyStar> {
    let brighter = |star: &SeenStar| star.illuminance_lx >= faintest_lx;
    let coloured = |star: SeenStar| SkyStar {
        direction: star.direction.normalize(),
        rgb_lx: rec709_in_gamut(star.temperature_k).map(|channel| channel * star.illuminance_lx),
    };
    seen_by(set, eye).filter(brighter).map(coloured).collect()
}

/// Draws stars in the picture of a mapping.
pub fn draw(stars: &[SkyStar], mapping: &dyn PlaneMapping, kernel: SkyKernel<'_>) -> ReferenceImage {
    match kernel {
        SkyKernel::Point => draw_points(stars, mapping),
        SkyKernel::Spread(spread) => draw_spread(stars, mapping, spread),
    }
}

fn black(mapping: &dyn PlaneMapping) -> ReferenceImage {
    let size = mapping.size();
    ReferenceImage { size, illuminance_lx: vec![[0.0; 3]; size[0] as usize * size[1] as usize], stars: 0 }
}

/// Returns the pixel that contains a point. The pixels on both sides share a point that lies on a border within f64 accuracy: otherwise rounding
/// could place it beyond the edges of both of two cube faces.
fn point(centre: DVec2) -> Vec<(i64, i64, f64)> {
    let axis = |at: f64| {
        let border = at.round();
        if (at - border).abs() < 1e-9 {
            vec![(border as i64 - 1, 0.5), (border as i64, 0.5)]
        } else {
            vec![(at.floor() as i64, 1.0)]
        }
    };
    let (columns, rows) = (axis(centre.x), axis(centre.y));
    rows.iter().flat_map(|(y, wy)| columns.iter().map(move |(x, wx)| (*x, *y, wx * wy))).collect()
}

fn draw_points(stars: &[SkyStar], mapping: &dyn PlaneMapping) -> ReferenceImage {
    let mut image = black(mapping);
    for some in stars.chunks(1 << 16) {
        let taps: Vec<_> = some.par_iter().map(|star| mapping.taps(&point, star.direction)).collect();
        for (star, taps) in some.iter().zip(taps) {
            image.stars += u64::from(!taps.is_empty());
            for tap in taps {
                let pixel = &mut image.illuminance_lx[tap.y as usize * image.size[0] as usize + tap.x as usize];
                add(pixel, star.rgb_lx, [tap.weight; 3]);
            }
        }
    }
    image
}

fn add(sum: &mut [f64; 3], light: [f64; 3], weight: [f64; 3]) {
    for c in 0..3 {
        sum[c] += light[c] * weight[c];
    }
}

/// Side of the smallest rectangles.
const LEAF: u32 = 8;
/// Larger rectangles are processed by several threads.
const SHARED: u32 = 32;

#[derive(Clone, Copy)]
struct Rect {
    x: [u32; 2],
    y: [u32; 2],
}

impl Rect {
    fn width(self) -> u32 {
        self.x[1] - self.x[0]
    }

    fn height(self) -> u32 {
        self.y[1] - self.y[0]
    }

    fn longest(self) -> u32 {
        self.width().max(self.height())
    }

    fn halves(self) -> [Self; 2] {
        let middle = |[from, to]: [u32; 2]| from + (to - from) / 2;
        if self.width() >= self.height() {
            let m = middle(self.x);
            [Self { x: [self.x[0], m], ..self }, Self { x: [m, self.x[1]], ..self }]
        } else {
            let m = middle(self.y);
            [Self { y: [self.y[0], m], ..self }, Self { y: [m, self.y[1]], ..self }]
        }
    }

    fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        (self.y[0]..self.y[1]).flat_map(move |y| (self.x[0]..self.x[1]).map(move |x| (x, y)))
    }
}

/// A finished rectangle: the light of its pixels, row by row.
struct Block {
    rect: Rect,
    light_lx: Vec<[f64; 3]>,
}

struct Painter<'a> {
    mapping: &'a dyn PlaneMapping,
    stars: &'a [SkyStar],
    /// For each star: rotation from view axes to axes in which the star is at -z.
    star_from_view: Vec<DQuat>,
    spread: &'a dyn PointSpread,
    reached: Vec<AtomicBool>,
}

fn draw_spread(stars: &[SkyStar], mapping: &dyn PlaneMapping, spread: &dyn PointSpread) -> ReferenceImage {
    let painter = Painter {
        mapping,
        stars,
        star_from_view: stars
            .par_iter()
            .map(|star| DQuat::from_rotation_arc(DVec3::NEG_Z, star.direction).conjugate())
            .collect(),
        spread,
        reached: stars.iter().map(|_| AtomicBool::new(false)).collect(),
    };
    let mut image = black(mapping);
    let [width, height] = image.size;
    let all = (0..stars.len() as u32).collect();
    for block in painter.paint(Rect { x: [0, width], y: [0, height] }, all) {
        for ((x, y), light_lx) in block.rect.pixels().zip(block.light_lx) {
            image.illuminance_lx[y as usize * width as usize + x as usize] = light_lx;
        }
    }
    image.stars = painter.reached.iter().filter(|reached| reached.load(Relaxed)).count() as u64;
    image
}

/// Returns the angle between unit vectors, rad, accurate for both small and large angles.
pub(super) fn separation_rad(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a - b).length().atan2((a + b).length())
}

impl Painter<'_> {
    fn paint(&self, rect: Rect, mut candidates: Vec<u32>) -> Vec<Block> {
        if let Some((axis, half_angle_rad)) = self.cone(rect) {
            let reach = half_angle_rad + self.spread.radius_rad();
            if reach < std::f64::consts::PI {
                let least = reach.cos() - 1e-12;
                candidates.retain(|star| self.stars[*star as usize].direction.dot(axis) >= least);
            }
        }
        if candidates.is_empty() {
            return Vec::new();
        }
        if rect.longest() <= LEAF {
            let light_lx = rect.pixels().map(|(x, y)| self.pixel(x, y, &candidates)).collect();
            return vec![Block { rect, light_lx }];
        }
        let [first, second] = rect.halves();
        let copy = candidates.clone();
        let (mut blocks, others) = if rect.longest() > SHARED {
            rayon::join(|| self.paint(first, candidates), || self.paint(second, copy))
        } else {
            (self.paint(first, candidates), self.paint(second, copy))
        };
        blocks.extend(others);
        blocks
    }

    /// Returns a cone that contains every direction of a rectangle; `None` if it is undetermined.
    fn cone(&self, rect: Rect) -> Option<(DVec3, f64)> {
        const PARTS: u32 = 4;
        let direction_at = |i: u32, j: u32| {
            let part =
                |[from, to]: [u32; 2], k: u32| f64::from(from) + f64::from(to - from) * f64::from(k) / f64::from(PARTS);
            self.mapping.direction_from_pixel(DVec2::new(part(rect.x, i), part(rect.y, j)))
        };
        let mut grid = Vec::new();
        for j in 0..=PARTS {
            for i in 0..=PARTS {
                grid.push(direction_at(i, j)?);
            }
        }
        let axis = grid.iter().sum::<DVec3>().try_normalize()?;
        let row = PARTS as usize + 1;
        // Points between the grid points are no farther from one of them than its diagonal neighbour.
        let mut slack = 0.0_f64;
        for j in 0..PARTS as usize {
            for i in 0..PARTS as usize {
                let corner = |di: usize, dj: usize| grid[(j + dj) * row + i + di];
                for (a, b) in [((0, 0), (1, 1)), ((1, 0), (0, 1)), ((0, 0), (1, 0)), ((0, 0), (0, 1))] {
                    slack = slack.max(separation_rad(corner(a.0, a.1), corner(b.0, b.1)));
                }
            }
        }
        let farthest = grid.iter().map(|direction| separation_rad(*direction, axis)).fold(0.0, f64::max);
        Some((axis, farthest + slack))
    }

    /// Returns the light of a pixel.
    fn pixel(&self, x: u32, y: u32, candidates: &[u32]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let Some(pixel) = Pixel::new(self.mapping, x, y) else { return sum };
        let reach = pixel.radius_rad + self.spread.radius_rad();
        // Fewer nodes suffice if the pixel is small compared with the kernel: the error remains below 1e-7 (see the
        // tests).
        let extent = pixel.radius_rad * std::f64::consts::SQRT_2 / self.spread.detail_rad();
        let nodes = match extent {
            e if e <= 0.1 => Some(pixel.nodes(&TWO_POINTS)),
            e if e <= 1.0 => Some(pixel.nodes(&FIVE_POINTS)),
            _ => None,
        };
        for &index in candidates {
            let star = &self.stars[index as usize];
            if separation_rad(star.direction, pixel.centre) > reach {
                continue;
            }
            let to_star = Toward { star_from_view: self.star_from_view[index as usize], spread: self.spread };
            let share = match &nodes {
                Some(nodes) => to_star.sum(nodes),
                None => pixel.divided(&to_star, star.direction),
            };
            if share != [0.0; 3] {
                self.reached[index as usize].store(true, Relaxed);
                add(&mut sum, star.rgb_lx, share);
            }
        }
        sum
    }
}

/// Two-point Gauss-Legendre quadrature over [-1, 1].
const TWO_POINTS: [(f64, f64); 2] = [(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];

/// A kernel around a star.
struct Toward<'a> {
    star_from_view: DQuat,
    spread: &'a dyn PointSpread,
}

impl Toward<'_> {
    fn per_sr(&self, direction: DVec3) -> [f64; 3] {
        let seen = self.star_from_view * direction;
        let across = DVec2::new(seen.x, seen.y);
        let sine = across.length();
        let offset = if sine > 0.0 { across * (sine.atan2(-seen.z) / sine) } else { DVec2::ZERO };
        self.spread.per_sr(offset)
    }

    fn sum(&self, nodes: &[(DVec3, f64)]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (direction, weight) in nodes {
            add(&mut sum, self.per_sr(*direction), [*weight; 3]);
        }
        sum
    }
}

/// A pixel of the picture.
pub(super) struct Pixel<'a> {
    mapping: &'a dyn PlaneMapping,
    corner: DVec2,
    pub(super) centre: DVec3,
    solid_angle_sr: f64,
    /// Largest angle from the centre to a point of the pixel.
    pub(super) radius_rad: f64,
}

impl<'a> Pixel<'a> {
    /// Returns `None` outside of the picture.
    pub(super) fn new(mapping: &'a dyn PlaneMapping, x: u32, y: u32) -> Option<Self> {
        let solid_angle_sr = mapping.solid_angle_sr(x, y);
        let position = pixel_centre(x, y);
        let centre = mapping.direction_from_pixel(position).filter(|_| solid_angle_sr > 0.0)?;
        let corners = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)];
        // At a rim some corners have no direction; the square root of the solid angle is a lower bound there.
        let radius_rad = corners
            .iter()
            .filter_map(|(u, v)| mapping.direction_from_pixel(position + DVec2::new(*u, *v)))
            .map(|direction| separation_rad(direction, centre))
            .fold(solid_angle_sr.sqrt(), f64::max);
        let corner = DVec2::new(f64::from(x), f64::from(y));
        Some(Self { mapping, corner, centre, solid_angle_sr, radius_rad })
    }

    /// Returns the directions, and area elements times weights, over a square of the pixel. `from` is the upper left corner of the square in [0,
    /// 1]^2.
    pub(super) fn cell(&self, rule: &[(f64, f64)], from: DVec2, side: f64) -> Vec<(DVec3, f64)> {
        let mut nodes = Vec::with_capacity(rule.len() * rule.len());
        // Well below the distance of the outermost node from the edge.
        let h = (0.02 * side).min(1e-3);
        for (v, weight_v) in rule {
            for (u, weight_u) in rule {
                let position = self.corner + from + DVec2::new(0.5 + u / 2.0, 0.5 + v / 2.0) * side;
                let direction = |dx: f64, dy: f64| self.mapping.direction_from_pixel(position + DVec2::new(dx, dy));
                // Nodes beyond a rim are skipped.
                if let (Some(middle), Some(right), Some(left), Some(down), Some(up)) =
                    (direction(0.0, 0.0), direction(h, 0.0), direction(-h, 0.0), direction(0.0, h), direction(0.0, -h))
                {
                    let area = (right - left).cross(down - up).length() / (4.0 * h * h);
                    nodes.push((middle, area * weight_u * weight_v * side * side / 4.0));
                }
            }
        }
        nodes
    }

    /// Returns the direction of the centre of a square of the pixel; `None` beyond a rim.
    pub(super) fn middle(&self, from: DVec2, side: f64) -> Option<DVec3> {
        self.mapping.direction_from_pixel(self.corner + from + DVec2::splat(side / 2.0))
    }

    /// Returns the directions over the whole pixel; their weights sum to its solid angle.
    fn nodes(&self, rule: &[(f64, f64)]) -> Vec<(DVec3, f64)> {
        let mut nodes = self.cell(rule, DVec2::ZERO, 1.0);
        let sum: f64 = nodes.iter().map(|(_, weight)| weight).sum();
        if sum > 0.0 {
            for (_, weight) in &mut nodes {
                *weight *= self.solid_angle_sr / sum;
            }
            nodes
        } else {
            vec![(self.centre, self.solid_angle_sr)]
        }
    }

    /// Returns the integral of a kernel with detail finer than the pixel: squares near the star are subdivided to the scale of the detail.
    fn divided(&self, kernel: &Toward<'_>, star: DVec3) -> [f64; 3] {
        let sum: f64 = self.cell(&FIVE_POINTS, DVec2::ZERO, 1.0).iter().map(|(_, weight)| weight).sum();
        let scale = if sum > 0.0 { self.solid_angle_sr / sum } else { 1.0 };
        self.divide(kernel, star, DVec2::ZERO, 1.0).map(|share| share * scale)
    }

    fn divide(&self, kernel: &Toward<'_>, star: DVec3, from: DVec2, side: f64) -> [f64; 3] {
        let radius_rad = self.radius_rad * side;
        let middle = self.middle(from, side);
        if middle.is_some_and(|middle| separation_rad(middle, star) > 1.5 * radius_rad + kernel.spread.radius_rad()) {
            return [0.0; 3];
        }
        // At a rim, where the distance to the star is unknown, the limit on the side ends the recursion.
        let fine = radius_rad * std::f64::consts::SQRT_2 <= kernel.spread.detail_rad();
        if fine || (middle.is_none() && side < 0.02) {
            return kernel.sum(&self.cell(&FIVE_POINTS, from, side));
        }
        let half = side / 2.0;
        let mut sum = [0.0; 3];
        for quarter in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
            add(&mut sum, self.divide(kernel, star, from + quarter * half, half), [1.0; 3]);
        }
        sum
    }
}

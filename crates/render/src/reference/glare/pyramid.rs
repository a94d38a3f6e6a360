//! The published glare pyramids in f64: the twin of the shaders in `shaders/glare/pyramid/`. It does not round, so a comparison of the two shows the
//! error of half floats.
//!
//! The published behaviour is kept unchanged: luminance is blurred, not illuminance; sources outside of the picture
//! contribute nothing; beyond the picture its border pixels are repeated; round pictures are surrounded by black; flat
//! pictures mirror light from behind the eye; nothing crosses the edge of a cube face or the date line.
//!
//! Units: cd/m^2, radians; positions are relative to the sides of a level.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::{
    plan::{
        glare::pyramid::{PyramidAxes, PyramidPlan, tap_weights, texel_px},
        settings::PyramidWeights,
    },
    view::projection::{Projection, pixel_centre},
};

/// A level: colours row by row.
struct Level {
    size: [u32; 2],
    texels: Vec<DVec3>,
}

impl Level {
    /// Builds a level; `colour` takes column and row.
    fn new(size: [u32; 2], colour: impl Fn(u32, u32) -> DVec3 + Sync) -> Self {
        let [width, height] = size;
        let texels = (0..width * height).into_par_iter().map(|index| colour(index % width, index / width)).collect();
        Self { size, texels }
    }

    /// Returns the position of a texel's centre.
    fn place(size: [u32; 2], x: u32, y: u32) -> DVec2 {
        pixel_centre(x, y) / sides(size)
    }

    /// Returns a texel; outside the level, the nearest one on its border.
    fn texel(&self, x: f64, y: f64) -> DVec3 {
        let last = sides(self.size) - 1.0;
        let (x, y) = (x.clamp(0.0, last.x) as usize, y.clamp(0.0, last.y) as usize);
        self.texels[y * self.size[0] as usize + x]
    }

    /// Sums 4 x 4 texels around a position, weighted with the product of one weight per axis; `of_part` returns the four weights of an axis.
    fn lookup(&self, place: DVec2, weights_for: impl Fn(f64) -> [f64; 4]) -> DVec3 {
        let texel_place = place * sides(self.size) - 0.5;
        let (first, part) = (texel_place.floor(), texel_place - texel_place.floor());
        let (across, down) = (weights_for(part.x), weights_for(part.y));
        let mut sum = DVec3::ZERO;
        for (j, weight_y) in (0..).zip(down) {
            for (i, weight_x) in (0..).zip(across) {
                if weight_x * weight_y > 0.0 {
                    let texel = self.texel(first.x + f64::from(i) - 1.0, first.y + f64::from(j) - 1.0);
                    sum += weight_x * weight_y * texel;
                }
            }
        }
        sum
    }

    fn bilinear(&self, place: DVec2) -> DVec3 {
        self.lookup(place, |t| [0.0, 1.0 - t, t, 0.0])
    }

    /// Returns the cubic B-spline with the texels as coefficients.
    fn cubic(&self, place: DVec2) -> DVec3 {
        let outer = |t: f64| t * t * t / 6.0;
        let inner = |t: f64| (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0;
        self.lookup(place, |t| [outer(1.0 - t), inner(t), inner(1.0 - t), outer(t)])
    }
}

fn sides([width, height]: [u32; 2]) -> DVec2 {
    DVec2::new(f64::from(width), f64::from(height))
}

/// Returns the unit tangents of the great circles through a direction along which it is blurred.
fn tangents(d: DVec3) -> [DVec3; 2] {
    // A rotation about +x goes up or down.
    let upwards = DVec3::X.cross(d);
    let outwards = DVec3::Z - d * d.z;
    let radial = if d.y < 0.0 { -outwards } else { outwards };
    // The published mixture of the two: it is entirely radial more than 30 degrees above or below the centre.
    let mixed = upwards.lerp(radial, (2.0 * d.y.abs()).min(1.0));
    let first = if mixed.length_squared() > 1e-12 { mixed.normalize() } else { DVec3::Y };
    [first, first.cross(d)]
}

/// Returns the image of a tap relative to the sides, if it has one.
fn image_of(projection: &Projection, covered: DVec2, direction: DVec3) -> Option<DVec2> {
    let flat = matches!(projection, Projection::Perspective(_) | Projection::CubeFace(_));
    let direction = if flat && direction.z > 0.0 { -direction } else { direction };
    projection.mapping().pixel_from_direction(direction).map(|pixel| pixel / covered)
}

/// Returns the light scattered towards every pixel, cd/m^2, row by row from the top: `light`, spread over the picture. Places without a pixel are
/// black. `light` has one value per pixel of the picture; those outside of a round picture are treated as black.
pub fn scattered(
    projection: &Projection,
    light: &[[f64; 3]],
    axes: PyramidAxes,
    weights: PyramidWeights,
) -> Vec<[f64; 3]> {
    let mapping = projection.mapping();
    let [width, height] = mapping.size();
    let plan = PyramidPlan::new(mapping.size());
    // Each texel of level 0 covers 2 x 2 pixels. If a side is odd, the last texels extend beyond the picture.
    let covered = 2.0 * sides(plan.sizes[0]);
    let pixel = |x: u32, y: u32| {
        let (x, y) = (x.min(width - 1), y.min(height - 1));
        if mapping.contains(x, y) { DVec3::from_array(light[(y * width + x) as usize]) } else { DVec3::ZERO }
    };
    let base = Level::new(plan.sizes[0], |x, y| {
        let (x, y) = (2 * x, 2 * y);
        (pixel(x, y) + pixel(x + 1, y) + pixel(x, y + 1) + pixel(x + 1, y + 1)) / 4.0
    });
    let mut levels: Vec<Level> = Vec::new();
    for (level, size) in plan.sizes.iter().enumerate() {
        let step_rad = projection.middle_pixel_rad() * texel_px(level);
        let blurred = |from: &Level, axis: usize| {
            Level::new(*size, |x, y| blur(projection, (axes, axis), step_rad, from, (*size, x, y), covered))
        };
        let between = blurred(levels.last().unwrap_or(&base), 0);
        levels.push(blurred(&between, 1));
    }
    let weights = plan.level_weights(weights);
    let combined = Level::new(plan.sizes[0], |x, y| {
        let place = Level::place(plan.sizes[0], x, y);
        levels.iter().zip(&weights).map(|(level, weight)| *weight * level.cubic(place)).sum()
    });
    let towards = Level::new([width, height], |x, y| {
        if mapping.contains(x, y) { combined.bilinear(pixel_centre(x, y) / covered) } else { DVec3::ZERO }
    });
    towards.texels.iter().map(DVec3::to_array).collect()
}

/// Blurs one texel along the first or the second axis.
fn blur(
    projection: &Projection,
    (axes, axis): (PyramidAxes, usize),
    step_rad: f64,
    from: &Level,
    (size, x, y): ([u32; 2], u32, u32),
    covered: DVec2,
) -> DVec3 {
    let place = Level::place(size, x, y);
    let weights = tap_weights();
    let aside = weights.len() as i32 - 1;
    let taps = (-aside..=aside).map(|k| (f64::from(k), weights[k.unsigned_abs() as usize]));
    match axes {
        PyramidAxes::Screen => {
            let step = [DVec2::X, DVec2::Y][axis] / sides(size);
            taps.map(|(k, weight)| weight * from.bilinear(place + k * step)).sum()
        }
        PyramidAxes::View => {
            let Some(direction) = projection.mapping().direction_from_pixel(place * covered) else {
                return DVec3::ZERO;
            };
            let tangent = tangents(direction)[axis];
            taps.filter_map(|(k, weight)| {
                let tap = direction * (k * step_rad).cos() + tangent * (k * step_rad).sin();
                image_of(projection, covered, tap).map(|place| weight * from.bilinear(place))
            })
            .sum()
        }
    }
}

/// Adds glare to a picture: `fraction` of the light is scattered. Pixels as for [`scattered`].
pub fn with_glare(
    projection: &Projection,
    light: &[[f64; 3]],
    (axes, weights): (PyramidAxes, PyramidWeights),
    fraction: f64,
) -> Vec<[f64; 3]> {
    let scattered = scattered(projection, light, axes, weights);
    let mix = |drawn: f64, scattered: f64| (1.0 - fraction) * drawn + fraction * scattered;
    light.iter().zip(scattered).map(|(drawn, towards)| std::array::from_fn(|c| mix(drawn[c], towards[c]))).collect()
}

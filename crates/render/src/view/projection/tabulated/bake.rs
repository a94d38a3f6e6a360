//! Baking: computes and checks the directions and solid angles of all pixels of a mapping, and of the fringe around
//! them.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    super::{PlaneMapping, check_size, pixel_centre, warp::triangle_sr},
    error::TabulationError,
    nodes::{FRINGE, Nodes, node_counts, pixel_of_place},
    pole::{self, Sides},
    rows::by_rows,
};

/// Maximum number of pixels along a side of a tabulated picture.
pub const MOST_SIDE_PX: u32 = 16_384;
/// Largest allowed distance between a pixel's centre and the image of its direction (round trip through the mapping),
/// pixels.
pub(super) const INVERSE_PX: f64 = 0.01;
/// Largest allowed relative difference between a pixel's solid angle and the solid angle that its directions span.
const SOLID_ANGLE_PARTS: f64 = 0.1;
/// Step for the central differences of a pixel's solid angle per unit area, pixels.
const DENSITY_STEP_PX: f64 = 1e-3;
/// If the mean direction, weighted by solid angle, is shorter than this, the picture shows most of the sphere, as a fisheye of more than 210 degrees
/// does.
const NO_MEAN: f64 = 0.37;
/// Number of rings of the fringe that may be extrapolated if the mapping is not defined there.
const MADE_UP_RINGS: i64 = 3;

const NEIGHBOURS: [[i64; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// Offsets of the midpoints of a pixel's sides: right, left, below, above.
const SIDES: [DVec2; 4] = [DVec2::new(0.5, 0.0), DVec2::new(-0.5, 0.0), DVec2::new(0.0, 0.5), DVec2::new(0.0, -0.5)];

/// Baked data of the pixels of a picture.
pub(super) struct Baked {
    pub(super) nodes: Nodes,
    /// Number of pixels in the picture.
    pub(super) pixels: u64,
    /// Sum of their solid angles, and the smallest one, sr.
    pub(super) sum_sr: f64,
    pub(super) least_sr: f64,
    /// Minimum and maximum of the longer sides of pixels, and minimum of the shorter sides, rad.
    pub(super) longer_rad: [f64; 2],
    pub(super) shortest_rad: f64,
    /// Mean direction, weighted by solid angle; -z if the mean vanishes.
    pub(super) axis: DVec3,
    /// Greatest angle from the axis to a pixel's centre, and to a node of the fringe, rad.
    pub(super) reach_rad: [f64; 2],
}

/// A pixel of the picture.
#[derive(Clone, Copy)]
struct Pixel {
    direction: DVec3,
    solid_angle_sr: f64,
    /// Longer and shorter side, rad.
    sides_rad: [f64; 2],
    /// Whether the picture is mirrored here, as if the sphere were seen from outside; `None` if undetermined.
    mirrored: Option<bool>,
}

/// Whether a value is within a limit; false for NaN.
pub(super) fn is_within(value: f64, limit: f64) -> bool {
    value <= limit
}

/// Longer and shorter side of the parallelogram of two derivatives: the singular values of their matrix.
pub(super) fn singular_values(along_x: DVec3, along_y: DVec3) -> [f64; 2] {
    let (xx, yy, xy) = (along_x.length_squared(), along_y.length_squared(), along_x.dot(along_y));
    let larger = ((xx + yy + (xx - yy).hypot(2.0 * xy)) / 2.0).sqrt();
    [larger, along_x.cross(along_y).length() / larger.max(1e-300)]
}

/// Directions at the midpoints of the sides of a square around a point of the picture, in the order of [`SIDES`]; `side_px`: its side.
fn directions_around(mapping: &dyn PlaneMapping, pixel: DVec2, side_px: f64) -> [Option<DVec3>; 4] {
    let direction = |side: DVec2| mapping.direction_from_pixel(pixel + side * side_px);
    [direction(SIDES[0]), direction(SIDES[1]), direction(SIDES[2]), direction(SIDES[3])]
}

/// Derivatives of the direction at a point of the picture, per pixel: central differences, one-sided at a border.
pub(super) fn derivatives(mapping: &dyn PlaneMapping, pixel: DVec2) -> Option<[DVec3; 2]> {
    differences(mapping.direction_from_pixel(pixel)?, directions_around(mapping, pixel, 1.0))
}

/// The same derivatives, from the directions at the point and around it.
fn differences(middle: DVec3, [right, left, below, above]: [Option<DVec3>; 4]) -> Option<[DVec3; 2]> {
    let along = |ahead: Option<DVec3>, behind: Option<DVec3>| match (ahead, behind) {
        (Some(ahead), Some(behind)) => Some(ahead - behind),
        (Some(ahead), None) => Some((ahead - middle) * 2.0),
        (None, Some(behind)) => Some((middle - behind) * 2.0),
        (None, None) => None,
    };
    Some([along(right, left)?, along(below, above)?])
}

/// Whether a solid angle is in a range, with a tolerance of [`SOLID_ANGLE_PARTS`].
fn is_alike(solid_angle_sr: f64, [least_sr, most_sr]: [f64; 2]) -> bool {
    ((1.0 - SOLID_ANGLE_PARTS) * least_sr..=(1.0 + SOLID_ANGLE_PARTS) * most_sr).contains(&solid_angle_sr)
}

/// Solid angle per unit area at a pixel's centre, sr. If it changes fast from pixel to pixel, it differs from that of the whole pixel; both are
/// accepted.
fn density_sr(source: &dyn PlaneMapping, centre: DVec2) -> Option<f64> {
    let [right, left, below, above] = directions_around(source, centre, DENSITY_STEP_PX);
    Some((right? - left?).cross(below? - above?).length() / DENSITY_STEP_PX.powi(2))
}

/// Solid angle of the polygon through the corners of a pixel and the midpoints of its sides, sr. It is exact if the map is flat between these points
/// and the centre, whose direction is `middle`.
fn outlined_sr(source: &dyn PlaneMapping, centre: DVec2, middle: DVec3) -> Option<f64> {
    const OUTLINE: [[f64; 2]; 8] =
        [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5], [-0.5, 0.5], [-0.5, 0.0], [-0.5, -0.5], [0.0, -0.5], [0.5, -0.5]];
    let mut corners = [DVec3::ZERO; 8];
    for (corner, offset) in corners.iter_mut().zip(OUTLINE) {
        *corner = source.direction_from_pixel(centre + DVec2::from(offset))?;
    }
    Some((0..8).map(|i| triangle_sr(middle, corners[i], corners[(i + 1) % 8])).sum::<f64>().abs())
}

fn pixel_at(source: &dyn PlaneMapping, x: u32, y: u32) -> Result<Option<Pixel>, TabulationError> {
    if !source.contains(x, y) {
        return Ok(None);
    }
    let value = |what: String| TabulationError::Value { pixel: [x, y], what };
    let centre = pixel_centre(x, y);
    let direction = source
        .direction_from_pixel(centre)
        .ok_or_else(|| value("it lies in the picture, but its centre has no direction".to_owned()))?;
    if !is_within((direction.length() - 1.0).abs(), 1e-6) {
        return Err(value(format!("its direction {direction} is not a unit vector")));
    }
    let solid_angle_sr = source.solid_angle_sr(x, y);
    if !(solid_angle_sr.is_finite() && solid_angle_sr >= 0.0) {
        return Err(value(format!("its solid angle is {solid_angle_sr} sr")));
    }
    let image = source.pixel_from_direction(direction).unwrap_or(DVec2::NAN);
    if !is_within(image.distance(centre), INVERSE_PX) {
        return Err(TabulationError::NotInverse { pixel: [x, y], image: image.to_array() });
    }
    let mut pixel = Pixel { direction, solid_angle_sr, sides_rad: [solid_angle_sr.sqrt(); 2], mirrored: None };
    let around = directions_around(source, centre, 1.0);
    if let Some([along_x, along_y]) = differences(direction, around) {
        let spanned = along_x.cross(along_y);
        pixel.sides_rad = singular_values(along_x, along_y);
        pixel.mirrored = Some(spanned.dot(direction) < 0.0);
        let whole = around.iter().all(Option::is_some);
        let spanned_sr = spanned.length();
        if whole && !is_alike(solid_angle_sr, [spanned_sr; 2]) {
            let others = [density_sr(source, centre), outlined_sr(source, centre, direction)].into_iter().flatten();
            let range = others.fold([spanned_sr; 2], |[least, most], sr| [least.min(sr), most.max(sr)]);
            if !is_alike(solid_angle_sr, range) {
                return Err(TabulationError::SolidAngle { pixel: [x, y], given_sr: solid_angle_sr, spanned_sr });
            }
        }
    }
    // A pixel without solid angle is not part of the picture.
    Ok((solid_angle_sr > 0.0).then_some(pixel))
}

/// Computes and checks the directions and solid angles of a mapping.
pub(super) fn bake(source: &(dyn PlaneMapping + Send)) -> Result<Baked, TabulationError> {
    let size = source.size();
    check_size(size)?;
    let [width, height] = size;
    if width > MOST_SIDE_PX || height > MOST_SIDE_PX {
        return Err(TabulationError::TooLarge { width, height, limit: MOST_SIDE_PX });
    }
    // Check every pixel.
    let rows = by_rows(height, |y| (0..width).map(|x| pixel_at(source, x, y)).collect::<Result<Vec<_>, _>>());
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for row in rows {
        pixels.extend(row?);
    }
    let in_picture = || pixels.iter().flatten();
    let count = in_picture().count() as u64;
    if count == 0 {
        return Err(TabulationError::Empty);
    }
    // All pixels must have the same orientation.
    let mirrored = in_picture().find_map(|pixel| pixel.mirrored);
    let folded =
        |pixel: &Option<Pixel>| pixel.is_some_and(|pixel| pixel.mirrored.is_some() && pixel.mirrored != mirrored);
    if let Some(index) = pixels.iter().position(folded) {
        return Err(TabulationError::Folded { pixel: [index as u32 % width, index as u32 / width] });
    }
    // The solid angles of a full sphere must sum to 4 pi.
    let sum_sr = in_picture().map(|pixel| pixel.solid_angle_sr).sum::<f64>();
    if source.shows_full_sphere() && !is_within((sum_sr / (4.0 * PI) - 1.0).abs(), 0.02) {
        return Err(TabulationError::NotFullSphere { sum_sr });
    }
    // Bounding cone of the picture and of its fringe.
    let mean = in_picture().map(|pixel| pixel.direction * pixel.solid_angle_sr).sum::<DVec3>() / sum_sr;
    let axis = if mean.length() > NO_MEAN {
        mean.normalize()
    } else {
        let middle = || source.direction_from_pixel(DVec2::from(size.map(f64::from)) / 2.0);
        let opposite = || pole::pole(&slivers(source, &pixels)).map(|pole| -pole);
        let of_sphere = || if mean.length() > 0.05 { mean } else { middle().unwrap_or(DVec3::NEG_Z) };
        let own = if source.shows_full_sphere() { None } else { opposite() };
        own.unwrap_or_else(of_sphere).normalize_or(DVec3::NEG_Z)
    };
    let directions = with_fringe(source, &pixels);
    let angle_to = |direction: DVec3| axis.angle_between(direction);
    let reach_rad = [
        pixels.par_iter().flatten().map(|pixel| angle_to(pixel.direction)).reduce(|| 0.0, f64::max),
        directions.par_iter().flatten().map(|direction| angle_to(*direction)).reduce(|| 0.0, f64::max),
    ];
    let least = |value_of: fn(&Pixel) -> f64| in_picture().map(value_of).fold(f64::INFINITY, f64::min);
    let longest_rad = in_picture().map(|pixel| pixel.sides_rad[0]).fold(0.0, f64::max);
    Ok(Baked {
        pixels: count,
        sum_sr,
        least_sr: least(|pixel| pixel.solid_angle_sr),
        longer_rad: [least(|pixel| pixel.sides_rad[0]), longest_rad],
        shortest_rad: least(|pixel| pixel.sides_rad[1]),
        axis,
        reach_rad,
        nodes: nodes(size, &pixels, &directions),
    })
}

/// The pixels that are slivers.
fn slivers(source: &dyn PlaneMapping, pixels: &[Option<Pixel>]) -> Vec<Sides> {
    let width = source.size()[0] as usize;
    let found = pixels.iter().enumerate().filter_map(|(number, pixel)| {
        let pixel = pixel.filter(|pixel| pole::is_sliver(pixel.sides_rad))?;
        let centre = pixel_centre((number % width) as u32, (number / width) as u32);
        Some((pixel.direction, derivatives(source, centre)?))
    });
    found.collect()
}

/// Directions at all nodes: those of the pixels, then those of the fringe, ring by ring.
fn with_fringe(source: &dyn PlaneMapping, pixels: &[Option<Pixel>]) -> Vec<Option<DVec3>> {
    let size = source.size();
    let [columns, rows] = node_counts(size);
    let mut directions = vec![None; (columns * rows) as usize];
    let index = move |[x, y]: [i64; 2]| {
        ((0..columns).contains(&x) && (0..rows).contains(&y)).then_some((y * columns + x) as usize)
    };
    let mut last: Vec<[i64; 2]> = Vec::new();
    for (number, pixel) in pixels.iter().enumerate() {
        let Some(pixel) = pixel else { continue };
        let (x, y) = (number as i64 % i64::from(size[0]) + FRINGE, number as i64 / i64::from(size[0]) + FRINGE);
        directions[(y * columns + x) as usize] = Some(pixel.direction);
        last.push([x, y]);
    }
    for ring in 1..=FRINGE {
        let mut next: Vec<[i64; 2]> = last
            .iter()
            .flat_map(|[x, y]| NEIGHBOURS.map(|[i, j]| [x + i, y + j]))
            .filter(|node| index(*node).is_some_and(|index| directions[index].is_none()))
            .collect();
        next.sort_unstable();
        next.dedup();
        let held = |node: [i64; 2]| index(node).and_then(|index| directions[index]);
        let found: Vec<_> = next
            .par_iter()
            .filter_map(|node| {
                let guess = continued(*node, &held)?;
                let pixel = pixel_of_place(DVec2::new(node[0] as f64, node[1] as f64));
                let direction = on_source(source, pixel, guess).or((ring <= MADE_UP_RINGS).then_some(guess))?;
                Some((*node, direction))
            })
            .collect();
        last = found.iter().map(|(node, _)| *node).collect();
        for (node, direction) in found {
            if let Some(index) = index(node) {
                directions[index] = Some(direction);
            }
        }
    }
    directions
}

/// Extrapolates the direction of a node from its neighbours. It uses parabolas through three nodes, averaged over all sides that have three;
/// otherwise lines through two nodes, or else the nearest node.
fn continued([x, y]: [i64; 2], held: &impl Fn([i64; 2]) -> Option<DVec3>) -> Option<DVec3> {
    for order in [3, 2, 1] {
        let mut sum = DVec3::ZERO;
        for [i, j] in NEIGHBOURS {
            let neighbour = |step: i64| held([x + step * i, y + step * j]);
            let extrapolated = || {
                Some(match order {
                    3 => neighbour(1)? * 3.0 - neighbour(2)? * 3.0 + neighbour(3)?,
                    2 => neighbour(1)? * 2.0 - neighbour(2)?,
                    _ => neighbour(1)?,
                })
            };
            sum += extrapolated().unwrap_or_default();
        }
        if let Some(direction) = sum.try_normalize() {
            return Some(direction);
        }
    }
    None
}

/// The direction whose image is `pixel`, if the mapping continues beyond its picture: Newton steps from a nearby
/// direction.
fn on_source(source: &dyn PlaneMapping, pixel: DVec2, near: DVec3) -> Option<DVec3> {
    let mut direction = near;
    for _ in 0..6 {
        let image = source.pixel_from_direction(direction)?;
        let missing = pixel - image;
        if missing.length() < 1e-6 {
            return Some(direction);
        }
        let (right, up) = direction.any_orthonormal_pair();
        let step = 1e-6;
        let slope = |along: DVec3| {
            let ahead = source.pixel_from_direction((direction + along * step).normalize())?;
            Some((ahead - image) / step)
        };
        let (a, b) = (slope(right)?, slope(up)?);
        let determinant = a.perp_dot(b);
        let turn = right * (missing.perp_dot(b) / determinant) + up * (a.perp_dot(missing) / determinant);
        // A large step means that the start is on the other side of a cut.
        if !is_within(turn.length(), 0.3) {
            return None;
        }
        direction = (direction + turn).normalize();
    }
    None
}

fn nodes(size: [u32; 2], pixels: &[Option<Pixel>], directions: &[Option<DVec3>]) -> Nodes {
    let [columns, _] = node_counts(size);
    let mut values: Vec<[f32; 4]> = directions
        .iter()
        .map(|direction| {
            let [x, y, z] = direction.unwrap_or_default().as_vec3().to_array();
            [x, y, z, 0.0]
        })
        .collect();
    for (number, pixel) in pixels.iter().enumerate() {
        let Some(pixel) = pixel else { continue };
        let (x, y) = (number as i64 % i64::from(size[0]), number as i64 / i64::from(size[0]));
        let solid_angle_sr = (pixel.solid_angle_sr as f32).max(f32::MIN_POSITIVE);
        values[((y + FRINGE) * columns + x + FRINGE) as usize][3] = solid_angle_sr;
    }
    Nodes { size, values }
}

//! Scoring scenes: small artificial skies whose correct picture is known, each with its rig.
//!
//! Camera axes are world axes; stars are at infinity. Many stars share one image, each in its own cell and at its own
//! position within a pixel, so that a thousand positions cost one frame. The pixels at the centre of the picture are as
//! large as those of a view of 1080 pixels and 60 degrees, so that anything drawn at a fixed angle has its usual size
//! in pixels.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    ChartError,
    workloads::{FLAT_FOV_Y_RAD, cubemap, projection_of, rig_of},
};
use crate::{
    catalogue::{StarRecord, chunks::StarSet},
    metrics::sub_pixel_positions,
    scene::{Camera, SceneSnapshot},
    units::{SOLAR_TEMPERATURE_K, illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
    view::{Rig, ViewKind, projection::PlaneMapping},
};

/// Height of the view that defines the pixel size of the scenes.
const PIXELS_OF_HEIGHT: f64 = 1080.0;
/// Apparent magnitude of a star of the sweep at the centre of the picture.
const SWEEP_MAGNITUDE: f64 = 4.0;

/// Field of view of the narrow sweep: 4 degrees.
const SWEEP_FOV_RAD: f64 = 0.07;

/// A star of a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Unit vector.
    pub direction: DVec3,
    /// Position in the picture, continuous pixel coordinates.
    pub pixel: DVec2,
    /// Illuminance at the eye, lx.
    pub illuminance_lx: f64,
}

/// A scene with its view.
pub(super) struct Scene {
    pub rig: Rig,
    pub snapshot: SceneSnapshot,
    pub stars: Vec<Placed>,
    /// Seed of the order in which the stars reach the GPU; `None`: the default order.
    pub order: Option<u64>,
}

impl Scene {
    fn new(rig: Rig, records: Vec<StarRecord>, stars: Vec<Placed>) -> Self {
        Self { rig, snapshot: still(records), stars, order: None }
    }

    /// Returns the mapping of the only image.
    pub fn mapping(&self) -> &dyn PlaneMapping {
        projection_of(&self.rig).mapping()
    }
}

/// Returns a scene of these stars, seen from the barycentre along the world axes.
fn still(records: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot {
        revision: 1,
        stars: StarSet::from_records(records).into(),
        objects: Default::default(),
        camera: Camera::default(),
    }
}

fn record(direction: DVec3, magnitude: f32, temperature_k: f32) -> StarRecord {
    StarRecord { position: direction, magnitude, temperature_k, distance_known: false }
}

/// Returns a flat view of `size` pixels whose pixels are as large as those of the usual view.
pub(super) fn usual_view(size: [u32; 2]) -> Result<Rig, ChartError> {
    let pixel = 2.0 * (FLAT_FOV_Y_RAD / 2.0).tan() / PIXELS_OF_HEIGHT;
    let fov_y_rad = 2.0 * (f64::from(size[1]) / 2.0 * pixel).atan();
    Ok(rig_of(vec![("score", ViewKind::Perspective { size, fov_y_rad })])?)
}

/// Returns the centres of the cells that divide an image.
fn cell_middles([width, height]: [u32; 2], cell_px: u32) -> Vec<DVec2> {
    let middle = |index: u32| (f64::from(index) + 0.5) * f64::from(cell_px);
    (0..height / cell_px)
        .flat_map(|row| (0..width / cell_px).map(move |column| DVec2::new(middle(column), middle(row))))
        .collect()
}

/// Places a star at every pixel position; `magnitude` gets the index and the position.
fn placed(
    rig: Rig,
    pixels: impl Iterator<Item = DVec2>,
    magnitude: impl Fn(usize, DVec2, &dyn PlaneMapping) -> f64,
) -> Scene {
    let mapping = projection_of(&rig).mapping();
    let (mut records, mut stars) = (Vec::new(), Vec::new());
    for (index, pixel) in pixels.enumerate() {
        let Some(direction) = mapping.direction_from_pixel(pixel) else { continue };
        let magnitude = magnitude(index, pixel, mapping) as f32;
        let illuminance_lx = illuminance_lx_from_magnitude(f64::from(magnitude));
        records.push(record(direction, magnitude, SOLAR_TEMPERATURE_K));
        stars.push(Placed { direction, pixel, illuminance_lx });
    }
    Scene::new(rig, records, stars)
}

/// Stars at the sub-pixel positions of a pan. All have the same luminance: their light divided by the solid angle of their pixel. The second value is
/// this luminance in cd/m^2. Every page has different positions.
///
/// In a `narrow` view, kernels defined in pixels have the same shape everywhere, so stars differ only by their sub-pixel position. Stars with a
/// constant angular size are scored in the usual view, where they have their usual small size.
pub(super) fn sweep(image_px: u32, cell_px: u32, page: usize, narrow: bool) -> Result<(Scene, f64), ChartError> {
    let rig = if narrow {
        rig_of(vec![("score", ViewKind::Perspective { size: [image_px; 2], fov_y_rad: SWEEP_FOV_RAD })])?
    } else {
        usual_view([image_px; 2])?
    };
    let cells = cell_middles([image_px; 2], cell_px);
    let solid_angle = |pixel: DVec2, mapping: &dyn PlaneMapping| {
        mapping.solid_angle_sr(pixel.x.floor() as u32, pixel.y.floor() as u32)
    };
    let middle = solid_angle(DVec2::splat(f64::from(image_px) / 2.0), projection_of(&rig).mapping());
    let luminance = illuminance_lx_from_magnitude(SWEEP_MAGNITUDE) / middle;
    let positions = sub_pixel_positions((page + 1) * cells.len()).skip(page * cells.len());
    let pixels: Vec<DVec2> = cells.iter().zip(positions).map(|(cell, position)| cell.floor() + position).collect();
    let scene = placed(rig, pixels.into_iter(), |_, pixel, mapping| {
        magnitude_from_illuminance_lx(luminance * solid_angle(pixel, mapping))
    });
    Ok((scene, luminance))
}

/// Stars of magnitudes 2 to 5 from the centre of a flat view to its corners.
pub(super) fn grid(size: [u32; 2], fov_y_rad: f64, cell_px: u32) -> Result<Scene, ChartError> {
    let rig = rig_of(vec![("score", ViewKind::Perspective { size, fov_y_rad })])?;
    let cells = cell_middles(size, cell_px);
    let pixels: Vec<DVec2> =
        cells.iter().zip(sub_pixel_positions(cells.len())).map(|(cell, position)| cell.floor() + position).collect();
    Ok(placed(rig, pixels.into_iter(), |index, _, _| 2.0 + (index % 4) as f64))
}

/// Stars 45 degrees off the axis of a flat view of 110 degrees, all around.
pub(super) fn ring(image_px: u32, cell_px: u32) -> Result<Scene, ChartError> {
    let fov_y_rad = 110f64.to_radians();
    let rig = rig_of(vec![("score", ViewKind::Perspective { size: [image_px; 2], fov_y_rad })])?;
    let middle = f64::from(image_px) / 2.0;
    // The tangent of 45 degrees is 1, so the radius in pixels is the distance of the image plane.
    let radius = middle / (fov_y_rad / 2.0).tan();
    let count = (TAU * radius / f64::from(cell_px)).floor().max(4.0) as u32;
    let position = |index: u32| {
        let angle = (f64::from(index) + 0.37) * TAU / f64::from(count);
        DVec2::splat(middle) + radius * DVec2::from_angle(angle)
    };
    Ok(placed(rig, (0..count).map(position), |_, _, _| SWEEP_MAGNITUDE))
}

/// Temperatures of the two stars that share a pixel, K.
pub(super) const PAIR_K: [f32; 2] = [3000.0, 20_000.0];

/// Returns a scene of two equally bright stars with the temperatures [`PAIR_K`] at each of 16 positions.
pub(super) fn pairs(cell_px: u32) -> Result<Scene, ChartError> {
    let size = [4 * cell_px; 2];
    let rig = usual_view(size)?;
    let cells = cell_middles(size, cell_px);
    let pixels: Vec<DVec2> =
        cells.iter().zip(sub_pixel_positions(cells.len())).map(|(cell, position)| cell.floor() + position).collect();
    let mut scene = placed(rig, pixels.into_iter(), |_, _, _| SWEEP_MAGNITUDE);
    let both = |star: &Placed| PAIR_K.map(|kelvin| record(star.direction, SWEEP_MAGNITUDE as f32, kelvin));
    let records = scene.stars.iter().flat_map(both).collect();
    for star in &mut scene.stars {
        star.illuminance_lx *= 2.0;
    }
    scene.snapshot = still(records);
    Ok(scene)
}

/// Returns a scene of Sirius and a star of magnitude 21 that is two cells away.
pub(super) fn faint_near_bright(cell_px: u32) -> Result<Scene, ChartError> {
    let rig = usual_view([4 * cell_px, 2 * cell_px])?;
    let cell = f64::from(cell_px);
    let pixels = [DVec2::new(cell + 0.3, cell + 0.4), DVec2::new(3.0 * cell + 0.6, cell + 0.2)];
    Ok(placed(rig, pixels.into_iter(), |index, _, _| if index == 0 { -1.46 } else { 21.0 }))
}

/// Side of the picture of [`crowd`], pixels.
pub(super) const CROWD_PX: u32 = 48;

/// Returns a scene of many stars with a range of brightnesses and colours in a small picture.
pub(super) fn crowd(stars: usize) -> Result<Scene, ChartError> {
    let rig = usual_view([CROWD_PX; 2])?;
    let mapping = projection_of(&rig).mapping();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let side = f64::from(CROWD_PX);
    let records: Vec<StarRecord> = (0..stars)
        .filter_map(|_| {
            let pixel = DVec2::new(random.random::<f64>() * side, random.random::<f64>() * side);
            let (magnitude, heat) = (random.random::<f32>(), random.random::<f32>());
            let direction = mapping.direction_from_pixel(pixel)?;
            Some(record(direction, 1.0 + 6.0 * magnitude, 2500.0 * 8f32.powf(heat)))
        })
        .collect();
    Ok(Scene::new(rig, records, Vec::new()))
}

/// Side of the picture of [`heap`], pixels; it holds the widest profile.
const HEAP_PX: u32 = 96;

/// Returns a scene of `stars` equal stars at the centre of one pixel.
pub(super) fn heap(stars: usize) -> Result<Scene, ChartError> {
    let rig = usual_view([HEAP_PX; 2])?;
    let middle = DVec2::splat(f64::from(HEAP_PX / 2) + 0.5);
    Ok(placed(rig, std::iter::repeat_n(middle, stars), |_, _, _| 5.0))
}

/// Radius around a star of [`cube_edges`] without other stars, rad.
pub(super) const EDGE_WINDOW_RAD: f64 = 0.15;

/// Stars on and next to the twelve edges and eight corners of a cubemap.
pub(super) fn cube_edges(face_size: u32) -> Result<Scene, ChartError> {
    let rig = rig_of(vec![("score", cubemap(face_size))])?;
    let mut directions = Vec::new();
    let sides = [-1.0, 1.0];
    for first in sides {
        for second in sides {
            for along in [-0.45, 0.45] {
                directions.push(DVec3::new(first, second, along));
                directions.push(DVec3::new(first, along, second));
                directions.push(DVec3::new(along, first, second));
            }
            for third in sides {
                directions.push(DVec3::new(first, second, third));
            }
        }
    }
    // Offsets of up to one pixel to either side of the edge.
    let pixel = 2.0 / f64::from(face_size);
    let magnitude = SWEEP_MAGNITUDE as f32;
    let illuminance_lx = illuminance_lx_from_magnitude(f64::from(magnitude));
    let (mut records, mut stars) = (Vec::new(), Vec::new());
    for (direction, offset) in directions.iter().zip(sub_pixel_positions(directions.len())) {
        let (a, b) = direction.normalize().any_orthonormal_pair();
        let offset = (2.0 * offset - 1.0) * pixel;
        let direction = (*direction + a * offset.x + b * offset.y).normalize();
        records.push(record(direction, magnitude, SOLAR_TEMPERATURE_K));
        stars.push(Placed { direction, pixel: DVec2::NAN, illuminance_lx });
    }
    Ok(Scene::new(rig, records, stars))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweep_stars_have_equal_luminance_over_their_pixel() {
        let (scene, luminance) = sweep(256, 32, 3, true).unwrap();
        assert_eq!(scene.stars.len(), 64);
        let (mut left, mut right) = (0, 0);
        for star in &scene.stars {
            let omega = scene.mapping().solid_angle_sr(star.pixel.x as u32, star.pixel.y as u32);
            assert!((star.illuminance_lx / omega / luminance - 1.0).abs() < 1e-6);
            let cell = (star.pixel / 32.0).floor() * 32.0 + 16.0;
            assert!((star.pixel - cell).abs().max_element() <= 1.0);
            let position = scene.mapping().pixel_from_direction(star.direction).unwrap();
            assert!((position - star.pixel).length() < 1e-9);
            if star.pixel.x.fract() < 0.5 { left += 1 } else { right += 1 }
        }
        assert!(left > 25 && right > 25);
        let (other, _) = sweep(256, 32, 4, true).unwrap();
        assert!(scene.stars.iter().zip(&other.stars).all(|(a, b)| a.pixel.distance(b.pixel) > 1e-3));
    }

    #[test]
    fn ring_is_45_degrees_off_axis() {
        let scene = ring(256, 32).unwrap();
        assert!(scene.stars.len() > 10);
        for star in &scene.stars {
            assert!((star.direction.angle_between(DVec3::NEG_Z).to_degrees() - 45.0).abs() < 1e-9);
        }
    }

    #[test]
    fn cube_edge_stars_are_separated() {
        let scene = cube_edges(128).unwrap();
        assert_eq!(scene.stars.len(), 32);
        for (index, star) in scene.stars.iter().enumerate() {
            for other in &scene.stars[..index] {
                assert!(star.direction.angle_between(other.direction) > 1.8 * EDGE_WINDOW_RAD);
            }
        }
    }
}

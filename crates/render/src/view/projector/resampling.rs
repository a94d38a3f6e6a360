//! The conventional way to a projector's picture, for comparison: draws a flat or round picture that covers the
//! projector's field, and warps it as a texture. Each pixel is the bilinear interpolation of four pixels of the
//! picture, in linear light. The chart measures the effect on stars.

use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::blend::middles;
use crate::{
    photometry::tone_map::light_of_codes,
    view::projection::{
        Fisheye, FisheyeMapping, Perspective, PlaneMapping, Projection, ProjectionError, TabulatedMapping, pixel_centre,
    },
};

/// Largest angle from the middle at which a flat picture is used. For larger angles a flat picture would waste pixels, so a round one is used.
const WIDEST_FLAT_RAD: f64 = 70.0 * std::f64::consts::PI / 180.0;
/// Width of the margin of the picture around the projector's field, pixels.
const MARGIN_PX: f64 = 2.0;

/// Positions of a projector's pixels in a picture that covers its field.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampling {
    /// The picture.
    pub source: Projection,
    /// Rotation from the picture's axes to those of the view.
    pub view_from_source: DQuat,
    size: [u32; 2],
    /// For each pixel of the projector, row by row from the top: its position in the picture, pixels; NaN if it shows
    /// nothing.
    places: Vec<[f32; 2]>,
    /// Solid angle of each pixel, sr.
    solid_angles_sr: Vec<f32>,
}

impl Resampling {
    /// Builds the resampling of a projector. In the middle of the picture, `scale` pixels are as long as a mean pixel
    /// of the projector.
    ///
    /// # Errors
    ///
    /// The picture is too large or too small.
    pub fn new(mapping: &TabulatedMapping, scale: f64) -> Result<Self, ProjectionError> {
        let size = mapping.size();
        let [width, height] = size.map(|side| side as usize);
        let directions: Vec<Option<DVec3>> = (0..width * height)
            .into_par_iter()
            .map(|index| mapping.direction_from_pixel(pixel_centre((index % width) as u32, (index / width) as u32)))
            .collect();
        let forward = mapping.bounding_cone(0.0).axis;
        // The picture has the orientation that the raster has in its middle.
        let known = |at: usize| directions[at];
        let columns = (0..width).map(|x| (known(height / 4 * width + x), known(3 * height / 4 * width + x)));
        let upwards: DVec3 = columns.filter_map(|(upper, lower)| Some(upper? - lower?)).sum();
        let up = (upwards - forward * forward.dot(upwards)).try_normalize();
        let up = up.unwrap_or_else(|| forward.any_orthonormal_vector());
        let axes = DMat3::from_cols(forward.cross(up), up, -forward);
        let view_from_source = DQuat::from_mat3(&axes);
        let local = |direction: &DVec3| axes.transpose() * *direction;
        let mean_px_rad = (mapping.picture_solid_angle_sr() / mapping.pixels() as f64).sqrt() / scale;
        let widest = directions.iter().flatten().map(|direction| direction.angle_between(forward)).fold(0.0, f64::max);
        // Returns a flat picture of a narrow field, or a fisheye picture of a wide one, with the requested pixel size.
        let source = if widest < WIDEST_FLAT_RAD {
            flat(directions.iter().flatten().map(local), mean_px_rad)?
        } else {
            let side = 2.0 * (widest / mean_px_rad + MARGIN_PX).ceil();
            let fov_rad = (side * mean_px_rad).min(std::f64::consts::TAU);
            Projection::Fisheye(Fisheye::new([side as u32; 2], FisheyeMapping::Equidistant, fov_rad)?)
        };
        // Positions and solid angles of the pixels of the projector.
        let place = |direction: &Option<DVec3>| {
            let pixel = direction.and_then(|direction| source.mapping().pixel_from_direction(local(&direction)));
            pixel.unwrap_or(DVec2::NAN).as_vec2().to_array()
        };
        let places = directions.par_iter().map(place).collect();
        let solid_angles_sr = (0..width * height)
            .into_par_iter()
            .map(|index| mapping.solid_angle_sr((index % width) as u32, (index / width) as u32) as f32)
            .collect();
        Ok(Self { source, view_from_source, size, places, solid_angles_sr })
    }

    /// Width and height of the projector's raster, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// HDR pixels of the projector (R, G, B in cd/m^2, solid angle in sr) from those of the picture.
    pub fn hdr(&self, picture: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let pixels = self.places.par_iter().zip(&self.solid_angles_sr).map(|(place, solid_angle_sr)| {
            let [r, g, b] = self.between(*place, |index| {
                let [r, g, b, _] = picture[index];
                [r, g, b]
            });
            [r, g, b, *solid_angle_sr]
        });
        pixels.collect()
    }

    /// Linear light of a pixel of the projector, in units of display white, from the display codes of the picture.
    pub(super) fn light(&self, picture: &[u8], pixel: usize) -> [f32; 3] {
        let light = light_of_codes();
        self.between(self.places[pixel], |index| [0, 1, 2].map(|c| light[usize::from(picture[4 * index + c])]))
    }

    /// Interpolates between the four pixels around a position; black if there is no position.
    fn between(&self, [x, y]: [f32; 2], value: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
        if x.is_nan() || y.is_nan() {
            return [0.0; 3];
        }
        let [width, height] = self.source.mapping().size().map(|side| side as usize);
        let [([left, right], across), ([upper, lower], down)] =
            [(x, width), (y, height)].map(|(at, side)| middles(f64::from(at), side));
        let [across, down] = [across, down].map(|share| share as f32);
        let row = |y: usize| {
            let [a, b] = [value(y * width + left), value(y * width + right)];
            [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * across)
        };
        let [a, b] = [row(upper), row(lower)];
        [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * down)
    }
}

/// A flat picture that covers directions given in its own axes.
fn flat(directions: impl Iterator<Item = DVec3>, px_rad: f64) -> Result<Projection, ProjectionError> {
    let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for direction in directions {
        let place = direction.truncate() / -direction.z;
        (least, most) = (least.min(place), most.max(place));
    }
    let margin = DVec2::splat(MARGIN_PX * px_rad);
    let (least, most) = (least - margin, most + margin);
    let size = ((most - least) / px_rad).ceil().as_uvec2().to_array();
    let [left, right, up, down] = [least.x, most.x, most.y, least.y].map(f64::atan);
    Ok(Projection::Perspective(Perspective::off_axis(size, left, right, up, down)?))
}

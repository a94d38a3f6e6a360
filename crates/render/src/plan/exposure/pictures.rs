//! Properties of pictures for the exposure: the sizes of their pixels, and directions distributed over them.

use glam::DVec3;

use crate::view::{
    Viewport,
    projection::{Projection, pixel_centre},
};

/// Maximum number of samples along a side of a picture for the size of its mean pixel. With 128 samples, that size is accurate to 1e-3.
const PIXEL_GRID: u32 = 128;
/// Directions along a side of a picture.
const DIRECTION_GRID: u32 = 16;

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Sum of the solid angles of its pixels, sr, and sum of their squares.
    pub pixel_sums: [f64; 2],
    /// Directions, view axes, and the solid angle that each represents, sr.
    pub directions: Vec<(DVec3, f64)>,
}

impl Picture {
    /// The picture of a projection.
    pub fn new(projection: &Projection) -> Self {
        let mapping = projection.mapping();
        let whole_sr = projection.picture_solid_angle_sr();
        let [width, height] = mapping.size();
        let grid = |side: u32, most: u32| {
            let count = side.min(most);
            (0..count).map(move |i| ((f64::from(i) + 0.5) * f64::from(side) / f64::from(count)) as u32)
        };
        let (mut sum, mut squares) = (0.0, 0.0);
        for y in grid(height, PIXEL_GRID) {
            for x in grid(width, PIXEL_GRID) {
                let pixel_sr = mapping.solid_angle_sr(x, y);
                sum += pixel_sr;
                squares += pixel_sr * pixel_sr;
            }
        }
        // If a picture has few pixels, all sampled centres may be outside of it.
        let pixel_sums = if sum > 0.0 { [whole_sr, squares * whole_sr / sum] } else { [whole_sr, whole_sr * whole_sr] };
        let mut directions = Vec::new();
        for y in grid(height, DIRECTION_GRID) {
            for x in grid(width, DIRECTION_GRID) {
                if let Some(direction) = mapping.direction_from_pixel(pixel_centre(x, y)) {
                    directions.push((direction, mapping.solid_angle_sr(x, y)));
                }
            }
        }
        let sampled: f64 = directions.iter().map(|(_, pixel_sr)| pixel_sr).sum();
        for (_, stands_for_sr) in &mut directions {
            *stands_for_sr *= if sampled > 0.0 { whole_sr / sampled } else { 0.0 };
        }
        Self { pixel_sums, directions }
    }
}

/// Pictures by projection, which seldom changes from frame to frame.
#[derive(Default)]
pub struct Pictures {
    held: Vec<(Projection, Picture)>,
}

impl Pictures {
    /// Returns the pictures of all viewports, and removes those of other viewports.
    pub fn for_viewports(&mut self, viewports: &[Viewport]) -> Vec<Picture> {
        self.held.retain(|(projection, _)| viewports.iter().any(|viewport| viewport.projection == *projection));
        viewports
            .iter()
            .map(|viewport| {
                if let Some((_, picture)) = self.held.iter().find(|(held, _)| *held == viewport.projection) {
                    return picture.clone();
                }
                let picture = Picture::new(&viewport.projection);
                self.held.push((viewport.projection.clone(), picture.clone()));
                picture
            })
            .collect()
    }
}

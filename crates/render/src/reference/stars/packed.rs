//! The published rasteriser in f64: the twin of `packed_cas` and `packed_cas_sorted`, without half floats, contention and solid angles from f32
//! triangles. Only the method is the same: a star lights four pixels. Each gets the luminance that the star would have in its central
//! pixel, times a weight. Temperatures are averaged with luminance as weight.

use super::splat::{Eye, seen_by};
use crate::{catalogue::chunks::StarSet, photometry::blackbody::rec709_in_gamut, view::projection::PlaneMapping};

/// Largest temperature that a half float can hold, K.
const MOST_K: f64 = 65_504.0;

/// Returns the luminance in cd/m^2 of every pixel, linear Rec. 709, row by row from the top.
pub fn draw(set: &StarSet, eye: Eye, mapping: &dyn PlaneMapping) -> Vec<[f64; 3]> {
    let [width, height] = mapping.size();
    // Luminance, and luminance times temperature.
    let mut sums = vec![[0.0_f64; 2]; width as usize * height as usize];
    for star in seen_by(set, eye) {
        let Some(image) = mapping.pixel_from_direction(star.direction) else { continue };
        if image.min_element() < 0.0 || !mapping.contains(image.x as u32, image.y as u32) {
            continue;
        }
        let luminance = star.illuminance_lx / mapping.solid_angle_sr(image.x as u32, image.y as u32);
        let first = (image - 0.5).floor();
        let part = image - 0.5 - first;
        for (column, weight_x) in [(first.x, 1.0 - part.x), (first.x + 1.0, part.x)] {
            for (row, weight_y) in [(first.y, 1.0 - part.y), (first.y + 1.0, part.y)] {
                if column >= 0.0 && row >= 0.0 && column < f64::from(width) && row < f64::from(height) {
                    let sum = &mut sums[row as usize * width as usize + column as usize];
                    sum[0] += luminance * weight_x * weight_y;
                    sum[1] += luminance * weight_x * weight_y * star.temperature_k.min(MOST_K);
                }
            }
        }
    }
    let colour = |index: usize, [luminance, weighted_temperature]: [f64; 2]| {
        let inside = mapping.contains(index as u32 % width, index as u32 / width);
        if luminance > 0.0 && inside {
            rec709_in_gamut(weighted_temperature / luminance).map(|channel| channel * luminance)
        } else {
            [0.0; 3]
        }
    };
    sums.into_iter().enumerate().map(|(index, sum)| colour(index, sum)).collect()
}

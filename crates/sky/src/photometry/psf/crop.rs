//! Crops of a texture: the brighter a star, the more of its spikes is visible.
//!
//! A star of illuminance E has the luminance E T / theta^2 on a spike, with T the spike's constant in the
//! inverse-square form. It falls below a threshold L at theta = sqrt(E T / L). The original Godot add-on uses the
//! same rule with constants found by trial and error. Here T is the median, over the outer half of the texture, of
//! the largest value at each distance from the centre: the typical spike. [`CropRule::exact_half_angle_rad`] uses the
//! texture's values instead.
//!
//! Crops are squares around the star, so distances are those to the side of a square, max(|x|, |y|).

use super::{InverseSquare, Psf};
use crate::photometry::rec709::luminance;

/// The crop rule for one texture.
#[derive(Clone, Debug, PartialEq)]
pub struct CropRule {
    /// The spikes' density per steradian times theta^2, as Y: no unit.
    pub spike_constant: f64,
    pixel_rad: f64,
    size: u32,
    /// For each square ring of pixels from the centre outwards: the largest density (Y) in it and beyond, per
    /// steradian.
    largest_from: Vec<f64>,
    /// For each ring, its share of the texture's light.
    light: Vec<f64>,
}

impl CropRule {
    /// Computes the rule for a texture.
    pub fn new(psf: &Psf) -> Self {
        let size = psf.size as usize;
        // Even sizes have no central pixel: ring 0 is then the four central ones.
        let ring_of = |index: usize| {
            let distance = |i: usize| if 2 * i < size { (size - 1) / 2 - i } else { i - size / 2 };
            distance(index % size).max(distance(index / size))
        };
        let rings = size.div_ceil(2);
        let (mut largest, mut light, mut spike) = (vec![0.0_f64; rings], vec![0.0; rings], vec![0.0_f64; rings]);
        let form = InverseSquare::from_psf(psf);
        for (index, (rgb, squared)) in psf.rgb.iter().zip(&form.rgb).enumerate() {
            let (ring, y) = (ring_of(index), luminance(rgb.map(f64::from)));
            largest[ring] = largest[ring].max(y / (psf.pixel_rad * psf.pixel_rad));
            light[ring] += y;
            spike[ring] = spike[ring].max(luminance(squared.map(f64::from)));
        }
        for ring in (0..rings - 1).rev() {
            largest[ring] = largest[ring].max(largest[ring + 1]);
        }
        let mut outer = spike.split_off(rings / 2);
        outer.sort_by(f64::total_cmp);
        Self {
            spike_constant: outer[outer.len() / 2],
            pixel_rad: psf.pixel_rad,
            size: psf.size,
            largest_from: largest,
            light,
        }
    }

    /// Half the side of the square beyond which a star of `illuminance_lx` stays below `threshold_cd_m2`, by the
    /// inverse-square rule; at least one pixel, at most the texture. Radians.
    pub fn half_angle_rad(&self, illuminance_lx: f64, threshold_cd_m2: f64) -> f64 {
        let full = 0.5 * f64::from(self.size) * self.pixel_rad;
        (illuminance_lx * self.spike_constant / threshold_cd_m2).sqrt().min(full).max(self.pixel_rad.min(full))
    }

    /// As [`Self::half_angle_rad`], but from the texture's values: the smallest square of whole pixels such that no
    /// pixel outside reaches the threshold. 0 if no pixel reaches it.
    pub fn exact_half_angle_rad(&self, illuminance_lx: f64, threshold_cd_m2: f64) -> f64 {
        let rings = self.largest_from.partition_point(|density| illuminance_lx * density >= threshold_cd_m2);
        self.outer_edge_rad(rings)
    }

    /// Share of the texture's light outside the square of half side `half_angle_rad`. Pixels on its side count by the
    /// part of their ring's width that is outside.
    pub fn light_outside(&self, half_angle_rad: f64) -> f64 {
        self.light
            .iter()
            .enumerate()
            .map(|(ring, light)| {
                let (inner, outer) = (self.outer_edge_rad(ring), self.outer_edge_rad(ring + 1));
                light * ((outer - half_angle_rad) / (outer - inner)).clamp(0.0, 1.0)
            })
            .sum()
    }

    /// Half the side of the square of the first `rings` rings, radians.
    fn outer_edge_rad(&self, rings: usize) -> f64 {
        let even = self.size.is_multiple_of(2);
        if rings == 0 { 0.0 } else { (rings as f64 - if even { 0.0 } else { 0.5 }) * self.pixel_rad }
    }
}

/// [`CropRule::half_angle_rad`] for a single star; for many stars, make the rule once.
pub fn crop_half_angle_rad(psf: &Psf, illuminance_lx: f64, threshold_cd_m2: f64) -> f64 {
    CropRule::new(psf).half_angle_rad(illuminance_lx, threshold_cd_m2)
}

//! Images for the tests of the metrics: a few stars drawn directly through a mapping, and kernels to draw them with.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::HdrView;
use crate::{
    photometry::rec709::luminance,
    view::projection::{Footprint, PlaneMapping},
};

/// A picture to which stars are added.
pub struct Canvas<'a> {
    mapping: &'a dyn PlaneMapping,
    /// Luminance, cd/m^2.
    pub pixels: Vec<[f64; 3]>,
}

impl<'a> Canvas<'a> {
    pub fn new(mapping: &'a dyn PlaneMapping) -> Self {
        let [width, height] = mapping.size().map(|side| side as usize);
        Self { mapping, pixels: vec![[0.0; 3]; width * height] }
    }

    /// Adds a white star.
    pub fn star(self, direction: DVec3, illuminance_lx: f64, kernel: Footprint<'_>) -> Self {
        self.coloured(direction, [illuminance_lx; 3], kernel)
    }

    /// Adds a star whose light is given per channel, lx.
    pub fn coloured(mut self, direction: DVec3, rgb_lx: [f64; 3], kernel: Footprint<'_>) -> Self {
        assert!(luminance(rgb_lx) > 0.0);
        for tap in self.mapping.taps(kernel, direction) {
            let omega = self.mapping.solid_angle_sr(tap.x, tap.y);
            let pixel = &mut self.pixels[tap.y as usize * self.mapping.size()[0] as usize + tap.x as usize];
            for (channel, lx) in pixel.iter_mut().zip(rgb_lx) {
                *channel += lx * tap.weight / omega;
            }
        }
        self
    }

    pub fn view(&self) -> HdrView<'_> {
        HdrView::new(self.mapping, &self.pixels).expect("drawn light is light")
    }
}

/// Returns a Gaussian sampled at pixel centres, with the given standard deviation along each axis (pixels), cut at 5 deviations and normalised.
pub fn sampled_gaussian(sigma_px: DVec2) -> impl Fn(DVec2) -> Vec<(i64, i64, f64)> {
    let axis = |centre: f64, sigma: f64| {
        let reach = (5.0 * sigma).ceil() as i64;
        let middle = centre.floor() as i64;
        let axis_tap = move |i: i64| (i, (-0.5 * ((i as f64 + 0.5 - centre) / sigma).powi(2)).exp());
        (middle - reach..=middle + reach).map(axis_tap).collect::<Vec<_>>()
    };
    move |centre| normalised_product(&axis(centre.x, sigma_px.x), &axis(centre.y, sigma_px.y))
}

/// Returns a round Gaussian integrated over each of `side` x `side` pixels around the centre, normalised.
pub fn integrated_gaussian(sigma_px: f64, side: i64) -> impl Fn(DVec2) -> Vec<(i64, i64, f64)> {
    let density = move |x: f64| (-0.5 * (x / sigma_px).powi(2)).exp() / (sigma_px * TAU.sqrt());
    // Simpson's rule with 16 intervals per pixel: error far below 1e-6 for these widths.
    let over_pixel = move |from: f64| -> f64 {
        let value = |i: i32| density(from + f64::from(i) / 16.0) * [2.0, 4.0][i as usize % 2];
        ((1..16).map(value).sum::<f64>() + density(from) + density(from + 1.0)) / 48.0
    };
    let axis = move |centre: f64| {
        let first = centre.floor() as i64 - side / 2;
        (first..first + side).map(|i| (i, over_pixel(i as f64 - centre))).collect::<Vec<_>>()
    };
    move |centre| normalised_product(&axis(centre.x), &axis(centre.y))
}

/// Puts the whole star into the pixel that contains it.
pub fn one_pixel(centre: DVec2) -> Vec<(i64, i64, f64)> {
    vec![(centre.x.floor() as i64, centre.y.floor() as i64, 1.0)]
}

fn normalised_product(columns: &[(i64, f64)], rows: &[(i64, f64)]) -> Vec<(i64, i64, f64)> {
    let total = columns.iter().map(|c| c.1).sum::<f64>() * rows.iter().map(|r| r.1).sum::<f64>();
    rows.iter().flat_map(|(y, wy)| columns.iter().map(move |(x, wx)| (*x, *y, wx * wy / total))).collect()
}

//! Flicker: how much a star's light appears to change while its image moves over the pixels.
//!
//! A pixel of luminance L on a display with white luminance L_w shows about x / (1 + x) with x = L / L_w. This value is summed over the pixels, for
//! many sub-pixel positions. Flicker is the standard deviation of these sums divided by their mean. Before tone mapping, the same is computed for the
//! sums of x. Flicker can be measured for a kernel alone, with x = k * weight, where k is the luminance of the star relative to display white if all
//! its light were in a single pixel; or for a pan, frame by frame. Pixels of a frame are weighted by their solid angle.

use glam::DVec2;

use super::{
    HdrView,
    error::{MetricError, positive},
};
use crate::view::projection::Footprint;

/// Standard deviation of a star's sums at all measured positions, divided by their mean. Dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flicker {
    /// Flicker of the sum of the light itself.
    pub before: f64,
    /// Flicker of the sum of the displayed values.
    pub after: f64,
}

/// Collects the frames of a slow pan, one by one.
#[derive(Clone, Debug)]
pub struct FlickerMeter {
    white_cd_m2: f64,
    linear: Vec<f64>,
    displayed: Vec<f64>,
}

impl FlickerMeter {
    /// Creates a meter for a display whose white corresponds to the luminance `white_cd_m2` in the scene.
    ///
    /// # Errors
    /// [`MetricError::NotPositive`] if that is not a positive number.
    pub fn new(white_cd_m2: f64) -> Result<Self, MetricError> {
        Ok(Self { white_cd_m2: positive("display white", white_cd_m2)?, linear: Vec::new(), displayed: Vec::new() })
    }

    /// Adds a frame of the pan.
    ///
    /// # Errors
    /// [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
    pub fn add(&mut self, image: &HdrView<'_>) -> Result<(), MetricError> {
        let [width, height] = image.size();
        let mut lit = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let luminance = image.luminance_cd_m2(x, y);
                if luminance > 0.0 {
                    lit.push((luminance / self.white_cd_m2, image.illuminance_lx(x, y)? / luminance));
                }
            }
        }
        self.add_pixels(lit.into_iter());
        Ok(())
    }

    /// Adds one of several stars in the same image: the pixels within `radius_px` of `pixel`, each weighted by its solid angle relative to that of
    /// the star's central pixel. So one image can contain many positions of a pan, even if the solid angle varies over the image. The light of a star
    /// divided by the solid angle of its central pixel must then be the same for all stars.
    ///
    /// # Errors
    /// [`MetricError::OutsidePicture`] if the star's pixel, or one that is lit, is outside of the picture.
    pub fn add_star(&mut self, image: &HdrView<'_>, pixel: DVec2, radius_px: f64) -> Result<(), MetricError> {
        let pixel_of = |pixel: DVec2| (pixel.x.floor().max(0.0) as u32, pixel.y.floor().max(0.0) as u32);
        let (x, y) = pixel_of(pixel);
        let own_sr = image.mapping().solid_angle_sr(x, y);
        if own_sr.is_nan() || own_sr <= 0.0 {
            return Err(MetricError::OutsidePicture { x, y });
        }
        let mut lit = image.lit_near_pixel(pixel, radius_px)?;
        for (centre, light_lx) in &mut lit {
            let (x, y) = pixel_of(*centre);
            let luminance = image.luminance_cd_m2(x, y);
            (centre.x, *light_lx) = (luminance / self.white_cd_m2, *light_lx / luminance / own_sr);
        }
        self.add_pixels(lit.into_iter().map(|(over_white, share)| (over_white.x, share)));
        Ok(())
    }

    /// Adds a position. Each pixel consists of its luminance relative to display white, and its weight in the sum.
    fn add_pixels(&mut self, pixels: impl Iterator<Item = (f64, f64)>) {
        let (linear, displayed) = pixels.fold((0.0, 0.0), |(linear, displayed), (x, share)| {
            (linear + x * share, displayed + x / (1.0 + x) * share)
        });
        self.linear.push(linear);
        self.displayed.push(displayed);
    }

    /// Returns the flicker of the frames added so far.
    ///
    /// # Errors
    /// [`MetricError::TooFew`] before the second frame, [`MetricError::NoLight`] if all frames were black.
    pub fn flicker(&self) -> Result<Flicker, MetricError> {
        Ok(Flicker { before: deviation_over_mean(&self.linear)?, after: deviation_over_mean(&self.displayed)? })
    }
}

/// Returns the flicker of a kernel alone. `peak` (k) is the star's luminance relative to display white if all its light were in a single pixel.
/// `positions` is the number of sub-pixel positions, which are spread evenly.
///
/// # Errors
/// [`MetricError::NotPositive`] if the peak is not a positive number, [`MetricError::TooFew`] below two positions,
/// [`MetricError::NoLight`] if the kernel has no weight.
pub fn kernel_flicker(kernel: Footprint<'_>, peak: f64, positions: usize) -> Result<Flicker, MetricError> {
    positive("peak over display white", peak)?;
    let mut meter = FlickerMeter::new(1.0)?;
    for position in sub_pixel_positions(positions) {
        meter.add_pixels(kernel(DVec2::splat(64.0) + position).iter().map(|tap| (peak * tap.2, 1.0)));
    }
    meter.flicker()
}

/// Returns points that are spread evenly over a pixel, in [0, 1) along each axis. They are always the same: the additive sequence of the plastic
/// number (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
pub fn sub_pixel_positions(count: usize) -> impl Iterator<Item = DVec2> {
    // The real root of x^3 = x + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let step = DVec2::new(1.0 / PLASTIC, 1.0 / (PLASTIC * PLASTIC));
    (0..count).map(move |i| (DVec2::splat(0.5) + step * i as f64).fract())
}

fn deviation_over_mean(values: &[f64]) -> Result<f64, MetricError> {
    if values.len() < 2 {
        return Err(MetricError::TooFew { what: "positions for flicker", found: values.len(), least: 2 });
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if mean.is_nan() || mean <= 0.0 {
        return Err(MetricError::NoLight("flicker"));
    }
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    Ok(variance.sqrt() / mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        metrics::synthetic::{Canvas, integrated_gaussian, one_pixel},
        photometry::kernel::{SplatKernel, bright_kernel, gaussian_part},
        plan::{
            BSPLINE_FLICKER, PLANE_GAUSSIAN_FLICKER, TENT_FLICKER_AT_WHITE, TENT_FLICKER_PER_PEAK, bspline_peak_within,
        },
        view::projection::{Perspective, PlaneMapping},
    };

    fn flicker_of(kernel: SplatKernel, peak: f64) -> Flicker {
        kernel_flicker(&|centre| kernel.footprint(centre), peak, 3000).unwrap()
    }

    #[test]
    fn positions_fill_the_pixel_evenly() {
        let positions: Vec<DVec2> = sub_pixel_positions(3000).collect();
        assert!(positions.iter().all(|p| (0.0..1.0).contains(&p.x) && (0.0..1.0).contains(&p.y)));
        // Each cell of a 10 x 10 grid has about 30 points.
        let mut cells = [0; 100];
        for p in &positions {
            cells[(p.x * 10.0) as usize * 10 + (p.y * 10.0) as usize] += 1;
        }
        assert!(cells.iter().all(|count| (25..=35).contains(count)), "{cells:?}");
    }

    /// For a small peak k the displayed sum is k - k^2 s with s the sum of squared weights, so the flicker is k std(s).
    /// Along an axis f^2 + (1 - f)^2 of the tent has mean 2/3 and mean square 7/15.
    #[test]
    fn the_tent_has_its_closed_form_for_small_peaks() {
        let std = ((7.0 / 15.0_f64).powi(2) - (2.0 / 3.0_f64).powi(4)).sqrt();
        let found = flicker_of(SplatKernel::Tent, 1e-4);
        assert!((found.after / 1e-4 / std - 1.0).abs() < 2e-3, "{found:?}");
        assert!((std / TENT_FLICKER_PER_PEAK - 1.0).abs() < 1e-3);
        assert!(found.before < 1e-12, "{found:?}");
    }

    /// The design's table of splat kernels gives 0.084 to 0.163 for the tent. For the B-spline it gives 0.011 to 0.038 up to k = 10, and 0.128 at
    /// 100. For a Gaussian of 0.7 px it gives 0.000 to 0.002, and over 7 x 7 pixels less than 0.002 up to k = 1000.
    #[test]
    fn kernels_have_the_flicker_of_the_design_table() {
        for k in [1.0, 10.0, 100.0] {
            let [tent, bspline] = [SplatKernel::Tent, SplatKernel::BSpline].map(|kernel| flicker_of(kernel, k).after);
            let [five, seven] =
                [5, 7].map(|side| kernel_flicker(&integrated_gaussian(0.7, side), k, 3000).unwrap().after);
            println!("k = {k}: tent {tent:.3}, B-spline {bspline:.3}, Gaussian 5x5 {five:.4}, 7x7 {seven:.4}");
            assert!(tent > 0.08 && (bspline < 0.04 || k > 10.0) && seven < 0.002);
        }
        assert!((flicker_of(SplatKernel::BSpline, 1.0).after - 0.011).abs() < 1e-3);
        assert!((flicker_of(SplatKernel::BSpline, 10.0).after - 0.038).abs() < 1e-3);
        assert!((flicker_of(SplatKernel::BSpline, 100.0).after - 0.128).abs() < 2e-3);
        assert!(kernel_flicker(&integrated_gaussian(0.7, 7), 1000.0, 3000).unwrap().after < 0.002);
    }

    #[test]
    fn the_tent_keeps_the_budget_up_to_the_chosen_peak_and_exceeds_it_beyond() {
        for budget in [0.002, 0.02] {
            let peak = budget / TENT_FLICKER_PER_PEAK;
            assert!(flicker_of(SplatKernel::Tent, peak).after <= budget);
            assert!(flicker_of(SplatKernel::Tent, 2.0 * peak).after > budget);
        }
        // The bounds for the two kernels, as the certificate of a frame states them.
        assert!(flicker_of(SplatKernel::Tent, 1.0).after <= TENT_FLICKER_AT_WHITE);
        for pair in BSPLINE_FLICKER.windows(2) {
            let [(from, _), (to, most)] = [pair[0], pair[1]];
            for part in [0.25, 0.5, 0.75, 1.0] {
                let peak = if to.is_finite() { from + (to - from) * part } else { from * 10.0_f64.powf(4.0 * part) };
                let flicker = flicker_of(SplatKernel::BSpline, peak).after;
                assert!(flicker <= most, "k = {peak}: {flicker} > {most}");
            }
        }
        for budget in [0.015, 0.02, 0.05] {
            let peak = bspline_peak_within(budget);
            let (at_peak, beyond) =
                (flicker_of(SplatKernel::BSpline, peak).after, flicker_of(SplatKernel::BSpline, 1.5 * peak).after);
            assert!(at_peak <= budget && beyond > budget, "{budget}: {at_peak} at k = {peak}, {beyond} beyond");
        }
    }

    /// Tests the kernel that `auto` uses for bright stars: its flicker stays within the budget, and the displayed light has no jump where the
    /// Gaussian starts to replace the B-spline.
    #[test]
    fn the_bright_star_gaussian_keeps_the_flicker_budget_and_joins_the_bspline() {
        for budget in [0.01, 0.02, 0.05] {
            let start = 0.75 * bspline_peak_within(budget);
            for step in 0..60 {
                let peak = start * 10f64.powf(f64::from(step) / 12.0);
                let part = gaussian_part(peak, start);
                let flicker = kernel_flicker(&|centre| bright_kernel(part, centre), peak, 400).unwrap().after;
                assert!(flicker <= PLANE_GAUSSIAN_FLICKER.max(budget), "k = {peak}: {flicker}");
                assert!(peak > 1000.0 || flicker < budget, "k = {peak}: {flicker}");
            }
        }
        let start = 0.75 * bspline_peak_within(0.02);
        let displayed = |kernel: Footprint<'_>| -> f64 {
            let places = sub_pixel_positions(400).map(|place| DVec2::splat(64.0) + place);
            places.flat_map(kernel).map(|tap| start * tap.2 / (1.0 + start * tap.2)).sum()
        };
        let spline = displayed(&|centre| SplatKernel::BSpline.footprint(centre));
        let jump = displayed(&|centre| bright_kernel(0.0, centre)) / spline - 1.0;
        let wrong = displayed(&|centre| bright_kernel(1.0, centre)) / spline - 1.0;
        assert!(jump.abs() < 1e-9 && wrong > 0.3, "{jump} {wrong}");
    }

    /// A pan in which every second frame is a tenth brighter. The deviation of {1, 1.1} divided by their mean is 0.05 / 1.05. For the displayed
    /// values at peak 1 it is that of {1/2, 1.1/2.1}.
    #[test]
    fn a_pan_that_pulses_by_a_tenth_is_found() {
        let mapping = Perspective::symmetric([32, 32], 0.01).unwrap();
        let omega = mapping.solid_angle_sr(16, 16);
        let mut steady = FlickerMeter::new(1.0).unwrap();
        let mut pulsing = FlickerMeter::new(1.0).unwrap();
        for frame in 0..40 {
            let direction = mapping.direction_from_pixel(DVec2::new(15.0 + 0.05 * f64::from(frame), 16.3)).unwrap();
            steady.add(&Canvas::new(&mapping).star(direction, omega, &one_pixel).view()).unwrap();
            let lx = omega * if frame % 2 == 0 { 1.0 } else { 1.1 };
            pulsing.add(&Canvas::new(&mapping).star(direction, lx, &one_pixel).view()).unwrap();
        }
        let steady = steady.flicker().unwrap();
        assert!(steady.before < 1e-12 && steady.after < 1e-4, "{steady:?}");
        let pulsing = pulsing.flicker().unwrap();
        assert!((pulsing.before - 0.05 / 1.05).abs() < 1e-4, "{pulsing:?}");
        let [low, high] = [0.5, 1.1 / 2.1];
        assert!((pulsing.after - (high - low) / (high + low)).abs() < 1e-4, "{pulsing:?}");
    }

    #[test]
    fn a_pan_has_the_flicker_of_its_kernel() {
        let mapping = Perspective::symmetric([16, 16], 0.001).unwrap();
        let mut meter = FlickerMeter::new(mapping.solid_angle_sr(8, 8)).unwrap();
        for position in sub_pixel_positions(3000) {
            let direction = mapping.direction_from_pixel(DVec2::splat(8.0) + position).unwrap();
            let canvas = Canvas::new(&mapping).star(direction, 10.0 * mapping.solid_angle_sr(8, 8).powi(2), &|pixel| {
                SplatKernel::BSpline.footprint(pixel)
            });
            meter.add(&canvas.view()).unwrap();
        }
        let (found, expected) = (meter.flicker().unwrap().after, flicker_of(SplatKernel::BSpline, 10.0).after);
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }

    /// Many stars in one wide image, each in its own window. The flicker is that of the kernel, and zero before tone mapping.
    #[test]
    fn a_pan_in_one_image_has_the_flicker_of_its_kernel() {
        let mapping = Perspective::symmetric([512, 512], 1.0).unwrap();
        let [mut meter, mut pulsing] = [1.0, 1.0].map(|white| FlickerMeter::new(white).unwrap());
        let (mut canvas, mut uneven) = (Canvas::new(&mapping), Canvas::new(&mapping));
        let places: Vec<DVec2> = sub_pixel_positions(1024)
            .enumerate()
            .map(|(i, position)| position + DVec2::new((i % 32) as f64, (i / 32) as f64) * 16.0 + 7.0)
            .collect();
        for (index, place) in places.iter().enumerate() {
            let lx = 10.0 * mapping.solid_angle_sr(place.x as u32, place.y as u32);
            let direction = mapping.direction_from_pixel(*place).unwrap();
            canvas = canvas.star(direction, lx, &|pixel| SplatKernel::BSpline.footprint(pixel));
            let lx = lx * if index % 2 == 0 { 1.0 } else { 1.1 };
            uneven = uneven.star(direction, lx, &|pixel| SplatKernel::BSpline.footprint(pixel));
        }
        for place in &places {
            meter.add_star(&canvas.view(), *place, 7.0).unwrap();
            pulsing.add_star(&uneven.view(), *place, 7.0).unwrap();
        }
        let (found, expected) = (meter.flicker().unwrap(), flicker_of(SplatKernel::BSpline, 10.0).after);
        assert!(found.before < 1e-12 && (found.after - expected).abs() < 1e-3, "{found:?} {expected}");
        assert!((pulsing.flicker().unwrap().before - 0.05 / 1.05).abs() < 1e-9);
        let outside = meter.add_star(&canvas.view(), DVec2::new(512.5, 3.0), 7.0);
        assert_eq!(outside, Err(MetricError::OutsidePicture { x: 512, y: 3 }));
    }

    #[test]
    fn too_few_or_black_frames_are_errors() {
        let mapping = Perspective::symmetric([4, 4], 1.0).unwrap();
        let mut meter = FlickerMeter::new(1.0).unwrap();
        assert!(matches!(meter.flicker(), Err(MetricError::TooFew { found: 0, .. })));
        meter.add(&Canvas::new(&mapping).view()).unwrap();
        meter.add(&Canvas::new(&mapping).view()).unwrap();
        assert_eq!(meter.flicker(), Err(MetricError::NoLight("flicker")));
        assert!(FlickerMeter::new(0.0).is_err() && kernel_flicker(&one_pixel, f64::NAN, 10).is_err());
        assert!(kernel_flicker(&one_pixel, 1.0, 1).is_err());
    }
}

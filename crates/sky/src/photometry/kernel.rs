//! Splat kernels: the distribution of a star's light over the pixels around its image.

use glam::DVec2;

/// Radius at which Gaussians that are round in view space are truncated, in standard deviations.
pub const GAUSSIAN_CUT: f64 = 4.5;

/// Standard deviation of the Gaussian of the brightest stars on the image plane, pixels: 0.7, integrated over pixels.
const PLANE_GAUSSIAN_PX: f64 = 0.757;

/// Pixels along a side of [`bright_kernel`].
pub const BRIGHT_KERNEL_PIXELS: i64 = 7;

/// The kernel of stars so bright that the B-spline would visibly flicker, around `centre` (continuous pixel
/// coordinates). Along each axis it is a mixture of the B-spline and a Gaussian (with the share `part`) on seven
/// pixels, divided by its sum. The items are column, row and weight.
pub fn bright_kernel(part: f64, centre: DVec2) -> Vec<(i64, i64, f64)> {
    let spline = |offset: f64| match offset {
        near if near < 0.5 => 0.75 - near * near,
        far => 0.5 * (1.5 - far).max(0.0).powi(2),
    };
    let gaussian = |offset: f64| {
        (-0.5 * (offset / PLANE_GAUSSIAN_PX).powi(2)).exp() / (PLANE_GAUSSIAN_PX * std::f64::consts::TAU.sqrt())
    };
    let axis = |x: f64| -> Vec<(i64, f64)> {
        let first = x.floor() as i64 - BRIGHT_KERNEL_PIXELS / 2;
        let tap = |i: i64| {
            let offset = (i as f64 + 0.5 - x).abs();
            (i, (1.0 - part) * spline(offset) + part * gaussian(offset))
        };
        let taps: Vec<(i64, f64)> = (first..first + BRIGHT_KERNEL_PIXELS).map(tap).collect();
        let sum: f64 = taps.iter().map(|tap| tap.1).sum();
        taps.into_iter().map(|(i, weight)| (i, weight / sum)).collect()
    };
    let (columns, rows) = (axis(centre.x), axis(centre.y));
    rows.iter().flat_map(|(y, wy)| columns.iter().map(move |(x, wx)| (*x, *y, wx * wy))).collect()
}

/// Share of its light that a star drawn with the B-spline has in its brightest pixel: the geometric mean over
/// positions within a pixel, which is the mean in magnitudes. It is 0.5625 at the centre of a pixel and 0.25 at a
/// corner.
pub const BSPLINE_PEAK: f64 = 0.439;

/// Ratio of illuminance between a star that uses only the Gaussian and the faintest star that uses [`bright_kernel`].
pub const BRIGHT_KERNEL_GROWTH: f64 = 6.0;

/// The Gaussian's share for a star; `from_lx` is the illuminance of the faintest star that uses [`bright_kernel`].
pub fn gaussian_part(illuminance_lx: f64, from_lx: f64) -> f64 {
    let way = (illuminance_lx / from_lx.max(1e-30)).log(BRIGHT_KERNEL_GROWTH).clamp(0.0, 1.0);
    // Smooth at both ends.
    way * way * (3.0 - 2.0 * way)
}

/// A separable kernel of fixed width in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SplatKernel {
    /// 2x2 bilinear tent: exact centroid, but its width changes with the sub-pixel position.
    Tent,
    /// 3x3 quadratic B-spline: exact centroid and constant width.
    BSpline,
}

named!(SplatKernel {
    Tent = "tent",
    BSpline = "bspline",
});

impl SplatKernel {
    /// Half of the kernel's support: the distance beyond a picture's edge at which a star still touches it, pixels.
    pub fn radius_px(self) -> f64 {
        match self {
            SplatKernel::Tent => 1.0,
            SplatKernel::BSpline => 1.5,
        }
    }

    /// First pixel and weights along one axis, for a star at continuous pixel coordinate `x`.
    fn axis(self, x: f64) -> (i64, [f64; 3], usize) {
        match self {
            SplatKernel::Tent => {
                let first = (x - 0.5).floor();
                let f = x - 0.5 - first;
                (first as i64, [1.0 - f, f, 0.0], 2)
            }
            SplatKernel::BSpline => {
                let middle = x.floor();
                let f = x - middle - 0.5;
                (middle as i64 - 1, [0.5 * (0.5 - f).powi(2), 0.75 - f * f, 0.5 * (0.5 + f).powi(2)], 3)
            }
        }
    }

    /// The kernel's pixels (column, row, weight) around continuous pixel coordinates; the weights sum to 1.
    pub fn footprint(self, centre: DVec2) -> Vec<(i64, i64, f64)> {
        let (x0, weights_x, n) = self.axis(centre.x);
        let (y0, weights_y, _) = self.axis(centre.y);
        let mut taps = Vec::with_capacity(n * n);
        for (j, weight_y) in weights_y.iter().take(n).enumerate() {
            for (i, weight_x) in weights_x.iter().take(n).enumerate() {
                taps.push((x0 + i as i64, y0 + j as i64, weight_x * weight_y));
            }
        }
        taps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_keep_the_centroid() {
        for kernel in [SplatKernel::Tent, SplatKernel::BSpline] {
            for i in 0..100 {
                let centre = DVec2::new(10.0 + f64::from(i) * 0.0137, 20.0 - f64::from(i) * 0.0311);
                let taps = kernel.footprint(centre);
                let sum: f64 = taps.iter().map(|t| t.2).sum();
                let centroid: DVec2 = taps.iter().map(|t| DVec2::new(t.0 as f64 + 0.5, t.1 as f64 + 0.5) * t.2).sum();
                assert!((sum - 1.0).abs() < 1e-12);
                assert!((centroid - centre).length() < 1e-12, "{kernel:?} {centre} {centroid}");
            }
        }
    }

    #[test]
    fn the_peak_of_the_bspline_is_its_mean_in_magnitudes() {
        const N: u32 = 64;
        let coordinate = |i: u32| 5.0 + (f64::from(i) + 0.5) / f64::from(N);
        let peak = |x: u32, y: u32| {
            let taps = SplatKernel::BSpline.footprint(DVec2::new(coordinate(x), coordinate(y)));
            taps.iter().map(|tap| tap.2).fold(0.0, f64::max)
        };
        let places: Vec<(u32, u32)> = (0..N).flat_map(|y| (0..N).map(move |x| (x, y))).collect();
        let logs: f64 = places.iter().map(|(x, y)| peak(*x, *y).ln()).sum();
        let mean = (logs / places.len() as f64).exp();
        assert!((mean - BSPLINE_PEAK).abs() < 5e-4, "{mean}");
        // The arithmetic mean is different.
        let plain = places.iter().map(|(x, y)| peak(*x, *y)).sum::<f64>() / places.len() as f64;
        assert!((plain - 4.0 / 9.0).abs() < 1e-4 && plain - BSPLINE_PEAK > 4e-3, "{plain}");
    }

    #[test]
    fn only_the_bspline_keeps_its_width() {
        let spread = |kernel: SplatKernel| {
            let variances: Vec<f64> = (0..50)
                .map(|i| {
                    let x = 5.0 + f64::from(i) * 0.02;
                    kernel.footprint(DVec2::new(x, 5.5)).iter().map(|t| t.2 * (t.0 as f64 + 0.5 - x).powi(2)).sum()
                })
                .collect();
            variances.iter().fold(0.0, |a: f64, b| a.max(*b)) - variances.iter().fold(f64::MAX, |a, b| a.min(*b))
        };
        assert!(spread(SplatKernel::BSpline) < 1e-12);
        assert!(spread(SplatKernel::Tent) > 0.2);
    }
}

//! Ground truth of glare: a convolution on the sphere in f64, which adds every source to every requested pixel.
//!
//! A source of illuminance E at an angle t causes the luminance `fraction` E k(t). For a pixel, the mean over the pixel
//! is computed: the kernel at its centre if the pixel is small compared with its distance from the source; otherwise
//! Gauss-Legendre quadrature with the area element of the mapping, over squares that are subdivided towards the source
//! and along the rim of the kernel's plateau. The relative error of the mean is below 1e-4 for kernels without jumps.
//!
//! Sources need not lie in the picture. Extended ones are represented by many points ([`disc_sources`]). A whole
//! picture is slow; a sample of pixels ([`sampled_pixels`]) is sufficient for comparisons.

use std::collections::HashSet;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::reference::{
    sky::{Pixel, SkyStar, separation_rad},
    stars::point_spread::FIVE_POINTS,
};
use crate::{
    photometry::glare::GlareKernel,
    view::projection::{PlaneMapping, pixel_centre},
};

/// Largest ratio of a pixel's radius to its distance from a source at which its centre represents the pixel. With the steepest kernel, the inverse
/// cube of the angle, the mean over such a pixel is 7e-5 higher than the value at its centre.
const SMALL: f64 = 0.01;
/// The same ratio for a square: quadrature with 5 x 5 points is accurate up to it.
const SMOOTH: f64 = 0.25;
/// Radius of the squares that the rim of the plateau crosses, in units of the inner angle.
const AT_RIM: f64 = 0.05;

/// Scattered light.
#[derive(Clone, Copy)]
pub struct Veil<'a> {
    /// All sources of light, inside the picture or not.
    pub sources: &'a [SkyStar],
    /// The angular distribution of scattered light.
    pub kernel: &'a dyn GlareKernel,
    /// Fraction of the light that is scattered.
    pub fraction: f64,
}

impl Veil<'_> {
    /// Returns the luminance scattered towards a unit direction in view space, linear Rec. 709, cd/m^2.
    pub fn towards(&self, direction: DVec3) -> [f64; 3] {
        self.sum(|source| self.kernel.per_sr(separation_rad(source, direction)))
    }

    /// Returns the mean over a pixel of the luminance scattered towards it, linear Rec. 709, cd/m^2; `None` outside of the picture.
    pub fn over_pixel(&self, mapping: &dyn PlaneMapping, [x, y]: [u32; 2]) -> Option<[f64; 3]> {
        let pixel = Pixel::new(mapping, x, y)?;
        Some(self.sum(|source| self.mean_over(&pixel, source)))
    }

    /// [`Veil::over_pixel`] for many pixels, in order; independent of the number of threads.
    pub fn over_pixels(&self, mapping: &dyn PlaneMapping, pixels: &[[u32; 2]]) -> Vec<Option<[f64; 3]>> {
        pixels.par_iter().map(|pixel| self.over_pixel(mapping, *pixel)).collect()
    }

    fn sum(&self, per_sr: impl Fn(DVec3) -> f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for source in self.sources {
            let density = per_sr(source.direction);
            (0..3).for_each(|c| sum[c] += source.rgb_lx[c] * density);
        }
        sum.map(|channel| channel * self.fraction)
    }

    fn mean_over(&self, pixel: &Pixel<'_>, source: DVec3) -> f64 {
        let distance = separation_rad(source, pixel.centre);
        if pixel.radius_rad <= SMALL * distance || distance + pixel.radius_rad <= self.kernel.inner_rad() {
            return self.kernel.per_sr(distance);
        }
        let (light, area) = self.integrate(pixel, source, DVec2::ZERO, 1.0);
        if area > 0.0 { light / area } else { self.kernel.per_sr(distance) }
    }

    /// Returns the integral of the kernel over a square of the pixel, and the square's solid angle, sr.
    fn integrate(&self, pixel: &Pixel<'_>, source: DVec3, from: DVec2, side: f64) -> (f64, f64) {
        // Mappings are curved: a point half a pixel away may be farther than half of the radius.
        let radius = 1.5 * pixel.radius_rad * side;
        let inner = self.kernel.inner_rad();
        let fine = match pixel.middle(from, side).map(|middle| separation_rad(middle, source)) {
            Some(distance) if distance + radius <= inner => true,
            Some(distance) if distance - radius < inner => radius <= AT_RIM * inner,
            Some(distance) => radius <= SMOOTH * distance,
            // Beyond a rim, the distance to the source is unknown.
            None => side < 0.02,
        };
        if fine {
            let nodes = pixel.cell(&FIVE_POINTS, from, side);
            return nodes.iter().fold((0.0, 0.0), |(light, area), (direction, weight)| {
                (light + weight * self.kernel.per_sr(separation_rad(*direction, source)), area + weight)
            });
        }
        let half = 0.5 * side;
        [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].into_iter().fold((0.0, 0.0), |(light, area), quarter| {
            let part = self.integrate(pixel, source, from + quarter * half, half);
            (light + part.0, area + part.1)
        })
    }
}

/// Returns a uniform disc of light around a unit direction, as `count` points of equal light. Each represents an equal area of the cap with this
/// angular radius (at most pi, rad). Their total light is `rgb_lx`.
pub fn disc_sources(direction: DVec3, radius_rad: f64, rgb_lx: [f64; 3], count: u32) -> Vec<SkyStar> {
    let (right, up) = direction.any_orthonormal_pair();
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let place = |i: u32| {
        // The square of the sine of half the angle is proportional to the area of the cap. In this form nothing cancels.
        let half_sine = (0.5 * radius_rad).sin() * ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
        let (sine, cosine) =
            (2.0 * half_sine * (1.0 - half_sine * half_sine).sqrt(), 1.0 - 2.0 * half_sine * half_sine);
        let (y, x) = (f64::from(i) * golden_angle).sin_cos();
        direction * cosine + (right * x + up * y) * sine
    };
    let rgb_lx = rgb_lx.map(|channel| channel / f64::from(count));
    (0..count).map(|i| SkyStar { direction: place(i).normalize(), rgb_lx }).collect()
}

/// Returns `count` different pixels that are spread evenly over a picture, or all of them if the picture has fewer. The result is always the same. It
/// excludes pixels outside of the picture, and those whose centres lie within an angle (rad) of a unit direction in `near`.
pub fn sampled_pixels(mapping: &dyn PlaneMapping, count: usize, near: &[(DVec3, f64)]) -> Vec<[u32; 2]> {
    // Steps of the two-dimensional counterpart of the golden section (M. Roberts, "The Unreasonable Effectiveness of
    // Quasirandom Sequences", 2018): powers of the inverse of the root of x^3 = x + 1.
    const STEP: DVec2 = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_2);
    let [width, height] = mapping.size();
    let is_wanted = |[x, y]: [u32; 2]| {
        let centre = mapping.direction_from_pixel(pixel_centre(x, y));
        centre.is_some_and(|at| near.iter().all(|(d, r)| separation_rad(at, *d) > *r))
    };
    let mut taken = HashSet::new();
    let all = u64::from(width) * u64::from(height);
    // A walk of this length visits nearly every pixel of a small picture, and finds enough pixels of a large one.
    (0..8 * all)
        .map(|i| (STEP * (i + 1) as f64).fract())
        .map(|at| [(at.x * f64::from(width)) as u32, (at.y * f64::from(height)) as u32])
        .filter(|pixel| taken.insert(*pixel) && is_wanted(*pixel))
        .take(count)
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{
        photometry::glare::{Cie, EyeColour, InverseSquareKernel, Normalised},
        view::projection::{Equirectangular, Fisheye, FisheyeMapping, Perspective},
    };

    fn kernel(inner_deg: f64) -> InverseSquareKernel {
        InverseSquareKernel::new(inner_deg.to_radians())
    }

    fn star(direction: DVec3) -> SkyStar {
        SkyStar { direction: direction.normalize(), rgb_lx: [1.0, 2.0, 4.0] }
    }

    #[test]
    fn one_source_gives_the_kernel() {
        let kernel = kernel(0.1);
        let source = [star(DVec3::new(0.3, -0.2, -1.0))];
        let veil = Veil { sources: &source, kernel: &kernel, fraction: 0.1 };
        let across = source[0].direction.any_orthonormal_vector();
        for angle in [0.0, 1e-9, 0.001, 0.01, 1.0, 3.0, PI - 1e-9, PI] {
            let seen = veil.towards(source[0].direction * f64::cos(angle) + across * f64::sin(angle));
            for (found, lx) in seen.into_iter().zip(source[0].rgb_lx) {
                let expected = 0.1 * lx * kernel.per_sr(angle);
                assert!((found / expected - 1.0).abs() < 1e-9, "{angle}: {found} {expected}");
            }
        }
        // Sources are additive.
        let two = [source[0], star(DVec3::Y)];
        let other = Veil { sources: &two[1..], ..veil }.towards(DVec3::X);
        let sum = Veil { sources: &two, ..veil }.towards(DVec3::X);
        assert!((sum[1] - other[1] - veil.towards(DVec3::X)[1]).abs() < 1e-15);
    }

    #[test]
    fn a_whole_sky_contains_all_scattered_light() {
        let mapping = Equirectangular::new([64, 32]).unwrap();
        let pixels: Vec<[u32; 2]> = (0..32).flat_map(|y| (0..64).map(move |x| [x, y])).collect();
        let cie = Normalised::new(Cie::new(0.1_f64.to_radians(), 35.0, EyeColour::Brown)).unwrap();
        let square = kernel(0.1);
        let kernels: [&dyn GlareKernel; 2] = [&square, &cie];
        // Three positions: inside a pixel, at a corner of pixels, and at a pole.
        for direction in [DVec3::new(0.3, 0.2, -1.0), DVec3::NEG_Z, DVec3::Y] {
            let source = [star(direction)];
            for kernel in kernels {
                let veil = Veil { sources: &source, kernel, fraction: 0.1 };
                let flux: f64 = pixels
                    .iter()
                    .zip(veil.over_pixels(&mapping, &pixels))
                    .map(|([x, y], rgb)| rgb.unwrap()[0] * mapping.solid_angle_sr(*x, *y))
                    .sum();
                assert!((flux / 0.1 - 1.0).abs() < 1e-3, "{direction}: {flux}");
                let centres: f64 = pixels
                    .iter()
                    .map(|[x, y]| {
                        let centre = mapping.direction_from_pixel(pixel_centre(*x, *y));
                        veil.towards(centre.unwrap())[0] * mapping.solid_angle_sr(*x, *y)
                    })
                    .sum();
                // Pixels as wide as 50 inner angles: their centres do not represent them.
                assert!((centres / 0.1 - 1.0).abs() > 0.05, "{direction}: {centres}");
            }
        }
    }

    #[test]
    fn a_pixel_near_a_source_is_the_mean_of_many_points() {
        let mapping = Perspective::symmetric([16, 16], 0.2).unwrap();
        let kernel = kernel(0.3);
        let source = [star(mapping.direction_from_pixel(DVec2::new(8.3, 7.6)).unwrap())];
        let veil = Veil { sources: &source, kernel: &kernel, fraction: 1.0 };
        for [x, y] in [[8, 7], [9, 7], [8, 8], [10, 9], [0, 0]] {
            let (mut light, mut area) = (0.0, 0.0);
            for i in 0..400 * 400 {
                let position =
                    DVec2::new(f64::from(x) + f64::from(i % 400) / 400.0, f64::from(y) + f64::from(i / 400) / 400.0)
                        + DVec2::splat(0.5 / 400.0);
                // The area element of a plane.
                let weight = mapping.direction_from_pixel(position).unwrap().z.abs().powi(3);
                light += weight * veil.towards(mapping.direction_from_pixel(position).unwrap())[0];
                area += weight;
            }
            let found = veil.over_pixel(&mapping, [x, y]).unwrap()[0];
            assert!((found * area / light - 1.0).abs() < 1e-4, "{x} {y}: {}", found * area / light - 1.0);
        }
        assert!(veil.over_pixel(&mapping, [16, 0]).is_none());
    }

    #[test]
    fn a_wrong_picture_is_detected() {
        let mapping = Fisheye::new([64, 64], FisheyeMapping::Equidistant, PI).unwrap();
        let source = [star(DVec3::new(0.8, 0.3, -0.5)), star(DVec3::new(0.1, -0.3, 0.9))];
        let right_kernel = kernel(0.1);
        let right = Veil { sources: &source, kernel: &right_kernel, fraction: 0.1 };
        let pixels = sampled_pixels(&mapping, 200, &[]);
        assert_eq!(pixels.len(), 200);
        let rms = |other: Veil<'_>| {
            let (a, b) = (right.over_pixels(&mapping, &pixels), other.over_pixels(&mapping, &pixels));
            let squares = a.iter().zip(b).map(|(a, b)| (b.unwrap()[1] / a.unwrap()[1] - 1.0).powi(2));
            (squares.sum::<f64>() / pixels.len() as f64).sqrt()
        };
        assert_eq!(rms(right), 0.0);
        let wider = kernel(0.2);
        assert!(rms(Veil { kernel: &wider, ..right }) > 0.02);
        assert!(rms(Veil { fraction: 0.103, ..right }) > 0.02);
        // A source behind the eye contributes; without it, or mirrored, the picture differs.
        assert!(rms(Veil { sources: &source[..1], ..right }) > 0.02);
        let mirrored = source.map(|s| SkyStar { direction: s.direction * DVec3::new(-1.0, 1.0, 1.0), ..s });
        assert!(rms(Veil { sources: &mirrored, ..right }) > 0.02);
    }

    #[test]
    fn a_disc_looks_like_a_point_only_from_far_away() {
        let direction = DVec3::new(0.2, 0.5, -0.8).normalize();
        let radius = 0.25_f64.to_radians();
        let disc = disc_sources(direction, radius, [3.0; 3], 2000);
        let (sum, middle) = disc.iter().fold((0.0, DVec3::ZERO), |(sum, m), s| (sum + s.rgb_lx[0], m + s.direction));
        assert!((sum - 3.0).abs() < 1e-12 && separation_rad(middle.normalize(), direction) < 0.01 * radius);
        // Half of the light lies within the radius that contains half of the area.
        let within = disc.iter().filter(|s| separation_rad(s.direction, direction) < radius * 0.5_f64.sqrt()).count();
        assert!(within.abs_diff(1000) <= 1 && disc.iter().all(|s| separation_rad(s.direction, direction) <= radius));

        let kernel = kernel(0.05);
        let point = [SkyStar { direction, rgb_lx: [3.0; 3] }];
        let ratio = |angle_deg: f64| {
            let (sine, cosine) = angle_deg.to_radians().sin_cos();
            let offset_direction = direction * cosine + direction.any_orthonormal_vector() * sine;
            let [disc, point] = [&disc[..], &point[..]]
                .map(|sources| Veil { sources, kernel: &kernel, fraction: 1.0 }.towards(offset_direction)[0]);
            disc / point
        };
        // The mean of 1 / t^2 over a disc of radius r is 1 / t^2 (1 + r^2 / (2 t^2) ...).
        assert!((ratio(10.0) - 1.0).abs() < 1e-3, "{}", ratio(10.0));
        assert!((ratio(1.0) - (1.0 + 0.5 * 0.0625)).abs() < 0.01, "{}", ratio(1.0));
        assert!(ratio(0.0) < 0.3);
        assert!(disc_sources(direction, radius, [1.0; 3], 0).is_empty());
        // The points cover the whole sphere, so their directions cancel.
        let sphere = disc_sources(direction, PI, [1.0; 3], 4000);
        assert!(sphere.iter().map(|s| s.direction).sum::<DVec3>().length() < 2.0);
    }

    #[test]
    fn sampled_pixels_cover_the_picture_evenly_except_near_sources() {
        let mapping = Fisheye::new([100, 100], FisheyeMapping::Equisolid, PI).unwrap();
        let source = DVec3::new(0.5, 0.2, -1.0).normalize();
        let pixels = sampled_pixels(&mapping, 1000, &[(source, 0.3)]);
        assert_eq!((pixels.len(), pixels.iter().collect::<HashSet<_>>().len()), (1000, 1000));
        let direction_at = |[x, y]: &[u32; 2]| mapping.direction_from_pixel(pixel_centre(*x, *y));
        assert!(pixels.iter().all(|pixel| separation_rad(direction_at(pixel).unwrap(), source) > 0.3));
        assert_eq!(pixels, sampled_pixels(&mapping, 1000, &[(source, 0.3)]));
        // A quarter of the pixels lies in each quarter.
        let whole = sampled_pixels(&mapping, 1000, &[]);
        for (right, low) in [(false, false), (false, true), (true, false), (true, true)] {
            let count = whole.iter().filter(|[x, y]| (*x >= 50, *y >= 50) == (right, low)).count();
            assert!(count.abs_diff(250) < 15, "{count}");
        }
        // The sample has no more pixels than the picture.
        assert_eq!(sampled_pixels(&mapping, 20_000, &[]).len(), sampled_pixels(&mapping, 10_000, &[]).len());
        assert!(sampled_pixels(&mapping, 10, &[(source, PI)]).is_empty());
    }
}

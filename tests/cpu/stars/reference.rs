//! The f64 reference compared with closed forms: flux, position, width and peak of stars over the whole sphere, in
//! every projection.

use std::f64::consts::{PI, SQRT_2, TAU};

use crate::common::*;
use glam::{DVec2, DVec3};
use steradian::{
    metrics::{HdrView, centroid_error_px, centroid_error_rad, shape_rad},
    photometry::{kernel::SplatKernel, rec709::luminance},
    reference::{
        sky::{SkyKernel, SkyStar, draw, stars_for},
        stars::{
            point_spread::{Gaussian, ImageTable, PointSpread, RadialTable},
            splat::{Eye, ReferenceImage},
        },
    },
    view::{
        ViewKind,
        projection::{Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping},
    },
};

const WHITE_LX: f64 = 2e-6;

fn white(direction: DVec3) -> SkyStar {
    SkyStar { direction: direction.normalize(), rgb_lx: [WHITE_LX; 3] }
}

/// Returns the light of a star in a picture, relative to its illuminance.
fn share(star: SkyStar, mapping: &dyn PlaneMapping, kernel: SkyKernel<'_>) -> f64 {
    let image = draw(&[star], mapping, kernel);
    image.illuminance_lx.iter().map(|rgb| luminance(*rgb)).sum::<f64>() / WHITE_LX
}

/// Returns the light of a star in all images of a view, relative to its illuminance.
fn share_of_view(direction: DVec3, kind: &ViewKind, kernel: SkyKernel<'_>) -> f64 {
    let view = view("v", kind.clone());
    let share_of_image = |image: &steradian::view::ViewImage| {
        share(white(image.camera_from_view.conjugate() * direction), image.projection.mapping(), kernel)
    };
    view.images.iter().map(share_of_image).sum()
}

/// 2 / sqrt(pi) times the integral of exp(-t^2) from 0 to x.
fn erf(x: f64) -> f64 {
    let cells = 400;
    let step = x / f64::from(cells);
    let value = |i: i32| (-(step * f64::from(i)).powi(2)).exp();
    let sum: f64 = (0..cells).map(|i| (value(i) + value(i + 1)) / 2.0).sum();
    // Integrate by the trapezium rule with its first correction, -h^2 / 12 times the difference of the slopes.
    (sum * step + step * step / 12.0 * (2.0 * x * value(cells))) * 2.0 / PI.sqrt()
}

#[test]
fn light_of_a_gaussian_inside_a_square_and_a_cap_matches_closed_forms() {
    // The integral over a square of half width h around the star, small enough to be flat, is erf(h / (sigma sqrt
    // 2))^2. The kernels are from much narrower than a pixel to many pixels wide.
    let half = 1e-3_f64;
    for size in [1, 3, 16, 65] {
        let plane = Perspective::symmetric([size, size], 2.0 * half).unwrap();
        for sigma in [0.02 * half, 0.3 * half, half, 2.0 * half] {
            let gaussian = Gaussian::new(sigma).unwrap();
            let found = share(white(DVec3::NEG_Z), &plane, SkyKernel::Spread(&gaussian));
            let expected = erf(half / (sigma * SQRT_2)).powi(2);
            assert!((found / expected - 1.0).abs() < 2e-6, "{size} px, sigma {sigma}: {found} {expected}");
        }
    }
    // The cap of the sphere is too wide to be flat. The integral over it follows from the moments of exp(-theta^2 / 2
    // sigma^2) and the series of the sine.
    let moments = |a: f64, s2: f64| {
        let e = (-a).exp();
        s2 * (1.0 - e) - s2.powi(2) / 3.0 * (1.0 - (1.0 + a) * e)
            + s2.powi(3) / 15.0 * (1.0 - (1.0 + a + a * a / 2.0) * e)
    };
    for (radius, sigma) in [(0.3_f64, 0.15_f64), (0.2, 0.1), (0.1, 0.1)] {
        let cap = Fisheye::new([512; 2], FisheyeMapping::Equisolid, 2.0 * radius).unwrap();
        let found = share(white(DVec3::NEG_Z), &cap, SkyKernel::Spread(&Gaussian::new(sigma).unwrap()));
        let s2 = sigma * sigma;
        let expected = moments(radius * radius / (2.0 * s2), s2) / moments(24.5, s2);
        // The tolerance allows for the jagged rim of a picture 512 pixels wide.
        assert!((found / expected - 1.0).abs() < 1e-4, "{radius}: {found} {expected}");
    }
}

#[test]
fn all_light_arrives_in_every_projection_and_across_every_edge() {
    let whole_sky = [
        ViewKind::Cubemap { face_size: 24, faces: Face::ALL.to_vec() },
        ViewKind::Equirectangular { size: [96, 48] },
        ViewKind::Fisheye { size: [64, 64], mapping: FisheyeMapping::Equidistant, fov_rad: TAU },
        ViewKind::Fisheye { size: [64, 64], mapping: FisheyeMapping::Equisolid, fov_rad: TAU },
    ];
    let mut places = vec![DVec3::Y, DVec3::NEG_Y, DVec3::new(1e-4, 1.0, 2e-4), DVec3::new(0.0, 0.4, 1.0)];
    places.extend([DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(1.0, 0.3, -1.0), DVec3::new(-0.2, 1.0, 1.0)]);
    places.extend(spiral(12));
    for kind in &whole_sky {
        let mut worst = [0.0_f64; 2];
        // The kernels are a twentieth of a pixel to several pixels wide.
        for sigma in [0.003, 0.03, 0.3] {
            let gaussian = Gaussian::new(sigma).unwrap();
            for place in &places {
                // The rim of a full sphere is jagged, because a pixel belongs to the picture if its centre does. In an
                // equisolid picture, the outermost pixels extend half a radian inwards.
                let rim_rad = place.angle_between(DVec3::Z);
                let near_rim = matches!(kind, ViewKind::Fisheye { .. }) && rim_rad < gaussian.radius_rad() + 0.6;
                let error = (share_of_view(*place, kind, SkyKernel::Spread(&gaussian)) - 1.0).abs();
                worst[usize::from(near_rim)] = worst[usize::from(near_rim)].max(error);
            }
        }
        for place in &places {
            let error = (share_of_view(*place, kind, SkyKernel::Point) - 1.0).abs();
            assert!(error < 1e-15, "a point at {place} in {}: {error}", kind.type_name());
        }
        println!("{}: relative error of the light {:.1e}, near the rim {:.1e}", kind.type_name(), worst[0], worst[1]);
        let equisolid = matches!(kind, ViewKind::Fisheye { mapping: FisheyeMapping::Equisolid, .. });
        assert!(worst[0] < 1e-7 && worst[1] < if equisolid { 0.15 } else { 5e-3 }, "{}: {worst:?}", kind.type_name());
    }
    // Every other picture has all light of stars well inside.
    for (name, kind) in all_views() {
        let images = view("v", kind.clone()).images.len() as f64;
        let gaussian = Gaussian::new(0.01).unwrap();
        let eyes = if matches!(kind, ViewKind::Stereo { .. }) { images } else { 1.0 };
        // For the dome, which is tilted 0.3 rad to the front, use a direction near its zenith.
        let direction = if name == "domemaster" { DVec3::new(0.1, 1.0, -0.4) } else { DVec3::new(0.2, -0.15, -1.0) };
        for kernel in [SkyKernel::Point, SkyKernel::Spread(&gaussian)] {
            let found = share_of_view(direction, &kind, kernel) / eyes;
            assert!((found - 1.0).abs() < 8e-11, "{name}: {found}");
        }
    }
}

#[test]
fn position_width_and_peak_match_the_gaussian() {
    let sigma = 0.02;
    let gaussian = Gaussian::new(sigma).unwrap();
    let mappings: [&dyn PlaneMapping; 3] = [
        &Perspective::symmetric([600, 600], 1.9).unwrap(),
        &Fisheye::new([700, 700], FisheyeMapping::Stereographic, PI).unwrap(),
        &Equirectangular::new([720, 360]).unwrap(),
    ];
    for mapping in mappings {
        for direction in [DVec3::NEG_Z, DVec3::new(0.6, 0.4, -0.7).normalize()] {
            let star = white(direction);
            let luminances = draw(&[star], mapping, SkyKernel::Spread(&gaussian)).luminance_cd_m2(mapping);
            let image = HdrView::new(mapping, &luminances).unwrap();
            let error_rad = centroid_error_rad(&[image], star.direction, 0.2).unwrap();
            let shape = shape_rad(&[image], star.direction, 0.2).unwrap();
            let peak = luminances.iter().map(|rgb| luminance(*rgb)).fold(0.0, f64::max);
            let peak_error = peak / (WHITE_LX / (TAU * sigma * sigma)) - 1.0;
            println!("centroid off by {error_rad:.1e} rad, {shape:?}, peak {peak_error:.1e}");
            // The error is a few ten-thousandths of a pixel, because the centroid treats pixels as points at their
            // centres.
            assert!(error_rad < 3e-6);
            // The width includes that of the pixels, up to 0.0087 rad, and the curvature of the sky reduces it
            // slightly. The peak is a mean over a pixel.
            assert!((shape.major / sigma - 1.0).abs() < 0.01 && (shape.minor / sigma - 1.0).abs() < 0.01);
            assert!(shape.ellipticity().unwrap() < 5e-3);
            assert!(peak_error > -0.07 && peak_error < 1e-3, "{peak_error}");
        }
    }
    // A kernel much wider than its pixels: the peak is accurate to 1e-4.
    let plane = Perspective::symmetric([201, 201], 0.02).unwrap();
    let wide = Gaussian::new(0.002).unwrap();
    let image = draw(&[white(DVec3::NEG_Z)], &plane, SkyKernel::Spread(&wide)).luminance_cd_m2(&plane);
    let peak = luminance(image[100 * 201 + 100]);
    assert!((peak / (WHITE_LX / (TAU * 4e-6)) - 1.0).abs() < 3e-4, "{peak}");
}

/// Integrates every pixel by a midpoint rule of 40 x 40 points, without cones or rectangles.
#[test]
fn brute_force_gives_the_same_picture() {
    let mapping = Equirectangular::new([32, 16]).unwrap();
    let stars: Vec<SkyStar> = spiral(9).map(white).chain([white(DVec3::new(0.01, 1.0, 0.0))]).collect();
    for sigma in [0.05, 0.25] {
        let gaussian = Gaussian::new(sigma).unwrap();
        let found = draw(&stars, &mapping, SkyKernel::Spread(&gaussian));
        assert_eq!(found.stars, 10);
        let parts = 40;
        let mut worst = 0.0_f64;
        for y in 0..16_u32 {
            for x in 0..32_u32 {
                let mut sum = 0.0;
                for part in 0..parts * parts {
                    let offset =
                        DVec2::new(f64::from(part % parts) + 0.5, f64::from(part / parts) + 0.5) / f64::from(parts);
                    let pixel = DVec2::new(f64::from(x), f64::from(y)) + offset;
                    let direction = mapping.direction_from_pixel(pixel).unwrap();
                    let area = TAU / 32.0 * PI / 16.0 * (pixel.y / 16.0 * PI).sin() / f64::from(parts * parts);
                    for star in &stars {
                        let offset = DVec2::new(star.direction.angle_between(direction), 0.0);
                        sum += gaussian.per_sr(offset)[0] * area * WHITE_LX;
                    }
                }
                worst = worst.max((found.illuminance_lx[(y * 32 + x) as usize][0] - sum).abs());
            }
        }
        assert!(worst < 4e-4 * WHITE_LX, "sigma {sigma}: {}", worst / WHITE_LX);
    }
}

/// The checks above must fail when the kernel is wrong.
#[test]
fn a_kernel_that_is_too_bright_shifted_or_too_wide_is_detected() {
    struct Wrong(Gaussian, f64, DVec2);
    impl PointSpread for Wrong {
        fn per_sr(&self, offset_rad: DVec2) -> [f64; 3] {
            self.0.per_sr(offset_rad - self.2).map(|value| value * self.1)
        }
        fn radius_rad(&self) -> f64 {
            self.0.radius_rad() * 2.0
        }
        fn detail_rad(&self) -> f64 {
            self.0.detail_rad()
        }
    }
    let plane = Perspective::symmetric([64, 64], 0.02).unwrap();
    let pixel_rad = 0.02 / 64.0;
    let good = Gaussian::new(1.5 * pixel_rad).unwrap();
    let bright = Wrong(good, 1.001, DVec2::ZERO);
    let found = share(white(DVec3::NEG_Z), &plane, SkyKernel::Spread(&bright));
    assert!((found - 1.001).abs() < 8e-12, "{found}");
    let shift = DVec2::new(0.3, -0.4) * pixel_rad;
    let shifted = draw(&[white(DVec3::NEG_Z)], &plane, SkyKernel::Spread(&Wrong(good, 1.0, shift)));
    let luminances = shifted.luminance_cd_m2(&plane);
    let image = HdrView::new(&plane, &luminances).unwrap();
    let error = centroid_error_px(&image, DVec2::splat(32.0), 100.0).unwrap();
    assert!((error - 0.5).abs() < 6.6e-5, "{error}");
    // +x is right and +y is up.
    assert!(centroid_error_px(&image, DVec2::new(32.3, 32.4), 100.0).unwrap() < 6.6e-5);
    let wide = Gaussian::new(1.51 * pixel_rad).unwrap();
    let peak = |spread: &Gaussian| {
        draw(&[white(DVec3::NEG_Z)], &plane, SkyKernel::Spread(spread)).illuminance_lx[32 * 64 + 32][0]
    };
    assert!((peak(&wide) / peak(&good) - 1.0).abs() > 5e-3);
}

#[test]
fn tables_draw_their_values() {
    let plane = Perspective::symmetric([64, 64], 0.02).unwrap();
    let sigma = 6e-4;
    let gaussian = Gaussian::new(sigma).unwrap();
    let profile = |theta: f64| [(-0.5 * (theta / sigma).powi(2)).exp(); 3];
    let radial = RadialTable::new(2e-5, (0..200).map(|i| profile(f64::from(i) * 2e-5)).collect()).unwrap();
    let texel = 5e-5;
    let texels = (0..161 * 161).map(|i| profile((f64::from(i % 161) - 80.0).hypot(f64::from(i / 161) - 80.0) * texel));
    let picture = ImageTable::new([161, 161], texel, texels.collect()).unwrap();
    let star = white(DVec3::new(0.002, -0.003, -1.0));
    let expected = draw(&[star], &plane, SkyKernel::Spread(&gaussian));
    let peak = expected.illuminance_lx.iter().map(|rgb| rgb[0]).fold(0.0, f64::max);
    for (table, limit) in [(&radial as &dyn PointSpread, 1e-3), (&picture, 2e-3)] {
        let found = draw(&[star], &plane, SkyKernel::Spread(table));
        let pairs = found.illuminance_lx.iter().zip(&expected.illuminance_lx);
        let worst = pairs.map(|(a, b)| (a[1] - b[1]).abs() / peak).fold(0.0, f64::max);
        assert!(worst < limit, "{worst}");
        let sum: f64 = found.illuminance_lx.iter().map(|rgb| rgb[2]).sum();
        assert!((sum / WHITE_LX - 1.0).abs() < 1.5e-8, "{sum}");
    }
}

#[test]
fn the_picture_is_the_same_on_any_number_of_threads() {
    let records = spiral(400).enumerate().map(|(i, d)| star(d, (i % 9) as f32)).collect();
    let set = snapshot(records).stars;
    let mapping = Fisheye::new([300, 300], FisheyeMapping::Equidistant, PI).unwrap();
    let gaussian = Gaussian::new(0.05).unwrap();
    let stars = stars_for(&set, Eye::default(), 0.0);
    assert_eq!(stars.len(), 400);
    let brighter = steradian::units::illuminance_lx_from_magnitude(4.5);
    assert_eq!(stars_for(&set, Eye::default(), brighter).len(), 224, "magnitudes 0 to 4");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| [SkyKernel::Point, SkyKernel::Spread(&gaussian)].map(|kernel| draw(&stars, &mapping, kernel)))
    };
    let one = on(1);
    for threads in [2, 5] {
        assert!(on(threads) == one, "{threads} threads");
    }
}

#[test]
fn a_moving_eye_sees_the_twins_stars() {
    let set = snapshot(spiral(200).enumerate().map(|(i, d)| star(d, (i % 7) as f32)).collect()).stars;
    let mapping = Equirectangular::new([64, 32]).unwrap();
    let light = |velocity_c: DVec3| {
        let eye = Eye { velocity_c, ..Eye::default() };
        let truth = draw(&stars_for(&set, eye, 0.0), &mapping, SkyKernel::Point);
        let twin = steradian::reference::stars::splat::draw(&set, eye, &mapping, |_| Some(SplatKernel::Tent));
        let sum = |image: &ReferenceImage| image.illuminance_lx.iter().map(|rgb| luminance(*rgb)).sum::<f64>();
        assert!((sum(&truth) / sum(&twin) - 1.0).abs() < 6.4e-15);
        sum(&truth)
    };
    assert!(light(DVec3::X * 0.5) / light(DVec3::ZERO) > 1.01, "not those of an eye at rest");
}

use std::f64::consts::PI;

use super::*;
use crate::view::projection::{TabulatedMapping, pixel_centre};

/// Direction of a point of the raster (0 to 1) as seen from the centre of a dome of radius 8 m, for a projector on the
/// rim that throws across the dome.
fn thrown(u: f64, v: f64) -> DVec3 {
    let from = DVec3::new(-1.0, -0.5, 7.8);
    let aim = (DVec3::new(0.3, 4.0, -6.0) - from).normalize();
    let right = aim.cross(DVec3::Y).normalize();
    let up = right.cross(aim);
    let ray = (aim + right * 0.55 * (2.0 * u - 1.0) - up * 0.35 * (2.0 * v - 1.0)).normalize();
    // Intersection of the ray with the sphere, in the direction away from the projector.
    let along = from.dot(ray);
    let distance = -along + (along * along - from.length_squared() + 64.0).sqrt();
    (from + distance * ray).normalize()
}

const SIZE: [u32; 2] = [192, 108];

fn grid(samples: [usize; 2], placement: Placement, interpolation: Interpolation) -> DirectionGrid {
    let [columns, rows] = samples;
    let fraction = |index: usize, samples: usize| match placement {
        Placement::Corners => index as f64 / (samples - 1) as f64,
        Placement::Centres => (index as f64 + 0.5) / samples as f64,
    };
    let points = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    let directions = points.map(|(x, y)| Some(thrown(fraction(x, columns), fraction(y, rows)))).collect();
    DirectionGrid { columns, rows, samples: directions, placement, interpolation }
}

fn analytic_sr(x: u32, y: u32) -> f64 {
    let [width, height] = SIZE.map(f64::from);
    let direction_at = |dx: f64, dy: f64| thrown((f64::from(x) + 0.5 + dx) / width, (f64::from(y) + 0.5 + dy) / height);
    let h = 1e-4;
    (direction_at(h, 0.0) - direction_at(-h, 0.0)).cross(direction_at(0.0, h) - direction_at(0.0, -h)).length()
        / (4.0 * h * h)
}

/// Largest error of direction, rad, and largest relative error of solid angle.
fn errors(warp: &Warp) -> [f64; 2] {
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
    let mut worst = [0.0_f64; 2];
    for (x, y) in pixels {
        let centre = pixel_centre(x, y);
        let exact = thrown(centre.x / f64::from(SIZE[0]), centre.y / f64::from(SIZE[1]));
        let direction = warp.direction_from_pixel(centre).unwrap();
        worst[0] = worst[0].max(direction.angle_between(exact));
        worst[1] = worst[1].max((warp.solid_angle_sr(x, y) / analytic_sr(x, y) - 1.0).abs());
    }
    worst
}

#[test]
fn directions_and_solid_angles_match_the_geometry() {
    use Interpolation::{Linear, Smooth};
    use Placement::{Centres, Corners};
    let whole = [SIZE[0] as usize, SIZE[1] as usize];
    for (samples, placement, interpolation, direction, omega) in [
        ([33, 33], Corners, Smooth, 4e-6, 3.5e-4),
        ([65, 65], Corners, Smooth, 2.5e-7, 1e-5),
        ([65, 65], Centres, Smooth, 1e-6, 1.6e-4),
        (whole, Centres, Smooth, 1e-7, 4e-6),
        ([33, 33], Corners, Linear, 1e-2, 0.2),
    ] {
        let warp = Warp::new(SIZE, &grid(samples, placement, interpolation)).unwrap();
        let found = errors(&warp);
        println!("{samples:?} {placement:?} {interpolation:?}: {:.1e} rad, {:.1e}", found[0], found[1]);
        assert!(found[0] < direction && found[1] < omega, "{samples:?} {placement:?} {interpolation:?}: {found:?}");
    }
    // A grid read with the other placement, or with rows upside down, is detected.
    let mut wrong = grid([33, 33], Placement::Corners, Interpolation::Smooth);
    wrong.placement = Placement::Centres;
    assert!(errors(&Warp::new(SIZE, &wrong).unwrap())[0] > 1e-3);
    let mut turned = grid([33, 33], Placement::Corners, Interpolation::Smooth);
    turned.samples = turned.samples.chunks(33).rev().flatten().copied().collect();
    assert!(errors(&Warp::new(SIZE, &turned).unwrap())[0] > 0.1);
}

/// A mesh of 33 x 33 samples, measured to a tenth of a pixel of a raster of 1920 x 1080: its solid angles are as accurate as the measurement.
#[test]
fn a_measured_mesh_has_errors_of_the_size_of_its_noise() {
    let mut samples = grid([33, 33], Placement::Corners, Interpolation::Smooth);
    let pixel_rad = analytic_sr(SIZE[0] / 2, SIZE[1] / 2).sqrt() * f64::from(SIZE[0]) / 1920.0;
    let mut state = 7_u64;
    // The sum of twelve uniform numbers minus 6 has a standard deviation of 1.
    let mut normal = || {
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    for direction in samples.samples.iter_mut().flatten() {
        *direction = (*direction + DVec3::new(normal(), normal(), normal()) * 0.1 * pixel_rad).normalize();
    }
    let warp = Warp::new(SIZE, &samples).unwrap();
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
    let off: Vec<f64> = pixels.map(|(x, y)| warp.solid_angle_sr(x, y) / analytic_sr(x, y) - 1.0).collect();
    let rms = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    let largest = off.iter().map(|off| off.abs()).fold(0.0, f64::max);
    println!("measured to 0.1 px: solid angles {rms:.1e} rms, {largest:.1e} at most");
    assert!((1e-3..1.2e-2).contains(&rms) && largest < 6e-2, "{rms} {largest}");
}

#[test]
fn positions_are_found_to_1e6_px_inside_and_slightly_beyond() {
    let warp = Warp::new(SIZE, &grid([33, 33], Placement::Corners, Interpolation::Smooth)).unwrap();
    for step in 0..2000 {
        let [u, v] = [7.0_f64, 13.0].map(|prime| (f64::from(step) * prime.sqrt()).fract());
        let pixel = DVec2::new(u * f64::from(SIZE[0]), v * f64::from(SIZE[1]));
        let direction = warp.direction_from_pixel(pixel).unwrap();
        let found = warp.pixel_from_direction(direction * 3.0).unwrap();
        assert!(found.distance(pixel) < 1e-6, "{pixel} {found}");
    }
    let beyond = warp.pixel_from_direction(thrown(-0.01, 0.5)).unwrap();
    assert!((beyond.x + 0.01 * f64::from(SIZE[0])).abs() < 1e-3, "{beyond}");
    assert_eq!(warp.direction_from_pixel(DVec2::new(-0.1, 5.0)), None);
    let cone = warp.bounding_cone(2.0);
    assert!(
        cone.half_angle_rad < 0.5 * PI
            && [0.0, 1.0].iter().all(|v| thrown(-0.005, *v).angle_between(cone.axis) < cone.half_angle_rad)
    );
    for far in [DVec3::Y * -1.0, DVec3::Z, thrown(1.5, 0.5)] {
        assert_eq!(warp.pixel_from_direction(far), None, "{far}");
    }
}

#[test]
fn a_warp_can_be_tabulated_and_a_fold_is_refused_with_its_pixel() {
    let samples = grid([33, 33], Placement::Corners, Interpolation::Smooth);
    let table = TabulatedMapping::new(Warp::new(SIZE, &samples).unwrap()).unwrap();
    let sum: f64 = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| analytic_sr(x, y))).sum();
    assert!((table.picture_solid_angle_sr() / sum - 1.0).abs() < 1e-5 && sum < 2.0 * PI);
    let mut folded = samples.clone();
    // The last columns fold back.
    for row in folded.samples.chunks_mut(33) {
        for column in 28..33 {
            row[column] = row[2 * 27 - column];
        }
    }
    let error = TabulatedMapping::new(Warp::new(SIZE, &folded).unwrap()).unwrap_err().to_string();
    assert!(error.starts_with("pixel (1"), "{error}");
}

#[test]
fn unknown_samples_are_outside_and_do_not_distort_the_inside() {
    let mut samples = grid([65, 65], Placement::Corners, Interpolation::Smooth);
    for (index, direction) in samples.samples.iter_mut().enumerate() {
        let [x, y] = [index % 65, index / 65];
        if x < 8 || (x + y > 100) {
            *direction = None;
        }
    }
    let warp = Warp::new(SIZE, &samples).unwrap();
    let mut worst = [0.0_f64; 2];
    let mut inside = 0;
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let centre = pixel_centre(x, y);
        let [u, v] = [centre.x / f64::from(SIZE[0]), centre.y / f64::from(SIZE[1])];
        let known = (64.0 * u).floor() >= 8.0 && (64.0 * u).floor() + (64.0 * v).floor() + 2.0 <= 100.0;
        assert_eq!(warp.contains(x, y), known, "{x} {y}");
        if known {
            inside += 1;
            worst[0] = worst[0].max(warp.direction_from_pixel(centre).unwrap().angle_between(thrown(u, v)));
            worst[1] = worst[1].max((warp.solid_angle_sr(x, y) / analytic_sr(x, y) - 1.0).abs());
        } else {
            assert_eq!(warp.solid_angle_sr(x, y), 0.0);
        }
    }
    println!("next to unknown samples: {:.1e} rad, {:.1e}", worst[0], worst[1]);
    assert!(inside > 10_000 && worst[0] < 1e-4 && worst[1] < 2e-2, "{worst:?}");
}

/// A map of flat facets that reports solid angles multiplied by a wrong factor.
struct Wrong(Warp, f64);

impl PlaneMapping for Wrong {
    fn size(&self) -> [u32; 2] {
        self.0.size()
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        self.0.pixel_from_direction(direction)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        self.0.direction_from_pixel(pixel)
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        self.1 * self.0.solid_angle_sr(x, y)
    }

    fn is_faceted(&self) -> bool {
        true
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        self.0.bounding_cone(margin_px)
    }
}

#[test]
fn flat_facets_have_the_whole_light_and_wrong_solid_angles_are_refused() {
    // Samples at the centres of pixels, on facets of 8 x 6 pixels with different slopes.
    let mut facets = grid([25, 19], Placement::Corners, Interpolation::Linear);
    for (index, direction) in facets.samples.iter_mut().enumerate() {
        let [x, y] = [(index % 25) as f64 / 24.0, (index / 25) as f64 / 18.0];
        let by = 0.004 * (index as f64 * 2.4).sin() * (PI * x).sin() * (PI * y).sin();
        *direction = Some(thrown(x + by, y - by));
    }
    let table = |factor: f64| TabulatedMapping::new(Wrong(Warp::new(SIZE, &facets).unwrap(), factor));
    let right = table(1.0).unwrap();
    // The outline of the raster is the polygon of the outermost samples: the facets inside do not matter.
    let at = |x: usize, y: usize| facets.samples[y * 25 + x].unwrap();
    let inner = at(12, 9);
    let outline: Vec<DVec3> = (0..24)
        .map(|x| at(x, 0))
        .chain((0..18).map(|y| at(24, y)))
        .chain((1..25).rev().map(|x| at(x, 18)))
        .chain((1..19).rev().map(|y| at(0, y)))
        .collect();
    let sum: f64 = (0..outline.len()).map(|i| triangle_sr(inner, outline[i], outline[(i + 1) % outline.len()])).sum();
    let found = right.picture_solid_angle_sr();
    assert!((found / sum.abs() - 1.0).abs() < 1e-9, "{found} {sum}");
    for factor in [0.8, 1.2] {
        let error = table(factor).unwrap_err().to_string();
        assert!(error.contains("its solid angle is"), "{error}");
    }
}

#[test]
fn a_content_ends_at_its_border_and_not_at_cells() {
    let samples = grid([9, 9], Placement::Corners, Interpolation::Smooth);
    let places: Vec<Option<DVec2>> = (0..81).map(|i| Some(DVec2::new((i % 9) as f64, (i / 9) as f64) / 8.0)).collect();
    let half = DVec2::splat(0.5);
    let shape = ContentShape { low: DVec2::new(0.3, 0.0), high: DVec2::ONE, ellipse: Some([half, half]) };
    let border = Border { places: places.clone(), shape };
    let warp = Warp::within(SIZE, &samples, Some(&border)).unwrap();
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let place = pixel_centre(x, y) / DVec2::from(SIZE.map(f64::from));
        assert_eq!(warp.contains(x, y), shape.holds(place), "{x} {y}");
        assert_eq!(warp.solid_angle_sr(x, y) > 0.0, shape.holds(place), "{x} {y}");
    }
    assert!(TabulatedMapping::new(warp).is_ok());
    let few = Border { places: places[1..].to_vec(), shape };
    let error = Warp::within(SIZE, &samples, Some(&few)).unwrap_err();
    assert_eq!(error, WarpError::Border { places: 80, samples: 81 });
    let beside = Border { places: vec![Some(DVec2::splat(7.0)); 81], shape };
    assert_eq!(Warp::within(SIZE, &samples, Some(&beside)).unwrap_err(), WarpError::Empty);
}

#[test]
fn invalid_grids_are_refused() {
    let right = grid([4, 4], Placement::Corners, Interpolation::Smooth);
    let refused = |change: &dyn Fn(&mut DirectionGrid)| {
        let mut grid = right.clone();
        change(&mut grid);
        Warp::new(SIZE, &grid).unwrap_err()
    };
    assert!(matches!(refused(&|grid| (grid.columns, grid.rows) = (1, 16)), WarpError::Samples { .. }));
    assert!(matches!(refused(&|grid| grid.rows = 5), WarpError::Samples { .. }));
    for wrong in [DVec3::ZERO, DVec3::NAN, DVec3::new(0.0, 0.0, 2.0)] {
        assert!(matches!(
            refused(&|grid| grid.samples[6] = Some(wrong)),
            WarpError::Direction { column: 2, row: 1, .. }
        ));
    }
    assert_eq!(refused(&|grid| grid.samples.iter_mut().step_by(2).for_each(|d| *d = None)), WarpError::Empty);
    assert!(matches!(Warp::new([0, 4], &right), Err(WarpError::Size(_))));
}

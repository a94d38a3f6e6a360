//! Tests the grid against closed forms, and the stars against the picture.

use std::f64::consts::PI;

use super::*;

fn settings(cells: u32, layers: u32) -> CellSkySettings {
    CellSkySettings { cells, layers, ..CellSkySettings::default() }
}

/// Returns directions spread evenly over the sphere.
fn spiral(count: u32) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
        let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
        DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
    })
}

#[test]
fn faces_and_distortion_are_invertible() {
    for direction in spiral(5000) {
        let (face, uv) = face_place(direction * 3.0);
        assert!(uv.abs().max_element() <= 1.0);
        assert!((face_direction(face, uv) - direction).length() < 1e-14);
        let distorted = distort(uv);
        assert!(distorted.abs().max_element() <= 1.0 + 1e-15, "{uv} leaves the face");
        assert!((straighten(distorted) - uv).length() < 1e-12, "{uv}");
    }
    assert_eq!(straighten(DVec2::ZERO), DVec2::ZERO);
    assert!((straighten(DVec2::ONE) - DVec2::ONE).length() < 1e-12);
    // The distortion moves points that are not at an edge.
    assert!((distort(DVec2::splat(0.5)) - DVec2::splat(0.5)).length() > 0.1);
}

#[test]
fn cells_of_two_faces_meet_at_the_edges() {
    // Along every edge of the cube, both faces have the same coordinate, so cell borders are continuous.
    let mut edges = 0;
    for face in 0..6 {
        for (fixed, sign) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
            for i in -9..=9 {
                let along = f64::from(i) * 0.1;
                let uv = |edge: f64| if fixed == 0 { DVec2::new(edge, along) } else { DVec2::new(along, edge) };
                let inside = distort(uv(sign * (1.0 - 1e-9)));
                // A point slightly beyond the edge is on the other face.
                let (other, beyond) = face_place(face_direction(face, uv(sign * (1.0 + 1e-9))));
                assert_ne!(other, face);
                let beyond = distort(beyond);
                let (a, b) = (inside.abs(), beyond.abs());
                let free = if fixed == 0 { a.y } else { a.x };
                assert!((a.max_element() - 1.0).abs() < 1e-8 && (b.max_element() - 1.0).abs() < 1e-8);
                assert!((b.min_element() - free).abs() < 1e-8, "{inside} {beyond}");
                edges += 1;
            }
        }
    }
    assert_eq!(edges, 6 * 4 * 19);
}

/// Returns the ratio of the largest solid angle to the smallest, and of the standard deviation to the mean.
fn spread(areas: &[f64]) -> (f64, f64) {
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let variance = areas.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / areas.len() as f64;
    let (least, most) = areas.iter().fold((f64::MAX, 0.0_f64), |(l, m), a| (l.min(*a), m.max(*a)));
    (most / least, variance.sqrt() / mean)
}

#[test]
fn the_distortion_makes_cells_more_equal_and_equal_angles_still_more() {
    let measured = [FaceGrid::Plain, FaceGrid::Published, FaceGrid::Equiangular].map(|grid| {
        let areas = grid.solid_angles_sr(200);
        // A face is a sixth of the sphere for every grid. With a wrong area law the sum would differ.
        let total: f64 = areas.iter().sum();
        assert!((total / (4.0 * PI / 6.0) - 1.0).abs() < 1e-5, "{grid:?}: {total}");
        let (ratio, deviation) = spread(&areas);
        println!("{grid:?}: largest / smallest {ratio:.3}, std / mean {deviation:.4}");
        (ratio, deviation)
    });
    let [plain, published, equiangular] = measured;
    assert!((plain.0 - 5.15).abs() < 0.1 && (published.0 - 1.92).abs() < 0.1 && (equiangular.0 - 1.41).abs() < 0.05);
    assert!(plain.1 > 3.0 * published.1 && published.1 > 1.2 * equiangular.1);
    // A face with a wrong area law is detected by the sum.
    let wrong: f64 = FaceGrid::Published.solid_angles_sr(50).iter().map(|a| a * (1.0 + 1e-3)).sum();
    assert!((wrong / (4.0 * PI / 6.0) - 1.0).abs() > 1e-5);
}

#[test]
fn areas_of_cells_match_counts_of_directions() {
    // Independent of the closed forms: count evenly spread directions per cell of a coarse grid.
    let (cells, count) = (8, 600_000);
    let mut hits = vec![0.0; 64];
    for (face, uv) in spiral(count).map(face_place) {
        if face == 1 {
            let cell = ((distort(uv) * 0.5 + 0.5) * 8.0).floor().min(DVec2::splat(7.0));
            hits[cell.y as usize * 8 + cell.x as usize] += 4.0 * PI / f64::from(count);
        }
    }
    let error = |grid: FaceGrid| -> f64 {
        let areas = grid.solid_angles_sr(cells);
        areas.iter().zip(&hits).map(|(a, h): (&f64, &f64)| (h / a - 1.0).abs()).fold(0.0, f64::max)
    };
    println!(
        "counted against computed: {:.4}; against the plain grid {:.2}",
        error(FaceGrid::Published),
        error(FaceGrid::Plain)
    );
    assert!(error(FaceGrid::Published) < 0.01);
    assert!(error(FaceGrid::Plain) > 0.3);
}

#[test]
fn stars_are_where_the_picture_is_brightest() {
    let settings = settings(16, 1);
    let pixel_rad = 0.002;
    let mut checked = 0;
    for (direction, brightness_of_star) in stars(&settings) {
        let peak: f64 = luminance(brightness(direction, pixel_rad, &settings));
        assert!((peak / brightness_of_star - 1.0).abs() < 1e-6, "{peak} {brightness_of_star}");
        // Four radii away the picture is dark, so the star is not larger than specified.
        let side = direction.any_orthonormal_vector();
        let away = (direction + side * 4.0 * settings.radius_px * pixel_rad).normalize();
        assert_eq!(brightness(away, pixel_rad, &settings), [0.0; 3]);
        checked += 1;
    }
    assert!(checked > 400, "{checked}");
    // The stars of another seed are elsewhere.
    let other = CellSkySettings { seed: 2, ..settings };
    let lit = stars(&other).filter(|(d, _)| luminance(brightness(*d, pixel_rad, &settings)) > 0.0).count();
    assert!(lit < 20, "{lit}");
}

fn luminance(rgb: [f64; 3]) -> f64 {
    crate::photometry::rec709::luminance(rgb)
}

/// Returns the half widths of a star in the sky, pixels: the largest and the smallest over all directions around it.
fn half_widths_px(direction: DVec3, settings: &CellSkySettings, pixel_rad: f64) -> (f64, f64) {
    let u = direction.any_orthonormal_vector();
    let v = direction.cross(u);
    let reach = |angle: f64| {
        let side = u * angle.cos() + v * angle.sin();
        let (mut low, mut high) = (0.0, 6.0);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            let lit = brightness((direction + side * middle * pixel_rad).normalize(), pixel_rad, settings) != [0.0; 3];
            (low, high) = if lit { (middle, high) } else { (low, middle) };
        }
        low
    };
    let reaches: Vec<f64> = (0..180).map(|i| reach(f64::from(i) / 180.0 * PI)).collect();
    reaches.iter().fold((0.0, f64::MAX), |(most, least), r| (f64::max(most, *r), f64::min(least, *r)))
}

#[test]
fn stars_are_round_in_the_middle_of_a_face_and_not_at_its_edges() {
    let settings = settings(64, 1);
    for pixel_rad in [1e-4, 1e-3] {
        let shape = |place: DVec2| {
            let nearest = stars(&settings)
                .filter(|(d, _)| face_place(*d).0 == 0)
                .min_by(|a, b| face_place(a.0).1.distance(place).total_cmp(&face_place(b.0).1.distance(place)))
                .expect("a star");
            half_widths_px(nearest.0, &settings, pixel_rad)
        };
        let [middle, edge, corner] = [DVec2::ZERO, DVec2::new(1.0, 0.0), DVec2::new(0.999, 0.98)].map(shape);
        println!(
            "pixels of {pixel_rad} rad: half widths in px, middle {:.2} x {:.2}, edge {:.2} x {:.2}, corner {:.2} x {:.2}",
            middle.0, middle.1, edge.0, edge.1, corner.0, corner.1
        );
        // About radius_px for any zoom.
        assert!((middle.0 - 1.0).abs() < 0.06 && (middle.1 - 1.0).abs() < 0.06, "{middle:?}");
        assert!(edge.0 / edge.1 > 1.3 && corner.0 / corner.1 > 1.5, "{edge:?} {corner:?}");
    }
}

#[test]
fn density_has_a_band_and_stars_follow_it() {
    let pole = direction_from_lon_lat(GALACTIC_POLE_RA_DEG.to_radians(), GALACTIC_POLE_DEC_DEG.to_radians());
    let settings = settings(48, 2);
    let (mut band, mut cap) = (0.0, 0.0);
    let mut expected = [0.0; 2];
    for (direction, _) in stars(&settings) {
        let sine = direction.dot(pole).abs();
        band += f64::from(u8::from(sine < 0.1));
        cap += f64::from(u8::from(sine > 0.6));
    }
    // Every cell is weighted with the density at its centre.
    for direction in spiral(200_000) {
        let sine = direction.dot(pole).abs();
        expected[0] += density(direction) * f64::from(u8::from(sine < 0.1)) / 200_000.0;
        expected[1] += density(direction) * f64::from(u8::from(sine > 0.6)) / 200_000.0;
    }
    let ratio = (band / cap) / (expected[0] / expected[1]);
    println!("{band} stars in the band, {cap} in the caps; their ratio over that of the density {ratio:.3}");
    // Only approximate, because cells have different areas.
    assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
    assert!((density(pole) - EVEN_DENSITY).abs() < 1e-6 && density(pole.any_orthonormal_vector()) == 1.0);
}

#[test]
fn brightness_is_in_range_and_random_numbers_are_uniform() {
    let settings = settings(40, 2);
    let mut brightest: f64 = 0.0;
    let mut above = [0.0; 2];
    for (_, b) in stars(&settings) {
        assert!((FAINTEST..=1.0 + 1e-9).contains(&b), "{b}");
        brightest = brightest.max(b);
        above[0] += f64::from(u8::from(b > 0.05));
        above[1] += f64::from(u8::from(b > 0.1));
    }
    // The number of stars brighter than b is proportional to b^-1.5, slightly less near the upper end.
    let slope = f64::log2(above[0] / above[1]);
    println!("brightest {brightest:.3}, slope of the numbers {slope:.2}");
    assert!(brightest > 0.3 && (slope - 1.5).abs() < 0.25, "{brightest} {slope}");
    let mean = (0..100_000).map(|i| unit(hash(i))).sum::<f64>() / 1e5;
    assert!((mean - 0.5).abs() < 3e-3, "{mean}");
}

#[test]
fn layers_differ_and_add_up() {
    let two = settings(12, 2);
    let one = settings(12, 1);
    let both = stars(&two).count();
    let first: Vec<(DVec3, f64)> = stars(&one).collect();
    assert!(both > first.len() + first.len() / 2);
    assert!(stars(&two).take(first.len()).eq(first.iter().copied()));
    let second: Vec<(DVec3, f64)> = stars(&two).skip(first.len()).collect();
    assert!(second.iter().all(|star| !first.contains(star)));
}

//! Tables of mappings with known results, and mappings that no table can represent.

use std::f64::consts::TAU;

use super::*;
use crate::view::projection::{CubeFace, Face, Fisheye, FisheyeMapping, Perspective, Projection, pixel_centre};

/// A perspective picture with a modification.
struct Changed {
    base: Perspective,
    /// Maps from a point of this picture to the point of the base picture, and back.
    there: fn(DVec2) -> DVec2,
    back: fn(DVec2) -> DVec2,
    /// Factor applied to solid angles.
    omega: f64,
    claims_everything: bool,
}

const SIDE: u32 = 64;

fn base() -> Perspective {
    Perspective::symmetric([SIDE; 2], 1.0).unwrap()
}

fn changed(there: fn(DVec2) -> DVec2, back: fn(DVec2) -> DVec2) -> Changed {
    Changed { base: base(), there, back, omega: 1.0, claims_everything: false }
}

impl PlaneMapping for Changed {
    fn size(&self) -> [u32; 2] {
        self.base.size()
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        self.base.pixel_from_direction(direction).map(self.back)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let there = (self.there)(pixel);
        if there.is_nan() { Some(DVec3::NAN) } else { self.base.direction_from_pixel(there) }
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        let there = (self.there)(pixel_centre(x, y));
        self.omega * self.base.solid_angle_sr(there.x as u32, there.y as u32)
    }

    fn shows_full_sphere(&self) -> bool {
        self.claims_everything
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        self.base.bounding_cone(margin_px)
    }
}

/// A perspective picture whose mapping ends at its border.
struct Ending(Perspective);

impl PlaneMapping for Ending {
    fn size(&self) -> [u32; 2] {
        self.0.size()
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let [width, height] = self.size().map(f64::from);
        let inside = |pixel: &DVec2| (0.0..=width).contains(&pixel.x) && (0.0..=height).contains(&pixel.y);
        self.0.pixel_from_direction(direction).filter(inside)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        self.0.direction_from_pixel(pixel)
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        self.0.solid_angle_sr(x, y)
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        self.0.bounding_cone(margin_px)
    }
}

#[test]
fn a_picture_of_one_pixel_or_one_line_is_drawn_or_refused() {
    let table = |size| TabulatedMapping::new(Ending(Perspective::symmetric(size, 0.02).unwrap()));
    assert_eq!(table([1, 1]).unwrap_err(), TabulationError::TooSmall { width: 1, height: 1 });
    for size in [[1, 48], [48, 1], [1, 2], [2, 1]] {
        let result = table(size);
        assert!(matches!(result, Ok(_) | Err(TabulationError::TooSmall { .. })), "{size:?}: {result:?}");
    }
    assert!(table([2, 2]).is_ok());
}

/// Directions spread over the sphere.
fn sphere(count: u32) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
        let (sin, cos) = (f64::from(i) * 0.381_966_011_25 * TAU).sin_cos();
        DVec3::new((1.0 - z * z).sqrt() * cos, z, (1.0 - z * z).sqrt() * sin)
    })
}

/// Greatest distance between the table and the mapping over directions in the picture, and the number of these
/// directions.
fn farthest_px(table: &TabulatedMapping) -> (f64, usize) {
    let mut worst: f64 = 0.0;
    let mut count = 0;
    for direction in sphere(60_000) {
        let Some(image) = table.pixel_from_direction(direction) else { continue };
        let inside = image.x >= 0.0 && image.y >= 0.0 && table.contains(image.x as u32, image.y as u32);
        if inside {
            worst = worst.max(table.lookup(direction).map_or(f64::INFINITY, |found| found.distance(image)));
            count += 1;
        }
    }
    (worst, count)
}

#[test]
fn tables_of_smooth_mappings_find_every_direction() {
    let fisheye = |mapping, degrees: f64| Fisheye::new([96, 80], mapping, degrees.to_radians()).unwrap();
    let off_axis = Perspective::off_axis([96, 64], -0.2, 1.1, 0.9, -0.1).unwrap();
    // Bounds are four times the measured values.
    let tables = [
        (TabulatedMapping::new(base()), 8e-5),
        (TabulatedMapping::new(off_axis), 4e-4),
        (TabulatedMapping::new(CubeFace::new(Face::Up, 96).unwrap()), 2e-4),
        (TabulatedMapping::new(fisheye(FisheyeMapping::Equidistant, 180.0)), 3e-4),
        (TabulatedMapping::new(fisheye(FisheyeMapping::Stereographic, 250.0)), 1.6e-3),
        (TabulatedMapping::new(fisheye(FisheyeMapping::Equidistant, 360.0)), 8e-3),
    ];
    for (table, bound_px) in tables {
        let table = table.unwrap();
        let (worst_px, count) = farthest_px(&table);
        assert!(count > 1000 && worst_px < bound_px, "{table:?}: {worst_px} px over {count} directions");
        assert!(table.accuracy().smooth_px <= LIMIT_PX && !table.has_cut());
    }
}

#[test]
fn a_table_agrees_with_its_mapping() {
    let fisheye = Fisheye::new([96, 80], FisheyeMapping::Equisolid, 3.0).unwrap();
    let table = Arc::new(TabulatedMapping::new(fisheye).unwrap());
    for (x, y) in [(48, 40), (10, 41), (20, 12), (0, 0), (95, 40), (47, 79), (200, 3)] {
        assert_eq!(table.contains(x, y), fisheye.contains(x, y), "({x}, {y})");
        assert_eq!(table.solid_angle_sr(x, y), fisheye.solid_angle_sr(x, y), "({x}, {y})");
        assert_eq!(table.direction_from_pixel(pixel_centre(x, y)), fisheye.direction_from_pixel(pixel_centre(x, y)));
    }
    let projection = Projection::Tabulated(Arc::clone(&table));
    let closed = Projection::Fisheye(fisheye);
    for (tabulated, closed_form) in [
        (projection.picture_solid_angle_sr(), closed.picture_solid_angle_sr()),
        (projection.middle_pixel_rad(), closed.middle_pixel_rad()),
        (projection.smallest_pixel_sr(), closed.smallest_pixel_sr()),
    ] {
        assert!((tabulated / closed_form - 1.0).abs() < 2e-3, "{tabulated} {closed_form}");
    }
    // Every direction of the picture lies in the cone, with a margin.
    let cone = table.bounding_cone(4.0);
    assert!(cone.half_angle_rad >= fisheye.bounding_cone(4.0).half_angle_rad && cone.half_angle_rad < 2.0);
    assert_eq!(projection, Projection::Tabulated(Arc::clone(&table)));
    assert_ne!(projection, Projection::Tabulated(Arc::new(TabulatedMapping::new(fisheye).unwrap())));
}

#[test]
fn a_wholly_mirrored_picture_is_allowed() {
    let mirror = |p: DVec2| DVec2::new(f64::from(SIDE) - p.x, p.y);
    let table = TabulatedMapping::new(changed(mirror, mirror)).unwrap();
    let (worst_px, _) = farthest_px(&table);
    assert!(worst_px < 8e-5, "{worst_px}");
}

fn refusal(mapping: Changed) -> String {
    TabulatedMapping::new(mapping).unwrap_err().to_string()
}

#[test]
fn mappings_that_no_table_can_represent_are_refused_with_the_pixel() {
    let same = |p: DVec2| p;
    // NaN at one pixel.
    let error = refusal(changed(|p| if p.floor() == DVec2::new(7.0, 5.0) { DVec2::NAN } else { p }, same));
    assert!(error.starts_with("pixel (7, 5): its direction") && error.contains("not a unit vector"), "{error}");
    // Folded along column 40: two pixels show the same direction.
    let error = refusal(changed(|p| DVec2::new(40.0 - (p.x - 40.0).abs(), p.y), same));
    assert!(error.starts_with("pixel (40, 0)") && error.contains("two parts of the picture"), "{error}");
    // The left part is mirrored in place. The two functions are still inverse to each other, but the orientation of that part is reversed.
    let half = |p: DVec2| if p.x < 32.0 { DVec2::new(32.0 - p.x, p.y) } else { p };
    let error = refusal(changed(half, half));
    assert!(error.starts_with("pixel (31, 0)") && error.contains("mirrored"), "{error}");
    // Two rows swapped.
    let swapped = |p: DVec2| match p.y.floor() as i32 {
        20 => p + DVec2::new(0.0, 12.0),
        32 => p - DVec2::new(0.0, 12.0),
        _ => p,
    };
    let error = refusal(changed(swapped, swapped));
    assert!(error.starts_with("pixel (0, 20)") || error.starts_with("pixel (0, 19)"), "{error}");
    // Twelve columns of the base picture are left out, without a gap between the two sides.
    let torn = |p: DVec2| if p.x < 31.2 { p } else { p + DVec2::new(12.0, 0.0) };
    let mended = |p: DVec2| if p.x < 43.2 { p } else { p - DVec2::new(12.0, 0.0) };
    let error = refusal(changed(torn, mended));
    assert!(error.starts_with("pixel (3") && (error.contains("torn") || error.contains("pieces")), "{error}");
    // Twice the true solid angle.
    let error = refusal(Changed { omega: 2.0, ..changed(same, same) });
    assert!(error.starts_with("pixel (0, 0): its solid angle"), "{error}");
    let error = refusal(Changed { omega: f64::NAN, ..changed(same, same) });
    assert!(error.starts_with("pixel (0, 0): its solid angle is NaN"), "{error}");
    // A window is not the sphere.
    let error = refusal(Changed { claims_everything: true, ..changed(same, same) });
    assert!(error.contains("full sphere"), "{error}");
    // The two functions are not inverse to each other: they differ by half a pixel.
    let error = refusal(changed(same, |p| p + DVec2::new(0.5, 0.0)));
    assert!(error.starts_with("pixel (0, 0): the picture shows its direction at (1.000, 0.500)"), "{error}");
    // The unmodified base is accepted.
    assert!(TabulatedMapping::new(changed(same, same)).is_ok());
}

#[test]
fn a_wrong_table_is_found() {
    let right = TabulatedMapping::new(base()).unwrap();
    assert!(farthest_px(&right).0 < LIMIT_PX);
    // Two rows of directions swapped.
    let mut wrong = TabulatedMapping::new(base()).unwrap();
    let columns = 64 + 2 * FRINGE as usize;
    for x in 0..columns {
        wrong.baked.nodes.values.swap(30 * columns + x, 31 * columns + x);
    }
    assert!(farthest_px(&wrong).0 > LIMIT_PX);
    // Directions rotated by a quarter of a pixel.
    let mut wrong = TabulatedMapping::new(base()).unwrap();
    for value in &mut wrong.baked.nodes.values {
        value[0] += 0.25 / 64.0;
    }
    assert!(farthest_px(&wrong).0 > LIMIT_PX);
}

#[test]
fn the_table_has_the_reported_size() {
    let table = TabulatedMapping::new(base()).unwrap();
    let words = table.words();
    assert_eq!(words.len() as u64 * 16, table.bytes());
    let node = |x: i64, y: i64| words[HEADER as usize + ((y + FRINGE) * (64 + 2 * FRINGE) + x + FRINGE) as usize];
    let omega = f32::from_bits(node(10, 20)[3]);
    assert!((f64::from(omega) / base().solid_angle_sr(10, 20) - 1.0).abs() < 1e-6);
    assert_eq!(node(-1, 5)[3], 0, "beyond the border");
    let [x, y, z] = [0, 1, 2].map(|i| f64::from(f32::from_bits(node(-3, 5)[i])));
    let image = base().pixel_from_direction(DVec3::new(x, y, z)).unwrap();
    assert!(image.distance(DVec2::new(-2.5, 5.5)) < 1e-4, "the mapping continues there: {image}");
}

//! Instances: packing, spin, positions, sizes, groups.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::scene::asteroids::{
    BRANCHING, FieldError, FieldParameters, GROUP, Instances, PackedAsteroid, Placement,
    packed::{Asteroid, RADIUS_PARTS},
    sphere::fibonacci_point,
};

const BELT: Placement = Placement::Belt { inner_m: 2e11, outer_m: 5e11, height_m: 1e11 };
const RING: Placement = Placement::Ring { inner_m: 7e7, outer_m: 1.4e8, thickness_m: 100.0 };

fn parameters(placement: Placement, instances: u32) -> FieldParameters {
    let radius_m = [10.0, 5000.0];
    FieldParameters { instances, seed: 5, placement, radius_m, size_index: 2.0, spin_period_s: [8e3, 8e5] }
}

fn placed(placement: Placement, instances: u32) -> Instances {
    Instances::place(&parameters(placement, instances), 3, &[1.3, 1.5, 1.9]).unwrap()
}

fn places(instances: &Instances) -> Vec<DVec3> {
    (0..instances.packed.len()).map(|k| instances.place_m(k).unwrap()).collect()
}

fn packed(axis: DVec3, phase: u16, rate: i16) -> PackedAsteroid {
    let offset_m = Vec3::new(1.5, -2.25, 1e6);
    Asteroid { offset_m, radius_over_largest: 0.3, shape: 201, axis, phase, rate }.into()
}

#[test]
fn packing_round_trips() {
    let mut worst = 0f64;
    for k in 0..20_000 {
        let axis = fibonacci_point(k, 20_000);
        let asteroid = packed(axis * 3.0, 65_535, -123);
        worst = worst.max(asteroid.axis().cross(axis).length().atan2(asteroid.axis().dot(axis)));
        assert_eq!((asteroid.shape(), asteroid.rate()), (201, -123));
        assert_eq!(asteroid.offset_m(), DVec3::new(1.5, -2.25, 1e6));
        assert!((asteroid.radius_m(1000.0) - 300.0).abs() < 500.0 / f64::from(RADIUS_PARTS));
    }
    println!("axes are packed within {worst:.1e} rad");
    assert!(worst < 8e-5, "{worst}");
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z] {
        assert_eq!(packed(axis, 0, 0).axis(), axis);
    }
    let tiny = Asteroid {
        radius_over_largest: 0.0,
        ..Asteroid { offset_m: Vec3::ZERO, radius_over_largest: 0.0, shape: 0, axis: DVec3::Z, phase: 0, rate: 0 }
    };
    assert_eq!(PackedAsteroid::from(tiny).radius_and_shape, 1);
}

#[test]
fn frames_are_right_handed_everywhere_including_minus_z() {
    let near_pole = [DVec3::new(1e-4, -1e-5, -1.0), DVec3::new(0.0, 5e-5, -1.0), -DVec3::Z, DVec3::Z, DVec3::X];
    for axis in (0..5000).map(|k| fibonacci_point(k, 5000)).chain(near_pole) {
        let asteroid = packed(axis, 16_384, 7);
        let frame = asteroid.frame();
        assert!((frame.determinant() - 1.0).abs() < 1e-12);
        let gram = frame.transpose() * frame;
        assert!((gram - glam::DMat3::IDENTITY).to_cols_array().iter().all(|d| d.abs() < 1e-12));
        assert_eq!(frame.z_axis, asteroid.axis());
        // The quaternion is the rotated frame: a quarter turn takes x to y.
        let rotation = asteroid.field_from_shape(0);
        assert!((rotation * DVec3::Z - asteroid.axis()).length() < 1e-12);
        assert!((rotation * DVec3::X - frame.y_axis).length() < 1e-12);
        assert!((rotation * DVec3::Y + frame.x_axis).length() < 1e-12);
    }
    // If |i| + |j| is 32767 the axis lies in the plane z = 0, and the sign is that of the upper half.
    let on_plane = PackedAsteroid { axis: 10_000 | 22_767 << 16, ..PackedAsteroid::default() };
    assert_eq!((on_plane.axis().z, on_plane.frame().y_axis.z), (0.0, -on_plane.axis().y));
}

#[test]
fn turns_are_exact_after_a_billion_seconds() {
    let instances = Instances { base_period_s: 7200.0 * 32_767.0, ..Instances::default() };
    for time_s in [0.0, 1.0, 86_400.5, 1e9, 1e9 + 0.125, -1e9, 3.7e11] {
        let time_parts = instances.time_parts(time_s);
        // The exact time in units of 2^-32 base periods. Both f64 numbers are multiples of 1/1024, so integers represent them exactly.
        let scaled = (time_s * 1024.0) as i128 * (1 << 32);
        let base = (instances.base_period_s * 1024.0) as i128;
        let exact_parts = scaled.div_euclid(base).rem_euclid(1 << 32) as u32;
        let off = time_parts.wrapping_sub(exact_parts) as i32;
        assert!(off.abs() <= 1 + (time_s.abs() / instances.base_period_s * 4.3e9 * 2e-16) as i32, "{time_s}: {off}");
        for (phase, rate) in [(0, 1), (40_000, 32_767), (1, -32_767), (65_535, 12), (7, 0)] {
            let asteroid = packed(DVec3::Z, phase, rate);
            let exact = (i128::from(phase) << 16) + i128::from(rate) * i128::from(time_parts);
            let exact = exact.rem_euclid(1 << 32) as u32;
            assert_eq!(asteroid.turn_parts(time_parts), exact);
            assert!((asteroid.turn(time_parts) - f64::from(exact) / 2f64.powi(32) * TAU).abs() < 1e-15);
        }
    }
    // The fastest asteroid rotates once in the shortest period, within the resolution of the time unit.
    let fast = packed(DVec3::Z, 0, 32_767);
    let quarter = fast.turn(instances.time_parts(1e9 * 7200.0 + 1800.0));
    assert!((quarter - PI / 2.0).abs() < 1e-4, "{quarter}");
    let backwards = packed(DVec3::Z, 0, -32_767).turn(instances.time_parts(1800.0));
    assert!((backwards - 1.5 * PI).abs() < 1e-4, "{backwards}");
}

/// Returns the mean of (found - expected)^2 / expected over bins of equal expectation. It is about 1 for a uniform distribution.
fn chi_square(shares: impl Iterator<Item = f64>) -> f64 {
    const BINS: usize = 40;
    let mut counts = [0.0; BINS];
    let mut total = 0.0;
    for share in shares {
        counts[((share * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        total += 1.0;
    }
    let expected = total / BINS as f64;
    counts.iter().map(|count| (count - expected).powi(2) / expected).sum::<f64>() / BINS as f64
}

fn turn_share(place: DVec3) -> f64 {
    (place.y.atan2(place.x) / TAU).rem_euclid(1.0)
}

#[test]
fn boxes_and_rings_are_filled_uniformly() {
    let size_m = DVec3::new(1e6, 3e5, 2e4);
    let shares: Vec<DVec3> =
        places(&placed(Placement::Box { size_m }, 40_000)).iter().map(|p| *p / size_m + 0.5).collect();
    for axis in 0..3 {
        assert!(shares.iter().all(|share| (-1e-6..=1.0 + 1e-6).contains(&share[axis])));
        let chi = chi_square(shares.iter().map(|share| share[axis]));
        assert!(chi < 1.8, "axis {axis}: {chi}");
        // A density that is 10 % off at the ends is detected.
        assert!(chi_square(shares.iter().map(|share| share[axis].powf(1.1))) > 2.5);
    }

    let places = places(&placed(RING, 40_000));
    let radius_share = |p: &DVec3| ((p.truncate().length() / 7e7).powi(2) - 1.0) / 3.0;
    assert!(places.iter().all(|p| (-1e-6..=1.0 + 1e-6).contains(&radius_share(p)) && p.z.abs() <= 51.0));
    for chi in [
        chi_square(places.iter().map(radius_share)),
        chi_square(places.iter().map(|p| turn_share(*p))),
        chi_square(places.iter().map(|p| p.z / 100.0 + 0.5)),
    ] {
        assert!(chi < 1.8, "{chi}");
    }
    // A distribution uniform by radius instead of by area is detected.
    assert!(chi_square(places.iter().map(|p| p.truncate().length() / 7e7 - 1.0)) > 10.0);
}

#[test]
fn belts_thin_out_towards_their_surface() {
    let instances = placed(BELT, 40_000);
    let places = places(&instances);
    let q = |p: &DVec3| ((p.truncate().length() - 3.5e11) / 1.5e11).hypot(p.z / 5e10);
    assert!(places.iter().all(|p| q(p) <= 1.0 + 1e-6));
    // By Pappus's theorem, the varying circumference does not change the distribution of q: P(q) is the integral of q cos^2(pi q / 2) up to q,
    // normalised to 1.
    let integral = |q: f64| q * q / 4.0 + q * (PI * q).sin() / (2.0 * PI) + ((PI * q).cos() - 1.0) / (2.0 * PI * PI);
    let chi = chi_square(places.iter().map(|p| integral(q(p)) / integral(1.0)));
    assert!(chi < 1.8, "{chi}");
    assert!(chi_square(places.iter().map(|p| turn_share(*p))) < 1.8);
    assert!(chi_square(places.iter().map(|p| q(p).powi(2))) > 10.0);
    // More asteroids lie outwards of the middle of the cross-section than inwards, because the circumference is larger there.
    let outside = places.iter().filter(|p| p.truncate().length() > 3.5e11).count();
    assert!((20_500..24_500).contains(&outside), "{outside}");
}

#[test]
fn sizes_spins_and_shapes_follow_their_distributions() {
    for index in [0.0, 1e-12, 1.0, 2.5] {
        let drawn = FieldParameters { size_index: index, radius_m: [50.0, 5000.0], ..parameters(RING, 40_000) };
        let instances = Instances::place(&drawn, 3, &[1.0; 3]).unwrap();
        let radii: Vec<f64> = instances.packed.iter().map(|one| one.radius_m(instances.largest_m)).collect();
        assert!(radii.iter().all(|r| (49.9..=5000.0).contains(r)));
        // Fraction below r: 1 - (r^-s - R^-s) / (r0^-s - R^-s); for s = 0, ln(r / r0) / ln(R / r0).
        let share = |r: f64| {
            if index < 1e-6 {
                return (r / 50.0).ln() / 100f64.ln();
            }
            let [low, high, r] = [50f64, 5000.0, r].map(|radius| radius.powf(-index));
            (low - r) / (low - high)
        };
        // Radii are integer fractions of the largest, so small ones are quantised; a uniform offset within the step
        // smooths this.
        let step = 5000.0 / f64::from(RADIUS_PARTS);
        let smooth = |(k, r): (usize, &f64)| share(r + step * ((k as f64 * 0.618_034).fract() - 0.5)).clamp(0.0, 1.0);
        let chi = chi_square(radii.iter().enumerate().map(smooth));
        assert!(chi < 2.0, "{index}: {chi}");
    }
    let instances = placed(RING, 40_000);
    let base = instances.base_period_s;
    let periods: Vec<f64> = instances.packed.iter().map(|one| base / f64::from(one.rate())).collect();
    assert!(periods.iter().all(|period| (7.99e3..8.2e5).contains(&period.abs())));
    assert!(chi_square(periods.iter().map(|p| (p.abs() / 8e3).ln() / 100f64.ln()).map(|share| share.max(0.0))) < 2.0);
    let forward = periods.iter().filter(|period| **period > 0.0).count();
    assert!((19_500..20_500).contains(&forward));
    let axes: Vec<DVec3> = instances.packed.iter().map(PackedAsteroid::axis).collect();
    for axis in 0..3 {
        assert!(chi_square(axes.iter().map(|a| a[axis] / 2.0 + 0.5)) < 1.8);
    }
    for shape in 0..3 {
        let count = instances.packed.iter().filter(|one| one.shape() == shape).count();
        assert!((12_800..13_900).contains(&count), "{shape}: {count}");
    }
    assert!(chi_square(instances.packed.iter().map(|one| f64::from(one.spin as u16) / 65_536.0)) < 1.8);
}

/// Whether every node's sphere contains all of its instances.
fn bounds_hold(instances: &Instances, bounds: &[f64]) -> bool {
    let mut stretch = GROUP;
    instances.levels.iter().all(|nodes| {
        let holds = nodes.iter().enumerate().all(|(number, node)| {
            let members = number * stretch..((number + 1) * stretch).min(instances.packed.len());
            members.into_iter().all(|k| {
                let one = &instances.packed[k];
                let reach = one.radius_m(instances.largest_m) * bounds[one.shape()];
                (instances.place_m(k).unwrap() - node.middle_m).length() + reach <= node.radius_m
            })
        });
        stretch *= BRANCHING;
        holds
    })
}

#[test]
fn nodes_contain_their_instances_and_sum_their_areas() {
    let bounds = [1.3, 1.5, 1.9];
    for (placement, count) in [(BELT, 70_001), (RING, 70_001), (RING, 1), (BELT, 256), (BELT, 257), (RING, 4096)] {
        let instances = placed(placement, count);
        assert!(bounds_hold(&instances, &bounds));
        assert_eq!(instances.levels.last().unwrap().len(), 1);
        let mut below = instances.packed.len();
        for (level, nodes) in instances.levels.iter().enumerate() {
            let size = if level == 0 { GROUP } else { BRANCHING };
            assert_eq!(nodes.len(), below.div_ceil(size));
            assert!(nodes.iter().enumerate().all(|(k, node)| {
                node.first as usize == k * size && node.count as usize == size.min(below - k * size)
            }));
            below = nodes.len();
        }
        let radii = || instances.packed.iter().map(|one| one.radius_m(instances.largest_m));
        let top = instances.levels.last().unwrap()[0];
        let area: f64 = radii().map(|r| PI * r * r).sum();
        assert!((top.area_m2 / area - 1.0).abs() < 1e-9);
        assert_eq!(top.largest_m, radii().fold(0.0, f64::max));
        assert_eq!(top.smallest_m, radii().fold(f64::INFINITY, f64::min));
        let centroid = places(&instances).iter().zip(radii()).map(|(p, r)| *p * (PI * r * r)).sum::<DVec3>() / area;
        assert!((top.centroid_m - centroid).length() < 1e-9 * (top.radius_m + centroid.length()));
    }
    // A sphere that is slightly too small is detected.
    let mut instances = placed(RING, 3000);
    instances.levels[0][2].radius_m *= 1.0 - 1e-4;
    assert!(!bounds_hold(&instances, &bounds));
}

#[test]
fn groups_are_neighbours() {
    // In a box with n groups, a group has 1/n of the volume: its sphere must not be much larger than that of a cube of
    // this volume.
    let instances = placed(Placement::Box { size_m: DVec3::splat(1e9) }, 1 << 18);
    let groups = &instances.levels[0];
    let side = 1e9 / (groups.len() as f64).cbrt();
    let mean = groups.iter().map(|group| group.radius_m).sum::<f64>() / groups.len() as f64;
    println!("mean radius of a group {:.3} of the half diagonal of its share", mean / (side * 0.75f64.sqrt()));
    assert!(mean < 1.2 * side * 0.75f64.sqrt());
    // Even in a thin ring, no group extends across the ring.
    let ring = placed(RING, 1 << 18);
    let share = (PI * 3.0 * 4.9e15 / ring.levels[0].len() as f64).sqrt();
    let widest = ring.levels[0].iter().map(|group| group.radius_m).fold(0.0, f64::max);
    println!("widest group of a ring {:.3} of the half diagonal of its share", widest / (share * 0.5f64.sqrt()));
    assert!(widest < 2.5 * share * 0.5f64.sqrt(), "{widest} {share}");
}

#[test]
fn a_seed_gives_the_same_bits_on_any_number_of_threads() {
    let one = placed(BELT, 50_000);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one, alone.install(|| placed(BELT, 50_000)));
    let other = FieldParameters { seed: 6, ..parameters(BELT, 50_000) };
    assert_ne!(one, Instances::place(&other, 3, &[1.3, 1.5, 1.9]).unwrap());
}

#[test]
fn offsets_have_a_small_rounding_error_relative_to_their_group() {
    for placement in [BELT, RING, Placement::Box { size_m: DVec3::splat(2e4) }] {
        let instances = placed(placement, 20_000);
        for (k, one) in instances.packed.iter().enumerate() {
            let group = &instances.levels[0][instances.group_of(k)];
            // f32 keeps 24 bits of an offset, and no offset is longer than the group's radius.
            let rounding_m = one.offset_m().abs().max_element() * 2f64.powi(-24);
            assert!(rounding_m < 6e-8 * group.radius_m);
            assert_eq!(instances.place_m(k).unwrap(), group.middle_m + one.offset_m());
        }
    }
    assert_eq!(placed(RING, 300).place_m(300), None);
}

#[test]
fn errors_name_the_key_and_the_valid_values() {
    let good = parameters(BELT, 10);
    let belt = |inner_m, outer_m, height_m| FieldParameters {
        placement: Placement::Belt { inner_m, outer_m, height_m },
        ..good
    };
    let with_box = |size_m| FieldParameters { placement: Placement::Box { size_m }, ..good };
    let cases = [
        (FieldParameters { instances: 0, ..good }, "instances = 0", "between 1 and"),
        (FieldParameters { instances: u32::MAX, ..good }, "instances", "between 1 and 67108864"),
        (belt(5.0, 5.0, 1.0), "placement.outer_m = 5", "above placement.inner_m = 5"),
        (belt(-1.0, 5.0, 1.0), "placement.inner_m = -1", "0 or more"),
        (belt(1.0, 5.0, 0.0), "placement.height_m = 0", "more than 0"),
        (belt(1.0, f64::INFINITY, 1.0), "placement.outer_m = inf", "at most 1e18"),
        (with_box(DVec3::new(1.0, f64::NAN, 1.0)), "placement.size_m = NaN", "more than 0"),
        (FieldParameters { radius_m: [2.0, 1.0], ..good }, "radius_m = [2, 1]", "smallest first"),
        (FieldParameters { radius_m: [1.0, 1001.0], ..good }, "radius_m = [1, 1001]", "1000 times"),
        (FieldParameters { radius_m: [0.0, 1.0], ..good }, "radius_m", "at least 0.001"),
        (FieldParameters { radius_m: [1e-170, 1e-170], ..good }, "radius_m", "at least 0.001"),
        (FieldParameters { size_index: -1.0, ..good }, "size_index = -1", "between 0 and 10"),
        (FieldParameters { size_index: f64::NAN, ..good }, "size_index = NaN", "between 0 and 10"),
        (FieldParameters { spin_period_s: [1.0, f64::NAN], ..good }, "spin_period_s", "at least 0.001"),
    ];
    for (wrong, key, allowed) in cases {
        let message = Instances::place(&wrong, 1, &[1.0]).unwrap_err().to_string();
        assert!(message.contains(key) && message.contains(allowed), "{message}");
    }
    for (shapes, bounds) in [(0, vec![]), (2, vec![1.0]), (1, vec![0.5]), (1, vec![f64::NAN]), (257, vec![1.0; 257])] {
        assert!(matches!(Instances::place(&good, shapes, &bounds), Err(FieldError::Shapes { .. })));
    }
    let sheet = FieldParameters { placement: Placement::Ring { inner_m: 0.0, outer_m: 5.0, thickness_m: 0.0 }, ..good };
    assert!(Instances::place(&sheet, 1, &[1.0]).is_ok());
}

//! Tests of the synthetic galaxy: comparison with the real sky, and self-consistency.
#![allow(clippy::print_stderr, reason = "these tests report their counts and densities")]

use std::sync::LazyLock;

use super::{
    unresolved::{MEASURED, MEASURED_FAINTER_THAN_MAG},
    *,
};
use crate::coordinates;

/// The model, made once for all tests.
pub(super) static SKY: LazyLock<Sky> = LazyLock::new(Sky::new);

/// As [`generate`](super::generate), with the shared model.
pub(in crate::catalogue) fn with_light(parameters: &GalaxyParameters) -> Result<Galaxy, GalaxyError> {
    generate_from(parameters, || &*SKY)
}

fn generate(parameters: &GalaxyParameters) -> Result<Vec<StarRecord>, GalaxyError> {
    with_light(parameters).map(|galaxy| galaxy.stars)
}

/// Numbers of stars brighter than V over the whole sky, in round figures.
const REAL_SKY: [(f64, f64); 12] = [
    (6.0, 4.9e3),
    (7.0, 1.4e4),
    (8.0, 4.1e4),
    (9.0, 1.2e5),
    (10.0, 3.2e5),
    (11.0, 8.7e5),
    (12.0, 2.3e6),
    (13.0, 5.7e6),
    (14.0, 1.4e7),
    (15.0, 3.2e7),
    (17.0, 1.5e8),
    (20.0, 1e9),
];

fn parameters(stars: usize, seed: u64, fainter_than: Option<f64>) -> GalaxyParameters {
    GalaxyParameters { stars, seed, fainter_than, unresolved_light: false }
}

/// Compares counts with the real sky up to the magnitude at which the set is complete, cumulatively and between neighbouring magnitudes. The error
/// names the first magnitude whose counts differ by more than a factor of 2.
fn check_counts(count_brighter: impl Fn(f64) -> f64, complete_to: f64) -> Result<(), String> {
    let mut before = (0.0, 0.0);
    let mut checked = 0;
    for (v, real) in REAL_SKY.into_iter().filter(|(v, _)| *v <= complete_to) {
        let counted = count_brighter(v);
        let (total, bin) = (counted / real, (counted - before.0) / (real - before.1));
        eprintln!("V < {v:4.1}: {counted:12.0}, real {real:12.0}, ratio {total:.2}; in the bin {bin:.2}");
        if !(0.5..=2.0).contains(&total) || !(0.5..=2.0).contains(&bin) {
            return Err(format!("V < {v}: {total:.2} of the real number, {bin:.2} in the last bin"));
        }
        before = (counted, real);
        checked += 1;
    }
    if checked < 4 { Err(format!("only {checked} magnitudes up to {complete_to}")) } else { Ok(()) }
}

fn check_star_counts(stars: &[StarRecord], shift_mag: f64) -> Result<(), String> {
    let mut magnitudes: Vec<f64> = stars.iter().map(|s| s.apparent_magnitude() + shift_mag).collect();
    magnitudes.sort_unstable_by(f64::total_cmp);
    let complete_to = magnitudes[magnitudes.len() - 1];
    eprintln!("{} stars, complete to V = {complete_to:.3}", stars.len());
    check_counts(|v| magnitudes.partition_point(|m| *m < v) as f64, complete_to)
}

/// FNV-1a over all bits of all stars.
fn hash(stars: &[StarRecord]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bits: u64| {
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    for star in stars {
        star.position.to_array().map(f64::to_bits).into_iter().for_each(&mut add);
        add(u64::from(star.magnitude.to_bits()) << 32 | u64::from(star.temperature_k.to_bits()));
        add(u64::from(star.distance_known));
    }
    hash
}

/// Stars per square degree in four regions, in degrees: towards the centre and the anticentre (each |b| < 10, 30 degrees of longitude), along the
/// whole plane (|b| < 5), and at both poles (|b| > 60).
struct Densities {
    centre: f64,
    anticentre: f64,
    plane: f64,
    poles: f64,
}

fn densities(stars: &[StarRecord]) -> Densities {
    let galactic_from_icrs = coordinates::galactic_from_icrs();
    let mut counts = [0u64; 4];
    for star in stars {
        let (l, b) = coordinates::lon_lat_from_direction(galactic_from_icrs * star.position);
        let (l, b) = (l.to_degrees(), b.to_degrees().abs());
        counts[0] += u64::from(b < 10.0 && !(15.0..345.0).contains(&l));
        counts[1] += u64::from(b < 10.0 && (165.0..195.0).contains(&l));
        counts[2] += u64::from(b < 5.0);
        counts[3] += u64::from(b > 60.0);
    }
    let square_degree = 1f64.to_radians().powi(2);
    let band = |b: f64, width: f64| 2.0 * b.to_radians().sin() * width.to_radians() / square_degree;
    let caps = 2.0 * std::f64::consts::TAU * (1.0 - 60f64.to_radians().sin()) / square_degree;
    let result = Densities {
        centre: counts[0] as f64 / band(10.0, 30.0),
        anticentre: counts[1] as f64 / band(10.0, 30.0),
        plane: counts[2] as f64 / band(5.0, 360.0),
        poles: counts[3] as f64 / caps,
    };
    eprintln!(
        "per square degree: centre {:.1}, anticentre {:.1}, plane {:.1}, poles {:.1}; \
         centre/anticentre {:.2}, plane/poles {:.2}",
        result.centre,
        result.anticentre,
        result.plane,
        result.poles,
        result.centre / result.anticentre,
        result.plane / result.poles
    );
    result
}

#[test]
fn model_counts_match_the_real_sky_to_v_20() {
    check_counts(|v| SKY.brighter_than(v), 20.0).unwrap();
}

#[test]
fn a_million_stars_have_the_counts_and_distribution_of_the_real_sky() {
    let stars = generate(&parameters(1_000_000, 1, None)).unwrap();
    assert_eq!(stars.len(), 1_000_000);
    check_star_counts(&stars, 0.0).unwrap();
    for star in &stars {
        assert!(star.position.is_finite() && star.distance_known);
        assert!(star.magnitude.is_finite() && (2_000.0..60_000.0).contains(&star.temperature_k), "{star:?}");
        assert!(star.position.length() > 1.29, "{star:?}");
    }
    let Densities { centre, anticentre, plane, poles } = densities(&stars);
    assert!(centre > anticentre && anticentre > poles, "centre, anticentre, poles out of order");
    assert!((3.0..12.0).contains(&(plane / poles)));
    assert!((1.2..4.0).contains(&(centre / anticentre)));
    // A set with wrong magnitudes must fail the same check.
    for shift_mag in [-2.0, 2.0] {
        assert!(check_star_counts(&stars, shift_mag).is_err(), "shifted by {shift_mag}");
    }
}

#[test]
#[ignore = "long: make test-all"]
fn ten_million_stars_have_the_counts_and_distribution_of_the_real_sky() {
    let stars = generate(&parameters(10_000_000, 1, None)).unwrap();
    assert_eq!(stars.len(), 10_000_000);
    check_star_counts(&stars, 0.0).unwrap();
    let Densities { centre, anticentre, plane, poles } = densities(&stars);
    assert!(centre > anticentre && anticentre > poles, "centre, anticentre, poles out of order");
    assert!((3.0..12.0).contains(&(plane / poles)));
    assert!((1.3..4.0).contains(&(centre / anticentre)));
}

#[test]
#[ignore = "long: make test-all"]
fn the_stars_depend_on_the_parameters_alone() {
    // Generate with a separate model, because the model is also made in parallel.
    let with_threads = |threads: usize, p: GalaxyParameters| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        hash(&pool.install(|| super::generate(&p)).unwrap().stars)
    };
    let p = parameters(100_000, 7, Some(4.0));
    let one_thread = with_threads(1, p);
    assert_eq!(one_thread, with_threads(2, p), "two threads");
    assert_eq!(one_thread, hash(&generate(&p).unwrap()), "again");
    assert_ne!(one_thread, hash(&generate(&GalaxyParameters { seed: 8, ..p }).unwrap()), "another seed");
    assert_ne!(one_thread, hash(&generate(&GalaxyParameters { stars: 99_999, ..p }).unwrap()), "one star less");
}

#[test]
fn only_stars_brighter_than_the_limit_are_left_out() {
    let all = generate(&parameters(60_000, 2, None)).unwrap();
    let fainter = generate(&parameters(50_000, 2, Some(6.5))).unwrap();
    assert!(all.iter().any(|s| s.apparent_magnitude() < 6.5));
    assert!(fainter.iter().all(|s| s.apparent_magnitude() >= 6.5));
    // The set begins exactly at the limit: about 80 stars are within 0.01 mag of it.
    let brightest = fainter.iter().map(StarRecord::apparent_magnitude).fold(f64::INFINITY, f64::min);
    assert!(brightest < 6.51, "{brightest}");
    // Here the stars are so numerous that rounding to f32 would move some of them across the limit.
    let crowded = generate(&parameters(1_000_000, 2, Some(12.0))).unwrap();
    assert!(crowded.iter().all(|s| s.apparent_magnitude() >= 12.0));
}

#[test]
fn small_numbers_are_exact_and_are_the_brightest() {
    for stars in [1, 2, 100, 10_000] {
        let made = generate(&parameters(stars, 3, None)).unwrap();
        assert_eq!(made.len(), stars);
        let faintest = made.iter().map(StarRecord::apparent_magnitude).fold(f64::NEG_INFINITY, f64::max);
        eprintln!("{stars} stars to V = {faintest:.2}");
        let (low, high) = match stars {
            1 | 2 => (-6.0, 2.5),
            100 => (1.0, 4.0),
            _ => (6.0, 7.2),
        };
        assert!((low..high).contains(&faintest), "{stars} stars: faintest {faintest}");
    }
}

#[test]
fn equal_magnitudes_are_trimmed_to_the_exact_number() {
    let star = |magnitude: f32, temperature_k: f32| StarRecord {
        position: glam::DVec3::X * 10.0,
        magnitude,
        temperature_k,
        distance_known: true,
    };
    let mut stars = vec![star(2.0, 1.0), star(1.0, 2.0), star(2.0, 3.0), star(2.0, 4.0), star(3.0, 5.0)];
    keep_brightest(&mut stars, 3);
    assert_eq!(stars, [star(2.0, 1.0), star(1.0, 2.0), star(2.0, 3.0)]);
}

#[test]
fn wrong_parameters_are_refused() {
    assert_eq!(generate(&parameters(0, 1, None)), Err(GalaxyError::StarCount { stars: 0 }));
    assert_eq!(generate(&parameters(MOST_STARS + 1, 1, None)), Err(GalaxyError::StarCount { stars: MOST_STARS + 1 }));
    for fainter_than in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(generate(&parameters(10, 1, Some(fainter_than))), Err(GalaxyError::NotFinite { .. })));
    }
    for (stars, fainter_than) in [(10, 20.0), (10, 30.0), (150_000_000, 19.99)] {
        let error = generate(&parameters(stars, 1, Some(fainter_than))).unwrap_err();
        assert!(matches!(error, GalaxyError::TooFewStars { .. }), "{error}");
        assert!(error.to_string().contains(&stars.to_string()), "{error}");
    }
}

/// Luminance of a galaxy in the cells of the measured sky, relative to the measurement, in magnitudes; by latitude, then longitude. It includes drawn
/// stars fainter than [`MEASURED_FAINTER_THAN_MAG`].
fn against_measured(galaxy: &Galaxy, turned_deg: f64) -> Vec<(f64, Vec<f64>)> {
    let diffuse = galaxy.unresolved.as_ref().unwrap();
    let galactic_from_icrs = coordinates::galactic_from_icrs();
    let icrs_from_galactic = coordinates::icrs_from_galactic();
    let stars: Vec<(f64, f64, f64)> = galaxy
        .stars
        .iter()
        .filter(|star| star.apparent_magnitude() >= MEASURED_FAINTER_THAN_MAG)
        .map(|star| {
            let (l, b) = coordinates::lon_lat_from_direction(galactic_from_icrs * star.position);
            let lx = crate::units::illuminance_lx_from_magnitude(star.apparent_magnitude());
            ((l.to_degrees() + turned_deg).rem_euclid(360.0), b.to_degrees(), lx)
        })
        .collect();
    let rows = &MEASURED;
    let of_row = |j: usize| {
        let b = rows[j].latitude_deg;
        let edge = |other: usize| 0.5 * (b + rows.get(other).map_or(b.signum() * 90.0, |row| row.latitude_deg));
        let (south, north) = (edge(j.wrapping_sub(1)), edge(j + 1));
        let mut sums = vec![0.0; rows[j].luminance_cd_m2.len()];
        for (l, latitude, lx) in &stars {
            if (south..north).contains(latitude) {
                sums[(l / 10.0).round() as usize % 36] += lx;
            }
        }
        let cell_sr = 10_f64.to_radians() * (north.to_radians().sin() - south.to_radians().sin());
        let ratio = |cell: usize| {
            let mean: f64 = (0..400)
                .map(|i| {
                    let across = (f64::from(i % 20) + 0.5) / 20.0 - 0.5;
                    let up = south + (north - south) * (f64::from(i / 20) + 0.5) / 20.0;
                    let l = (10.0 * (cell as f64 + across) - turned_deg).to_radians();
                    let towards = icrs_from_galactic * coordinates::direction_from_lon_lat(l, up.to_radians());
                    crate::photometry::rec709::luminance(diffuse.luminance_cd_m2(towards)) / 400.0
                })
                .sum();
            -2.5 * ((mean + sums[cell] / cell_sr) / rows[j].luminance_cd_m2[cell]).log10()
        };
        (b, (0..36).map(ratio).collect())
    };
    (0..rows.len()).map(of_row).collect()
}

/// Root mean square and mean over the rows at the wanted latitudes, ignoring cells that were not measured.
fn spread(rows: &[(f64, Vec<f64>)], wanted: impl Fn(f64) -> bool) -> [f64; 2] {
    let values: Vec<f64> = rows
        .iter()
        .filter(|(b, _)| wanted(*b))
        .flat_map(|(_, cells)| cells.iter().copied().filter(|value| !value.is_nan()))
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [(values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt(), mean]
}

#[test]
fn the_milky_way_has_its_measured_brightness() {
    let made = |stars: usize| {
        let p = GalaxyParameters { unresolved_light: true, ..parameters(stars, 1, Some(6.5)) };
        with_light(&p).unwrap()
    };
    let galaxy = made(300_000);
    let rows = against_measured(&galaxy, 0.0);
    let s10 = |cd_m2: f64| cd_m2 / crate::catalogue::healpix::s10_cd_m2();
    for (row, (b, cells)) in MEASURED.iter().zip(&rows) {
        if [0.0, 8.0, 12.0, 80.0].contains(&b.abs()) {
            let line = |value: &dyn Fn(usize) -> f64| (0..36).map(|i| format!("{:4.0}", value(i))).collect::<String>();
            eprintln!("b {b:3}, S10(V) measured {}", line(&|i| s10(row.luminance_cd_m2[i])));
            eprintln!(
                "              drawn   {}",
                line(&|i| s10(row.luminance_cd_m2[i]) * 10_f64.powf(-0.4 * cells[i]))
            );
        }
    }
    for (name, from, to) in [("plane", 0.0, 0.0), ("band", 4.0, 12.0), ("beyond", 16.0, 50.0), ("poles", 60.0, 90.0)] {
        let [rms, mean] = spread(&rows, |b| (from..=to).contains(&b.abs()));
        eprintln!("{name}: rms {rms:.3} mag, mean {mean:.3}");
    }
    let [rms, mean] = spread(&rows, |b| b.abs() <= 12.0);
    assert!(rms < 0.35 && mean.abs() < 0.08, "band: {rms} {mean}");
    let [rms, mean] = spread(&rows, |b| b.abs() > 12.0);
    assert!(rms < 0.35 && mean.abs() < 0.08, "beyond: {rms} {mean}");
    // A rotated galaxy does not match the measurement, nor does one without the light of its faint stars.
    let [turned, _] = spread(&against_measured(&galaxy, 120.0), |b| b.abs() <= 12.0);
    assert!(turned > 0.45, "{turned}");
    // The brightness stays the same if more stars are drawn individually.
    let more = made(2_000_000);
    let [_, of_more] = spread(&against_measured(&more, 0.0), |b| b.abs() <= 12.0);
    let diffuse = |galaxy: &Galaxy| galaxy.unresolved.as_ref().unwrap().mean_cd_m2();
    eprintln!("mean of the rest: {:.3e} and {:.3e} cd/m^2", diffuse(&galaxy), diffuse(&more));
    assert!((of_more - mean).abs() < 0.15 && diffuse(&more) < 0.9 * diffuse(&galaxy), "{of_more} {mean}");
    // The Large Magellanic Cloud has V = 0.4: the area within 4 degrees contains four fifths of its light, plus the light of the sky there.
    let middle = coordinates::direction_from_lon_lat(80_f64.to_radians(), (-69_f64).to_radians());
    let around = |from_deg: f64, to_deg: f64| {
        let sky = galaxy.unresolved.as_ref().unwrap();
        let (mut sum, mut places) = (0.0, 0.0);
        for i in 0..20_000 {
            let cosine = 1.0 - (f64::from(i) + 0.5) / 20_000.0 * (1.0 - to_deg.to_radians().cos());
            if cosine.acos().to_degrees() < from_deg {
                continue;
            }
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let (right, up) = (middle.any_orthonormal_vector(), middle.cross(middle.any_orthonormal_vector()));
            let towards = middle * cosine + (right * cos + up * sin) * (1.0 - cosine * cosine).sqrt();
            sum += crate::photometry::rec709::luminance(sky.luminance_cd_m2(towards));
            places += 1.0;
        }
        sum / places
    };
    let sr = std::f64::consts::TAU * (1.0 - 4_f64.to_radians().cos());
    let magnitude = crate::units::magnitude_from_illuminance_lx((around(0.0, 4.0) - around(11.0, 14.0)) * sr);
    eprintln!("Large Magellanic Cloud within 4 degrees: V = {magnitude:.2}");
    assert!((0.45..0.85).contains(&magnitude), "{magnitude}");
}

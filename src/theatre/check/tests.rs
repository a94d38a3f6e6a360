//! Tests the rules on a set-up of two projectors, and the effect of each mistake.

#![allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]

use super::*;
use crate::view::{
    projection::{DirectionGrid, Interpolation, Placement, Warp},
    projector::Weights,
};

const DOME: Dome = Dome { fov_deg: 120.0, tilt_deg: 90.0 };
const SIZE: [u32; 2] = [120, 220];

/// Returns the direction of a point of the raster (0 to 1). Projectors show bands of the dome, from one side to the
/// other, with the upper border beyond the zenith.
fn band(from_deg: f64, to_deg: f64) -> impl Fn(f64, f64) -> DVec3 {
    move |u: f64, v: f64| {
        let across = (from_deg + (to_deg - from_deg) * u).to_radians();
        let along = (65.0 - 130.0 * v).to_radians();
        DVec3::new(across.sin() * along.cos(), along.sin(), -across.cos() * along.cos())
    }
}

fn warp(direction: impl Fn(f64, f64) -> DVec3, samples: usize, interpolation: Interpolation) -> Warp {
    let fraction = |index: usize| index as f64 / (samples - 1) as f64;
    let directions =
        (0..samples * samples).map(|n| Some(direction(fraction(n % samples), fraction(n / samples)))).collect();
    let (columns, rows, placement) = (samples, samples, Placement::Corners);
    Warp::new(SIZE, &DirectionGrid { columns, rows, samples: directions, placement, interpolation }).unwrap()
}

/// Two halves that overlap by 10 degrees, with shares that add up.
struct SetUp {
    warps: [Warp; 2],
    blends: [Option<Blend>; 2],
}

impl SetUp {
    fn right() -> Self {
        let warps = [band(-65.0, 5.0), band(-5.0, 65.0)].map(|direction| warp(direction, 33, Interpolation::Smooth));
        let ramp = |first: bool| {
            let width = SIZE[0] as usize;
            let values: Vec<f32> = (0..width)
                .map(|x| {
                    let across = (x as f32 + 0.5) / width as f32 * 70.0 + if first { -65.0 } else { -5.0 };
                    let share = ((across + 5.0) / 10.0).clamp(0.0, 1.0);
                    if first { 1.0 - share } else { share }
                })
                .collect();
            Some(Blend::new(SIZE, Some(Weights { size: [width, 1], values: &values }), None).unwrap())
        };
        Self { warps, blends: [ramp(true), ramp(false)] }
    }

    fn check(&self) -> DomeReport {
        let names = ["left", "right"];
        let projector = |at: usize| Projector {
            name: names[at],
            mapping: &self.warps[at],
            dome_from_view: DQuat::IDENTITY,
            blend: self.blends[at].as_ref(),
            dimmed_to: 1.0,
            screen: None,
        };
        check(DOME, &[projector(0), projector(1)])
    }
}

fn failed(report: &DomeReport) -> Vec<&'static str> {
    report.findings.iter().filter(|finding| !finding.passed).map(|finding| finding.rule).collect()
}

#[test]
fn a_good_set_up_satisfies_all_rules() {
    let report = SetUp::right().check();
    assert!(report.passed(), "{:#?}", report.findings);
    assert!(report.coverage[0] > 0.999 && (0.05..0.15).contains(&report.coverage[1]), "{:?}", report.coverage);
    assert!((report.blend_sum[1] - 1.0).abs() < 1e-6);
    let pixel_arcmin = 130.0 * 60.0 / 220.0;
    assert!((report.projectors[0].arcmin_per_pixel[1] / pixel_arcmin - 1.0).abs() < 0.02, "{:?}", report.projectors);
}

#[test]
fn each_mistake_violates_its_own_rule() {
    let mistake = |change: &dyn Fn(&mut SetUp)| {
        let mut set_up = SetUp::right();
        change(&mut set_up);
        set_up.check()
    };
    let smooth = Interpolation::Smooth;
    let right = || band(-5.0, 65.0);
    let upside_down = mistake(&|s| s.warps[1] = warp(|u, v| right()(u, 1.0 - v), 33, smooth));
    assert_eq!(failed(&upside_down), ["mirrored"]);
    assert!(upside_down.findings.iter().any(|finding| finding.what.contains("rows upside down")));
    let columns = mistake(&|s| s.warps[1] = warp(|u, v| right()(1.0 - u, v), 33, smooth));
    assert_eq!(failed(&columns), ["blend", "mirrored"]);
    let gap = mistake(&|s| s.warps[1] = warp(band(15.0, 85.0), 33, smooth));
    assert_eq!(failed(&gap)[..2], ["coverage", "blend"]);
    let [azimuth, _, radius] = gap.widest_gap_deg.unwrap();
    assert!((0.0..120.0).contains(&azimuth.abs()) && (3.0..8.0).contains(&radius), "{azimuth} {radius}");
    let unblended = mistake(&|s| s.blends = [None, None]);
    assert_eq!(failed(&unblended), ["blend"]);
    assert!(unblended.findings.iter().any(|finding| finding.what.contains("no projector has a blend mask")));
    let swapped = mistake(&|s| s.blends.swap(0, 1));
    assert_eq!(failed(&swapped), ["blend", "swapped"]);
    // Use offsets instead of directions: the whole picture is then near one point.
    let collapsed =
        mistake(&|s| s.warps[1] = warp(|u, v| (right()(0.5, 0.5) + 1e-2 * right()(u, v)).normalize(), 33, smooth));
    assert!(failed(&collapsed).contains(&"span"), "{:?}", failed(&collapsed));
    let twice = mistake(&|s| s.warps[1] = warp(band(-65.0, 5.0), 33, smooth));
    assert!(failed(&twice).contains(&"twice") && failed(&twice).contains(&"coverage"));
    // Use cells of different widths: the size of pixels jumps between them.
    let uneven = |u: f64, v: f64| right()(u + 0.04 * (7.0 * u).sin(), v);
    let facets = mistake(&|s| s.warps[1] = warp(uneven, 9, Interpolation::Linear));
    assert!(failed(&facets).contains(&"facets"), "{:?}", failed(&facets));
    let below = mistake(&|s| s.warps[1] = warp(|u, v| -right()(1.0 - u, v), 33, smooth));
    assert!(failed(&below).contains(&"reaches"));
}

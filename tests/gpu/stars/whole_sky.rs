//! Draws the 9,096 stars of the Yale Bright Star Catalogue in three views of the whole sphere, each of which must have
//! the light of the catalogue. The variable `STERADIAN_BSC_CSV` names the catalogue, which is not part of this project.

use std::{f64::consts::TAU, path::Path};

use crate::common::*;
use steradian::{
    catalogue::{StarRecord, reader::read_csv},
    plan::settings::StarMethod,
    units::illuminance_lx_from_magnitude,
    view::{
        ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

/// Returns the relative differences between the light of each of the three views and the expected sum.
fn differences(records: Vec<StarRecord>, expected_lx: f64) -> Vec<(&'static str, f64)> {
    let scene = snapshot(records);
    let mut renderer = renderer();
    [
        ("six cube faces", ViewKind::Cubemap { face_size: 512, faces: Face::ALL.to_vec() }),
        ("equirectangular", ViewKind::Equirectangular { size: [2048, 1024] }),
        (
            "360-degree equidistant fisheye",
            ViewKind::Fisheye { size: [1024, 1024], mapping: FisheyeMapping::Equidistant, fov_rad: TAU },
        ),
    ]
    .into_iter()
    .map(|(name, kind)| {
        let rig = rig(vec![("v", kind)]);
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
        (name, total_illuminance_lx(&frame, &rig) / expected_lx - 1.0)
    })
    .collect()
}

#[test]
#[cfg_attr(not(has_bsc_csv), ignore = "set STERADIAN_BSC_CSV to a copy of the Yale Bright Star Catalogue as CSV")]
fn the_yale_catalogue_has_the_same_light_in_every_whole_sky() {
    let path = std::env::var("STERADIAN_BSC_CSV").expect("STERADIAN_BSC_CSV was set when this test was built");
    let records = read_csv(Path::new(&path), 0.0).expect("the catalogue is readable").stars;
    assert_eq!(records.len(), 9096);
    let expected_lx: f64 = records.iter().map(|star| illuminance_lx_from_magnitude(star.apparent_magnitude())).sum();
    let found = differences(records.clone(), expected_lx);
    for (name, difference) in &found {
        println!("9096 stars, {expected_lx:.6e} lx: {name} differs by {difference:.1e}");
        assert!(difference.abs() < 1e-3, "{name}: {difference}");
    }
    // The views differ from each other by less than the same limit.
    let most = found.iter().map(|(_, d)| *d).fold(f64::MIN, f64::max);
    let least = found.iter().map(|(_, d)| *d).fold(f64::MAX, f64::min);
    assert!(most - least < 1e-3);
    // If the stars about as bright as Vega are left out, the sum must not match.
    let without: Vec<StarRecord> =
        records.into_iter().filter(|star| (star.apparent_magnitude() - 0.03).abs() > 0.011).collect();
    assert!(without.len() < 9096);
    assert!(differences(without, expected_lx).iter().all(|(_, difference)| *difference < -1e-3));
}

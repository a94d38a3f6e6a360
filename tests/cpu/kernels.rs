//! Bodies in SPK kernels: small kernels that the tests write, and their use in configurations.

use std::{fs, path::Path};

use steradian::{
    config::{Config, ConfigError},
    glam::DVec3,
    scene::{SceneObjects, bodies::SolarBody},
};
use tempfile::TempDir;

use crate::spk::{Segment, kernel};

/// 2026-11-24T00:00:00Z, s since J2000.0; TDB is 69.184 s ahead of it, and this count of civil time has no leap
/// seconds.
const TIME: &str = "2026-11-24T00:00:00Z";
const TIME_S: f64 = 848_750_400.0;
const TDB_S: f64 = TIME_S + 69.184;

/// The segments are a probe near Saturn, a satellite of the Earth, a comet relative to the barycentre, and one on
/// ecliptic axes.
fn probe() -> Segment {
    Segment {
        target: -82,
        centre: 6,
        axes: 1,
        covered_s: [TDB_S, 86_400.0],
        place_km: [DVec3::new(4e5, -3e5, 1e5), DVec3::new(8640.0, 0.0, -4320.0)],
    }
}

fn satellite() -> Segment {
    let place_km = [DVec3::new(42_164.0, 10.0, -20.0), DVec3::ZERO];
    Segment { target: -1_000, centre: 399, axes: 1, covered_s: [TDB_S, 3600.0], place_km }
}

fn comet() -> Segment {
    let place_km = [DVec3::new(1e8, 2e8, -3e7), DVec3::new(0.0, 1e5, 0.0)];
    Segment { target: 1_000_012, centre: 0, axes: 1, covered_s: [TDB_S, 86_400.0], place_km }
}

fn written(kernels: &[(&str, Vec<u8>)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in kernels {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn config(folder: &Path, scene: &str, bodies: &str) -> Result<SceneObjects, ConfigError> {
    let text = format!("[scene]\ntime = {TIME}\n{scene}\n{bodies}");
    Config::from_text(&text, "kernels.toml", folder, &[])?.objects()
}

fn body(name: &str, number: i32) -> String {
    format!("[[bodies]]\nname = '{name}'\nephemeris = 'spk:{number}'\nradius_m = 10\ngeometric_albedo = 0.5\n")
}

fn place_m(objects: &SceneObjects, name: &str) -> DVec3 {
    objects.bodies.iter().find(|body| body.name == name).unwrap().position_m
}

#[test]
fn bodies_have_their_positions_in_kernels() {
    let folder = written(&[("a.bsp", kernel(&[probe(), satellite()])), ("b.bsp", kernel(&[comet()]))]);
    let bodies = [body("probe", -82), body("geo", -1000), body("comet", 1_000_012)].concat();
    let objects = config(folder.path(), "kernels = ['a.bsp', 'b.bsp']", &bodies).unwrap();
    for later_s in [0.0, 1000.0, -3600.0] {
        let tdb_s = TDB_S + later_s;
        let objects = objects.at(TIME_S + later_s);
        let share = later_s / 86_400.0;
        let close = |name: &str, expected_m: DVec3| {
            let error_m = (place_m(&objects, name) - expected_m).length();
            assert!(error_m < 1.0, "{name} {later_s}: {error_m} m");
        };
        let [start_km, slope] = probe().place_km;
        close("probe", SolarBody::Saturn.barycentric_m(tdb_s) + (start_km + slope * share) * 1e3);
        close("geo", SolarBody::Earth.barycentric_m(tdb_s) + satellite().place_km[0] * 1e3);
        let [start_km, slope] = comet().place_km;
        close("comet", (start_km + slope * share) * 1e3);
    }
    // After the end of the kernel the body keeps its last position relative to Saturn, which continues to move.
    let [start_km, slope] = probe().place_km;
    let beyond = objects.at(TIME_S + 3.0 * 86_400.0);
    let expected_m = SolarBody::Saturn.barycentric_m(TDB_S + 3.0 * 86_400.0) + (start_km + slope) * 1e3;
    assert!((place_m(&beyond, "probe") - expected_m).length() < 1.0);
}

#[test]
fn an_observer_sees_a_satellite_from_their_position() {
    let folder = written(&[("a.bsp", kernel(&[satellite()]))]);
    let observer = "kernels = ['a.bsp']\n[scene.observer]\nlatitude_deg = 48\nlongitude_deg = 11\nheight_m = 500\n";
    let objects = config(folder.path(), observer, &body("geo", -1000)).unwrap();
    let standpoint = objects.observer.unwrap().standpoint(TIME_S);
    let seen_m = place_m(&objects, "geo") - objects.observer.unwrap().epoch.position_m;
    let expected_m = satellite().place_km[0] * 1e3 - standpoint.from_earth_m;
    // During the light time of 0.1 s, the Earth and the satellite move by 4 km together. The aberration is 20 arcsec.
    assert!((seen_m.length() - expected_m.length()).abs() < 6e3, "{seen_m} {expected_m}");
    assert!(seen_m.angle_between(expected_m) < 1.2e-4, "{seen_m} {expected_m}");
}

#[test]
fn bodies_missing_from_kernels_are_refused() {
    let tilted = Segment { axes: 17, ..comet() };
    let adrift = Segment { target: -9, centre: -8, ..probe() };
    let whole = kernel(&[probe()]);
    let cut = |bytes: usize| whole[..bytes].to_vec();
    let mut big_endian = whole.clone();
    big_endian[88..96].copy_from_slice(b"BIG-IEEE");
    let incomplete = "the kernel is damaged or incomplete";
    let folder = written(&[
        ("a.bsp", kernel(&[probe()])),
        ("tilted.bsp", kernel(&[tilted])),
        ("adrift.bsp", kernel(&[adrift])),
        ("none.bsp", b"DAF/SPK".to_vec()),
        ("text.bsp", b"KPL/LSK".to_vec()),
        ("cut.bsp", cut(3 * 1024 + 80)),
        ("cut-in-summaries.bsp", cut(1500)),
        ("cut-in-head.bsp", cut(500)),
        ("big-endian.bsp", big_endian),
    ]);
    let later = Segment { covered_s: [TDB_S + 1e6, 1000.0], ..comet() };
    fs::write(folder.path().join("later.bsp"), kernel(&[later])).unwrap();
    let cases = [
        ("kernels = ['a.bsp']", body("x", -83), vec!["bodies[0].ephemeris", "spk:-83", "-82"]),
        ("", body("x", -82), vec!["bodies[0].ephemeris", "scene.kernels"]),
        ("kernels = ['missing.bsp']", body("x", -82), vec!["scene.kernels", "missing.bsp"]),
        ("kernels = ['text.bsp']", body("x", -82), vec!["scene.kernels", "text.bsp", "DAF/SPK"]),
        ("kernels = ['none.bsp']", body("x", -82), vec!["scene.kernels", "none.bsp"]),
        ("kernels = ['tilted.bsp']", body("x", 1_000_012), vec!["scene.kernels", "1000012", "axes 17"]),
        (
            "kernels = ['adrift.bsp']",
            body("x", -9),
            vec!["bodies[0].ephemeris", "spk:-9", "relative to spk:-8: not in"],
        ),
        (
            "kernels = ['cut.bsp']",
            body("x", -82),
            vec!["scene.kernels", "cut.bsp", incomplete, "385 to 396", "has only 394"],
        ),
        ("kernels = ['cut-in-summaries.bsp']", body("x", -82), vec!["cut-in-summaries.bsp", incomplete]),
        ("kernels = ['cut-in-head.bsp']", body("x", -82), vec!["cut-in-head.bsp", incomplete]),
        ("kernels = ['big-endian.bsp']", body("x", -82), vec!["big-endian.bsp", "LTL-IEEE"]),
        ("kernels = ['later.bsp']", body("x", 1_000_012), vec!["bodies[0].ephemeris", "scene.time", "2026-12-05T"]),
        ("", body("x", -82).replace("-82", "Cassini"), vec!["bodies[0].ephemeris", "spk:Cassini", "NAIF"]),
        ("", body("x", -82).replace("spk:-82", "pluto"), vec!["bodies[0].ephemeris", "pluto", "neptune", "spk:"]),
        ("kernels = ['a.bsp']", body("x", -82) + "position_m = [0, 0, 0]\n", vec!["bodies[0].position_m", "ephemeris"]),
    ];
    for (scene, bodies, parts) in cases {
        let error = config(folder.path(), scene, &bodies).unwrap_err().to_string();
        for part in parts {
            assert!(error.contains(part), "{error}\nlacks {part}");
        }
    }
    // The orientation and rotation of such a body can be configured.
    let turned = body("x", -82) + "spin = { period_s = 100 }\norientation = [0, 0, 1, 0]\n";
    assert!(config(folder.path(), "kernels = ['a.bsp']", &turned).is_ok());
}

/// The barycentre of kernels differs from that of VSOP87. The two are aligned by the position of the Earth in the
/// kernels, or otherwise by that of the Sun.
#[test]
fn kernels_with_another_barycentre_are_aligned_with_the_theories() {
    let shift_m = DVec3::new(9e5, -8e5, 4e5);
    let straight = |target: i32, place_m: &dyn Fn(f64) -> DVec3| {
        let half_s = 600.0;
        let [before, middle, after] = [-half_s, 0.0, half_s].map(|s| (place_m(TDB_S + s) + shift_m) * 1e-3);
        Segment { target, centre: 0, axes: 1, covered_s: [TDB_S, half_s], place_km: [middle, 0.5 * (after - before)] }
    };
    let trajectory = |body: SolarBody| move |tdb_s: f64| body.barycentric_m(tdb_s);
    let bodies = format!("{}{}", body("probe", 1_000_012), body("own-moon", 301));
    let far_m = DVec3::new(1e11, 2e11, -3e10);
    let probe = || straight(1_000_012, &|_| far_m);
    for anchor in [Some((399, SolarBody::Earth)), Some((10, SolarBody::Sun)), None] {
        let segments: Vec<Segment> = anchor
            .map(|(number, body)| straight(number, &trajectory(body)))
            .into_iter()
            .chain([probe(), straight(301, &trajectory(SolarBody::Moon))])
            .collect();
        let folder = written(&[("a.bsp", kernel(&segments))]);
        let objects = config(folder.path(), "kernels = ['a.bsp']", &bodies).unwrap();
        let moon_m = SolarBody::Moon.barycentric_m(TDB_S);
        let errors_m =
            [place_m(&objects, "probe") - far_m, place_m(&objects, "own-moon") - moon_m].map(|error| error.length());
        println!("{anchor:?}: {errors_m:?} m");
        // If the kernels have neither of them, they are not corrected.
        let expected_m = if anchor.is_some() { 0.0 } else { shift_m.length() };
        assert!(errors_m.iter().all(|error_m| (error_m - expected_m).abs() < 1.0), "{anchor:?}: {errors_m:?}");
    }
}

use super::*;

fn sky() -> SkyLight {
    // 0.2 mag in green.
    let depths = Depths {
        molecules: [0.064, 0.0989, 0.193],
        aerosol: [0.050, 0.0574, 0.0715],
        ozone: [0.04, 0.0286, 0.0028],
        height_km: 0.0,
        molecules_below_km: MOLECULES_KM,
        most_haze_below: 1.0,
    };
    SkyLight::new(depths)
}

#[test]
fn phase_functions_scatter_all_light() {
    for per_sr in [molecules_per_sr, aerosol_per_sr] {
        let nodes = 20_000;
        let sum: f64 = (0..nodes).map(|i| per_sr(-1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(nodes))).sum();
        assert!((sum / f64::from(nodes) * 4.0 * PI - 1.0).abs() < 1e-5);
    }
}

#[test]
fn transmission_follows_from_the_optical_depths() {
    let sky = sky();
    let total = [0, 1, 2].map(|c| sky.depths.molecules[c] + sky.depths.aerosol[c] + sky.depths.ozone[c]);
    let [overhead, low] = [1.0, 0.5].map(|sine| sky.arriving(0.0, sine));
    for c in 0..3 {
        assert!((overhead[c] / (-total[c]).exp() - 1.0).abs() < 2e-3, "{overhead:?}");
        assert!((low[c] / (-1.99 * total[c]).exp() - 1.0).abs() < 5e-3, "{low:?}");
    }
    assert_eq!(sky.arriving(0.0, -1e-3), [0.0; 3]);
    // For the Sun at 6 degrees of depression, a height of 35 km is at the edge of the shadow.
    let edge = f64::to_radians(6.0).sin();
    assert_eq!(sky.arriving(34.0, -edge), [0.0; 3]);
    assert!(sky.arriving(40.0, -edge)[0] > 0.0);
}

#[test]
fn tables_match_direct_integration() {
    let sky = sky();
    let mut worst = 0.0_f64;
    for source_deg in [50.0, 10.0, 0.0, -4.0, -9.0] {
        let source = f64::to_radians(source_deg);
        let table = sky.table(source);
        for i in 0..30 {
            for j in 0..20 {
                let (altitude, azimuth) = ((f64::from(i) + 0.4) / 30.0 * FRAC_PI_2, (f64::from(j) + 0.3) / 20.0 * PI);
                let cosine = direction(altitude, azimuth).dot(direction(source, 0.0));
                let expected = sky.luminance(source, altitude, azimuth);
                let found = table.luminance(altitude, azimuth, cosine);
                let mirrored = table.luminance(altitude, -azimuth, cosine);
                (0..3).for_each(|c| worst = worst.max((found[c] / expected[c] - 1.0).abs()));
                assert_eq!(found, mirrored);
            }
        }
    }
    println!("largest error of the tables {worst:.4}");
    assert!(worst < 0.1, "{worst}");
    assert!(Arc::ptr_eq(&sky.table(0.3), &sky.table(0.300_05)));
}

#[test]
fn a_clear_sky_is_blue_red_at_sunset_and_dark_in_the_earths_shadow() {
    let sky = sky();
    let noon = sky.luminance(0.7, FRAC_PI_2, 0.0);
    assert!(noon[2] > 1.5 * noon[1] && noon[1] > 1.2 * noon[0], "{noon:?}");
    let dusk = f64::to_radians(-4.0);
    let [towards, away] = [0.0, PI].map(|azimuth| sky.luminance(dusk, f64::to_radians(2.0), azimuth));
    assert!(towards[0] > towards[1] && towards[1] > towards[2], "{towards:?}");
    assert!(away[2] > away[1] && towards[1] > 4.0 * away[1], "{towards:?} {away:?}");
    let zenith = sky.luminance(dusk, FRAC_PI_2, 0.0);
    assert!(zenith[2] > 2.0 * zenith[1], "ozone makes twilight blue: {zenith:?}");
}

#[test]
fn light_from_all_azimuths_is_uniform_and_gives_a_level_surface_one_lux() {
    let even = sky().table(0.0).all_around(0.0);
    let luminance = |altitude_deg: f64, azimuth: f64| even.luminance(altitude_deg.to_radians(), azimuth, 0.3);
    assert_eq!(luminance(20.0, 0.1), luminance(20.0, 2.9));
    let [low, high] = [luminance(3.0, 0.0), luminance(90.0, 0.0)];
    // A sunset at all azimuths: bright and red below, blue above.
    assert!(rec709::luminance(low) > 2.0 * rec709::luminance(high), "{low:?} {high:?}");
    assert!(low[0] / low[2] > 1.3 * high[0] / high[2], "{low:?} {high:?}");
    // A uniform sky of 1 / pi gives 1 lx.
    assert!((0.3..1.0).contains(&(rec709::luminance(high) * PI)), "{high:?}");
    let other = sky().table(0.0).luminance(0.35, 0.1, 0.9);
    assert_ne!(other, sky().table(0.0).luminance(0.35, 2.9, -0.9), "one source depends on azimuth");
}

#[test]
fn the_sky_gives_the_ground_its_published_illuminance() {
    // Global horizontal illuminance at sunset and at 6 degrees of depression: 730 and 3.4 lx (P. K. Seidelmann, "Explanatory Supplement", 1992, table 9.311), within a factor of 1.6.
    let sky = sky();
    for (source_deg, published_lx) in [(0.0, 730.0), (-6.0, 3.4)] {
        let mut lit_lx = 0.0;
        for i in 0..12 {
            let sine = (f64::from(i) + 0.5) / 12.0;
            for j in 0..16 {
                let seen = sky.luminance(f64::to_radians(source_deg), sine.asin(), (f64::from(j) + 0.5) / 16.0 * TAU);
                lit_lx += TAU * sine / 192.0 * seen[1] * 1.26e5;
            }
        }
        println!("{source_deg} degrees: {lit_lx:.2} lx on the ground, published {published_lx}");
        assert!((1.0 / 1.6..1.6).contains(&(lit_lx / published_lx)), "{source_deg}: {lit_lx}");
    }
}

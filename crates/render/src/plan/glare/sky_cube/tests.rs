use std::f64::consts::{FRAC_PI_2, PI};

use glam::DMat3;

use super::*;
use crate::{
    catalogue::StarRecord,
    photometry::{atmosphere::Air, glare::InverseSquareKernel, rec709::luminance},
    scene::surroundings::{Ground, Horizon, Surroundings},
};

fn sky(stars: u32) -> StarSet {
    let records = (0..stars)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(stars);
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            StarRecord {
                position: direction * (3.0 + f64::from(i % 50)),
                magnitude: (i % 12) as f32,
                temperature_k: 3000.0 + (i % 7) as f32 * 2000.0,
                distance_known: i % 3 != 0,
            }
        })
        .collect();
    StarSet::from_records(records)
}

fn settings() -> SkyCubeSettings {
    SkyCubeSettings {
        place_pc: DVec3::new(0.3, -0.2, 0.1),
        motion: None,
        local_sky: None,
        faintest_lx: 0.0,
        farthest_eye_pc: 0.0,
        tolerance: 0.01,
        in_sums: None,
        pixel_classes_rad: vec![pixel_class_rad(0.001), pixel_class_rad(0.02)],
    }
}

fn budget(least_cd_m2: f64, least_of_glow: f64) -> Option<VeilInSums> {
    Some(VeilInSums { least_cd_m2, least_of_glow })
}

fn kernel() -> InverseSquareKernel {
    InverseSquareKernel::new(0.1_f64.to_radians())
}

#[test]
fn cells_contain_their_centres() {
    for cells in [1, 8, 64] {
        for index in 0..6 * (cells * cells) as usize {
            assert_eq!(cell_of(direction_of_cell(index, cells), cells), index);
        }
    }
}

/// For every class of pixels, the map's kernels, the bumps and the sprites together distribute all light exactly once.
#[test]
fn all_light_is_distributed_exactly_once() {
    let set = sky(20_000);
    let glare = SkyCubePlan::new(&set, &kernel(), &settings(), None, None);
    let total: f64 = glare.light.levels[0].cells.iter().map(|cell| luminance(cell.light)).sum();
    let expected: f64 = set
        .iter()
        .map(|(place, at_infinity, star)| {
            let place = if at_infinity { place } else { place - settings().place_pc };
            star.illuminance_at_1_pc_lx() / place.length_squared()
        })
        .sum();
    assert!((total / expected - 1.0).abs() < 1e-5, "{total} {expected}");
    for level in &glare.light.levels[1..] {
        let sum: f64 = level.cells.iter().map(|cell| luminance(cell.light)).sum();
        assert!((sum / total - 1.0).abs() < 1e-9);
    }
    // Integrals of the levels' kernels from their tables (trapezoids over solid angle).
    let share = |level: &Level| {
        let step = level.end_squared / (TABLE_ENTRIES - 1) as f64;
        let ends = 0.5 * (level.table[0] + level.table[TABLE_ENTRIES - 1]);
        PI * step * (level.table.iter().sum::<f64>() - ends)
    };
    let smooth: f64 = glare.light.levels.iter().map(share).sum();
    assert!(!glare.sprites.sprites.is_empty());
    for class in &glare.classes {
        let bumps: f64 = class.bumps.iter().map(|light| luminance(*light) * bump_share(glare.bump_squared)).sum();
        let drawn: Vec<_> =
            glare.sprites.sprites.iter().filter(|sprite| sprite.squared >= class.least_squared).collect();
        let sprites: f64 = drawn
            .iter()
            .map(|sprite| {
                let share = if sprite.whole {
                    kernel().share_within(smooth_angle_rad(0)) - glare.soft.share()
                } else {
                    class.shown.faded_share(&kernel(), sprite.squared)
                };
                share * luminance(sprite.light)
            })
            .sum();
        let shared_out = (smooth * total + bumps + sprites) / total;
        assert!((shared_out - 1.0).abs() < 1e-4, "{shared_out}: {} sprites", drawn.len());
        assert!(bumps >= 0.0 && sprites > 0.0);
    }
    assert!(glare.classes[0].least_squared < glare.classes[1].least_squared);
}

#[test]
fn sprites_are_found_by_their_cells() {
    let glare = SkyCubePlan::new(&sky(5000), &kernel(), &settings(), None, None);
    let Sprites { sprites, cells, regions } = &glare.sprites;
    let held = |cell: &SpriteCell| cell.first as usize..(cell.first + cell.count) as usize;
    assert_eq!(cells.iter().map(|cell| held(cell).len()).sum::<usize>(), sprites.len());
    assert_eq!(regions.iter().map(|region| held(region).len()).sum::<usize>(), cells.len());
    for cell in cells {
        for sprite in &sprites[held(cell)] {
            assert!((sprite.direction - cell.direction).length() + sprite.squared.sqrt() <= cell.reach + 1e-12);
        }
    }
    for region in regions {
        for cell in &cells[held(region)] {
            assert!((cell.direction - region.direction).length() + cell.reach <= region.reach + 1e-12);
        }
    }
}

#[test]
fn only_stars_in_different_directions_are_separate_for_each_eye() {
    let set = sky(300);
    let far = SkyCubePlan::new(&set, &kernel(), &settings(), None, None);
    assert!(far.light.near.is_empty());
    let near_pc = 5.0;
    let near = SkyCubePlan::new(
        &set,
        &kernel(),
        &SkyCubeSettings { farthest_eye_pc: near_pc * SHARED_PARALLAX_RAD, ..settings() },
        None,
        None,
    );
    assert!(!near.light.near.is_empty() && near.light.near.iter().all(|star| star.place_pc.length() < near_pc));
    let light = |glare: &SkyCubePlan| glare.light.levels[0].cells.iter().map(|cell| luminance(cell.light)).sum::<f64>();
    let own: f64 = near.near_for(DVec3::ZERO, None, None).iter().map(|(_, light)| luminance(*light)).sum();
    assert!(((light(&near) + own) / light(&far) - 1.0).abs() < 1e-9);
}

#[test]
fn classes_of_pixels_are_never_smaller_and_hardly_larger() {
    for pixel in [1e-5, 0.001, 0.00123, 0.5] {
        let class = pixel_class_rad(pixel);
        assert!(class >= pixel * 0.999_999 && class <= pixel * 1.045, "{pixel} {class}");
    }
}

#[test]
fn eyes_that_differ_by_rounding_share_a_class_and_so_do_all_in_a_cube() {
    let of_a_cube = eye_class_m(0.0);
    let corner_m = SHARED_CUBE_M * 0.75_f64.sqrt();
    for metres in [0.03, 1.0, 1e3, corner_m + 1e3] {
        assert_eq!(eye_class_m(metres), of_a_cube);
    }
    for metres in [1e9, 3e9, 1e12, 3.1e16] {
        let class = eye_class_m(metres);
        assert!((metres..1.3 * metres).contains(&class), "{metres}: {class}");
        for part in [1.0 - 1e-15, 1.0 + 1e-15] {
            assert_eq!(eye_class_m(metres * part), class, "{metres}");
        }
        assert!(eye_class_m(1.3 * metres) > class);
    }
}

#[test]
fn cameras_in_a_cube_share_the_position_of_their_map() {
    assert_eq!(map_place_pc(DVec3::splat(0.49 * SHARED_CUBE_M / PARSEC_M)), DVec3::ZERO);
    let far_pc = DVec3::new(8.0, -3.0, 1e4);
    let place_pc = map_place_pc(far_pc);
    let farthest_m = 0.75_f64.sqrt() * SHARED_CUBE_M;
    assert!((place_pc - far_pc).length() * PARSEC_M <= 1.001 * farthest_m);
    assert_eq!(map_place_pc(place_pc + DVec3::X * 1e3 / PARSEC_M), place_pc);
    assert_ne!(map_place_pc(place_pc + DVec3::X * SHARED_CUBE_M / PARSEC_M), place_pc);
}

#[test]
fn plans_with_the_same_cells_share_the_light_of_the_stars() {
    let set = sky(20_000);
    let other = SkyCubeSettings { tolerance: 0.03, pixel_classes_rad: vec![pixel_class_rad(0.002)], ..settings() };
    assert!(settings().has_same_cells(&other, &set));
    let plan = SkyCubePlan::new(&set, &kernel(), &settings(), None, None);
    let shared = SkyCubePlan::new(&set, &kernel(), &other, Some(&plan), None);
    assert!(Arc::ptr_eq(&plan.light, &shared.light));
    assert_eq!(shared, SkyCubePlan::new(&set, &kernel(), &other, None, None));
    assert_ne!(shared.sprites.sprites.len(), plan.sprites.sprites.len());
    // A display image first, then an exact one: in space the light of the first is not sufficient for the second, in air it is.
    for (local_sky, is_shared) in [(None, false), (Some(night(1e-4)), true)] {
        let exact = SkyCubeSettings { local_sky, ..settings() };
        let of_display = SkyCubeSettings { in_sums: budget(1e-3, 0.0), ..exact.clone() };
        assert!(exact.has_same_cells(&of_display, &set));
        let display = SkyCubePlan::new(&set, &kernel(), &of_display, None, None);
        let after = SkyCubePlan::new(&set, &kernel(), &exact, Some(&display), None);
        assert_eq!(Arc::ptr_eq(&after.light, &display.light), is_shared);
        assert_eq!(after, SkyCubePlan::new(&set, &kernel(), &exact, None, None));
    }
}

/// A sky with this glow in the zenith, above dark ground up to an altitude of 0.21 rad.
fn night(glow_cd_m2: f64) -> Arc<LocalSky> {
    let ground = Ground { horizon: Horizon::level(0.21), albedo: 0.0, landscape: None };
    let surroundings =
        Surroundings { air: Some(Air::new(0.2, 0.0, [glow_cd_m2; 3])), refraction: None, ground: Some(ground) };
    Arc::new(LocalSky::new(&surroundings, DMat3::IDENTITY, &[], None))
}

/// The glow hides faint sources in frames without a budget for the veil, and in frames whose error may be relative to it, but not in other frames with
/// a budget, such as display images.
#[test]
fn the_glow_of_the_sky_hides_faint_sources_above_the_ground() {
    let exact = settings();
    let of_display = SkyCubeSettings { in_sums: budget(1e-9, 0.0), ..settings() };
    let relative = SkyCubeSettings { in_sums: budget(1e-9, 1e-3), ..settings() };
    for (settings, is_hidden) in [(exact, true), (relative, true), (of_display, false)] {
        let [dark, bright] = [1e-9, 1.0].map(|glow_cd_m2| {
            let settings = SkyCubeSettings { local_sky: Some(night(glow_cd_m2)), ..settings.clone() };
            let sprites = SkyCubePlan::new(&sky(20_000), &kernel(), &settings, None, None).sprites.sprites;
            // Numbers of sprites in cells that contain ground, and high up.
            let between = |altitudes_rad: std::ops::Range<f64>| {
                sprites.iter().filter(|sprite| altitudes_rad.contains(&sprite.direction.y.asin())).count()
            };
            [between(0.0..0.22), between(0.8..FRAC_PI_2)]
        });
        assert!(dark[0] > 20 && bright[0] == dark[0], "the glare of low stars covers dark ground: {dark:?} {bright:?}");
        assert_eq!(bright[1] < dark[1] / 2, is_hidden, "{dark:?} {bright:?}");
        assert!(is_hidden || bright == dark, "{dark:?} {bright:?}");
    }
}

use std::fs;
use std::sync::LazyLock;
use std::thread;
use std::time::Instant;

use super::super::super::epoch::Vantage;
use super::super::super::packed::PackedStar;
use super::super::cells::CellFrame;
use super::super::composite::Composite;
use super::super::test_stores::{built, stars};
use super::super::tile::cells_per_tile;
use super::super::{LAYERS, PLANES};
use super::*;
use crate::photometry::rec709::luminance;
use crate::units::ARCSECOND_RAD;

/// A store of 20,000 stars within 7 degrees, built once.
fn store() -> &'static Path {
    static STORE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let towards = DVec3::new(0.3, -0.5, 0.8).normalize() * 8.0;
        let mut stars = stars(20_000, 3, 20.0);
        for (star, _) in &mut stars {
            let distance = star.position.length();
            star.position = (towards + star.position / distance).normalize() * distance;
        }
        built(&folder.path().join("store"), &stars);
        folder
    });
    STORE.path()
}

fn opened() -> DeepSky {
    DeepSky::open(&store().join("store"), &Epoch::default()).expect("a store")
}

fn keys(sky: &DeepSky, detail: Detail) -> Vec<PageKey> {
    let mut keys = Vec::new();
    (0..BUCKETS).for_each(|bucket| detail.pages(bucket, LAYERS.len(), |key| keys.push(key)));
    keys.retain(|key| key.stars(sky.store()) > 0);
    keys
}

#[test]
fn pages_have_the_places_and_the_light_of_leaves() {
    let sky = opened();
    let mut worst: f64 = 0.0;
    for key in keys(&sky, Detail::Stars) {
        let PageKey::Leaf { layer, cell } = key else { panic!("{key:?}") };
        let leaf = sky.store().leaf(usize::from(layer), u64::from(cell)).expect("a leaf");
        let page = sky.read(key).expect("a page");
        let (axis, half_angle_rad) = key.cone();
        assert_eq!(page.stars.len(), leaf.words.len());
        for (index, star) in page.stars.iter().enumerate() {
            let exact = leaf.star(index);
            let (towards, factor) = page.seen(star, DVec3::ZERO);
            worst = worst.max(towards.normalize().cross(exact.direction).length());
            assert!(towards.angle_between(axis) <= half_angle_rad);
            let light = PackedStar { offset_pc: [0.0; 3], light: star.light }.illuminance_at_1_pc_lx() * factor;
            assert!((light / exact.illuminance_lx - 1.0).abs() < 4e-5);
            assert_eq!(star.light, PackedStar::new(glam::Vec3::ZERO, exact.illuminance_lx, exact.temperature_k).light);
            assert_eq!(page.is_distance_known(star), exact.distance_pc.is_some());
            // From another place.
            let camera_pc = DVec3::new(3.0, -40.0, 20.0);
            let (towards, factor) = page.seen(star, camera_pc);
            let place = exact.direction * exact.distance_pc.unwrap_or(200_000.0) - camera_pc;
            assert!(towards.normalize().cross(place.normalize()).length() < 1e-7);
            let expected = (exact.distance_pc.unwrap_or(200_000.0) / place.length()).powi(2);
            assert!((factor / expected - 1.0).abs() < 1e-5, "{factor} {expected}");
        }
    }
    assert!(worst < 0.5e-3 * ARCSECOND_RAD, "{} mas", worst / ARCSECOND_RAD * 1e3);
}

#[test]
fn composite_stars_of_pages_are_in_their_cells() {
    let sky = opened();
    let (mut seen, mut worst): (u32, f64) = (0, 0.0);
    for key in keys(&sky, Detail::Composites { leaves: 0, order: 9 }).into_iter().take(200) {
        let PageKey::Tile { plane, cell } = key else { continue };
        let (order, tile) = (PLANES[usize::from(plane)].order, sky.store().tile(usize::from(plane), u64::from(cell)));
        let tile = tile.expect("a tile");
        let page = sky.read(key).expect("a page");
        for ((inner, bits), star) in tile.cells.iter().zip(&tile.bits).zip(&page.stars) {
            let finer = u64::from(cell) * cells_per_tile(order) as u64 + u64::from(*inner);
            let exact = CellFrame::new(order, finer).direction(Composite::from_bits(*bits).inside);
            let found = page.seen(star, DVec3::ZERO).0.normalize();
            worst = worst.max(found.cross(exact).length() / ARCSECOND_RAD * 1e3);
            seen += 1;
        }
    }
    // The limit allows for the steps of f32 numbers in a tile of 3.7 degrees.
    assert!(seen > 100 && worst < 1.0, "{seen} stars, {worst} mas");
}

#[test]
fn every_detail_has_the_same_light() {
    let sky = opened();
    let sum = |detail: Detail| -> f64 {
        keys(&sky, detail).into_iter().map(|key| sky.read(key).expect("a page").total_lx).sum()
    };
    let stars = sum(Detail::Stars);
    let mut detail = Detail::Stars;
    while let Some(coarser) = detail.coarser() {
        let light = sum(coarser);
        // In a small store the relative error is larger, because some remainder of rounding is left over in each bucket.
        assert!((light / stars - 1.0).abs() < 2e-5, "{coarser:?}: {light} {stars}");
        detail = coarser;
    }
    let base: f64 = sky.base_light(DVec3::ZERO).map(|(_, light)| luminance(light)).sum();
    assert!((base / stars - 1.0).abs() < 2e-5 && (sky.total_lx() / stars - 1.0).abs() < 2e-5, "{base} {stars}");
}

#[test]
fn another_epoch_moves_pages_by_its_aberration() {
    let sky = opened();
    let vantage = Vantage { position_pc: DVec3::ZERO, velocity_c: DVec3::X * 1e-4, origin_pc: DVec3::ZERO };
    let moved = sky.at_epoch(&Epoch { years: 0.0, seen_from: Some(vantage) });
    for key in keys(&sky, Detail::Stars).into_iter().take(300) {
        let [before, after] = [&sky, &moved].map(|sky| sky.read(key).expect("a page"));
        let [before, after] = [&before, &after].map(|page| page.seen(&page.stars[0], DVec3::ZERO).0.normalize());
        let turned_arcsec = (after - before).length() / ARCSECOND_RAD;
        let expected = 20.626 * before.cross(DVec3::X).length();
        assert!((turned_arcsec - expected).abs() < 5e-3, "{turned_arcsec} {expected}");
    }
}

#[test]
fn pages_are_read_in_the_background_the_most_urgent_ones_first_and_forgotten_ones_not_at_all() {
    let sky = opened();
    let keys = keys(&sky, Detail::Stars);
    sky.set_delay(Duration::from_millis(5));
    let wants: Vec<(PageKey, f64)> = keys[..200].iter().enumerate().map(|(i, key)| (*key, i as f64)).collect();
    sky.ask(&wants);
    let held = || sky.pages_of(&keys[..200]);
    let started = Instant::now();
    while held().iter().flatten().count() < 60 {
        assert!(started.elapsed() < Duration::from_secs(20));
        thread::sleep(Duration::from_millis(5));
    }
    let found = held();
    let urgent = found[100..].iter().flatten().count();
    assert!(urgent >= 55, "{urgent} of the more urgent half");
    // Pages whose requests are not renewed are not read.
    thread::sleep(Duration::from_millis(1600));
    let before = sky.statistics().pages_read;
    sky.set_delay(Duration::ZERO);
    sky.ask(&[(keys[0], 1.0)]);
    thread::sleep(Duration::from_millis(200));
    assert!(sky.pages_of(&keys[..1])[0].is_some());
    assert!(sky.statistics().pages_read <= before + 40, "{} {before}", sky.statistics().pages_read);
}

#[test]
fn memory_keeps_its_limit_and_the_pages_used_last() {
    let sky = opened();
    let keys = keys(&sky, Detail::Stars);
    sky.load(&keys).expect("read");
    let all = sky.statistics().bytes;
    assert_eq!(all, keys.iter().map(|key| 16 * u64::from(key.stars(sky.store()))).sum::<u64>());
    thread::sleep(Duration::from_millis(600));
    let used = &keys[..20];
    assert!(sky.pages_of(used).iter().all(Option::is_some));
    sky.set_limit(all / 4);
    assert!(sky.statistics().bytes <= all / 4);
    assert!(sky.pages_of(used).iter().all(Option::is_some));
}

#[test]
fn a_damaged_leaf_is_reported_and_its_neighbours_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    for file in fs::read_dir(store().join("store")).expect("the store") {
        let file = file.expect("a file");
        fs::copy(file.path(), folder.path().join(file.file_name())).expect("copied");
    }
    let sky = DeepSky::open(folder.path(), &Epoch::default()).expect("a store");
    let path = folder.path().join("leaves-15");
    let mut bytes = fs::read(&path).expect("the leaves");
    bytes[4] ^= 1;
    fs::write(&path, bytes).expect("written");
    let leaves: Vec<PageKey> =
        keys(&sky, Detail::Stars).into_iter().filter(|key| matches!(key, PageKey::Leaf { layer: 1, .. })).collect();
    let error = sky.load(&leaves[..2]).expect_err("a damaged leaf").to_string();
    assert!(error.contains("leaves-15") && error.contains("damaged"), "{error}");
    sky.ask(&leaves[..3].iter().map(|key| (*key, 1.0)).collect::<Vec<_>>());
    let started = Instant::now();
    while sky.problem().is_none() || sky.pages_of(&leaves[1..3]).iter().any(Option::is_none) {
        assert!(started.elapsed() < Duration::from_secs(20));
        thread::sleep(Duration::from_millis(5));
    }
    assert!(sky.pages_of(&leaves[..1])[0].is_none());
    assert_eq!(sky.problem(), Some(error));
}

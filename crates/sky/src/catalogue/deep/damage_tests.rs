//! Tests with damaged stores: all damage is reported, and no damaged part is decoded as other data.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cells::cell_count;
use super::check::check;
use super::test_stores::{built, stars};
use super::tile::tile_order;
use super::{DeepStore, LAYERS, PLANES};

/// Contents of all files by name.
type Files = BTreeMap<String, Vec<u8>>;

fn files_of(folder: &Path) -> Files {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    entries
        .map(|entry| (entry.file_name().into_string().expect("UTF-8"), fs::read(entry.path()).expect("read")))
        .collect()
}

/// Words of every leaf and tile with stars.
struct Parts {
    leaves: Vec<(usize, u64, Vec<u64>)>,
    tiles: Vec<(usize, u64, super::tile::Tile)>,
}

fn parts_of(store: &DeepStore) -> Parts {
    let mut parts = Parts { leaves: Vec::new(), tiles: Vec::new() };
    for (layer, kind) in LAYERS.iter().enumerate() {
        let cells = (0..cell_count(kind.order)).filter(|cell| store.leaf_stars(layer, *cell) > 0);
        parts.leaves.extend(cells.map(|cell| (layer, cell, store.leaf(layer, cell).expect("valid").words)));
    }
    for (plane, kind) in PLANES.iter().enumerate() {
        let cells = (0..cell_count(tile_order(kind.order))).filter(|cell| store.tile_stars(plane, *cell) > 0);
        parts.tiles.extend(cells.map(|cell| (plane, cell, store.tile(plane, cell).expect("valid"))));
    }
    parts
}

/// Damages one or two files in one of eight ways; returns the files that changed.
fn damaged(rng: &mut ChaCha8Rng, kind: u32, whole: &Files, other: &Files) -> Vec<(String, Vec<u8>)> {
    let names: Vec<&String> = whole.iter().filter(|(_, bytes)| !bytes.is_empty()).map(|(name, _)| name).collect();
    let pick = |rng: &mut ChaCha8Rng| names[rng.random_range(0..names.len())].clone();
    let name = pick(rng);
    let mut bytes = whole[&name].clone();
    let place = rng.random_range(0..bytes.len());
    match kind {
        0 | 1 => bytes[place] ^= 1 << rng.random_range(0..8),
        2 => bytes.truncate(place),
        3 => bytes.extend_from_within(place..),
        4 => {
            // A block of zeros, as after a power failure.
            let end = (place + 4096).min(bytes.len());
            bytes[place..end].fill(0);
        }
        5 => {
            // Two words change places.
            let words = bytes.len() / 8;
            let (first, second) = (place / 8 % words * 8, rng.random_range(0..words) * 8);
            (0..8).for_each(|byte| bytes.swap(first + byte, second + byte));
        }
        6 => {
            let second = pick(rng);
            return vec![(name.clone(), whole[&second].clone()), (second, bytes)];
        }
        _ => bytes = other[&name].clone(),
    }
    vec![(name, bytes)]
}

/// Makes `count` damaged copies and checks each of them.
fn every_copy_is_reported(count: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, other_path) = (folder.path().join("store"), folder.path().join("other"));
    let report = built(&path, &stars(4000, 1, 16.9));
    assert!(report.layers[0] > 500 && report.layers[1] > 500 && report.bright > 500, "{report:?}");
    built(&other_path, &stars(4000, 2, 16.9));
    let (whole, other) = (files_of(&path), files_of(&other_path));
    let parts = parts_of(&DeepStore::open(&path).expect("a store"));
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let mut tried = 0;
    while tried < count {
        let kind = tried % 8;
        let changed = damaged(&mut rng, kind, &whole, &other);
        if changed.iter().all(|(name, bytes)| whole[name] == *bytes) {
            continue;
        }
        tried += 1;
        changed.iter().for_each(|(name, bytes)| fs::write(path.join(name), bytes).expect("written"));
        let names: Vec<&String> = changed.iter().map(|(name, _)| name).collect();
        let opened = DeepStore::open(&path);
        let result = opened
            .as_ref()
            .map_err(ToString::to_string)
            .and_then(|store| check(store, false, &mut |_| ()).map_err(|error| error.to_string()));
        let message =
            result.map(|_| ()).expect_err(&format!("copy {tried}, damage {kind} of {names:?} is not reported"));
        // The message names a damaged file, or the folder if its index is not recognised.
        let is_named =
            names.iter().any(|name| message.contains(name.as_str())) || message.contains("not a deep star store");
        assert!(is_named, "{names:?}: {message}");
        // Every part that can be read equals the original.
        if let Ok(store) = &opened {
            for (layer, cell, words) in parts.leaves.iter().step_by(7) {
                assert!(
                    store.leaf(*layer, *cell).is_ok_and(|leaf| leaf.words == *words)
                        || store.leaf(*layer, *cell).is_err()
                );
            }
            for (plane, cell, tile) in parts.tiles.iter().step_by(7) {
                assert!(
                    store.tile(*plane, *cell).is_ok_and(|found| found == *tile) || store.tile(*plane, *cell).is_err()
                );
            }
        }
        names.iter().for_each(|name| fs::write(path.join(name), &whole[*name]).expect("written"));
    }
    check(&DeepStore::open(&path).expect("the store"), true, &mut |_| ()).expect("whole again");
}

#[test]
fn every_one_of_80_damaged_copies_is_reported() {
    every_copy_is_reported(80);
}

#[test]
#[ignore = "long: make test-all"]
fn every_one_of_2000_damaged_copies_is_reported() {
    every_copy_is_reported(2000);
}

#[test]
fn missing_files_and_other_folders_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let message = |path: &Path| DeepStore::open(path).map(|_| ()).expect_err("no store").to_string();
    assert!(message(folder.path()).contains("not a deep star store"));
    assert!(message(&PathBuf::from("/no/such/folder")).contains("/no/such/folder"));
    let path = folder.path().join("store");
    built(&path, &stars(300, 1, 15.5));
    for name in ["bright", "leaves-15", "plane-13-8"] {
        let (from, to) = (path.join(name), folder.path().join("away"));
        fs::rename(&from, &to).expect("renamed");
        assert!(message(&path).contains(name));
        fs::rename(to, from).expect("renamed");
    }
    let store = DeepStore::open(&path).expect("a store");
    assert!(store.leaf(0, 49_152).expect_err("no such leaf").to_string().contains("between 0 and 49151"));
    // A file is truncated while it is open: the error names the leaf.
    let (layer, cell, _) = parts_of(&store).leaves.pop().expect("a leaf");
    fs::write(path.join(LAYERS[layer].file()), b"").expect("written");
    let error = store.leaf(layer, cell).expect_err("cut").to_string();
    assert!(error.contains(&format!("leaf {cell} of order 7")), "{error}");
}

/// Wrong light with correct checksums is found only by `--light`.
#[test]
fn light_that_is_not_that_of_the_leaves_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, other) = (folder.path().join("store"), folder.path().join("other"));
    let mut some = stars(3000, 1, 14.9);
    built(&path, &some);
    some[1500].0.magnitude += 0.5;
    built(&other, &some);
    let [store, brighter] = [&path, &other].map(|path| DeepStore::open(path).expect("a store"));
    let mixed = |take_sums: bool| {
        let mut index = store.index().clone();
        if take_sums {
            index.sums = brighter.index().sums.clone();
        } else {
            index.tiles = brighter.index().tiles.clone();
        }
        index
    };
    for take_sums in [true, false] {
        let out = folder.path().join(format!("mixed-{take_sums}"));
        fs::create_dir(&out).expect("a folder");
        for (name, bytes) in files_of(&path) {
            fs::write(out.join(name), bytes).expect("written");
        }
        if !take_sums {
            for (name, bytes) in files_of(&other).into_iter().filter(|(name, _)| name.starts_with("plane")) {
                fs::write(out.join(name), bytes).expect("written");
            }
        }
        fs::write(out.join("index"), mixed(take_sums).to_bytes().0).expect("written");
        let store = DeepStore::open(&out).expect("a store");
        check(&store, false, &mut |_| ()).expect("right checksums");
        let error = check(&store, true, &mut |_| ()).expect_err("wrong light").to_string();
        assert!(error.contains(if take_sums { "order 5" } else { "does not match the light of its stars" }), "{error}");
    }
}

/// Each composite star is close to its cell, but their sum is not.
#[test]
fn light_whose_rounding_was_not_carried_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("store");
    built(&path, &stars(6000, 1, 14.9));
    let store = DeepStore::open(&path).expect("a store");
    // The plane of order 7 has 64 cells in a bucket: add one step of red to each.
    let plane = PLANES.iter().position(|plane| *plane == super::Plane { magnitude: 13, order: 7 }).expect("a plane");
    let mut index = store.index().clone();
    let (mut words, mut segments) = (Vec::new(), Vec::new());
    for cell in 0..cell_count(tile_order(7)) {
        let mut tile = store.tile(plane, cell).expect("valid");
        tile.bits.iter_mut().filter(|bits| **bits >> 55 < 511).for_each(|bits| *bits += 1 << 55);
        let of_tile = tile.to_words(7);
        segments.push(super::index::Segment::new(tile.bits.len() as u32, &of_tile));
        words.extend(of_tile);
    }
    index.tiles[plane].list = segments;
    fs::write(path.join(PLANES[plane].file()), bytemuck::cast_slice(&words)).expect("written");
    fs::write(path.join("index"), index.to_bytes().0).expect("written");
    let store = DeepStore::open(&path).expect("a store");
    check(&store, false, &mut |_| ()).expect("right checksums");
    let error = check(&store, true, &mut |_| ()).expect_err("too much light").to_string();
    assert!(error.contains("plane-13-7") && error.contains("carried rounding"), "{error}");
}

//! Each common mistake in installers' files is recognised by its rule. The files are MPCDI a3 sets of six projectors on
//! a tilted dome, with one mistake each.

use steradian::{
    glam::{DMat3, DQuat, DVec3},
    theatre::{
        Axes, Mask, ReadOptions, Region, RowOrder,
        check::{Dome, DomeReport, Projector as Judged, check},
        read,
    },
    view::{
        projection::{PlaneMapping, Warp},
        projector::Blend,
    },
};

use crate::common::theatre::{Alpha, Mpcdi, centre, projectors_of};

const SIZE: [u32; 2] = [240, 150];
/// Part of the dome in which every direction has light from at least two projectors.
const DOME: Dome = Dome { fov_deg: 164.0, tilt_deg: 0.0 };
const ALPHA: Alpha = Alpha { bits: 16, gamma: 2.2 };

fn set() -> Mpcdi {
    Mpcdi { alpha: Some(ALPHA), ..Mpcdi::a3(33, 33) }
}

fn regions(bytes: &[u8], options: &ReadOptions) -> Vec<Region> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.mpcdi");
    std::fs::write(&path, bytes).unwrap();
    read(&path, options).unwrap().regions
}

fn right() -> Vec<Region> {
    regions(&set().bytes(&projectors_of(SIZE)), &ReadOptions::default())
}

fn judged(regions: &[Region]) -> DomeReport {
    let warps: Vec<Warp> = regions.iter().map(|region| Warp::new(region.size_px, &region.grid).unwrap()).collect();
    let blend = |region: &Region| {
        let [alpha, beta] = [&region.alpha, &region.beta].map(|mask| mask.as_ref().map(Mask::weights));
        (alpha.is_some() || beta.is_some()).then(|| Blend::new(region.size_px, alpha, beta).unwrap())
    };
    let blends: Vec<Option<Blend>> = regions.iter().map(blend).collect();
    let projectors: Vec<Judged<'_>> = regions
        .iter()
        .zip(&warps)
        .zip(&blends)
        .map(|((region, warp), blend)| Judged {
            name: &region.name,
            mapping: warp as &dyn PlaneMapping,
            dome_from_view: DQuat::IDENTITY,
            blend: blend.as_ref(),
            dimmed_to: 1.0,
            screen: region.screen.as_ref(),
        })
        .collect();
    check(DOME, &projectors)
}

fn failed(report: &DomeReport) -> Vec<&'static str> {
    let mut rules: Vec<_> =
        report.findings.iter().filter(|finding| !finding.passed).map(|finding| finding.rule).collect();
    rules.dedup();
    rules
}

/// Checks a set with one mistake; returns the rules that fail, and their combined text.
fn mistake(name: &str, regions: &[Region]) -> (Vec<&'static str>, String) {
    let report = judged(regions);
    let rules = failed(&report);
    let findings = report.findings.iter().filter(|finding| !finding.passed);
    let text: Vec<String> =
        findings.map(|finding| format!("{}: {}: {}", finding.rule, finding.subject(), finding.what)).collect();
    println!("{name}: {rules:?}");
    (rules, text.join("\n"))
}

/// Asserts that the rule is among those that fail, and that its text contains these words.
#[track_caller]
fn assert_found(name: &str, regions: &[Region], rule: &str, words: &str) {
    let (rules, text) = mistake(name, regions);
    assert!(rules.contains(&rule) && text.contains(words), "{name}: {rules:?}\n{text}");
}

#[test]
fn the_correct_set_passes_all_rules() {
    let regions = right();
    let report = judged(&regions);
    assert!(report.passed(), "{:#?}", report.findings);
    let rules: Vec<&str> = report.findings.iter().map(|finding| finding.rule).collect();
    for rule in ["coverage", "blend", "tilt", "eye", "span", "reaches", "mirrored", "raster", "facets"] {
        assert!(rules.contains(&rule), "{rule}");
    }
}

#[test]
fn mistakes_in_geometry_are_recognised() {
    let projectors = projectors_of(SIZE);
    let bytes = set().bytes(&projectors);
    let rows = ReadOptions { rows: RowOrder::TopFirst, ..ReadOptions::default() };
    assert_found("rows upside down", &regions(&bytes, &rows), "mirrored", "rows upside down");

    let mut columns = right();
    for region in &mut columns {
        for row in region.grid.samples.chunks_exact_mut(33) {
            row.reverse();
        }
    }
    assert_found("columns reversed", &columns, "mirrored", "columns in the wrong order");

    // Leave out the frame: the axes of the file are then those of the room, in which the dome is tilted.
    let room = |axes| ReadOptions { axes: Axes::Map(axes), ..ReadOptions::default() };
    assert_found("tilt left out", &regions(&bytes, &room(DMat3::IDENTITY)), "tilt", "centred 20");
    let swapped = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    let (rules, _) = mistake("axes swapped", &regions(&bytes, &room(swapped)));
    assert!(rules.contains(&"coverage") && rules.contains(&"tilt"), "{rules:?}");

    let mut collapsed = right();
    let towards = collapsed[1].grid.samples[500].unwrap();
    for direction in collapsed[1].grid.samples.iter_mut().flatten() {
        *direction = (towards + 0.01 * *direction).normalize();
    }
    assert_found("offsets read as absolute values", &collapsed, "span", "offsets that were read as absolute values");

    let eye = ReadOptions { eye_m: DVec3::new(0.0, 0.5, 4.0), ..ReadOptions::default() };
    assert_found("another eye point", &regions(&bytes, &eye), "eye", "eye point or origin");
    // Write millimetres without naming the unit.
    let unnamed = Mpcdi { per_metre: 1000.0, ..set() };
    let unnamed = regions(&unnamed.bytes(&projectors), &ReadOptions::default());
    assert_found("millimetres read as metres", &unnamed, "unit", "a different unit");

    let without = |left_out: &[usize]| -> Vec<Region> {
        right()
            .into_iter()
            .enumerate()
            .filter(|(index, _)| !left_out.contains(index))
            .map(|(_, region)| region)
            .collect()
    };
    assert_found("a gap", &without(&[2, 3]), "coverage", "the widest gap is");

    let mut twice = right();
    twice[4] = Region { name: "again".to_owned(), ..twice[3].clone() };
    assert_found("one region twice", &twice, "twice", "same region used twice");

    let coarse = Mpcdi {
        warp: "<interpolation>linear</interpolation>".to_owned(),
        ..Mpcdi { alpha: Some(ALPHA), ..Mpcdi::a3(9, 9) }
    };
    let coarse = regions(&coarse.bytes(&projectors), &ReadOptions::default());
    assert_found("a coarse grid without splines", &coarse, "facets", "grid is too coarse");

    let mut noisy = right();
    let mut state = 1_u32;
    for direction in noisy[0].grid.samples.iter_mut().flatten() {
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        *direction = (*direction + 4e-3 * DVec3::new(noise(), noise(), noise())).normalize();
    }
    assert_found("noise of the measurement", &noisy, "facets", "values are noisy");

    // Exchange width and height of the raster.
    let exchanged: Vec<Region> = right().into_iter().map(|region| Region { size_px: [150, 240], ..region }).collect();
    assert_found("raster of the wrong shape", &exchanged, "raster", "is the raster 150 x 240?");

    // Use a mesh for a larger fisheye than the options state.
    let narrow: Vec<Region> = right()
        .into_iter()
        .map(|mut region| {
            for direction in region.grid.samples.iter_mut().flatten() {
                let theta = direction.angle_between(DVec3::Y);
                let across = (*direction - DVec3::Y * direction.y).normalize_or_zero();
                *direction = DVec3::Y * (0.8 * theta).cos() + across * (0.8 * theta).sin();
            }
            Region { screen: None, ..region }
        })
        .collect();
    assert_found("a field of view too small", &narrow, "rim", "too small");
}

#[test]
fn mistakes_in_blends_are_recognised() {
    let projectors = projectors_of(SIZE);
    let change = |edit: &dyn Fn(usize, &mut Region)| {
        let mut regions = right();
        regions.iter_mut().enumerate().for_each(|(index, region)| edit(index, region));
        regions
    };
    let masked = |region: &mut Region, curve: &dyn Fn(f32) -> f32| {
        if let Some(mask) = &mut region.alpha {
            mask.values.iter_mut().for_each(|value| *value = curve(*value));
        }
    };
    assert_found("masks left out", &change(&|_, region| region.alpha = None), "blend", "no projector has a blend mask");

    // Use five projectors, whose masks differ, and swap two of the masks.
    let mut five = projectors.clone();
    five.remove(3);
    let mut swapped = regions(&set().bytes(&five), &ReadOptions::default());
    let (first, rest) = swapped.split_at_mut(3);
    std::mem::swap(&mut first[0].alpha, &mut rest[0].alpha);
    assert_found("masks swapped", &swapped, "swapped", "`bp0/p0` and `bp4/p4`");
    let mut marked = right();
    let shift = |mask: &mut Mask| mask.values.rotate_right(40);
    marked[1].alpha.iter_mut().for_each(shift);
    assert_found("mask of another projector", &marked, "blend", "sum of the shares of light");

    let gamma = change(&|_, region| masked(region, &|value| value.powf(1.0 / 2.2)));
    assert_found("gamma of masks left out", &gamma, "gamma", "power 2.20");
    let doubled = change(&|_, region| masked(region, &|value| value.powf(2.2)));
    assert_found("gamma of masks twice", &doubled, "gamma", "power 0.45");
    let inverted = change(&|_, region| masked(region, &|value| 1.0 - value));
    assert_found("masks inverted", &inverted, "blend", "sum of the shares of light");

    // Black levels are correct if they are higher where fewer projectors overlap; the reverse is a mistake.
    let black = |inverted: bool| {
        change(&|own, region| {
            let [width, height] = [60, 40];
            let count = |x: f64, y: f64| {
                let direction = projectors[own].direction(x, y);
                projectors.iter().filter(|projector| projector.place(direction).is_some()).count()
            };
            let lift = |x: usize, y: usize| {
                let count = count(centre(x, width), centre(y, height)) as f32;
                0.002 * if inverted { count } else { (6.0 - count) / count }
            };
            let values = (0..width * height).map(|index| lift(index % width, index / width)).collect();
            region.beta = Some(Mask { width, height, values, levels: 65_535 });
        })
    };
    assert!(judged(&black(false)).passed(), "{:?}", failed(&judged(&black(false))));
    assert_found("black levels inverted", &black(true), "black_level", "more where fewer projectors reach");
}

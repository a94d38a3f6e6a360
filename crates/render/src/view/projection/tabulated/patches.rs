//! Patches: finely sampled images for cells of the grid in which a search does not converge. At kinks of the mapping,
//! such as the poles of many maps of the sphere, the slopes do not point towards the solution. These cells store the
//! images themselves, separately for each side of a cut.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3};

use super::{
    super::PlaneMapping,
    starts::{NO_START, Starts, side_of_cut},
};

/// Flag in a cell's word that refers to a patch. The remaining bits are the index of the patch's first group of words.
pub const PATCH_BIT: u32 = 1 << 31;
/// Intervals along a side of a patch.
pub const PATCH_STEPS: u32 = 16;
/// A sample closer than this to a cut may be on its other side, in units of a cell.
const BESIDE_CUT: f64 = 1e-3;

const NEIGHBOURS: [[i64; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// The image at a position in a cell, from (0, 0) to (1, 1), interpolated in its patch.
pub(super) fn in_patch(samples: &[[f32; 2]], part: DVec2) -> DVec2 {
    let steps = f64::from(PATCH_STEPS);
    let place = (part * steps).clamp(DVec2::ZERO, DVec2::splat(steps));
    let first = place.floor().min(DVec2::splat(steps - 1.0));
    let sample = |i: usize, j: usize| {
        let [x, y] = samples[(first.y as usize + j) * (PATCH_STEPS as usize + 1) + first.x as usize + i];
        DVec2::new(f64::from(x), f64::from(y))
    };
    let part = place - first;
    sample(0, 0).lerp(sample(1, 0), part.x).lerp(sample(0, 1).lerp(sample(1, 1), part.x), part.y)
}

/// Creates patches for the cells that contain these directions, and for their neighbours. `base`: groups of words
/// before the first patch.
pub(super) fn refine(starts: &mut Starts, source: &dyn PlaneMapping, directions: &[DVec3], base: u32) {
    let side = i64::from(starts.side);
    let mut cells = BTreeSet::new();
    for direction in directions {
        let held = starts.place(*direction).floor();
        for [i, j] in NEIGHBOURS.into_iter().chain([[0, 0]]) {
            let (x, y) = (held.x as i64 + i, held.y as i64 + j);
            if (0..side).contains(&x) && (0..side).contains(&y) {
                cells.insert((x, y));
            }
        }
    }
    for (x, y) in cells {
        let index = (y * side + x) as usize;
        let before = starts.cells[index];
        for number in 0..2 {
            if before[number] == NO_START {
                continue;
            }
            let own = |at: DVec2| {
                let beyond = if before[1] == NO_START { 1.0 } else { side_of_cut(before, at) };
                if number == 0 { beyond > BESIDE_CUT } else { beyond < -BESIDE_CUT }
            };
            let image = |at: DVec2| {
                let direction = starts.direction(DVec2::new(x as f64, y as f64) + 0.5 + at)?;
                if own(at) { source.pixel_from_direction(direction) } else { None }
            };
            if let Some(samples) = patch(image) {
                starts.cells[index][number] = PATCH_BIT | (base + starts.patches.len() as u32);
                starts.patches.extend(samples);
            }
        }
    }
}

/// The samples of a patch, row by row; samples without an image are extrapolated from their neighbours.
fn patch(image: impl Fn(DVec2) -> Option<DVec2>) -> Option<Vec<[f32; 2]>> {
    let count = i64::from(PATCH_STEPS) + 1;
    let offset = |index: i64| index as f64 / f64::from(PATCH_STEPS) - 0.5;
    let places = (0..count).flat_map(|j| (0..count).map(move |i| DVec2::new(offset(i), offset(j))));
    let mut samples: Vec<Option<DVec2>> = places.map(image).collect();
    while samples.iter().any(Option::is_none) {
        let before = samples.clone();
        let held = |x: i64, y: i64| {
            let inside = (0..count).contains(&x) && (0..count).contains(&y);
            if inside { before[(y * count + x) as usize] } else { None }
        };
        let mut grown = false;
        for (index, sample) in samples.iter_mut().enumerate().filter(|(_, sample)| sample.is_none()) {
            let (x, y) = (index as i64 % count, index as i64 / count);
            *sample = continued(|i, j| held(x + i, y + j));
            grown |= sample.is_some();
        }
        if !grown {
            return None;
        }
    }
    Some(samples.into_iter().flatten().map(|sample| sample.as_vec2().to_array()).collect())
}

/// Extrapolates a sample from its neighbours with straight lines through two samples on the same side; if there are no
/// two, with the adjacent samples.
fn continued(held: impl Fn(i64, i64) -> Option<DVec2>) -> Option<DVec2> {
    for lines in [true, false] {
        let found = NEIGHBOURS.into_iter().filter_map(|[i, j]| {
            let near = held(i, j)?;
            if lines { Some(near * 2.0 - held(2 * i, 2 * j)?) } else { Some(near) }
        });
        let (sum, count) = found.fold((DVec2::ZERO, 0.0), |(sum, count), sample| (sum + sample, count + 1.0));
        if count > 0.0 {
            return Some(sum / count);
        }
    }
    None
}

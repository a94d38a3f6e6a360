//! Final steps of a build or a merge: selects the bright stars, and writes the files `bright` and `index` and the record of a part.

use std::fs;
use std::path::Path;

use rayon::prelude::*;

use super::super::StarRecord;
use super::super::store::{self, Store};
use super::build::{BuildReport, Limit};
use super::cell_range::CellRange;
use super::cells::SkyPlace;
use super::error::DeepError;
use super::index::{self, BrightFile, Index, PartOfIndex, Segment};
use super::journal::{BrightStars, Counts, State};
use super::part::{Input, PartRecord};
use super::resident::listed_again;
use super::{BRIGHT_FILE, BUCKET_ORDER, DeepStore, EPOCH_YEAR};
use crate::files;

/// Source of the stars of a store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    /// Human-readable description, which is written into the store.
    pub description: String,
    /// Lines for the report of a merge.
    pub lines: Vec<String>,
    /// Inputs with digests of their contents: a merge compares those of its parts with each other.
    pub inputs: Vec<Input>,
}

impl From<String> for Sources {
    fn from(description: String) -> Self {
        Self { description, ..Self::default() }
    }
}

/// Numbers of stars that needed a rule, and of those that were left out. The numbers of a whole store are the sums over its parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Tally {
    /// Counts of the first pass.
    pub counts: Counts,
    /// Stars in leaves without colour that got a median temperature.
    pub median_colour: u64,
    /// Number of stars that were left out because they equal another star.
    pub repeated: u64,
    /// Number of stars that were left out because they are also in the built-in table.
    pub listed_again: u64,
}

impl Tally {
    /// Adds the numbers of another tally.
    pub fn add(&mut self, other: Self) {
        self.counts.add(other.counts);
        self.median_colour += other.median_colour;
        self.repeated += other.repeated;
        self.listed_again += other.listed_again;
    }
}

/// Tables of the index for all cells.
pub struct Tables {
    /// Leaves of each layer; empty for a layer without stars.
    pub leaves: Vec<Vec<Segment>>,
    /// Light of each layer in each cell of order 5.
    pub sums: Vec<Vec<[f64; 3]>>,
    /// Tiles of each plane; empty for a plane without stars.
    pub tiles: Vec<Vec<Segment>>,
}

/// The bright stars that are kept, and numbers of those that are not.
pub struct ReadyBright {
    pub stars: BrightStars,
    /// Stars that were left out because they equal another star.
    pub repeated: u64,
    pub listed_again: u64,
}

/// Reads the bright stars. Leaves out those beyond the limit, those that are also in the built-in table, and those outside of `cells`.
pub fn ready_bright(
    folder: &Path,
    state: &State,
    limit: Option<Limit>,
    cells: CellRange,
) -> Result<ReadyBright, DeepError> {
    let mut stars = BrightStars::read(folder, state.bright)?;
    if let Some(limit) = limit {
        leave_out_beyond(&mut stars, limit);
    }
    let built_in: Vec<StarRecord> = stars
        .records
        .iter()
        .zip(&stars.is_built_in)
        .filter(|(_, is_built_in)| **is_built_in)
        .map(|(star, _)| *star)
        .collect();
    let mut again = 0;
    if !built_in.is_empty() && built_in.len() < stars.records.len() {
        let listed = listed_again(&built_in, stars.records.iter());
        let keep: Vec<bool> =
            listed.iter().zip(&stars.is_built_in).map(|(listed, built_in)| *built_in || !listed).collect();
        again = keep.iter().filter(|keep| !**keep).count() as u64;
        stars.retain(&keep);
    }
    // Stars of the built-in table outside of the cells were needed only to find their duplicates inside: leave them out now.
    let keep: Vec<bool> = stars.records.iter().map(|star| cells.contains_direction(star.position)).collect();
    if keep.contains(&false) {
        stars.retain(&keep);
    }
    let keep = one_of_equals(&stars);
    let repeated = keep.iter().filter(|keep| !**keep).count() as u64;
    if repeated > 0 {
        stars.retain(&keep);
    }
    Ok(ReadyBright { stars, repeated, listed_again: again })
}

/// Leaves out stars beyond the limit. Of the stars of exactly the limiting magnitude the first ones are kept, sorted by cell of order 4 and then by
/// coordinates.
fn leave_out_beyond(stars: &mut BrightStars, limit: Limit) {
    let magnitudes: Vec<f32> = stars.records.par_iter().map(|star| star.apparent_magnitude() as f32).collect();
    let mut keep: Vec<bool> = magnitudes.iter().map(|v_mag| *v_mag < limit.v_mag).collect();
    let ties = (0..magnitudes.len()).filter(|index| magnitudes[*index] == limit.v_mag);
    let mut ties: Vec<(u64, usize)> =
        ties.map(|index| (SkyPlace::from_direction(stars.records[index].position).cell(BUCKET_ORDER), index)).collect();
    ties.sort_by(|(first, a), (second, b)| {
        let [a, b] = [a, b].map(|index| stars.records[*index].position);
        first.cmp(second).then(a.x.total_cmp(&b.x)).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    });
    ties.iter().take(limit.bright_ties as usize).for_each(|(_, index)| keep[*index] = true);
    stars.retain(&keep);
}

/// Returns for each star whether it is kept. Of several stars that are equal in position, brightness, colour and distance one is kept, preferably one
/// with a motion and with names. The result does not depend on the order of the stars.
fn one_of_equals(stars: &BrightStars) -> Vec<bool> {
    let content = |index: &u32| {
        let star = &stars.records[*index as usize];
        (
            star.position.to_array().map(f64::to_bits),
            star.magnitude.to_bits(),
            star.temperature_k.to_bits(),
            star.distance_known,
        )
    };
    let rest = |index: &u32| {
        let velocity = stars.velocities.binary_search_by_key(index, |velocity| velocity.star);
        let velocity = velocity.ok().map(|found| stars.velocities[found].velocity.map(f32::to_bits));
        let names = stars.names.binary_search_by_key(index, |names| names.star).ok();
        let names = names.map(|found| (&stars.names[found].names.name, &stars.names[found].names.designations));
        (velocity.is_none(), names.is_none(), velocity, names)
    };
    let mut order: Vec<u32> = (0..stars.records.len() as u32).collect();
    order.par_sort_unstable_by(|a, b| content(a).cmp(&content(b)).then(a.cmp(b)));
    let mut is_kept = vec![true; stars.records.len()];
    for equals in order.chunk_by(|a, b| content(a) == content(b)).filter(|equals| equals.len() > 1) {
        let kept = equals.iter().min_by(|a, b| rest(a).cmp(&rest(b)));
        equals.iter().for_each(|index| is_kept[*index as usize] = Some(index) == kept);
    }
    is_kept
}

/// Writes bright stars, the record of a part and the index into the folder of an unfinished store. `cells` are those of a part; `None` for a whole
/// store.
///
/// # Errors
/// A whole store has no star, or I/O fails.
pub fn complete(
    folder: &Path,
    sources: Sources,
    tally: Tally,
    tables: Tables,
    mut stars: BrightStars,
    cells: Option<CellRange>,
) -> Result<BuildReport, DeepError> {
    let (motions, names) = (stars.velocities.len() as u64, stars.names.len() as u64);
    let count = stars.records.len() as u64;
    let Sources { description, lines, inputs } = sources;
    let part = cells.map(|cells| -> Result<PartOfIndex, DeepError> {
        let sha256 = PartRecord::new(cells, inputs, lines, tally).write(folder, &mut stars)?;
        Ok(PartOfIndex { cells, sha256 })
    });
    let part = part.transpose()?;
    let store = Store::from_records(description.clone(), stars.records, stars.velocities, stars.names);
    let path = folder.join(BRIGHT_FILE);
    store::write(&path, &store).map_err(|error| match error {
        store::StoreError::Io { path, source } => DeepError::io(&path)(source),
        other => DeepError::Bright(other),
    })?;
    drop(store);
    let header = store::read_header(&path)?;
    let bytes = fs::metadata(&path).map_err(DeepError::io(&path))?.len();
    let bright = BrightFile { bytes, stars: count, crc32: header.crc32 };
    let Tables { leaves, sums, tiles } = tables;
    let index = Index::new((EPOCH_YEAR, description), bright, leaves, sums, tiles);
    let index = index.ok_or_else(|| DeepError::damaged(folder, "the numbers of its stars overflow"))?;
    let index = Index { part, ..index };
    if index.stars() == 0 && part.is_none() {
        return Err(DeepError::NoStars { path: folder.to_owned() });
    }
    let index_path = folder.join(index::NAME);
    files::write_whole(&index_path, &index.to_bytes().0).map_err(DeepError::io(&index_path))?;
    let store = DeepStore::open(folder)?;
    Ok(BuildReport {
        cells,
        bright: count,
        layers: std::array::from_fn(|layer| index.leaves[layer].stars()),
        tally,
        motions,
        names,
        bytes: store.bytes(),
        root: store.root(),
    })
}

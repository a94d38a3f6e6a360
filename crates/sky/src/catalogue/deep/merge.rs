//! Joins the parts of a store ([`part`](super::part)).
//!
//! Every value in leaves, planes and sums of light depends on one cell of order 4 only. Therefore their bytes are copied; the checksum of each leaf
//! and tile is verified. The bright stars of all parts are sorted and divided into chunks together. The result has the same bytes as a store that one
//! program makes from the same inputs.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::build::{BuildReport, BuildStep, OnStep};
use super::cell_range::CellRange;
use super::error::DeepError;
use super::finish::{Sources, Tables, Tally, complete};
use super::index::{Index, Segment, Segments};
use super::journal::{BrightStars, State};
use super::part::PartRecord;
use super::tile::tile_order;
use super::work::{self, STORE};
use super::{BUCKETS, DeepStore, LAYERS, PLANES, SUM_ORDER};

/// Result of a merge.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// The store.
    pub build: BuildReport,
    /// A line for each catalogue, and lines for its data that the store lacks.
    pub catalogues: Vec<String>,
}

/// A part that is open.
struct Part {
    folder: PathBuf,
    store: DeepStore,
    record: PartRecord,
}

/// Joins parts, given in any order, into the whole store `out`. The folders of the parts are kept.
///
/// # Errors
/// Ranges of cells overlap or are missing, parts have different inputs or versions, a part is damaged, or the store cannot be written.
pub fn merge(parts: &[PathBuf], out: &Path, on_step: &mut OnStep<'_>) -> Result<MergeReport, DeepError> {
    let mut opened: Vec<Part> = parts.iter().map(|path| Part::open(path)).collect::<Result<_, _>>()?;
    opened.sort_by_key(|part| part.record.cells);
    check_cover(&opened)?;
    check_inputs(&opened)?;
    let is_out = |path: &Path| out.canonicalize().is_ok_and(|out| path.canonicalize().is_ok_and(|path| path == out));
    if parts.iter().any(|path| is_out(path)) {
        return Err(DeepError::Occupied { path: out.to_owned() });
    }

    let (folder, lock) = work::begin(out)?;
    if let Some(state) = State::read(&folder)? {
        return Err(DeepError::OtherJob { path: folder, found: state.job });
    }
    let store = folder.join(STORE);
    if store.exists() {
        // Start an interrupted merge again: copying takes less time than finding out how far it got.
        fs::remove_dir_all(&store).map_err(DeepError::io(&store))?;
    }
    fs::create_dir_all(&store).map_err(DeepError::io(&store))?;
    copy_files(&opened, &store, on_step)?;

    on_step(BuildStep { work: "sorting bright stars", done: 0, total: 1 });
    let (mut bright, mut tally) = (BrightStars::default(), Tally::default());
    for part in &opened {
        bright.append(part.record.bright(&part.folder)?);
        tally.add(part.record.tally);
    }
    let tables = joined_tables(&opened);
    // The list of parts is not empty, because their ranges cover all cells.
    let (description, catalogues) = opened
        .first()
        .map(|part| (part.store.index().description.clone(), part.record.lines.clone()))
        .unwrap_or_default();
    let build = complete(&store, Sources::from(description), tally, tables, bright, None)?;
    drop(lock);
    work::publish(&folder, out)?;
    Ok(MergeReport { build, catalogues })
}

impl Part {
    fn open(folder: &Path) -> Result<Self, DeepError> {
        let store = DeepStore::open(folder)?;
        let Some(part) = store.index().part else {
            let problem = "it is a whole store; a merge needs parts of a store, which `--cells` makes";
            return Err(DeepError::OtherPart { path: folder.to_owned(), problem: problem.to_owned() });
        };
        let record = PartRecord::read(folder, &part)?;
        // Refuse the part: the merge would lose its stars outside of its cells.
        let index = store.index();
        let orders = LAYERS.iter().map(|layer| layer.order).chain(PLANES.iter().map(|plane| tile_order(plane.order)));
        for (order, segments) in orders.zip(index.leaves.iter().chain(&index.tiles)) {
            let own: u64 =
                own_segments(segments, part.cells, order).iter().map(|segment| u64::from(segment.count)).sum();
            if own != segments.stars() {
                return Err(DeepError::damaged(folder, format!("it has stars outside of its cells {}", part.cells)));
            }
        }
        Ok(Self { folder: folder.to_owned(), store, record })
    }
}

/// Returns the segments of a range of cells; none if no cell has stars.
fn own_segments(segments: &Segments, cells: CellRange, order: u8) -> &[Segment] {
    segments.list.get(cells.at_order(order)).unwrap_or_default()
}

/// Refuses parts whose cells overlap or leave a gap. The parts must be sorted.
fn check_cover(parts: &[Part]) -> Result<(), DeepError> {
    let mut missing: Vec<String> = Vec::new();
    let mut gap = |first: u64, end: u64| missing.extend(CellRange::new(first, end).map(|range| range.to_string()));
    let mut covered: Option<&Part> = None;
    for part in parts {
        let end = covered.map_or(0, |before| before.record.cells.end());
        if part.record.cells.first() < end {
            let before = covered.map_or(&part.folder, |before| &before.folder);
            return Err(DeepError::Overlap {
                first: (before.clone(), covered.map_or(CellRange::ALL, |before| before.record.cells).to_string()),
                second: (part.folder.clone(), part.record.cells.to_string()),
            });
        }
        gap(end, part.record.cells.first());
        covered = Some(part);
    }
    gap(covered.map_or(0, |last| last.record.cells.end()), BUCKETS);
    if missing.is_empty() { Ok(()) } else { Err(DeepError::Gap { missing: missing.join(" and ") }) }
}

/// Refuses parts whose inputs differ from those of the first part.
fn check_inputs(parts: &[Part]) -> Result<(), DeepError> {
    let Some((first, others)) = parts.split_first() else { return Ok(()) };
    for other in others {
        let problem = difference(&first.record, &other.record);
        if let Some(problem) = problem {
            let problem = format!("{problem}; those of {} are needed", first.folder.display());
            return Err(DeepError::OtherPart { path: other.folder.clone(), problem });
        }
    }
    Ok(())
}

fn difference(first: &PartRecord, other: &PartRecord) -> Option<String> {
    let (expected, found) = (&first.inputs, &other.inputs);
    if expected.len() != found.len() {
        return Some(format!("it was made from {} inputs instead of {}", found.len(), expected.len()));
    }
    let differs = expected.iter().zip(found).find(|(a, b)| a.digest != b.digest);
    differs.map(|(a, b)| {
        format!("it was made from other inputs: {} ({:.12}) instead of {} ({:.12})", b.name, b.digest, a.name, a.digest)
    })
}

/// Reads the words of a leaf or tile.
type WordsOf<'a> = dyn Fn(&DeepStore, u64) -> Result<Vec<u64>, DeepError> + 'a;

/// Writes the files of leaves and planes.
fn copy_files(parts: &[Part], folder: &Path, on_step: &mut OnStep<'_>) -> Result<(), DeepError> {
    let bytes = |index: &Index| index.leaves.iter().chain(&index.tiles).map(Segments::bytes).sum::<u64>();
    let total: u64 = parts.iter().map(|part| bytes(part.store.index())).sum();
    let mut done = 0;
    let mut write = |name: String, order: u8, words: &WordsOf<'_>| {
        let path = folder.join(name);
        let file = File::create(&path).map_err(DeepError::io(&path))?;
        let mut file = BufWriter::with_capacity(1 << 20, file);
        for part in parts {
            on_step(BuildStep { work: "copying stars", done, total });
            for cell in part.record.cells.at_order(order) {
                let words = words(&part.store, cell as u64)?;
                file.write_all(bytemuck::cast_slice(&words)).map_err(DeepError::io(&path))?;
                done += 8 * words.len() as u64;
            }
        }
        file.flush().map_err(DeepError::io(&path))
    };
    for (index, layer) in LAYERS.iter().enumerate() {
        write(layer.file(), layer.order, &|store, cell| store.leaf_words(index, cell))?;
    }
    for (index, plane) in PLANES.iter().enumerate() {
        write(plane.file(), tile_order(plane.order), &|store, cell| store.tile_words(index, cell))?;
    }
    Ok(())
}

/// Joins the tables of all parts. A layer or plane without stars has no table.
fn joined_tables(parts: &[Part]) -> Tables {
    let joined = |order: u8, segments: &dyn Fn(&Index) -> &Segments| {
        let of_parts = parts.iter().map(|part| (part.record.cells, segments(part.store.index())));
        if of_parts.clone().all(|(_, segments)| segments.list.is_empty()) {
            return Vec::new();
        }
        let mut all = vec![Segment::default(); super::cells::cell_count(order) as usize];
        for (cells, segments) in of_parts.filter(|(_, segments)| !segments.list.is_empty()) {
            all[cells.at_order(order)].copy_from_slice(own_segments(segments, cells, order));
        }
        all
    };
    let sums = (0..LAYERS.len()).map(|layer| {
        let mut all = vec![[0.0; 3]; super::cells::cell_count(SUM_ORDER) as usize];
        for part in parts {
            let (sums, cells) = (&part.store.index().sums[layer], part.record.cells.at_order(SUM_ORDER));
            if !sums.is_empty() {
                all[cells.clone()].copy_from_slice(&sums[cells]);
            }
        }
        all
    });
    Tables {
        leaves: LAYERS
            .iter()
            .enumerate()
            .map(|(layer, kind)| joined(kind.order, &|index| &index.leaves[layer]))
            .collect(),
        sums: sums.collect(),
        tiles: PLANES
            .iter()
            .enumerate()
            .map(|(plane, kind)| joined(tile_order(kind.order), &|index| &index.tiles[plane]))
            .collect(),
    }
}

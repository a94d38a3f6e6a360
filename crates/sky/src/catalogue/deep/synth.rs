//! A synthetic Milky Way as a deep store.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::super::StarRecord;
use super::super::galaxy::stream::GalaxyStream;
use super::super::galaxy::{GalaxyError, GalaxyParameters};
use super::BUCKET_ORDER;
use super::build::{Build, BuildOptions, BuildReport, BuildStep, Limit, NewStar, OnStep, Sources};
use super::cell_range::CellRange;
use super::cells::SkyPlace;
use super::error::DeepError;
use super::part::Input;
use super::resident::is_resident;

/// Number of blocks that are drawn before the state may be saved again.
const BLOCKS_AT_ONCE: usize = 8;
/// Number of stars that a thread collects before it passes them on.
const BATCH: usize = 1 << 14;

/// Numbers of stars by magnitude. The faint limit for the requested number of stars is computed from them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Magnitudes {
    /// Number of stars that are too bright to be counted by magnitude.
    brighter: u64,
    /// Numbers by magnitude. The keys are the bits of the magnitude in sortable form; see [`sortable`].
    counted: BTreeMap<u32, Ties>,
}

/// Numbers of stars of one magnitude.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Ties {
    /// Number of all stars, and of those that are bright stars.
    total: u64,
    bright: u64,
    /// Numbers of bright stars and of stars in leaves in the cells that precede those of the part.
    before: [u64; 2],
}

/// Maps a magnitude to an integer with the same sort order.
fn sortable(v_mag: f32) -> u32 {
    let bits = v_mag.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Inverse of [`sortable`].
fn magnitude(sortable: u32) -> f32 {
    f32::from_bits(if sortable >> 31 == 1 { sortable & !(1 << 31) } else { !sortable })
}

impl Magnitudes {
    /// Counts a star. Stars of magnitude `from` or fainter are counted by magnitude; those in cells of order 4 before `first_cell` are also counted
    /// separately.
    fn add(&mut self, star: &StarRecord, from: f32, first_cell: u64) {
        let v_mag = star.apparent_magnitude() as f32;
        if v_mag < from {
            self.brighter += 1;
            return;
        }
        let ties = self.counted.entry(sortable(v_mag)).or_default();
        let is_bright = is_resident(star, v_mag, None);
        ties.total += 1;
        ties.bright += u64::from(is_bright);
        if first_cell > 0 && SkyPlace::from_direction(star.position).cell(BUCKET_ORDER) < first_cell {
            ties.before[usize::from(!is_bright)] += 1;
        }
    }

    fn merge(&mut self, other: Self) {
        self.brighter += other.brighter;
        for (v_mag, ties) in other.counted {
            let sum = self.counted.entry(v_mag).or_default();
            sum.total += ties.total;
            sum.bright += ties.bright;
            [0, 1].into_iter().for_each(|kind| sum.before[kind] += ties.before[kind]);
        }
    }

    fn total(&self) -> u64 {
        self.brighter + self.counted.values().map(|ties| ties.total).sum::<u64>()
    }

    /// Returns the limit that keeps `stars` stars in all cells; `None` if there are fewer, or if the limit is brighter than the magnitudes that are
    /// counted.
    ///
    /// Of the stars of the limiting magnitude the first ones are kept: first bright stars, then stars in leaves, each sorted by cell. A part keeps
    /// the number that remains after the preceding cells have kept theirs.
    fn limit(&self, stars: u64) -> Option<Limit> {
        let mut left = stars.checked_sub(self.brighter)?;
        for (v_mag, ties) in &self.counted {
            if ties.total >= left {
                return Some(Limit {
                    v_mag: magnitude(*v_mag),
                    bright_ties: left.saturating_sub(ties.before[0]),
                    leaf_ties: left.saturating_sub(ties.bright + ties.before[1]),
                });
            }
            left -= ties.total;
        }
        None
    }
}

/// Makes a deep store with exactly `parameters.stars` stars: the apparently brightest ones of the model, the same as those of
/// [`galaxy::generate`](super::super::galaxy::generate). The same parameters give the same bytes with any number of threads and any memory limit.
/// `options.job` is replaced.
///
/// # Errors
/// Parameters are out of range, or the store cannot be written.
pub fn synthesise(
    parameters: &GalaxyParameters,
    options: BuildOptions,
    on_step: &mut OnStep<'_>,
) -> Result<BuildReport, DeepError> {
    synthesise_with(|| GalaxyStream::new(parameters).map(Arc::new), parameters, options, on_step)
}

/// Stars in blocks, as [`GalaxyStream`] delivers them.
pub(super) trait Blocks: Sync {
    /// See [`GalaxyStream::blocks`].
    fn blocks(&self) -> usize;
    /// See [`GalaxyStream::counted_from`].
    fn counted_from(&self) -> f32;
    /// See [`GalaxyStream::draw`].
    fn draw(&self, block: usize, round: u32, sink: &mut dyn FnMut(StarRecord)) -> Result<(), GalaxyError>;
}

impl Blocks for GalaxyStream {
    fn blocks(&self) -> usize {
        Self::blocks(self)
    }

    fn counted_from(&self) -> f32 {
        Self::counted_from(self)
    }

    fn draw(&self, block: usize, round: u32, sink: &mut dyn FnMut(StarRecord)) -> Result<(), GalaxyError> {
        Self::draw(self, block, round, sink)
    }
}

/// As [`synthesise`], but `model` prepares the model, which takes seconds; it is called only if stars must be drawn.
pub(super) fn synthesise_with<B: Blocks>(
    model: impl FnOnce() -> Result<Arc<B>, GalaxyError>,
    parameters: &GalaxyParameters,
    options: BuildOptions,
    on_step: &mut OnStep<'_>,
) -> Result<BuildReport, DeepError> {
    let GalaxyParameters { stars, seed, fainter_than, .. } = *parameters;
    let fainter = fainter_than.map(|v| format!(", fainter than V = {v}")).unwrap_or_default();
    let description = format!("synthetic galaxy ({stars} stars, seed {seed}{fainter})");
    let job = options.job_of(&description);
    let first_cell = options.cells.map_or(0, CellRange::first);
    let mut build = Build::open(BuildOptions { job, ..options })?;
    let unusable = || {
        DeepError::damaged(std::path::Path::new(&description), "its state cannot be used; remove the unfinished store")
    };
    let mut magnitudes = match build.source() {
        "" => Magnitudes::default(),
        text => serde_json::from_str(text).map_err(|_| unusable())?,
    };
    if !build.is_read() {
        let stream = model()?;
        let mut next = build.steps_done();
        // More than one round is hardly ever needed.
        while next < stream.blocks() || magnitudes.total() < stars as u64 {
            let round = next / stream.blocks();
            let end = (round + 1) * stream.blocks();
            draw_round(&*stream, next..end, (&mut build, &mut magnitudes, first_cell), on_step)?;
            next = end;
        }
        let source = serde_json::to_string(&magnitudes).map_err(|_| unusable())?;
        build.checkpoint(next, source)?;
    }
    let limit = magnitudes.limit(stars as u64).ok_or_else(unusable)?;
    let input = Input { name: description.clone(), digest: description.clone() };
    build.finish(Some(limit), Sources { lines: Vec::new(), inputs: vec![input], description }, on_step)
}

/// Draws steps of one round, eight blocks at a time.
fn draw_round(
    stream: &impl Blocks,
    steps: std::ops::Range<usize>,
    (build, magnitudes, first_cell): (&mut Build, &mut Magnitudes, u64),
    on_step: &mut OnStep<'_>,
) -> Result<(), DeepError> {
    let blocks = stream.blocks();
    let counted_from = stream.counted_from();
    let round = (steps.start / blocks) as u32;
    let mut next = steps.start;
    on_step(BuildStep { work: "drawing stars", done: (next % blocks) as u64, total: blocks as u64 });
    while next < steps.end {
        let end = (next + BLOCKS_AT_ONCE).min(steps.end);
        let shared = Mutex::new((&mut *build, &mut *on_step, (next % blocks) as u64));
        let drawn: Vec<Magnitudes> = (next..end)
            .into_par_iter()
            .map(|step| {
                let counts = draw_block(stream, step % blocks, round, (counted_from, first_cell), |batch| {
                    let mut shared = shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    batch.drain(..).try_for_each(|star| shared.0.add(star, NewStar::default()))
                })?;
                let mut shared = shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                shared.2 += 1;
                let done = shared.2;
                shared.1(BuildStep { work: "drawing stars", done, total: blocks as u64 });
                Ok(counts)
            })
            .collect::<Result<_, DeepError>>()?;
        drawn.into_iter().for_each(|counts| magnitudes.merge(counts));
        next = end;
        if build.is_checkpoint_due() {
            let source = serde_json::to_string(magnitudes);
            let source = source.map_err(|error| DeepError::io(std::path::Path::new("the state"))(error.into()))?;
            build.checkpoint(next, source)?;
        }
    }
    Ok(())
}

/// Draws a block and passes its stars on in batches.
fn draw_block(
    stream: &impl Blocks,
    block: usize,
    round: u32,
    (counted_from, first_cell): (f32, u64),
    mut hand_over: impl FnMut(&mut Vec<StarRecord>) -> Result<(), DeepError>,
) -> Result<Magnitudes, DeepError> {
    let mut magnitudes = Magnitudes::default();
    let mut batch = Vec::with_capacity(BATCH);
    let mut result = Ok(());
    stream.draw(block, round, &mut |star| {
        magnitudes.add(&star, counted_from, first_cell);
        batch.push(star);
        if batch.len() == BATCH && result.is_ok() {
            result = hand_over(&mut batch);
        }
        // After an error the rest of the block is dropped.
        if result.is_err() {
            batch.clear();
        }
    })?;
    result?;
    hand_over(&mut batch)?;
    Ok(magnitudes)
}

#[cfg(test)]
mod tests {
    use super::super::super::galaxy::tests::with_light;
    use super::super::check;
    use super::super::{DeepStore, LAYERS};
    use super::*;

    fn options(folder: &std::path::Path, name: &str, memory_bytes: u64) -> BuildOptions {
        BuildOptions { out: folder.join(name), memory_bytes, job: String::new(), cells: None }
    }

    fn parameters(stars: usize) -> GalaxyParameters {
        GalaxyParameters { stars, seed: 3, fainter_than: Some(13.2), unresolved_light: false }
    }

    #[test]
    fn limits_keep_exactly_the_requested_number() {
        let star = |index: usize, v: f64| {
            // Distant stars are bright stars if V is below 13.
            let position = [glam::DVec3::X, -glam::DVec3::Y, glam::DVec3::Z][index % 3] * 1000.0;
            StarRecord { position, magnitude: (v - 10.0) as f32, temperature_k: 5e3, distance_known: true }
        };
        let limits = |stars: &[StarRecord], first_cell: u64, counts: &[u64]| -> Vec<_> {
            let mut magnitudes = Magnitudes::default();
            stars.iter().for_each(|star| magnitudes.add(star, -1.5, first_cell));
            let limit = |stars: &u64| magnitudes.limit(*stars);
            counts.iter().map(|stars| limit(stars).map(|l| (l.v_mag, l.bright_ties, l.leaf_ties))).collect()
        };
        let bright: Vec<_> =
            [-2.0, -1.0, 5.0, 5.0, 5.0, 6.0].into_iter().enumerate().map(|(i, v)| star(i, v)).collect();
        let expected = [Some((-1.0, 1, 0)), Some((5.0, 2, 0)), Some((6.0, 1, 0)), None];
        assert_eq!(limits(&bright, 0, &[2, 4, 6, 7]), expected);
        // Stars of V = 14 in the cells of +z, +x and -y; a part that begins with the cell of +x leaves out those before it.
        let leaves: Vec<_> = (0..6).map(|index| star(index, 14.0)).collect();
        let cell = |star: &StarRecord| SkyPlace::from_direction(star.position).cell(BUCKET_ORDER);
        assert!(cell(&leaves[2]) < cell(&leaves[0]) && cell(&leaves[0]) < cell(&leaves[1]));
        assert_eq!(limits(&leaves, 0, &[5]), [Some((14.0, 5, 5))]);
        assert_eq!(limits(&leaves, cell(&leaves[0]), &[5]), [Some((14.0, 5, 3))]);
        assert_eq!(limits(&leaves, cell(&leaves[1]), &[3]), [Some((14.0, 3, 0))]);
    }

    #[test]
    fn a_store_has_the_stars_of_the_galaxy_whatever_the_threads() {
        let folder = tempfile::tempdir().expect("a folder");
        let model = Arc::new(GalaxyStream::new(&parameters(150_000)).expect("enough stars"));
        let make = |threads: usize, memory: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let options = options(folder.path(), &format!("{threads}"), memory);
            let model = || Ok(Arc::clone(&model));
            pool.install(|| synthesise_with(model, &parameters(150_000), options, &mut |_| ())).expect("made")
        };
        let [one, three] = [make(1, 64 << 20), make(3, 1 << 30)];
        assert_eq!(one, three);
        assert_eq!(one.bright + one.layers.iter().sum::<u64>(), 150_000);
        for entry in std::fs::read_dir(folder.path().join("1")).expect("a folder") {
            let path = entry.expect("an entry").path();
            let other = folder.path().join("3").join(path.file_name().expect("a name"));
            assert!(std::fs::read(&path).expect("read") == std::fs::read(other).expect("read"), "{}", path.display());
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 2, "no work is left");
        let store = DeepStore::open(&folder.path().join("1")).expect("a store");
        check::check(&store, true, &mut |_| ()).expect("a valid store");

        // Every star of the generator that is not bright is in a leaf, within the errors of its word.
        let galaxy = with_light(&parameters(150_000)).expect("made");
        let light = |layer: usize, star: &StarRecord| star.apparent_magnitude() >= f64::from(LAYERS[layer].magnitude);
        let faint: Vec<&StarRecord> =
            galaxy.stars.iter().filter(|star| light(0, star) && star.position.length() >= 100.0).collect();
        assert!((faint.len() as u64).abs_diff(one.layers.iter().sum()) <= 2, "{} {one:?}", faint.len());
        for star in faint.iter().step_by(997) {
            let place = super::super::cells::SkyPlace::from_direction(star.position);
            let layer = usize::from(light(1, star));
            let leaf = store.leaf(layer, place.cell(LAYERS[layer].order)).expect("a leaf");
            let direction = star.position.normalize();
            let found = (0..leaf.words.len()).map(|index| leaf.star(index)).any(|found| {
                found.direction.angle_between(direction) < 1.5e-7
                    && (found.v_mag() - star.apparent_magnitude()).abs() < 0.006
                    && found.distance_pc.is_some_and(|d| (d / star.position.length() - 1.0).abs() < 0.004)
            });
            assert!(found, "{star:?}");
        }
    }
}

//! Stars in chunks, sorted by position in the sky and by distance: a chunk outside every view costs nothing.
//!
//! A chunk is a cell of the sky (HEALPix, seen from the Solar-System barycentre) within a shell of distance; the outer radius of each shell is four
//! times that of the previous one. Cells are divided until they hold few stars. The order of the stars in a set depends on the stars alone, not on
//! the order of the input. Positions are f32 offsets from an f64 origin: each frame computes origin minus camera in f64.

use std::sync::{Arc, OnceLock};

use cdshealpix::nested;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    StarRecord,
    bright::{named_bright_stars, variable_rows, variable_stars},
    deep::live::DeepSky,
    diffuse::DiffuseSky,
    epoch::Epoch,
    names::NamedStar,
    packed::PackedStar,
    spectra::{self, Spectrum},
};
use crate::{once, units::illuminance_lx_from_magnitude};

/// A chunk with more stars than this is divided, unless all its stars share one position.
pub const CHUNK_STARS: usize = 1024;
/// HEALPix depth of the cells by which stars are sorted: cells of 51 arcseconds.
const SORT_DEPTH: u8 = 12;
/// No chunk is wider than a cell of this depth (29 degrees), unless it holds few stars.
const WIDEST_DEPTH: u8 = 1;
/// A chunk of at most this many stars may have any width.
const FEW_STARS: usize = 256;
/// Base-2 logarithm of the ratio of the outer radii of successive shells.
const SHELL_LOG2: f64 = 2.0;
/// Shell index of stars at infinity.
const INFINITY_SHELL: u16 = u16::MAX;

/// A run of neighbouring stars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chunk {
    /// First star in [`StarSet::stars`].
    pub first: u32,
    /// Number of stars.
    pub count: u32,
    /// Whether the stars are at infinity: offsets are then unit vectors and the origin is 0.
    pub at_infinity: bool,
    /// Origin of the offsets, ICRS, pc.
    pub origin_pc: DVec3,
    /// Radius around the origin that holds every star, pc.
    pub radius_pc: f64,
    /// Axis of the cone that contains every star, seen from the barycentre.
    pub axis: DVec3,
    /// Half-angle of that cone, rad.
    pub half_angle_rad: f64,
    /// Smallest distance of a star from the barycentre, pc.
    pub nearest_pc: f64,
    /// Illuminance at 1 pc, lx: of the faintest star, of the brightest star, and of all stars together.
    pub faintest_lx: f64,
    /// See `faintest_lx`.
    pub brightest_lx: f64,
    /// See `faintest_lx`.
    pub total_lx: f64,
}

/// All stars of a scene, chunked.
#[derive(Clone, Debug, Default)]
pub struct StarSet {
    /// Chunks, in the order of their stars.
    pub chunks: Vec<Chunk>,
    /// Stars; within a chunk the brightest come first.
    pub stars: Vec<PackedStar>,
    /// Time at which the stars are placed, and the vantage from which they are seen.
    pub epoch: Epoch,
    /// Light of the stars that are too faint to be in the set.
    pub unresolved: Option<Arc<DiffuseSky>>,
    /// Stars that are read from a deep store when views need them.
    pub deep: Option<Arc<DeepSky>>,
    /// Spectra of the chunks, computed on first use; chunks and stars must not change afterwards.
    spectra: OnceLock<Vec<Spectrum>>,
    /// Illuminance at the barycentre of the faintest star of each chunk, computed on first use.
    faintest_seen_lx: OnceLock<Vec<f32>>,
    /// Variable stars by their ephemeris, if the set has them.
    variable: Option<VariableStars>,
    /// Named stars of files, as seen at the epoch.
    named_in_files: Arc<Vec<NamedStar>>,
    /// All named stars, computed on first use.
    named: OnceLock<Vec<NamedStar>>,
}

/// The variable stars of a set.
#[derive(Clone, Copy, Debug)]
struct VariableStars {
    /// Time for which their brightness was computed, Julian years after J2000.0.
    years: f64,
    /// Numbers of chunks and of stars that precede them; `None` if they are mixed with the other stars.
    after: Option<[usize; 2]>,
}

/// Sort key: shell of distance, then cell of the sky, then the star's own values, so that the order does not depend
/// on the input.
#[derive(Clone, Copy)]
struct Key {
    shell: u16,
    cell: u32,
    index: u32,
}

fn shell_of(star: &StarRecord) -> u16 {
    if !star.distance_known {
        return INFINITY_SHELL;
    }
    // The clamp keeps absurd positions sortable: any distance below 4^-64 pc is practically 0.
    ((star.position.length().log2() / SHELL_LOG2).floor().clamp(-64.0, 64.0) + 64.0) as u16
}

fn cell_of(position: DVec3) -> u32 {
    let longitude = position.y.atan2(position.x);
    let latitude = position.z.atan2(position.x.hypot(position.y));
    // Depth 12 has 12 * 4^12 = 2.0e8 cells, which fit in 32 bits.
    nested::hash(SORT_DEPTH, longitude, latitude) as u32
}

impl StarSet {
    /// Creates a set from chunks and their stars, in the same order.
    pub fn new(chunks: Vec<Chunk>, stars: Vec<PackedStar>) -> Self {
        Self { chunks, stars, ..Self::default() }
    }

    /// Returns the set with the epoch at which its stars are seen.
    #[must_use]
    pub fn of_epoch(self, epoch: Epoch) -> Self {
        Self { epoch, ..self }
    }

    /// Returns the set with the light of the stars that are too faint to be in it.
    #[must_use]
    pub fn with_unresolved(self, unresolved: Option<Arc<DiffuseSky>>) -> Self {
        Self { unresolved, ..self }
    }

    /// Attaches a deep store, whose stars are drawn in addition to those of the set.
    #[must_use]
    pub fn with_deep(self, deep: Option<Arc<DeepSky>>) -> Self {
        Self { deep, ..self }
    }

    /// Returns the set with the variable stars of the built-in table added in chunks at its end. Their brightness is that of `years` Julian years
    /// after J2000.0. Variable stars that an earlier call added are replaced; otherwise the set must not contain any.
    #[must_use]
    pub fn with_variable_stars(&self, years: f64) -> Self {
        let [chunks, stars] =
            self.variable.and_then(|variable| variable.after).unwrap_or([self.chunks.len(), self.stars.len()]);
        let records = variable_stars(self.epoch.years, years).into_iter().map(|star| self.epoch.seen(star)).collect();
        let variable = Self::from_records(records);
        let added = variable.chunks.into_iter().map(|chunk| Chunk { first: chunk.first + stars as u32, ..chunk });
        Self {
            chunks: self.chunks[..chunks].iter().copied().chain(added).collect(),
            stars: [&self.stars[..stars], &variable.stars].concat(),
            epoch: self.epoch,
            unresolved: self.unresolved.clone(),
            deep: self.deep.clone(),
            variable: Some(VariableStars { years, after: Some([chunks, stars]) }),
            named_in_files: Arc::clone(&self.named_in_files),
            ..Self::default()
        }
    }

    /// Records that variable stars are among the stars of this set, which consists of all stars of `other` in another order.
    #[must_use]
    pub(super) fn with_variability_of(self, other: &Self) -> Self {
        Self { variable: other.variable.map(|variable| VariableStars { after: None, ..variable }), ..self }
    }

    /// Distribution of each chunk's light over temperature, computed from all stars at the first call.
    pub fn spectra(&self) -> &[Spectrum] {
        once::get_or_make::<Vec<_>>(&self.spectra, || spectra::of_chunks(self))
    }

    /// Returns the set with the named stars of its files, as seen at the set's epoch.
    #[must_use]
    pub fn with_names(self, named_in_files: Vec<NamedStar>) -> Self {
        Self { named_in_files: Arc::new(named_in_files), ..self }
    }

    /// The named stars of the set's files, as seen at its epoch.
    pub fn named_in_files(&self) -> &[NamedStar] {
        &self.named_in_files
    }

    /// Returns all named stars as seen at the set's epoch: first those of files, which are drawn, then those of the built-in table, whether or not
    /// they are in the set. Computed at the first call.
    pub fn named(&self) -> &[NamedStar] {
        self.named.get_or_init(|| {
            let mut built_in = named_bright_stars(self.epoch.years);
            if let Some(variable) = self.variable {
                let varied = variable_rows().into_iter().zip(variable_stars(self.epoch.years, variable.years));
                varied.for_each(|(row, star)| built_in[row].star = star);
            }
            let built_in = built_in.into_iter().map(|named| NamedStar { star: self.epoch.seen(named.star), ..named });
            self.named_in_files.iter().cloned().chain(built_in).collect()
        })
    }

    /// Illuminance of each chunk's faintest star, as seen from the barycentre, lx. Computed from all stars at the
    /// first call.
    pub fn faintest_seen_lx(&self) -> &[f32] {
        once::get_or_make::<Vec<_>>(&self.faintest_seen_lx, || {
            let seen = |chunk: &Chunk| {
                let stars = self.stars_of(chunk).iter();
                let light = stars.map(|star| {
                    let place = chunk.origin_pc + Vec3::from_array(star.offset_pc).as_dvec3();
                    let distance_squared = if chunk.at_infinity { 1.0 } else { place.length_squared() };
                    star.illuminance_at_1_pc_lx() / distance_squared
                });
                light.fold(f64::INFINITY, f64::min) as f32
            };
            self.chunks.par_iter().map(seen).collect()
        })
    }

    /// Sorts and chunks stars. Consumes the records and frees them as soon as they are read.
    pub fn from_records(records: Vec<StarRecord>) -> Self {
        Self::from_records_with_order(records).0
    }

    /// As [`Self::from_records`]; also returns the index in `records` of each star of the set.
    pub fn from_records_with_order(records: Vec<StarRecord>) -> (Self, Vec<u32>) {
        let mut keys: Vec<Key> = records
            .par_iter()
            .enumerate()
            .map(|(index, star)| Key { shell: shell_of(star), cell: cell_of(star.position), index: index as u32 })
            .collect();
        // Stars of one cell are sorted by their own values, so that shuffled input gives the same set.
        let content = |key: &Key| {
            let star = &records[key.index as usize];
            let p = star.position;
            (star.magnitude.to_bits(), star.temperature_k.to_bits(), p.x.to_bits(), p.y.to_bits(), p.z.to_bits())
        };
        keys.par_sort_unstable_by(|a, b| {
            (a.shell, a.cell).cmp(&(b.shell, b.cell)).then_with(|| content(a).cmp(&content(b)))
        });

        let runs = chunk_runs(&keys);
        let chunked: Vec<(Chunk, Vec<(PackedStar, u32)>)> =
            runs.par_iter().map(|&(start, end)| build_chunk(&records, &keys[start..end])).collect();
        drop(keys);
        drop(records);
        let mut set = StarSet::new(Vec::with_capacity(chunked.len()), Vec::new());
        let count = chunked.iter().map(|(_, stars)| stars.len()).sum();
        set.stars.reserve_exact(count);
        let mut order = Vec::with_capacity(count);
        for (mut chunk, stars) in chunked {
            chunk.first = set.stars.len() as u32;
            set.stars.extend(stars.iter().map(|(star, _)| *star));
            order.extend(stars.into_iter().map(|(_, index)| index));
            set.chunks.push(chunk);
        }
        (set, order)
    }

    /// The stars of a chunk.
    pub fn stars_of(&self, chunk: &Chunk) -> &[PackedStar] {
        &self.stars[chunk.first as usize..(chunk.first + chunk.count) as usize]
    }

    /// Iterates over the stars: ICRS position in pc (or unit vector at infinity), whether the star is at infinity,
    /// and its packed form.
    pub fn iter(&self) -> impl Iterator<Item = (DVec3, bool, &PackedStar)> {
        self.chunks.iter().flat_map(|chunk| {
            self.stars_of(chunk)
                .iter()
                .map(|star| (chunk.origin_pc + Vec3::from_array(star.offset_pc).as_dvec3(), chunk.at_infinity, star))
        })
    }
}

/// Cuts the sorted keys into chunks: in each shell, cells of the sky are divided until they hold few stars.
fn chunk_runs(keys: &[Key]) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut start = 0;
    for shell in keys.chunk_by(|a, b| a.shell == b.shell) {
        for base in shell.chunk_by(|a, b| a.cell >> (2 * SORT_DEPTH) == b.cell >> (2 * SORT_DEPTH)) {
            divide(base, 0, start, &mut runs);
            start += base.len();
        }
    }
    runs
}

fn divide(keys: &[Key], depth: u8, start: usize, runs: &mut Vec<(usize, usize)>) {
    let narrow_enough = depth >= WIDEST_DEPTH || keys.len() <= FEW_STARS;
    if narrow_enough && keys.len() <= CHUNK_STARS {
        runs.push((start, start + keys.len()));
        return;
    }
    if depth == SORT_DEPTH {
        // All stars are in one cell of 51 arcseconds: divide them by number.
        let mut first = start;
        for part in keys.chunks(CHUNK_STARS) {
            runs.push((first, first + part.len()));
            first += part.len();
        }
        return;
    }
    let shift = 2 * (SORT_DEPTH - depth - 1);
    let mut first = start;
    for child in keys.chunk_by(|a, b| a.cell >> shift == b.cell >> shift) {
        divide(child, depth + 1, first, runs);
        first += child.len();
    }
}

/// Creates a chunk; returns it with its stars and their indices in `records`.
fn build_chunk(records: &[StarRecord], keys: &[Key]) -> (Chunk, Vec<(PackedStar, u32)>) {
    let at_infinity = keys.first().is_some_and(|key| key.shell == INFINITY_SHELL);
    let mut lowest = DVec3::INFINITY;
    let mut highest = DVec3::NEG_INFINITY;
    let mut direction_sum = DVec3::ZERO;
    for key in keys {
        let position = records[key.index as usize].position;
        lowest = lowest.min(position);
        highest = highest.max(position);
        direction_sum += position.normalize_or_zero();
    }
    let origin_pc = if at_infinity { DVec3::ZERO } else { (lowest + highest) / 2.0 };
    let axis = direction_sum.normalize_or(DVec3::X);
    let mut chunk = Chunk {
        first: 0,
        count: keys.len() as u32,
        at_infinity,
        origin_pc,
        radius_pc: 0.0,
        axis,
        half_angle_rad: 0.0,
        nearest_pc: f64::INFINITY,
        faintest_lx: f64::INFINITY,
        brightest_lx: 0.0,
        total_lx: 0.0,
    };
    let mut stars: Vec<(PackedStar, u32)> = Vec::with_capacity(keys.len());
    for key in keys {
        let record = &records[key.index as usize];
        // A star at infinity has its apparent magnitude. A star with a position has its absolute magnitude, which is the magnitude at 10 pc.
        let magnitude_at_1_pc = f64::from(record.magnitude) - if record.distance_known { 5.0 } else { 0.0 };
        let illuminance_lx = illuminance_lx_from_magnitude(magnitude_at_1_pc);
        let star =
            PackedStar::new((record.position - origin_pc).as_vec3(), illuminance_lx, f64::from(record.temperature_k));
        chunk.radius_pc = chunk.radius_pc.max(Vec3::from_array(star.offset_pc).as_dvec3().length());
        if let Some(direction) = record.position.try_normalize() {
            chunk.half_angle_rad = chunk.half_angle_rad.max(axis.angle_between(direction));
        } else {
            chunk.half_angle_rad = std::f64::consts::PI;
        }
        chunk.nearest_pc = chunk.nearest_pc.min(record.position.length());
        chunk.faintest_lx = chunk.faintest_lx.min(star.illuminance_at_1_pc_lx());
        chunk.brightest_lx = chunk.brightest_lx.max(star.illuminance_at_1_pc_lx());
        chunk.total_lx += star.illuminance_at_1_pc_lx();
        stars.push((star, key.index));
    }
    // `angle_between` loses half of its digits near 0, and rounding offsets to f32 changes a direction by up to 1e-7.
    chunk.half_angle_rad = (chunk.half_angle_rad + 1e-6).min(std::f64::consts::PI);
    chunk.radius_pc *= 1.0 + 1e-6;
    stars.sort_by_key(|(star, _)| std::cmp::Reverse(star.light >> 11));
    (chunk, stars)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(x: f64, y: f64, z: f64, distance_known: bool) -> StarRecord {
        StarRecord { position: DVec3::new(x, y, z), magnitude: 5.0, temperature_k: 5772.0, distance_known }
    }

    /// Stars along a spiral over the whole sky; every third star is at infinity.
    fn spiral(n: usize) -> Vec<StarRecord> {
        (0..n)
            .map(|i| {
                let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
                let (sin, cos) = (i as f64 * 2.399_963).sin_cos();
                let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
                let far = if i % 3 == 0 { 1.0 } else { 10.0 + i as f64 * 0.05 };
                star(direction.x * far, direction.y * far, direction.z * far, i % 3 != 0)
            })
            .collect()
    }

    #[test]
    fn every_star_lies_within_the_bounds_of_its_chunk() {
        let set = StarSet::from_records(spiral(20_000));
        assert_eq!(set.stars.len(), 20_000);
        assert_eq!(set.chunks.iter().map(|c| c.count).sum::<u32>(), 20_000);
        for chunk in &set.chunks {
            assert!(chunk.count as usize <= CHUNK_STARS);
            for star in set.stars_of(chunk) {
                let offset = Vec3::from_array(star.offset_pc).as_dvec3();
                let position = chunk.origin_pc + offset;
                assert!(offset.length() <= chunk.radius_pc);
                assert!(chunk.axis.angle_between(position) <= chunk.half_angle_rad);
                assert!(position.length() >= chunk.nearest_pc * (1.0 - 1e-6));
                assert!(star.illuminance_at_1_pc_lx() <= chunk.brightest_lx);
            }
        }
    }

    #[test]
    fn the_order_of_the_input_does_not_matter() {
        let records = spiral(5000);
        let mut shuffled = records.clone();
        for i in 0..shuffled.len() {
            shuffled.swap(i, (i * 7919 + 13) % records.len());
        }
        assert_ne!(records, shuffled);
        let (a, b) = (StarSet::from_records(records), StarSet::from_records(shuffled));
        assert_eq!(a.chunks, b.chunks);
        assert_eq!(a.stars, b.stars);
    }

    #[test]
    fn a_million_stars_in_one_spot_and_a_star_at_the_origin_are_chunked() {
        let mut records = vec![star(3.0, 4.0, 5.0, true); 10_000];
        records.push(star(0.0, 0.0, 0.0, true));
        let set = StarSet::from_records(records);
        assert_eq!(set.stars.len(), 10_001);
        assert!(set.chunks.iter().all(|chunk| chunk.count as usize <= CHUNK_STARS));
    }
}

//! State of an unfinished store, and its bright stars on disk. With both, a later run continues the work after the program was killed.

use std::fs::{self, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::super::StarRecord;
use super::super::motion::{StarVelocity, velocity_by_star};
use super::super::names::{NamesOfStar, StarNames};
use super::super::store::kept;
use super::error::DeepError;
use super::spill::{self, SpillState};
use crate::files;

/// Name of the file with the state.
pub const STATE: &str = "state.json";
/// Names of the files of the bright stars and of their names.
pub const STARS: &str = "bright-stars";
/// See [`STARS`].
pub const NAMES: &str = "bright-names";
/// Version of the state.
const VERSION: u32 = 3;

/// Numbers of stars of an import that needed a rule, and of those that were left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Number of delivered stars.
    pub delivered: u64,
    /// Stars whose distance was computed from the prior, because their parallax is less than five times its error, or is missing in a catalogue with
    /// errors.
    pub prior_distance: u64,
    /// Stars at infinity.
    pub at_infinity: u64,
    /// Bright stars without colour, which get the Sun's temperature.
    pub bright_without_colour: u64,
    /// Stars that were left out because they are fainter than leaves can hold.
    pub too_faint: u64,
    /// Stars in leaves whose motion is not stored; their positions are at the store's epoch.
    pub motions_left_out: u64,
    /// Stars whose names are not stored: those in leaves, and those of bright stars that the rule in `resident` excludes.
    pub names_left_out: u64,
}

impl Counts {
    /// Counts a delivered star.
    pub(super) fn delivered(&mut self, star: &StarRecord, prior_distance: bool) {
        self.delivered += 1;
        self.prior_distance += u64::from(prior_distance);
        self.at_infinity += u64::from(!star.distance_known);
    }

    /// Adds the counts of other stars.
    pub(super) fn add(&mut self, other: Self) {
        let Self {
            delivered,
            prior_distance,
            at_infinity,
            bright_without_colour,
            too_faint,
            motions_left_out,
            names_left_out,
        } = other;
        self.delivered += delivered;
        self.prior_distance += prior_distance;
        self.at_infinity += at_infinity;
        self.bright_without_colour += bright_without_colour;
        self.too_faint += too_faint;
        self.motions_left_out += motions_left_out;
        self.names_left_out += names_left_out;
    }
}

/// State of the first pass.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    version: u32,
    /// Inputs of the store: work on it continues only with the same inputs.
    pub job: String,
    /// Number of finished inputs: files, or blocks of a synthetic galaxy.
    pub steps: usize,
    /// Whether all inputs are read.
    pub is_read: bool,
    /// Files of the buckets.
    pub spill: SpillState,
    /// Number of bright stars, and length of the file of their names.
    pub bright: [u64; 2],
    /// Numbers of stars that needed a rule.
    pub counts: Counts,
    /// Additional data with which the source of the stars can continue.
    pub source: String,
}

impl State {
    /// Creates the state before the first input.
    pub fn new(job: &str) -> Self {
        Self {
            version: VERSION,
            job: job.to_owned(),
            steps: 0,
            is_read: false,
            spill: spill::empty(),
            bright: [0; 2],
            counts: Counts::default(),
            source: String::new(),
        }
    }

    /// Reads the state in a folder; `None` if there is none.
    pub fn read(folder: &Path) -> Result<Option<Self>, DeepError> {
        let path = folder.join(STATE);
        if !path.exists() {
            return Ok(None);
        }
        let text = files::read_text_bounded(&path, 1 << 30).map_err(DeepError::io(&path))?;
        let unusable = || DeepError::damaged(&path, "it is not the state of an unfinished store; remove the folder");
        let state: Self = serde_json::from_str(&text).map_err(|_| unusable())?;
        if state.version != VERSION || state.spill.len() as u64 != super::BUCKETS {
            return Err(unusable());
        }
        Ok(Some(state))
    }

    /// Replaces the state in a folder.
    pub fn write(&self, folder: &Path) -> Result<(), DeepError> {
        let path = folder.join(STATE);
        let text = serde_json::to_vec(self).map_err(|error| DeepError::io(&path)(error.into()))?;
        files::write_whole(&path, &text).map_err(DeepError::io(&path))
    }
}

/// A bright star on disk.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct KeptStar {
    position: [f64; 3],
    velocity: [f32; 3],
    magnitude: f32,
    temperature_k: f32,
    /// Bits: bit 0, the distance is known; bit 1, the star moves; bit 2, it is a star of the built-in table.
    flags: u32,
}

/// The bright stars.
#[derive(Clone, Debug, Default)]
pub struct BrightStars {
    /// At J2000.0.
    pub records: Vec<StarRecord>,
    /// Velocities of the stars that move.
    pub velocities: Vec<StarVelocity>,
    /// Names of the stars that have any.
    pub names: Vec<NamesOfStar>,
    /// Whether each star is one of the built-in table.
    pub is_built_in: Vec<bool>,
    /// Numbers of records, velocities and names that have been written to disk, and the length of the file of names.
    saved: ([usize; 3], u64),
}

impl BrightStars {
    /// Adds a star.
    pub fn push(
        &mut self,
        record: StarRecord,
        velocity: Option<[f32; 3]>,
        names: Option<StarNames>,
        is_built_in: bool,
    ) {
        let star = self.records.len() as u32;
        self.velocities.extend(velocity.map(|velocity| StarVelocity { star, velocity }));
        self.names.extend(names.map(|names| NamesOfStar { star, names }));
        self.records.push(record);
        self.is_built_in.push(is_built_in);
    }

    /// Appends the new stars to the files in a folder; returns [`State::bright`].
    pub fn save(&mut self, folder: &Path) -> Result<[u64; 2], DeepError> {
        let ([records, velocities, names], names_bytes) = self.saved;
        let mut velocity_of = velocity_by_star(&self.velocities[velocities..]);
        let mut bytes = Vec::new();
        for index in records..self.records.len() {
            let StarRecord { position, magnitude, temperature_k, distance_known } = self.records[index];
            let velocity = velocity_of(index);
            let flags = u32::from(distance_known)
                | u32::from(velocity.is_some()) << 1
                | u32::from(self.is_built_in[index]) << 2;
            let kept = KeptStar {
                position: position.to_array(),
                velocity: velocity.unwrap_or_default(),
                magnitude,
                temperature_k,
                flags,
            };
            bytes.extend_from_slice(bytemuck::bytes_of(&kept));
        }
        append(&folder.join(STARS), (records * size_of::<KeptStar>()) as u64, &bytes)?;
        let mut lines = Vec::new();
        for NamesOfStar { star, names: StarNames { name, designations } } in &self.names[names..] {
            let path = folder.join(NAMES);
            serde_json::to_writer(&mut lines, &(star, name, designations))
                .map_err(|error| DeepError::io(&path)(error.into()))?;
            lines.push(b'\n');
        }
        append(&folder.join(NAMES), names_bytes, &lines)?;
        let names_bytes = names_bytes + lines.len() as u64;
        self.saved = ([self.records.len(), self.velocities.len(), self.names.len()], names_bytes);
        Ok([self.records.len() as u64, names_bytes])
    }

    /// Replaces the files in a folder by those of all stars; returns [`State::bright`].
    pub fn save_all(&mut self, folder: &Path) -> Result<[u64; 2], DeepError> {
        self.saved = ([0; 3], 0);
        self.save(folder)
    }

    /// Adds other stars after these.
    pub fn append(&mut self, other: Self) {
        let first = self.records.len() as u32;
        let Self { records, velocities, names, is_built_in, .. } = other;
        self.records.extend(records);
        self.is_built_in.extend(is_built_in);
        self.velocities.extend(velocities.into_iter().map(|of| StarVelocity { star: first + of.star, ..of }));
        self.names.extend(names.into_iter().map(|of| NamesOfStar { star: first + of.star, ..of }));
    }

    /// Reads the stars of a state.
    pub fn read(folder: &Path, [stars, names_bytes]: [u64; 2]) -> Result<Self, DeepError> {
        let mut bright = Self::default();
        let (path, names_path) = (folder.join(STARS), folder.join(NAMES));
        if stars > 0 {
            let file = files::open_regular(&path).map_err(DeepError::io(&path))?;
            let mut source = BufReader::with_capacity(1 << 20, file);
            let mut bytes = [0; size_of::<KeptStar>()];
            for _ in 0..stars {
                source.read_exact(&mut bytes).map_err(DeepError::io(&path))?;
                let KeptStar { position, velocity, magnitude, temperature_k, flags } =
                    bytemuck::pod_read_unaligned(&bytes);
                let record = StarRecord {
                    position: DVec3::from_array(position),
                    magnitude,
                    temperature_k,
                    distance_known: flags & 1 != 0,
                };
                bright.push(record, (flags & 2 != 0).then_some(velocity), None, flags & 4 != 0);
            }
        }
        if names_bytes > 0 {
            let file = files::open_regular(&names_path).map_err(DeepError::io(&names_path))?;
            for line in BufReader::new(file.take(names_bytes)).lines() {
                let line = line.map_err(DeepError::io(&names_path))?;
                let (star, name, designations): (u32, String, Vec<String>) =
                    serde_json::from_str(&line).map_err(|_| {
                        DeepError::damaged(&names_path, "a line is not a name; remove the unfinished store")
                    })?;
                bright.names.push(NamesOfStar { star, names: StarNames { name, designations } });
            }
        }
        bright.saved = ([bright.records.len(), bright.velocities.len(), bright.names.len()], names_bytes);
        Ok(bright)
    }

    /// Keeps only the stars for which `keep` is true.
    pub fn retain(&mut self, keep: &[bool]) {
        (self.velocities, self.names) = kept(keep, &self.velocities, std::mem::take(&mut self.names));
        let mut keeps = keep.iter();
        self.records.retain(|_| *keeps.next().unwrap_or(&false));
        let mut keeps = keep.iter();
        self.is_built_in.retain(|_| *keeps.next().unwrap_or(&false));
    }
}

/// Truncates a file to a length, and appends bytes.
fn append(path: &Path, length: u64, bytes: &[u8]) -> Result<(), DeepError> {
    let file = OpenOptions::new().append(true).create(true).open(path);
    let write = |mut file: fs::File| {
        file.set_len(length)?;
        file.write_all(bytes)
    };
    file.and_then(write).map_err(DeepError::io(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_are_saved_in_parts_and_read_up_to_a_state() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut bright = BrightStars::default();
        let record =
            |x: f64| StarRecord { position: DVec3::X * x, magnitude: 3.0, temperature_k: 4e3, distance_known: x < 5.0 };
        let names = StarNames { name: "Näme\t\"x\"".to_owned(), designations: vec!["HIP 1".to_owned()] };
        bright.push(record(1.0), Some([1e-6, 0.0, 2e-6]), Some(names.clone()), false);
        bright.push(record(2.0), None, None, true);
        let state = bright.save(folder.path()).expect("saved");
        bright.push(record(7.0), Some([3e-6, 0.0, 0.0]), Some(names.clone()), false);
        let later = bright.save(folder.path()).expect("saved");
        let found = BrightStars::read(folder.path(), later).expect("read");
        assert_eq!(
            (&found.records, &found.velocities, &found.names),
            (&bright.records, &bright.velocities, &bright.names)
        );
        // Simulate a program that was killed in between: it continues with the earlier state.
        let mut found = BrightStars::read(folder.path(), state).expect("read");
        assert_eq!((found.records.len(), found.velocities.len(), found.names.len()), (2, 1, 1));
        found.push(record(9.0), None, None, false);
        let state = found.save(folder.path()).expect("saved");
        let mut again = BrightStars::read(folder.path(), state).expect("read");
        assert_eq!(again.records, found.records);
        again.retain(&[false, true, true]);
        assert_eq!(
            (again.records.len(), again.velocities.len(), again.is_built_in.as_slice()),
            (2, 0, &[true, false][..])
        );
    }
}

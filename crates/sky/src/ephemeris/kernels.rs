//! SPK kernels of the SPICE toolkit, read with `anise`: positions of bodies and spacecraft by NAIF number.
//!
//! A segment of a kernel gives the position of a body relative to its centre; the position relative to the barycentre
//! of the Solar System is the sum along the chain of centres. The chain ends at that barycentre, at the Earth, or at a
//! body of the Solar System that no kernel contains. From the Earth, it continues with the position on which observers
//! are placed, so that satellites have the distance from the Earth that their kernel gives. A body that no kernel
//! contains has its position from VSOP87 or ELP.
//!
//! The barycentre of DE440 differs from that of VSOP87 by 1,000 to 1,400 km. So a chain that ends at the barycentre
//! is shifted by the difference between kernels and VSOP87 in the position of the Earth, or of the Sun if no kernel
//! has the Earth.

use std::{
    collections::{BTreeMap, HashSet},
    fmt::Display,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::SystemTime,
};

use anise::{
    naif::{SPK, daf::NAIFSummaryRecord},
    prelude::{Almanac, Epoch, Frame},
};
use glam::DVec3;
use thiserror::Error;
use tracing::warn;

use super::Ephemeris;
use crate::solar_system::SolarBody;

/// NAIF numbers of the barycentre, the Earth and the Sun.
const BARYCENTRE: i32 = 0;
/// See [`BARYCENTRE`].
const EARTH: i32 = 399;
/// See [`BARYCENTRE`].
const SUN: i32 = 10;
/// NAIF number of the ICRS axes, on which segments must be given.
const ICRS_AXES: i32 = 1;
/// Size of a number in a kernel, bytes.
const WORD_BYTES: usize = 8;
/// Largest number of centres between a spacecraft and the barycentre: far more than any kernel has.
const MOST_CENTRES: usize = 16;

/// An unusable kernel.
#[derive(Debug, Error)]
#[error("{}: {problem}", file.display())]
pub struct KernelError {
    /// The file.
    pub file: PathBuf,
    /// Description of the problem and of valid kernels.
    pub problem: String,
}

/// The kernels of a scene; later ones take precedence.
pub struct Kernels {
    almanac: Almanac,
    files: Vec<PathBuf>,
    /// First and last TDB, s since J2000.0, for each number.
    covered_s: BTreeMap<i32, [f64; 2]>,
    /// Numbers for which an uncovered time has been logged.
    reported: Mutex<HashSet<i32>>,
}

impl std::fmt::Debug for Kernels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kernels").field("files", &self.files).field("covered_s", &self.covered_s).finish()
    }
}

impl PartialEq for Kernels {
    fn eq(&self, other: &Self) -> bool {
        (&self.files, &self.covered_s) == (&other.files, &other.covered_s)
    }
}

/// Paths, times and sizes of the files that were read last, and their kernels.
type Held = Option<(Vec<(PathBuf, Option<SystemTime>, u64)>, Arc<Kernels>)>;

/// The kernels that were read last: a scene is rebuilt for every change of a configuration, and kernels are up to a
/// gigabyte in size.
static HELD: Mutex<Held> = Mutex::new(None);

fn read(file: &Path) -> Result<SPK, KernelError> {
    let fault = |problem: String| KernelError { file: file.to_owned(), problem };
    let bytes = std::fs::read(file).map_err(|error| fault(error.to_string()))?;
    if !bytes.starts_with(b"DAF/SPK") {
        return Err(fault("not an SPK kernel, which begins with `DAF/SPK`".to_owned()));
    }
    if bytes.get(88..96) == Some(&b"BIG-IEEE"[..]) {
        let problem = "its numbers are big-endian (BIG-IEEE); convert it to LTL-IEEE with `bingo` of the SPICE toolkit";
        return Err(fault(problem.to_owned()));
    }
    SPK::parse(bytes.as_slice()).map_err(|error| fault(damaged(&error)))
}

/// Message about an incomplete file.
fn damaged(problem: &dyn Display) -> String {
    format!("the kernel is damaged or incomplete, copy it again: {problem}")
}

/// Checks that a file of a given length, bytes, contains the data of a segment.
fn check_data(segment: &impl NAIFSummaryRecord, bytes: usize) -> Result<(), String> {
    let (first, last) = (segment.start_index(), segment.end_index());
    if first > 0 && first <= last && last <= bytes / WORD_BYTES {
        return Ok(());
    }
    let words = bytes / WORD_BYTES;
    let id = segment.id();
    Err(damaged(&format!("the data of {id} are at 8-byte numbers {first} to {last}, but the file has only {words}")))
}

impl Kernels {
    /// Reads kernels; reuses the ones that were read last while their files are unchanged. These are errors: a file
    /// that cannot be read, is not an SPK kernel or is incomplete, and a segment on axes other than those of ICRS
    /// (J2000).
    pub fn load(files: &[PathBuf]) -> Result<Arc<Self>, KernelError> {
        let mut stamps = Vec::new();
        for file in files {
            let stamp = std::fs::metadata(file)
                .map_err(|error| KernelError { file: file.clone(), problem: error.to_string() })?;
            stamps.push((file.clone(), stamp.modified().ok(), stamp.len()));
        }
        let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((loaded, kernels)) = held.as_ref()
            && *loaded == stamps
        {
            return Ok(Arc::clone(kernels));
        }
        let kernels = Arc::new(Self::read(files)?);
        *held = Some((stamps, Arc::clone(&kernels)));
        Ok(kernels)
    }

    fn read(files: &[PathBuf]) -> Result<Self, KernelError> {
        let mut almanac = Almanac::default();
        let mut covered_s = BTreeMap::<i32, [f64; 2]>::new();
        let mut centres = BTreeMap::<i32, HashSet<i32>>::new();
        for (index, file) in files.iter().enumerate() {
            let fault = |problem: String| KernelError { file: file.clone(), problem };
            let kernel = read(file)?;
            for block in kernel.iter_summary_blocks() {
                for segment in
                    block.map_err(|error| fault(damaged(&error)))?.iter().filter(|summary| !summary.is_empty())
                {
                    check_data(segment, kernel.bytes.len()).map_err(fault)?;
                    if segment.frame_id != ICRS_AXES {
                        let problem = format!(
                            "the segment of {} is on axes {}; they must be those of ICRS, {ICRS_AXES} (J2000)",
                            segment.target_id, segment.frame_id
                        );
                        return Err(fault(problem));
                    }
                    let [start_s, end_s] = [segment.start_epoch_et_s, segment.end_epoch_et_s];
                    let covered = covered_s.entry(segment.target_id).or_insert([start_s, end_s]);
                    *covered = [covered[0].min(start_s), covered[1].max(end_s)];
                    centres.entry(segment.target_id).or_default().insert(segment.center_id);
                }
            }
            almanac = almanac.with_spk_as(kernel, Some(format!("{index}: {}", file.display())));
        }
        // A position is known only at times at which the positions of all centres of its chain are known.
        for _ in 0..MOST_CENTRES {
            for (body, centres_of_body) in &centres {
                for centre in centres_of_body.iter().filter(|centre| **centre != EARTH) {
                    if let (Some(within), Some(covered)) = (covered_s.get(centre).copied(), covered_s.get_mut(body)) {
                        *covered = [covered[0].max(within[0]), covered[1].min(within[1])];
                    }
                }
            }
        }
        Ok(Self { almanac, files: files.to_owned(), covered_s, reported: Mutex::default() })
    }

    /// The numbers in the kernels.
    pub fn numbers(&self) -> impl Iterator<Item = i32> {
        self.covered_s.keys().copied()
    }

    /// First and last TDB, s since J2000.0, at which the position of a number is known; `None` if no kernel has it.
    pub fn covered_s(&self, number: i32) -> Option<[f64; 2]> {
        self.covered_s.get(&number).copied()
    }

    /// Position of a number relative to the barycentre, ICRS axes, m, at a TDB, s since J2000.0. Before and after the
    /// time that the kernels cover, it is the position at the limit; this is logged once. The error says why the
    /// position is unknown.
    pub fn barycentric_m(&self, number: i32, tdb_s: f64) -> Result<DVec3, String> {
        let [first, last] = self.covered_s(number).ok_or_else(|| self.unknown(number))?;
        if first > last {
            return Err(format!("spk:{number}: its kernel and those of its centres cover no common time"));
        }
        let at_s = tdb_s.clamp(first, last);
        if at_s != tdb_s && self.reported.lock().unwrap_or_else(PoisonError::into_inner).insert(number) {
            warn!(
                number,
                tdb_s,
                first,
                last,
                "the scene's time is outside an SPK kernel: the body stays at its first or last position"
            );
        }
        match self.summed_m(number, at_s)? {
            (place_m, None) => Ok(place_m + self.barycentre_m(at_s)),
            (place_m, Some(ours)) => Ok(place_m + ours.barycentric_m(tdb_s)),
        }
    }

    /// Sum along the chain of centres of a number, m, at a covered time, and the body at which it ends; `None` if it
    /// ends at the barycentre of the kernels.
    fn summed_m(&self, number: i32, at_s: f64) -> Result<(DVec3, Option<SolarBody>), String> {
        let (mut body, mut place_m) = (number, DVec3::ZERO);
        for _ in 0..MOST_CENTRES {
            if body == BARYCENTRE {
                return Ok((place_m, None));
            }
            let ours = Ephemeris::Spk(body).stands_as().filter(|_| body != number);
            if ours.is_some() && (body == EARTH || !self.covered_s.contains_key(&body)) {
                return Ok((place_m, ours));
            }
            if !self.covered_s.contains_key(&body) {
                return Err(format!("spk:{number}: its position is relative to {}", self.unknown(body)));
            }
            let state = self
                .almanac
                .translate_to_parent(Frame::from_ephem_j2000(body), Epoch::from_et_seconds(at_s))
                .map_err(|error| self.unusable(number, body, &error))?;
            place_m += DVec3::new(state.radius_km.x, state.radius_km.y, state.radius_km.z) * 1e3;
            body = state.frame.ephemeris_id;
        }
        Err(format!("spk:{number}: more than {MOST_CENTRES} centres to the barycentre"))
    }

    /// Position of the kernels' barycentre relative to that of VSOP87, m; zero if they have neither the Earth nor the
    /// Sun.
    fn barycentre_m(&self, tdb_s: f64) -> DVec3 {
        let by = |number: i32| {
            let [first, last] = self.covered_s(number).filter(|[first, last]| first <= last)?;
            let at_s = tdb_s.clamp(first, last);
            // A chain that ends at another body does not define the barycentre.
            let (place_m, _) = self.summed_m(number, at_s).ok().filter(|(_, ours)| ours.is_none())?;
            Some(Ephemeris::Spk(number).stands_as()?.barycentric_m(at_s) - place_m)
        };
        by(EARTH).or_else(|| by(SUN)).unwrap_or_default()
    }

    /// Message that the position of a body, on which that of a number depends, cannot be computed.
    fn unusable(&self, number: i32, body: i32, error: &dyn Display) -> String {
        let files: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        format!(
            "spk:{number}: the data of {body} in one of the kernels {} are damaged, incomplete, or of a type other than 1, 2, 3, \
             9, 12 and 13: {error}",
            files.join(", ")
        )
    }

    /// Message that no kernel has a number, with the numbers that exist.
    pub fn unknown(&self, number: i32) -> String {
        let known: Vec<String> = self.numbers().map(|number| number.to_string()).collect();
        format!("spk:{number}: not in any kernel of scene.kernels; they contain {}", known.join(", "))
    }
}

impl Ephemeris {
    /// Returns the body of the Solar System that this ephemeris describes, whose rotation applies; `None` for any other
    /// object.
    pub fn stands_as(self) -> Option<SolarBody> {
        match self {
            Self::Of(body) => Some(body),
            Self::Spk(number) => match number {
                10 => Some(SolarBody::Sun),
                1 | 199 => Some(SolarBody::Mercury),
                2 | 299 => Some(SolarBody::Venus),
                399 => Some(SolarBody::Earth),
                301 => Some(SolarBody::Moon),
                4 | 499 => Some(SolarBody::Mars),
                5 | 599 => Some(SolarBody::Jupiter),
                6 | 699 => Some(SolarBody::Saturn),
                7 | 799 => Some(SolarBody::Uranus),
                8 | 899 => Some(SolarBody::Neptune),
                501 => Some(SolarBody::Io),
                502 => Some(SolarBody::Europa),
                503 => Some(SolarBody::Ganymede),
                504 => Some(SolarBody::Callisto),
                606 => Some(SolarBody::Titan),
                _ => None,
            },
        }
    }
}

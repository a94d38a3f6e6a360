//! SPK kernels of the SPICE toolkit, by `anise`: where bodies and spacecraft are that have a NAIF number.
//!
//! A segment of a kernel has a body from its centre; the place from the barycentre of the Solar System is the sum along centres. The sum ends at that barycentre; at the Earth, whose place
//! is that on which observers stand, so that satellites are as far from them as their kernel says; and at a body of the Solar System that no kernel has, which is where VSOP87 or ELP have it.
//!
//! The barycentre of DE440 is not that of VSOP87: they are 1,000 to 1,400 km apart. So a sum that ends at the barycentre is moved by what kernels and VSOP87 differ in the place of the Earth, or of the Sun
//! where no kernel has the Earth.

use std::{
    collections::{BTreeMap, HashSet},
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

/// NAIF's numbers of the barycentre and of the Earth.
const BARYCENTRE: i32 = 0;
/// See [`BARYCENTRE`].
const EARTH: i32 = 399;
/// See [`BARYCENTRE`].
const SUN: i32 = 10;
/// NAIF's number of the axes of ICRS, which segments must be given on.
const ICRS_AXES: i32 = 1;
/// Centres from a spacecraft to the barycentre: far more than any kernel has.
const MOST_CENTRES: usize = 16;

/// A kernel that cannot be used.
#[derive(Debug, Error)]
#[error("{}: {problem}", file.display())]
pub struct KernelError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it and what is allowed.
    pub problem: String,
}

/// The kernels of a scene; later ones are looked at first.
pub struct Kernels {
    almanac: Almanac,
    files: Vec<PathBuf>,
    /// First and last TDB, s since J2000.0, of each number.
    covered_s: BTreeMap<i32, [f64; 2]>,
    /// Numbers of which it was said that they are not covered.
    told: Mutex<HashSet<i32>>,
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

/// What is known of the files that were read last.
type Held = Option<(Vec<(PathBuf, Option<SystemTime>, u64)>, Arc<Kernels>)>;

/// The kernels that were read last: scenes are made anew for every change of a configuration, and kernels have up to a gigabyte.
static HELD: Mutex<Held> = Mutex::new(None);

fn read(file: &Path) -> Result<SPK, KernelError> {
    let fault = |problem: String| KernelError { file: file.to_owned(), problem };
    let bytes = std::fs::read(file).map_err(|error| fault(error.to_string()))?;
    if !bytes.starts_with(b"DAF/SPK") {
        return Err(fault("no SPK kernel: these begin with `DAF/SPK`".to_owned()));
    }
    SPK::parse(bytes.as_slice()).map_err(|error| fault(error.to_string()))
}

impl Kernels {
    /// Reads kernels; those that were read last are taken again while their files are the same. Errors: a file that cannot be read or is no SPK kernel, a segment on other axes than those of
    /// ICRS (J2000).
    pub fn load(files: &[PathBuf]) -> Result<Arc<Self>, KernelError> {
        let mut stamps = Vec::new();
        for file in files {
            let stamp = std::fs::metadata(file)
                .map_err(|error| KernelError { file: file.clone(), problem: error.to_string() })?;
            stamps.push((file.clone(), stamp.modified().ok(), stamp.len()));
        }
        let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, kernels)) = held.as_ref()
            && *of == stamps
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
                for segment in block.map_err(|error| fault(error.to_string()))?.iter().filter(|of| !of.is_empty()) {
                    if segment.frame_id != ICRS_AXES {
                        let problem = format!(
                            "the segment of {} is on axes {}: allowed are those of ICRS, {ICRS_AXES} (J2000)",
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
        // A place is known while all of its centres are.
        for _ in 0..MOST_CENTRES {
            for (body, of) in &centres {
                for centre in of.iter().filter(|centre| **centre != EARTH) {
                    if let (Some(within), Some(covered)) = (covered_s.get(centre).copied(), covered_s.get_mut(body)) {
                        *covered = [covered[0].max(within[0]), covered[1].min(within[1])];
                    }
                }
            }
        }
        Ok(Self { almanac, files: files.to_owned(), covered_s, told: Mutex::default() })
    }

    /// The numbers that the kernels have.
    pub fn numbers(&self) -> impl Iterator<Item = i32> {
        self.covered_s.keys().copied()
    }

    /// First and last TDB, s since J2000.0, at which the place of a number is known; `None`: no kernel has it.
    pub fn covered_s(&self, number: i32) -> Option<[f64; 2]> {
        self.covered_s.get(&number).copied()
    }

    /// Place of a number from the barycentre, ICRS axes, m, at a TDB, s since J2000.0; before and after what the kernels cover, as at the border, which is logged once. The error says why
    /// there is none.
    pub fn barycentric_m(&self, number: i32, tdb_s: f64) -> Result<DVec3, String> {
        let [first, last] = self.covered_s(number).ok_or_else(|| self.unknown(number))?;
        if first > last {
            return Err(format!("spk:{number}: its kernel and those of its centres have no time in common"));
        }
        let at_s = tdb_s.clamp(first, last);
        if at_s != tdb_s && self.told.lock().unwrap_or_else(PoisonError::into_inner).insert(number) {
            warn!(
                number,
                tdb_s,
                first,
                last,
                "the scene's time is beyond an SPK kernel: the body stays where the kernel begins or ends"
            );
        }
        match self.summed_m(number, at_s)? {
            (place_m, None) => Ok(place_m + self.barycentre_m(at_s)),
            (place_m, Some(ours)) => Ok(place_m + ours.barycentric_m(tdb_s)),
        }
    }

    /// Sum along the centres of a number, m, at a time that is covered, and the body at which it ends; `None`: at the barycentre of the kernels.
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
            let state = self
                .almanac
                .translate_to_parent(Frame::from_ephem_j2000(body), Epoch::from_et_seconds(at_s))
                .map_err(|error| format!("spk:{number}: {error}"))?;
            place_m += DVec3::new(state.radius_km.x, state.radius_km.y, state.radius_km.z) * 1e3;
            body = state.frame.ephemeris_id;
        }
        Err(format!("spk:{number}: more than {MOST_CENTRES} centres to the barycentre"))
    }

    /// Where the barycentre of the kernels is from that of VSOP87, m; zero where they have neither the Earth nor the Sun.
    fn barycentre_m(&self, tdb_s: f64) -> DVec3 {
        let by = |number: i32| {
            let [first, last] = self.covered_s(number).filter(|[first, last]| first <= last)?;
            let at_s = tdb_s.clamp(first, last);
            // A sum that ends at another body says nothing of the barycentre.
            let (place_m, _) = self.summed_m(number, at_s).ok().filter(|(_, ours)| ours.is_none())?;
            Some(Ephemeris::Spk(number).stands_as()?.barycentric_m(at_s) - place_m)
        };
        by(EARTH).or_else(|| by(SUN)).unwrap_or_default()
    }

    /// That no kernel has a number, and which there are.
    pub fn unknown(&self, number: i32) -> String {
        let known: Vec<String> = self.numbers().map(|number| number.to_string()).collect();
        format!("spk:{number}: no kernel of scene.kernels has it; they have {}", known.join(", "))
    }
}

impl Ephemeris {
    /// The body of the Solar System as which it stands and turns; `None`: one of its own.
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

//! Loads the stars of a scene from catalogues.
//!
//! The catalogues are read one after the other, compared for stars that are listed in two of them, and joined. A store that is the only catalogue is
//! used directly if its stars need not move. The bright stars of a deep store are read like those of a file; views read the others when they need
//! them. Memory: the records of the other catalogues are appended to those of the largest one (40 bytes each). All are freed when the packed stars
//! (16 bytes each) exist.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use crate::catalogue::chunks::StarSet;
use crate::catalogue::deep::{BRIGHT_FILE, DeepError, is_deep_store, live::DeepSky};
use crate::catalogue::diffuse::DiffuseSky;
use crate::catalogue::epoch::Epoch;
use crate::catalogue::galaxy::{self, Galaxy, GalaxyError, GalaxyParameters};
use crate::catalogue::healpix::{LightMap, LightMapError};
use crate::catalogue::motion::StarVelocity;
use crate::catalogue::names::{NamedStar, NamesOfStar};
use crate::catalogue::overlap::{Overlap, Repetition, find_overlaps, find_repetitions};
use crate::catalogue::reader::{CatalogueError, CatalogueRead, ReadReport, read_file};
use crate::catalogue::store::{self, Store, StoreError};
use crate::catalogue::{StarRecord, bright};

/// Source of stars.
#[derive(Clone, Debug, PartialEq)]
pub enum StarSource {
    /// The built-in table of bright stars.
    Bright,
    /// The same table, but variable stars have their brightness at the scene's time.
    BrightVariable,
    /// A catalogue or a store.
    File(PathBuf),
    /// Synthetic stars.
    Galaxy(GalaxyParameters),
    /// A map of unresolved light, which belongs to no individual star.
    Light(LightMap),
}

impl StarSource {
    /// Folder of the deep store, if the source is one.
    fn deep_store(&self) -> Option<&Path> {
        match self {
            Self::File(path) if is_deep_store(path) => Some(path),
            _ => None,
        }
    }

    /// Whether its stars may have proper motion.
    pub fn may_move(&self) -> bool {
        match self {
            Self::Bright | Self::BrightVariable => true,
            // If the file cannot be read, this is reported when it is loaded.
            Self::File(path) if is_deep_store(path) => has_velocities(&path.join(BRIGHT_FILE)),
            Self::File(path) if is_store(path).unwrap_or(false) => has_velocities(path),
            Self::File(_) => true,
            Self::Galaxy(_) | Self::Light(_) => false,
        }
    }
}

/// Whether a single-file store has stars that move, according to its header.
fn has_velocities(path: &Path) -> bool {
    store::read_header(path).is_ok_and(|header| header.velocities > 0)
}

impl fmt::Display for StarSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StarSource::Bright => f.write_str(bright::NAME),
            StarSource::BrightVariable => write!(f, "{} (variable stars)", bright::NAME),
            StarSource::File(path) => write!(f, "{}", path.display()),
            StarSource::Light(map) => write!(f, "light of {}", map.path.display()),
            StarSource::Galaxy(GalaxyParameters { stars, seed, fainter_than, .. }) => {
                write!(f, "synthetic galaxy ({stars} stars, seed {seed}")?;
                match fainter_than {
                    Some(magnitude) => write!(f, ", fainter than V = {magnitude})"),
                    None => f.write_str(")"),
                }
            }
        }
    }
}

/// Progress events.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadStep {
    /// A catalogue is about to be read or generated.
    Catalogue {
        /// Its name.
        name: String,
        /// Its index, from 0.
        index: usize,
        /// Number of catalogues.
        of: usize,
    },
    /// Catalogues are about to be compared with each other.
    Overlaps,
    /// Stars are about to be sorted into chunks.
    Chunks {
        /// Number of stars.
        stars: usize,
    },
}

/// A loaded catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedCatalogue {
    /// Its name.
    pub name: String,
    /// Number of stars.
    pub stars: usize,
    /// Statistics of the rows of a file; `None` for stores and built-in catalogues, which have no bad rows.
    pub rows: Option<ReadReport>,
}

/// Report of loading.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct LoadReport {
    /// One entry per source.
    pub catalogues: Vec<LoadedCatalogue>,
    /// Pairs of catalogues that have stars in common. These stars are drawn twice.
    pub overlaps: Vec<Overlap>,
    /// Files that seem to contain some stars twice; these stars are drawn twice.
    pub repetitions: Vec<Repetition>,
}

/// Reasons why the stars of a scene cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A catalogue file is invalid.
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    /// A store is invalid.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A deep store is invalid.
    #[error(transparent)]
    Deep(#[from] DeepError),
    /// The scene has more than one deep store.
    #[error(
        "scene.catalogues[{index}]: {} is a second deep store, but a scene can have only one: `catalogue import` combines several catalogues into one store",
        path.display()
    )]
    SecondDeep {
        /// Index of the source, from 0.
        index: usize,
        /// The store.
        path: PathBuf,
    },
    /// A synthetic galaxy together with a deep store.
    #[error(
        "scene.catalogues[{index}]: a synthetic galaxy cannot be drawn together with a deep store, whose light of faint stars it would repeat: remove one of them"
    )]
    GalaxyBesideDeep {
        /// Index of the galaxy, from 0.
        index: usize,
    },
    /// A deep store cannot become part of a store in one file.
    #[error(
        "{}: a deep store cannot be put into a store in one file: `catalogue export` writes its stars as CSV or Parquet, `catalogue slice` a part of it",
        path.display()
    )]
    DeepInStore {
        /// The store.
        path: PathBuf,
    },
    /// A map of light is invalid.
    #[error(transparent)]
    Light(#[from] LightMapError),
    /// The parameters of a synthetic galaxy are invalid.
    #[error("scene.catalogues[{index}].galaxy: {source}")]
    Galaxy {
        /// Index of the source, from 0.
        index: usize,
        /// The error.
        source: GalaxyError,
    },
    /// More stars than a u32 can index.
    #[error("the catalogues have {stars} stars together, but at most {} can be drawn", u32::MAX)]
    TooMany {
        /// Number of stars.
        stars: usize,
    },
}

/// Loads and joins catalogues as seen at an epoch. `progress` is called before each step.
pub fn load_stars(
    sources: &[StarSource],
    epoch: &Epoch,
    progress: &mut dyn FnMut(LoadStep),
) -> Result<(StarSet, LoadReport), LoadError> {
    // If the only source is a store whose stars need not be moved, it is used as it is. For a deep store, this applies to the bright stars.
    if let [StarSource::File(path)] = sources
        && epoch.seen_from.is_none()
        && let is_deep = is_deep_store(path)
        && (is_deep || is_store(path)?)
        && let file = if is_deep { path.join(BRIGHT_FILE) } else { path.clone() }
        && (epoch.years == 0.0 || store::read_header(&file)?.velocities == 0)
    {
        progress(LoadStep::Catalogue { name: sources[0].to_string(), index: 0, of: 1 });
        let deep = if is_deep { Some(Arc::new(DeepSky::open(path, epoch)?)) } else { None };
        let store = deep
            .as_ref()
            .map_or_else(|| Ok(store::read(path)?), |deep| deep.store().bright().map_err(LoadError::from))?;
        let named = if store.names.is_empty() { Vec::new() } else { store.named(&store.records(epoch.years)) };
        let stars = store.stars.of_epoch(*epoch).with_names(named).with_deep(deep);
        let loaded = LoadedCatalogue { name: sources[0].to_string(), stars: stars.stars.len(), rows: None };
        return Ok((stars, LoadReport { catalogues: vec![loaded], ..LoadReport::default() }));
    }

    let (parts, report) = read_all(sources, epoch, progress)?;
    let (mut unresolved, mut map, mut deep, mut named) = (None, None, None, Vec::new());
    let mut loaded = Vec::with_capacity(parts.len());
    for (source, mut part) in sources.iter().zip(parts) {
        // The variable stars are added below, with their brightness at this time. This part has no names: those of the table are known in every
        // scene.
        if *source == StarSource::BrightVariable {
            let mut rows = bright::variable_rows();
            rows.sort_unstable();
            for row in rows.into_iter().rev() {
                part.stars.swap_remove(row);
            }
        }
        named.extend(part.named());
        deep = part.deep.take().or(deep);
        // Only one map of unresolved light is used: that of a light map if there is one, otherwise that of the last galaxy.
        if matches!(source, StarSource::Light(_)) {
            map = part.unresolved;
        } else {
            unresolved = part.unresolved.or(unresolved);
        }
        loaded.push(part.stars);
    }
    let stars = loaded.iter().map(Vec::len).sum();
    progress(LoadStep::Chunks { stars });
    let mut records = joined(loaded, stars);
    if epoch.seen_from.is_some() {
        records.par_iter_mut().for_each(|record| *record = epoch.seen(*record));
    }
    named.iter_mut().for_each(|named: &mut NamedStar| named.star = epoch.seen(named.star));
    let stars = StarSet::from_records(records).of_epoch(*epoch).with_names(named);
    let stars = stars.with_unresolved(map.or(unresolved).map(Arc::new)).with_deep(deep);
    let are_variable = sources.contains(&StarSource::BrightVariable);
    Ok((if are_variable { stars.with_variable_stars(epoch.years) } else { stars }, report))
}

/// Reads and joins catalogues for a store: stars at J2000.0 with their velocities and names. `progress` is called before each step.
pub fn import_stars(
    sources: &[StarSource],
    progress: &mut dyn FnMut(LoadStep),
) -> Result<(Store, LoadReport), LoadError> {
    if let Some(path) = sources.iter().find_map(StarSource::deep_store) {
        return Err(LoadError::DeepInStore { path: path.to_owned() });
    }
    let (parts, report) = read_all(sources, &Epoch::default(), progress)?;
    let (mut records, mut velocities, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for part in parts {
        // Checked by `read_all`: all stars together fit in a u32.
        let first = records.len() as u32;
        velocities.extend(part.velocities.iter().map(|v| StarVelocity { star: first + v.star, ..*v }));
        names.extend(part.names.into_iter().map(|of| NamesOfStar { star: first + of.star, ..of }));
        records.extend(part.stars);
    }
    progress(LoadStep::Chunks { stars: records.len() });
    Ok((Store::from_records(String::new(), records, velocities, names), report))
}

/// Reads all sources, and compares them for stars that are listed twice.
fn read_all(
    sources: &[StarSource],
    epoch: &Epoch,
    progress: &mut dyn FnMut(LoadStep),
) -> Result<(Vec<Read>, LoadReport), LoadError> {
    check_deep(sources)?;
    let mut report = LoadReport::default();
    let mut parts: Vec<Read> = Vec::with_capacity(sources.len());
    for (index, source) in sources.iter().enumerate() {
        progress(LoadStep::Catalogue { name: source.to_string(), index, of: sources.len() });
        let mut part = read(source, index, epoch)?;
        let rows = part.rows.take();
        // A store was compared when it was made.
        if rows.is_some() {
            report.repetitions.extend(find_repetitions(&source.to_string(), &part.stars));
        }
        report.catalogues.push(LoadedCatalogue { name: source.to_string(), stars: part.stars.len(), rows });
        parts.push(part);
    }

    // Synthetic stars are excluded from the comparison: if one is near a real star by chance, both are intended.
    let real: Vec<(&str, &[StarRecord])> = sources
        .iter()
        .zip(&report.catalogues)
        .zip(&parts)
        .filter(|((source, _), _)| !matches!(source, StarSource::Galaxy(_)))
        .map(|((_, catalogue), part)| (catalogue.name.as_str(), part.stars.as_slice()))
        .collect();
    if real.len() > 1 {
        progress(LoadStep::Overlaps);
        report.overlaps = find_overlaps(&real);
    }
    let stars: usize = parts.iter().map(|part| part.stars.len()).sum();
    if stars > u32::MAX as usize {
        return Err(LoadError::TooMany { stars });
    }
    Ok((parts, report))
}

/// Whether the file is a store, judged by its first bytes or by its extension, so that a damaged store is reported as a store.
fn is_store(path: &Path) -> Result<bool, LoadError> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("stars")) {
        return Ok(true);
    }
    Ok(path.is_file() && store::is_store(path)?)
}

/// Contents of a source.
#[derive(Default)]
struct Read {
    stars: Vec<StarRecord>,
    rows: Option<ReadReport>,
    /// Velocities and names, by the index of the star.
    velocities: Vec<StarVelocity>,
    names: Vec<NamesOfStar>,
    unresolved: Option<DiffuseSky>,
    /// Stars that views read when they need them.
    deep: Option<Arc<DeepSky>>,
}

impl Read {
    /// The named stars.
    fn named(&self) -> impl Iterator<Item = NamedStar> {
        self.names.iter().map(|of| NamedStar::from_file(of.names.clone(), self.stars[of.star as usize]))
    }
}

fn read(source: &StarSource, index: usize, epoch: &Epoch) -> Result<Read, LoadError> {
    let years = epoch.years;
    match source {
        StarSource::Bright | StarSource::BrightVariable => {
            // The names of this table are known in every scene.
            let CatalogueRead { stars, velocities, .. } = bright::read(years);
            Ok(Read { stars, velocities, ..Read::default() })
        }
        StarSource::Galaxy(parameters) => {
            let Galaxy { stars, unresolved } =
                galaxy::kept_or_generated(parameters).map_err(|source| LoadError::Galaxy { index, source })?;
            Ok(Read { stars, unresolved, ..Read::default() })
        }
        StarSource::Light(map) => Ok(Read { unresolved: Some(map.read()?), ..Read::default() }),
        StarSource::File(path) if is_deep_store(path) => read_deep(path, epoch),
        StarSource::File(path) if is_store(path)? => {
            let store = store::read(path)?;
            let stars = store.records(years);
            Ok(Read { stars, velocities: store.velocities, names: store.names, ..Read::default() })
        }
        StarSource::File(path) => {
            let CatalogueRead { stars, names, velocities, report } = read_file(path, years)?;
            Ok(Read { stars, rows: Some(report), velocities, names, ..Read::default() })
        }
    }
}

/// Reads the bright stars of a deep store, and opens it for the others.
fn read_deep(path: &Path, epoch: &Epoch) -> Result<Read, LoadError> {
    let deep = DeepSky::open(path, epoch)?;
    let bright = deep.store().bright()?;
    Ok(Read {
        stars: bright.records(epoch.years),
        velocities: bright.velocities,
        names: bright.names,
        deep: Some(Arc::new(deep)),
        ..Read::default()
    })
}

/// Refuses a second deep store, and a synthetic galaxy together with one.
fn check_deep(sources: &[StarSource]) -> Result<(), LoadError> {
    let Some(first) = sources.iter().position(|source| source.deep_store().is_some()) else { return Ok(()) };
    for (index, source) in sources.iter().enumerate() {
        if matches!(source, StarSource::Galaxy(_)) {
            return Err(LoadError::GalaxyBesideDeep { index });
        }
        if let Some(path) = source.deep_store().filter(|_| index > first) {
            return Err(LoadError::SecondDeep { index, path: path.to_owned() });
        }
    }
    Ok(())
}

/// Joins all records into one vector by appending to the largest part. The order does not matter.
fn joined(mut parts: Vec<Vec<StarRecord>>, stars: usize) -> Vec<StarRecord> {
    let Some(largest) = (0..parts.len()).max_by_key(|&index| parts[index].len()) else { return Vec::new() };
    let mut all = parts.swap_remove(largest);
    all.reserve_exact(stars - all.len());
    for part in parts {
        all.extend_from_slice(&part);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::names;

    const CSV: &str = "ra_deg,dec_deg,v_mag\n10,20,3.0\nx,20,3.0\n101.28715,-16.71612,-1.46\n";

    fn galaxy(stars: usize) -> StarSource {
        StarSource::Galaxy(GalaxyParameters { stars, seed: 1, fainter_than: Some(3.5), unresolved_light: false })
    }

    #[test]
    fn catalogues_are_joined_bad_rows_counted_and_common_stars_reported() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("two.csv");
        std::fs::write(&csv, CSV).unwrap();
        let mut steps = Vec::new();
        let sources = [StarSource::Bright, StarSource::File(csv), galaxy(1000)];
        let (set, report) = load_stars(&sources, &Epoch::default(), &mut |step| steps.push(step)).unwrap();
        let bright = bright::bright_stars(0.0).len();
        assert_eq!(report.catalogues.iter().map(|c| c.stars).collect::<Vec<_>>(), [bright, 2, 1000]);
        assert_eq!(set.stars.len(), bright + 1002);
        let rows = report.catalogues[1].rows.as_ref().unwrap();
        assert_eq!((rows.used, rows.rejected, rows.first_rejected[0].line), (2, 1, 3));
        assert_eq!(report.overlaps.len(), 1, "{:?}", report.overlaps);
        assert_eq!(report.overlaps[0].count, 1, "Sirius");
        assert_eq!(steps.len(), 5);
        assert_eq!(steps[4], LoadStep::Chunks { stars: bright + 1002 });
    }

    #[test]
    fn a_store_can_be_loaded_alone_and_with_other_catalogues() {
        let folder = tempfile::tempdir().unwrap();
        let (stars, _) = load_stars(&[galaxy(2000)], &Epoch::default(), &mut |_| ()).unwrap();
        for name in ["set.stars", "set.bin"] {
            let path = folder.path().join(name);
            store::write(&path, &Store { stars: stars.clone(), ..Store::default() }).unwrap();
            let alone = load_stars(&[StarSource::File(path.clone())], &Epoch::default(), &mut |_| ()).unwrap().0;
            assert_eq!(alone.stars, stars.stars);
            let both =
                load_stars(&[StarSource::File(path), StarSource::Bright], &Epoch::default(), &mut |_| ()).unwrap().0;
            assert_eq!(both.stars.len(), 2000 + bright::bright_stars(0.0).len());
        }
    }

    /// The stars of a store have the same motions and names as those of the file from which the store was made.
    #[test]
    fn a_store_keeps_the_motions_and_names_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("named.csv");
        let text = "ra_deg,dec_deg,v_mag,distance_pc,pm_ra_mas_yr,pm_dec_mas_yr,radial_velocity_km_s,hip,name\n\
             269.452,4.693,9.54,1.8,-800,10360,-110,87937,Barnard\n10,20,3,,300,400,,,Far\n50,60,4,10,,,,,Still\n";
        std::fs::write(&csv, text).unwrap();
        let sources = [StarSource::File(csv)];
        let (store, _) = import_stars(&sources, &mut |_| ()).unwrap();
        assert_eq!((store.stars.stars.len(), store.velocities.len(), store.names.len()), (3, 2, 3));
        let path = folder.path().join("named.stars");
        store::write(&path, &store).unwrap();
        let stored = [StarSource::File(path.clone())];
        assert!(stored[0].may_move());
        for years in [0.0, 100.0, -500.0] {
            let epoch = Epoch { years, ..Epoch::default() };
            let [expected, found] = [&sources, &stored].map(|from| load_stars(from, &epoch, &mut |_| ()).unwrap().0);
            for name in ["Barnard", "HIP 87937", "far", "Still"] {
                let place =
                    |set: &StarSet| names::find(set.named().iter(), name).map(|star| star.star.position).unwrap();
                let (expected, found) = (place(&expected), place(&found));
                assert!((expected - found).length() < 1e-6 * expected.length(), "{name} {years}: {expected} {found}");
            }
            let places = |set: &StarSet| set.iter().map(|(position, ..)| position).sum::<glam::DVec3>();
            assert!((places(&expected) - places(&found)).length() < 1e-4, "{years}");
        }
        // A store made from other stores keeps motions and names, and a store without motions is not read again for another time.
        let (again, _) = import_stars(&[StarSource::File(path), StarSource::Bright], &mut |_| ()).unwrap();
        assert_eq!(again.names.len(), 3);
        assert!(again.velocities.len() > 9000);
        let still = folder.path().join("still.stars");
        store::write(&still, &import_stars(&[galaxy(10)], &mut |_| ()).unwrap().0).unwrap();
        assert!(!StarSource::File(still).may_move());
    }

    #[test]
    fn stars_that_are_in_a_file_twice_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("twice.csv");
        std::fs::write(&csv, "id,ra_deg,dec_deg,v_mag\n1,101.287,-16.716,-1.46\n2,101.287,-16.716,-1.46\n3,10,20,5\n")
            .unwrap();
        let (set, report) = load_stars(&[StarSource::File(csv)], &Epoch::default(), &mut |_| ()).unwrap();
        assert_eq!((set.stars.len(), report.repetitions.len(), report.repetitions[0].count), (3, 1, 1));
        let (_, report) = load_stars(&[StarSource::Bright, galaxy(1000)], &Epoch::default(), &mut |_| ()).unwrap();
        assert!(report.repetitions.is_empty());
    }

    #[test]
    fn missing_files_damaged_files_and_bad_galaxies_have_distinct_errors() {
        let folder = tempfile::tempdir().unwrap();
        let damaged = folder.path().join("x.stars");
        std::fs::write(&damaged, "STERSTARxxxx").unwrap();
        let load =
            |source: StarSource| load_stars(&[StarSource::Bright, source], &Epoch::default(), &mut |_| ()).unwrap_err();
        assert!(matches!(load(StarSource::File(damaged)), LoadError::Store(StoreError::Damaged { .. })));
        assert!(matches!(load(StarSource::File("no/such.csv".into())), LoadError::Catalogue(_)));
        assert!(matches!(load(StarSource::File("no/such.stars".into())), LoadError::Store(StoreError::Io { .. })));
        assert!(matches!(load(galaxy(0)), LoadError::Galaxy { index: 1, .. }));
    }

    #[test]
    fn no_catalogue_is_an_empty_sky() {
        assert!(load_stars(&[], &Epoch::default(), &mut |_| ()).unwrap().0.stars.is_empty());
    }
}

//! Loads the stars of a scene from catalogues.
//!
//! The catalogues are read one after the other, compared for stars that are listed in two of them, and joined. A store
//! that is the only catalogue is used directly. Memory: the records of the largest catalogue (40 bytes each) grow in
//! place by those of the others, and are freed when the packed stars (16 bytes each) exist.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use crate::catalogue::chunks::StarSet;
use crate::catalogue::diffuse::DiffuseSky;
use crate::catalogue::epoch::Epoch;
use crate::catalogue::galaxy::{self, Galaxy, GalaxyError, GalaxyParameters};
use crate::catalogue::healpix::{LightMap, LightMapError};
use crate::catalogue::names::NamedStar;
use crate::catalogue::overlap::{Overlap, find_overlaps};
use crate::catalogue::reader::{CatalogueError, ReadReport, read_file};
use crate::catalogue::store::{self, StoreError};
use crate::catalogue::{StarRecord, bright};

/// Source of stars.
#[derive(Clone, Debug, PartialEq)]
pub enum StarSource {
    /// The built-in table of bright stars.
    Bright,
    /// A catalogue or a store.
    File(PathBuf),
    /// Synthetic stars.
    Galaxy(GalaxyParameters),
    /// A map of unresolved light, which belongs to no individual star.
    Light(LightMap),
}

impl StarSource {
    /// Whether its stars may have proper motion.
    pub fn may_move(&self) -> bool {
        match self {
            Self::Bright => true,
            // A file that cannot be read is reported when it is loaded.
            Self::File(path) => !is_store(path).unwrap_or(false),
            Self::Galaxy(_) | Self::Light(_) => false,
        }
    }
}

impl fmt::Display for StarSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StarSource::Bright => f.write_str(bright::NAME),
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
    /// Pairs of catalogues with common stars, which are drawn twice.
    pub overlaps: Vec<Overlap>,
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

/// Loads and joins catalogues as seen at an epoch; stars of stores have no proper motion. `progress` is called before
/// each step.
pub fn load_stars(
    sources: &[StarSource],
    epoch: &Epoch,
    progress: &mut dyn FnMut(LoadStep),
) -> Result<(StarSet, LoadReport), LoadError> {
    if let [StarSource::File(path)] = sources
        && epoch.seen_from.is_none()
        && is_store(path)?
    {
        progress(LoadStep::Catalogue { name: sources[0].to_string(), index: 0, of: 1 });
        let stars = store::read(path)?.stars.of_epoch(*epoch);
        let loaded = LoadedCatalogue { name: sources[0].to_string(), stars: stars.stars.len(), rows: None };
        return Ok((stars, LoadReport { catalogues: vec![loaded], overlaps: Vec::new() }));
    }

    let mut report = LoadReport::default();
    let mut loaded: Vec<Vec<StarRecord>> = Vec::with_capacity(sources.len());
    let (mut unresolved, mut map, mut named) = (None, None, Vec::new());
    for (index, source) in sources.iter().enumerate() {
        progress(LoadStep::Catalogue { name: source.to_string(), index, of: sources.len() });
        let Read { stars, rows, named: source_names, unresolved: source_light } = read(source, index, epoch.years)?;
        named.extend(source_names);
        report.catalogues.push(LoadedCatalogue { name: source.to_string(), stars: stars.len(), rows });
        loaded.push(stars);
        // There is one map of unresolved light: that of a light map, else that of the last galaxy.
        if matches!(source, StarSource::Light(_)) {
            map = source_light;
        } else {
            unresolved = source_light.or(unresolved);
        }
    }

    // Synthetic stars are excluded from the comparison: if one is near a real star by chance, both are intended.
    let real: Vec<(&str, &[StarRecord])> = sources
        .iter()
        .zip(&report.catalogues)
        .zip(&loaded)
        .filter(|((source, _), _)| !matches!(source, StarSource::Galaxy(_)))
        .map(|((_, catalogue), records)| (catalogue.name.as_str(), records.as_slice()))
        .collect();
    if real.len() > 1 {
        progress(LoadStep::Overlaps);
        report.overlaps = find_overlaps(&real);
    }

    let stars = loaded.iter().map(Vec::len).sum();
    if stars > u32::MAX as usize {
        return Err(LoadError::TooMany { stars });
    }
    progress(LoadStep::Chunks { stars });
    let mut records = joined(loaded, stars);
    if epoch.seen_from.is_some() {
        records.par_iter_mut().for_each(|record| *record = epoch.seen(*record));
    }
    named.iter_mut().for_each(|named: &mut NamedStar| named.star = epoch.seen(named.star));
    let stars = StarSet::from_records(records).of_epoch(*epoch).with_names(named);
    Ok((stars.with_unresolved(map.or(unresolved).map(Arc::new)), report))
}

/// Whether the file is a store: by its first bytes, or by its extension, so that a damaged store is reported as such.
fn is_store(path: &Path) -> Result<bool, LoadError> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("stars")) {
        return Ok(true);
    }
    Ok(path.is_file() && store::is_store(path)?)
}

/// Contents of a source.
struct Read {
    stars: Vec<StarRecord>,
    rows: Option<ReadReport>,
    named: Vec<NamedStar>,
    unresolved: Option<DiffuseSky>,
}

fn read(source: &StarSource, index: usize, years: f64) -> Result<Read, LoadError> {
    let of_stars = |stars: Vec<StarRecord>| Read { stars, rows: None, named: Vec::new(), unresolved: None };
    match source {
        StarSource::Bright => Ok(of_stars(bright::bright_stars(years))),
        StarSource::Galaxy(parameters) => {
            let Galaxy { stars, unresolved } =
                galaxy::generate(parameters).map_err(|source| LoadError::Galaxy { index, source })?;
            Ok(Read { unresolved, ..of_stars(stars) })
        }
        StarSource::Light(map) => Ok(Read { unresolved: Some(map.read()?), ..of_stars(Vec::new()) }),
        StarSource::File(path) if is_store(path)? => Ok(of_stars(store::records_of(&store::read(path)?.stars))),
        StarSource::File(path) => {
            let read = read_file(path, years)?;
            Ok(Read { rows: Some(read.report), named: read.named, ..of_stars(read.stars) })
        }
    }
}

/// Joins all records into one vector, by growing the largest part. The order does not matter.
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
            store::write(&path, &store::Store { description: String::new(), stars: stars.clone() }).unwrap();
            let alone = load_stars(&[StarSource::File(path.clone())], &Epoch::default(), &mut |_| ()).unwrap().0;
            assert_eq!(alone.stars, stars.stars);
            let both =
                load_stars(&[StarSource::File(path), StarSource::Bright], &Epoch::default(), &mut |_| ()).unwrap().0;
            assert_eq!(both.stars.len(), 2000 + bright::bright_stars(0.0).len());
        }
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

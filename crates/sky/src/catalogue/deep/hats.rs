//! Catalogues in HATS, a folder of Parquet files by HEALPix cell (LSST Interdisciplinary Network, <https://hats.readthedocs.io>).
//!
//! `hats.properties` has lines `key=value`; one of them gives the kind of the catalogue. `partition_info.csv` gives the order `Norder` and the cell
//! `Npix` of each file, whose path is `dataset/Norder=K/Dir=D/Npix=N.parquet` with D = N rounded down to 10,000. `hats_npix_suffix` may give another
//! ending; a slash means that the path is a folder with any number of files. Margin catalogues repeat stars of neighbouring cells, and index
//! catalogues have no stars: both are refused.
//!
//! A collection is a folder with a catalogue and its margin and index catalogues. Only the catalogue, which `collection.properties` names, is read.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::DeepError;
use crate::files;

/// Name of the file that identifies a folder as a catalogue.
const PROPERTIES: &str = "hats.properties";
/// Name of the file that identifies a folder as a collection.
const COLLECTION: &str = "collection.properties";
/// Kinds of catalogues that contain stars.
const KINDS: [&str; 2] = ["object", "source"];
/// Largest length of the text files, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// Whether the path is the folder of a catalogue or of a collection in HATS.
pub fn is_hats(path: &Path) -> bool {
    path.join(PROPERTIES).is_file() || path.join(COLLECTION).is_file()
}

fn refusal(path: &Path, problem: impl Into<String>) -> DeepError {
    DeepError::Hats { path: path.to_owned(), problem: problem.into() }
}

/// Refuses a folder that is neither a deep store nor a catalogue in HATS.
///
/// # Errors
/// The path is a folder.
pub fn refuse_other_folder(path: &Path) -> Result<(), DeepError> {
    if !path.is_dir() {
        return Ok(());
    }
    let problem = if path.join("catalog_info.json").is_file() {
        "it is a catalogue in HiPSCat, the predecessor of HATS; convert it with hats-import".to_owned()
    } else {
        format!(
            "it is a folder; folders must be deep stores (with a file index) or catalogues in HATS (with {PROPERTIES} or {COLLECTION}). Name the files \
             in it instead"
        )
    };
    Err(refusal(path, problem))
}

/// Reads a text file in a folder; returns its path and its text.
fn text(folder: &Path, name: &str) -> Result<(PathBuf, String), DeepError> {
    let path = folder.join(name);
    files::read_text_bounded(&path, MOST_BYTES).map_err(DeepError::io(&path)).map(|text| (path, text))
}

/// Returns the value of a key in lines `key=value`.
fn value<'a>(properties: &'a str, key: &str) -> Option<&'a str> {
    let mut lines = properties.lines().filter_map(|line| line.split_once('='));
    lines.find(|(found, _)| found.trim() == key).map(|(_, value)| value.trim()).filter(|value| !value.is_empty())
}

/// Returns the folder of the catalogue of a collection; the folder itself if it is a catalogue.
fn catalogue_of(folder: &Path) -> Result<PathBuf, DeepError> {
    if folder.join(PROPERTIES).is_file() {
        return Ok(folder.to_owned());
    }
    let (path, properties) = text(folder, COLLECTION)?;
    let key = "hats_primary_table_url";
    let Some(name) = value(&properties, key) else {
        return Err(refusal(&path, format!("it has no {key}, which must name the folder of the catalogue")));
    };
    let catalogue = folder.join(name);
    if catalogue.join(PROPERTIES).is_file() {
        return Ok(catalogue);
    }
    Err(refusal(
        &path,
        format!("its {key} is {name}; it must be a folder in the collection that has a file {PROPERTIES}"),
    ))
}

/// Returns the Parquet files of a catalogue, or of the catalogue in a collection, in the order of its list.
///
/// # Errors
/// The catalogue is of another kind, its list cannot be read, or a listed file is missing.
pub fn files_of(folder: &Path) -> Result<Vec<PathBuf>, DeepError> {
    let folder = &catalogue_of(folder)?;
    let (path, properties) = text(folder, PROPERTIES)?;
    let kind = value(&properties, "dataproduct_type").unwrap_or("missing");
    if !KINDS.contains(&kind) {
        let kinds = KINDS.join(" or ");
        return Err(refusal(
            &path,
            format!("its dataproduct_type is {kind}; it must be {kinds}, whose rows are stars"),
        ));
    }
    let suffix = value(&properties, "hats_npix_suffix").unwrap_or(".parquet");
    if suffix != "/" && (!suffix.starts_with('.') || suffix.contains(['/', '\\'])) {
        let problem = format!("its hats_npix_suffix is {suffix}; it must be an ending such as .parquet, or a slash");
        return Err(refusal(&path, problem));
    }
    let (path, list) = text(folder, "partition_info.csv")?;
    let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(list.as_bytes());
    let damaged = |error: csv::Error| refusal(&path, error.to_string());
    let head = table.headers().map_err(damaged)?.clone();
    let column = |name: &str| {
        head.iter().position(|found| found == name).ok_or_else(|| refusal(&path, format!("it has no column {name}")))
    };
    let columns = [column("Norder")?, column("Npix")?];
    let mut found = Vec::new();
    for row in table.records() {
        let row = row.map_err(damaged)?;
        let [order, pixel] = columns.map(|column| row.get(column).and_then(|field| field.parse::<u64>().ok()));
        let (Some(order @ 0..=29), Some(pixel)) = (order, pixel) else {
            let line = row.position().map_or(0, csv::Position::line);
            return Err(refusal(&path, format!("line {line} has no cell; Norder must be 0 to 29, Npix a number")));
        };
        let directory = folder.join(format!("dataset/Norder={order}/Dir={}", pixel / 10_000 * 10_000));
        let file = directory.join(format!("Npix={pixel}{}", suffix.trim_end_matches('/')));
        let missing = || refusal(&file, "it is listed in partition_info.csv but does not exist");
        if suffix == "/" {
            found.extend(parquet_files(&file)?.ok_or_else(missing)?);
        } else if file.is_file() {
            found.push(file);
        } else {
            return Err(missing());
        }
    }
    if found.is_empty() { Err(refusal(&path, "it lists no file")) } else { Ok(found) }
}

/// Returns the Parquet files in a folder, sorted by name; `None` if there are none.
fn parquet_files(folder: &Path) -> Result<Option<Vec<PathBuf>>, DeepError> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let entries = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut files: Vec<PathBuf> = entries.map_err(DeepError::io(folder))?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "parquet"));
    files.sort();
    Ok(Some(files).filter(|files| !files.is_empty()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::DeepStore;
    use super::super::export::{Rows, export};
    use super::super::import::{ImportSource, import};
    use super::super::slice::Selection;
    use super::super::test_stores::{built, options, stars};
    use super::*;

    /// A catalogue with two files, cells 5 and 12345 of order 5, which contain the northern and the southern stars of a store.
    fn written(folder: &Path, store: &DeepStore) -> PathBuf {
        let catalogue = folder.join("hats");
        for (pixel, z) in [(5, 1.0), (12_345, -1.0)] {
            let dataset = catalogue.join(format!("dataset/Norder=5/Dir={}", pixel / 10_000 * 10_000));
            fs::create_dir_all(&dataset).expect("a folder");
            let half = Selection { cone: Some((glam::DVec3::Z * z, 1.57)), ..Selection::default() };
            export(Rows::Deep(store), &half, &dataset.join(format!("Npix={pixel}.parquet")), &mut |_| ())
                .expect("written");
        }
        let properties = "# HATS\nobs_collection=test\ndataproduct_type=object\nhats_nrows=1\n";
        fs::write(catalogue.join(PROPERTIES), properties).expect("written");
        fs::write(catalogue.join("partition_info.csv"), "Norder,Dir,Npix\n5,0,5\n5,10000,12345\n").expect("written");
        catalogue
    }

    #[test]
    fn all_partitions_are_imported() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        built(&out, &stars(1000, 2, 16.0));
        let store = DeepStore::open(&out).expect("a store");
        let catalogue = written(folder.path(), &store);
        assert!(is_hats(&catalogue) && !is_hats(&out));
        let again = folder.path().join("again");
        let report = import(&[ImportSource::File(catalogue)], options(&again), &mut |_| ()).expect("imported");
        assert_eq!(report.catalogues.len(), 1, "{:?}", report.catalogues);
        assert!(report.catalogues[0].contains("hats (2 files): "), "{:?}", report.catalogues);
        let found = report.build.bright + report.build.layers.iter().sum::<u64>();
        // The cones leave out a narrow band at the equator.
        assert!(found <= store.index().stars() && found + 10 > store.index().stars(), "{found}");
    }

    #[test]
    fn margins_and_incomplete_catalogues_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        built(&out, &stars(300, 2, 16.0));
        let catalogue = written(folder.path(), &DeepStore::open(&out).expect("a store"));
        let message = || files_of(&catalogue).expect_err("refused").to_string();
        fs::remove_file(catalogue.join("dataset/Norder=5/Dir=0/Npix=5.parquet")).expect("removed");
        assert!(message().contains("Npix=5.parquet") && message().contains("does not exist"));
        for (list, part) in
            [("Norder,Dir,Npix\n", "lists no file"), ("Norder,Npix\n5,x\n", "line 2"), ("a,b\n", "no column Norder")]
        {
            fs::write(catalogue.join("partition_info.csv"), list).expect("written");
            assert!(message().contains(part), "{}", message());
        }
        fs::write(catalogue.join(PROPERTIES), "dataproduct_type=margin\n").expect("written");
        assert!(message().contains("margin") && message().contains("object or source"));
    }

    #[test]
    fn only_the_catalogue_of_a_collection_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        built(&out, &stars(300, 2, 16.0));
        let catalogue = written(folder.path(), &DeepStore::open(&out).expect("a store"));
        let collection = folder.path().join("collection.properties");
        fs::write(&collection, "#HATS Collection\nhats_primary_table_url=hats\nall_margins=hats_10arcs\n")
            .expect("written");
        assert!(is_hats(folder.path()));
        assert_eq!(files_of(folder.path()).expect("files"), files_of(&catalogue).expect("files"));
        let message = || files_of(folder.path()).expect_err("refused").to_string();
        for (properties, part) in [
            ("obs_collection=x\n", "has no hats_primary_table_url"),
            ("hats_primary_table_url=other\n", "is other; it must be"),
        ] {
            fs::write(&collection, properties).expect("written");
            assert!(message().contains(part), "{}", message());
        }
    }

    #[test]
    fn partitions_may_be_folders_and_have_another_ending() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        built(&out, &stars(300, 2, 16.0));
        let catalogue = written(folder.path(), &DeepStore::open(&out).expect("a store"));
        let [first, second] = files_of(&catalogue).expect("files").try_into().expect("two files");
        let with_suffix = |suffix: &str| {
            let properties = format!("dataproduct_type=object\nhats_npix_suffix={suffix}\n");
            fs::write(catalogue.join(PROPERTIES), properties).expect("written");
            files_of(&catalogue)
        };
        let message = |suffix: &str| with_suffix(suffix).expect_err("refused").to_string();
        assert!(message("../x").contains("is ../x; it must be an ending"), "{}", message("../x"));
        assert!(message(".snappy.parquet").contains("Npix=5.snappy.parquet"), "{}", message(".snappy.parquet"));
        assert!(message("/").contains("Npix=5: it is listed"), "{}", message("/"));
        let mut expected = Vec::new();
        for file in [first, second] {
            let partition = file.with_extension("");
            fs::create_dir(&partition).expect("a folder");
            fs::write(partition.join("notes.txt"), "").expect("written");
            for name in ["a.parquet", "b.parquet"] {
                fs::copy(&file, partition.join(name)).expect("copied");
                expected.push(partition.join(name));
            }
        }
        assert_eq!(with_suffix("/").expect("files"), expected);
    }

    #[test]
    fn other_folders_are_refused_with_the_kinds_that_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let message = || refuse_other_folder(folder.path()).expect_err("refused").to_string();
        assert!(message().contains("hats.properties or collection.properties"), "{}", message());
        fs::write(folder.path().join("catalog_info.json"), "{}").expect("written");
        assert!(message().contains("HiPSCat"), "{}", message());
        assert!(refuse_other_folder(&folder.path().join("catalog_info.json")).is_ok());
    }

    /// A collection that hats-import 0.11.1 made of `stars.csv`, with a catalogue and a margin catalogue. It lacks the maps of the sky, `_metadata`
    /// and most files of the margin, because they are not read.
    #[test]
    fn a_collection_of_hats_import_gives_the_store_of_its_table() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/hats");
        let folder = tempfile::tempdir().expect("a folder");
        let imported = |source: &str, name: &str| {
            let out = folder.path().join(name);
            let report =
                import(&[ImportSource::File(data.join(source))], options(&out), &mut |_| ()).expect("imported");
            (report, out)
        };
        let (table, from_table) = imported("stars.csv", "table");
        let (collection, from_collection) = imported("", "collection");
        let stars = collection.build.bright + collection.build.layers.iter().sum::<u64>();
        assert_eq!((stars, collection.build.tally), (500, table.build.tally), "{:?}", collection.catalogues);
        assert!(
            collection.catalogues[0]
                .contains("(7 files): 500 stars, read as Gaia archive, DR3, 0 of 500 rows rejected")
        );
        for name in ["leaves-13", "leaves-15", "leaves-17", "plane-13-10", "plane-17-12"] {
            let [of_table, of_collection] =
                [&from_table, &from_collection].map(|out| fs::read(out.join(name)).expect("read"));
            assert!(of_table == of_collection, "{name}");
        }
        let margin = files_of(&data.join("stars_10arcmin")).expect_err("refused").to_string();
        assert!(margin.contains("is margin; it must be object or source"), "{margin}");
    }
}

//! Catalogues in HATS, a folder of Parquet files by HEALPix cell (LSST Interdisciplinary Network, <https://hats.readthedocs.io>).
//!
//! `hats.properties` has lines `key=value`, among them the kind of the catalogue. `partition_info.csv` has the order `Norder` and the cell `Npix` of each
//! file, which is `dataset/Norder=K/Dir=D/Npix=N.parquet` with D = N rounded down to 10,000. Margin catalogues repeat stars of neighbouring cells, and index
//! catalogues have no stars: both are refused.

use std::path::{Path, PathBuf};

use super::error::DeepError;
use crate::files;

/// Name of the file that makes a folder a catalogue.
const PROPERTIES: &str = "hats.properties";
/// Kinds of catalogues that have stars.
const KINDS: [&str; 2] = ["object", "source"];
/// Largest length of the two text files, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// Whether the path is the folder of a catalogue in HATS.
pub fn is_hats(path: &Path) -> bool {
    path.join(PROPERTIES).is_file()
}

/// The Parquet files of a catalogue, in the order of its list.
///
/// # Errors
/// The catalogue is of another kind, its list cannot be read, or a listed file is missing.
pub fn files_of(folder: &Path) -> Result<Vec<PathBuf>, DeepError> {
    let refuse = |path: &Path, problem: String| DeepError::Hats { path: path.to_owned(), problem };
    let text = |name: &str| {
        let path = folder.join(name);
        files::read_text_bounded(&path, MOST_BYTES).map_err(DeepError::io(&path)).map(|text| (path, text))
    };
    let (path, properties) = text(PROPERTIES)?;
    let lines = properties.lines().filter_map(|line| line.split_once('='));
    let kind = lines.map(|(key, value)| (key.trim(), value.trim())).find(|(key, _)| *key == "dataproduct_type");
    match kind {
        Some((_, kind)) if KINDS.contains(&kind) => {}
        found => {
            let found = found.map_or("missing", |(_, kind)| kind);
            let problem =
                format!("its dataproduct_type is {found}; it must be {}, whose rows are stars", KINDS.join(" or "));
            return Err(refuse(&path, problem));
        }
    }
    let (path, list) = text("partition_info.csv")?;
    let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(list.as_bytes());
    let damaged = |error: csv::Error| refuse(&path, error.to_string());
    let head = table.headers().map_err(damaged)?.clone();
    let column = |name: &str| {
        head.iter().position(|found| found == name).ok_or_else(|| refuse(&path, format!("it has no column {name}")))
    };
    let columns = [column("Norder")?, column("Npix")?];
    let mut found = Vec::new();
    for row in table.records() {
        let row = row.map_err(damaged)?;
        let [order, pixel] = columns.map(|column| row.get(column).and_then(|field| field.parse::<u64>().ok()));
        let (Some(order @ 0..=29), Some(pixel)) = (order, pixel) else {
            let line = row.position().map_or(0, csv::Position::line);
            return Err(refuse(&path, format!("line {line} has no cell; Norder must be 0 to 29, Npix a number")));
        };
        let directory = pixel / 10_000 * 10_000;
        let file = folder.join(format!("dataset/Norder={order}/Dir={directory}/Npix={pixel}.parquet"));
        if !file.is_file() {
            return Err(refuse(&file, "it is listed in partition_info.csv, and is missing".to_owned()));
        }
        found.push(file);
    }
    if found.is_empty() { Err(refuse(&path, "it lists no file".to_owned())) } else { Ok(found) }
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

    /// A catalogue with the files 5 and 12345 of order 5, of the northern and southern stars of a store.
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
        assert_eq!(report.catalogues.len(), 2);
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
        assert!(message().contains("Npix=5.parquet") && message().contains("is missing"));
        for (list, part) in
            [("Norder,Dir,Npix\n", "lists no file"), ("Norder,Npix\n5,x\n", "line 2"), ("a,b\n", "no column Norder")]
        {
            fs::write(catalogue.join("partition_info.csv"), list).expect("written");
            assert!(message().contains(part), "{}", message());
        }
        fs::write(catalogue.join(PROPERTIES), "dataproduct_type=margin\n").expect("written");
        assert!(message().contains("margin") && message().contains("object or source"));
    }
}

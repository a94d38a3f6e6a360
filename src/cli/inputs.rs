//! What pictures are made of: the configuration as used, and every file that it names, with its SHA-256.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::CliError;
use crate::config::{CatalogueConfig, Config};
use crate::files;
use crate::gpu::AdapterReport;
use crate::output::provenance::{InputFile, Provenance, UsedCatalogue, UsedConfiguration, UsedRow, told_path};
use crate::scene::Camera;
use crate::scene::asteroids::ShapeSet;
use crate::scene::loader::LoadReport;

/// A configuration and the files that its pictures depend on.
pub struct Inputs {
    /// The configuration.
    pub config: Config,
    /// The files, each once.
    paths: Vec<PathBuf>,
    /// The folder that is told as the one at which relative paths start.
    folder: PathBuf,
}

/// SHA-256, hexadecimal.
pub fn sha256(parts: &[&str]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        // The length first: no two lists of parts are the same bytes.
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part.as_bytes());
    }
    hexadecimal(hash)
}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Length and SHA-256 of a file.
fn digest(path: &Path) -> io::Result<(u64, String)> {
    let mut file = files::open_regular(path)?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 1 << 20];
    let mut bytes = 0;
    loop {
        match file.read(&mut block)? {
            0 => return Ok((bytes, hexadecimal(hash))),
            count => {
                hash.update(&block[..count]);
                bytes += count as u64;
            }
        }
    }
}

fn input(path: &Path, folder: &Path) -> Result<InputFile, CliError> {
    let read = |source| CliError::ReadInput { path: path.to_owned(), source };
    let (bytes, sha256) = digest(path).map_err(read)?;
    Ok(InputFile { file: told_path(path, folder), bytes, sha256 })
}

impl Inputs {
    /// Loads a file and applies overrides.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, CliError> {
        let (config, opened) = files::reading(|| Config::load(path, overrides));
        let opened: Vec<PathBuf> = opened.into_iter().filter(|file| file != path).collect();
        let config = config?;
        // What the program is given is told from the root, so that it leads to the files from anywhere.
        let folder = if config.folder.as_os_str().is_empty() { Path::new(".") } else { &config.folder };
        let folder = folder.canonicalize().map_err(|source| CliError::ReadInput { path: folder.to_owned(), source })?;
        Ok(Self::of(config, opened, folder))
    }

    /// What a picture was made of, again. `folder` is where relative paths start in place of the one that is told.
    ///
    /// # Errors
    ///
    /// A file is not what it was, which is found out before it is read; or the configuration is refused.
    pub fn again(told: &Provenance, origin: &str, folder: Option<&Path>) -> Result<Self, CliError> {
        let start = folder.unwrap_or(&told.configuration.folder);
        for expected in &told.files {
            let path = start.join(&expected.file);
            let found = input(&path, start)?;
            if (found.bytes, &found.sha256) != (expected.bytes, &expected.sha256) {
                return Err(CliError::OtherInput {
                    origin: origin.to_owned(),
                    path,
                    expected: expected.sha256.clone(),
                    found: found.sha256,
                });
            }
        }
        let read = || Config::from_text(&told.configuration.toml, origin, start, &[]);
        let (config, opened) = files::reading(read);
        Ok(Self::of(config?, opened, told.configuration.folder.clone()))
    }

    fn of(config: Config, opened: Vec<PathBuf>, folder: PathBuf) -> Self {
        let mut paths = config.named_files();
        paths.extend(opened);
        let shapes = config.shape_files();
        if !shapes.is_empty() {
            // What is wrong with one is told when it is loaded.
            let (_, opened) = files::reading(|| ShapeSet::from_gltf(&shapes).is_ok());
            paths.extend(opened);
        }
        paths.sort();
        paths.dedup();
        Self { config, paths, folder }
    }

    /// Every file that pictures depend on, by path: reads them all.
    pub fn files(&self) -> Result<Vec<InputFile>, CliError> {
        let files: Result<Vec<InputFile>, CliError> =
            self.paths.iter().map(|path| input(path, &self.config.folder)).collect();
        let mut files = files?;
        files.sort();
        files.dedup();
        Ok(files)
    }

    /// The configuration as it is used.
    pub fn configuration(&self) -> UsedConfiguration {
        UsedConfiguration { folder: self.folder.clone(), toml: self.config.pictured.clone() }
    }

    /// What became of the catalogues.
    pub fn catalogues(&self, report: &LoadReport) -> Vec<UsedCatalogue> {
        let told = self.config.scene.catalogues.iter().zip(&report.catalogues).map(|(configured, loaded)| {
            let rows = loaded.rows.as_ref();
            let first = rows.map(|rows| rows.first_rejected.as_slice()).unwrap_or_default();
            let row =
                |row: &crate::catalogue::reader::RejectedRow| UsedRow { line: row.line, reason: row.reason.clone() };
            UsedCatalogue {
                name: match configured {
                    CatalogueConfig::Named(name) => name.clone(),
                    CatalogueConfig::Light(light) => format!("light of {}", light.file.display()),
                    CatalogueConfig::Galaxy(_) => loaded.name.clone(),
                },
                stars: loaded.stars,
                rejected_rows: rows.map(|rows| rows.rejected),
                first_rejected: first.iter().map(row).collect(),
            }
        });
        told.collect()
    }

    /// All that a picture is made of.
    pub fn provenance(
        &self,
        adapter: &AdapterReport,
        camera: &Camera,
        time_s: f64,
        report: &LoadReport,
    ) -> Result<Provenance, CliError> {
        Ok(Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            adapter: adapter.adapter.clone(),
            driver: adapter.driver.clone(),
            configuration: self.configuration(),
            camera: camera.into(),
            time_s_since_j2000: time_s,
            catalogues: self.catalogues(report),
            files: self.files()?,
        })
    }
}

//! Inputs of pictures: the effective configuration, and every file that it names with its SHA-256.

use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::CliError;
use crate::config::{CatalogueConfig, Config};
use crate::files;
use crate::gpu::AdapterReport;
use crate::output::provenance::{InputFile, Provenance, UsedCatalogue, UsedConfiguration, recorded_path};
use crate::scene::Camera;
use crate::scene::asteroids::ShapeSet;
use crate::scene::loader::LoadReport;

/// A configuration and the files that its pictures depend on.
pub struct Inputs {
    /// The configuration.
    pub config: Config,
    /// The files, each listed once.
    paths: Vec<PathBuf>,
    /// Folder that is recorded as the base of relative paths.
    folder: PathBuf,
}

/// SHA-256, hexadecimal.
pub fn sha256(parts: &[&str]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        // Hash the length of each part first, so that different lists of parts never give the same bytes.
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part.as_bytes());
    }
    files::hexadecimal(&hash.finalize())
}

/// SHA-256 of a file, hexadecimal.
pub fn file_sha256(path: &Path) -> io::Result<String> {
    files::sha256_of_file(path).map(|(_, sha256)| sha256)
}

fn input(path: &Path, folder: &Path) -> Result<InputFile, CliError> {
    let read = |source| CliError::ReadInput { path: path.to_owned(), source };
    let (bytes, sha256) = files::sha256_of_file(path).map_err(read)?;
    Ok(InputFile { file: recorded_path(path, folder), bytes, sha256 })
}

impl Inputs {
    /// Loads a file and applies overrides.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, CliError> {
        let (config, opened) = files::reading(|| Config::load(path, overrides));
        let opened: Vec<PathBuf> = opened.into_iter().filter(|file| file != path).collect();
        let config = config?;
        // Record an absolute folder, so that the paths lead to the files from anywhere.
        let folder = if config.folder.as_os_str().is_empty() { Path::new(".") } else { &config.folder };
        let folder = folder.canonicalize().map_err(|source| CliError::ReadInput { path: folder.to_owned(), source })?;
        Ok(Self::new(config, opened, folder))
    }

    /// Loads the recorded inputs of a picture again. `folder`, if given, replaces the recorded base of relative paths.
    ///
    /// # Errors
    ///
    /// A file differs from the recorded one (this is checked before the file is interpreted), or the configuration is invalid.
    pub fn again(recorded: &Provenance, origin: &str, folder: Option<&Path>) -> Result<Self, CliError> {
        Self::of_record(&recorded.configuration, &recorded.files, origin, folder)
    }

    /// Does the same as [`Self::again`], with only the recorded configuration and the list of files.
    pub fn of_record(
        configuration: &UsedConfiguration,
        files_then: &[InputFile],
        origin: &str,
        folder: Option<&Path>,
    ) -> Result<Self, CliError> {
        let start = folder.unwrap_or(&configuration.folder);
        for expected in files_then {
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
        let read = || Config::from_text(&configuration.toml, origin, start, &[]);
        let (config, opened) = files::reading(read);
        Ok(Self::new(config?, opened, configuration.folder.clone()))
    }

    fn new(config: Config, opened: Vec<PathBuf>, folder: PathBuf) -> Self {
        let mut paths = config.named_files();
        paths.extend(opened);
        let shapes = config.shape_files();
        if !shapes.is_empty() {
            // Errors of a shape file are reported when it is loaded.
            let (_, opened) = files::reading(|| ShapeSet::from_gltf(&shapes).is_ok());
            paths.extend(opened);
        }
        paths.sort();
        paths.dedup();
        Self { config, paths, folder }
    }

    /// Reads every file that pictures depend on, and returns the length and the hash of each, sorted by path.
    pub fn files(&self) -> Result<Vec<InputFile>, CliError> {
        let files: Result<Vec<InputFile>, CliError> =
            self.paths.iter().map(|path| input(path, &self.config.folder)).collect();
        let mut files = files?;
        files.sort();
        files.dedup();
        Ok(files)
    }

    /// Returns the length and the hash of a file that pictures do not depend on directly, such as a film's path.
    pub fn source(&self, path: &Path) -> Result<InputFile, CliError> {
        let read = |source| CliError::ReadInput { path: path.to_owned(), source };
        input(&path.canonicalize().map_err(read)?, &self.folder)
    }

    /// Returns the configuration in effect.
    pub fn configuration(&self) -> UsedConfiguration {
        UsedConfiguration { folder: self.folder.clone(), toml: self.config.pictured.clone() }
    }

    /// Returns the load results of the catalogues.
    pub fn catalogues(&self, report: &LoadReport) -> Vec<UsedCatalogue> {
        let catalogues = self.config.scene.catalogues.iter().zip(&report.catalogues).map(|(configured, loaded)| {
            let rows = loaded.rows.as_ref();
            UsedCatalogue {
                name: match configured {
                    CatalogueConfig::Named(name) => name.clone(),
                    CatalogueConfig::Light(light) => format!("light of {}", light.file.display()),
                    CatalogueConfig::Galaxy(_) => loaded.name.clone(),
                },
                stars: loaded.stars,
                rejected_rows: rows.map(|rows| rows.rejected),
                first_rejected: rows.map(|rows| rows.first_rejected.clone()).unwrap_or_default(),
            }
        });
        catalogues.collect()
    }

    /// Returns the complete provenance of a picture.
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

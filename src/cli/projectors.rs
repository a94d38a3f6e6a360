//! `projectors`: converts the files of projector installers to configurations.

use std::{
    collections::BTreeMap,
    ffi::{OsStr, OsString},
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use clap::{Args, Subcommand};
use glam::DVec3;
use toml::{Table, Value};

use super::{CliError, output::refuse_own_input, results};
use crate::{
    config::{Config, ConfigError},
    files::{folder_of, reading, write_whole},
    theatre::{Axes, Calibration, ReadOptions, RowOrder, plain_name, read},
};

/// Arguments of `projectors`.
#[derive(Debug, Args)]
pub struct ProjectorsArguments {
    #[command(subcommand)]
    command: ProjectorsCommand,
}

#[derive(Debug, Subcommand)]
enum ProjectorsCommand {
    /// Write a configuration with one view for each projector in an installer's files.
    Import(ImportArguments),
}

/// Arguments of `projectors import`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian projectors import dome.mpcdi --out dome.toml\n  \
    steradian projectors import left.data right.data --size 1920x1200 --blend computed --out dome.toml\n\n\
    The views refer to the files in their present place, and every key with an effect is written out. Comments list which values the\n\
    files leave open and which were assumed. Warps that fold are refused. `test_pattern = true` of a view draws a pattern for aligning its projector.")]
struct ImportArguments {
    /// MPCDI, SGCT JSON, meshes, or directions as PFM or OpenEXR; recognised by content.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The configuration to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    overwrite: bool,
    /// Width and height of the rasters if the files have none.
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true)]
    size: Option<[u32; 2]>,
    /// Order of the rows, top_first or bottom_first, if it differs from the order that the format defines. Refused for files without rows.
    #[arg(long, value_name = "ORDER", value_parser = ["as_format", "top_first", "bottom_first"], default_value = "as_format")]
    rows: String,
    /// Axes of the files, as x=x,y=z,z=-y. Refused for SGCT and meshes.
    #[arg(long, value_name = "AXES", allow_hyphen_values = true)]
    axes: Option<String>,
    /// Position of the spectator, m: right, up, backwards, such as 0,1.2,0. Refused if the directions do not depend on it.
    #[arg(long, value_name = "X,Y,Z", value_parser = eye, allow_hyphen_values = true)]
    eye_m: Option<[f64; 3]>,
    /// Field of view of the fisheye picture that meshes sample, degrees. Refused if a file defines it.
    #[arg(long, value_name = "DEG", default_value_t = 180.0, allow_negative_numbers = true)]
    fov_deg: f64,
    /// Tilt of that fisheye, degrees. For a dome of projectors use --dome-tilt-deg.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    tilt_deg: f64,
    /// Tilt of the dome, degrees: how far its zenith leans to the front. Turns all projectors together, as `tilt_deg` turns a domemaster.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    dome_tilt_deg: f64,
    /// Source of the blend: file, computed or none.
    #[arg(long, value_name = "WHICH", value_parser = ["file", "computed", "none"], default_value = "file")]
    blend: String,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').map(|(width, height)| [width.parse(), height.parse()]);
    match sides {
        Some([Ok(width), Ok(height)]) => Ok([width, height]),
        _ => Err("must be width x height in pixels, such as 1920x1080".to_owned()),
    }
}

fn eye(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let numbers = numbers.ok().filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    numbers
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .ok_or_else(|| "must be three finite numbers separated by commas, such as 0,1.2,0".to_owned())
}

/// Runs the command.
pub fn run(arguments: &ProjectorsArguments) -> Result<(), CliError> {
    let ProjectorsCommand::Import(arguments) = &arguments.command;
    if !(-180.0..=180.0).contains(&arguments.dome_tilt_deg) {
        let problem = format!("--dome-tilt-deg {}: must be between -180 and 180", arguments.dome_tilt_deg);
        return Err(CliError::Usage(problem));
    }
    let options = options(arguments)?;
    check_out(arguments)?;
    let folder = folder_of(&arguments.out);
    let mut text = "# Projectors, imported from the installer's files.\n".to_owned();
    if arguments.dome_tilt_deg != 0.0 {
        let tilt_deg = arguments.dome_tilt_deg;
        let _ = writeln!(
            text,
            "# The dome's zenith leans {tilt_deg} degrees to the front: every view has that orientation."
        );
    }
    let mut names = BTreeMap::new();
    for file in &arguments.files {
        let (calibration, opened) = reading(|| read(file, &options));
        // Nor may the output replace the meshes and masks that the file refers to.
        refuse_own_input(&arguments.out, opened.iter().map(PathBuf::as_path))?;
        let calibration = calibration?;
        let place =
            relative(file, folder).map_err(|source| CliError::WriteFile { path: arguments.out.clone(), source })?;
        add(&mut text, &calibration, &place, arguments, &mut names);
    }
    // Check that the written configuration can be drawn.
    let origin = arguments.out.display().to_string();
    let config = Config::from_text(&text, &origin, folder, &[]).map_err(of_file)?;
    let rig = config.rig().map_err(of_file)?;
    write_whole(&arguments.out, text.as_bytes())
        .map_err(|source| CliError::WriteFile { path: arguments.out.clone(), source })?;
    for view in rig.views() {
        let [width, height] = view.output_size(&view.images[0]);
        results::line(format!("{}: {width} x {height} pixels", view.name))?;
    }
    results::line(format!("{} projectors in {origin}", rig.views().len()))
}

/// Refuses to replace a file, which may have been edited, unless the user requests it.
fn check_out(arguments: &ImportArguments) -> Result<(), CliError> {
    if arguments.out.is_dir() {
        return Err(CliError::Usage(format!(
            "--out {}: this is a folder: must be the name of a file",
            arguments.out.display()
        )));
    }
    refuse_own_input(&arguments.out, arguments.files.iter().map(PathBuf::as_path))?;
    if !arguments.overwrite && fs::symlink_metadata(&arguments.out).is_ok() {
        return Err(CliError::Usage(format!(
            "--out {}: the file exists: choose another file, or replace it with --overwrite",
            arguments.out.display()
        )));
    }
    Ok(())
}

/// Converts an error of the written configuration. If a calibration is at fault, the message names the calibration file instead of the configuration.
fn of_file(error: ConfigError) -> CliError {
    match error {
        ConfigError::Key { key, problem, .. } if key.contains("].file ") || key.ends_with("].file") => {
            CliError::Calibration(problem)
        }
        error => CliError::Config(error),
    }
}

fn options(arguments: &ImportArguments) -> Result<ReadOptions, CliError> {
    let axes = arguments.axes.as_deref().map_or(Ok(Axes::AsFormat), Axes::parse);
    let rows = match arguments.rows.as_str() {
        "top_first" => RowOrder::TopFirst,
        "bottom_first" => RowOrder::BottomFirst,
        _ => RowOrder::AsFormat,
    };
    Ok(ReadOptions {
        region: None,
        size_px: arguments.size,
        rows,
        axes: axes.map_err(|problem| CliError::Usage(format!("--axes: {problem}")))?,
        eye_m: arguments.eye_m.map_or(DVec3::ZERO, DVec3::from_array),
        fov_deg: arguments.fov_deg,
        tilt_deg: arguments.tilt_deg,
    })
}

/// Returns the path relative to the folder if the file is below it, otherwise the absolute path.
fn relative(file: &Path, folder: &Path) -> std::io::Result<PathBuf> {
    let file = fs::canonicalize(file)?;
    let folder = fs::canonicalize(folder)?;
    Ok(file.strip_prefix(&folder).map(Path::to_owned).unwrap_or(file))
}

/// Adds one view for each region.
fn add(
    text: &mut String,
    calibration: &Calibration,
    file: &Path,
    arguments: &ImportArguments,
    names: &mut BTreeMap<String, usize>,
) {
    let _ = writeln!(text, "\n# {}: {}. Assumed:", file.display(), calibration.format);
    for note in &calibration.notes {
        let _ = writeln!(text, "# - {note}");
    }
    for region in &calibration.regions {
        let mut view = Table::new();
        let mut set = |key: &str, value: Value| view.insert(key.to_owned(), value);
        set("name", Value::from(unique(region.title.as_ref().unwrap_or(&region.name), names)));
        set("type", Value::from("projector"));
        set("file", Value::from(file.to_string_lossy().into_owned()));
        set("region", Value::from(region.name.clone()));
        set("method", Value::from("direct"));
        // Set only keys that have an effect: others would be refused.
        if region.uses.rows {
            set("rows", Value::from(arguments.rows.clone()));
        }
        if let Some(axes) = arguments.axes.as_ref().filter(|_| region.uses.axes) {
            set("axes", Value::from(axes.clone()));
        }
        if region.uses.eye {
            set("eye_m", Value::from(arguments.eye_m.unwrap_or_default().to_vec()));
        }
        if region.uses.fisheye {
            set("fov_deg", Value::from(arguments.fov_deg));
            set("tilt_deg", Value::from(arguments.tilt_deg));
        }
        if arguments.dome_tilt_deg != 0.0 {
            let half_rad = 0.5 * arguments.dome_tilt_deg.to_radians();
            set("orientation", Value::from(vec![-half_rad.sin(), 0.0, 0.0, half_rad.cos()]));
        }
        if let Some(size) = arguments.size {
            set("size", Value::from(size.map(i64::from).to_vec()));
        }
        set("blend", Value::from(arguments.blend.clone()));
        let _ = write!(text, "\n[[views]]\n{view}");
    }
}

/// Returns a unique view name for a region, with only letters, digits, `_` and `-`.
fn unique(region: &str, names: &mut BTreeMap<String, usize>) -> String {
    let name = plain_name(region);
    let count = names.entry(name.clone()).or_default();
    *count += 1;
    if *count == 1 { name } else { unique(&format!("{name}_{count}"), names) }
}

/// Returns the words of the command line, with `--eye-m X Y Z` rewritten as `--eye-m X,Y,Z`: both forms are valid. In the form with blanks, clap
/// would take a file name that follows for a fourth number.
pub fn with_joined_eye(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = words.collect();
    let is_number = |word: &OsString| word.to_str().is_some_and(|text| text.parse::<f64>().is_ok());
    if let Some(option) = words.iter().position(|word| word == "--eye-m")
        && let Some(numbers) = words.get(option + 1..option + 4).filter(|numbers| numbers.iter().all(is_number))
    {
        let joined = numbers.join(OsStr::new(","));
        words.splice(option + 1..option + 4, [joined]);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_eye_may_be_given_with_blanks_or_commas() {
        let joined = |line: &str| {
            let words = with_joined_eye(line.split(' ').map(OsString::from));
            words.join(OsStr::new(" ")).into_string().unwrap_or_default()
        };
        for (line, expected) in [
            ("import --eye-m 0 1.2 -3 a.mpcdi --out o", "import --eye-m 0,1.2,-3 a.mpcdi --out o"),
            ("import --eye-m 0,1.2,0 a.mpcdi", "import --eye-m 0,1.2,0 a.mpcdi"),
            ("import --eye-m 0 1.2 a.mpcdi", "import --eye-m 0 1.2 a.mpcdi"),
            ("import a.mpcdi --eye-m 1", "import a.mpcdi --eye-m 1"),
        ] {
            assert_eq!(joined(line), expected);
        }
        // A word that begins with a negative number is not taken for an option.
        let parse = |words: &[&str]| <crate::cli::Cli as clap::Parser>::try_parse_from(words).is_ok();
        let words = |eye| ["steradian", "projectors", "import", "a.mpcdi", "--eye-m", eye, "--out", "o.toml"];
        assert!(parse(&words("-0.5,1.2,-3")) && parse(&words("0,1.2,0")) && !parse(&words("-0.5,1.2")));
        for wrong in ["0,1", "0,1,2,3", "a,b,c", "0,inf,0", ""] {
            assert!(eye(wrong).is_err(), "{wrong}");
        }
        assert_eq!(eye("0, 1.2,-3"), Ok([0.0, 1.2, -3.0]));
    }
}

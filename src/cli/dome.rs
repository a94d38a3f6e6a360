//! `dome`: judges the projectors of a dome.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use clap::{Args, Subcommand};
use glam::DQuat;

use super::{CliError, results};
use crate::{
    config::{Config, DomeFault, DomeProjector, ViewKindConfig},
    theatre::check::{Dome, DomeReport, Finding, MapPoint, Projector, check},
    view::{ViewKind, projection::PlaneMapping},
};

/// Arguments of `dome`.
#[derive(Debug, Args)]
pub struct DomeArguments {
    #[command(subcommand)]
    command: DomeCommand,
}

#[derive(Debug, Subcommand)]
enum DomeCommand {
    /// Judge the warps and blends of all projectors of a configuration.
    Check(CheckArguments),
}

/// Arguments of `dome check`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian dome check --config dome.toml\n  \
    steradian dome check --config dome.toml --dome-tilt-deg 20 --html dome.html --json dome.json\n\n\
    A line per rule: its name, pass or FAIL, the projector, what was found and what is allowed. Exit code 1 if a rule fails.\n\
    The dome is that of the first view of the type dome_master, unless it is given.")]
struct CheckArguments {
    /// The configuration: TOML.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Angle across the dome, degrees.
    #[arg(long, value_name = "DEG")]
    dome_fov_deg: Option<f64>,
    /// Tilt of the dome towards the front, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    dome_tilt_deg: Option<f64>,
    /// Write the results to a file as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page with pictures.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Runs the command.
pub fn run(arguments: &DomeArguments) -> Result<(), CliError> {
    let DomeCommand::Check(arguments) = &arguments.command;
    let config = Config::load_unbuilt(&arguments.config, &arguments.set)?;
    let dome = dome_of(&config, arguments)?;
    let (found, faults) = config.dome_projectors()?;
    if found.is_empty() && faults.is_empty() {
        return Err(CliError::Usage(format!("{}: no view has the type projector", arguments.config.display())));
    }
    let projectors: Vec<Projector<'_>> = found.iter().filter_map(projector).collect();
    let mut report = check(dome, &projectors);
    let of_fault = |fault: DomeFault| Finding {
        rule: if fault.folds { "folds" } else { "reads" },
        projector: Some(fault.name),
        passed: false,
        what: fault.problem,
    };
    report.findings.extend(faults.into_iter().map(of_fault));
    print(&report)?;
    let write = |path: &Path, text: String| {
        fs::write(path, text).map_err(|source| CliError::WriteFile { path: path.to_owned(), source })
    };
    if let Some(path) = &arguments.json {
        write(path, serde_json::to_string_pretty(&report).map_err(CliError::Json)? + "\n")?;
    }
    if let Some(path) = &arguments.html {
        write(path, page(&report))?;
    }
    let failed = report.findings.iter().filter(|finding| !finding.passed).count();
    if failed == 0 { Ok(()) } else { Err(CliError::Checks { failed, of: report.findings.len() }) }
}

fn dome_of(config: &Config, arguments: &CheckArguments) -> Result<Dome, CliError> {
    let master = config.views.iter().find_map(|view| match &view.kind {
        ViewKindConfig::DomeMaster(master) => Some(master),
        _ => None,
    });
    let fov_deg = arguments.dome_fov_deg.or(master.map(|master| master.fov_deg)).unwrap_or(180.0);
    let tilt_deg = arguments.dome_tilt_deg.or(master.map(|master| master.tilt_deg)).unwrap_or(0.0);
    if !(fov_deg > 0.0 && fov_deg <= 360.0) {
        return Err(CliError::Usage(format!("--dome-fov-deg {fov_deg}: allowed are angles above 0 up to 360")));
    }
    if !(-180.0..=180.0).contains(&tilt_deg) {
        return Err(CliError::Usage(format!("--dome-tilt-deg {tilt_deg}: allowed are -180 to 180")));
    }
    Ok(Dome { fov_deg, tilt_deg })
}

fn projector(of: &DomeProjector) -> Option<Projector<'_>> {
    let DomeProjector { view, screen, dimmed_to } = of;
    let ViewKind::Projector { mapping, output } = &view.kind else { return None };
    let image = view.images.first()?;
    let mapping: &dyn PlaneMapping = mapping.as_ref();
    let view_from_picture = output.resampling().map_or(DQuat::IDENTITY, |resampling| resampling.view_from_source);
    let dome_from_view = image.camera_from_view * view_from_picture.inverse();
    Some(Projector {
        name: &view.name,
        mapping,
        dome_from_view,
        blend: output.blend(),
        dimmed_to: *dimmed_to,
        screen: screen.as_ref(),
    })
}

fn print(report: &DomeReport) -> Result<(), CliError> {
    let DomeReport { dome, coverage, blend_sum, projectors, findings, .. } = report;
    results::line(format!(
        "dome of {} degrees, tilted by {}: {:.2} % has light, {:.2} % of two projectors or more",
        dome.fov_deg,
        dome.tilt_deg,
        100.0 * coverage[0],
        100.0 * coverage[1]
    ))?;
    results::line(format!(
        "shares of light add up to {:.3} (1 %), {:.3} (median), {:.3} (99 %)",
        blend_sum[0], blend_sum[1], blend_sum[2]
    ))?;
    for projector in projectors {
        let [fine, median, coarse] = projector.arcmin_per_pixel;
        results::line(format!(
            "{}: {:.2} % of the dome, {fine:.2} to {coarse:.2} arcminutes per pixel (5 and 95 %), median {median:.2}",
            projector.name,
            100.0 * projector.coverage
        ))?;
    }
    for finding in findings {
        let (of, outcome) = (finding.of(), finding.outcome());
        results::line(format!("{:10} {outcome} {of}: {}", finding.rule, finding.what))?;
    }
    Ok(())
}

/// A page with the findings and three maps of the dome.
fn page(report: &DomeReport) -> String {
    let mut rows = String::new();
    for finding in &report.findings {
        let (of, outcome) = (finding.of(), finding.outcome());
        let _ = writeln!(
            rows,
            "<tr class={outcome}><td>{}<td>{of}<td>{outcome}<td>{}",
            finding.rule,
            escaped(&finding.what)
        );
    }
    let coarsest =
        report.map.iter().filter(|point| point.projectors > 0).map(|point| point.arcmin).fold(1e-9, f64::max);
    let maps = [
        (
            "Projectors: dark none, blue one, green two, yellow three or more",
            map(report, |point| ["#222", "#36c", "#3a6", "#dc3"][point.projectors.min(3)].to_owned()),
        ),
        ("Sum of the shares of light: black 0, grey 1, white 2 and more", map(report, |point| grey(0.5 * point.sum))),
        (
            "Size of the finest pixel: black none, white the coarsest",
            map(
                report,
                |point| if point.projectors == 0 { grey(0.0) } else { grey(0.15 + 0.85 * point.arcmin / coarsest) },
            ),
        ),
    ];
    let figures: String =
        maps.iter().map(|(title, map)| format!("<figure>{map}<figcaption>{title}</figcaption></figure>\n")).collect();
    format!(
        "<!doctype html><meta charset=utf-8><title>Dome check</title>\n<style>body{{font:15px sans-serif;background:#111;color:#ddd;margin:2em}}\
         td{{padding:.2em .8em;border-top:1px solid #444}}.FAIL td{{color:#f86}}figure{{display:inline-block;width:24em;margin:1em}}</style>\n\
         <h1>Dome check</h1>\n<p>The dome has {} degrees and is tilted by {}. {:.2} % of it has light. In the maps the front is at the bottom.</p>\n\
         <table>\n{rows}</table>\n{figures}",
        report.dome.fov_deg,
        report.dome.tilt_deg,
        100.0 * report.coverage[0]
    )
}

fn grey(share: f64) -> String {
    let code = (255.0 * share.clamp(0.0, 1.0)).round() as u8;
    format!("#{code:02x}{code:02x}{code:02x}")
}

fn map(report: &DomeReport, colour: impl Fn(&MapPoint) -> String) -> String {
    let mut dots = String::new();
    for point in &report.map {
        let _ = write!(
            dots,
            "<circle cx={:.1} cy={:.1} r=2.2 fill=\"{}\"/>",
            200.0 + 198.0 * point.place.x,
            200.0 - 198.0 * point.place.y,
            colour(point)
        );
    }
    format!("<svg viewBox=\"0 0 400 400\">{dots}</svg>")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

//! `dome`: checks the projectors of a dome.

use std::{
    fs,
    path::{Path, PathBuf},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use clap::{Args, Subcommand};
use png::{BitDepth, ColorType};

use super::{CliError, output::refuse_own_input, results};
use crate::{
    config::{Config, DomeFault, DomeProjector, ViewKindSpec},
    files::reading,
    output::{OutputError, png_of},
    photometry::{
        rec709::luminance,
        tone_map::{linear_from_srgb, srgb_from_linear},
    },
    picture_file::PictureFile,
    theatre::check::{
        CrossReflection, Dome, DomeReport, Finding, GreyedPicture, MapPoint, Projector, ProjectorFigures, check,
    },
};

/// Arguments of `dome`.
#[derive(Debug, Args)]
pub struct DomeArguments {
    #[command(subcommand)]
    command: DomeCommand,
}

#[derive(Debug, Subcommand)]
enum DomeCommand {
    /// Check the warps and blends of all projectors of a configuration.
    Check(CheckArguments),
}

/// Arguments of `dome check`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian dome check --config dome.toml\n  \
    steradian dome check --config dome.toml --dome-tilt-deg 20 --html dome.html --json dome.json\n  \
    steradian dome check --config dome.toml --reflectivity 0.45 --picture tonight.png\n\n\
    Prints one line per rule: its name, pass or FAIL, the projector, the measured value and the limit. Exit code 1 if a rule fails.\n\
    Unless options give the dome, it is taken from the first view of the type dome_master.")]
struct CheckArguments {
    /// Configuration file, TOML.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Angle across the dome, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    dome_fov_deg: Option<f64>,
    /// Tilt of the dome towards the front, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    dome_tilt_deg: Option<f64>,
    /// Share of the light that the dome's screen reflects. With it, the results include how much cross-reflection brightens the sky.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    reflectivity: Option<f64>,
    /// Domemaster (PNG) for which cross-reflection is computed, with that reflectivity.
    #[arg(long, value_name = "FILE", requires = "reflectivity")]
    picture: Option<PathBuf>,
    /// Write the results to a file as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write an HTML page with maps of the dome.
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
    let (loaded, calibrations) = reading(|| config.dome_projectors());
    check_outputs(arguments, &calibrations)?;
    let (found, faults) = loaded?;
    if found.is_empty() && faults.is_empty() {
        return Err(CliError::Usage(format!("{}: no view has the type projector", arguments.config.display())));
    }
    let projectors: Vec<Projector<'_>> = found.iter().filter_map(projector).collect();
    let cross_reflection = cross_reflection(dome, arguments)?;
    let mut report = DomeReport { cross_reflection, ..check(dome, &projectors) };
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
        write(path, page(&report)?)?;
    }
    let failed = report.findings.iter().filter(|finding| !finding.passed).count();
    if failed == 0 { Ok(()) } else { Err(CliError::Checks { failed, total: report.findings.len() }) }
}

/// Refuses output files that would replace an input or each other.
fn check_outputs(arguments: &CheckArguments, calibrations: &[PathBuf]) -> Result<(), CliError> {
    let CheckArguments { config, picture, json, html, .. } = arguments;
    for out in json.iter().chain(html) {
        let inputs = [config].into_iter().chain(picture).chain(calibrations);
        refuse_own_input(out, inputs.map(PathBuf::as_path))?;
    }
    match (json, html) {
        (Some(json), Some(html)) if json == html => Err(CliError::Usage(format!(
            "--json and --html are both {}: the page would replace the results; give each its own file",
            json.display()
        ))),
        _ => Ok(()),
    }
}

fn dome_of(config: &Config, arguments: &CheckArguments) -> Result<Dome, CliError> {
    let master = config.views.iter().find_map(|view| match &view.geometry.kind {
        ViewKindSpec::DomeMaster(master) => Some(master),
        _ => None,
    });
    let fov_deg = arguments.dome_fov_deg.or(master.map(|master| master.fov_deg)).unwrap_or(180.0);
    let tilt_deg = arguments.dome_tilt_deg.or(master.map(|master| master.tilt_deg)).unwrap_or(0.0);
    if !(fov_deg > 0.0 && fov_deg <= 360.0) {
        return Err(CliError::Usage(format!("--dome-fov-deg {fov_deg}: must be an angle above 0 and at most 360")));
    }
    if !(-180.0..=180.0).contains(&tilt_deg) {
        return Err(CliError::Usage(format!("--dome-tilt-deg {tilt_deg}: must be between -180 and 180")));
    }
    Ok(Dome { fov_deg, tilt_deg })
}

/// Computes cross-reflection if `--reflectivity` is given.
fn cross_reflection(dome: Dome, arguments: &CheckArguments) -> Result<Option<CrossReflection>, CliError> {
    let Some(reflectivity) = arguments.reflectivity else { return Ok(None) };
    if !(0.0..1.0).contains(&reflectivity) {
        return Err(CliError::Usage(format!(
            "--reflectivity {reflectivity}: must be a share of at least 0 and below 1"
        )));
    }
    let found = CrossReflection::new(dome, reflectivity);
    let Some(path) = &arguments.picture else { return Ok(Some(found)) };
    let wanted = "a domemaster must be a square PNG with 8 bits per channel";
    let picture = PictureFile::read(path, wanted).map_err(|error| CliError::Usage(format!("--picture {error}")))?;
    let [width, height] = picture.size;
    if width != height {
        return Err(CliError::Usage(format!(
            "--picture {}: it has {width} x {height} pixels; {wanted}",
            path.display()
        )));
    }
    let linear: Vec<f64> = (0..=255).map(|code| linear_from_srgb(f64::from(code) / 255.0)).collect();
    let light = |texel: &[u8; 4]| luminance([0, 1, 2].map(|c| linear[usize::from(texel[c])]));
    let light: Vec<f64> = picture.rgba.iter().map(light).collect();
    Ok(Some(found.with_picture(dome, width, &light)))
}

/// Describes the effect of cross-reflection: one line for the dome, and one for the picture if there is one.
fn reflection_lines(found: &CrossReflection) -> Vec<String> {
    let CrossReflection { reflectivity, screen_share, gain, half_white_contrast, mean_ev, picture } = found;
    let mut lines = vec![format!(
        "cross-reflection: a screen of reflectivity {reflectivity} that covers {screen_share:.3} of the sphere adds {gain:.3} of the mean light everywhere; \
         a picture half white and half black has a contrast of {half_white_contrast:.1}; EV +{mean_ev:.2} keeps the mean light"
    )];
    if let Some(GreyedPicture { mean, median, grey, median_ev }) = picture {
        let code = |light: f64| 255.0 * srgb_from_linear(light);
        let compensated = match median_ev {
            Some(ev) => format!("EV +{ev:.2} restores the median"),
            None => "no exposure restores the median".to_owned(),
        };
        lines.push(format!(
            "the picture has a mean of {mean:.5} of white and a median of {median:.5} (code {:.0}); the reflected light lifts black to {grey:.5} (code {:.0}) and the median to {:.5}: {compensated}",
            code(*median),
            code(*grey),
            median + grey
        ));
    }
    lines
}

fn projector(configured: &DomeProjector) -> Option<Projector<'_>> {
    let DomeProjector { view, screen, dimmed_to } = configured;
    let (mapping, dome_from_view) = view.raster()?;
    Some(Projector {
        name: &view.name,
        mapping: mapping.as_ref(),
        dome_from_view,
        blend: view.kind.projector()?.blend(),
        dimmed_to: *dimmed_to,
        screen: screen.as_ref(),
    })
}

fn print(report: &DomeReport) -> Result<(), CliError> {
    let DomeReport { dome, coverage, blend_sum, projectors, findings, .. } = report;
    results::line(format!(
        "dome of {} degrees, tilted by {}: {:.2} % is lit, {:.2} % by two or more projectors",
        dome.fov_deg,
        dome.tilt_deg,
        100.0 * coverage[0],
        100.0 * coverage[1]
    ))?;
    results::line(format!(
        "masks add up to {:.3} (1st percentile of the lit dome), {:.3} (median), {:.3} (99th percentile); 1 is right",
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
    for line in report.cross_reflection.iter().flat_map(reflection_lines) {
        results::line(line)?;
    }
    for finding in findings {
        let (subject, outcome) = (finding.subject(), finding.outcome());
        results::line(format!("{:10} {outcome} {subject}: {}", finding.rule, finding.what))?;
    }
    Ok(())
}

/// Returns the HTML page. It has the failed rules first, then the figures of the projectors and three maps of the dome.
fn page(report: &DomeReport) -> Result<String, CliError> {
    let (kept, broken): (Vec<&Finding>, Vec<&Finding>) = report.findings.iter().partition(|finding| finding.passed);
    let outcome = match broken.len() {
        0 => "All rules pass.".to_owned(),
        failed => format!("{failed} rules fail; they are listed first."),
    };
    let rows: String = broken.into_iter().chain(kept).map(finding_row).collect();
    let figures: String = report.projectors.iter().map(figures_row).collect();
    let lit = report.map.points.iter().flatten().filter(|point| point.projectors > 0);
    let [finest, coarsest] =
        lit.fold([f64::INFINITY, 0.0], |[least, most], point| [point.arcmin.min(least), point.arcmin.max(most)]);
    let share_of_range = |arcmin: f64| (arcmin - finest) / (coarsest - finest).max(1e-9);
    let maps = [
        (
            "Number of projectors: dark for none, blue for one, green for two, yellow for three, orange for more".to_owned(),
            map(report, |point| {
                [[34; 3], [51, 102, 204], [51, 170, 102], [221, 204, 51], [230, 130, 40]][point.projectors.min(4)]
            })?,
        ),
        (
            "Sum of the shares of light: grey for 1, blue for less, red for more (full colour: 10 % off), black for no light".to_owned(),
            map(report, |point| {
                let off = ((point.sum - 1.0) / 0.1).clamp(-1.0, 1.0);
                let [red, blue] = [off.max(0.0), (-off).max(0.0)];
                let [base, rest] = [128.0, 1.0 - off.abs()];
                if point.projectors == 0 {
                    [0; 3]
                } else {
                    [base * rest + 255.0 * red, base * rest, base * rest + 255.0 * blue].map(|code| code as u8)
                }
            })?,
        ),
        (
            format!("Finest pixel size: dark for {finest:.1} arcminutes, light for {coarsest:.1} arcminutes, black for no pixel"),
            map(report, |point| match point.projectors {
                0 => [0; 3],
                _ => [(60.0 + 180.0 * share_of_range(point.arcmin)) as u8; 3],
            })?,
        ),
    ];
    let lines = report.cross_reflection.iter().flat_map(reflection_lines);
    let reflection: String = lines.map(|line| format!("<p>{}\n", escaped(&line))).collect();
    let maps: String =
        maps.iter().map(|(title, map)| format!("<figure>{map}<figcaption>{title}</figcaption></figure>\n")).collect();
    Ok(format!(
        "<!doctype html><meta charset=utf-8><title>Dome check</title>\n<style>body{{font:15px sans-serif;background:#111;color:#ddd;margin:2em}}\
         td,th{{padding:.2em .8em;border-top:1px solid #444;text-align:left}}.FAIL td{{color:#f86}}figure{{display:inline-block;vertical-align:top;width:24em;margin:1em}}\
         img{{width:100%}}</style>\n\
         <h1>Dome check</h1>\n<p>{outcome} The dome spans {} degrees and is tilted by {}. {:.2} % of it is lit, {:.2} % by two or more projectors. In the maps the front is at the bottom, as in a domemaster.</p>\n\
         {reflection}{maps}\n<table>\n<tr><th>rule<th>projector<th>outcome<th>finding\n{rows}</table>\n\
         <h2>Projectors</h2>\n<table>\n<tr><th>projector<th>share of the dome<th>arcminutes per pixel, 5 %<th>median<th>95 %\n{figures}</table>\n",
        report.dome.fov_deg,
        report.dome.tilt_deg,
        100.0 * report.coverage[0],
        100.0 * report.coverage[1],
    ))
}

fn finding_row(finding: &Finding) -> String {
    let (subject, outcome) = (finding.subject(), finding.outcome());
    format!("<tr class={outcome}><td>{}<td>{subject}<td>{outcome}<td>{}\n", finding.rule, escaped(&finding.what))
}

fn figures_row(projector: &ProjectorFigures) -> String {
    let [fine, median, coarse] = projector.arcmin_per_pixel;
    let coverage = 100.0 * projector.coverage;
    format!("<tr><td>{}<td>{coverage:.2} %<td>{fine:.2}<td>{median:.2}<td>{coarse:.2}\n", projector.name)
}

/// Encodes a map as an image embedded in the page.
fn map(report: &DomeReport, colour: impl Fn(&MapPoint) -> [u8; 3]) -> Result<String, CliError> {
    let side = report.map.side as u32;
    let pixels: Vec<u8> = report.map.points.iter().flat_map(|point| point.as_ref().map_or([17; 3], &colour)).collect();
    let bytes = png_of([side; 2], (ColorType::Rgb, BitDepth::Eight), &pixels).map_err(|source| {
        let path = "a map of the page".into();
        CliError::Output(OutputError::Encode { path, source })
    })?;
    let data = STANDARD.encode(&bytes);
    Ok(format!("<img alt=\"\" src=\"data:image/png;base64,{data}\">"))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

//! `render`: renders every view once into files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};

use super::{
    CliError, audits, explain,
    inputs::Inputs,
    load::{self, LoadedScene, PendingObjects},
    results,
};
use crate::audit::{AuditedScene, audit_into};
use crate::files;
use crate::gpu::{AdapterReport, Gpu, GpuOptions};
use crate::output::{check_folder, pack, provenance::Provenance, write_frames};
use crate::render::{Frame, FrameRequest, RenderError, Renderer, Wanted};
use crate::scene::SceneSnapshot;

/// Maximum size of a manifest, bytes.
const MOST_MANIFEST_BYTES: u64 = 256 << 20;

/// A kind of image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FileKind {
    /// Display images.
    Png,
    /// HDR images.
    Exr,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian render --config configs/dome.toml --out out\n  \
    steradian render --config configs/demo.toml --out out --set views.dome.size=[2048,2048] --set exposure.mode=manual\n  \
    steradian render --config configs/dome.toml --out out --files png --explain\n  \
    steradian render --from out/manifest.json --out again\n\n\
    Writes <view>.exr and <view>.png (with several images <view>.<part>.exr and .png), timings.json and manifest.json. An\n\
    image does not depend on which other files are written; an image that is not written is not drawn.\n\
    The key of --set is a dotted path; a view is named by its name or its index from 0. Values are TOML; a bare word is a\n\
    string. Relative paths of catalogues are relative to the folder of the configuration.")]
pub struct RenderArguments {
    /// The configuration.
    #[arg(long, value_name = "FILE", required_unless_present = "from")]
    config: Option<PathBuf>,
    /// Render the frame that a manifest describes again, without --config. Files that differ from the recorded ones are refused.
    #[arg(long, value_name = "MANIFEST", conflicts_with_all = ["config", "set"])]
    from: Option<PathBuf>,
    /// With --from: folder for relative paths, instead of the folder that the manifest names.
    #[arg(long, value_name = "DIR", requires = "from")]
    folder: Option<PathBuf>,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Images to write, separated by commas.
    #[arg(long, value_name = "KINDS", value_enum, value_delimiter = ',', default_value = "png,exr")]
    files: Vec<FileKind>,
    /// Print how each part was drawn, with the bound of every approximation.
    #[arg(long)]
    explain: bool,
}

/// Runs the command.
pub fn run(arguments: RenderArguments, options: &GpuOptions) -> Result<(), CliError> {
    // Check everything that can be refused before loading the stars, which takes longest.
    let recorded = arguments.from.as_deref().map(read_manifest).transpose()?;
    let inputs = match (&recorded, &arguments.config, &arguments.from) {
        (Some(recorded), _, Some(from)) => {
            Inputs::again(recorded, &from.display().to_string(), arguments.folder.as_deref())?
        }
        (_, Some(config), _) => Inputs::load(config, &arguments.set)?,
        // The parser requires one of them, and has already reported an error if both are missing.
        _ => return Err(CliError::Usage("render needs --config or --from".to_owned())),
    };
    let config = &inputs.config;
    let rig = config.rig()?;
    let camera = config.camera()?;
    if rig.views().is_empty() {
        return Err(CliError::Usage(format!("{}: views: at least one [[views]] is needed to render", config.origin)));
    }
    check_folder(&arguments.out)?;
    if config.accuracy.frame_ms.is_some() {
        tracing::info!(
            "{}: accuracy.frame_ms applies only to `serve`: files are always drawn at full quality",
            config.origin
        );
    }
    // Open the adapter and check that it can draw the views.
    let objects = PendingObjects::begin(config);
    let mut renderer = Renderer::new(Gpu::open(options)?);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &config.origin))?;

    if let Some(recorded) = &recorded {
        warn_of_differences(recorded, renderer.adapter());
    }
    // Load the scene and draw one frame per group of views.
    let groups = config.frame_groups()?;
    let wanted = Wanted {
        display: arguments.files.contains(&FileKind::Png),
        hdr: arguments.files.contains(&FileKind::Exr),
        ..Wanted::default()
    };
    let LoadedScene { stars, report, objects, prepared } =
        load::scene(config, objects, &groups, wanted, &mut renderer, None)?;
    prepared.map_err(|error| CliError::render(error, &config.origin))?;
    let snapshot = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera };
    let mut draw = |number: usize| -> Result<Frame, RenderError> {
        let mut frame = renderer.render(FrameRequest::for_group(&snapshot, &groups, number).wanted(wanted))?;
        if groups[number].settings.accuracy.audit {
            let scene = AuditedScene::for_group(&snapshot, &groups[number], false);
            audit_into(&scene, &mut frame, renderer.limits())?;
        }
        let mut frame = frame.with_views(&groups[number].views);
        frame.images = pack(&rig, frame.images);
        Ok(frame)
    };
    let frames: Result<Vec<Frame>, RenderError> = (0..groups.len()).map(&mut draw).collect();
    let frames = frames.map_err(|error| CliError::render(error, &config.origin))?;
    if arguments.explain {
        results::line(explain::text(&frames))?;
    }
    // Write the files and report failed audits.
    let log_written = |path: &Path| tracing::info!("wrote {}", path.display());
    let SceneSnapshot { camera, objects, .. } = &snapshot;
    let provenance = inputs.provenance(renderer.adapter(), camera, objects.time_s, &report)?;
    let written = std::thread::scope(|scope| {
        // Release the adapter's memory meanwhile.
        scope.spawn(move || drop(renderer));
        write_frames(&arguments.out, &rig, &frames, &provenance, &log_written)
    });
    for path in written? {
        results::line(path.display())?;
    }
    audits::check(&frames)
}

/// Reads the provenance of a frame from its manifest.
fn read_manifest(path: &Path) -> Result<Provenance, CliError> {
    let wrong = |problem: String| CliError::ReadManifest { path: path.to_owned(), problem };
    let bytes = files::read_bounded(path, MOST_MANIFEST_BYTES).map_err(|error| wrong(error.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|error| wrong(error.to_string()))
}

/// Warns of differences that may change the bytes of a frame.
fn warn_of_differences(recorded: &Provenance, adapter: &AdapterReport) {
    for (property, then, now) in [
        ("version", &recorded.version[..], env!("CARGO_PKG_VERSION")),
        ("adapter", &recorded.adapter, &adapter.adapter),
        ("driver", &recorded.driver, &adapter.driver),
    ] {
        if then != now {
            tracing::warn!("the {property} was {then} and is {now}: pictures may differ");
        }
    }
}

//! `render`: every view once, into files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};

use super::{
    CliError, audits, explain,
    load::{self, LoadedScene},
    results,
};
use crate::audit::{AuditedScene, audit_into};
use crate::config::Config;
use crate::gpu::{Gpu, GpuOptions};
use crate::output::write_frames;
use crate::render::{Frame, FrameRequest, RenderError, Renderer, Wanted};
use crate::scene::SceneSnapshot;

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
    steradian render --config configs/dome.toml --out out --files png --explain\n\n\
    Writes <view>.exr and <view>.png (with several images <view>.<part>.exr and .png), timings.json and manifest.json. An\n\
    image is the same whichever other files are written; one that is not written is not drawn.\n\
    The key of --set is a dotted path; a view is named by its name or its index from 0. Values are TOML; a bare word is a\n\
    string. Relative paths of catalogues start at the folder of the configuration.")]
pub struct RenderArguments {
    /// The configuration.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Which images are written, separated by commas.
    #[arg(long, value_name = "KINDS", value_enum, value_delimiter = ',', default_value = "png,exr")]
    files: Vec<FileKind>,
    /// Print what was drawn how, with the bound of every approximation.
    #[arg(long)]
    explain: bool,
}

/// Runs the command.
pub fn run(arguments: RenderArguments, adapter: Option<String>) -> Result<(), CliError> {
    // Everything that can be refused is looked at before the stars, which take longest.
    let config = Config::load(&arguments.config, &arguments.set)?;
    let rig = config.rig()?;
    let camera = config.camera()?;
    if rig.views().is_empty() {
        return Err(CliError::Usage(format!("{}: views: at least one [[views]] is needed to render", config.origin)));
    }
    if config.accuracy.frame_ms.is_some() {
        tracing::info!("{}: accuracy.frame_ms acts in `serve` alone: files give up no quality", config.origin);
    }
    let gpu = Gpu::open(&GpuOptions { adapter, ..GpuOptions::default() })?;
    let mut renderer = Renderer::new(gpu);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &config.origin))?;

    let groups = config.frame_groups()?;
    let LoadedScene { stars, objects, prepared, .. } = load::scene(&config, &groups, &mut renderer)?;
    prepared.map_err(|error| CliError::render(error, &config.origin))?;
    let snapshot = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera };
    let wanted = Wanted {
        display: arguments.files.contains(&FileKind::Png),
        hdr: arguments.files.contains(&FileKind::Exr),
        ..Wanted::default()
    };
    let mut draw = |number: usize| -> Result<Frame, RenderError> {
        let mut frame = renderer.render(FrameRequest::of_group(&snapshot, &groups, number).wanted(wanted))?;
        if groups[number].settings.accuracy.audit {
            let scene = AuditedScene::of_group(&snapshot, &groups[number], false);
            audit_into(&scene, &mut frame, renderer.limits())?;
        }
        Ok(frame.of_views(&groups[number].views))
    };
    let frames: Result<Vec<Frame>, RenderError> = (0..groups.len()).map(&mut draw).collect();
    let frames = frames.map_err(|error| CliError::render(error, &config.origin))?;
    if arguments.explain {
        results::line(explain::text(&frames))?;
    }
    let tell = |path: &Path| tracing::info!("wrote {}", path.display());
    for path in write_frames(&arguments.out, &rig, &frames, &renderer.adapter().adapter, &tell)? {
        results::line(path.display())?;
    }
    audits::check(&frames)
}

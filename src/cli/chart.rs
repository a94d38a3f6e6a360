//! `chart`: compares speed and accuracy of every method.

mod daemons;

use std::path::PathBuf;

use clap::Args;

pub use self::daemons::Daemons;
use super::{CliError, progress::Progress, results};
use crate::catalogue::deep::DeepStore;
use crate::chart::{self, About, Axis, Extent, Step};
use crate::gpu::{Gpu, GpuOptions};
use crate::output::check_folder;
use crate::render::Renderer;

/// Arguments of `chart`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian chart --out chart --quick\n  \
    steradian chart --out chart --axis stars --adapter llvmpipe\n  \
    steradian chart --out chart --quick --axis glare\n  \
    steradian chart --out chart --quick --axis live     # frames that reach a client, two minutes\n  \
    steradian chart --out chart --axis scale --store gaia\n\n\
    Writes chart.csv, one SVG per axis and index.html that shows them, and prints one line per method. A quick run ends within four minutes on two cores\n\
    without a GPU; a full run covers all workloads, from 10 thousand to 10 million stars and from 720p to 4K, and takes longer.\n\
    The rows of a method that cannot be drawn have empty figures and the reason in the notes column.")]
pub struct ChartArguments {
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Run fewer workloads and rounds.
    #[arg(long)]
    quick: bool,
    /// Chart only this axis: stars, glare, asteroids, projectors, views, scale or live. Default: all axes, with --quick all
    /// but live, which starts daemons on free ports of this machine and measures the frames that reach a client.
    #[arg(long, value_name = "AXIS", value_parser = Axis::parse)]
    axis: Option<Axis>,
    /// A deep store to measure on the axis scale, in addition to the generated ones. May be repeated.
    #[arg(long = "store", value_name = "DIR")]
    stores: Vec<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &ChartArguments, options: &GpuOptions, no_cache: bool) -> Result<(), CliError> {
    // Create the folder first, so that an error is reported before the long work.
    check_folder(&arguments.out)?;
    std::fs::create_dir_all(&arguments.out)
        .map_err(|source| chart::ChartError::Write { path: arguments.out.clone(), source })?;
    // For the same reason, check in advance that the stores can be used.
    if let (Some(axis), [_, ..]) = (arguments.axis.filter(|axis| *axis != Axis::Scale), &arguments.stores[..]) {
        return Err(CliError::Usage(format!(
            "--store: the axis {} does not measure stores; give --axis scale, or omit --axis",
            axis.name()
        )));
    }
    for folder in &arguments.stores {
        DeepStore::open_whole(folder).map_err(CliError::Deep)?;
    }
    let gpu = Gpu::open(options)?;
    let discrete = gpu.report().device_type == "DiscreteGpu";
    let about = About::now(gpu.report(), &command());
    let mut renderer = Renderer::new(gpu);
    let extent = if arguments.quick { Extent::quick() } else { Extent::full(discrete) };
    let extent = Extent { stores: arguments.stores.clone(), ..extent };
    let progress = Progress::new();
    let axes = match arguments.axis {
        Some(axis) => vec![axis],
        // With the daemons a quick run would take longer than the four minutes that it promises.
        None => Axis::ALL.into_iter().filter(|axis| !arguments.quick || *axis != Axis::Live).collect(),
    };
    let daemons = Daemons::new(std::env::current_exe().map_err(CliError::Runtime)?, options, no_cache)?;
    let mut start = |request: &chart::LiveRequest<'_>| daemons.start(request);
    let rows = chart::run(&mut renderer, &axes, &extent, &mut start, &mut |step| show_step(&progress, step))?;
    tracing::info!("charted in {:.1} s", progress.finish());
    for path in chart::write(&arguments.out, &rows, &about)? {
        results::line(path.display())?;
    }
    for line in chart::summary(&rows) {
        results::line(line)?;
    }
    Ok(())
}

/// Returns the command line of this process, quoted so that it can be repeated.
fn command() -> String {
    let words = std::env::args_os().skip(1).map(|word| {
        let word = word.to_string_lossy().into_owned();
        if word.contains(' ') { format!("'{word}'") } else { word }
    });
    std::iter::once("steradian".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Shows a step on the progress bar of a terminal, or in a log line if there is no terminal.
fn show_step(progress: &Progress, Step { axis, task, done, total }: &Step) {
    progress.step(*done, *total, task.clone(), |task| {
        tracing::info!("{}: {task} ({} of {total})", axis.name(), done + 1);
    });
}

//! `film`: draws numbered frames along a path into files, checks and repairs them, and records paths from a daemon.

mod draw;
mod record;
mod repair;
mod status;

use crate::gpu::GpuOptions;
use clap::{Args, Subcommand};

use super::CliError;

/// Arguments of `film`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  \
    steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film\n  \
    steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film --shard 2/4 --format exr16\n  \
    steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film --shutter 0.5 --sub-frames 16\n  \
    steradian film --config configs/perspective.toml --path path.toml --frames 0..=239 --out film --video film.mp4\n  \
    steradian film status film\n  \
    steradian film repair film\n  \
    steradian film record --address 127.0.0.1:7143 --out path.toml --seconds 60\n\n\
    A path is TOML: `fps`, and [[keyframes]] with `frame` and any of position_m, orientation or look, time, fov_y_deg or fov_scale,\n\
    ev100 or compensation_ev, magnitude_limit, velocity_c and easing.\n\n\
    Writes <view>_00001.png (or .exr; with several images <view>.<part>_00001.png), film.json and film.sha256. Existing frames are not\n\
    drawn again. A frame depends only on its number: shards on several machines with the same adapter make one film."
)]
pub struct FilmArguments {
    /// Action other than drawing.
    #[command(subcommand)]
    command: Option<FilmCommand>,
    /// Arguments for drawing.
    #[command(flatten)]
    draw: Option<draw::DrawArguments>,
}

/// Actions of `film` other than drawing.
#[derive(Debug, Subcommand)]
enum FilmCommand {
    /// Follow the camera of a daemon and write its path.
    Record(record::RecordArguments),
    /// List the frames of a folder that are missing, damaged, or from another film.
    Status(status::StatusArguments),
    /// Draw the frames again that `film status` lists.
    Repair(repair::RepairArguments),
}

/// Runs the command.
pub fn run(arguments: FilmArguments, options: &GpuOptions) -> Result<(), CliError> {
    match (arguments.command, arguments.draw) {
        (Some(FilmCommand::Record(arguments)), _) => record::run(&arguments),
        (Some(FilmCommand::Status(arguments)), _) => status::run(&arguments),
        (Some(FilmCommand::Repair(arguments)), _) => repair::run(&arguments, options),
        (None, Some(arguments)) => draw::run(arguments, options),
        // If there is no subcommand, the parser requires all of these and has already reported any that is missing.
        (None, None) => Err(CliError::Usage("film needs --config, --path, --frames and --out".to_owned())),
    }
}

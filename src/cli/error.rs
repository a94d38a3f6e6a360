//! Errors of the commands, and the exit code of each.

use std::io;
use std::path::PathBuf;

use crate::catalogue::deep::DeepError;
use crate::catalogue::galaxy::GalaxyError;
use crate::catalogue::store::StoreError;
use crate::chart::ChartError;
use crate::config::ConfigError;
use crate::gpu::{GpuError, ShaderError};
use crate::output::{OutputError, film::FilmError};
use crate::photometry::glare::GlareKernelError;
use crate::photometry::psf::PsfError;
use crate::scene::loader::LoadError;
use crate::service::{ClientError, ServeError};
use crate::theatre::TheatreError;
use crate::windows::WindowsError;
use crate::xr::XrError;
use crate::{
    plan::PlanError,
    render::{RenderError, SHADER_FOLDER_VARIABLE},
};

/// Exit code: a check or a job failed.
pub const FAILED: u8 = 1;
/// Exit code: bad usage or configuration.
pub const BAD_USAGE: u8 = 64;
/// Exit code: bad input data.
pub const BAD_DATA: u8 = 65;
/// Exit code: no usable adapter, or another resource of the system is missing.
pub const NO_ADAPTER: u8 = 69;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// An argument is invalid.
    #[error("{0}")]
    Usage(String),
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The stars of a scene cannot be loaded.
    #[error("{origin}{source}")]
    Load {
        /// Name of the configuration followed by a colon and a space, or empty.
        origin: String,
        /// Reason.
        source: LoadError,
    },
    /// A store cannot be read.
    #[error(transparent)]
    ReadStore(StoreError),
    /// A store cannot be written.
    #[error("cannot write the store: {0}")]
    WriteStore(StoreError),
    /// A deep store cannot be read or written.
    #[error(transparent)]
    Deep(DeepError),
    /// The cache folder cannot be read or cleared.
    #[error("{}: {source}", folder.display())]
    Cache {
        /// The folder.
        folder: PathBuf,
        /// Reason.
        source: io::Error,
    },
    /// These arguments do not describe a synthetic galaxy.
    #[error(transparent)]
    Galaxy(#[from] GalaxyError),
    /// A point-spread function cannot be made, read or written.
    #[error(transparent)]
    Psf(#[from] PsfError),
    /// Files of a frame cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The files of a projector installer cannot be read.
    #[error(transparent)]
    Theatre(#[from] TheatreError),
    /// The files of a projector installer can be read, but views made from them cannot be drawn.
    #[error("{0}")]
    Calibration(String),
    /// A film cannot be made.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// No adapter can be used, or the device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The folder of shaders for development cannot be used.
    #[error("{SHADER_FOLDER_VARIABLE}: {0}")]
    Shaders(#[from] ShaderError),
    /// A frame cannot be rendered.
    #[error("{origin}: {source}")]
    Render {
        /// The configuration.
        origin: String,
        /// Reason.
        source: RenderError,
    },
    /// A headset cannot be driven.
    #[error(transparent)]
    Headset(#[from] XrError),
    /// Windows cannot be opened or shown.
    #[error(transparent)]
    Windows(#[from] WindowsError),
    /// Threads or signal handlers cannot be set up.
    #[error("cannot start: {0}")]
    Runtime(io::Error),
    /// The daemon could not start, or failed.
    #[error(transparent)]
    Serve(ServeError),
    /// A cluster is not in order.
    #[error("{0} lines say WRONG")]
    Cluster(u32),
    /// A token cannot be made.
    #[error("cannot make a token: {0}")]
    Token(String),
    /// A daemon cannot be reached, or refuses the request.
    #[error(transparent)]
    Client(ClientError),
    /// A file that a configuration names cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    ReadInput {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A manifest cannot be read.
    #[error("cannot read the manifest {}: {problem}", path.display())]
    ReadManifest {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
    },
    /// A file differs from the one that a picture was made with.
    #[error("{origin}: {} differs from the file that was used: its SHA-256 is {found}, expected {expected}", path.display())]
    OtherInput {
        /// The manifest.
        origin: String,
        /// The file.
        path: PathBuf,
        /// SHA-256 in the manifest.
        expected: String,
        /// SHA-256 of the file.
        found: String,
    },
    /// A path could not be recorded, or was recorded only in part.
    #[error("{0}")]
    Record(String),
    /// A chart cannot be made.
    #[error("chart: {0}")]
    Chart(#[from] ChartError),
    /// A report cannot be serialised as JSON.
    #[error("cannot write JSON: {0}")]
    Json(serde_json::Error),
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    WriteFile {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Checks failed, or no check applies.
    #[error("{failed} of {total} applicable checks failed")]
    Checks {
        /// Number of failed checks.
        failed: usize,
        /// Number of checks that ran.
        total: usize,
    },
    /// An audit found images beyond their error budgets.
    #[error("the audit found images beyond the error budget; the files are written:\n  {}", .0.join("\n  "))]
    Audit(Vec<String>),
    /// Standard output cannot be written.
    #[error("cannot write to standard output: {0}")]
    Stdout(#[from] io::Error),
}

impl CliError {
    /// Wraps an error of the renderer together with the name of its configuration.
    pub(super) fn render(source: RenderError, origin: &str) -> Self {
        CliError::Render { origin: origin.to_owned(), source }
    }

    /// Returns the exit code, which scripts rely on.
    pub fn exit_code(&self) -> u8 {
        match self {
            CliError::Gpu(error) | CliError::Chart(ChartError::Gpu(error)) => gpu_exit_code(error),
            CliError::Render { source, .. } => render_exit_code(source),
            CliError::Headset(error) => match error {
                XrError::Gpu(error) => gpu_exit_code(error),
                XrError::Render(error) => render_exit_code(error),
                XrError::Loader(_)
                | XrError::NoRuntime { .. }
                | XrError::MissingExtension { .. }
                | XrError::NoHeadset { .. }
                | XrError::Unsuitable { .. }
                | XrError::Vulkan { .. } => NO_ADAPTER,
                XrError::Call { .. } | XrError::LossPending => FAILED,
            },
            CliError::Windows(error) => match error {
                WindowsError::Gpu(error) => gpu_exit_code(error),
                WindowsError::NoDisplay(_)
                | WindowsError::Display(_)
                | WindowsError::NoAdapter(_)
                | WindowsError::Format { .. }
                | WindowsError::Window { .. } => NO_ADAPTER,
                WindowsError::Refused(_) => FAILED,
            },
            CliError::Serve(
                ServeError::Address { .. }
                | ServeError::NotSocket { .. }
                | ServeError::Unsupported { .. }
                | ServeError::Open { .. }
                | ServeError::Access(_),
            ) => BAD_USAGE,
            CliError::Serve(ServeError::State(error)) if error.is_damage() => BAD_DATA,
            CliError::Serve(_) | CliError::Runtime(_) => FAILED,
            CliError::Psf(error) => psf_exit_code(error),
            CliError::Deep(error) => deep_exit_code(error),
            CliError::Film(error) => match error {
                FilmError::Frame { .. }
                | FilmError::Config(_)
                | FilmError::OtherFilm { .. }
                | FilmError::NotAFilm { .. } => BAD_USAGE,
                FilmError::NoFfmpeg { .. } => NO_ADAPTER,
                _ => FAILED,
            },
            CliError::Usage(_) | CliError::Config(_) | CliError::Galaxy(_) | CliError::Shaders(_) => BAD_USAGE,
            CliError::Load { source: LoadError::Galaxy { .. }, .. } => BAD_USAGE,
            CliError::Load { source: LoadError::Deep(error), .. } => deep_exit_code(error),
            CliError::Load { .. } | CliError::ReadStore(_) => BAD_DATA,
            CliError::Theatre(_) | CliError::Calibration(_) => BAD_DATA,
            CliError::ReadInput { .. } | CliError::ReadManifest { .. } | CliError::OtherInput { .. } => BAD_DATA,
            CliError::Chart(_) | CliError::Client(_) | CliError::Record(_) => FAILED,
            CliError::WriteStore(_) | CliError::Output(_) | CliError::Json(_) | CliError::Stdout(_) => FAILED,
            CliError::Cache { .. }
            | CliError::WriteFile { .. }
            | CliError::Checks { .. }
            | CliError::Audit(_)
            | CliError::Cluster(_)
            | CliError::Token(_) => FAILED,
        }
    }

    /// Whether the process that reads standard output has closed it, as `head` does in `steradian ... | head`. This is not a failure.
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, CliError::Stdout(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}

fn gpu_exit_code(error: &GpuError) -> u8 {
    match error {
        GpuError::NoAdapter(_) | GpuError::Unusable(_) | GpuError::Device { .. } | GpuError::Adopt(_) => NO_ADAPTER,
        GpuError::Lost(_) | GpuError::Refused(_) | GpuError::Readback(_) => FAILED,
    }
}

fn render_exit_code(error: &RenderError) -> u8 {
    match error {
        RenderError::Gpu(error) => gpu_exit_code(error),
        RenderError::Plan(error) => plan_exit_code(error),
        _ => FAILED,
    }
}

fn plan_exit_code(error: &PlanError) -> u8 {
    match error {
        PlanError::TooLarge { .. }
        | PlanError::TooManyImages { .. }
        | PlanError::TooManyFields { .. }
        | PlanError::TooManyShapes { .. }
        | PlanError::TooManyPixels { .. }
        | PlanError::AtRestOnly(_)
        | PlanError::DeepMethod(_)
        | PlanError::DeepAtRest
        | PlanError::DeepMemory { .. }
        | PlanError::GlareOfCatalogue(_) => BAD_USAGE,
        PlanError::Psf(error) => psf_exit_code(error),
        PlanError::DeepDamaged(_) => BAD_DATA,
        PlanError::Glare(error) => match error {
            GlareKernelError::NoFile | GlareKernelError::Inner { .. } => BAD_USAGE,
            GlareKernelError::Read { .. } | GlareKernelError::Row { .. } | GlareKernelError::File { .. } => BAD_DATA,
            GlareKernelError::Psf(error) => psf_exit_code(error),
            GlareKernelError::NoIntegral(_) => FAILED,
        },
        _ => FAILED,
    }
}

fn deep_exit_code(error: &DeepError) -> u8 {
    match error {
        DeepError::Memory { .. }
        | DeepError::Occupied { .. }
        | DeepError::OtherJob { .. }
        | DeepError::Overlap { .. }
        | DeepError::Gap { .. }
        | DeepError::IsPart { .. }
        | DeepError::Galaxy(_)
        | DeepError::Export { .. } => BAD_USAGE,
        DeepError::DiskFull { .. } | DeepError::Busy { .. } => FAILED,
        _ => BAD_DATA,
    }
}

fn psf_exit_code(error: &PsfError) -> u8 {
    match error {
        PsfError::Parameter { .. } | PsfError::TooFine { .. } => BAD_USAGE,
        PsfError::Read { .. } | PsfError::File { .. } | PsfError::NoScale { .. } => BAD_DATA,
        PsfError::Write { .. } | PsfError::Encode { .. } => FAILED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glare_errors_map_to_usage_or_data_exit_codes() {
        let code = |error: PlanError| CliError::render(error.into(), "a.toml").exit_code();
        let path = || PathBuf::from("eye.csv");
        assert_eq!(code(GlareKernelError::NoFile.into()), BAD_USAGE);
        assert_eq!(code(GlareKernelError::Inner { path: path(), inner_deg: 2.0, last_deg: 1.0 }.into()), BAD_USAGE);
        let row = GlareKernelError::Row { path: path(), line: 7, problem: "`x`: two numbers are needed".to_owned() };
        let error = CliError::render(PlanError::from(row).into(), "a.toml");
        assert_eq!(error.exit_code(), BAD_DATA);
        assert_eq!(error.to_string(), "a.toml: glare: eye.csv:7: `x`: two numbers are needed");
        let missing = PsfError::NoScale { path: path(), looked_for: "CDELT1" };
        assert_eq!(code(missing.into()), BAD_DATA);
    }
}

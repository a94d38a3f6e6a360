//! Deep stores on the axis `scale`: measures display frames of stores of growing size, their reads and memory, and their error relative to a frame of
//! every star.

use std::path::Path;
use std::sync::Arc;

use super::{
    Axis, Budget, ChartError, DisplayErrors, ReportStep, Row, Score, Step, ViewShape,
    timing::{self, Case, Timed, message_of},
    workloads::{SEED, Sky, camera, rig_of},
};
use crate::{
    catalogue::{
        deep::{DeepError, build::BuildOptions, live::DeepSky, synth::synthesise},
        epoch::Epoch,
        galaxy::GalaxyParameters,
    },
    memory_size::MemorySize,
    plan::{
        Output,
        settings::{ExposureSettings, GlareSettings, MethodSource, RenderSettings},
    },
    render::{Frame, FrameRequest, RenderError, Renderer, SkyMapUse, Wanted},
    scene::{
        SceneSnapshot,
        loader::{StarSource, load_stars},
    },
    view::Rig,
};

/// Exposure, EV at ISO 100: a dark sky.
const EV100: f64 = -5.4;
/// Stores with more stars are not compared with a frame of every star, because such a frame takes minutes and many GiB.
const MOST_COMPARED: u64 = 100_000_000;
/// Memory for the pages of a frame that draws every star.
const EVERY_STAR: MemorySize = MemorySize::gib(4);
/// Memory for building a store.
const MAKING: MemorySize = MemorySize::gib(1);

/// Figure of a row of a deep store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeepMetric {
    /// Error that 99.9 % of the channels of the display image do not exceed, 8-bit codes.
    Error999Codes,
    /// Largest error of the display image, 8-bit codes.
    ErrorLargestCodes,
    /// Data read for the first frame, MiB.
    ReadMib,
    /// Memory of the resident stars and of the pages, MiB.
    MemoryMib,
    /// Number of stars and composite stars that are drawn one by one.
    Drawn,
}

named!(DeepMetric {
    Error999Codes = "display_error_999_codes",
    ErrorLargestCodes = "display_error_largest_codes",
    ReadMib = "read_mib",
    MemoryMib = "memory_mib",
    Drawn = "drawn",
});

impl DeepMetric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Error999Codes => {
                "error that 99.9 % of the channels do not exceed, relative to a frame of every star, 8-bit codes before rounding"
            }
            Self::ErrorLargestCodes => "the largest error, 8-bit codes before rounding",
            Self::ReadMib => "data read from leaves and planes for the first frame, MiB",
            Self::MemoryMib => "resident stars, and pages in memory, MiB",
            Self::Drawn => "stars and composite stars that a frame draws one by one; the others are in a map",
        }
    }
}

/// A view of stores, with the name of its series.
const VIEWS: [(&str, ViewShape); 2] =
    [("deep_store", ViewShape::Flat([1920, 1080])), ("deep_store_dome", ViewShape::Dome(1024))];

/// Builds and measures stores with these numbers of stars, and measures the stores in these folders.
pub(super) fn run(
    renderer: &mut Renderer,
    (numbers, folders): (&[usize], &[std::path::PathBuf]),
    rounds: usize,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let total = numbers.len() + folders.len();
    let mut step = |done: usize, task: String| report_step(&Step { axis: Axis::Scale, done, total, task });
    let mut rows = Vec::new();
    for (done, &stars) in numbers.iter().enumerate() {
        step(done, format!("a deep store of {} stars", Sky::Galaxy(stars).name()));
        let folder = tempfile::tempdir().map_err(|source| ChartError::Write { path: std::env::temp_dir(), source })?;
        let out = folder.path().join("store");
        make(stars, &out)?;
        rows.extend(of_store(renderer, &out, rounds, budget.part(1.0, total - done))?);
    }
    for (index, folder) in folders.iter().enumerate() {
        let done = numbers.len() + index;
        step(done, format!("the deep store {}", folder.display()));
        rows.extend(of_store(renderer, folder, rounds, budget.part(1.0, total - done))?);
    }
    Ok(rows)
}

fn make(stars: usize, out: &Path) -> Result<(), ChartError> {
    let parameters = GalaxyParameters { stars, seed: SEED, fainter_than: None, unresolved_light: false };
    let options =
        BuildOptions { out: out.to_owned(), memory_bytes: MAKING.bytes, job: "chart".to_owned(), cells: None };
    synthesise(&parameters, options, &mut |_| ())?;
    Ok(())
}

/// Measures a store and returns its rows.
fn of_store(renderer: &mut Renderer, folder: &Path, rounds: usize, budget: Budget) -> Result<Vec<Row>, ChartError> {
    let mut rows = Vec::new();
    for (index, (series, view)) in VIEWS.into_iter().enumerate() {
        // Load the store again for each view, so that no page has been read before.
        let (stars, _) =
            load_stars(&[StarSource::File(folder.to_owned())], &Epoch::default(), &mut |_| {}).map_err(Box::new)?;
        let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects: Arc::default(), camera: camera() };
        let deep = scene.stars.deep.as_deref().ok_or_else(|| DeepError::NotAStore { path: folder.to_owned() })?;
        let measured = measure(renderer, (&scene, deep), view, rounds, budget.part(1.0, VIEWS.len() - index))?;
        let items = deep.store().index().stars();
        let case = Case {
            axis: Axis::Scale,
            workload: format!("store of {}", Sky::Galaxy(items as usize).name()),
            adapter: renderer.adapter().adapter.clone(),
            size: view.size(),
            items,
            planes: true,
        };
        let note = format!("display frames at EV {EV100}");
        for metric in DeepMetric::ALL {
            let (value, reason) = measured.figure(metric);
            let score = Score { value, note: reason };
            let names = [series, MethodSource::Steradian.name()];
            rows.push(case.named_row(names, &measured.timed, metric.name(), &score, &note));
        }
    }
    Ok(rows)
}

/// Figures of a view of a store.
struct Measured {
    timed: Timed,
    /// Data read for the first frame; `None`: it failed.
    read_mib: Option<f64>,
    memory_mib: f64,
    drawn: Option<f64>,
    /// Error that 99.9 % of the channels do not exceed, and the largest error; or the reason why there is none.
    errors: Result<[f64; 2], String>,
}

impl Measured {
    /// Returns the value of a metric and a note, which is the reason if there is no value.
    fn figure(&self, metric: DeepMetric) -> (Option<f64>, String) {
        let error = |index: usize| match &self.errors {
            Ok(errors) => (Some(errors[index]), String::new()),
            Err(reason) => (None, reason.clone()),
        };
        match metric {
            DeepMetric::Error999Codes => error(0),
            DeepMetric::ErrorLargestCodes => error(1),
            DeepMetric::ReadMib => (self.read_mib, String::new()),
            DeepMetric::MemoryMib => (Some(self.memory_mib), String::new()),
            DeepMetric::Drawn => (self.drawn, String::new()),
        }
    }
}

fn measure(
    renderer: &mut Renderer,
    (scene, deep): (&SceneSnapshot, &DeepSky),
    view: ViewShape,
    rounds: usize,
    budget: Budget,
) -> Result<Measured, ChartError> {
    let rig = rig_of(vec![("chart", view.kind())])?;
    let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
    settings.exposure = ExposureSettings::manual(EV100);
    // The first frame, which is not counted, reads all pages and makes the map of faint light.
    let mut read = None;
    let mut drawn = None;
    let timed = timing::rounds(1, rounds, budget, |_| {
        let start = std::time::Instant::now();
        match draw(renderer, (scene, &rig), &settings, Output::Display, Wanted { hdr_stays: true, ..Wanted::default() })
        {
            Ok(frame) => {
                read.get_or_insert_with(|| deep.statistics().bytes_read);
                drawn = Some(frame.views.iter().map(|view| view.stars_drawn as f64).sum());
                Ok(Ok((frame.times.gpu_ms.map(|ms| ms + frame.times.cull_ms), start.elapsed())))
            }
            Err(error) => message_of(error).map(Err),
        }
    })?;
    let resident_bytes = std::mem::size_of_val(&scene.stars.stars[..]) as u64;
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let memory_mib = mib(resident_bytes + deep.statistics().bytes);
    let stars = deep.store().index().stars();
    let errors = match stars > MOST_COMPARED {
        true => Err(format!("not compared with every star: more than {} million", MOST_COMPARED / 1_000_000)),
        false => errors(renderer, (scene, &rig), &settings)?,
    };
    // Only one method was timed.
    let timed = timed.into_iter().next().unwrap_or_default();
    Ok(Measured { timed, read_mib: read.map(mib), memory_mib, drawn, errors })
}

/// Measures the errors of the display image relative to a frame of every star.
fn errors(
    renderer: &mut Renderer,
    (scene, rig): (&SceneSnapshot, &Rig),
    settings: &RenderSettings,
) -> Result<Result<[f64; 2], String>, ChartError> {
    let mut every_star = settings.clone();
    every_star.stars.every_star = true;
    every_star.stars.memory = EVERY_STAR;
    let mut frames = Vec::new();
    for (settings, output) in [(&every_star, Output::Hdr), (settings, Output::Display)] {
        match draw(renderer, (scene, rig), settings, output, Wanted::hdr()) {
            Ok(frame) => frames.push(frame),
            Err(error) => return Ok(Err(message_of(error)?)),
        }
    }
    let errors = DisplayErrors::between(&frames[0], &frames[1], settings);
    Ok(Ok([0.999, 1.0].map(|share| errors.quantile(share))))
}

/// Draws a complete frame: the map of faint light is drawn first if the frame needs it.
fn draw(
    renderer: &mut Renderer,
    (scene, rig): (&SceneSnapshot, &Rig),
    settings: &RenderSettings,
    output: Output,
    wanted: Wanted,
) -> Result<Frame, RenderError> {
    let request = FrameRequest::new(scene, rig).settings(settings).wanted(wanted).sky_map(SkyMapUse::Wait);
    renderer.render(request.drawn_for(output))
}

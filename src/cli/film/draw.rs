//! Draws the frames of a film.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum, value_parser};
use glam::DQuat;

use super::super::ending::ended_by_signal;
use super::super::numbers::within;
use super::super::progress::FilmProgress;
use super::super::{
    CliError,
    inputs::{Inputs, sha256},
    load::{self, LoadedScene, PendingObjects},
    results,
};
use crate::config::{Config, FilmPath};
use crate::gpu::{Gpu, GpuOptions};
use crate::output::film::{
    Ffmpeg, FilmError, FilmFolder, FilmFormat, FilmRecord, FilmTracks, FilmWriter, FrameFile, FrameRange, ImageWords,
    Shard, Written,
    blur::{self, MOST_SUB_FRAMES, Shutter},
    check_video_file, check_with, stems, with_writer,
};
use crate::output::{check_folder, pack};
use crate::render::{Frame, FrameRequest, RenderError, Renderer, Wanted};
use crate::scene::{Camera, SceneObjects, SceneSnapshot, SeenStars};
use crate::view::{Rig, ViewPicture};

/// File formats of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Display images, PNG of 8 bits.
    Png8,
    /// Display images, PNG of 16 bits.
    Png16,
    /// HDR images, OpenEXR of 16-bit floats.
    Exr16,
    /// HDR images, OpenEXR of 32-bit floats.
    Exr32,
}

impl From<Format> for FilmFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Png8 => Self::Png8,
            Format::Png16 => Self::Png16,
            Format::Exr16 => Self::Exr16,
            Format::Exr32 => Self::Exr32,
        }
    }
}

fn open_share(text: &str) -> Result<f64, String> {
    within(text, [0.0, 1.0])
}

/// Arguments of `film` when it draws.
#[derive(Debug, Args)]
pub struct DrawArguments {
    /// The configuration.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Path of the camera: keyframes in TOML.
    #[arg(long, value_name = "FILE")]
    path: PathBuf,
    /// Range of frames: A..B excludes B, A..=B includes it.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    frames: FrameRange,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// File format of the images.
    #[arg(long, value_enum, default_value = "png8")]
    format: Format,
    /// Draw only every N-th frame, starting at the I-th: one of N runs that share the range.
    #[arg(long, value_name = "I/N", conflicts_with = "video", allow_hyphen_values = true)]
    shard: Option<Shard>,
    /// Motion blur: share of the time between two frames during which the shutter is open, 0 to 1.
    #[arg(long, value_name = "S", value_parser = open_share, requires = "sub_frames", allow_negative_numbers = true)]
    shutter: Option<f64>,
    /// Motion blur: number of moments whose light is added, 1 to 64.
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=i64::from(MOST_SUB_FRAMES)), requires = "shutter", allow_negative_numbers = true)]
    sub_frames: Option<u32>,
    /// Encode the frames as a video with an installed ffmpeg.
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// View that the video shows; required if there are several.
    #[arg(long, value_name = "NAME", requires = "video")]
    video_view: Option<String>,
    /// Draw existing frames again, and replace another film in the folder.
    #[arg(long)]
    overwrite: bool,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Everything that is needed to draw a film.
pub(super) struct Film {
    camera: Camera,
    path: FilmPath,
    tracks: FilmTracks,
    pub(super) inputs: Inputs,
    format: FilmFormat,
    /// `None`: every frame shows a single moment.
    shutter: Option<Shutter>,
}

/// Runs the command.
pub fn run(arguments: DrawArguments, gpu: &GpuOptions) -> Result<(), CliError> {
    // Check everything that can be refused before loading the stars, which takes longest.
    let inputs = Inputs::load(&arguments.config, &arguments.set)?;
    let path = FilmPath::load(&arguments.path)?;
    let shutter = arguments.shutter.zip(arguments.sub_frames).map(|(open, sub_frames)| Shutter { open, sub_frames });
    let film = Film::new(inputs, path, arguments.format.into(), shutter)?;
    let rig = film.check(arguments.frames)?;
    let video = arguments.video.as_deref().map(|file| {
        film.video_stem(&rig, arguments.video_view.as_deref()).and_then(|stem| {
            check_video_file(file).map_err(CliError::Usage)?;
            Ok((file, stem, Ffmpeg::find()?))
        })
    });
    let video = video.transpose()?;
    check_folder(&arguments.out)?;

    let gpu = Gpu::open(gpu)?;
    let mut renderer = Renderer::new(gpu);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &film.inputs.config.origin))?;
    let sources = [&arguments.config, &arguments.path].map(|file| film.inputs.source(file));
    let record = FilmRecord {
        sources: sources.into_iter().collect::<Result<_, _>>()?,
        frames: vec![arguments.frames],
        ..film.record(&rig, &renderer)?
    };
    let folder = FilmFolder::open(&arguments.out, &record, arguments.overwrite)?;
    let frames: Vec<u32> = arguments.frames.frames(arguments.shard).collect();
    let missing: Vec<u32> = frames.iter().copied().filter(|frame| !folder.has(*frame)).collect();
    film.log_cost(&rig, frames.len(), missing.len());
    if !missing.is_empty() {
        film.draw(&mut renderer, &folder, &record, &missing)?;
    }
    results::line(format!(
        "{}: {} frames drawn, {} already existed",
        arguments.out.display(),
        missing.len(),
        frames.len() - missing.len()
    ))?;
    if let Some((file, stem, ffmpeg)) = video {
        tracing::info!("encoding {}", file.display());
        ffmpeg.encode(&arguments.out, &stem, arguments.frames, film.path.fps, file)?;
        results::line(file.display())?;
    }
    Ok(())
}

impl Film {
    /// A film of a configuration and a path.
    pub(super) fn new(
        inputs: Inputs,
        path: FilmPath,
        format: FilmFormat,
        shutter: Option<Shutter>,
    ) -> Result<Self, CliError> {
        let shutter = shutter.filter(|shutter| !shutter.is_sharp());
        Ok(Self { camera: inputs.config.camera()?, tracks: FilmTracks::new(&path), format, shutter, path, inputs })
    }

    /// Checks whether all frames can be drawn, as far as that is known beforehand; returns the views.
    pub(super) fn check(&self, range: FrameRange) -> Result<Rig, CliError> {
        let Self { inputs: Inputs { config, .. }, path, tracks, format, .. } = self;
        let rig = config.rig()?;
        let usage = |text: String| Err(CliError::Usage(text));
        if rig.views().is_empty() {
            return usage(format!("{}: views: at least one [[views]] is needed to render", config.origin));
        }
        if config.accuracy.audit {
            return usage(format!("{}: accuracy.audit: films are not audited; `render` audits a frame", config.origin));
        }
        if config.accuracy.frame_ms.is_some() {
            tracing::info!(
                "{}: accuracy.frame_ms applies only to `serve`: files are always drawn at full quality",
                config.origin
            );
        }
        let has_overlay = config.views.iter().any(|view| view.test_pattern) || !config.overlay.is_empty();
        if (*format != FilmFormat::Png8 || self.shutter.is_some()) && has_overlay {
            let text = "overlays and test patterns exist only in 8-bit display images without motion blur: use --format png8 without \
                        --shutter, or remove them";
            return usage(format!("{}: overlay: {text}", config.origin));
        }
        check_with(path, config)?;
        for frame in range.first..range.end {
            for moment in self.moments(frame) {
                let camera = tracks.at_moment(moment).camera(&self.camera, DQuat::IDENTITY);
                camera.map_err(|error| self.fault(frame, error.to_string()))?;
            }
        }
        // The values between two keyframes lie between those of the keyframes, so checking the keyframes suffices.
        for keyframe in &path.keyframes {
            let groups = self.config_at(f64::from(keyframe.frame)).frame_groups();
            groups.map_err(|error| self.fault(keyframe.frame, error.to_string()))?;
        }
        Ok(rig)
    }

    /// Returns the configuration at a moment.
    fn config_at(&self, moment: f64) -> Config {
        self.tracks.at_moment(moment).applied_to(&self.inputs.config)
    }

    /// Returns the moments whose light a frame adds up.
    fn moments(&self, frame: u32) -> Vec<f64> {
        self.shutter.map_or_else(|| vec![f64::from(frame)], |shutter| shutter.moments(frame).collect())
    }

    fn fault(&self, frame: u32, problem: String) -> FilmError {
        FilmError::Frame { origin: self.path.origin.clone(), frame, problem }
    }

    /// Returns the prefix of the file names of the view that the video shows.
    fn video_stem(&self, rig: &Rig, view: Option<&str>) -> Result<String, CliError> {
        let usage = |text: String| Err(CliError::Usage(text));
        if self.format != FilmFormat::Png8 {
            return usage(format!("--video needs --format png8, not {}", self.format.name()));
        }
        let single: Vec<_> = rig.views().iter().filter(|view| view.pictures().len() == 1).collect();
        let names: Vec<&str> = single.iter().map(|view| view.name.as_str()).collect();
        let allowed = if names.is_empty() { "none here".to_owned() } else { names.join(", ") };
        let chosen = match (view, rig.views()) {
            (None, [_]) => single.first(),
            (None, _) => {
                return usage(format!(
                    "--video shows one view: name it with --video-view; views with one image: {allowed}"
                ));
            }
            (Some(name), _) => single.iter().find(|view| view.name == name),
        };
        let Some(chosen) = chosen else {
            return usage(format!("--video needs a view with one image, which must be one of: {allowed}"));
        };
        let ViewPicture { part, size: [width, height] } = chosen.pictures()[0];
        if width % 2 != 0 || height % 2 != 0 {
            let name = &chosen.name;
            return usage(format!("--video: view {name} has {width} x {height} pixels: both must be even (4:2:0)"));
        }
        Ok(part.name().map_or(chosen.name.clone(), |part| format!("{}.{part}", chosen.name)))
    }

    pub(super) fn record(&self, rig: &Rig, renderer: &Renderer) -> Result<FilmRecord, CliError> {
        let report = renderer.adapter();
        let configuration = sha256(&[&self.inputs.config.pictured]);
        let path = sha256(&[&self.path.document]);
        let (version, format) = (env!("CARGO_PKG_VERSION"), self.format.name());
        let adapter = format!("{}, {}", report.adapter, report.driver);
        let blur = self.shutter.map_or("none".to_owned(), |shutter| {
            format!("shutter open for {:?} of the time, {} moments", shutter.open, shutter.sub_frames)
        });
        // Write one line per file, with an escaped name: a line break in a name must not imitate another file.
        let files = self.inputs.files()?;
        let contents: String = files.iter().map(|file| format!("{} {:?}\n", file.sha256, file.file)).collect();
        Ok(FilmRecord {
            digest: sha256(&[&configuration, &path, format, version, &adapter, &blur, &contents]),
            version: version.to_owned(),
            configuration_sha256: configuration,
            path_sha256: path,
            format: format.to_owned(),
            extension: self.format.extension().to_owned(),
            adapter,
            blur,
            shutter: self.shutter,
            fps: self.path.fps,
            images: stems(rig),
            configuration: self.inputs.configuration(),
            path_toml: self.path.document.clone(),
            files,
            sources: Vec::new(),
            frames: Vec::new(),
            catalogues: None,
        })
    }

    pub(super) fn log_cost(&self, rig: &Rig, frames: usize, missing: usize) {
        let pixels_of = |size: [u32; 2]| size.map(u64::from).iter().product::<u64>();
        let pictures = rig.views().iter().flat_map(|view| view.pictures());
        let pixels: u64 = pictures.map(|picture| pixels_of(picture.size)).sum();
        let bytes = pixels * self.format.bytes_per_pixel() * missing as u64;
        tracing::info!(
            "{frames} frames, {} of them to draw, {} moments each; per frame {} views, {} images and {pixels} pixels; at most about {:.3} GB as {}",
            missing,
            self.shutter.map_or(1, |shutter| shutter.sub_frames),
            rig.views().len(),
            stems(rig).len(),
            bytes as f64 * 1e-9,
            self.format.name(),
        );
    }

    /// Kind of images that the format needs.
    fn wanted(&self) -> Wanted {
        // Motion blur adds up light, so it needs HDR images.
        if self.shutter.is_some() { Wanted::hdr() } else { self.format.wanted() }
    }

    /// Draws frames, and replaces existing files.
    pub(super) fn draw(
        &self,
        renderer: &mut Renderer,
        folder: &FilmFolder,
        record: &FilmRecord,
        missing: &[u32],
    ) -> Result<(), CliError> {
        let config = &self.inputs.config;
        let of_render = |error: RenderError| CliError::render(error, &config.origin);
        let groups = self.config_at(f64::from(missing[0])).frame_groups()?;
        let objects = PendingObjects::begin(config);
        let LoadedScene { stars, report, objects, prepared } =
            load::scene(config, objects, &groups, self.wanted(), renderer, None)?;
        prepared.map_err(of_render)?;
        folder.record_catalogues(self.inputs.catalogues(&report))?;
        let sources = self.inputs.config.star_sources();
        let stars = SeenStars::new(Arc::new(stars), objects.observer.as_ref(), sources);
        let ended = ended_by_signal().map_err(CliError::Runtime)?;
        let mut progress = FilmProgress::new(missing.len());
        let begun = Instant::now();
        let mut times = DrawingTimes::default();
        let drawing = |writer: &FilmWriter<'_>| -> Result<usize, CliError> {
            for (done, frame) in missing.iter().enumerate() {
                // Stop only between two frames: frames already handed to the encoders are still written.
                if ended.load(Ordering::Relaxed) {
                    return Ok(done);
                }
                let scene = Scene { stars: &stars, objects: &objects };
                let frame_begun = Instant::now();
                let files = self.draw_frame(renderer, folder, record, *frame, scene, &mut times)?;
                times.drawing += frame_begun.elapsed();
                let waits = Instant::now();
                writer.write(files)?;
                times.waiting += waits.elapsed();
                progress.drawn(*frame, done + 1);
            }
            Ok(missing.len())
        };
        let before = |path: &Path, bytes: &[u8]| folder.record_checksum(path, bytes);
        let (_, written) = with_writer(self.format, &before, drawing)?;
        folder.sort_checksums()?;
        progress.finish();
        times.log(begun.elapsed(), &written);
        let left = missing.len() - written.frames;
        if left > 0 { Err(FilmError::Interrupted { drawn: written.frames, left }.into()) } else { Ok(()) }
    }

    /// Returns the scene, the camera and the views at a moment.
    fn moment(&self, frame: u32, moment: f64, Scene { stars, objects }: Scene<'_>) -> Result<Moment, CliError> {
        let values = self.tracks.at_moment(moment);
        let config = &self.inputs.config;
        let (objects, of_config) = match values.time_s {
            Some(time_s) => (Arc::new(objects.at(time_s)), config.camera_at(time_s)?),
            None => (Arc::clone(objects), self.camera),
        };
        let Some(icrs_from_frame) = objects.icrs_from(self.path.frame) else {
            unreachable!("a path along the horizon requires an observer")
        };
        let camera = values.camera(&of_config, DQuat::from_mat3(&icrs_from_frame));
        let camera = camera.map_err(|error| self.fault(frame, error.to_string()))?;
        let stars = stars.made(objects.observer.as_ref(), objects.time_s);
        let stars = stars.map_err(|source| CliError::Load { origin: format!("{}: ", config.origin), source })?;
        let snapshot = SceneSnapshot { revision: 1, stars, objects, camera };
        Ok(Moment { config: values.applied_to(config), snapshot })
    }

    fn draw_frame(
        &self,
        renderer: &mut Renderer,
        folder: &FilmFolder,
        record: &FilmRecord,
        frame: u32,
        scene: Scene<'_>,
        times: &mut DrawingTimes,
    ) -> Result<Vec<FrameFile>, CliError> {
        // Scene and views at the frame's own moment.
        let moment = self.moment(frame, f64::from(frame), scene)?;
        let Moment { config, snapshot } = &moment;
        let camera = snapshot.camera;
        let rig = config.rig()?;
        let groups = config.frame_groups()?;
        // Number of images of all views that precede the given one.
        let first_image = |view: usize| rig.views()[..view].iter().map(|view| view.pictures().len()).sum::<usize>();
        let mut files = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            // Draw a group of views, with motion blur if requested.
            let request = FrameRequest::for_group(snapshot, &groups, number).wanted(self.wanted());
            let mut drawn =
                renderer.render(request).map_err(|error| CliError::render(error, &self.inputs.config.origin))?;
            times.plan_ms += drawn.times.plan_ms;
            times.gpu_and_readback_ms += drawn.times.gpu_and_readback_ms;
            if let Some(shutter) = self.shutter {
                drawn = self.blurred(renderer, shutter, drawn, frame, number, &moment, scene)?;
                if self.format == FilmFormat::Png8 {
                    for image in &mut drawn.images {
                        let displayed = blur::show(image, drawn.exposure_ev100, &group.settings.tone_map);
                        displayed.map_err(FilmError::Blur)?;
                    }
                }
            }
            let drawn = drawn.with_views(&group.views);
            // Describe each picture and name its file.
            for image in pack(&rig, drawn.images) {
                let view = &rig.views()[image.view];
                // A picture that holds both eyes uses the metadata of the first eye.
                let part = view.images.iter().position(|of_view| of_view.part == image.part).unwrap_or_default();
                let words = ImageWords {
                    exposure_ev100: drawn.exposure_ev100,
                    tone_map: group.settings.tone_map,
                    attributes: vec![
                        ("view_name", view.name.clone()),
                        ("view_part", image.part.name().unwrap_or("whole").to_owned()),
                        ("film_frame", frame.to_string()),
                        ("projection", config.geometry_line(image.view)),
                        ("camera_position_m", numbers(&camera.position_m.to_array())),
                        ("camera_orientation", numbers(&camera.world_from_camera.to_array())),
                        ("camera_velocity_c", numbers(&camera.velocity_c.to_array())),
                        ("view_orientation", numbers(&view.images[part].camera_from_view.to_array())),
                        ("eye_position_m", numbers(&view.images[part].eye_position_m.to_array())),
                        ("viewing_circle_m", numbers(&[view.images[part].viewing_circle_m.abs()])),
                        ("packing", format!("{:?}", view.packing)),
                        ("time_s_since_j2000", numbers(&[snapshot.objects.time_s])),
                        ("motion_blur", record.blur.clone()),
                        ("units", "R, G, B: cd/m^2 divided by whiteLuminance, linear Rec. 709; omega: sr".to_owned()),
                        ("configuration_sha256", record.configuration_sha256.clone()),
                        ("film_sha256", record.digest.clone()),
                    ],
                };
                let path = folder.file(first_image(image.view) + part, frame);
                files.push(FrameFile { path, image, words });
            }
        }
        Ok(files)
    }

    /// Averages the light of all moments of a frame. The frame's own moment has been drawn already; its exposure is
    /// used for all.
    #[allow(clippy::too_many_arguments, reason = "a frame depends on a film, a group of views, a moment and a scene")]
    fn blurred(
        &self,
        renderer: &mut Renderer,
        shutter: Shutter,
        own: Frame,
        frame: u32,
        group: usize,
        moment: &Moment,
        scene: Scene<'_>,
    ) -> Result<Frame, CliError> {
        let exposure_ev100 = own.exposure_ev100;
        // Add the frame's own moment only when its turn comes, so that the sum follows the order of the moments.
        let mut own = Some(own);
        let mut sum: Option<Frame> = None;
        for (sub_frame, at) in (0..).zip(shutter.moments(frame)) {
            let drawn = match own.take_if(|_| shutter.middle() == Some(sub_frame)) {
                Some(own) => own,
                None => {
                    let Moment { mut config, snapshot } = self.moment(frame, at, scene)?;
                    config.exposure = moment.config.exposure;
                    let groups = config.frame_groups()?;
                    let request = FrameRequest::for_group(&snapshot, &groups, group).wanted(Wanted::hdr());
                    let drawn = renderer.render(request.adapted_ev100(exposure_ev100));
                    drawn.map_err(|error| CliError::render(error, &self.inputs.config.origin))?
                }
            };
            match &mut sum {
                None => sum = Some(drawn),
                Some(sum) => {
                    for (sum, image) in sum.images.iter_mut().zip(&drawn.images) {
                        blur::add(sum, image).map_err(FilmError::Blur)?;
                    }
                }
            }
        }
        let mut mean = sum.ok_or_else(|| self.fault(frame, "the frame has no moments".to_owned()))?;
        for image in &mut mean.images {
            blur::divide(image, shutter.sub_frames);
        }
        mean.exposure_ev100 = exposure_ev100;
        Ok(mean)
    }
}

/// Time spent in each stage of a run, summed over all frames.
#[derive(Default)]
struct DrawingTimes {
    drawing: Duration,
    waiting: Duration,
    plan_ms: f64,
    gpu_and_readback_ms: f64,
}

impl DrawingTimes {
    /// Logs the mean times of a frame.
    fn log(&self, all: Duration, written: &Written) {
        let Written { frames, bytes, encoding, writing, threads } = *written;
        if frames == 0 {
            return;
        }
        let per_frame = |seconds: f64| seconds / frames as f64;
        let [whole_s, drawing_s, waiting_s, encoding_s, writing_s] =
            [all, self.drawing, self.waiting, encoding, writing].map(|time| per_frame(time.as_secs_f64()));
        let [plan_s, gpu_s] = [self.plan_ms, self.gpu_and_readback_ms].map(|ms| per_frame(ms * 1e-3));
        tracing::info!(
            "mean per frame: {whole_s:.3} s and {:.3} MB; drawing took {drawing_s:.3} s (for its own moment: planning {plan_s:.3} s, drawing and readback \
             {gpu_s:.3} s), waiting for the encoders {waiting_s:.3} s; meanwhile {threads} threads took {encoding_s:.3} s to encode and {writing_s:.3} s to write",
            per_frame(bytes as f64 * 1e-6)
        );
    }
}

/// Everything that is drawn for one moment.
struct Moment {
    config: Config,
    snapshot: SceneSnapshot,
}

/// Scene content that all frames share.
#[derive(Clone, Copy)]
struct Scene<'a> {
    stars: &'a SeenStars,
    objects: &'a Arc<SceneObjects>,
}

/// Formats numbers with enough digits to read back the same values.
fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    texts.join(" ")
}

//! `film`: numbered frames along a path, into files.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Args, ValueEnum};
use sha2::{Digest, Sha256};

use super::progress::FilmProgress;
use super::{
    CliError,
    load::{self, LoadedScene},
    results,
};
use crate::config::{Config, FilmPath};
use crate::gpu::{Gpu, GpuOptions};
use crate::output::film::{
    Ffmpeg, FilmError, FilmFolder, FilmFormat, FilmRecord, FilmTracks, FilmWriter, FrameFile, FrameRange, ImageWords,
    Shard, check_video_file, check_with, stems, with_writer,
};
use crate::render::{FrameRequest, RenderError, Renderer};
use crate::scene::{Camera, SceneObjects, SceneSnapshot};
use crate::service;
use crate::view::Rig;

/// Names of the formats.
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

/// Arguments of `film`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film\n  \
    steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film --shard 2/4 --format exr16\n  \
    steradian film --config configs/perspective.toml --path path.toml --frames 0..=239 --out film --video film.mp4\n\n\
    Writes <view>_00001.png (or .exr; with several images <view>.<part>_00001.png) and film.json. Frames that are there are not\n\
    drawn again. Every frame is a function of its number alone: shards on several machines with the same adapter make one film.")]
pub struct FilmArguments {
    /// The configuration.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// The path: keyframes in TOML.
    #[arg(long, value_name = "FILE")]
    path: PathBuf,
    /// The frames: A..B without B, A..=B with it.
    #[arg(long, value_name = "A..B")]
    frames: FrameRange,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How images are written.
    #[arg(long, value_enum, default_value = "png8")]
    format: Format,
    /// Draw every N-th frame alone, from the I-th on: one of N runs that share the range.
    #[arg(long, value_name = "I/N", conflicts_with = "video")]
    shard: Option<Shard>,
    /// Make a video of the frames with an installed ffmpeg.
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// The view that the video shows; needed where there are several.
    #[arg(long, value_name = "NAME", requires = "video")]
    video_view: Option<String>,
    /// Draw frames that are there again, and replace another film in the folder.
    #[arg(long)]
    overwrite: bool,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// The film, before anything is drawn.
struct Film {
    config: Config,
    camera: Camera,
    path: FilmPath,
    tracks: FilmTracks,
    format: FilmFormat,
}

fn sha256(parts: &[&str]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        // The length first: no two lists of parts are the same bytes.
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part.as_bytes());
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Runs the command.
pub fn run(arguments: FilmArguments, adapter: Option<String>) -> Result<(), CliError> {
    // Everything that can be refused is looked at before the stars, which take longest.
    let config = Config::load(&arguments.config, &arguments.set)?;
    let path = FilmPath::load(&arguments.path)?;
    let film = Film {
        camera: config.camera()?,
        tracks: FilmTracks::new(&path),
        format: arguments.format.into(),
        config,
        path,
    };
    let rig = film.check(arguments.frames)?;
    let video = arguments.video.as_deref().map(|file| {
        film.video_stem(&rig, arguments.video_view.as_deref()).and_then(|stem| {
            check_video_file(file).map_err(CliError::Usage)?;
            Ok((file, stem, Ffmpeg::find()?))
        })
    });
    let video = video.transpose()?;

    let gpu = Gpu::open(&GpuOptions { adapter, ..GpuOptions::default() })?;
    let mut renderer = Renderer::new(gpu);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &film.config.origin))?;
    let configuration = sha256(&[&Config::pictured_document(&arguments.config, &arguments.set)?]);
    let record = film.record(&rig, &renderer, configuration);
    let folder = FilmFolder::open(&arguments.out, &record, arguments.overwrite)?;
    let frames: Vec<u32> = arguments.frames.frames(arguments.shard).collect();
    let missing: Vec<u32> = frames.iter().copied().filter(|frame| !folder.has(*frame)).collect();
    film.tell_cost(&rig, frames.len(), missing.len());
    if !missing.is_empty() {
        film.draw(&mut renderer, &folder, &record, &missing)?;
    }
    results::line(format!(
        "{}: {} frames drawn, {} were there",
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
    /// Whether all frames can be drawn, as far as that is known beforehand; returns the views.
    fn check(&self, range: FrameRange) -> Result<Rig, CliError> {
        let Self { config, path, tracks, format, .. } = self;
        let rig = config.rig()?;
        let usage = |text: String| Err(CliError::Usage(text));
        if rig.views().is_empty() {
            return usage(format!("{}: views: at least one [[views]] is needed to render", config.origin));
        }
        if config.accuracy.audit {
            return usage(format!("{}: accuracy.audit: films are not audited; `render` audits a frame", config.origin));
        }
        if config.accuracy.frame_ms.is_some() {
            tracing::info!("{}: accuracy.frame_ms acts in `serve` alone: files give up no quality", config.origin);
        }
        let has_overlay = config.views.iter().any(|view| view.test_pattern) || {
            let overlay = &config.overlay;
            !overlay.grids.is_empty() || !overlay.trajectories.is_empty() || !overlay.labels.is_empty()
        };
        if *format != FilmFormat::Png8 && has_overlay {
            let text = "overlays and test patterns are in display images of 8 bits alone: use --format png8, or leave them out";
            return usage(format!("{}: overlay: {text}", config.origin));
        }
        check_with(path, config)?;
        for frame in range.first..range.end {
            let values = tracks.at(frame);
            values.camera(&self.camera).map_err(|error| FilmError::Frame {
                origin: path.origin.clone(),
                frame,
                problem: error.to_string(),
            })?;
        }
        // Between keyframes nothing is beyond them.
        for keyframe in &path.keyframes {
            self.at(keyframe.frame)?.frame_groups().map_err(|error| FilmError::Frame {
                origin: path.origin.clone(),
                frame: keyframe.frame,
                problem: error.to_string(),
            })?;
        }
        Ok(rig)
    }

    /// The configuration of a frame.
    fn at(&self, frame: u32) -> Result<Config, CliError> {
        Ok(self.tracks.at(frame).applied_to(&self.config))
    }

    /// What the files of the video's view begin with.
    fn video_stem(&self, rig: &Rig, view: Option<&str>) -> Result<String, CliError> {
        let usage = |text: String| Err(CliError::Usage(text));
        if self.format != FilmFormat::Png8 {
            return usage(format!("--video needs --format png8, not {}", self.format.name()));
        }
        let single: Vec<_> = rig.views().iter().filter(|view| view.images.len() == 1).collect();
        let names: Vec<&str> = single.iter().map(|view| view.name.as_str()).collect();
        let allowed = if names.is_empty() { "none here".to_owned() } else { names.join(", ") };
        let chosen = match (view, rig.views()) {
            (None, [_]) => single.first(),
            (None, _) => {
                return usage(format!("--video shows one view: name it with --video-view; of one image are {allowed}"));
            }
            (Some(name), _) => single.iter().find(|view| view.name == name),
        };
        let Some(chosen) = chosen else {
            return usage(format!("--video needs a view of one image: allowed are {allowed}"));
        };
        let [width, height] = chosen.output_size(&chosen.images[0]);
        if width % 2 != 0 || height % 2 != 0 {
            let name = &chosen.name;
            return usage(format!(
                "--video: view {name} has {width} x {height} pixels: even numbers are needed (4:2:0)"
            ));
        }
        let part = chosen.images[0].part.name();
        Ok(part.map_or(chosen.name.clone(), |part| format!("{}.{part}", chosen.name)))
    }

    fn record(&self, rig: &Rig, renderer: &Renderer, configuration: String) -> FilmRecord {
        let report = renderer.adapter();
        let path = sha256(&[&self.path.document]);
        let (version, format) = (env!("CARGO_PKG_VERSION"), self.format.name());
        let adapter = format!("{}, {}", report.adapter, report.driver);
        FilmRecord {
            digest: sha256(&[&configuration, &path, format, version, &adapter]),
            version: version.to_owned(),
            configuration,
            path,
            format: format.to_owned(),
            extension: self.format.extension().to_owned(),
            adapter,
            fps: self.path.fps,
            images: stems(rig),
        }
    }

    fn tell_cost(&self, rig: &Rig, frames: usize, missing: usize) {
        let pixels_of = |size: [u32; 2]| size.map(u64::from).iter().product::<u64>();
        let images = rig.views().iter().flat_map(|view| view.images.iter().map(|image| view.output_size(image)));
        let pixels: u64 = images.map(pixels_of).sum();
        let bytes = pixels * self.format.bytes_per_pixel() * missing as u64;
        tracing::info!(
            "{frames} frames, {} of them to draw, {} views, {} images and {pixels} pixels a frame, about {:.3} GB at most as {}",
            missing,
            rig.views().len(),
            stems(rig).len(),
            bytes as f64 * 1e-9,
            self.format.name(),
        );
    }

    fn draw(
        &self,
        renderer: &mut Renderer,
        folder: &FilmFolder,
        record: &FilmRecord,
        missing: &[u32],
    ) -> Result<(), CliError> {
        let of_render = |error: RenderError| CliError::render(error, &self.config.origin);
        let groups = self.at(missing[0])?.frame_groups()?;
        let LoadedScene { stars, objects, prepared, .. } = load::scene(&self.config, &groups, renderer)?;
        prepared.map_err(of_render)?;
        let stars = Arc::new(stars);
        let ended = ended_by_signal().map_err(CliError::Runtime)?;
        let mut progress = FilmProgress::new(missing.len());
        let drawing = |writer: &FilmWriter<'_>| -> Result<usize, CliError> {
            for (done, frame) in missing.iter().enumerate() {
                // Between two frames: what is handed over is still written.
                if ended.load(Ordering::Relaxed) {
                    return Ok(done);
                }
                let scene = Scene { stars: Arc::clone(&stars), objects: &objects };
                writer.write(self.draw_frame(renderer, folder, record, *frame, scene)?)?;
                progress.drawn(*frame, done + 1);
            }
            Ok(missing.len())
        };
        let (_, written) = with_writer(self.format, drawing)?;
        progress.finish();
        let left = missing.len() - written;
        if left > 0 { Err(FilmError::Interrupted { drawn: written, left }.into()) } else { Ok(()) }
    }

    fn draw_frame(
        &self,
        renderer: &mut Renderer,
        folder: &FilmFolder,
        record: &FilmRecord,
        frame: u32,
        Scene { stars, objects }: Scene<'_>,
    ) -> Result<Vec<FrameFile>, CliError> {
        let values = self.tracks.at(frame);
        let config = values.applied_to(&self.config);
        let camera = values.camera(&self.camera).map_err(|error| FilmError::Frame {
            origin: self.path.origin.clone(),
            frame,
            problem: error.to_string(),
        })?;
        let objects = match values.time_s {
            Some(time_s) => Arc::new(SceneObjects { time_s, ..(**objects).clone() }),
            None => Arc::clone(objects),
        };
        let time_s = objects.time_s;
        let snapshot = SceneSnapshot { revision: 1, stars, objects, camera };
        let rig = config.rig()?;
        let groups = config.frame_groups()?;
        // Views before the one at that number have so many images.
        let first_image = |view: usize| rig.views()[..view].iter().map(|view| view.images.len()).sum::<usize>();
        let mut files = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            let request = FrameRequest::of_group(&snapshot, &groups, number).wanted(self.format.wanted());
            let drawn = renderer.render(request).map_err(|error| CliError::render(error, &self.config.origin))?;
            let drawn = drawn.of_views(&group.views);
            for image in drawn.images {
                let view = &rig.views()[image.view];
                let part = view.images.iter().position(|of_view| of_view.part == image.part).unwrap_or_default();
                let words = ImageWords {
                    exposure_ev100: drawn.exposure_ev100,
                    tone_map: group.settings.tone_map,
                    attributes: vec![
                        ("view_name", view.name.clone()),
                        ("view_part", image.part.name().unwrap_or("whole").to_owned()),
                        ("film_frame", frame.to_string()),
                        ("projection", projection(&config, image.view)),
                        ("camera_position_m", numbers(&camera.position_m.to_array())),
                        ("camera_orientation", numbers(&camera.world_from_camera.to_array())),
                        ("camera_velocity_c", numbers(&camera.velocity_c.to_array())),
                        ("view_orientation", numbers(&view.images[part].camera_from_view.to_array())),
                        ("eye_position_m", numbers(&view.images[part].eye_position_m.to_array())),
                        ("time_s_since_j2000", numbers(&[time_s])),
                        ("units", "R, G, B: cd/m^2 divided by whiteLuminance, linear Rec. 709; omega: sr".to_owned()),
                        ("configuration_sha256", record.configuration.clone()),
                        ("film_sha256", record.digest.clone()),
                    ],
                };
                let path = folder.file(first_image(image.view) + part, frame);
                files.push(FrameFile { path, image, words });
            }
        }
        Ok(files)
    }
}

/// What all frames show.
struct Scene<'a> {
    stars: Arc<crate::catalogue::chunks::StarSet>,
    objects: &'a Arc<SceneObjects>,
}

/// The geometry of a view as its configuration has it, in one line.
fn projection(config: &Config, view: usize) -> String {
    let definition = &config.views[view].definition;
    let keys: Vec<String> = definition.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    keys.join("; ")
}

/// So many digits that reading them gives the same numbers.
fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    texts.join(" ")
}

/// Becomes true with SIGINT or SIGTERM, which from now on end nothing by themselves.
fn ended_by_signal() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let signals = {
        let _entered = runtime.enter();
        service::signals()?
    };
    let ended = Arc::new(AtomicBool::new(false));
    let tell = Arc::clone(&ended);
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        runtime.block_on(signals);
        tracing::info!("ending after the frame in hand");
        tell.store(true, Ordering::Relaxed);
    })?;
    Ok(ended)
}

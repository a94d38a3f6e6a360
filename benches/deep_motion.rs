//! Measures a deep store, from a cold cache, while the camera moves: how much light frames lack as time passes, whether they report it, and how much
//! the image jumps from frame to frame. Run: `cargo bench --bench deep_motion -- FOLDER [DELAY_MS]`; DELAY_MS delays the reading of each page, like a
//! slow disk.
//!
//! The motions are a zoom from 60 degrees to 1, a turn by 5 degrees per second, and flights of 1 and 100 pc. Each takes 8 seconds, and begins with
//! the galactic centre in the middle of the image. Afterwards, the frames are compared with frames of the same poses that wait for all pages.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{DQuat, DVec3};
use steradian::{
    catalogue::epoch::Epoch,
    chart::code_errors,
    coordinates::direction_from_lon_lat,
    memory_size::MemorySize,
    plan::{
        Output,
        settings::{ExposureSettings, RenderSettings},
    },
    render::{Frame, FrameRequest, Renderer, SkyMapUse, Wanted},
    scene::{
        Camera, SceneSnapshot,
        loader::{StarSource, load_stars},
    },
    units::PARSEC_M,
    view::{Rig, View, ViewKind},
};

/// Duration of a motion, and the longest wait afterwards for the pages that are still missing, s.
const MOTION_S: f64 = 8.0;
const MOST_WAIT_S: f64 = 30.0;
const SIZE: [u32; 2] = [960, 540];
const EV100: f64 = -5.4;
/// The galactic centre, ICRS degrees.
const TOWARDS_DEG: [f64; 2] = [266.4, -28.94];

/// Position, direction and field of view of the camera.
struct Pose {
    fov_y_deg: f64,
    turn_deg: f64,
    flown_pc: f64,
}

type Motion = fn(f64) -> Pose;

/// Names of the motions, and the pose at a fraction of each motion, from 0 to 1.
const MOTIONS: [(&str, Motion); 4] = [
    ("zoom from 60 to 1 degree", |share| Pose {
        fov_y_deg: 60.0 * (1.0_f64 / 60.0).powf(share),
        turn_deg: 0.0,
        flown_pc: 0.0,
    }),
    ("turn by 40 degrees at 10", |share| Pose { fov_y_deg: 10.0, turn_deg: 40.0 * share, flown_pc: 0.0 }),
    ("flight of 1 pc at 20 degrees", |share| Pose { fov_y_deg: 20.0, turn_deg: 0.0, flown_pc: share }),
    ("flight of 100 pc at 20 degrees", |share| Pose { fov_y_deg: 20.0, turn_deg: 0.0, flown_pc: 100.0 * share }),
];

/// A frame of the motion.
struct Shown {
    share: f64,
    at_s: f64,
    took_ms: f64,
    missing: u64,
    residual_codes: f64,
    frame: Frame,
}

/// Opens the store, without reading its pages.
fn opened(folder: &Path) -> SceneSnapshot {
    let (stars, _) =
        load_stars(&[StarSource::File(folder.to_owned())], &Epoch::default(), &mut |_| {}).expect("a deep store");
    SceneSnapshot { revision: 1, stars: Arc::new(stars), objects: Arc::default(), camera: Camera::default() }
}

fn draw(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    pose: &Pose,
    settings: &RenderSettings,
    sky_map: SkyMapUse,
) -> Frame {
    let [ra, dec] = TOWARDS_DEG.map(f64::to_radians);
    let towards = direction_from_lon_lat(ra, dec);
    let mut scene = scene.clone();
    scene.camera = Camera {
        position_m: towards * pose.flown_pc * PARSEC_M,
        world_from_camera: DQuat::from_rotation_arc(DVec3::NEG_Z, towards)
            * DQuat::from_rotation_y(pose.turn_deg.to_radians()),
        ..Camera::default()
    };
    let kind = ViewKind::Perspective { size: SIZE, fov_y_rad: pose.fov_y_deg.to_radians() };
    let rig = Rig::new(vec![View::new("window", kind, DQuat::IDENTITY, DVec3::ZERO).expect("a view")]).expect("a rig");
    let request = FrameRequest::new(&scene, &rig).settings(settings).wanted(Wanted::hdr()).sky_map(sky_map);
    renderer.render(request.drawn_for(Output::Display)).expect("a frame")
}

/// Empties the system's cache of files.
fn drop_file_cache() -> bool {
    std::fs::write("/proc/sys/vm/drop_caches", "1").is_ok()
}

/// Draws frames as fast as they come until the motion ends and no page is missing.
fn run(renderer: &mut Renderer, scene: &SceneSnapshot, motion: Motion, settings: &RenderSettings) -> Vec<Shown> {
    let mut frames = Vec::new();
    let start = Instant::now();
    loop {
        let at_s = start.elapsed().as_secs_f64();
        let share = (at_s / MOTION_S).min(1.0);
        let frame = draw(renderer, scene, &motion(share), settings, SkyMapUse::InTurn);
        let report = frame.plan.deep.clone().expect("a report of the store");
        let took_ms = 1e3 * (start.elapsed().as_secs_f64() - at_s);
        frames.push(Shown {
            share,
            at_s,
            took_ms,
            missing: report.missing,
            residual_codes: report.residual_codes,
            frame,
        });
        if share == 1.0 && (report.missing == 0 || at_s > MOTION_S + MOST_WAIT_S) {
            return frames;
        }
    }
}

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let folder = PathBuf::from(words.next().expect("the folder of a deep store"));
    let delay = Duration::from_millis(words.next().map_or(0, |word| word.parse().expect("a number of milliseconds")));
    let mut settings = RenderSettings { exposure: ExposureSettings::manual(EV100), ..RenderSettings::default() };
    settings.stars.memory = MemorySize::gib(1);
    let mut waiting = settings.clone();
    waiting.stars.memory = MemorySize::gib(4);
    let [mut renderer, mut exact_renderer] = [(); 2].map(|()| testkit::new_renderer());
    println!(
        "{}, {} x {} pixels, EV100 {EV100}, pages delayed by {delay:?}",
        renderer.adapter().adapter,
        SIZE[0],
        SIZE[1]
    );
    let whole = opened(&folder);
    for (name, motion) in MOTIONS {
        // Compile the shaders before the motion begins, by a frame of a separately opened store.
        draw(&mut renderer, &opened(&folder), &motion(0.0), &settings, SkyMapUse::InTurn);
        let scene = opened(&folder);
        scene.stars.deep.as_ref().expect("a deep store").set_delay(delay);
        println!("\n{name}; file cache dropped: {}", drop_file_cache());
        let frames = run(&mut renderer, &scene, motion, &settings);
        let read = scene.stars.deep.as_ref().expect("a deep store").statistics();
        println!("  s      frames  ms   missing  residual  largest error  99.9 %   codes");
        let mut last: Option<Vec<[f64; 3]>> = None;
        let (mut beyond, mut largest_part, mut jumps): (f64, f64, Vec<f64>) = (f64::NEG_INFINITY, 0.0, Vec::new());
        let mut second = Second::default();
        for shown in &frames {
            let exact = draw(&mut exact_renderer, &whole, &motion(shown.share), &waiting, SkyMapUse::Wait);
            let errors = code_errors(&exact, &shown.frame, &settings).swap_remove(0);
            let mut sizes: Vec<f64> = errors.iter().flatten().map(|error| error.abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let [largest, usual] = [1.0, 0.999].map(|share| sizes[((sizes.len() - 1) as f64 * share) as usize]);
            beyond = beyond.max(largest - shown.residual_codes);
            if shown.residual_codes > 0.0 {
                largest_part = largest_part.max(largest / shown.residual_codes);
            }
            if let Some(last) = &last {
                let changes = errors.iter().flatten().zip(last.iter().flatten()).map(|(now, then)| (now - then).abs());
                jumps.push(changes.fold(0.0, f64::max));
            }
            last = Some(errors);
            second.add(shown, largest, usual);
        }
        second.print();
        let jump = jumps.iter().copied().fold(0.0, f64::max);
        let end_s = frames.last().map_or(0.0, |shown| shown.at_s) - MOTION_S;
        let rest = frames.last().map_or(0, |shown| shown.missing);
        println!(
            "  {} frames; error beyond the residual at most {beyond:.3} codes, of the residual at most {largest_part:.3}; largest change that exact frames do not \
             have {jump:.2} codes; {rest} pages missing {end_s:.2} s after the motion; {} pages, {} MiB read",
            frames.len(),
            read.pages_read,
            read.bytes_read >> 20,
        );
    }
}

/// Figures of the frames within one second.
#[derive(Default)]
struct Second {
    number: u64,
    frames: u32,
    ms: f64,
    missing: u64,
    residual_codes: f64,
    largest: f64,
    usual: f64,
}

impl Second {
    /// Adds a frame; if it begins a new second, prints the previous one.
    fn add(&mut self, shown: &Shown, largest: f64, usual: f64) {
        let number = shown.at_s as u64;
        if number != self.number {
            self.print();
            *self = Self { number, ..Self::default() };
        }
        self.frames += 1;
        self.ms += shown.took_ms;
        self.missing = self.missing.max(shown.missing);
        self.residual_codes = self.residual_codes.max(shown.residual_codes);
        (self.largest, self.usual) = (self.largest.max(largest), self.usual.max(usual));
    }

    fn print(&self) {
        let Self { number, frames, ms, missing, residual_codes, largest, usual } = self;
        if *frames > 0 {
            let ms = ms / f64::from(*frames);
            println!(
                "  {number:2}     {frames:3}  {ms:6.0}  {missing:6}  {residual_codes:8.2}  {largest:8.2}  {usual:12.3}"
            );
        }
    }
}

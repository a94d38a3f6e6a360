//! Counts the instructions of ten reference frames under callgrind and compares them with the recorded counts. Unlike times, counts
//! hardly depend on the machine and its load. `cargo bench --bench instruction_counts -- --help`.
//!
//! The program runs itself under valgrind. Everything before a counted frame (loading, pipelines, the driver's compiler, two
//! frames that fill caches) runs without instrumentation. The process then makes callgrind instrument one frame, all threads
//! included, by client requests: sequences of instructions that do nothing outside of valgrind.
#![allow(unsafe_code, reason = "client requests of valgrind are instructions for which Rust has no interface")]

use std::{
    error::Error,
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use clap::Parser;
use glam::DQuat;
use steradian::{
    cache::{self, Cache},
    plan::settings::RenderSettings,
    render::{FrameRequest, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    view::Rig,
};
use testkit::{
    configured,
    instruction_counts::{Counts, problems, read_dump},
};

/// A reference frame.
struct Reference {
    name: &'static str,
    configuration: &'static str,
    /// Name of the view; empty for all views.
    view: &'static str,
    set: &'static [&'static str],
    wanted: Wanted,
}

const fn display(
    name: &'static str,
    configuration: &'static str,
    view: &'static str,
    set: &'static [&'static str],
) -> Reference {
    Reference { name, configuration, view, set, wanted: Wanted::display() }
}

static FRAMES: [Reference; 10] = [
    display("dome", "dome.toml", "dome", &["views.dome.size=[192,192]"]),
    display("tonight-dome", "tonight.toml", "dome", &["views.dome.size=[192,192]"]),
    display("tonight-window", "tonight.toml", "south", &["views.south.size=[192,108]"]),
    display(
        "demo",
        "demo.toml",
        "",
        &[
            "views.dome.size=[128,128]",
            "views.stereo.size=[80,80]",
            "views.cubemap.face_size=64",
            "views.equirectangular.size=[192,96]",
        ],
    ),
    display("mission-control", "mission-control.toml", "ahead", &["views.ahead.size=[192,108]"]),
    display("stereo", "stereo.toml", "headset", &["views.headset.size=[128,128]"]),
    display("cubemap", "cubemap.toml", "sky", &["views.sky.face_size=64"]),
    display("equirectangular", "equirectangular.toml", "sky", &["views.sky.size=[256,128]"]),
    display("asteroids", "asteroids.toml", "window", &["views.window.size=[192,108]"]),
    Reference {
        name: "hdr",
        configuration: "dome.toml",
        view: "dome",
        set: &["views.dome.size=[96,96]"],
        wanted: Wanted::hdr(),
    },
];

/// The scene has few stars, so that loading takes little time.
const STARS: &str =
    "scene.catalogues=[\"builtin:bright\", { galaxy = { stars = 20000, seed = 1, fainter_than = 6.5 } }]";
/// Size limit of the folder of stars and atlases. They need less than this.
const CACHE_BYTES: u64 = 1 << 30;
/// Turn of the camera from frame to frame, degrees.
const TURN_DEG: f64 = 0.5;

/// Counts the instructions of ten reference frames.
#[derive(Debug, Parser)]
struct Arguments {
    /// Record the counts in benches/instruction_counts.csv.
    #[arg(long)]
    record: bool,
    /// Draw the frames in this process, for callgrind.
    #[arg(long, hide = true)]
    draw: bool,
    /// Draw only every second frame, beginning with the first (0) or the second (1).
    #[arg(long, hide = true, value_parser = clap::value_parser!(u8).range(0..2))]
    half: Option<u8>,
    /// Folder of stars and atlases that an earlier process has made.
    #[arg(long, hide = true)]
    cache: Option<PathBuf>,
    /// Option that cargo passes to every benchmark.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Requests of callgrind, from its header `callgrind.h`: tool CT.
#[derive(Clone, Copy)]
enum Request {
    Zero = 1,
    DumpAt = 3,
    Start = 4,
    Stop = 5,
}

/// Sends a request to callgrind; does nothing outside of valgrind.
#[cfg(target_arch = "x86_64")]
fn request(request: Request, argument: usize) {
    let base = (usize::from(b'C') << 24) | (usize::from(b'T') << 16);
    let arguments = [base + request as usize, argument, 0, 0, 0, 0];
    // SAFETY: the rotations of rdi add up to 128 bits and a register is exchanged with itself, so outside of valgrind only the flags change. Inside,
    // valgrind reads the six words at rax, which live as long as this call, and writes its answer to rdx.
    unsafe {
        std::arch::asm!(
            "rol rdi, 3",
            "rol rdi, 13",
            "rol rdi, 61",
            "rol rdi, 51",
            "xchg rbx, rbx",
            in("rax") arguments.as_ptr(),
            inout("rdx") 0_usize => _,
            options(nostack)
        );
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn request(_: Request, _: usize) {}

/// A reference frame that is ready to be counted.
struct Ready {
    renderer: Renderer,
    scene: SceneSnapshot,
    rig: Rig,
    settings: RenderSettings,
    frame: &'static Reference,
}

impl Ready {
    /// Loads the scene and draws two frames, which fill all caches.
    fn new(frame: &'static Reference) -> Result<Self, Box<dyn Error>> {
        let overrides: Vec<&str> = frame.set.iter().copied().chain([STARS]).collect();
        let (scene, rig, settings) = configured(frame.configuration, &overrides);
        let views = rig.views().iter().filter(|view| frame.view.is_empty() || view.name == frame.view);
        let rig = Rig::new(views.cloned().collect())?;
        let mut ready = Self { renderer: testkit::new_renderer(), scene, rig, settings, frame };
        ready.draw()?;
        ready.draw()?;
        Ok(ready)
    }

    /// Turns the camera and draws a frame.
    fn draw(&mut self) -> Result<(), RenderError> {
        self.scene.camera.world_from_camera *= DQuat::from_rotation_y(TURN_DEG.to_radians());
        let request = FrameRequest::new(&self.scene, &self.rig).settings(&self.settings).wanted(self.frame.wanted);
        self.renderer.render(request).map(drop)
    }
}

/// Prepares every frame and then has callgrind count each. Instrumentation starts once, because valgrind then translates the whole
/// program again.
fn draw(folder: Option<PathBuf>, half: Option<u8>) -> Result<(), Box<dyn Error>> {
    cache::set_for_process(folder.map(|folder| Cache { folder, most_bytes: CACHE_BYTES }));
    let frames = FRAMES.iter().enumerate().filter(|(index, _)| half.is_none_or(|half| index % 2 == usize::from(half)));
    let mut ready = frames.map(|(_, frame)| Ready::new(frame)).collect::<Result<Vec<_>, _>>()?;
    request(Request::Start, 0);
    for ready in &mut ready {
        let name = std::ffi::CString::new(ready.frame.name)?;
        request(Request::Zero, 0);
        let drawn = ready.draw();
        request(Request::DumpAt, name.as_ptr() as usize);
        drawn?;
    }
    request(Request::Stop, 0);
    let report = ready[0].renderer.adapter();
    println!("driver: {}, {}", report.adapter, report.driver);
    Ok(())
}

/// Runs this program under callgrind, in two processes at the same time.
fn count() -> Result<Counts, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let program = std::env::current_exe()?;
    let kept = folder.path().join("cache");
    // Make stars and atlases without valgrind, under which that takes minutes.
    let made = Command::new(&program).arg("--draw").arg("--cache").arg(&kept).output()?;
    if !made.status.success() {
        return Err(String::from_utf8_lossy(&made.stdout).into_owned().into());
    }
    let start = |half: &str| {
        Command::new("valgrind")
            .args(["--tool=callgrind", "--instr-atstart=no", "--quiet"])
            .arg(format!("--callgrind-out-file={}", folder.path().join(half).display()))
            .arg(&program)
            .args(["--draw", "--half", half, "--cache"])
            .arg(&kept)
            // Use one thread per process, because waiting threads add a random amount to the count.
            .env("LP_NUM_THREADS", "0")
            .env("RAYON_NUM_THREADS", "1")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot run valgrind: {error}"))
    };
    let mut counts = Counts::default();
    for process in [start("0")?, start("1")?] {
        let output = process.wait_with_output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let driver = text.lines().find_map(|line| line.strip_prefix("driver: "));
        let message = || format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr));
        counts.driver = driver.ok_or_else(message)?.to_owned();
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder.path())? {
        let path = entry?.path();
        if path.is_file() {
            found.extend(read_dump(&std::fs::read_to_string(path)?));
        }
    }
    for frame in &FRAMES {
        let count = found.iter().find(|(name, _)| name == frame.name).map_or(0, |(_, count)| *count);
        counts.frames.push((frame.name.to_owned(), count));
    }
    Ok(counts)
}

fn compare(record: bool) -> Result<(), Box<dyn Error>> {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/instruction_counts.csv");
    let found = count()?;
    println!("{}", found.driver);
    for (name, count) in &found.frames {
        println!("{name:16} {:9.2} million instructions", *count as f64 / 1e6);
    }
    if record {
        std::fs::write(&path, found.to_csv())?;
        return Ok(());
    }
    let recorded = Counts::from_csv(&std::fs::read_to_string(&path)?)?;
    for line in problems(&recorded, &found) {
        println!("ci: instruction counts: {line}");
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let done = if arguments.draw { draw(arguments.cache, arguments.half) } else { compare(arguments.record) };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            println!("ci: instruction counts: {error}");
            ExitCode::FAILURE
        }
    }
}

//! Programs that step through a session by themselves, and the test's interface to them.

use std::{
    path::PathBuf,
    process::Command,
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use steradian::{
    plan::settings::{HeadsetSettings, RenderSettings},
    render::Wanted,
    verify::scenes,
    xr::{Flight, Headset, HeadsetStatistics, Host, MirroredFrame, Recorder, Shown, Status, Step},
};

use crate::{
    monado::{Service, harness::Inner},
    program::{LIMIT, Program},
};

pub const INNERS: &[Inner] = &[("watch", watch)];

/// Settings of the headset, as JSON.
const SETTINGS_VARIABLE: &str = "STERADIAN_TEST_HEADSET";
/// Name of a file. When it exists, the program requests the end of the session.
const END_VARIABLE: &str = "STERADIAN_TEST_END";

/// Output of the program, line by line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Line {
    /// The session exists.
    Connected { runtime: String, system: String, sizes: [[u32; 2]; 2] },
    /// The state of the session has changed.
    State(String),
    /// A frame was submitted.
    Frame(SeenFrame),
    /// Whether the runtime has ended the session.
    Exited(bool),
}

/// A frame of the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenFrame {
    pub display_time_ns: i64,
    /// Left and right eye, or `None` if the runtime did not want the frame.
    pub eyes: Option<[SeenEye; 2]>,
    pub recentred: u64,
    pub rendered: u64,
    pub not_wanted: u64,
}

/// An eye as drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenEye {
    pub size: [u32; 2],
    /// Quaternion x, y, z, w.
    pub orientation: [f64; 4],
    pub position_m: [f64; 3],
}

/// Host that shows one star until its end is requested.
#[derive(Default)]
struct Wearer {
    ending: AtomicBool,
    statistics: Mutex<HeadsetStatistics>,
}

impl Host for Wearer {
    fn shown(&self) -> Option<Shown> {
        (!self.ending.load(Relaxed)).then(|| Shown {
            snapshot: scenes::snapshot(vec![scenes::star(DVec3::NEG_Z, 0.0)]),
            settings: RenderSettings::default(),
            camera_time: SystemTime::now(),
        })
    }

    fn fly(&self, flight: &Flight) {
        panic!("the controllers are not used: {flight:?}");
    }

    fn mirror(&self) -> Wanted {
        Wanted::default()
    }

    fn publish(&self, _: MirroredFrame) {}

    fn status(&self, _: Status) {}

    fn statistics(&self, statistics: &HeadsetStatistics) {
        self.statistics.lock().unwrap().clone_from(statistics);
    }
}

fn say(line: &Line) {
    println!("{}", serde_json::to_string(line).unwrap());
}

fn watch() {
    let settings = std::env::var(SETTINGS_VARIABLE).unwrap();
    let settings: HeadsetSettings = serde_json::from_str(&settings).unwrap();
    let end = PathBuf::from(std::env::var_os(END_VARIABLE).unwrap());
    let mut headset = Headset::connect(&settings, Recorder::default()).unwrap_or_else(|error| panic!("{error}"));
    let host = Wearer::default();
    let mut last_state = "";
    let start = Instant::now();
    let mut asked = false;
    while start.elapsed() < LIMIT {
        let step = headset.step(&host).unwrap();
        let Status::Connected { runtime, system, state, sizes, .. } = headset.status() else { unreachable!() };
        if last_state.is_empty() {
            say(&Line::Connected { runtime, system, sizes });
        }
        if last_state != state {
            last_state = state;
            say(&Line::State(state.to_owned()));
        }
        match step {
            Step::Frame(frame) => {
                let figures = host.statistics.lock().unwrap().clone();
                let eye = |eye: steradian::view::Eye| SeenEye {
                    size: eye.size,
                    orientation: eye.room_from_eye.to_array(),
                    position_m: eye.position_m.to_array(),
                };
                say(&Line::Frame(SeenFrame {
                    display_time_ns: frame.display_time_ns,
                    eyes: frame.eyes.map(|eyes| eyes.map(eye)),
                    recentred: figures.recentred,
                    rendered: figures.rendered,
                    not_wanted: figures.not_wanted,
                }));
            }
            Step::Exited => return say(&Line::Exited(true)),
            Step::Idle | Step::HostEnded => {}
        }
        if end.exists() && !asked {
            asked = true;
            headset.request_exit().unwrap();
        }
    }
    say(&Line::Exited(false));
}

/// A program that watches a session, with its output.
pub struct Watcher {
    program: Program,
    folder: tempfile::TempDir,
}

impl Watcher {
    /// Starts the program as a program of a service.
    pub fn start(service: &Service, settings: &HeadsetSettings) -> Self {
        Self::of(service.inner("watch"), settings)
    }

    /// Starts the program with the command of the inner function.
    pub fn of(mut command: Command, settings: &HeadsetSettings) -> Self {
        let folder = tempfile::tempdir().unwrap();
        command.env(SETTINGS_VARIABLE, serde_json::to_string(settings).unwrap());
        command.env(END_VARIABLE, folder.path().join("end"));
        Self { program: Program::start(command), folder }
    }

    /// Returns all lines so far.
    pub fn lines(&self) -> Vec<Line> {
        let out = self.program.out();
        // The last line may be incomplete.
        let whole = out.rfind('\n').map_or("", |end| &out[..end]);
        lines(whole)
    }

    /// Waits until the lines contain an answer.
    ///
    /// # Panics
    /// If the program ends before, or takes too long.
    pub fn until<T>(&mut self, answer: impl Fn(&[Line]) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            let running = self.program.is_running();
            let lines = self.lines();
            if let Some(answer) = answer(&lines) {
                return answer;
            }
            assert!(running && start.elapsed() < LIMIT, "{lines:?}\n{}", self.program.log());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for the session; returns the names of runtime and system, and the sizes of the eyes' images.
    pub fn connected(&mut self) -> (String, String, [[u32; 2]; 2]) {
        self.until(|lines| match lines.first()? {
            Line::Connected { runtime, system, sizes } => Some((runtime.clone(), system.clone(), *sizes)),
            other => panic!("{other:?}"),
        })
    }

    /// Waits for a frame whose eyes are queried after this call.
    pub fn next_frame(&mut self) -> SeenFrame {
        // Skip the next frame, which may have begun before the call.
        let before = frames(&self.lines()).len() + 1;
        self.until(|lines| frames(lines).into_iter().skip(before).find(|frame| frame.eyes.is_some()))
    }

    /// Requests the end of the session and waits for the end of the program; returns all lines.
    pub fn end(self) -> Vec<Line> {
        std::fs::write(self.folder.path().join("end"), "").unwrap();
        let ended = self.program.wait();
        assert_eq!(ended.code, Some(0), "{}", ended.err);
        lines(&ended.out)
    }
}

fn lines(out: &str) -> Vec<Line> {
    out.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))).collect()
}

/// Returns the frames among lines.
pub fn frames(lines: &[Line]) -> Vec<SeenFrame> {
    let frame = |line: &Line| if let Line::Frame(frame) = line { Some(frame.clone()) } else { None };
    lines.iter().filter_map(frame).collect()
}

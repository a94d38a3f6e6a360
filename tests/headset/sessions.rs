//! Sessions of `xr` and of separate programs: their states from beginning to end, their properties, and the loss of the
//! runtime.

use steradian::plan::settings::{HeadsetSettings, ReferenceSpace};

use crate::{
    monado::{Monado, Service, harness::Test},
    program::{Daemon, Ended, Program, executable},
    wearer::{Line, Watcher, frames},
};

pub const TESTS: &[Test] = &[
    Test::WithMonado("xr_shows_frames_and_prints_statistics", xr_shows_frames),
    Test::WithMonado("example_headset_scene_is_shown", example_is_shown),
    Test::WithMonado("undrawable_scene_ends_xr_but_not_serve", scene_cannot_be_drawn),
    Test::WithMonado("signals_end_xr_in_order", signals_end_xr),
    Test::WithMonado("xr_reconnects_after_the_runtime_was_killed", xr_reconnects),
    Test::WithMonado("requested_end_passes_through_all_states", exit_is_requested),
    Test::WithMonado("settings_determine_the_session", settings_make_sessions),
    Test::WithMonado("spaces_have_their_origins", spaces_have_their_origins),
];

/// Bright stars.
const SCENE: &str = "[scene]\ncatalogues = ['builtin:bright']\n[headset]\nresolution_scale = 0.5\n";

/// Counts that `xr` prints at its end.
#[derive(Debug, PartialEq, Eq)]
struct Figures {
    sessions: u64,
    lost: u64,
    recentred: u64,
    frames: u64,
    rendered: u64,
    not_wanted: u64,
    left_out: u64,
    missed: u64,
}

/// Parses and prints the output of `xr`.
fn figures(ended: &Ended) -> Figures {
    println!("{}", ended.out);
    let line = |name: &str| {
        let found = ended.out.lines().find_map(|line| line.strip_prefix(name));
        let found = found.unwrap_or_else(|| panic!("no line `{name}`: {ended:?}"));
        let numbers = found.split(|c: char| !c.is_ascii_digit()).filter_map(|digits| digits.parse().ok());
        numbers.collect::<Vec<u64>>()
    };
    let (sessions, frames) = (line("sessions "), line("frames "));
    for name in ["pose age    at submission ", "pose age    at display ", "wait ", "draw ", "end ", "gpu "] {
        assert!(line(name).len() >= 6, "{name}: {}", ended.out);
    }
    Figures {
        sessions: sessions[0],
        lost: sessions[1],
        recentred: sessions[2],
        frames: frames[0],
        rendered: frames[1],
        not_wanted: frames[2],
        left_out: frames[3],
        missed: frames[4],
    }
}

/// Returns the states of the session in the order of the log.
fn states(ended: &Ended) -> Vec<&str> {
    ended.err.lines().filter_map(|line| line.split_once("headset: the session is ")).map(|(_, state)| state).collect()
}

const WHOLE_LIFE: [&str; 10] =
    ["idle", "ready", "synchronized", "visible", "focused", "visible", "synchronized", "stopping", "idle", "exiting"];

/// The scene of the documentation, rocks above Mars, is drawn without leaving out frames.
fn example_is_shown(monado: &'static Monado) {
    let service = Service::simulated(monado);
    let example = include_str!("../../configs/headset.toml");
    let ended = Program::steradian(service.command(executable()), &["xr", "--frames", "5"], example).wait();
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    let figures = figures(&ended);
    assert_eq!((figures.sessions, figures.rendered, figures.left_out), (1, 5, 0), "{figures:?}");
}

/// `xr` fails if the scene cannot be drawn; `serve` only reports the problem, because a client may correct the scene.
fn scene_cannot_be_drawn(monado: &'static Monado) {
    let service = Service::remote(monado);
    let scene = format!("{SCENE}enabled = true\n[stars]\nmethod = 'cell_sky'\n[glare]\nmethod = 'sky_cube'\n");
    let ended = Program::steradian(service.command(executable()), &["xr", "--frames", "60"], &scene).wait();
    assert_eq!(ended.code, Some(64), "{}", ended.err);
    assert!(ended.err.contains("cell_sky"), "{}", ended.err);

    let mut daemon = Daemon::start(&service, &scene);
    let reported = daemon.wait_for_headset(|headset| headset.left_out > 3);
    let status = reported.status.as_ref().unwrap();
    let problem = &status.reason;
    assert!(status.connected && !problem.is_empty(), "{reported:?}");
    assert!(problem.contains("cell_sky") && reported.rendered == 0, "{reported:?}");
    println!("{problem}; {} frames left out", reported.left_out);
    assert_eq!(daemon.terminate().code, Some(0));
}

/// After the given number of frames, the session ends in order, and the counts are consistent.
fn xr_shows_frames(monado: &'static Monado) {
    let service = Service::remote(monado);
    let ended = Program::steradian(service.command(executable()), &["xr", "--frames", "60"], SCENE).wait();
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    let figures = figures(&ended);
    assert_eq!((figures.sessions, figures.lost, figures.recentred, figures.rendered), (1, 0, 0, 60), "{figures:?}");
    assert_eq!(figures.frames, figures.rendered + figures.not_wanted, "{figures:?}");
    // Before the session is visible, the runtime sets the pace of frames but does not want them rendered.
    assert!(figures.not_wanted > 0, "{figures:?}");
    assert_eq!(states(&ended), WHOLE_LIFE);
}

/// SIGTERM and SIGINT end the session in order, and the statistics so far are printed.
fn signals_end_xr(monado: &'static Monado) {
    let service = Service::remote(monado);
    for signal in ["TERM", "INT"] {
        let mut program = Program::steradian(service.command(executable()), &["xr"], SCENE);
        program.wait_for_log("the session is focused", 1);
        program.signal(signal);
        let ended = program.wait();
        assert_eq!(ended.code, Some(0), "{signal}: {}", ended.err);
        println!("{signal}: {:?}", states(&ended));
        assert_eq!(states(&ended), WHOLE_LIFE, "{signal}");
    }
}

/// A killed runtime is reported. When it is back, the same run continues, and so do its counts.
fn xr_reconnects(monado: &'static Monado) {
    let mut service = Service::remote(monado);
    let mut program = Program::steradian(service.command(executable()), &["xr", "--frames", "60"], SCENE);
    program.wait_for_log("the session is focused", 1);
    service.kill();
    program.wait_for_log("trying again", 2);
    assert!(program.is_running());
    service.restart();
    let ended = program.wait();
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    for line in ended.err.lines().filter(|line| line.contains("trying again")) {
        println!("{line}");
    }
    let lost = ended.err.lines().find(|line| line.contains("trying again")).unwrap();
    assert!(lost.contains("the XrInstance was lost"), "{lost}");
    let figures = figures(&ended);
    assert_eq!((figures.sessions, figures.lost, figures.rendered), (2, 1, 60), "{figures:?}");
    // The frame in which the runtime was lost counts neither as rendered nor as not wanted.
    assert!(figures.frames - figures.rendered - figures.not_wanted <= 1, "{figures:?}");
}

/// If the end of a session is requested, it passes through the runtime's states to its exit, which is a separate step.
fn exit_is_requested(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut watcher = Watcher::start(&service, &HeadsetSettings::default());
    watcher.next_frame();
    let lines = watcher.end();
    let states: Vec<&str> = lines
        .iter()
        .filter_map(|line| if let Line::State(state) = line { Some(state.as_str()) } else { None })
        .collect();
    println!("{states:?}");
    assert_eq!((states.last(), lines.last()), (Some(&"exiting"), Some(&Line::Exited(true))));
    let frames = frames(&lines);
    let last = frames.last().unwrap();
    let wanted = frames.iter().filter(|frame| frame.eyes.is_some()).count() as u64;
    assert_eq!((last.rendered, last.rendered + last.not_wanted), (wanted, frames.len() as u64));
    assert!(frames.windows(2).all(|two| two[0].display_time_ns < two[1].display_time_ns));
}

/// With every layout, format and scale, the session has the requested properties and shows frames.
fn settings_make_sessions(monado: &'static Monado) {
    const MADE: &str = "llvmpipe (LLVM ";
    let service = Service::remote(monado);
    // The recommended size is 320 x 240 px.
    let cases = [
        (vec![], "a swapchain with two layers of [[320, 240], [320, 240]] px, "),
        (
            vec!["swapchains='array'", "format='rgba16f'"],
            "a swapchain with two layers of [[320, 240], [320, 240]] px, Rgba16Float",
        ),
        (vec!["swapchains='two'", "format='rgba16f'"], "two swapchains of [[320, 240], [320, 240]] px, Rgba16Float"),
        (
            vec!["swapchains='two'", "format='rgba8_srgb'"],
            "two swapchains of [[320, 240], [320, 240]] px, Rgba8UnormSrgb",
        ),
        (
            vec!["swapchains='array'", "format='bgra8_srgb'"],
            "two layers of [[320, 240], [320, 240]] px, Bgra8UnormSrgb",
        ),
        (vec!["resolution_scale=1.5", "reference_space='stage'"], "of [[480, 360], [480, 360]] px, "),
        (vec!["resolution_scale=0.3", "reference_space='local'"], "of [[96, 72], [96, 72]] px, "),
    ];
    for (settings, made) in cases {
        let settings: Vec<String> = settings.iter().map(|setting| format!("headset.{setting}")).collect();
        let mut arguments = vec!["xr", "--frames", "3"];
        settings.iter().for_each(|setting| arguments.extend(["--set", setting]));
        let scene = "[scene]\ncatalogues = ['builtin:bright']\n";
        let ended = Program::steradian(service.command(executable()), &arguments, scene).wait();
        assert_eq!(ended.code, Some(0), "{settings:?}: {}", ended.err);
        let line = ended.err.lines().find(|line| line.contains(MADE) && line.contains(" INFO headset: ")).unwrap();
        println!("{settings:?}: {line}");
        assert!(line.contains(made), "{settings:?}: {line}");
        assert!(ended.out.contains(": 3 rendered"), "{}", ended.out);
    }
}

/// The origin of the stage is on the floor, and that of the local space is at the initial position of the head.
fn spaces_have_their_origins(monado: &'static Monado) {
    let service = Service::remote(monado);
    for (reference_space, floor_m) in [(ReferenceSpace::Stage, 0.0), (ReferenceSpace::Local, 1.6)] {
        let mut watcher = Watcher::start(&service, &HeadsetSettings { reference_space, ..HeadsetSettings::default() });
        let (runtime, system, sizes) = watcher.connected();
        assert!(runtime.starts_with("Monado") && system.contains("Remote HMD"), "{runtime}, {system}");
        let eyes = watcher.next_frame().eyes.unwrap();
        assert_eq!([eyes[0].size, eyes[1].size], sizes);
        println!("{reference_space:?}: {:?}", eyes.clone().map(|eye| eye.position_m));
        assert!(eyes.iter().all(|eye| (eye.position_m[1] - (1.6 - floor_m)).abs() < 1e-6), "{eyes:?}");
        watcher.end();
    }
}

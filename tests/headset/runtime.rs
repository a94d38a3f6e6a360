//! The runtime itself: that it is there, gives what it is sent, ends and comes back, and that its absence is told.

use std::{path::Path, time::Duration};

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::monado::{
    Buttons, Controller, Driver, Eye, Lifetime, Monado, Pose, RemoteState, Service,
    harness::{Inner, Test},
};

/// How long an inner function may take; each takes less than a second on an idle machine.
const LIMIT: Duration = Duration::from_secs(120);

pub const TESTS: &[Test] = &[
    Test::WithMonado("runtime_answers", runtime_answers),
    Test::WithMonado("poses_and_buttons_are_those_sent", poses_and_buttons_are_those_sent),
    Test::WithMonado("recentring_moves_the_local_space", recentring_moves_the_local_space),
    Test::WithMonado("service_outlives_programs_and_comes_back_when_killed", service_outlives_programs),
    Test::WithMonado("service_ends_with_its_program_if_asked_to", service_ends_with_its_program),
    Test::WithMonado("validation_layer_complains_of_what_is_wrong_only", validation_layer_complains),
    Test::WithMonado("failing_program_is_reported", failing_program_is_reported),
    Test::WithMonado("steradian_runs_with_the_driver_of_monado", steradian_runs_with_the_driver_of_monado),
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    Test::Anywhere("missing_runtime_is_shown", missing::runtime_is_shown),
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    Test::Anywhere("script_says_what_is_missing", missing::script_says_what),
];

pub const INNERS: &[Inner] = &[
    ("describe_runtime", programs::describe_runtime),
    ("observe", programs::observe),
    ("ask_for_nonsense", programs::ask_for_nonsense),
    ("fail", programs::fail),
];

/// What a program learns of the runtime before it draws.
#[derive(Debug, Serialize, Deserialize)]
struct Runtime {
    name: String,
    version: String,
    system: String,
    view_configurations: Vec<String>,
    /// Recommended size of each eye's image, pixels.
    sizes: Vec<[u32; 2]>,
}

/// What a program sees of the remote driver's state.
#[derive(Debug, Serialize, Deserialize)]
struct Observation {
    /// Field of view (left, right, up, down, rad), orientation (x, y, z, w) and position (m) of the eyes.
    eyes: Vec<([f32; 4], [f32; 4], [f32; 3])>,
    /// Positions of the eyes in the local space, which a user can recentre, m.
    local_m: Vec<[f32; 3]>,
    /// Of the left and the right controller.
    hands: Vec<Hand>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Hand {
    thumbstick: [f32; 2],
    trigger: f32,
    a_click: bool,
    active: bool,
    orientation: [f32; 4],
    position_m: [f32; 3],
}

fn describe(service: &Service) -> Runtime {
    serde_json::from_str(&service.run_inner("describe_runtime", LIMIT)).unwrap()
}

/// The runtime tells name, version and views, with each driver.
fn runtime_answers(monado: &'static Monado) {
    for (service, system) in [(Service::simulated(monado), "Simulated HMD"), (Service::remote(monado), "Remote HMD")] {
        let runtime = describe(&service);
        println!("{runtime:?}");
        assert!(runtime.name.starts_with("Monado"), "{runtime:?}");
        assert!(runtime.system.contains(system), "{runtime:?}");
        assert!(runtime.view_configurations.contains(&"PRIMARY_STEREO".into()), "{runtime:?}");
        assert_eq!(runtime.sizes.len(), 2, "{runtime:?}");
        assert!(runtime.sizes.iter().flatten().all(|&size| size > 0), "{runtime:?}");
    }
}

/// A program sees the eyes and controllers as they were sent, and not as they were before.
fn poses_and_buttons_are_those_sent(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut remote = service.connect_remote();
    let pose = |angle_rad: f32, position_m| Pose::new(Quat::from_rotation_z(angle_rad), Vec3::from_array(position_m));
    let state = RemoteState {
        eyes: [
            Eye { fov_rad: [-0.9, 0.7, 0.8, -0.6], pose: pose(0.0, [-0.031, 0.001, 0.002]) },
            Eye { fov_rad: [-0.7, 0.95, 0.75, -0.65], pose: pose(0.02, [0.033, 0.0, 0.0]) },
        ],
        head: pose(0.5, [0.25, 1.5, -0.75]),
        controllers: [
            Controller { thumbstick: [0.25, -0.5], trigger: 0.75, ..Controller::at(pose(0.1, [-0.3, 1.0, -0.4])) },
            Controller {
                thumbstick: [-1.0, 1.0],
                buttons: Buttons { a_click: true, ..Buttons::default() },
                ..Controller::at(pose(-0.2, [0.3, 1.1, -0.5]))
            },
        ],
    };
    for state in [state, RemoteState::default(), state] {
        remote.send(&state).unwrap();
        let seen: Observation = serde_json::from_str(&service.run_inner("observe", LIMIT)).unwrap();
        println!("{:?}", seen.eyes);
        for ((eye, pose), (fov_rad, orientation, position_m)) in
            state.eyes.iter().zip(state.eye_poses()).zip(&seen.eyes)
        {
            assert_eq!(*fov_rad, eye.fov_rad);
            assert_close(orientation, &pose.orientation);
            assert_close(position_m, &pose.position_m);
        }
        for (controller, hand) in state.controllers.iter().zip(&seen.hands) {
            assert!(hand.active);
            assert_eq!(hand.thumbstick, controller.thumbstick);
            assert_eq!(hand.trigger.to_bits(), controller.trigger.to_bits());
            assert_eq!(hand.a_click, controller.buttons.a_click);
            assert_close(&hand.orientation, &controller.pose.orientation);
            assert_close(&hand.position_m, &controller.pose.position_m);
        }
        assert_eq!((seen.eyes.len(), seen.hands.len()), (2, 2));
    }
}

/// Poses are combined in f32, by the runtime and by the test.
fn assert_close(seen: &[f32], sent: &[f32]) {
    assert_eq!(seen.len(), sent.len());
    assert!(seen.iter().zip(sent).all(|(seen, sent)| (seen - sent).abs() < 1e-6), "{seen:?} for {sent:?}");
}

/// The local space follows the head's place and heading when the user recentres, and keeps its height, 1.6 m.
fn recentring_moves_the_local_space(monado: &'static Monado) {
    let service = Service::remote(monado);
    let head = Pose::new(Quat::from_rotation_y(0.5), Vec3::new(0.25, 1.5, -0.75));
    let state = RemoteState { head, ..RemoteState::default() };
    service.connect_remote().send(&state).unwrap();
    let observe = || serde_json::from_str::<Observation>(&service.run_inner("observe", LIMIT)).unwrap();
    let lowered = |pose: Pose| (Vec3::from_array(pose.position_m) - 1.6 * Vec3::Y).to_array();
    let before = observe();
    service.control(&["-c"]);
    let after = observe();
    println!("{:?}, then {:?}", before.local_m, after.local_m);
    for (eye, pose) in state.eye_poses().into_iter().enumerate() {
        assert_close(&before.local_m[eye], &lowered(pose));
        let [x_m, y_m, z_m] = state.eyes[eye].pose.position_m;
        assert_close(&after.local_m[eye], &[x_m, y_m + 1.5 - 1.6, z_m]);
        assert_close(&after.eyes[eye].2, &pose.position_m);
    }
}

/// Programs come and go; a killed service takes none until it is started again.
fn service_outlives_programs(monado: &'static Monado) {
    let mut service = Service::remote(monado);
    describe(&service);
    assert!(service.is_running());
    let state = RemoteState { head: Pose::IDENTITY, ..RemoteState::default() };
    for _ in 0..2 {
        service.connect_remote().send(&state).unwrap();
        let before = service.process_id();
        service.kill();
        assert!(!service.is_running());
        let alone = service.run(&mut service.inner("describe_runtime"), LIMIT);
        assert!(alone.is_err(), "a program cannot do without the service: {alone:?}");
        service.restart();
        assert_ne!(service.process_id(), before);
        describe(&service);
    }
}

/// For tests of the end of a service that nobody kills.
fn service_ends_with_its_program(monado: &'static Monado) {
    let mut service = Service::start(monado, Driver::Simulated, Lifetime::UntilProgramLeaves);
    assert!(service.is_running());
    describe(&service);
    let status = service.wait(LIMIT).expect("the service ends");
    assert!(!service.is_running());
    println!("{status}");
    service.restart();
    describe(&service);
    service.quit();
    assert!(!service.is_running());
}

/// The core validation layer is loaded and writes down what is wrong: else no complaint would mean nothing.
fn validation_layer_complains(monado: &'static Monado) {
    let service = Service::remote(monado);
    let folder = tempfile::tempdir().unwrap();
    let complaints = |inner: &str| {
        let log = folder.path().join(inner);
        service.run(service.validated(&mut service.inner(inner), &log), LIMIT).unwrap();
        Service::complaints(&log)
    };
    assert_eq!(complaints("observe"), Vec::<String>::new());
    let wrong = complaints("ask_for_nonsense");
    println!("{wrong:?}");
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert!(wrong[0].contains("VUID-xrEnumerateViewConfigurationViews-viewConfigurationType-parameter"), "{wrong:?}");
}

/// A failure of an inner function is one of its test, and says why.
fn failing_program_is_reported(monado: &'static Monado) {
    let service = Service::simulated(monado);
    let failure = |name, limit| service.run(&mut service.inner(name), limit).unwrap_err();
    let message = failure("fail", LIMIT);
    for part in ["this function fails", "exit status: 101", "The Monado service has started"] {
        assert!(message.contains(part), "{part} in: {message}");
    }
    assert!(failure("unknown", LIMIT).contains("no inner function is named unknown"));
    assert!(failure("describe_runtime", Duration::ZERO).contains("did not end in"));
}

/// The program itself runs through Monado's dynamic linker, and finds Monado's Vulkan driver and no other.
fn steradian_runs_with_the_driver_of_monado(monado: &'static Monado) {
    let service = Service::simulated(monado);
    let mut command = service.command(Path::new(env!("CARGO_BIN_EXE_steradian")));
    let info = service.run(command.arg("info"), LIMIT).unwrap();
    println!("{info}");
    assert!(info.contains("llvmpipe"), "{info}");
    let nowhere = service.run(command.env("VK_DRIVER_FILES", "/dev/null"), LIMIT);
    assert!(nowhere.as_ref().is_err_and(|error| error.contains("adapter")), "{nowhere:?}");
}

/// Where there is no Monado.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod missing {
    use std::{
        path::Path,
        process::{Command, Output},
    };

    use crate::monado::harness::{INNER_VARIABLE, REQUIRE_VARIABLE};

    /// Runs one test of this executable where Monado cannot be had, with the requirement set to a value.
    fn without_monado(required: &str) -> Output {
        Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "runtime_answers"])
            .env_remove(INNER_VARIABLE)
            .env("STERADIAN_MONADO_DIR", "/dev/null/monado")
            .env(REQUIRE_VARIABLE, required)
            .output()
            .unwrap()
    }

    /// Where there is no Monado, a test is shown as ignored with the reason, or fails with it if it is required.
    pub fn runtime_is_shown() {
        let reason = "the folder for Monado cannot be made: /dev/null/monado";
        for required in ["", "0"] {
            let output = without_monado(required);
            let shown = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{shown}");
            let line = shown.lines().find(|line| line.starts_with("test runtime_answers")).unwrap();
            assert!(line.contains("ignored") && line.contains(reason), "{line}");
            assert!(shown.contains("0 passed; 0 failed; 1 ignored"), "{shown}");
        }
        let output = without_monado("1");
        let shown = String::from_utf8_lossy(&output.stdout);
        assert!(!output.status.success(), "{shown}");
        assert!(shown.contains("0 passed; 1 failed; 0 ignored") && shown.contains(reason), "{shown}");
    }

    /// The script ends with code 69 and one clear line where it cannot fetch, and prints no folder.
    pub fn script_says_what() {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/monado.sh");
        let folder = tempfile::tempdir().unwrap();
        // A system with the tools that any has, and none of Debian's.
        let tools = folder.path().join("tools");
        std::fs::create_dir(&tools).unwrap();
        for tool in ["bash", "dirname", "uname", "mkdir", "realpath", "grep", "ls"] {
            let found = std::env::split_paths(&std::env::var_os("PATH").unwrap())
                .map(|folder| folder.join(tool))
                .find(|path| path.exists())
                .unwrap_or_else(|| panic!("no {tool} in PATH"));
            std::os::unix::fs::symlink(found, tools.join(tool)).unwrap();
        }
        let colon = folder.path().join("a:b");
        // A folder that somebody else uses.
        let foreign = folder.path().join("foreign");
        std::fs::create_dir_all(foreign.join("root")).unwrap();
        let path = std::env::var_os("PATH").unwrap();
        let cases = [
            ("no apt-get", folder.path().join("cache"), tools.as_os_str().to_owned(), "there is no apt-get here"),
            ("a colon", colon, path.clone(), "must have no quote, backslash, colon"),
            ("foreign", foreign.clone(), path, "must be a new or an empty one"),
        ];
        for (case, cache, path, reason) in cases {
            let output = Command::new(&script).env("STERADIAN_MONADO_DIR", cache).env("PATH", path).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(69), "{case}: {said}");
            assert!(said.lines().next_back().unwrap().contains(reason), "{case}: {said}");
            assert!(output.stdout.is_empty(), "{case}: {output:?}");
        }
        assert!(foreign.join("root").exists(), "what was there is left alone");
    }
}

/// What runs as a program of the runtime, in a process of its own.
mod programs {
    use openxr::{
        ApplicationInfo, Entry, ExtensionSet, FormFactor, Headless, Instance, Posef, ReferenceSpaceType, Result,
        SystemId, Vector2f, Version, ViewConfigurationType,
    };

    use super::{Hand, Observation, Runtime};

    const STEREO: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;
    const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

    #[allow(unsafe_code, reason = "the loader is a shared library, opened at run time")]
    fn instance() -> (Instance, SystemId) {
        // SAFETY: the library of this name is the OpenXR loader of Debian, which follows the specification.
        let entry = unsafe { Entry::load(&()) }.expect("the OpenXR loader");
        let application = ApplicationInfo {
            application_name: "Steradian's tests",
            application_version: 0,
            engine_name: "",
            engine_version: 0,
            api_version: Version::new(1, 0, 0),
        };
        let mut extensions = ExtensionSet::default();
        extensions.mnd_headless = true;
        extensions.khr_convert_timespec_time = true;
        let instance = entry.create_instance(&application, &extensions, &[], &()).expect("an instance");
        let system = instance.system(FormFactor::HEAD_MOUNTED_DISPLAY).expect("a headset");
        (instance, system)
    }

    pub fn describe_runtime() {
        let (instance, system) = instance();
        let runtime = instance.properties().unwrap();
        let runtime = Runtime {
            name: runtime.runtime_name,
            version: runtime.runtime_version.to_string(),
            system: instance.system_properties(system).unwrap().system_name,
            view_configurations: instance
                .enumerate_view_configurations(system)
                .unwrap()
                .into_iter()
                .map(|configuration| format!("{configuration:?}"))
                .collect(),
            sizes: instance
                .enumerate_view_configuration_views(system, STEREO)
                .unwrap()
                .into_iter()
                .map(|view| [view.recommended_image_rect_width, view.recommended_image_rect_height])
                .collect(),
        };
        println!("{}", serde_json::to_string(&runtime).unwrap());
    }

    #[allow(unsafe_code, reason = "sessions with graphics share handles with a graphics API")]
    pub fn observe() {
        let (instance, system) = instance();
        // SAFETY: a session without graphics shares nothing.
        let (session, _waiter, _stream) =
            unsafe { instance.create_session::<Headless>(system, &openxr::headless::SessionCreateInfo {}) }.unwrap();

        let actions = instance.create_action_set("fly", "Flying", 0).unwrap();
        let hands = HANDS.map(|hand| instance.string_to_path(hand).unwrap());
        let thumbstick = actions.create_action::<Vector2f>("thumbstick", "Thumbstick", &hands).unwrap();
        let trigger = actions.create_action::<f32>("trigger", "Trigger", &hands).unwrap();
        let a_click = actions.create_action::<bool>("a", "A", &hands).unwrap();
        let grip = actions.create_action::<Posef>("grip", "Grip", &hands).unwrap();
        let mut bindings = Vec::new();
        for hand in HANDS {
            let path = |input: &str| instance.string_to_path(&format!("{hand}/input/{input}")).unwrap();
            bindings.push(openxr::Binding::new(&thumbstick, path("thumbstick")));
            bindings.push(openxr::Binding::new(&trigger, path("trigger/value")));
            bindings.push(openxr::Binding::new(&a_click, path("a/click")));
            bindings.push(openxr::Binding::new(&grip, path("grip/pose")));
        }
        let profile = instance.string_to_path("/interaction_profiles/valve/index_controller").unwrap();
        instance.suggest_interaction_profile_bindings(profile, &bindings).unwrap();
        session.attach_action_sets(&[&actions]).unwrap();

        // Actions are given to a session that has the focus.
        let mut storage = openxr::EventDataBuffer::new();
        loop {
            match instance.poll_event(&mut storage).unwrap() {
                Some(openxr::Event::SessionStateChanged(change)) => match change.state() {
                    openxr::SessionState::READY => {
                        session.begin(STEREO).unwrap();
                    }
                    openxr::SessionState::FOCUSED => break,
                    _ => {}
                },
                Some(_) => {}
                None => std::thread::sleep(std::time::Duration::from_millis(5)),
            }
        }
        session.sync_actions(&[(&actions).into()]).unwrap();

        let stage = session.create_reference_space(ReferenceSpaceType::STAGE, Posef::IDENTITY).unwrap();
        let now = instance.now().unwrap();
        let (_, views) = session.locate_views(STEREO, now, &stage).unwrap();
        let local = session.create_reference_space(ReferenceSpaceType::LOCAL, Posef::IDENTITY).unwrap();
        let (_, local_views) = session.locate_views(STEREO, now, &local).unwrap();
        let observation = Observation {
            eyes: views
                .into_iter()
                .map(|view| {
                    let fov = view.fov;
                    let (orientation, position_m) = arrays(view.pose);
                    ([fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down], orientation, position_m)
                })
                .collect(),
            local_m: local_views.into_iter().map(|view| arrays(view.pose).1).collect(),
            hands: hands
                .iter()
                .map(|&hand| -> Result<Hand> {
                    let stick = thumbstick.state(&session, hand)?;
                    let location = grip.create_space(&session, hand, Posef::IDENTITY)?.locate(&stage, now)?;
                    let (orientation, position_m) = arrays(location.pose);
                    Ok(Hand {
                        thumbstick: [stick.current_state.x, stick.current_state.y],
                        trigger: trigger.state(&session, hand)?.current_state,
                        a_click: a_click.state(&session, hand)?.current_state,
                        active: stick.is_active,
                        orientation,
                        position_m,
                    })
                })
                .collect::<Result<_>>()
                .unwrap(),
        };
        println!("{}", serde_json::to_string(&observation).unwrap());
    }

    fn arrays(pose: Posef) -> ([f32; 4], [f32; 3]) {
        let Posef { orientation: q, position: p } = pose;
        ([q.x, q.y, q.z, q.w], [p.x, p.y, p.z])
    }

    /// Calls the runtime with an argument that the specification has no meaning for.
    pub fn ask_for_nonsense() {
        drop(instance());
        let (instance, system) = instance();
        let nonsense = ViewConfigurationType::from_raw(77);
        println!("{:?}", instance.enumerate_view_configuration_views(system, nonsense).unwrap_err());
    }

    pub fn fail() {
        panic!("this function fails");
    }
}

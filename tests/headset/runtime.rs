//! Tests of the runtime itself: it starts, receives the test's state, ends and restarts, and its absence is reported.

use std::{path::Path, time::Duration};

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use steradian::plan::settings::HeadsetSettings;

use crate::{
    monado::{
        Driver, Lifetime, Monado, Pose, RemoteState, Service,
        harness::{Inner, Test},
    },
    wearer::Watcher,
};

/// Time limit of an inner function. Each takes less than a second on an idle machine.
const LIMIT: Duration = Duration::from_secs(120);

pub const TESTS: &[Test] = &[
    Test::WithMonado("runtime_reports_its_properties", runtime_reports_its_properties),
    Test::WithMonado("recentring_moves_the_local_space", recentring_moves_the_local_space),
    Test::WithMonado("service_survives_programs_and_restarts_when_killed", service_outlives_programs),
    Test::WithMonado("service_ends_with_its_program_on_request", service_ends_with_its_program),
    Test::WithMonado("validation_layer_reports_only_errors", validation_layer_complains),
    Test::WithMonado("failing_program_is_reported", failing_program_is_reported),
    Test::WithMonado("steradian_runs_with_the_driver_of_monado", steradian_runs_with_the_driver_of_monado),
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    Test::Anywhere("missing_runtime_is_reported", missing::missing_runtime_is_reported),
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    Test::Anywhere("script_reports_the_missing_part", missing::script_reports_the_reason),
];

pub const INNERS: &[Inner] = &[
    ("describe_runtime", programs::describe_runtime),
    ("call_with_invalid_argument", programs::call_with_invalid_argument),
    ("fail", programs::fail),
];

/// Properties of the runtime that a program reads before it draws.
#[derive(Debug, Serialize, Deserialize)]
struct Runtime {
    name: String,
    version: String,
    system: String,
    view_configurations: Vec<String>,
    /// Recommended size of each eye's image, pixels.
    sizes: Vec<[u32; 2]>,
}

fn describe(service: &Service) -> Runtime {
    serde_json::from_str(&service.run_inner("describe_runtime", LIMIT)).unwrap()
}

/// The runtime reports name, version and views with each driver.
fn runtime_reports_its_properties(monado: &'static Monado) {
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

/// Compares parts of poses with a tolerance, because the runtime and the test combine poses in f32.
fn assert_close(received: &[f64], sent: &[f32]) {
    assert_eq!(received.len(), sent.len());
    assert!(
        received.iter().zip(sent).all(|(received, sent)| (received - f64::from(*sent)).abs() < 1e-6),
        "{received:?} for {sent:?}"
    );
}

/// When the user recentres during a session, the local space moves to the position and heading of the head, but keeps
/// its height of 1.6 m.
fn recentring_moves_the_local_space(monado: &'static Monado) {
    let service = Service::remote(monado);
    let head = Pose::new(Quat::from_rotation_y(0.5), Vec3::new(0.25, 1.5, -0.75));
    let state = RemoteState { head, ..RemoteState::default() };
    service.connect_remote().send(&state).unwrap();
    let lowered = |pose: Pose| (Vec3::from_array(pose.position_m) - 1.6 * Vec3::Y).to_array();
    let mut watcher = Watcher::start(&service, &HeadsetSettings::default());
    let before = watcher.next_frame();
    service.control(&["-c"]);
    let after = watcher.next_frame();
    println!("{before:?}, then {after:?}");
    assert_eq!((before.recentred, after.recentred), (0, 1));
    let (before, after) = (before.eyes.unwrap(), after.eyes.unwrap());
    for (eye, pose) in state.eye_poses().into_iter().enumerate() {
        assert_close(&before[eye].orientation, &pose.orientation);
        assert_close(&before[eye].position_m, &lowered(pose));
        let [x_m, y_m, z_m] = state.eyes[eye].pose.position_m;
        assert_close(&after[eye].orientation, &Pose::IDENTITY.orientation);
        assert_close(&after[eye].position_m, &[x_m, y_m + 1.5 - 1.6, z_m]);
    }
    watcher.end();
}

/// Programs connect and disconnect; a killed service accepts none until it is restarted.
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
        assert!(alone.is_err(), "a program must fail without the service: {alone:?}");
        service.restart();
        assert_ne!(service.process_id(), before);
        describe(&service);
    }
}

/// A service with this lifetime ends when its program ends, without being killed.
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

/// The core validation layer is loaded and records errors: otherwise the absence of complaints would be meaningless.
fn validation_layer_complains(monado: &'static Monado) {
    let service = Service::remote(monado);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("session");
    let mut command = service.inner("watch");
    service.validated(&mut command, &log);
    let mut watcher = Watcher::of(command, &HeadsetSettings::default());
    watcher.next_frame();
    watcher.end();
    assert_eq!(Service::complaints(&log), Vec::<String>::new());
    let log = folder.path().join("nonsense");
    service.run(service.validated(&mut service.inner("call_with_invalid_argument"), &log), LIMIT).unwrap();
    let wrong = Service::complaints(&log);
    println!("{wrong:?}");
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert!(wrong[0].contains("VUID-xrEnumerateViewConfigurationViews-viewConfigurationType-parameter"), "{wrong:?}");
}

/// A failure of an inner function fails its test and gives the reason.
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

/// Steradian runs through Monado's dynamic linker, and finds only Monado's Vulkan driver.
fn steradian_runs_with_the_driver_of_monado(monado: &'static Monado) {
    let service = Service::simulated(monado);
    let mut command = service.command(Path::new(env!("CARGO_BIN_EXE_steradian")));
    let info = service.run(command.arg("info"), LIMIT).unwrap();
    println!("{info}");
    assert!(info.contains("llvmpipe"), "{info}");
    let nowhere = service.run(command.env("VK_DRIVER_FILES", "/dev/null"), LIMIT);
    assert!(nowhere.as_ref().is_err_and(|error| error.contains("adapter")), "{nowhere:?}");
}

/// Tests without Monado.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod missing {
    use std::{
        path::Path,
        process::{Command, Output},
    };

    use crate::monado::harness::{INNER_VARIABLE, REQUIRE_VARIABLE};

    /// Runs one test of this executable without Monado, with a value of the variable that requires it.
    fn without_monado(required: &str) -> Output {
        Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "runtime_reports_its_properties"])
            .env_remove(INNER_VARIABLE)
            .env("STERADIAN_MONADO_DIR", "/dev/null/monado")
            .env(REQUIRE_VARIABLE, required)
            .output()
            .unwrap()
    }

    /// Without Monado, a test is reported as ignored with the reason. If Monado is required, the test fails with this
    /// reason.
    pub fn missing_runtime_is_reported() {
        let reason = "the folder for Monado cannot be created: /dev/null/monado";
        for required in ["", "0"] {
            let output = without_monado(required);
            let report = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{report}");
            let line = report.lines().find(|line| line.starts_with("test runtime_reports_its_properties")).unwrap();
            assert!(line.contains("ignored") && line.contains(reason), "{line}");
            assert!(report.contains("0 passed; 0 failed; 1 ignored"), "{report}");
        }
        let output = without_monado("1");
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(!output.status.success(), "{report}");
        assert!(report.contains("0 passed; 1 failed; 0 ignored") && report.contains(reason), "{report}");
    }

    /// If it cannot fetch Monado, the script exits with 69 and one clear line, and prints no folder.
    pub fn script_reports_the_reason() {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/monado.sh");
        let folder = tempfile::tempdir().unwrap();
        // A system with common tools but without those of Debian.
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
        // A folder with files of another user.
        let foreign = folder.path().join("foreign");
        std::fs::create_dir_all(foreign.join("root")).unwrap();
        let path = std::env::var_os("PATH").unwrap();
        let cases = [
            ("no apt-get", folder.path().join("cache"), tools.as_os_str().to_owned(), "apt-get is missing"),
            ("a colon", colon, path.clone(), "must have no quote, backslash, colon"),
            ("foreign", foreign.clone(), path, "must be new or empty"),
        ];
        for (case, cache, path, reason) in cases {
            let output = Command::new(&script).env("STERADIAN_MONADO_DIR", cache).env("PATH", path).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(69), "{case}: {said}");
            assert!(said.lines().next_back().unwrap().contains(reason), "{case}: {said}");
            assert!(output.stdout.is_empty(), "{case}: {output:?}");
        }
        assert!(foreign.join("root").exists(), "the existing files are unchanged");
    }
}

/// Inner functions that run as programs of the runtime.
mod programs {
    use openxr::{ApplicationInfo, ExtensionSet, FormFactor, Instance, SystemId, Version, ViewConfigurationType};
    use steradian::xr::loader;

    use super::Runtime;

    const STEREO: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;

    fn instance() -> (Instance, SystemId) {
        let application = ApplicationInfo {
            application_name: "Steradian's tests",
            application_version: 0,
            engine_name: "",
            engine_version: 0,
            api_version: Version::new(1, 0, 0),
        };
        let entry = loader().unwrap_or_else(|error| panic!("{error}"));
        let instance = entry.create_instance(&application, &ExtensionSet::default(), &[], &()).expect("an instance");
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

    /// Calls the runtime with an argument that the specification does not define.
    pub fn call_with_invalid_argument() {
        drop(instance());
        let (instance, system) = instance();
        let nonsense = ViewConfigurationType::from_raw(77);
        println!("{:?}", instance.enumerate_view_configuration_views(system, nonsense).unwrap_err());
    }

    pub fn fail() {
        panic!("this function fails");
    }
}

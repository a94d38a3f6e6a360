//! Tests the error messages for a missing loader, runtime or service, and for unsupported requests.

use std::process::Command;

use steradian::{output::Encoding, service::proto::HeadsetStatus};
use tonic::Code;

use crate::{
    monado::{Monado, Service, harness::Test},
    program::{Daemon, Ended, Program, executable},
};

pub const TESTS: &[Test] = &[
    Test::Anywhere("bad_settings_of_the_headset_are_refused", bad_settings),
    Test::WithMonado("xr_reports_missing_parts", xr_reports_missing_parts),
    Test::WithMonado("daemon_runs_without_a_runtime_and_reports_the_reason", daemon_runs_without_headset),
];

const SCENE: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "flat"
type = "perspective"
size = [16, 16]
fov_y_deg = 60.0
[headset]
enabled = true
"#;

/// Exit code for bad usage or configuration, as documented.
const BAD_USAGE: i32 = 64;
/// Exit code if there is no usable adapter or no headset, as documented.
const NO_ADAPTER: i32 = 69;

/// Asserts that the program ended with this exit code and an error line that contains these texts.
fn assert_fails(ended: &Ended, code: i32, texts: &[&str]) {
    let error = ended.err.lines().find(|line| line.starts_with("error: ")).unwrap_or_else(|| panic!("{ended:?}"));
    println!("{code}: {error}");
    assert_eq!(ended.code, Some(code), "{ended:?}");
    for text in texts {
        assert!(error.contains(text), "{text} in: {error}");
    }
    assert_eq!(ended.out, "", "nothing is printed");
}

/// Errors that are detected without a runtime.
fn bad_settings() {
    let cases: [(&[&str], &[&str]); 5] = [
        (&["xr", "--set", "headset.format='png'"], &["headset.format", "png", "rgba16f"]),
        (&["xr", "--set", "headset.swapchains='three'"], &["headset.swapchains", "three"]),
        (&["xr", "--set", "headset.resolution_scale=9"], &["headset.resolution_scale", "9"]),
        (&["xr", "--set", "headset.size=9"], &["size"]),
        (&["--adapter", "some card", "xr"], &["--adapter some card", "the headset's runtime chooses"]),
    ];
    for (arguments, texts) in cases {
        let ended = Program::steradian(Command::new(executable()), arguments, SCENE).wait();
        assert_fails(&ended, BAD_USAGE, texts);
    }
}

/// Each missing part has a specific message and exit code.
fn xr_reports_missing_parts(monado: &'static Monado) {
    let mut service = Service::remote(monado);
    let run = |command: Command| Program::steradian(command, &["xr", "--frames", "1"], SCENE).wait();

    let (_folder, command) = without_loader(monado);
    assert_fails(&run(command), NO_ADAPTER, &["OpenXR loader", "libopenxr-loader1", "Monado or WiVRn"]);

    let mut command = service.command(executable());
    command.env("XR_RUNTIME_JSON", "/dev/null/runtime.json");
    assert_fails(&run(command), NO_ADAPTER, &["no OpenXR runtime answers", "XR_RUNTIME_JSON"]);

    service.kill();
    let ended = run(service.command(executable()));
    assert_fails(&ended, NO_ADAPTER, &["no OpenXR runtime answers", "xrCreateInstance", "monado-service"]);

    service.restart();
    let ended = run(service.command(executable()));
    assert_eq!(ended.code, Some(0), "although all parts are present: {ended:?}");
}

/// Returns a command for a program that finds only an invalid loader.
fn without_loader(monado: &Monado) -> (tempfile::TempDir, Command) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("libopenxr_loader.so.1"), "").unwrap();
    let path = format!("{}:{}", folder.path().display(), monado.library_path);
    let command = Monado { library_path: path, ..monado.clone() }.command(executable());
    (folder, command)
}

/// The daemon serves its other views, reports why there is no headset, and refuses its frames with that reason.
fn daemon_runs_without_headset(monado: &'static Monado) {
    let service = Service::remote(monado);
    let (_folder, no_loader) = without_loader(monado);
    let mut no_manifest = service.command(executable());
    no_manifest.env("XR_RUNTIME_JSON", "/dev/null/runtime.json");
    for (command, text) in [(no_loader, "the OpenXR loader cannot be used"), (no_manifest, "no OpenXR runtime answers")]
    {
        let mut daemon = Daemon::of(command, SCENE);
        let tried = |status: &HeadsetStatus| !status.connected && status.reason.contains(text);
        let headset = daemon.wait_for_headset(|headset| headset.status.as_ref().is_some_and(tried));
        println!("{:?}", headset.status);
        assert!(
            headset.status.as_ref().is_some_and(|status| !status.connected && status.retrying),
            "{:?}",
            headset.status
        );
        assert_eq!((headset.sessions, headset.losses, headset.frames), (0, 0, 0));
        let refused = daemon.frame("headset", Encoding::Rgba8).unwrap_err();
        assert!(refused.code() == Some(Code::Unavailable) && refused.to_string().contains(text), "{refused}");
        assert_eq!(daemon.frame("flat", Encoding::Rgba8).unwrap().images[0].data.len(), 16 * 16 * 4);
        let ended = daemon.terminate();
        assert_eq!(ended.code, Some(0), "{}", ended.err);
    }
}

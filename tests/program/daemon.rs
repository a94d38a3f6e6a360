//! The program as a daemon, with the real renderer and a real socket, ended by real signals.

use std::{
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStderr, ChildStdout, Command, Stdio},
};

use glam::{DQuat, DVec3};
use steradian::{
    catalogue::bright::named_bright_stars,
    config::{ViewKindSpec, ViewSpec},
    output::Encoding,
    photometry::rec709::luminance,
    plan::settings::StarMethod,
    service::{CameraUpdate, Client, ReceivedFrame, SceneUpdate, SettingsChange, ViewUpdate},
    units::illuminance_lx_from_magnitude,
    view::{View, ViewKind},
};
use tonic::Code;

const SIZE: [u32; 2] = [128, 64];

/// A running daemon, killed on drop.
pub(super) struct Daemon {
    process: Child,
    out: BufReader<ChildStdout>,
    err: BufReader<ChildStderr>,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // The daemon may have ended already, as in most tests.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Daemon {
    pub(super) fn start(folder: &Path, catalogue: &str) -> Self {
        Self::start_with(folder, catalogue, &[])
    }

    pub(super) fn start_with(folder: &Path, catalogue: &str, arguments: &[&str]) -> Self {
        Self::start_with_views(folder, catalogue, "", arguments)
    }

    /// Starts a daemon with additional `[[views]]` tables.
    fn start_with_views(folder: &Path, catalogue: &str, views: &str, arguments: &[&str]) -> Self {
        let scene = format!(
            "[scene]\ncatalogues = ['{catalogue}']\n[[views]]\nname = 'all'\ntype = 'equirectangular'\nsize = {SIZE:?}\n{views}"
        );
        std::fs::write(folder.join("sky.toml"), scene).unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["--log", "info", "serve", "--config", "sky.toml", "--listen", "127.0.0.1:0"])
            .args(arguments)
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let out = BufReader::new(process.stdout.take().unwrap());
        let err = BufReader::new(process.stderr.take().unwrap());
        Self { process, out, err }
    }

    pub(super) fn address(&mut self) -> String {
        let mut line = String::new();
        self.out.read_line(&mut line).unwrap();
        line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line}")).to_owned()
    }

    /// Reads the log up to a line that contains `text`.
    fn wait_for_log(&mut self, text: &str) {
        let mut line = String::new();
        while !line.contains(text) {
            line.clear();
            assert!(self.err.read_line(&mut line).unwrap() > 0, "the log ends without `{text}`");
        }
    }

    /// Sends SIGTERM; returns the exit code and the remaining standard output and log.
    pub(super) fn terminate(mut self) -> (Option<i32>, String, String) {
        let kill = Command::new("kill").args(["-TERM", &self.process.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let (mut out, mut err) = (String::new(), String::new());
        self.out.read_to_string(&mut out).unwrap();
        self.err.read_to_string(&mut err).unwrap();
        (self.process.wait().unwrap().code(), out, err)
    }
}

/// Returns the illuminance of all pixels together, lux, and the brightest pixel.
fn light(frame: &ReceivedFrame, view: &View) -> (f64, [u32; 2]) {
    let image = &frame.images[0];
    assert_eq!([image.width, image.height], SIZE);
    let floats: Vec<f32> = image.data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(floats.len(), (3 * SIZE[0] * SIZE[1]) as usize);
    let mapping = view.images[0].projection.mapping();
    let (mut sum_lx, mut most_lx, mut brightest) = (0.0, 0.0, [0; 2]);
    for (i, rgb) in floats.chunks_exact(3).enumerate() {
        let [x, y] = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
        let lx = luminance([0, 1, 2].map(|c| f64::from(rgb[c]))) * mapping.solid_angle_sr(x, y);
        sum_lx += lx;
        if lx > most_lx {
            (most_lx, brightest) = (lx, [x, y]);
        }
    }
    (sum_lx, brightest)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_have_the_light_of_the_stars_for_any_camera_and_after_refusals() {
    let folder = tempfile::tempdir().unwrap();
    let mut daemon = Daemon::start(folder.path(), "builtin:bright");
    let address = daemon.address();
    let mut client = Client::connect(&format!("http://{address}")).await.unwrap();

    let stars = named_bright_stars(0.0);
    let expected_lx: f64 = stars.iter().map(|s| illuminance_lx_from_magnitude(s.star.apparent_magnitude())).sum();
    let sirius = stars.iter().min_by(|a, b| a.star.apparent_magnitude().total_cmp(&b.star.apparent_magnitude()));
    let sirius = sirius.unwrap().star.position.normalize();
    let view = View::new("all", ViewKind::Equirectangular { size: SIZE }, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    let image = &view.images[0];

    let turns = [DQuat::IDENTITY, DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.0)];
    let mut places = Vec::new();
    for turn in turns {
        let update = CameraUpdate { orientation: Some(turn.to_array()), ..CameraUpdate::default() };
        let camera = client.set_camera(&update).await.unwrap();

        let unknown = client.render_frame("none", Encoding::Rgb32f).await.unwrap_err();
        assert_eq!(unknown.code(), Some(Code::NotFound), "{unknown}");
        let nowhere = CameraUpdate { position_m: Some([0.0, f64::NAN, 0.0]), ..CameraUpdate::default() };
        let nowhere = client.set_camera(&nowhere).await.unwrap_err();
        assert_eq!(nowhere.code(), Some(Code::InvalidArgument), "{nowhere}");

        let frame = client.render_frame("all", Encoding::Rgb32f).await.unwrap();
        assert_eq!(frame.camera_revision, camera.revision);
        let (seen_lx, brightest) = light(&frame, &view);
        let error = seen_lx / expected_lx - 1.0;
        println!("{seen_lx:.6e} lx, relative error {error:.1e}; brightest pixel {brightest:?}");
        assert!(error.abs() < 1e-3, "{seen_lx} lx instead of {expected_lx} lx");
        let mapping = image.projection.mapping();
        let centre = glam::DVec2::new(f64::from(brightest[0]) + 0.5, f64::from(brightest[1]) + 0.5);
        let direction = turn * (image.camera_from_view * mapping.direction_from_pixel(centre).unwrap());
        // Pixels are 2.8 degrees wide.
        assert!(direction.angle_between(sirius).to_degrees() < 3.0, "the brightest pixel is not Sirius");
        places.push(brightest);
    }
    assert_ne!(places[0], places[1], "the picture did not turn");
    drop(client);
    let (code, out, err) = daemon.terminate();
    assert_eq!((code, out.as_str()), (Some(0), ""), "{err}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn view_exposure_follows_the_client_and_undrawable_settings_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut daemon = Daemon::start(folder.path(), "builtin:bright");
    let mut client = Client::connect(&format!("http://{}", daemon.address())).await.unwrap();
    let exposed = |text: &str| ViewUpdate {
        exposure: SettingsChange::Replace(toml::from_str(text).unwrap()),
        ..ViewUpdate::default()
    };
    let mut stream = client.stream_frames("all", Encoding::Rgba8, 0.0).await.unwrap();
    let before = stream.next().await.unwrap().unwrap();
    let mut last = before.clone();
    for (text, expected_ev100) in [
        ("mode = 'manual'\nev100 = -9.0", Some(-9.0)),
        ("metering = 'spot'\nspot_deg = 90.0\nadaptation_s = 0.0", None),
        ("metering = 'spot'\nspot_deg = 90.0", None),
        ("metering = 'mean'", None),
        ("", Some(before.exposure_ev100)),
    ] {
        let view = client.update_view("all", &exposed(text), Some(last.scene_revision)).await.unwrap();
        assert_eq!(view.revision, last.scene_revision + 1, "{text}");
        let frame = loop {
            let frame = stream.next().await.unwrap().unwrap();
            if frame.scene_revision == view.revision {
                break frame;
            }
        };
        // The first frame after the change has the new exposure, and so has a frame from a separate request.
        let single = client.render_frame("all", Encoding::Rgba8).await.unwrap();
        for frame in [&frame, &single] {
            let off = frame.exposure_ev100 - expected_ev100.unwrap_or(frame.exposure_ev100);
            assert!(off.abs() < 1e-6 && frame.exposure_ev100.is_finite(), "{text}: {}", frame.exposure_ev100);
        }
        assert!(
            (frame.exposure_ev100 - last.exposure_ev100).abs() > 0.1 || text.starts_with("metering = 'spot'"),
            "{text}"
        );
        assert!(frame.images[0].data != last.images[0].data || text.starts_with("metering = 'spot'"), "{text}");
        last = frame;
    }
    assert_eq!(last.images[0].data, before.images[0].data, "the original settings are restored");
    let sky_cube = ViewUpdate {
        glare: SettingsChange::Replace(toml::from_str("method = 'sky_cube'").unwrap()),
        ..ViewUpdate::default()
    };
    let cell_sky = SceneUpdate { star_method: Some(StarMethod::CellSky), ..SceneUpdate::default() };
    client.update_scene(&cell_sky, None).await.unwrap();
    let refused = client.update_view("all", &sky_cube, None).await.unwrap_err();
    assert!(refused.code() == Some(Code::InvalidArgument) && refused.to_string().contains("cell_sky"), "{refused}");
    client.render_frame("all", Encoding::Png).await.unwrap();
    drop((client, stream));
    let (code, out, err) = daemon.terminate();
    assert_eq!((code, out.as_str()), (Some(0), ""), "{err}");
}

#[test]
fn sigterm_during_loading_exits_cleanly() {
    let folder = tempfile::tempdir().unwrap();
    // The catalogue is a pipe without a writer, so loading it never ends.
    assert!(Command::new("mkfifo").arg(folder.path().join("endless.csv")).status().unwrap().success());
    let mut daemon = Daemon::start(folder.path(), "endless.csv");
    daemon.wait_for_log("loading endless.csv");
    let (code, out, err) = daemon.terminate();
    assert_eq!((code, out.as_str()), (Some(0), ""), "{err}");
    assert!(err.contains("SIGTERM"), "{err}");
}

/// If a daemon is killed during changes, it restores all acknowledged changes.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_daemon_restores_acknowledged_changes() {
    let folder = tempfile::tempdir().unwrap();
    let (mut revision, mut limit) = (0, 0.0);
    for kill in 0..3 {
        let mut daemon = Daemon::start_with(folder.path(), "builtin:bright", &["--state", "state.redb"]);
        let address = daemon.address();
        let mut client = Client::connect(&format!("http://{address}")).await.unwrap();
        let begun = client.scene().await.unwrap();
        assert!(
            begun.revision >= revision && begun.magnitude_limit >= limit || kill == 0,
            "{begun:?} after {revision}"
        );
        limit = if kill == 0 { 1.0 } else { begun.magnitude_limit };
        let killed = tokio::spawn({
            let id = daemon.process.id().to_string();
            async move {
                tokio::time::sleep(std::time::Duration::from_millis(150)).await;
                Command::new("kill").args(["-KILL", &id]).status().unwrap()
            }
        });
        loop {
            // Either both changes apply or none.
            let next = limit + 0.001;
            let quality = Some(next / 2.0);
            let update = SceneUpdate { magnitude_limit: Some(next), quality, ..SceneUpdate::default() };
            let Ok(scene) = client.update_scene(&update, None).await else { break };
            (revision, limit) = (scene.revision, next);
        }
        assert!(killed.await.unwrap().success());
    }
    let mut daemon = Daemon::start_with(folder.path(), "builtin:bright", &["--state", "state.redb"]);
    let address = daemon.address();
    let scene = Client::connect(&format!("http://{address}")).await.unwrap().scene().await.unwrap();
    println!("{} changes", scene.revision);
    // One unacknowledged change may have been stored.
    assert!(scene.revision - revision <= 1 && scene.magnitude_limit - limit < 0.0011, "{scene:?}");
    assert!((scene.quality - scene.magnitude_limit / 2.0).abs() < 1e-12);
    let (code, ..) = daemon.terminate();
    assert_eq!(code, Some(0));
}

/// Views of several types, with and without own settings.
const VIEWS: [&str; 3] = [
    "name = 'dome'\ntype = 'fisheye'\nsize = [96, 96]\nfov_deg = 200.0\nmapping = 'equisolid'\norientation = [0.0, 0.6, 0.0, 0.8]",
    "name = 'eyes'\ntype = 'stereo'\nsize = [48, 40]\nipd_m = 0.064\n\
     fov = { left_deg = -50.0, right_deg = 40.0, up_deg = 45.0, down_deg = -45.0 }\ntest_pattern = true",
    "name = 'scope'\ntype = 'perspective'\nsize = [80, 60]\nfov_y_deg = 33.3\nexposure = { mode = 'manual', ev100 = -7.0 }\n\
     glare = { fraction = 0.3 }\ntone_map = { operator = 'srgb' }",
];

async fn pictures(client: &mut Client) -> Vec<Vec<u8>> {
    let mut pictures = Vec::new();
    for view in ["dome", "eyes", "scope"] {
        let frame = client.render_frame(view, Encoding::Png).await.unwrap();
        pictures.extend(frame.images.into_iter().map(|image| image.data));
    }
    pictures
}

/// A view that a client creates has the same bytes as one from the same table in a configuration, even after the daemon
/// was killed.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn view_made_by_a_client_equals_the_configured_view() {
    let folder = tempfile::tempdir().unwrap();
    let tables: String = VIEWS.iter().map(|table| format!("[[views]]\n{table}\n")).collect();
    let mut daemon = Daemon::start_with_views(folder.path(), "builtin:bright", &tables, &[]);
    let mut client = Client::connect(&format!("http://{}", daemon.address())).await.unwrap();
    let expected = pictures(&mut client).await;
    let defined: Vec<_> = client.views().await.unwrap().into_iter().map(|view| view.definition.unwrap()).collect();
    drop(client);
    assert_eq!(daemon.terminate().0, Some(0));
    assert!(expected.iter().enumerate().all(|(i, one)| !expected[..i].contains(one)), "the pictures are all different");

    let arguments = ["--state", "state.redb"];
    let mut daemon = Daemon::start_with(folder.path(), "builtin:bright", &arguments);
    let mut client = Client::connect(&format!("http://{}", daemon.address())).await.unwrap();
    for table in VIEWS {
        client.create_view(&ViewSpec::from_toml(table).unwrap().0, None).await.unwrap();
    }
    assert!(pictures(&mut client).await == expected, "the pictures of views made by a client differ");
    let kept = client.views().await.unwrap();
    assert_eq!(kept.iter().map(|view| view.definition.clone().unwrap()).collect::<Vec<_>>(), defined);
    // The comparison must detect a different picture.
    let dome = kept.iter().find(|view| view.name == "dome").and_then(|view| view.definition.clone()).unwrap();
    let with_field = |fov_deg: f64| {
        let mut geometry = dome.geometry.clone();
        match &mut geometry.kind {
            ViewKindSpec::Fisheye(fisheye) => fisheye.fov_deg = fov_deg,
            ViewKindSpec::DomeMaster(dome) => dome.fov_deg = fov_deg,
            other => panic!("{other:?}"),
        }
        ViewUpdate { geometry: Some(geometry), ..ViewUpdate::default() }
    };
    client.update_view("dome", &with_field(190.0), None).await.unwrap();
    assert!(pictures(&mut client).await != expected);
    let revision = client.update_view("dome", &with_field(200.0), None).await.unwrap().revision;
    // Kill the daemon.
    daemon.process.kill().unwrap();
    daemon.process.wait().unwrap();
    let mut daemon = Daemon::start_with(folder.path(), "builtin:bright", &arguments);
    let mut client = Client::connect(&format!("http://{}", daemon.address())).await.unwrap();
    let again = client.views().await.unwrap();
    assert!(again.iter().all(|view| view.revision == revision));
    assert_eq!(again.iter().map(|view| view.definition.clone().unwrap()).collect::<Vec<_>>(), defined);
    assert!(pictures(&mut client).await == expected, "the pictures differ after the daemon was killed");
    drop(client);
    assert_eq!(daemon.terminate().0, Some(0));
}

//! Tests a scene with an observer in a running daemon: its time runs, the camera is in the horizon frame, and bodies
//! are found by name.

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use steradian::{
    config::{AirConfig, Config},
    glam::{DQuat, DVec3},
    observer::Frame,
    output::Encoding,
    scene::{Camera, SceneObjects},
    service::{CameraUpdate, Client, GroundForm, ObserverChange, SceneUpdate, SeenKind, ServeOptions},
};
use tokio::time::sleep;
use tonic::Code;

use crate::{
    daemon::{Daemon, small_rig, within},
    spk::{Segment, kernel},
};

const CONFIG: &str = "[scene]\ntime = 2026-11-23T20:00:00Z\n[scene.observer]\nlatitude_deg = 48\nlongitude_deg = 11\n";

fn observed() -> (Config, Camera, Arc<SceneObjects>) {
    let config = Config::from_text(CONFIG, "sky.toml", Path::new("."), &[]).unwrap();
    let (camera, objects) = (config.camera().unwrap(), Arc::new(config.objects().unwrap()));
    (config, camera, objects)
}

fn with_sky(options: &mut ServeOptions) {
    let (config, camera, objects) = observed();
    options.scene.clock = Some(config.clock());
    options.scene.snapshot.camera = camera;
    options.scene.snapshot.objects = objects;
    options.scene.observer = config.scene.observer;
}

fn time(time_s: Option<f64>, time_rate: Option<f64>) -> SceneUpdate {
    SceneUpdate { time_s, time_rate, ..SceneUpdate::default() }
}

/// Returns the position of a body as the daemon reports it.
async fn place_m(client: &mut Client, name: &str) -> DVec3 {
    let scene = client.scene().await.unwrap();
    scene.bodies.iter().find(|form| form.body.name == name).unwrap().body.position_m
}

#[tokio::test]
async fn bodies_and_camera_follow_the_clock() {
    let daemon = Daemon::start_with(small_rig(), with_sky).await;
    let mut client = daemon.client().await;
    let (config, camera, objects) = observed();
    let begin_s = objects.time_s;
    assert_eq!((client.scene().await.unwrap().time_s, client.scene().await.unwrap().time_rate), (begin_s, 0.0));
    let before = client.camera().await.unwrap();
    assert_eq!((before.frame, before.revision), (Frame::Horizon, 0));
    // The time is set an hour later.
    client.update_scene(&time(Some(begin_s + 3600.0), None), None).await.unwrap();
    let later = objects.at(begin_s + 3600.0);
    let expected_m = later.bodies.iter().find(|body| body.name == "moon").unwrap().position_m;
    assert!((place_m(&mut client, "moon").await - expected_m).length() < 1.0);
    let turned = client.camera().await.unwrap();
    let expected = config.camera_at(begin_s + 3600.0).unwrap();
    assert!(turned.world_from_camera.angle_between(expected.world_from_camera) < 1e-7);
    assert_eq!((turned.revision, turned.position_m), (0, camera.position_m), "the camera was not moved");
    // The clock runs forwards and backwards by an hour per second, and frames follow it.
    for rate in [3600.0, -3600.0] {
        let scene = client.update_scene(&time(None, Some(rate)), None).await.unwrap();
        let mut frames = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
        let first = within(frames.next()).await.unwrap().expect("a frame");
        let mut last = within(frames.next()).await.unwrap().expect("a frame");
        for _ in 0..5 {
            last = within(frames.next()).await.unwrap().expect("a frame");
        }
        let angle = first.camera.world_from_camera.angle_between(last.camera.world_from_camera);
        assert!(angle > 1e-4 && first.scene_revision == last.scene_revision, "{angle}");
        let now = client.scene().await.unwrap();
        assert!((now.time_s - scene.time_s) * rate > 0.0 && now.revision == scene.revision);
    }
    // Stop the clock.
    let stopped = client.update_scene(&time(None, Some(0.0)), None).await.unwrap();
    sleep(Duration::from_millis(50)).await;
    assert_eq!(client.scene().await.unwrap().time_s, stopped.time_s);
    let error = client.update_scene(&time(None, Some(1e9)), None).await.unwrap_err();
    assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains("time_rate"), "{error}");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn names_are_found_and_the_camera_is_pointed_at_them() {
    let daemon = Daemon::start_with(small_rig(), with_sky).await;
    let mut client = daemon.client().await;
    let saturn = client.find("Saturn").await.unwrap();
    assert!(saturn.kind == SeenKind::Body && saturn.distance_m.unwrap() > 5e10);
    let camera = client.look_at("saturn", Some(Frame::Horizon)).await.unwrap();
    assert!((camera.world_from_camera * DVec3::NEG_Z).angle_between(saturn.direction) < 1e-7);
    assert_eq!((camera.frame, camera.revision), (Frame::Horizon, 1));
    // A planet is smaller than a pixel, so a direction close to it is sufficient to find it.
    let beside = (saturn.direction + saturn.direction.any_orthonormal_vector() * 2e-3).normalize();
    let identified = client.identify(beside, 0.0, 0).await.unwrap();
    assert_eq!(identified[0].name, "saturn", "{identified:?}");
    assert!((identified[0].separation_deg - 2e-3_f64.to_degrees()).abs() < 1e-4);
    // Mars has not risen yet: the ground hides it.
    let mars = client.find("Mars").await.unwrap();
    assert_eq!(client.identify(mars.direction, 0.0, 0).await.unwrap(), []);
    for name in ["HR 2491", "α CMa", "Alpha Canis Majoris"] {
        assert_eq!(client.find(name).await.unwrap().name, "Sirius", "{name}");
    }
    let star = client.find("alf cma").await.unwrap();
    assert_eq!((star.name.as_str(), star.kind), ("Sirius", SeenKind::Star));
    assert_eq!(client.constellation(star.direction).await.unwrap(), "Canis Major");
    let orion = client.find("orion").await.unwrap();
    assert_eq!((orion.name.as_str(), orion.kind), ("Orion", SeenKind::Constellation));
    assert!((orion.solid_angle_sr.unwrap().to_degrees().to_degrees() - 594.120).abs() < 0.02);
    assert_eq!(client.constellation(orion.direction).await.unwrap(), "Orion");
    let error = client.find("Pluto").await.unwrap_err();
    assert!(error.code() == Some(Code::NotFound) && error.to_string().contains("Pluto"), "{error}");
    // In another frame, the camera keeps its direction while time runs.
    let fixed = client.set_camera(&CameraUpdate { frame: Some(Frame::Icrs), ..CameraUpdate::default() }).await.unwrap();
    let now_s = client.scene().await.unwrap().time_s;
    client.update_scene(&time(Some(now_s + 7200.0), None), None).await.unwrap();
    assert_eq!(client.camera().await.unwrap().world_from_camera, fixed.world_from_camera);
    daemon.shutdown().await.unwrap();
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let error = client.look_at("Sirius", Some(Frame::Horizon)).await.unwrap_err();
    assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains("no observer"), "{error}");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_running_clock_continues_after_a_restart_and_snapshots_keep_their_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    let start = || {
        let state = path.clone();
        Daemon::start_with(small_rig(), |options| {
            with_sky(options);
            options.state = Some(state);
        })
    };
    let daemon = start().await;
    let mut client = daemon.client().await;
    let begin_s = client.scene().await.unwrap().time_s;
    let begun = Instant::now();
    client.update_scene(&time(None, Some(1000.0)), None).await.unwrap();
    client.save_snapshot("evening").await.unwrap();
    let saved_by = begun.elapsed();
    drop(client);
    daemon.shutdown().await.unwrap();
    sleep(Duration::from_millis(200)).await;
    let daemon = start().await;
    let mut client = daemon.client().await;
    let scene = client.scene().await.unwrap();
    assert!(scene.time_rate == 1000.0 && scene.time_s > begin_s + 200.0, "{} s", scene.time_s - begin_s);
    // The snapshot's clock must not have run between saving and loading it, which are at least 200 ms apart.
    let asked = Instant::now();
    client.load_snapshot("evening", None).await.unwrap();
    let restored = client.scene().await.unwrap();
    let most_s = 1000.0 * (saved_by + asked.elapsed()).as_secs_f64() + 10.0;
    let gone_s = restored.time_s - begin_s;
    assert!(restored.time_rate == 1000.0 && gone_s <= most_s, "{gone_s} s, at most {most_s}");
    daemon.shutdown().await.unwrap();
}

/// Returns azimuth and altitude of a body, degrees.
async fn stands_deg(client: &mut Client, name: &str) -> [f64; 2] {
    let direction = client.find(name).await.unwrap().direction;
    let camera = client.look_at(name, Some(Frame::Horizon)).await.unwrap();
    assert!((camera.world_from_camera * DVec3::NEG_Z).angle_between(direction) < 1e-7);
    let scene = client.scene().await.unwrap();
    let (Some(latitude_deg), Some(longitude_deg)) = (scene.observer.latitude_deg, scene.observer.longitude_deg) else {
        panic!("an observer")
    };
    let text = format!("[scene]\n[scene.observer]\nlatitude_deg = {latitude_deg}\nlongitude_deg = {longitude_deg}\n");
    let observer = Config::from_text(&text, "place.toml", Path::new("."), &[]).unwrap().observer().unwrap();
    let local = observer.icrs_from_horizon(scene.time_s).inverse() * direction;
    [local.x.atan2(-local.z), local.y.asin()].map(f64::to_degrees)
}

#[tokio::test]
async fn moving_the_observer_keeps_the_cameras_azimuth() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.redb");
    let started = |options: &mut ServeOptions| {
        with_sky(options);
        options.state = Some(state.clone());
    };
    let daemon = Daemon::start_with(small_rig(), started).await;
    let mut client = daemon.client().await;
    let (_, camera, objects) = observed();
    let at_home = stands_deg(&mut client, "sun").await;
    assert!(at_home[1] < -40.0, "night over Munich: {at_home:?}");
    // Turn the camera back to its initial direction: south, along the horizon.
    let south = CameraUpdate {
        orientation: Some(camera.world_from_camera.to_array()),
        frame: Some(Frame::Horizon),
        ..CameraUpdate::default()
    };
    let before = client.set_camera(&south).await.unwrap();
    let moon_before = client.find("moon").await.unwrap().direction;
    let there = ObserverChange { latitude_deg: Some(-33.87), longitude_deg: Some(151.21), ..ObserverChange::default() };
    let to = |observer: ObserverChange| SceneUpdate { observer, ..SceneUpdate::default() };
    let scene = client.update_scene(&to(there), None).await.unwrap();
    assert_eq!((scene.observer.latitude_deg, scene.observer.height_m), (Some(-33.87), Some(0.0)));
    // The result must equal a configuration for that place.
    let text = CONFIG.replace("= 48", "= -33.87").replace("= 11", "= 151.21");
    let config = Config::from_text(&text, "sydney.toml", Path::new("."), &[]).unwrap();
    let (expected, of_place) = (config.camera().unwrap(), config.objects().unwrap());
    let camera = client.camera().await.unwrap();
    assert!(camera.world_from_camera.angle_between(expected.world_from_camera) < 1e-7);
    assert_eq!((camera.position_m, camera.revision), (before.position_m, before.revision + 1));
    for name in ["moon", "mars", "jupiter"] {
        let expected = of_place.bodies.iter().find(|body| body.name == name).unwrap().position_m - expected.position_m;
        let found = place_m(&mut client, name).await - camera.position_m;
        assert!(found.angle_between(expected) < 1e-8 && (found - expected).length() < 1.0, "{name}");
    }
    // The Moon has moved relative to the stars by its parallax.
    let parallax_deg = client.find("moon").await.unwrap().direction.angle_between(moon_before).to_degrees();
    assert!((0.3..2.0).contains(&parallax_deg), "{parallax_deg}");
    assert!(stands_deg(&mut client, "sun").await[1] > 0.0, "morning over Sydney");
    // Atmosphere and ground.
    let ground =
        GroundForm { enabled: true, albedo: 0.5, horizon_deg: vec![[0.0, 30.0], [180.0, 30.0]], landscape: false };
    let air = AirConfig { night_sky_mag: 18.0, ..AirConfig::default() };
    let around = ObserverChange { air: Some(air.clone()), ground: Some(ground.clone()), ..ObserverChange::default() };
    let scene = client.update_scene(&to(around), None).await.unwrap();
    assert_eq!((scene.observer.air, scene.observer.ground), (Some(air), Some(ground)));
    // Invalid changes have no effect.
    for (change, part) in [
        (ObserverChange { latitude_deg: Some(100.0), ..ObserverChange::default() }, "observer.latitude_deg"),
        (ObserverChange { height_m: Some(f64::NAN), ..ObserverChange::default() }, "observer.height_m"),
        (
            ObserverChange {
                air: Some(AirConfig { pressure_hpa: Some(-1.0), ..AirConfig::default() }),
                ..Default::default()
            },
            "observer.air.pressure_hpa",
        ),
    ] {
        let error = client.update_scene(&to(change), None).await.unwrap_err();
        assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains(part), "{error}");
    }
    let scene = client.scene().await.unwrap();
    let camera = client.camera().await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();
    // The place survives a restart, and the camera is in its horizon frame.
    let daemon = Daemon::start_with(small_rig(), started).await;
    let mut client = daemon.client().await;
    let again = client.scene().await.unwrap();
    assert_eq!((again.observer, again.revision), (scene.observer, scene.revision));
    let turned = client.camera().await.unwrap().world_from_camera.angle_between(camera.world_from_camera);
    assert!(turned < 1e-7, "{turned}");
    assert_eq!(objects.observer.map(|observer| observer.place.height_m), Some(0.0));
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn clients_cannot_add_an_observer() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let observer = ObserverChange { latitude_deg: Some(1.0), ..ObserverChange::default() };
    let error = client.update_scene(&SceneUpdate { observer, ..SceneUpdate::default() }, None).await.unwrap_err();
    assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains("scene.observer"), "{error}");
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn times_outside_the_kernels_are_refused_but_a_running_clock_may_leave_them() {
    const HALF_S: f64 = 3600.0;
    let folder = tempfile::tempdir().unwrap();
    let text = "[scene]\ntime = 2026-11-24T00:00:00Z\nkernels = ['a.bsp']\n[[bodies]]\nname = 'probe'\n\
                ephemeris = 'spk:-82'\nradius_m = 10\ngeometric_albedo = 0.5\n";
    // TDB is 69.184 s ahead.
    let covered_s = [848_750_400.0 + 69.184, HALF_S];
    let place_km = [DVec3::new(1e8, 2e8, -3e7), DVec3::ZERO];
    let probe = Segment { target: -82, centre: 0, axes: 1, covered_s, place_km };
    std::fs::write(folder.path().join("a.bsp"), kernel(&[probe])).unwrap();
    let config = Config::from_text(text, "probe.toml", folder.path(), &[]).unwrap();
    let objects = Arc::new(config.objects().unwrap());
    let begin_s = objects.time_s;
    let started = |options: &mut ServeOptions| {
        options.scene.clock = Some(config.clock());
        options.scene.snapshot.objects = Arc::clone(&objects);
        options.state = Some(folder.path().join("state.redb"));
    };
    let daemon = Daemon::start_with(small_rig(), started).await;
    let mut client = daemon.client().await;
    for sign in [1.0, -1.0] {
        client.update_scene(&time(Some(begin_s + sign * 0.9 * HALF_S), None), None).await.unwrap();
        let error = client.update_scene(&time(Some(begin_s + sign * 1.1 * HALF_S), None), None).await.unwrap_err();
        let message = error.to_string();
        assert!(error.code() == Some(Code::InvalidArgument) && message.contains("bodies.probe"), "{message}");
        assert!(message.contains("2026-11-23T23:01:09.184Z to 2026-11-24T01:01:09.184Z"), "{message}");
    }
    // The clock runs by an hour per millisecond, so it leaves the range of the kernel.
    client.update_scene(&time(None, Some(3.6e6)), None).await.unwrap();
    sleep(Duration::from_millis(50)).await;
    let stopped = client.update_scene(&time(None, Some(0.0)), None).await.unwrap();
    assert!(stopped.time_s > begin_s + 2.0 * HALF_S, "{}", stopped.time_s - begin_s);
    drop(client);
    daemon.shutdown().await.unwrap();
    let daemon = Daemon::start_with(small_rig(), started).await;
    let mut client = daemon.client().await;
    let again = client.scene().await.unwrap();
    assert!(again.revision == stopped.revision && (again.time_s - stopped.time_s).abs() < 1e-6);
    drop(client);
    daemon.shutdown().await.unwrap();
}

/// A client that steers by relative turns does not undo the rotation of the camera with the sky.
#[tokio::test]
async fn a_turn_starts_from_the_camera_of_now() {
    let daemon = Daemon::start_with(small_rig(), with_sky).await;
    let mut client = daemon.client().await;
    let looked = client.look_at("saturn", Some(Frame::Horizon)).await.unwrap();
    client.update_scene(&time(None, Some(36_000.0)), None).await.unwrap();
    sleep(Duration::from_millis(500)).await;
    client.update_scene(&time(None, Some(0.0)), None).await.unwrap();
    let before = client.camera().await.unwrap();
    assert_eq!(before.revision, looked.revision);
    assert!(before.world_from_camera.angle_between(looked.world_from_camera).to_degrees() > 30.0);
    let turn = DQuat::from_rotation_y(0.15);
    let update = CameraUpdate { turn: Some(turn.to_array()), ..CameraUpdate::default() };
    let after = client.move_camera(&update, before.revision).await.unwrap();
    assert!(after.world_from_camera.angle_between(before.world_from_camera * turn) < 1e-9);
    assert_eq!((after.frame, after.position_m), (Frame::Horizon, before.position_m));
    // A turn must not be combined with an absolute orientation, and must be normalised.
    for update in [
        CameraUpdate { orientation: Some([0.0, 0.0, 0.0, 1.0]), ..update },
        CameraUpdate { turn: Some([0.0, 0.0, 0.0, 1.1]), ..update },
    ] {
        let error = client.set_camera(&update).await.unwrap_err();
        assert!(error.code() == Some(Code::InvalidArgument) && error.to_string().contains("turn"), "{error}");
    }
    daemon.shutdown().await.unwrap();
}

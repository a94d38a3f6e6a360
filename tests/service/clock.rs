//! The machine's clock is set forward and back while a scene runs and a client steers.

use std::{
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering::SeqCst},
    },
    time::{Duration, SystemTime},
};

use steradian::{
    output::Encoding,
    service::{CameraUpdate, Lease, SceneUpdate, TimeSource},
};

use crate::daemon::{Daemon, small_rig, within};

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

/// A replacement for the machine's clock, which a test can set.
#[derive(Clone, Default)]
struct MachineClock {
    set_s: Arc<AtomicI64>,
}

impl MachineClock {
    fn set(&self, by_s: i64) {
        self.set_s.store(by_s, SeqCst);
    }

    fn now(&self) -> SystemTime {
        let set_s = self.set_s.load(SeqCst);
        let by = Duration::from_secs(set_s.unsigned_abs());
        if set_s < 0 { SystemTime::now() - by } else { SystemTime::now() + by }
    }
}

fn apart_s(a: SystemTime, b: SystemTime) -> f64 {
    a.duration_since(b).unwrap_or_else(|error| error.duration()).as_secs_f64()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_running_scene_and_timed_poses_go_on_when_the_machines_clock_is_set() {
    let machine = MachineClock::default();
    let time = {
        let machine = machine.clone();
        TimeSource::with_machine(move || machine.now())
    };
    let daemon = Daemon::start_with(small_rig(), |options| options.scene.time = time).await;
    let mut client = daemon.client().await;
    let runs = SceneUpdate { time_s: Some(1e8), time_rate: Some(1.0), ..SceneUpdate::default() };
    client.update_scene(&runs, None).await.unwrap();
    let mut steering = client.steer(Lease::Take, "desk").await.unwrap();
    let mut last_s = 1e8;
    for (turn, set_s) in [0, -3600, -2, 7200, 0].into_iter().enumerate() {
        machine.set(set_s);
        // The time of the scene neither jumps nor stops.
        for _ in 0..3 {
            let next_s = within(async {
                loop {
                    let time_s = client.scene().await.unwrap().time_s;
                    if time_s != last_s {
                        return time_s;
                    }
                }
            })
            .await;
            assert!(next_s > last_s && next_s - last_s < 1000.0, "set by {set_s} s: {last_s} s, then {next_s} s");
            last_s = next_s;
        }
        // Times in the client's poses are those of the machine's clock, and so are the times that the client receives.
        let x = 1.0 + turn as f64;
        assert!(steering.send_for(&at_x(x), machine.now() + Duration::from_millis(100)).await);
        within(async { while client.camera().await.unwrap().position_m.x != x {} }).await;
        let frame = client.render_frame("flat", Encoding::Rgba8).await.unwrap();
        assert_eq!(frame.camera.position_m.x, x);
        for told in [frame.render_time, frame.pose_time] {
            assert!(apart_s(told, machine.now()) < 1000.0, "set by {set_s} s: {told:?}");
        }
    }
    let (camera, poses) = within(steering.end()).await.unwrap();
    assert_eq!((camera.position_m.x, poses), (5.0, 5));
    daemon.shutdown().await.unwrap();
}

/// Starts a movement of the camera from x = 0 to x = 80 in 8 s.
async fn moves(client: &mut steradian::service::Client, name: &str) -> steradian::service::Steering {
    let mut steering = client.steer(Lease::Take, name).await.unwrap();
    let now = SystemTime::now();
    assert!(steering.send_for(&at_x(0.0), now).await);
    assert!(steering.send_for(&at_x(80.0), now + Duration::from_secs(8)).await);
    within(async { while client.camera().await.unwrap().position_m.x == 0.0 {} }).await;
    steering
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn poses_that_wait_end_with_their_stream_and_with_its_lease() {
    let daemon = Daemon::start(small_rig()).await;
    let [mut first, mut second] = [daemon.client().await, daemon.client().await];
    // After an orderly end, the camera rests at the position in the answer.
    let steering = moves(&mut first, "first").await;
    let (rested, _) = within(steering.end()).await.unwrap();
    assert!(rested.position_m.x > 0.0 && rested.position_m.x < 80.0);
    assert_eq!(second.camera().await.unwrap().position_m, rested.position_m);
    // A broken connection.
    second.set_camera(&at_x(0.0)).await.unwrap();
    drop(moves(&mut first, "first").await);
    within(async { while second.camera_holder().await.unwrap() != "" {} }).await;
    let rested = second.camera().await.unwrap();
    assert_eq!(first.camera().await.unwrap().position_m, rested.position_m);
    // If another client takes over the lease, its poses do not wait for those of the first client.
    second.set_camera(&at_x(0.0)).await.unwrap();
    let _steering = moves(&mut first, "first").await;
    let mut taker = second.steer(Lease::TakeOver, "second").await.unwrap();
    assert!(taker.send_for(&at_x(-5.0), SystemTime::now() + Duration::from_millis(50)).await);
    within(async { while first.camera().await.unwrap().position_m.x != -5.0 {} }).await;
    within(taker.end()).await.unwrap();
    daemon.shutdown().await.unwrap();
}

//! The controllers steer the flight of the camera of `serve`: direction, speed, and interaction with clients that set
//! the camera.

use glam::{DQuat, DVec3, Quat, Vec3};
use steradian::{scene::Camera, service::CameraUpdate};

use crate::{
    monado::{Monado, Pose, Remote, RemoteState, Service, harness::Test},
    program::{Daemon, LIMIT},
};

pub const TESTS: &[Test] = &[
    Test::WithMonado("controllers_fly_the_camera", controllers_fly),
    Test::WithMonado("flight_and_clients_move_one_camera", flight_and_clients),
];

const SPEED_M_S: f64 = 20.0;
const TURN_DEG_S: f64 = 90.0;
/// Time between two refreshes of the null compositor's display, s. A frame that takes longer is shown one or more
/// refreshes later.
const REFRESH_S: f64 = 0.05;
/// Longest time step of the camera's movement per frame, s.
const LONGEST_STEP_S: f64 = 0.1;

fn scene() -> String {
    format!(
        r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "flat"
type = "perspective"
size = [16, 16]
fov_y_deg = 60.0
[headset]
enabled = true
resolution_scale = 0.2
flight_m_s = {SPEED_M_S:?}
turn_deg_s = {TURN_DEG_S:?}
"#
    )
}

/// A daemon with a headset and the remote driver.
struct Flyer {
    daemon: Daemon,
    remote: Remote,
    // Declared last, so that it is dropped after the daemon.
    _service: Service,
}

impl Flyer {
    fn start(monado: &'static Monado) -> Self {
        let service = Service::remote(monado);
        let mut daemon = Daemon::start(&service, &scene());
        daemon.wait_for_focus();
        Self { daemon, remote: service.connect_remote(), _service: service }
    }

    /// Waits for frames that begin after the call.
    fn wait_for_frames(&mut self, frames: u64) {
        // Add one, because a frame may have begun before the call.
        let until = self.daemon.headset().frames + frames + 1;
        self.daemon.wait_for_headset(|headset| headset.frames >= until);
    }

    /// Waits until the camera has made this number of steps.
    fn wait_for_steps(&mut self, steps: u64) -> Camera {
        let until = self.daemon.camera().revision + steps;
        let start = std::time::Instant::now();
        loop {
            let camera = self.daemon.camera();
            if camera.revision >= until {
                return camera;
            }
            assert!(start.elapsed() < LIMIT, "the camera does not move: {camera:?}");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }

    /// Flies with the controllers in `state`. Returns the camera at some moment of the flight, and some steps later.
    fn fly(&mut self, state: &RemoteState) -> [Camera; 2] {
        // Set the head first, because it steers from the next frame on.
        self.rest(state.head);
        self.remote.send(state).unwrap();
        let cameras = [self.wait_for_steps(1), self.wait_for_steps(5)];
        self.rest(state.head);
        cameras
    }

    /// Releases the controllers.
    fn rest(&mut self, head: Pose) {
        self.remote.send(&RemoteState { head, ..RemoteState::default() }).unwrap();
        self.wait_for_frames(2);
    }
}

/// Returns a state with a head, thumbsticks (left, right) and triggers (left, right).
fn state(head: Pose, thumbsticks: [[f32; 2]; 2], triggers: [f32; 2]) -> RemoteState {
    let mut state = RemoteState { head, ..RemoteState::default() };
    for hand in 0..2 {
        state.controllers[hand].thumbstick = thumbsticks[hand];
        state.controllers[hand].trigger = triggers[hand];
    }
    state
}

fn controllers_fly(monado: &'static Monado) {
    let mut flyer = Flyer::start(monado);
    let level = RemoteState::default().head;
    let left = Pose::new(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2), Vec3::new(0.3, 1.7, -0.2));
    let down = Pose::new(Quat::from_rotation_x(-0.5), Vec3::new(0.0, 1.6, 0.0));
    let rest = [0.0; 2];
    // Beyond a dead zone of 0.15, deflection grows from 0 to 1.
    let half = (0.5 - 0.15) / 0.85;
    let looks_down = DVec3::new(0.0, -0.5_f64.sin(), -0.5_f64.cos());
    // Name, state, expected direction, and expected speed as a multiple of the base speed.
    let cases = [
        ("forwards", state(level, [[0.0, 1.0], rest], rest), DVec3::NEG_Z, 1.0),
        ("right, half way", state(level, [[0.5, 0.0], rest], rest), DVec3::X, half),
        (
            "backwards to the left",
            state(level, [[-1.0, -1.0], rest], rest),
            DVec3::new(-1.0, 0.0, 1.0).normalize(),
            2_f64.sqrt(),
        ),
        ("up", state(level, [rest, [0.0, 1.0]], rest), DVec3::Y, 1.0),
        ("thrust", state(level, [rest, rest], [0.0, 1.0]), DVec3::NEG_Z, 1.0),
        ("thrust, boosted", state(level, [rest, rest], [1.0, 1.0]), DVec3::NEG_Z, 1000.0),
        // The trigger is at a third of its range beyond the dead zone, which gives one of three decades.
        ("forwards, a third boosted", state(level, [[0.0, 1.0], rest], [0.15 + 0.85 / 3.0, 0.0]), DVec3::NEG_Z, 10.0),
        ("forwards, looking left", state(left, [[0.0, 1.0], rest], rest), DVec3::NEG_X, 1.0),
        ("right, looking left", state(left, [[1.0, 0.0], rest], rest), DVec3::NEG_Z, 1.0),
        ("forwards, looking down", state(down, [[0.0, 1.0], rest], rest), looks_down, 1.0),
        ("up, looking down", state(down, [rest, [0.0, -1.0]], rest), DVec3::NEG_Y, 1.0),
    ];
    let step_range_s = 0.999 * REFRESH_S..1.000_001 * LONGEST_STEP_S;
    for (case, state, direction, speeds) in cases {
        let origin = CameraUpdate { position_m: Some([0.0; 3]), ..CameraUpdate::default() };
        flyer.daemon.call(async |client| client.set_camera(&origin).await).unwrap();
        let [before, after] = flyer.fly(&state);
        let way_m = after.position_m - before.position_m;
        let steps = (after.revision - before.revision) as f64;
        let step_s = way_m.length() / steps / (speeds * SPEED_M_S);
        println!("{case}: {way_m:.3?} m in {steps} steps, so {:.1} ms each", step_s * 1e3);
        // The runtime's quaternions have the precision of f32.
        assert!((way_m.normalize() - direction).length() < 1e-6, "{case}: {way_m:?}");
        assert_eq!(after.world_from_camera, DQuat::IDENTITY, "{case}");
        // The time step is the time between two frames, as reported by the runtime, which is one refresh or more.
        assert!(step_range_s.contains(&step_s), "{case}: {step_s}");
    }

    // The camera turns around the head, whose position does not change. The origin of the local space is 1.6 m above
    // the floor.
    let [before, after] = flyer.fly(&state(left, [rest, [1.0, 0.0]], rest));
    let head_m = DVec3::new(0.3, 0.1, -0.2);
    let turned = after.world_from_camera * before.world_from_camera.conjugate();
    let angle_deg = turned.angle_between(DQuat::IDENTITY).to_degrees();
    let (place, steps) =
        (|camera: &Camera| camera.position_m + camera.world_from_camera * head_m, after.revision - before.revision);
    println!(
        "turned by {angle_deg:.3} deg in {steps} steps; the head moved by {:.1e} m",
        (place(&after) - place(&before)).length()
    );
    assert!((place(&after) - place(&before)).length() < 1e-6);
    assert!((turned * DVec3::Y - DVec3::Y).length() < 1e-9);
    assert!((turned * DVec3::NEG_Z).x > 0.0, "the turn is to the right: {turned:?}");
    let step_s = angle_deg / TURN_DEG_S / steps as f64;
    assert!(step_range_s.contains(&step_s), "{step_s}");

    // After the turn, the forward direction is still the viewing direction of the wearer.
    let [before, after] = flyer.fly(&state(left, [[0.0, 1.0], rest], rest));
    let expected = before.world_from_camera * DVec3::NEG_X;
    assert!(((after.position_m - before.position_m).normalize() - expected).length() < 1e-6);

    // A worn thumbstick that does not return to the centre does not move the camera.
    let before = flyer.daemon.camera();
    flyer.remote.send(&state(level, [[0.14, -0.14], [-0.149, 0.1]], rest)).unwrap();
    flyer.wait_for_frames(10);
    assert_eq!(flyer.daemon.camera(), before);
    // A slightly larger deflection moves the camera within the same waiting time.
    flyer.remote.send(&state(level, [[0.16, 0.0], rest], rest)).unwrap();
    flyer.wait_for_frames(10);
    assert!(flyer.daemon.camera().revision > before.revision + 5);
    assert_eq!(flyer.daemon.terminate().code, Some(0));
}

/// If a client sets the camera during a flight, the flight continues from the client's position.
fn flight_and_clients(monado: &'static Monado) {
    let mut flyer = Flyer::start(monado);
    let forwards = state(RemoteState::default().head, [[0.0, 1.0], [0.0; 2]], [0.0; 2]);
    flyer.remote.send(&forwards).unwrap();
    flyer.wait_for_steps(1);
    let mut last = flyer.daemon.camera();
    for round in 1..=5 {
        let place = [1e6 * f64::from(round), -5.0, 0.0];
        let update =
            CameraUpdate { position_m: Some(place), velocity_c: Some([0.0, 0.1, 0.0]), ..CameraUpdate::default() };
        let set = flyer.daemon.call(async |client| client.set_camera(&update).await).unwrap();
        assert_eq!(set.position_m.to_array(), place);
        assert!(set.revision > last.revision, "{last:?}, {set:?}");
        last = flyer.wait_for_steps(3);
        let [x_m, y_m, z_m] = last.position_m.to_array();
        println!("set revision {} at {place:?}; revision {} at {:.3?}", set.revision, last.revision, last.position_m);
        assert_eq!([x_m, y_m], [place[0], place[1]]);
        let most_m = SPEED_M_S * LONGEST_STEP_S * (last.revision - set.revision) as f64;
        assert!((-most_m * 1.000_001..0.0).contains(&z_m), "{z_m}, {most_m}");
        assert_eq!(last.velocity_c, DVec3::new(0.0, 0.1, 0.0), "the velocity set by the client stays");
    }
    assert_eq!(flyer.daemon.terminate().code, Some(0));
}

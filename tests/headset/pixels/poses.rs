//! Tests for which eyes a frame is drawn.

use glam::{Quat, Vec3};
use steradian::{
    plan::settings::{SwapchainFormat, SwapchainLayout},
    view::Eye,
};

use super::shots::{Assignment, canted_eyes, head, sent_eyes, settings, take};
use crate::monado::{Monado, Pose, RemoteState, Service};

/// Largest difference that f32 causes in a component of an orientation or position.
const LIMIT: f64 = 1e-6;

/// Returns the largest difference of a component, and whether the fields of view are identical.
fn difference(drawn: &[Eye; 2], sent: &[Eye; 2]) -> (f64, bool) {
    let mut worst = 0.0_f64;
    for (drawn, sent) in drawn.iter().zip(sent) {
        // A quaternion and its negative are the same rotation.
        let sign = drawn.room_from_eye.dot(sent.room_from_eye).signum();
        let orientation = (drawn.room_from_eye * sign - sent.room_from_eye).to_array();
        let position = (drawn.position_m - sent.position_m).to_array();
        worst = orientation.iter().chain(&position).fold(worst, |worst, part| worst.max(part.abs()));
    }
    (worst, [0, 1].iter().all(|&eye| drawn[eye].fov == sent[eye].fov))
}

/// Each frame is drawn for exactly the state that was sent before it.
pub fn eyes_are_those_sent(monado: &'static Monado) {
    let service = Service::remote(monado);
    let far = Pose::new(Quat::from_euler(glam::EulerRot::YXZ, 2.5, -0.4, 0.3), Vec3::new(2.25, 0.4, -3.5));
    let states = [
        RemoteState::default(),
        head(Quat::IDENTITY, canted_eyes()),
        head(Quat::from_rotation_z(30_f32.to_radians()), canted_eyes()),
        head(Quat::from_rotation_y(1.0) * Quat::from_rotation_x(0.7), RemoteState::default().eyes),
        RemoteState { head: far, ..head(Quat::IDENTITY, canted_eyes()) },
        RemoteState::default(),
    ];
    let assignments = states.iter().map(|state| Assignment::new(*state, "")).collect();
    let shots = take(&service, settings(SwapchainFormat::Auto, SwapchainLayout::Auto, 0.25), assignments);
    let sent = states.map(|state| sent_eyes(&state, [shots[0].images[0].size; 2]));
    let mut worst = 0.0_f64;
    for (index, shot) in shots.iter().enumerate() {
        let (error, same_fov) = difference(&shot.eyes, &sent[index]);
        assert!(error < LIMIT && same_fov, "state {index}: {error:e}, {:?} for {:?}", shot.eyes, sent[index]);
        worst = worst.max(error);
        // The comparison must fail for other states and for swapped eyes.
        for (other, eyes) in sent.iter().enumerate().filter(|(_, eyes)| **eyes != sent[index]) {
            assert!(difference(&shot.eyes, eyes).0 > 1e3 * LIMIT, "states {index} and {other}");
        }
        let [left, right] = shot.eyes;
        assert!(difference(&[right, left], &sent[index]).0 > 1e3 * LIMIT, "swapped eyes");
    }
    println!("{} states: fields of view exact, orientations and positions within {worst:.1e}", shots.len());
}

//! Converts the runtime's views to eyes of the rig.

use glam::{DQuat, DVec3};
use openxr as xr;

use crate::view::{Eye, Fov, Rig, RigError, View, ViewKind};

/// Returns the field of view of a view of the session: signed angles of the four edges.
pub(super) fn fov_of(view: &xr::View) -> Fov {
    let xr::Fovf { angle_left, angle_right, angle_up, angle_down } = view.fov;
    Fov {
        left_rad: angle_left.into(),
        right_rad: angle_right.into(),
        up_rad: angle_up.into(),
        down_rad: angle_down.into(),
    }
}

/// Returns an eye of the rig from a view of the session: both look along -z with +y up.
pub(super) fn eye_from_view(view: &xr::View, size: [u32; 2]) -> Eye {
    let xr::Posef { orientation: q, position: p } = view.pose;
    // Normalise the quaternion, because the runtime's have only the precision of f32.
    let room_from_eye = DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()).normalize();
    Eye { size, fov: fov_of(view), room_from_eye, position_m: DVec3::new(p.x.into(), p.y.into(), p.z.into()) }
}

/// Returns the rig of a frame: one view with both eyes.
pub(super) fn rig_of(name: &str, eyes: [Eye; 2]) -> Result<Rig, RigError> {
    Rig::new(vec![View::new(name, ViewKind::Headset { eyes }, DQuat::IDENTITY, DVec3::ZERO)?])
}

/// Returns the pose of the head in the room: at the midpoint between the eyes, with their average orientation.
pub(super) fn head(eyes: &[Eye; 2]) -> (DVec3, DQuat) {
    let [left, right] = eyes;
    let middle = (left.position_m + right.position_m) / 2.0;
    // `slerp` takes the shorter way between quaternions that may differ by their sign.
    (middle, left.room_from_eye.slerp(right.room_from_eye, 0.5).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eye_keeps_all_values_of_its_view() {
        let view = xr::View {
            pose: xr::Posef {
                orientation: xr::Quaternionf { x: 0.0, y: 0.6, z: 0.0, w: 0.8 },
                position: xr::Vector3f { x: 1.0, y: 2.0, z: 3.0 },
            },
            fov: xr::Fovf { angle_left: -0.9, angle_right: 0.7, angle_up: 0.6, angle_down: -0.5 },
        };
        let eye = eye_from_view(&view, [10, 20]);
        assert_eq!((eye.size, eye.position_m), ([10, 20], DVec3::new(1.0, 2.0, 3.0)));
        assert!(eye.room_from_eye.angle_between(DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8)) < 1e-7);
        let edges = [eye.fov.left_rad, eye.fov.right_rad, eye.fov.up_rad, eye.fov.down_rad];
        assert_eq!(edges.map(|edge| edge as f32), [-0.9, 0.7, 0.6, -0.5]);
    }

    #[test]
    fn head_is_between_the_eyes_for_either_quaternion_sign() {
        let fov = Fov { left_rad: -0.8, right_rad: 0.8, up_rad: 0.8, down_rad: -0.8 };
        let eye = |angle: f64, sign: f64, x: f64| Eye {
            size: [4, 4],
            fov,
            room_from_eye: DQuat::from_rotation_y(angle) * sign,
            position_m: DVec3::new(x, 1.7, 0.0),
        };
        let (position, orientation) = head(&[eye(0.5, 1.0, -0.03), eye(0.3, -1.0, 0.05)]);
        assert!((position - DVec3::new(0.01, 1.7, 0.0)).length() < 1e-12);
        assert!((orientation * DVec3::NEG_Z - DQuat::from_rotation_y(0.4) * DVec3::NEG_Z).length() < 1e-12);
    }
}

//! Camera changes as clients request them.

use glam::DQuat;

use crate::{
    observer::{Frame, Observer, direction_of_camera},
    scene::{Camera, PoseError, named_unit_quaternion},
};

/// Changes of a camera; `None` keeps a value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraUpdate {
    /// ICRS barycentric position, m.
    pub position_m: Option<[f64; 3]>,
    /// Camera axes to world axes, unit quaternion x, y, z, w.
    pub orientation: Option<[f64; 4]>,
    /// Rotation about the camera's axes, relative to its orientation at the time of the change, unit quaternion x, y, z, w. It replaces
    /// `orientation`.
    pub turn: Option<[f64; 4]>,
    /// Velocity in units of the speed of light, world axes; at most 0.9999 long.
    pub velocity_c: Option<[f64; 3]>,
    /// Reference frame of the axes.
    pub frame: Option<Frame>,
}

impl CameraUpdate {
    /// Returns the camera that results from this change of `old`.
    pub(crate) fn applied_to(&self, old: &Camera) -> Result<Camera, PoseError> {
        let moved = Camera::new(
            self.position_m.unwrap_or(old.position_m.to_array()),
            self.orientation.unwrap_or(old.world_from_camera.to_array()),
            self.velocity_c.unwrap_or(old.velocity_c.to_array()),
        )?;
        let turn = self.turn.map(|turn| named_unit_quaternion("turn", turn)).transpose()?.unwrap_or(DQuat::IDENTITY);
        let world_from_camera = (moved.world_from_camera * turn).normalize();
        Ok(Camera { world_from_camera, frame: self.frame.unwrap_or(old.frame), as_of_s: old.as_of_s, ..moved })
    }
}

/// Direction of a camera for an observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Horizontal {
    /// Azimuth from north through east, 0 to 360.
    pub(crate) azimuth_deg: f64,
    /// Altitude above the horizon, without refraction.
    pub(crate) altitude_deg: f64,
    /// Angle by which the top of the image is turned to the left.
    pub(crate) roll_deg: f64,
}

impl Horizontal {
    /// Returns the direction at a time, s since 2000-01-01T12:00:00Z; `None` without an observer.
    pub(crate) fn new(camera: &Camera, observer: Option<&Observer>, time_s: f64) -> Option<Self> {
        let icrs_from_frame = Frame::Horizon.icrs_from(observer, time_s)?;
        let frame_from_camera = DQuat::from_mat3(&icrs_from_frame).inverse() * camera.world_from_camera;
        let [longitude_rad, latitude_rad, roll_rad] = direction_of_camera(frame_from_camera);
        Some(Self {
            azimuth_deg: Frame::Horizon.longitude_deg(longitude_rad),
            altitude_deg: latitude_rad.to_degrees(),
            roll_deg: roll_rad.to_degrees(),
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;
    use crate::observer::{Clock, Place, frame_from_camera};

    #[test]
    fn the_direction_for_an_observer_is_that_of_a_look() {
        let place = Place { latitude_rad: 0.8, longitude_rad: 0.2, height_m: 100.0 };
        let time_s = 8.2e8;
        let observer = Observer::new(place, Clock::default(), time_s);
        let axes = DQuat::from_mat3(&Frame::Horizon.icrs_from(Some(&observer), time_s).unwrap());
        for [azimuth_deg, altitude_deg, roll_deg] in
            [[0.0, 0.0, 0.0], [90.0, 30.0, 0.0], [181.0, -20.0, 170.0], [359.0, 89.0, -40.0]]
        {
            let longitude_rad = Frame::Horizon.longitude_rad(azimuth_deg);
            let local = frame_from_camera(longitude_rad, f64::to_radians(altitude_deg), f64::to_radians(roll_deg));
            let camera = Camera { world_from_camera: axes * local, ..Camera::default() };
            let seen = Horizontal::new(&camera, Some(&observer), time_s).unwrap();
            let off = |a: f64, b: f64| (a - b + 180.0).rem_euclid(360.0) - 180.0;
            assert!(off(seen.azimuth_deg, azimuth_deg).abs() < 1e-6, "{seen:?}");
            assert!((seen.altitude_deg - altitude_deg).abs() < 1e-6, "{seen:?}");
            assert!(off(seen.roll_deg, roll_deg).abs() < 1e-6, "{seen:?}");
            assert_eq!(Horizontal::new(&camera, None, time_s), None);
            // Ten minutes later, the sky has turned by 2.5 degrees.
            let later = Horizontal::new(&camera, Some(&observer), time_s + 600.0).unwrap();
            assert!(off(later.azimuth_deg, azimuth_deg).abs() + (later.altitude_deg - altitude_deg).abs() > 0.5);
        }
    }

    #[test]
    fn a_turn_is_about_the_axes_of_the_camera() {
        let camera = Camera { world_from_camera: DQuat::from_rotation_z(0.4), ..Camera::default() };
        let turn = DQuat::from_rotation_y(0.3);
        let turned =
            CameraUpdate { turn: Some(turn.to_array()), ..CameraUpdate::default() }.applied_to(&camera).unwrap();
        assert!(turned.world_from_camera.abs_diff_eq(camera.world_from_camera * turn, 1e-12));
        let wrong = CameraUpdate { turn: Some([0.0, 0.0, 0.0, 2.0]), ..CameraUpdate::default() };
        assert!(wrong.applied_to(&camera).unwrap_err().to_string().starts_with("turn = [0.0, 0.0, 0.0, 2.0]"));
    }
}

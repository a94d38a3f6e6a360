//! Flight: converts the state of the controllers to a movement of the camera.

use glam::{DQuat, DVec3};

use super::host::Flight;
use crate::plan::settings::HeadsetSettings;

/// The four controls of flight on both controllers. The type parameters determine what is stored for each control: its state, an action, or a path.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(super) struct Controls<Stick = [f64; 2], Trigger = f64> {
    /// Movement to the right and forwards, each -1 to 1.
    pub(super) translate: Stick,
    /// Turn to the right, and movement upwards, each -1 to 1.
    pub(super) turn_rise: Stick,
    /// Movement forwards, 0 to 1, which is the position of the trigger.
    pub(super) thrust: Trigger,
    /// Speed factor, 0 to 1: beyond the dead zone each tenth multiplies the speed by 10^0.3.
    pub(super) boost: Trigger,
}

/// Deflections of thumbsticks and triggers below this count as rest, because worn ones do not return to 0.
const DEAD_ZONE: f64 = 0.15;
/// Powers of ten between boost 0 and boost 1.
const BOOST_DECADES: f64 = 3.0;
/// Maximum time step of a movement, s. Longer intervals, such as a pause of the runtime, are shortened to it.
const LONGEST_STEP_S: f64 = 0.1;

/// Returns the deflection beyond the dead zone, scaled to 0 to 1.
fn live(value: f64) -> f64 {
    if value.is_nan() {
        return 0.0;
    }
    value.signum() * ((value.abs().min(1.0) - DEAD_ZONE) / (1.0 - DEAD_ZONE)).max(0.0)
}

/// Returns the movement of the camera in `dt_s`. The head (its position and axes in the room) steers: forwards is its viewing direction. Turns are
/// about the room's vertical axis through the head, so that they do not move the wearer through the scene. `None`: at rest.
pub(super) fn flight(
    controls: &Controls,
    dt_s: f64,
    settings: &HeadsetSettings,
    world_from_room: DQuat,
    (head_m, room_from_head): (DVec3, DQuat),
) -> Option<Flight> {
    let dt_s = dt_s.clamp(0.0, LONGEST_STEP_S);
    let [right, forwards] = controls.translate.map(live);
    let [turn, rise] = controls.turn_rise.map(live);
    let [thrust, boost] = [controls.thrust, controls.boost].map(|trigger| live(trigger).max(0.0));
    let forwards = forwards + thrust;
    let speed_m_s = settings.flight_m_s * 10_f64.powf(BOOST_DECADES * boost);
    let in_room = room_from_head * DVec3::new(right, 0.0, -forwards) + DVec3::Y * rise;
    let turned = DQuat::from_rotation_y(-turn * settings.turn_deg_s.to_radians() * dt_s);
    // Translation of the room's origin when turning about the head.
    let pivot_m = head_m - turned * head_m;
    if dt_s == 0.0 || (in_room == DVec3::ZERO && turn == 0.0) {
        return None;
    }
    Some(Flight {
        translation_m: world_from_room * (in_room * (speed_m_s * dt_s) + pivot_m),
        rotation: (world_from_room * turned * world_from_room.conjugate()).normalize(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    const AT_REST: (DVec3, DQuat) = (DVec3::ZERO, DQuat::IDENTITY);

    fn settings() -> HeadsetSettings {
        HeadsetSettings { flight_m_s: 10.0, turn_deg_s: 90.0, ..HeadsetSettings::default() }
    }

    #[test]
    fn head_steers_and_speed_is_independent_of_frame_rate() {
        let controls = Controls { translate: [0.0, 1.0], ..Controls::default() };
        let step = flight(&controls, 0.02, &settings(), DQuat::IDENTITY, AT_REST).unwrap();
        assert!((step.translation_m - DVec3::new(0.0, 0.0, -0.2)).length() < 1e-12, "{step:?}");
        let looks_left = (DVec3::new(0.3, 1.7, 0.2), DQuat::from_rotation_y(FRAC_PI_2));
        let step = flight(&controls, 0.04, &settings(), DQuat::from_rotation_x(FRAC_PI_2), looks_left).unwrap();
        assert!((step.translation_m - DVec3::new(-0.4, 0.0, 0.0)).length() < 1e-12, "{step:?}");
        assert!(step.rotation.angle_between(DQuat::IDENTITY) < 1e-7);
        let boosted = Controls { boost: 1.0, ..controls };
        let step = flight(&boosted, 5.0, &settings(), DQuat::IDENTITY, AT_REST).unwrap();
        assert!((step.translation_m.length() - 1000.0).abs() < 1e-9, "a pause counts as a tenth of a second at most");
    }

    #[test]
    fn turning_keeps_the_head_in_place() {
        let controls = Controls { turn_rise: [1.0, 0.0], ..Controls::default() };
        let world_from_room = DQuat::from_rotation_z(0.7);
        let head = (DVec3::new(1.0, 1.7, -2.0), DQuat::from_rotation_x(0.3));
        let step = flight(&controls, 0.1, &settings(), world_from_room, head).unwrap();
        // Position of the head before and after the turn: the position of the camera plus the offset of the head in the camera's axes.
        let before = world_from_room * head.0;
        let after = step.translation_m + step.rotation * world_from_room * head.0;
        assert!((before - after).length() < 1e-12);
        let turned = (step.rotation * world_from_room) * DVec3::NEG_Z;
        let expected = world_from_room * (DQuat::from_rotation_y(-9_f64.to_radians()) * DVec3::NEG_Z);
        assert!((turned - expected).length() < 1e-12, "to the right");
    }

    #[test]
    fn worn_thumbsticks_and_nan_do_not_move() {
        for value in [0.0, 0.14, -0.149, f64::NAN] {
            let controls = Controls { translate: [value; 2], turn_rise: [value; 2], thrust: value, boost: value };
            assert_eq!(flight(&controls, 0.02, &settings(), DQuat::IDENTITY, AT_REST), None, "{value}");
        }
        let pushed = Controls { thrust: 1.0, ..Controls::default() };
        assert_eq!(flight(&pushed, 0.0, &settings(), DQuat::IDENTITY, AT_REST), None, "no time has passed");
        let step = flight(&pushed, 0.1, &settings(), DQuat::IDENTITY, AT_REST).unwrap();
        assert!((step.translation_m - DVec3::new(0.0, 0.0, -1.0)).length() < 1e-12);
        assert_eq!(live(1.0), 1.0);
        assert_eq!(live(-2.0), -1.0);
    }
}

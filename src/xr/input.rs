//! Controllers: the actions of flight, and their bindings to buttons and sticks of common controllers.

use openxr as xr;

use super::{
    error::{During, XrError},
    flight::Controls,
};

/// Bindings of one type of controller, as paths.
struct Profile {
    path: &'static str,
    inputs: Controls<Option<&'static str>, &'static str>,
}

const THUMBSTICKS: [&str; 2] = ["/user/hand/left/input/thumbstick", "/user/hand/right/input/thumbstick"];
const TRACKPADS: [&str; 2] = ["/user/hand/left/input/trackpad", "/user/hand/right/input/trackpad"];

/// Bindings for a controller in each hand, each with a trigger and a stick or pad. The left hand controls direction and speed, the right hand turn,
/// rise and thrust.
const fn pair(path: &'static str, [left, right]: [&'static str; 2]) -> Profile {
    Profile {
        path,
        inputs: Controls {
            translate: Some(left),
            turn_rise: Some(right),
            thrust: "/user/hand/right/input/trigger/value",
            boost: "/user/hand/left/input/trigger/value",
        },
    }
}

const PROFILES: [Profile; 5] = [
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        inputs: Controls {
            translate: None,
            turn_rise: None,
            thrust: "/user/hand/right/input/select/click",
            boost: "/user/hand/left/input/select/click",
        },
    },
    pair("/interaction_profiles/oculus/touch_controller", THUMBSTICKS),
    pair("/interaction_profiles/valve/index_controller", THUMBSTICKS),
    pair("/interaction_profiles/microsoft/motion_controller", THUMBSTICKS),
    pair("/interaction_profiles/htc/vive_controller", TRACKPADS),
];

/// The actions of a session.
pub(super) struct Input {
    set: xr::ActionSet,
    actions: Controls<xr::Action<xr::Vector2f>, xr::Action<f32>>,
}

impl Input {
    /// Creates the actions and attaches them to the session.
    pub(super) fn attach(session: &xr::Session<xr::Vulkan>) -> Result<Self, XrError> {
        let instance = session.instance();
        let set = instance.create_action_set("flight", "Flight", 0).during("xrCreateActionSet")?;
        let call = "xrCreateAction";
        let actions = Controls {
            translate: set.create_action("translate", "Fly", &[]).during(call)?,
            turn_rise: set.create_action("turn_rise", "Turn and rise", &[]).during(call)?,
            thrust: set.create_action("thrust", "Thrust", &[]).during(call)?,
            boost: set.create_action("boost", "Faster", &[]).during(call)?,
        };
        for Profile { path: profile, inputs } in &PROFILES {
            let path = |text: &str| instance.string_to_path(text).during("xrStringToPath");
            let mut bindings = vec![
                xr::Binding::new(&actions.thrust, path(inputs.thrust)?),
                xr::Binding::new(&actions.boost, path(inputs.boost)?),
            ];
            for (action, place) in [(&actions.translate, inputs.translate), (&actions.turn_rise, inputs.turn_rise)] {
                if let Some(place) = place {
                    bindings.push(xr::Binding::new(action, path(place)?));
                }
            }
            if let Err(result) = instance.suggest_interaction_profile_bindings(path(profile)?, &bindings) {
                // A runtime need not support every controller.
                tracing::info!("headset: the runtime does not accept bindings of {profile}: {result}");
            }
        }
        session.attach_action_sets(&[&set]).during("xrAttachSessionActionSets")?;
        Ok(Self { set, actions })
    }

    /// Returns the current state of the controllers. They are at rest while the session has no focus.
    pub(super) fn read(&self, session: &xr::Session<xr::Vulkan>) -> Result<Controls, XrError> {
        session.sync_actions(&[(&self.set).into()]).during("xrSyncActions")?;
        let none = xr::Path::NULL;
        let pair = |action: &xr::Action<xr::Vector2f>| -> Result<[f64; 2], XrError> {
            let state = action.state(session, none).during("xrGetActionStateVector2f")?;
            let value = [f64::from(state.current_state.x), f64::from(state.current_state.y)];
            Ok(if state.is_active { value } else { [0.0; 2] })
        };
        let one = |action: &xr::Action<f32>| -> Result<f64, XrError> {
            let state = action.state(session, none).during("xrGetActionStateFloat")?;
            Ok(if state.is_active { f64::from(state.current_state) } else { 0.0 })
        };
        Ok(Controls {
            translate: pair(&self.actions.translate)?,
            turn_rise: pair(&self.actions.turn_rise)?,
            thrust: one(&self.actions.thrust)?,
            boost: one(&self.actions.boost)?,
        })
    }
}

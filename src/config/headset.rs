//! Ranges of the numbers in `[headset]`, whose types are the planner's own, and its name.

use super::{
    error::{Fault, finite},
    views::ViewConfig,
};
use crate::{plan::settings::HeadsetSettings, view::check_name};

pub(super) fn check(headset: &HeadsetSettings) -> Result<(), Fault> {
    check_name(&headset.name).map_err(|error| Fault::new("name", error.to_string()))?;
    finite("resolution_scale", headset.resolution_scale)?;
    if !(0.1..=4.0).contains(&headset.resolution_scale) {
        let problem = format!("{}: allowed are factors from 0.1 to 4", headset.resolution_scale);
        return Err(Fault::new("resolution_scale", problem));
    }
    finite("flight_m_s", headset.flight_m_s)?;
    if !(headset.flight_m_s > 0.0 && headset.flight_m_s <= 1e12) {
        return Err(Fault::new(
            "flight_m_s",
            format!("{}: allowed are speeds above 0 up to 1e12 m/s", headset.flight_m_s),
        ));
    }
    finite("turn_deg_s", headset.turn_deg_s)?;
    if !(0.0..=360.0).contains(&headset.turn_deg_s) {
        return Err(Fault::new("turn_deg_s", format!("{}: allowed are 0 to 360 deg/s", headset.turn_deg_s)));
    }
    Ok(())
}

/// Clients tell the headset from the views by its name. One that `serve` does not drive is in nobody's way.
pub(super) fn check_views(headset: &HeadsetSettings, views: &[ViewConfig]) -> Result<(), Fault> {
    let twin = views.iter().position(|view| headset.enabled && view.name == headset.name);
    twin.map_or(Ok(()), |index| {
        let problem = format!("views[{index}] has the name `{}` too: names must be unique", headset.name);
        Err(Fault::new("name", problem))
    })
}

//! Checks of `[headset]`: its name must differ from those of the views.

use super::{error::Fault, views::ViewSpec};
use crate::{plan::settings::HeadsetSettings, view::check_name};

pub(super) fn check(headset: &HeadsetSettings) -> Result<(), Fault> {
    check_name(&headset.name).map_err(|error| Fault::new("name", error.to_string()))
}

/// Clients refer to the headset and to views by name, so the names must differ, unless `serve` drives no headset.
pub(super) fn check_views(headset: &HeadsetSettings, views: &[ViewSpec]) -> Result<(), Fault> {
    let twin = views.iter().position(|view| headset.enabled && view.name == headset.name);
    twin.map_or(Ok(()), |index| {
        let problem = format!("views[{index}] has the name `{}` too: names must be unique", headset.name);
        Err(Fault::new("name", problem))
    })
}

//! Checks of `[headset]`: its name must differ from those of the views.

use super::views::ViewSpec;
use crate::ranges::KeyError;
use crate::{plan::settings::HeadsetSettings, view::check_name};

pub(super) fn check(headset: &HeadsetSettings) -> Result<(), KeyError> {
    check_name(&headset.name).map_err(|error| KeyError::new("name", error.to_string()))
}

/// Clients refer to the headset and to views by name, so the names must differ, unless `serve` drives no headset.
pub(super) fn check_views(headset: &HeadsetSettings, views: &[ViewSpec]) -> Result<(), KeyError> {
    let twin = views.iter().position(|view| headset.enabled && view.name == headset.name);
    twin.map_or(Ok(()), |index| {
        let problem = format!("views[{index}] also has the name `{}`: names must be unique", headset.name);
        Err(KeyError::new("name", problem))
    })
}

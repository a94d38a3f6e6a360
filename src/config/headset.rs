//! The name in `[headset]`, whose types are the planner's own. The ranges of its numbers stand in [`super::ranges`].

use super::{error::Fault, views::ViewConfig};
use crate::{plan::settings::HeadsetSettings, view::check_name};

pub(super) fn check(headset: &HeadsetSettings) -> Result<(), Fault> {
    check_name(&headset.name).map_err(|error| Fault::new("name", error.to_string()))
}

/// Clients tell the headset from the views by its name. Where `serve` drives no headset, the name may be taken.
pub(super) fn check_views(headset: &HeadsetSettings, views: &[ViewConfig]) -> Result<(), Fault> {
    let twin = views.iter().position(|view| headset.enabled && view.name == headset.name);
    twin.map_or(Ok(()), |index| {
        let problem = format!("views[{index}] has the name `{}` too: names must be unique", headset.name);
        Err(Fault::new("name", problem))
    })
}

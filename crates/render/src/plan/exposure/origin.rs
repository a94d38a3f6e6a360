//! Origin of the automatic exposure of a frame, if it does not follow from the frame's own views.

use std::borrow::Cow;

use crate::{
    plan::{
        PlanError,
        settings::{Metering, RenderSettings},
        view_settings::{meter_settings, spot_rig},
    },
    view::Rig,
};

/// Origin of the automatic exposure of a frame.
#[derive(Clone, Debug)]
pub enum ExposureOrigin<'a> {
    /// The frame itself: its plan or its light.
    Own,
    /// The plan of the views that share the exposure.
    Plan,
    /// The light of another picture, which is metered.
    Picture {
        /// Views of the picture.
        rig: Cow<'a, Rig>,
        /// Settings with which the picture is drawn.
        settings: Box<RenderSettings>,
    },
}

impl<'a> ExposureOrigin<'a> {
    /// Returns the origin for a frame whose exposure is that of the views of `rig` with these settings. `has_other_views`: the frame itself draws
    /// other views or has other settings.
    ///
    /// # Errors
    ///
    /// The angle of `spot` metering is not valid for a fisheye picture.
    pub fn new(rig: &'a Rig, settings: &RenderSettings, has_other_views: bool) -> Result<Self, PlanError> {
        let exposure = &settings.exposure;
        if has_other_views && exposure.uses(Metering::LimitingMagnitude) {
            return Ok(Self::Plan);
        }
        let metered = match spot_rig(rig, exposure)? {
            Some(spot) => Some(Cow::Owned(spot)),
            None if has_other_views && exposure.uses(Metering::Mean) => Some(Cow::Borrowed(rig)),
            None => None,
        };
        Ok(metered.map_or(Self::Own, |rig| Self::Picture { rig, settings: Box::new(meter_settings(settings)) }))
    }
}

//! Settings of single views, and the division of a rig into frames: views that are drawn alike and share one exposure form one frame; the others form
//! separate frames.
//!
//! A group of views shares one exposure, even if the views differ in other settings. It is computed for all views of the group together, with the
//! glare and the tone mapping of the first view. Without settings of single views all views are one frame.

use super::settings::{
    AutoExposure, ExposureSettings, GlareSettings, Meter, Metering, RenderSettings, ToneMapSettings,
};
use crate::view::{Rig, RigError, View, ViewKind, projection::FisheyeMapping};

use glam::{DQuat, DVec2, DVec3};

/// Views that share an exposure.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ExposureGroup {
    /// Every view without its own exposure.
    #[default]
    General,
    /// The views that name this group.
    Named(String),
    /// The view of that name alone: it has its own exposure.
    OfView(String),
}

/// How a view is exposed and shown.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSettings {
    /// Views that share its exposure.
    pub group: ExposureGroup,
    /// Exposure, the same for all views of the group.
    pub exposure: ExposureSettings,
    /// Glare.
    pub glare: GlareSettings,
    /// Tone mapping.
    pub tone_map: ToneMapSettings,
}

impl ViewSettings {
    /// Settings of a view without settings in the configuration.
    pub fn general(settings: &RenderSettings) -> Self {
        Self {
            group: ExposureGroup::General,
            exposure: settings.exposure,
            glare: settings.glare.clone(),
            tone_map: settings.tone_map,
        }
    }

    /// These settings, together with those that all views have in common.
    fn of_frame(&self, common: &RenderSettings) -> RenderSettings {
        RenderSettings { exposure: self.exposure, glare: self.glare.clone(), tone_map: self.tone_map, ..common.clone() }
    }
}

/// Views that are drawn as one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameGroup {
    /// Their numbers in the whole rig, ascending.
    pub views: Vec<usize>,
    /// These views alone.
    pub rig: Rig,
    /// How they are drawn.
    pub settings: RenderSettings,
    /// Views that share their exposure.
    pub exposure_group: ExposureGroup,
    /// The views and settings that determine the exposure, if they are not the frame's own.
    pub exposed_as: Option<(Rig, RenderSettings)>,
}

/// Divides the views of a rig into frames. Frames with the general exposure come first; the others are in the order of their first views. `views` has
/// the settings of each view in the order of the rig. Views beyond its end have the common settings.
pub fn frame_groups(rig: &Rig, common: &RenderSettings, views: &[ViewSettings]) -> Vec<FrameGroup> {
    let general = ViewSettings::general(common);
    let of_view = |index: usize| views.get(index).unwrap_or(&general);
    let count = rig.views().len();
    let mut alike: Vec<Vec<usize>> = Vec::new();
    for index in 0..count {
        match alike.iter_mut().find(|group| of_view(group[0]) == of_view(index)) {
            Some(group) => group.push(index),
            None => alike.push(vec![index]),
        }
    }
    alike.sort_by_key(|members| of_view(members[0]).group != ExposureGroup::General);
    alike
        .into_iter()
        .map(|members| {
            let own = of_view(members[0]);
            let sharing: Vec<usize> = (0..count).filter(|&index| of_view(index).group == own.group).collect();
            let exposed_as =
                (sharing != members).then(|| (rig.of_views(&sharing), of_view(sharing[0]).of_frame(common)));
            FrameGroup {
                rig: rig.of_views(&members),
                settings: own.of_frame(common),
                exposure_group: own.group.clone(),
                exposed_as,
                views: members,
            }
        })
        .collect()
}

/// Side of the picture in which a spot is metered, pixels. With this side, the total area of the pixels inside the circle equals the circle's area to
/// 1.4e-4. Few other sides are as accurate.
pub const SPOT_PX: u32 = 86;

/// Returns the cone that `spot` meters for a rig, as a rig of one round picture. The cone is around the middle of the first view's picture. If this
/// view has two eyes, the apex of the cone is between them; if it has several faces, the cone is in the first face. `None`: the rig is empty, or the
/// exposure does not meter a spot.
///
/// # Errors
///
/// The angle is not valid for a fisheye picture.
pub fn spot_rig(rig: &Rig, exposure: &ExposureSettings) -> Result<Option<Rig>, RigError> {
    let ExposureSettings::Auto(AutoExposure { meter: Meter::Spot { spot_deg, .. }, .. }) = exposure else {
        return Ok(None);
    };
    let Some(view) = rig.views().first() else { return Ok(None) };
    let eyes = match view.kind {
        ViewKind::Stereo { .. } | ViewKind::StereoDome { .. } | ViewKind::Headset { .. } => view.images.len(),
        _ => 1,
    };
    let images = &view.images[..eyes.min(view.images.len())];
    let (mut towards, mut place_m) = (DVec3::ZERO, DVec3::ZERO);
    for image in images {
        let mapping = image.projection.mapping();
        let middle = mapping.direction_from_pixel(DVec2::from(mapping.size().map(f64::from)) / 2.0);
        // If a picture shows nothing in its middle, use its axis.
        towards += image.camera_from_view * middle.unwrap_or(DVec3::NEG_Z);
        place_m += image.eye_position_m / images.len() as f64;
    }
    let kind =
        ViewKind::Fisheye { size: [SPOT_PX; 2], mapping: FisheyeMapping::Equidistant, fov_rad: spot_deg.to_radians() };
    let ahead = towards.try_normalize().unwrap_or(DVec3::NEG_Z);
    let orientation = DQuat::from_rotation_arc(DVec3::NEG_Z, ahead);
    Rig::new(vec![View::new("spot", kind, orientation, place_m)?]).map(Some)
}

/// The settings with which a meter's picture is drawn; its mean is metered. Glare pyramids are left out for a spot: they are computed from the
/// picture, and the picture of a spot contains very little. Composite stars are sufficient, since they have the light of all stars.
pub fn meter_settings(settings: &RenderSettings) -> RenderSettings {
    use super::settings::GlareMethod;
    let mut meter = settings.clone();
    meter.stars.every_star = false;
    if settings.exposure.uses(Metering::Spot) && settings.glare.chosen(settings.stars.method) != GlareMethod::SkyCube {
        meter.glare = GlareSettings::none();
    }
    if let ExposureSettings::Auto(auto) = &mut meter.exposure {
        auto.meter = Meter::Mean { key: auto.key() };
    }
    meter
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::plan::settings::{ExposureKeys, ExposureValues};
    use crate::view::{Fov, projection::Face};

    fn rig() -> Rig {
        let kind = ViewKind::Perspective { size: [8, 6], fov_y_rad: 1.0 };
        let view = |name: &str| View::new(name, kind.clone(), DQuat::IDENTITY, DVec3::ZERO).unwrap();
        Rig::new(["a", "b", "c", "d"].map(view).to_vec()).unwrap()
    }

    #[test]
    fn views_without_settings_of_their_own_are_one_frame_of_the_whole_rig() {
        let common = RenderSettings::default();
        let groups = frame_groups(&rig(), &common, &[]);
        assert_eq!(groups.len(), 1);
        assert_eq!((&groups[0].views, &groups[0].rig, &groups[0].settings), (&vec![0, 1, 2, 3], &rig(), &common));
        assert!(groups[0].exposed_as.is_none());
        assert!(frame_groups(&Rig::default(), &common, &[]).is_empty());
    }

    #[test]
    fn views_that_differ_are_frames_of_their_own_and_share_the_exposure_of_their_group() {
        let common = RenderSettings::default();
        let general = ViewSettings::general(&common);
        let named = ViewSettings {
            group: ExposureGroup::Named("dim".to_owned()),
            exposure: ExposureKeys { limiting_magnitude: Some(8.0), ..ExposureKeys::default() }.over(&common.exposure),
            ..general.clone()
        };
        let clear = ViewSettings { glare: GlareSettings::none(), ..named.clone() };
        let groups = frame_groups(&rig(), &common, &[general.clone(), clear, general, named.clone()]);
        let views: Vec<&[usize]> = groups.iter().map(|group| &group.views[..]).collect();
        assert_eq!(views, [&[0, 2][..], &[1], &[3]]);
        assert!(groups[0].exposed_as.is_none());
        for group in &groups[1..] {
            let (shared, settings) = group.exposed_as.as_ref().unwrap();
            let names: Vec<&str> = shared.views().iter().map(|view| view.name.as_str()).collect();
            assert_eq!(names, ["b", "d"]);
            assert_eq!(settings.glare, GlareSettings::none(), "the first view of the group decides");
            assert_eq!(group.settings.exposure, named.exposure);
        }
    }

    #[test]
    fn the_spot_stands_in_the_middle_of_the_first_picture_between_two_eyes_and_in_the_first_face() {
        let exposure = ExposureValues { metering: Metering::Spot, spot_deg: 4.0, ..ExposureValues::default() }.into();
        let spot = |kind: ViewKind| {
            let turn = DQuat::from_rotation_y(0.3);
            let view = View::new("v", kind, turn, DVec3::X).unwrap();
            let spot = spot_rig(&Rig::new(vec![view]).unwrap(), &exposure).unwrap().unwrap();
            let image = &spot.views()[0].images[0];
            assert!(
                (image.projection.picture_solid_angle_sr() / (2.0 * PI * (1.0 - 2f64.to_radians().cos())) - 1.0).abs()
                    < 1e-9
            );
            (turn.conjugate() * image.camera_from_view * DVec3::NEG_Z, image.eye_position_m)
        };
        let near = |(direction, place): (DVec3, DVec3), expected: DVec3| {
            assert!((direction - expected.normalize()).length() < 1e-12, "{direction} instead of {expected}");
            assert!((place - DVec3::X).length() < 1e-12, "{place}");
        };
        near(spot(ViewKind::Perspective { size: [7, 5], fov_y_rad: 1.0 }), DVec3::NEG_Z);
        near(spot(ViewKind::DomeMaster { size: 9, fov_rad: PI, tilt_rad: 0.0 }), DVec3::Y);
        near(spot(ViewKind::Cubemap { face_size: 4, faces: vec![Face::Up, Face::Front] }), DVec3::Y);
        let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.8 };
        near(
            spot(ViewKind::Stereo { size: [6, 4], ipd_m: 0.064, fov_left: fov, fov_right: fov.mirrored() }),
            DVec3::NEG_Z,
        );
        // In an off-axis view, the spot is in the middle of the picture, not on the axis.
        let middle = 0.5 * (0.7_f64.tan() - 0.9_f64.tan());
        near(spot(ViewKind::OffAxis { size: [8, 8], fov }), DVec3::new(middle, 0.0, -1.0));
        assert!(spot_rig(&Rig::default(), &exposure).unwrap().is_none());
    }
}

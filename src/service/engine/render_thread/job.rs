//! Content of a frame: its recipients, and the frame groups of a scene's views.

use std::{
    collections::HashMap,
    sync::Arc,
    time::{Instant, SystemTime},
};

use crate::{
    catalogue::chunks::StarSet,
    plan::{
        budget::draws_outputs_apart,
        settings::{ExposureSettings, RenderSettings},
        view_settings::{ExposureGroup, FrameGroup},
    },
    render::Wanted,
    scene::{Camera, SceneObjects},
    service::{
        engine::{quality, shared_state::Request},
        frames::{latest_frame::LatestFrame, schedule::Revisions},
        scene::{state::SceneState, views::ViewId},
    },
};

/// Recipients of the next frame, and its content.
pub(super) struct Job {
    pub(super) requests: Vec<Request>,
    pub(super) subscribers: Vec<Arc<LatestFrame>>,
    /// Requested images of each view of the group.
    pub(super) wanted: Vec<Wanted>,
    /// Frame groups of the scene, and the index of this frame's group.
    pub(super) groups: Arc<Groups>,
    pub(super) group: usize,
    pub(super) camera: Camera,
    pub(super) pose_time: SystemTime,
    pub(super) scene: SceneState,
    /// Step of the scene's clock.
    pub(super) step: u64,
    /// Scene time of the frame.
    pub(super) time_s: f64,
    /// Objects at that time.
    pub(super) objects: Arc<SceneObjects>,
    pub(super) stars: Arc<StarSet>,
    pub(super) start: Instant,
    /// Values of the cue, if the worker is led.
    pub(super) cued: Option<Cued>,
}

/// Values that a cue gives to one of its frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cued {
    /// Number of the frame.
    pub(super) number: u64,
    /// Exposure, EV at ISO 100.
    pub(super) ev100: f64,
    /// Whether the camera has the same position as in the frame before.
    pub(super) rests: bool,
}

impl Job {
    pub(super) fn frame_group(&self) -> &FrameGroup {
        &self.frame_groups()[self.group]
    }

    /// Returns the key of the exposure state that this frame uses.
    pub(super) fn eye(&self) -> &EyeOf {
        &self.groups.eyes[self.group]
    }

    /// Settings of the adaptation, and the number of jumps of the scene.
    pub(super) fn adapts_by(&self) -> (ExposureSettings, u64) {
        (self.frame_group().settings.exposure, self.scene.jumps)
    }

    /// Returns the groups of frames of this kind: HDR images keep full quality.
    pub(super) fn frame_groups(&self) -> &[FrameGroup] {
        if self.wanted.iter().any(|wanted| wanted.reads_hdr()) { &self.groups.all } else { &self.groups.reduced }
    }

    /// Returns the quality level of the frame; `None` if it has full quality in any case.
    pub(super) fn level(&self) -> Option<u32> {
        (!self.wanted.iter().any(|wanted| wanted.reads_hdr())).then_some(self.groups.level)
    }

    pub(super) fn shows(&self) -> Revisions {
        Revisions { scene: self.scene.revision, camera: self.camera.revision, step: self.step }
    }
}

/// Grouping of a scene's views into frames.
pub(super) struct Groups {
    /// Revision of the scene.
    pub(super) revision: u64,
    pub(super) all: Vec<FrameGroup>,
    /// The same groups for display images at the present quality level.
    pub(super) reduced: Vec<FrameGroup>,
    /// The present quality level; 0: as configured.
    pub(super) level: u32,
    /// For each view, the index of its group and its index within the group.
    pub(super) of_view: HashMap<ViewId, (usize, usize)>,
    /// For each group, its exposure state.
    pub(super) eyes: Vec<EyeOf>,
    /// For each group, whether a request for HDR images changes its other images.
    pub(super) apart: Vec<bool>,
}

impl Groups {
    pub(super) fn new(general: &RenderSettings, scene: &SceneState, level: u32) -> Self {
        let common =
            RenderSettings { stars: scene.stars.clone(), asteroids: scene.asteroids.clone(), ..general.clone() };
        let (all, ids) = (scene.views.frame_groups(&common), scene.views.ids());
        let mut of_view = HashMap::new();
        for (number, group) in all.iter().enumerate() {
            of_view.extend(group.views.iter().enumerate().map(|(own, view)| (ids[*view], (number, own))));
        }
        // A new view with the name of a deleted one has its own exposure state.
        let alone =
            |group: &FrameGroup| matches!(group.exposure_group, ExposureGroup::OfView(_)).then(|| ids[group.views[0]]);
        let eyes = all.iter().map(|group| (group.exposure_group.clone(), alone(group))).collect();
        let is_apart = |group: &FrameGroup| {
            let viewports = group.rig.viewports(glam::DQuat::IDENTITY);
            draws_outputs_apart(&group.settings, &scene.objects.drawn, &viewports)
        };
        let apart = all.iter().map(is_apart).collect();
        // The exposure is the configured one.
        let at_level =
            |group: &FrameGroup| FrameGroup { settings: quality::settings_at(level, &group.settings), ..group.clone() };
        let reduced = all.iter().map(at_level).collect();
        Self { revision: scene.revision, all, reduced, level, of_view, eyes, apart }
    }

    /// Returns the exposure settings of a view, and its exposure state.
    pub(super) fn exposure_of(&self, view: ViewId) -> Option<(&ExposureSettings, &EyeOf)> {
        let (group, _) = self.of_view.get(&view)?;
        Some((&self.all[*group].settings.exposure, &self.eyes[*group]))
    }

    /// Returns the frame for the requested images of a view: the index of its group, and whether it is a separate HDR
    /// frame. Display images have their own error budget, which a request for HDR images must not change, so both need
    /// separate frames. With an exact budget, one frame serves both.
    pub(super) fn kind_of(&self, view: ViewId, wanted: Wanted) -> Kind {
        // No request refers to a view that the scene lacks.
        let group = self.of_view[&view].0;
        (group, self.apart[group] && wanted.reads_hdr())
    }
}

/// Index of a group, and whether its frame is a separate HDR frame.
pub(super) type Kind = (usize, bool);

/// Key of an exposure state: the exposure group, and the view if it has its own exposure.
pub(super) type EyeOf = (ExposureGroup, Option<ViewId>);

/// Chooses the next frame among those that are due: they take turns.
pub(super) fn next_kind(due: impl Iterator<Item = Kind>, last: Kind) -> Kind {
    let due: Vec<Kind> = due.collect();
    let after = due.iter().filter(|kind| **kind > last).min();
    after.or(due.iter().min()).copied().unwrap_or(last)
}

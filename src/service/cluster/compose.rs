//! Composes cues: the camera, the scene's time and the exposure of every frame group, at the time at which the frame is shown.

use std::{
    collections::HashMap,
    sync::Arc,
    time::{Duration, Instant, SystemTime},
};

use glam::DVec3;

use super::{cue::HashedCue, scene};
use crate::{
    plan::{
        Planner,
        adaptation::Adaptation,
        settings::{ExposureSettings, RenderSettings},
        view_settings::{ExposureGroup, FrameGroup},
    },
    service::engine::{
        led::{Content, Cue},
        quality::Quality,
        render_handle::RenderHandle,
    },
};

/// Exposure state of an exposure group.
#[derive(Default)]
struct Eye {
    /// Settings and number of jumps; a change resets the state.
    adapted_by: Option<(ExposureSettings, u64)>,
    adaptation: Adaptation,
    last: Option<Instant>,
    /// The last exposure; it is used if a client has chosen one that cannot be planned.
    ev100: f32,
}

/// The groups of a scene, with its hash and the bytes for nodes.
struct Known {
    revision: u64,
    hash: [u8; 32],
    groups: Vec<FrameGroup>,
}

/// Composes the cues of a director.
pub(super) struct Composer {
    render: RenderHandle,
    planner: Planner,
    eyes: HashMap<ExposureGroup, Eye>,
    known: Option<Known>,
    position_m: Option<DVec3>,
    /// Chooses the quality level. `None` until the settings are known, and if the time of frames is not limited.
    quality: Option<Quality>,
    reported: bool,
}

/// A composed cue.
pub(super) struct Composed {
    pub(super) cue: HashedCue,
    /// The scene, if it differs from that of the last cue.
    pub(super) new_scene: Option<Arc<[u8]>>,
}

impl Composer {
    pub(super) fn new(render: RenderHandle) -> Self {
        let quality = render.figures().quality.map(|quality| Quality::new(quality.frame_ms));
        Self {
            render,
            planner: Planner::new(),
            eyes: HashMap::new(),
            known: None,
            position_m: None,
            quality,
            reported: false,
        }
    }

    /// Notes the time that the slowest node took to draw a frame.
    pub(super) fn note_drawn(&mut self, drawn_ns: u64) {
        if let Some(quality) = &mut self.quality {
            quality.note(quality.level(), drawn_ns as f64 * 1e-6);
        }
    }

    /// Composes the cue of a frame that is shown after `ahead`; `None` at the end of the daemon.
    ///
    /// # Errors
    ///
    /// The scene cannot be drawn.
    pub(super) fn compose(&mut self, number: u64, ahead: Duration) -> Result<Option<Composed>, String> {
        let now: SystemTime = self.render.time().now();
        let Some(content) = self.render.content_at(now + ahead) else { return Ok(None) };
        let mut new_scene = None;
        if self.known.as_ref().is_none_or(|known| known.revision != content.scene.revision) {
            let common: &RenderSettings = &content.settings;
            let groups = content.scene.views.frame_groups(common);
            self.eyes.retain(|of, _| groups.iter().any(|group| group.exposure_group == *of));
            let hash = scene::hash(&content.scene, self.render.time());
            self.known = Some(Known { revision: content.scene.revision, hash, groups });
            new_scene = Some(scene::encode(&content.scene, self.render.time()));
        }
        let Some(known) = self.known.take() else { return Ok(None) };
        let ev100 = self.exposures(&known.groups, &content);
        let scene_hash = known.hash;
        self.known = Some(known);
        let camera = content.snapshot.camera;
        let rests = self.position_m.replace(camera.position_m).is_none_or(|last| last == camera.position_m);
        let level = self.quality.as_ref().map_or(0, Quality::level);
        let (revision, time_s) = (content.scene.revision, content.time_s);
        let cue = Cue { number, scene: revision, time_s, camera, rests, level, ev100: ev100? };
        Ok(Some(Composed { cue: HashedCue { cue, scene_hash }, new_scene }))
    }

    fn exposures(&mut self, groups: &[FrameGroup], content: &Content) -> Result<Vec<f32>, String> {
        let now = Instant::now();
        let mut done: HashMap<&ExposureGroup, f32> = HashMap::new();
        for group in groups {
            if done.contains_key(&group.exposure_group) {
                continue;
            }
            let (rig, settings) =
                group.exposed_as.as_ref().map_or((&group.rig, &group.settings), |(rig, settings)| (rig, settings));
            let exposure = settings.exposure;
            let eye = self.eyes.entry(group.exposure_group.clone()).or_default();
            let adapted_by = (exposure, content.scene.jumps);
            if eye.adapted_by.replace(adapted_by).is_some_and(|before| before != adapted_by) {
                *eye = Eye { adapted_by: Some(adapted_by), ev100: eye.ev100, ..Eye::default() };
            }
            let planned = match exposure {
                ExposureSettings::Manual { ev100 } => Some(ev100),
                ExposureSettings::Auto(_) => self
                    .planner
                    .exposure(&content.snapshot, rig, settings, &content.limits)
                    .map_err(|error| error.to_string())?,
            };
            let Some(planned) = planned else {
                if !std::mem::replace(&mut self.reported, true) {
                    tracing::error!(
                        "a view meters its exposure, which is not possible in a cluster, so it keeps its last exposure"
                    );
                }
                done.insert(&group.exposure_group, eye.ev100);
                continue;
            };
            let dt = eye.last.replace(now).map_or(Duration::ZERO, |last| now - last);
            let ev100 = eye.adaptation.exposure(dt.as_secs_f64(), 0.0, &exposure).unwrap_or(planned) as f32;
            eye.adaptation.observe(f64::from(ev100), planned);
            eye.ev100 = ev100;
            done.insert(&group.exposure_group, ev100);
        }
        Ok(groups.iter().map(|group| done[&group.exposure_group]).collect())
    }
}

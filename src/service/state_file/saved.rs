//! Content of a state file: scene, views and camera, as messages, and the forms of older files.

use std::{sync::Arc, time::SystemTime};

use prost::Message;
use serde::de::DeserializeOwned;

use crate::{
    config::{KeyError, ViewSpec},
    plan::settings::RenderSettings,
    scene::{Camera, SceneClock},
    service::{
        proto,
        scene::state::SceneState,
        time_source::TimeSource,
        wire::{
            camera, scene,
            views::{spec_from_pb, spec_to_pb},
        },
    },
};

/// View in the formats up to 3, with tables as TOML text.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct TextView {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(string, optional, tag = "2")]
    exposure_group: Option<String>,
    #[prost(string, optional, tag = "3")]
    exposure: Option<String>,
    #[prost(string, optional, tag = "4")]
    glare: Option<String>,
    #[prost(string, optional, tag = "5")]
    tone_map: Option<String>,
    /// Keys of the view's geometry if a client has set them; otherwise those of the configuration apply.
    #[prost(string, optional, tag = "6")]
    definition: Option<String>,
}

/// Scene and views.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Saved {
    #[prost(message, optional, tag = "1")]
    pub(crate) scene: Option<proto::Scene>,
    /// Views in the formats up to 3.
    #[prost(message, repeated, tag = "2")]
    text_views: Vec<TextView>,
    /// Camera of a snapshot. The current camera has its own entry, because it changes more often.
    #[prost(message, optional, tag = "3")]
    pub(crate) camera: Option<proto::Camera>,
    /// Time at which a snapshot was saved.
    #[prost(message, optional, tag = "4")]
    pub(crate) time: Option<prost_types::Timestamp>,
    /// Deleted views of the configuration.
    #[prost(string, repeated, tag = "5")]
    deleted: Vec<String>,
    /// All views. Views without a type have the geometry of the configuration.
    #[prost(message, repeated, tag = "6")]
    views: Vec<proto::ViewDefinition>,
    /// Whether the overlay has its pictures, with the files that clients have sent. Older formats have none.
    #[prost(bool, tag = "7")]
    has_pictures: bool,
}

impl Saved {
    /// Copies the parts of a scene that clients may change.
    pub(crate) fn from_scene(scene: &SceneState, camera: Option<&Camera>, time: &TimeSource) -> Self {
        let mut message = scene::scene_to_pb(scene, &[], time);
        if let Some(overlay) = &mut message.overlay {
            for (saved, picture) in overlay.pictures.iter_mut().zip(&scene.objects.drawn.overlay.pictures) {
                saved.png = picture.png.as_ref().map(|png| png.to_vec());
            }
        }
        Self {
            scene: Some(message),
            has_pictures: true,
            // Only a specification with a non-UTF-8 path has no message.
            views: scene.views.kept().filter_map(|spec| spec_to_pb(&spec).ok()).collect(),
            text_views: Vec::new(),
            deleted: scene.views.deleted().map(str::to_owned).collect(),
            camera: camera.map(camera::camera_to_pb),
            time: Some(time.machine_now().into()),
        }
    }

    /// Returns the saved clock, advanced by the time since it was saved. If the machine's clock was set back since then, the saved clock continues
    /// from the saved time.
    pub(crate) fn clock(&self, set: SceneClock, time: &TimeSource) -> SceneClock {
        let saved_at = self.scene.as_ref().and_then(|scene| scene.time_told?.try_into().ok());
        saved_at.map_or(set, |told| SceneClock { since: time.heard(told).min(time.now()), ..set })
    }

    /// Applies the saved values to a scene at the daemon's time `now`, whatever the revision of the scene. Logs the saved objects that no longer
    /// exist.
    pub(crate) fn applied(
        &self,
        scene: &SceneState,
        general: &RenderSettings,
        now: SystemTime,
    ) -> Result<SceneState, String> {
        // Older versions have only the timestamp.
        let is_exact = self.scene.as_ref().is_some_and(|scene| scene.time_j2000_s.is_some());
        let time = if is_exact { "time_j2000_s" } else { "time" };
        let mut all =
            ["stars", time, "time_rate", "asteroids", "bodies", "asteroid_fields"].map(str::to_owned).to_vec();
        if self.has_pictures {
            all.push("overlay".to_owned());
        } else {
            let parts = ["grids", "trajectories", "labels", "cardinal_points", "test_patterns"];
            all.extend(parts.map(|part| format!("overlay.{part}")));
        }
        // In older formats, an observer has only its place, which no client could change.
        if self.scene.as_ref().and_then(|scene| scene.observer.as_ref()?.air).is_some() {
            all.push("observer".to_owned());
        }
        let request = proto::UpdateSceneRequest {
            scene: self.scene.clone().map(|saved| without_lost_pictures(saved, scene)),
            update_mask: Some(prost_types::FieldMask { paths: all }),
            expected_revision: None,
        };
        let made = scene::scene_update_from_pb(&request)?.make(scene)?;
        let mut after = scene.clone().changed(&made, None, now).map_err(|error| error.to_string())?;
        let older = self.text_views.iter().map(TextView::message).collect::<Result<Vec<_>, String>>()?;
        let kept = older.iter().chain(&self.views).map(kept_spec).collect::<Result<_, String>>()?;
        after.views = Arc::new(scene.views.restored(general, kept, &self.deleted)?);
        Ok(after)
    }
}

/// Returns the saved scene without the pictures that come from an earlier configuration and that the current one lacks, because their files are not
/// saved.
fn without_lost_pictures(mut saved: proto::Scene, scene: &SceneState) -> proto::Scene {
    if let Some(overlay) = &mut saved.overlay {
        let there = &scene.objects.drawn.overlay.pictures;
        overlay.pictures.retain(|picture| {
            let is_known = picture.png.is_some() || there.iter().any(|known| known.name == picture.name);
            if !is_known {
                tracing::info!(
                    "the picture `{}` of the overlay is left out: the configuration no longer has it",
                    picture.name
                );
            }
            is_known
        });
    }
    saved
}

/// Returns the specification in a saved message. If the message has no type, the specification has no geometry.
fn kept_spec(message: &proto::ViewDefinition) -> Result<ViewSpec, String> {
    let wrong = |error: KeyError| format!("view `{}`: {error}", message.name());
    if message.r#type.is_some() {
        return spec_from_pb(message).map(|(spec, _)| spec).map_err(wrong);
    }
    ViewSpec::settings_from_keys(message).map_err(wrong)
}

impl TextView {
    fn message(&self) -> Result<proto::ViewDefinition, String> {
        let view = &self.name;
        let definition: Option<proto::ViewDefinition> = parsed(view, self.definition.as_ref())?;
        Ok(proto::ViewDefinition {
            name: Some(view.clone()),
            exposure_group: self.exposure_group.clone(),
            exposure: parsed(view, self.exposure.as_ref())?,
            glare: parsed(view, self.glare.as_ref())?,
            tone_map: parsed(view, self.tone_map.as_ref())?,
            ..definition.unwrap_or_default()
        })
    }
}

/// Reads a message from keys that are TOML text.
fn parsed<M: DeserializeOwned>(view: &str, text: Option<&String>) -> Result<Option<M>, String> {
    text.map(|text| toml::from_str(text)).transpose().map_err(|error| format!("view `{view}`: {error}"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_clock_that_was_saved_in_the_future_runs_from_now() {
        let time = TimeSource::default();
        for told in [Duration::ZERO, Duration::from_secs(3600)] {
            let saved = Saved {
                scene: Some(proto::Scene { time_told: Some((time.now() + told).into()), ..Default::default() }),
                ..Saved::default()
            };
            let clock = saved.clock(SceneClock::running(0.0, 1.0, SystemTime::UNIX_EPOCH), &time);
            let after_a_minute_s = clock.time_s(time.now() + Duration::from_secs(60));
            assert!((55.0..100.0).contains(&after_a_minute_s), "{after_a_minute_s}");
        }
        let old = time.now() - Duration::from_secs(100);
        let scene = proto::Scene { time_told: Some(old.into()), ..Default::default() };
        let saved = Saved { scene: Some(scene), ..Saved::default() };
        let clock = saved.clock(SceneClock::running(0.0, 1.0, SystemTime::UNIX_EPOCH), &time);
        assert_eq!(clock.since, old);
    }

    #[test]
    fn views_of_older_formats_are_read_and_broken_ones_are_refused() {
        let older = TextView {
            name: "dome".to_owned(),
            exposure_group: Some("desk".to_owned()),
            exposure: Some("limiting_magnitude = 8.5\n".to_owned()),
            glare: Some("fraction = 0.25\n".to_owned()),
            tone_map: None,
            definition: Some(
                "fov_deg = 0.1\norientation = [0.0, 0.6, 0.0, 0.8]\nsize = [16, 16]\ntype = \"fisheye\"\n".to_owned(),
            ),
        };
        let text = "name = 'dome'\ntype = 'fisheye'\nsize = [16, 16]\nfov_deg = 0.1\norientation = [0.0, 0.6, 0.0, 0.8]\n\
                    exposure_group = 'desk'\nexposure = { limiting_magnitude = 8.5 }\nglare = { fraction = 0.25 }";
        let expected = ViewSpec::from_toml(text).unwrap().0;
        assert_eq!(kept_spec(&older.message().unwrap()), Ok(expected.clone()));
        // Views without a geometry, in the current format and in an older one.
        let without = TextView { definition: None, ..older.clone() };
        let kept = kept_spec(&without.message().unwrap()).unwrap();
        assert_eq!(kept, ViewSpec { geometry: kept.geometry.clone(), ..expected });
        assert!(!kept.geometry.has_keys());
        assert_eq!(kept_spec(&spec_to_pb(&kept).unwrap()), Ok(kept));
        for (broken, part) in [
            (TextView { glare: Some("fraction = ".to_owned()), ..older.clone() }, "view `dome`: "),
            (TextView { glare: Some("colour = 3".to_owned()), ..older }, "unknown field `colour`"),
        ] {
            let problem = broken.message().unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
    }
}

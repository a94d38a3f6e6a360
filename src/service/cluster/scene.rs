//! The director's scene for its nodes: the content of a state file, the revision, and a hash. Equal scenes have equal hashes.

use std::sync::Arc;

use prost::Message;
use sha2::{Digest, Sha256};

use crate::service::{
    engine::render_handle::RenderHandle, scene::state::SceneState, state_file::Saved, time_source::TimeSource,
};

#[derive(Clone, PartialEq, Message)]
struct ScenePb {
    #[prost(message, optional, tag = "1")]
    saved: Option<Saved>,
    #[prost(uint64, tag = "2")]
    jumps: u64,
}

/// Encodes a scene for nodes.
pub(super) fn encode(scene: &SceneState, time: &TimeSource) -> Arc<[u8]> {
    let saved = Some(Saved::from_scene(scene, None, time));
    ScenePb { saved, jumps: scene.jumps }.encode_to_vec().into()
}

/// Returns the hash of everything in a scene that determines pictures. The scene's time is left out, because cues contain it.
pub(super) fn hash(scene: &SceneState, time: &TimeSource) -> [u8; 32] {
    let mut saved = Saved::from_scene(scene, None, time);
    saved.time = None;
    if let Some(scene) = &mut saved.scene {
        scene.revision = 0;
        scene.time = None;
        scene.time_j2000_s = None;
        scene.time_rate = 0.0;
        scene.time_told = None;
    }
    Sha256::digest(saved.encode_to_vec()).into()
}

/// Returns the node's scene after the director's scene in `bytes` has been applied. Placing asteroids may take seconds.
pub(super) fn applied(bytes: &[u8], render: &RenderHandle) -> Result<SceneState, String> {
    let ScenePb { saved, jumps } = ScenePb::decode(bytes).map_err(|error| error.to_string())?;
    let saved = saved.ok_or("it has no content")?;
    let before = render.scene().map_err(|_| "the daemon is shutting down".to_owned())?;
    let general = render.general(&before);
    let after = saved.applied(&before, &general, render.time().now())?;
    let revision = saved.scene.as_ref().map_or(after.revision, |scene| scene.revision);
    Ok(SceneState { revision, jumps, ..after })
}

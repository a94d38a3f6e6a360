//! The test pattern key of the windows: it changes the scene in the same way as a call.

use tokio::sync::mpsc;

use super::service::Service;
use crate::{
    config::WindowConfig,
    service::scene::{overlay::OverlayChange, state::SceneUpdate},
};

impl Service {
    /// Toggles the test patterns of all views of windows with each press of the key.
    pub(crate) async fn keep_test_patterns(self, windows: Vec<WindowConfig>, mut pressed: mpsc::Receiver<()>) {
        while pressed.recv().await.is_some() {
            let Ok(scene) = self.render.scene() else { return };
            let before = &scene.objects.drawn.overlay.test_patterns;
            let of_windows = |name: &String| windows.iter().any(|window| window.view == *name);
            let mut patterns: Vec<String> = before.iter().filter(|name| !of_windows(name)).cloned().collect();
            let mut views: Vec<&str> = windows.iter().map(|window| window.view.as_str()).collect();
            views.retain(|view| scene.views.named(view).is_some());
            views.dedup();
            let has_all = views.iter().all(|view| before.iter().any(|name| name == view));
            if !has_all {
                patterns.extend(views.iter().map(|view| (*view).to_owned()));
            }
            let overlay = OverlayChange { test_patterns: Some(patterns), ..OverlayChange::default() };
            let update = SceneUpdate { overlay, ..SceneUpdate::default() };
            match self.changed_scene(&update, None).await {
                Ok(scene) => {
                    let switched = if has_all { "off" } else { "on" };
                    tracing::info!(
                        "test patterns {switched} by the key of a window, revision {} of the scene",
                        scene.revision
                    );
                }
                Err(status) => {
                    tracing::error!("cannot switch test patterns by the key of a window: {}", status.message())
                }
            }
        }
    }
}

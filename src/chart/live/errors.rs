//! Errors of the delivered display images: compares images of a budget with exact ones, at the poses of the turning camera.

use std::{path::Path, sync::Arc};

use super::LiveScene;
use crate::{
    chart::{ChartError, DisplayErrors, timing::message_of},
    config::Config,
    plan::{
        Output,
        settings::{ExposureSettings, RenderSettings},
    },
    render::{Frame, FrameRequest, RenderError, Renderer, Wanted},
    scene::{SceneSnapshot, loader::load_stars},
    view::Rig,
};

/// Errors of a view with one budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    /// Error that 99.9 % of the channels do not exceed, codes; maximum over the poses.
    pub most_codes: f64,
    /// Largest error, codes.
    pub largest_codes: f64,
    /// Mean number of stars in view over the poses.
    pub stars_in_view: f64,
    /// Mean number, over the poses, of the stars that are drawn one by one; the others are read from a map.
    pub stars_drawn: f64,
}

/// The scene of a configuration, for all of its views.
pub(super) struct Compared {
    config: Config,
    scene: SceneSnapshot,
}

impl Compared {
    /// Loads the stars and objects of a configuration; the error is the reason why it cannot be drawn.
    pub fn load(scene: &LiveScene) -> Result<Self, String> {
        let config = Config::from_text(&scene.text, &scene.name, Path::new(""), &scene.set)
            .map_err(|error| error.to_string())?;
        let (stars, _) =
            load_stars(&config.star_sources(), &config.epoch(), &mut |_| {}).map_err(|error| error.to_string())?;
        let objects = Arc::new(config.objects().map_err(|error| error.to_string())?);
        let camera = config.camera().map_err(|error| error.to_string())?;
        let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera };
        Ok(Self { config, scene })
    }

    /// Returns the number of stars in the catalogues.
    pub fn stars(&self) -> u64 {
        self.scene.stars.stars.len() as u64
    }

    /// Returns a rig with only this view, and the size of the view's first image, pixels.
    pub fn view(&self, name: &str) -> Result<(Rig, [u32; 2]), String> {
        let rig = self.config.rig().map_err(|error| error.to_string())?;
        let view =
            rig.views().iter().find(|view| view.name == name).ok_or_else(|| format!("there is no view {name}"))?;
        let size = view.images.first().map_or([0; 2], |image| image.projection.mapping().size());
        Ok((Rig::new(vec![view.clone()]).map_err(|error| error.to_string())?, size))
    }

    /// Compares the images of several budgets (codes) with the exact ones at an exposure, over the poses of a full turn.
    /// The inner error is the reason why the view cannot be drawn.
    pub fn errors(
        &self,
        renderer: &mut Renderer,
        rig: &Rig,
        budgets_codes: &[f64],
        ev100: f64,
        poses: usize,
    ) -> Result<Result<Vec<Found>, String>, ChartError> {
        let mut settings = self.config.render_settings();
        settings.exposure = ExposureSettings::manual(ev100);
        let mut found = vec![
            Found { most_codes: 0.0, largest_codes: 0.0, stars_in_view: 0.0, stars_drawn: 0.0 };
            budgets_codes.len()
        ];
        for pose in 0..poses {
            let mut scene = self.scene.clone();
            let turn = glam::DQuat::from_rotation_y(std::f64::consts::TAU * pose as f64 / poses as f64);
            scene.camera.world_from_camera = (scene.camera.world_from_camera * turn).normalize();
            let exact = match draw(renderer, &scene, rig, &settings, Output::Hdr) {
                Ok(frame) => frame,
                Err(error) => return Ok(Err(message_of(error)?)),
            };
            for (&codes, found) in budgets_codes.iter().zip(&mut found) {
                settings.accuracy.display_codes = codes;
                let drawn = match draw(renderer, &scene, rig, &settings, Output::Display) {
                    Ok(frame) => frame,
                    Err(error) => return Ok(Err(message_of(error)?)),
                };
                let errors = DisplayErrors::between(&exact, &drawn, &settings);
                let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
                if !most.is_finite() {
                    return Ok(Err("the image has no pixels inside of its picture".to_owned()));
                }
                found.most_codes = found.most_codes.max(most);
                found.largest_codes = found.largest_codes.max(largest);
                let stars = |frame: &Frame| frame.views.iter().map(|view| view.stars_drawn as f64).sum::<f64>();
                found.stars_in_view += stars(&exact) / poses as f64;
                found.stars_drawn += stars(&drawn) / poses as f64;
            }
        }
        Ok(Ok(found))
    }
}

fn draw(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    rig: &Rig,
    settings: &RenderSettings,
    output: Output,
) -> Result<Frame, RenderError> {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr()).drawn_for(output))
}

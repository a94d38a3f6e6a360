//! Pipelines before the first frame: those that a scene's objects, a rig and settings can ask for, on all cores.
//!
//! Drivers of GPUs compile a shader when its pipeline is made, on the thread that makes it. Software drivers compile it when it first runs, one
//! after the other on the queue's own thread; there compute shaders are compiled ahead on devices of their own (`gpu/compile_ahead.rs`), and
//! it takes a frame ([`Renderer::warm_up`]) to have the others compiled.

use std::sync::{Mutex, PoisonError};

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    technique::{PipelineJob, Wish},
};
use crate::{
    plan::{
        PlanError,
        settings::{Metering, RenderSettings},
        view_settings::{meter_settings, spot_rig},
    },
    scene::{SceneObjects, SceneSnapshot},
    view::Rig,
};

/// How far [`Renderer::prepare`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrepareStep {
    /// What has been made last.
    pub name: &'static str,
    /// How much is done.
    pub done: usize,
    /// How much there is to do.
    pub of: usize,
}

/// Runs jobs on as many threads as there are cores, the first ones first.
fn run(jobs: Vec<PipelineJob<'_>>, progress: &mut (dyn FnMut(PrepareStep) + Send)) {
    let of = jobs.len();
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(of);
    let waiting = Mutex::new(jobs.into_iter());
    let told = Mutex::new((0, progress));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let job = waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
                    let Some(PipelineJob { name, make }) = job else { return };
                    make();
                    let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                    let (done, progress) = &mut *told;
                    *done += 1;
                    progress(PrepareStep { name, done: *done, of });
                }
            });
        }
    });
}

impl Renderer {
    /// Makes the pipelines that frames of these objects, views and settings take, on all cores. `wanted` says what is going to be
    /// read back of any view, `formats` what textures images are going to be drawn into. Frames make what they need and does not
    /// exist yet; after this there is nothing of that kind.
    ///
    /// # Errors
    ///
    /// The driver has refused a shader.
    pub fn prepare(
        &mut self,
        objects: &SceneObjects,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: Wanted,
        formats: &[wgpu::TextureFormat],
        progress: &mut (dyn FnMut(PrepareStep) + Send),
    ) -> Result<(), RenderError> {
        let viewports = rig.viewports(glam::DQuat::IDENTITY);
        self.hold_tables(&viewports)?;
        // A meter of its own draws a picture that nobody sees.
        let spot = match settings.exposure.goes_by(Metering::Spot) {
            true => spot_rig(rig, &settings.exposure).map_err(PlanError::from)?,
            false => None,
        };
        let spot_viewports = spot.map(|spot| spot.viewports(glam::DQuat::IDENTITY));
        let of_meter = meter_settings(settings);
        let wish = Wish { gpu: &self.gpu, objects, settings, viewports: &viewports, made: wanted, formats };
        let mut jobs: Vec<PipelineJob<'_>> =
            self.techniques.iter().flat_map(|technique| technique.pipelines(&wish)).collect();
        let meter_wish = spot_viewports.as_ref().map(|viewports| Wish {
            settings: &of_meter,
            viewports,
            made: Wanted::default(),
            formats: &[],
            ..wish
        });
        if let Some(wish) = &meter_wish {
            jobs.extend(self.techniques.iter().flat_map(|technique| technique.pipelines(wish)));
        }
        self.gpu.compiling_ahead(|| run(jobs, progress));
        self.gpu.take_failure()?;
        Ok(())
    }

    /// Draws a frame that nobody sees, so that everything that the first frame takes is there and compiled.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::render`].
    pub fn warm_up(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: Wanted,
    ) -> Result<(), RenderError> {
        self.render(FrameRequest::new(scene, rig).settings(settings).wanted(wanted)).map(drop)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use std::{path::Path, sync::Arc};

    use super::*;
    use crate::{
        config::Config,
        gpu::{Gpu, GpuOptions},
        scene::loader::load_stars,
    };

    /// Pipelines that `prepare` makes for a configuration, and those that the first frame makes beside them.
    fn made(file: &str, set: &[&str]) -> [u64; 2] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
        let small = ["scene.catalogues=[\"builtin:bright\"]"];
        let set: Vec<String> = small.iter().chain(set).map(|text| (*text).to_owned()).collect();
        let config = Config::load(&path, &set).unwrap();
        let (rig, settings) = (config.rig().unwrap(), config.render_settings());
        let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
        assert_eq!(renderer.gpu.made().pipelines, 0, "a renderer makes none before it knows what for");
        let objects = Arc::new(config.objects().unwrap());
        let wanted = Wanted::both();
        let mut steps = Vec::new();
        renderer.prepare(&objects, &rig, &settings, wanted, &[], &mut |step| steps.push(step)).unwrap();
        let of = steps.len();
        assert!(steps.iter().enumerate().all(|(index, step)| (step.done, step.of) == (index + 1, of)), "{steps:?}");
        let prepared = renderer.gpu.made().pipelines;
        let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| ()).unwrap();
        let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera: config.camera().unwrap() };
        renderer.warm_up(&scene, &rig, &settings, wanted).unwrap();
        [prepared, renderer.gpu.made().pipelines - prepared]
    }

    #[test]
    fn the_first_frame_makes_no_pipeline_that_could_be_made_before() {
        let small = "views.dome.size=[64,64]";
        let cases: [(&str, &[&str]); 11] = [
            ("perspective.toml", &["views.0.size=[64,48]"]),
            ("dome.toml", &[small]),
            ("dome.toml", &[small, "glare.method=none"]),
            ("dome.toml", &[small, "glare.method=none", "exposure.mode=manual", "exposure.ev100=-5.4"]),
            ("dome.toml", &[small, "glare.method=view_pyramid"]),
            ("dome.toml", &[small, "glare.kernel=cie"]),
            ("dome.toml", &[small, "stars.method=packed_cas", "glare.method=none"]),
            ("dome.toml", &[small, "stars.method=packed_cas_sorted", "glare.method=none"]),
            ("dome.toml", &[small, "stars.method=disc", "glare.method=none"]),
            ("asteroids.toml", &["views.0.size=[64,48]"]),
            ("tonight.toml", &["views.dome.size=[64,64]", "views.south.size=[64,48]"]),
        ];
        for (file, set) in cases {
            let [prepared, late] = made(file, set);
            assert!(prepared > 0 && late == 0, "{file} {set:?}: {prepared} prepared, {late} more by the frame");
        }
    }

    #[test]
    fn what_was_not_prepared_is_made_by_the_frame() {
        // The counter sees it.
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/dome.toml");
        let set = ["scene.catalogues=[\"builtin:bright\"]", "views.dome.size=[64,64]"].map(str::to_owned);
        let config = Config::load(&path, &set).unwrap();
        let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
        let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| ()).unwrap();
        let objects = Arc::new(config.objects().unwrap());
        let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera: config.camera().unwrap() };
        let wanted = Wanted { display: true, ..Wanted::default() };
        renderer.warm_up(&scene, &config.rig().unwrap(), &config.render_settings(), wanted).unwrap();
        assert!(renderer.gpu.made().pipelines > 0);
    }
}

//! `sky_cube`: a map of the whole sky, and the brightest sources one by one. The map is made when the scene, the camera's place or the
//! settings have changed, and kept until they do again; what depends on where the views look is made for every frame.

mod map;
mod record;
mod sprites;

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use self::{
    map::{Held, Key, MapPasses},
    record::{Variant, composite},
    sprites::SpritePasses,
};
use super::composite::GlareCompositePass;
use crate::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GrowingBuffer, Variants},
    photometry::glare::GlareKernel,
    plan::{
        glare::sky_cube::{SkyCubeSettings, eye_class_m, map_place_pc, pixel_class_rad},
        settings::{GlareSettings, RenderSettings},
    },
    relativity::Motion,
    render::technique::{Holding, PipelineJob, Recording, Wish, begin_pass},
    scene::SceneSnapshot,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::Viewport,
};

/// Stars and camera of a frame.
struct SkyScene<'a> {
    stars: &'a Arc<StarSet>,
    camera_pc: DVec3,
    motion: Option<Motion>,
    faintest_lx: f64,
    /// What a source may add to the veil around it without being drawn by itself, relative.
    tolerance: f64,
}

impl<'a> SkyScene<'a> {
    fn of(snapshot: &'a SceneSnapshot, settings: &RenderSettings) -> Self {
        Self {
            stars: &snapshot.stars,
            camera_pc: snapshot.camera.position_m / PARSEC_M,
            motion: Motion::new(snapshot.camera.velocity_c),
            faintest_lx: illuminance_lx_from_magnitude(settings.stars.magnitude_limit),
            tolerance: settings.accuracy.glare,
        }
    }

    /// What the map of these views is made of.
    fn settings(&self, views: &Views) -> SkyCubeSettings {
        let place_pc = map_place_pc(self.camera_pc);
        let camera_m = ((self.camera_pc - place_pc) * PARSEC_M).length();
        SkyCubeSettings {
            place_pc,
            motion: self.motion,
            faintest_lx: self.faintest_lx,
            farthest_eye_pc: eye_class_m(camera_m + views.farthest_eye_m) / PARSEC_M,
            tolerance: self.tolerance,
            pixel_classes_rad: views.pixel_classes_rad.clone(),
        }
    }
}

/// What of views the map depends on.
struct Views {
    /// See [`SkyCubeSettings::pixel_classes_rad`].
    pixel_classes_rad: Vec<f64>,
    /// Distance from the camera to the farthest eye, m.
    farthest_eye_m: f64,
}

impl Views {
    fn of(viewports: &[Viewport]) -> Self {
        let mut classes: Vec<f64> = viewports.iter().map(pixel_class).collect();
        classes.sort_by(f64::total_cmp);
        classes.dedup();
        let eyes = viewports.iter().map(|viewport| viewport.eye_offset_m.length());
        Self { pixel_classes_rad: classes, farthest_eye_m: eyes.fold(0.0, f64::max) }
    }
}

/// Passes and buffers, made when they are first asked for.
pub(super) struct SkyCube {
    passes: OnceLock<MapPasses>,
    sprites: OnceLock<SpritePasses>,
    composites: Variants<Variant, GlareCompositePass>,
    held: Option<Held>,
    /// Of the last frame.
    views: Option<Views>,
    lists: GrowingBuffer,
    square_lists: GrowingBuffer,
}

fn pixel_class(viewport: &Viewport) -> f64 {
    pixel_class_rad(viewport.projection.middle_pixel_rad())
}

impl SkyCube {
    pub(super) fn new() -> Self {
        Self {
            passes: OnceLock::new(),
            sprites: OnceLock::new(),
            composites: Variants::new(),
            held: None,
            views: None,
            lists: GrowingBuffer::new("glare lists", wgpu::BufferUsages::STORAGE),
            square_lists: GrowingBuffer::new("glare square lists", wgpu::BufferUsages::STORAGE),
        }
    }

    /// The pipelines for these viewports.
    pub(super) fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        let variant = Variant::of(wish.settings.glare.kernel, wish.viewports);
        vec![
            // Longest first.
            PipelineJob::new("glare", move || composite(&self.composites, gpu, variant)),
            PipelineJob::new("glare map", move || {
                self.passes.get_or_init(|| MapPasses::new(gpu));
            }),
            PipelineJob::new("glare sprites", move || {
                self.sprites.get_or_init(|| SpritePasses::new(gpu));
            }),
        ]
    }

    /// Lets go of buffers.
    pub(super) fn release(&mut self) {
        self.held = None;
        self.lists.release();
        self.square_lists.release();
    }

    /// Records the glare of a frame.
    pub(super) fn record(&mut self, recording: &mut Recording<'_>) {
        let frame = recording.frame;
        let Some(kernel) = &frame.plan.glare.kernel else { unreachable!("a plan of this method has its kernel") };
        let scene = SkyScene::of(frame.scene, frame.settings);
        let views = Views::of(&frame.plan.viewports);
        let settings = scene.settings(&views);
        self.views = Some(views);
        if !self.holds(&scene, &settings, kernel) {
            let gpu = recording.gpu;
            let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
            let key = Key { stars: Arc::clone(scene.stars), settings, kernel: Arc::clone(kernel) };
            self.hold_new(gpu, &mut pass, &frame.settings.glare, key);
        }
        self.record_views(recording);
    }

    /// Makes the map of a scene that has changed before it is known where the views look, as they were in the last frame: that
    /// is when it takes its time, not between the poses of a headset and its picture.
    pub(super) fn hold_map(&mut self, holding: &Holding<'_>) {
        let (Some(views), Some(kernel)) = (&self.views, holding.kernel) else { return };
        let scene = SkyScene::of(holding.scene, holding.settings);
        let settings = scene.settings(views);
        if self.holds(&scene, &settings, kernel) {
            return;
        }
        let gpu = holding.gpu;
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("glare map") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let key = Key { stars: Arc::clone(scene.stars), settings, kernel: Arc::clone(kernel) };
        self.hold_new(gpu, &mut pass, &holding.settings.glare, key);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }

    /// Whether the map that is held is one of these settings.
    fn holds(&self, scene: &SkyScene<'_>, settings: &SkyCubeSettings, of_frame: &Arc<dyn GlareKernel>) -> bool {
        self.held.as_ref().is_some_and(|held| {
            let Key { stars, settings: of, kernel } = &held.key;
            Arc::ptr_eq(stars, scene.stars) && of == settings && Arc::ptr_eq(kernel, of_frame)
        })
    }

    fn hold_new(&mut self, gpu: &Gpu, pass: &mut wgpu::ComputePass<'_>, glare: &GlareSettings, key: Key) {
        // Gone before its successor is made, so that both never exist at once.
        self.held = None;
        self.held = Some(self.passes.get_or_init(|| MapPasses::new(gpu)).make(gpu, pass, glare, key));
    }
}

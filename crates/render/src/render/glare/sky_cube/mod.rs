//! The `sky_cube` glare: a map of the whole sky, and the brightest sources individually. The map is recomputed only if
//! the scene, the camera's position or the settings change. Data that depends on the directions of the views is
//! computed for every frame.

mod map;
mod objects;
mod record;
mod sprites;
mod veil;

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use self::{
    map::{Held, Key, MapPasses},
    objects::{ObjectFrame, ObjectPasses},
    record::{Variant, composite},
    sprites::SpritePasses,
    veil::{VeilFrame, VeilPasses},
};
use super::composite::GlareCompositePass;
use crate::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GrowingBuffer, Variants},
    photometry::glare::GlareKernel,
    plan::{
        GlareMap, VeilInSums,
        glare::sky_cube::{FarLight, SkyCubeSettings, eye_class_m, map_place_pc, pixel_class_rad},
    },
    relativity::Motion,
    render::technique::{Holding, PipelineJob, Recording, Series, Wish, begin_pass},
    scene::{SceneSnapshot, surroundings::LocalSky},
    units::PARSEC_M,
    view::Viewport,
};

/// Stars and camera of a frame.
struct SkyScene<'a> {
    stars: &'a Arc<StarSet>,
    camera_pc: DVec3,
    motion: Option<Motion>,
    local_sky: Option<Arc<LocalSky>>,
    faintest_lx: f64,
    /// Relative tolerance: the largest veil that a source may add without being drawn individually.
    tolerance: f64,
    /// Budget of the veil; `None` for frames without one.
    in_sums: Option<VeilInSums>,
}

impl<'a> SkyScene<'a> {
    fn new(snapshot: &'a SceneSnapshot, parameters: &GlareMap, in_sums: Option<VeilInSums>) -> Self {
        Self {
            stars: &snapshot.stars,
            camera_pc: snapshot.camera.position_m / PARSEC_M,
            motion: Motion::new(snapshot.camera.velocity_c),
            local_sky: snapshot.objects.sky_of_stars(snapshot.camera.position_m).map(Arc::new),
            faintest_lx: parameters.faintest_lx,
            tolerance: parameters.tolerance,
            in_sums,
        }
    }

    /// Returns the settings of the map for these views.
    fn settings(&self, views: &Views) -> SkyCubeSettings {
        let place_pc = map_place_pc(self.camera_pc);
        let camera_m = ((self.camera_pc - place_pc) * PARSEC_M).length();
        SkyCubeSettings {
            place_pc,
            motion: self.motion,
            local_sky: self.local_sky.clone(),
            faintest_lx: self.faintest_lx,
            farthest_eye_pc: eye_class_m(camera_m + views.farthest_eye_m) / PARSEC_M,
            tolerance: self.tolerance,
            in_sums: self.in_sums,
            pixel_classes_rad: views.pixel_classes_rad.clone(),
        }
    }
}

/// View properties that the map depends on.
struct Views {
    /// See [`SkyCubeSettings::pixel_classes_rad`].
    pixel_classes_rad: Vec<f64>,
    /// Distance from the camera to the farthest eye, m.
    farthest_eye_m: f64,
}

impl Views {
    fn new(viewports: &[Viewport]) -> Self {
        let mut classes: Vec<f64> = viewports.iter().map(pixel_class).collect();
        classes.sort_by(f64::total_cmp);
        classes.dedup();
        let eyes = viewports.iter().map(|viewport| viewport.eye_offset_m.length());
        Self { pixel_classes_rad: classes, farthest_eye_m: eyes.fold(0.0, f64::max) }
    }
}

/// Lazily created passes, and buffers.
pub(super) struct SkyCube {
    passes: OnceLock<MapPasses>,
    sprites: OnceLock<SpritePasses>,
    composites: Variants<Variant, GlareCompositePass>,
    veil: OnceLock<VeilPasses>,
    objects: ObjectPasses,
    near_points: Variants<bool, wgpu::ComputePipeline>,
    /// For each series of frames: the map for exact frames, and the map for frames whose veil is in the sums.
    held: Vec<[Option<Held>; 2]>,
    /// Sums of the light of distant stars.
    far: FarLight,
    /// Views of the last frame of the first series, and its error budget if its veil was in the sums.
    last: Option<(Views, Option<VeilInSums>)>,
    /// Data shared by the batches of a frame.
    veil_frame: Option<VeilFrame>,
    object_frame: Option<ObjectFrame>,
    /// Sprites of each square of blocks, then of each block.
    lists: GrowingBuffer,
}

/// Returns the map of a series for frames whose veil is in the sums.
fn held_in_sums(held: &[[Option<Held>; 2]], series: Series) -> &Held {
    let held = held.get(series.slot).and_then(|[_, in_sums]| in_sums.as_ref());
    let Some(held) = held else { unreachable!("the map must be made before the veil") };
    held
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
            veil: OnceLock::new(),
            objects: Variants::new(),
            near_points: Variants::new(),
            held: Vec::new(),
            far: FarLight::default(),
            last: None,
            veil_frame: None,
            object_frame: None,
            lists: GrowingBuffer::new("glare lists", wgpu::BufferUsages::STORAGE),
        }
    }

    /// Returns jobs that create the pipelines for the viewports of `wish`.
    pub(super) fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let gpu = wish.gpu;
        let variant = Variant::new(&wish.forecast.methods.glare_map, wish.viewports);
        let in_sums = wish.forecast.may_have_veil_in_sums;
        let plain_forms = wish.forecast.plain_forms();
        let mut jobs = Vec::new();
        // The jobs that take longest come first.
        if !in_sums || wish.made.hdr || wish.made.hdr_stays {
            jobs.push(PipelineJob::new("glare", move || composite(&self.composites, gpu, variant)));
            jobs.push(PipelineJob::new("glare sprites", move || {
                self.sprites.get_or_init(|| SpritePasses::new(gpu));
            }));
        }
        if in_sums {
            jobs.push(PipelineJob::new("glare veil", move || {
                self.veil.get_or_init(VeilPasses::new).pipelines(gpu, variant.tabulated);
            }));
            if !wish.objects.is_empty() {
                jobs.extend(plain_forms.iter().map(|&has_plain| {
                    PipelineJob::new("glare of bodies", move || {
                        objects::pipeline(&self.objects, gpu, variant, has_plain)
                    })
                }));
                jobs.push(PipelineJob::new("points of the glare of bodies", move || {
                    objects::points_pipeline(&self.near_points, gpu, variant.tabulated)
                }));
            }
        }
        jobs.push(PipelineJob::new("glare map", move || {
            self.passes.get_or_init(|| MapPasses::new(gpu));
        }));
        jobs
    }

    /// Releases all buffers.
    pub(super) fn release(&mut self) {
        self.held.clear();
        self.far = FarLight::default();
        self.lists.release();
        self.veil_frame = None;
        self.object_frame = None;
    }

    /// Releases the maps of a series that no longer needs them, and all buffers if no series has a map.
    pub(super) fn release_series(&mut self, series: Series) {
        self.keep(series);
        self.held[series.slot] = [None, None];
        if self.held.iter().flatten().all(Option::is_none) {
            self.release();
        }
    }

    /// Ensures that there is one entry per series, and releases the maps of series that no longer exist.
    pub(super) fn keep(&mut self, series: Series) {
        self.held.resize_with(series.slots, || [None, None]);
    }

    /// Records the glare of a frame over its pictures.
    pub(super) fn record(&mut self, recording: &mut Recording<'_>) {
        self.hold_for(recording);
        self.record_views(recording);
    }

    /// Records the glare of a frame whose veil is in the sums at the points of its grids, and the data shared by all batches.
    pub(super) fn record_points(&mut self, recording: &mut Recording<'_>) {
        self.hold_for(recording);
        self.record_veil_points(recording);
        self.record_near_points(recording);
    }

    /// Records the glare of one batch of a frame whose veil is in the sums.
    pub(super) fn record_in_sums(&mut self, recording: &mut Recording<'_>, batch: usize) {
        self.record_veil(recording, batch);
        self.record_objects(recording, batch);
    }

    /// Computes the map of a frame unless it is up to date.
    fn hold_for(&mut self, recording: &mut Recording<'_>) {
        let frame = recording.frame;
        let Some(kernel) = &frame.plan.glare.kernel else { unreachable!("a plan with this method has a kernel") };
        let in_sums = frame.plan.glare.in_sums;
        let scene = SkyScene::new(frame.scene, &frame.plan.glare.map, in_sums);
        let views = Views::new(&frame.plan.views.all_viewports);
        let settings = scene.settings(&views);
        if frame.series.slot == 0 {
            self.last = Some((views, in_sums));
        }
        if !self.holds(frame.series.slot, &scene, &settings, kernel) {
            let gpu = recording.gpu;
            let mut pass = begin_pass(recording.encoder, recording.timer, "glare");
            let key = Key { stars: Arc::clone(scene.stars), settings, kernel: Arc::clone(kernel) };
            self.hold_new(gpu, &mut pass, frame.series.slot, &frame.plan.glare.map, key);
        }
    }

    /// Computes the map of a changed scene in advance, assuming the views of the last frame. The time is then not spent between reading the poses of
    /// a headset and showing its picture.
    pub(super) fn hold_map(&mut self, holding: &Holding<'_>) {
        let (Some((views, in_sums)), Some(kernel)) = (&self.last, holding.kernel) else { return };
        let scene = SkyScene::new(holding.scene, &holding.methods.glare_map, *in_sums);
        let settings = scene.settings(views);
        if self.holds(0, &scene, &settings, kernel) {
            return;
        }
        let gpu = holding.gpu;
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("glare map") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let key = Key { stars: Arc::clone(scene.stars), settings, kernel: Arc::clone(kernel) };
        if self.held.is_empty() {
            self.held.push([None, None]);
        }
        self.hold_new(gpu, &mut pass, 0, &holding.methods.glare_map, key);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }

    /// Whether the current map has these settings.
    fn holds(
        &self,
        slot: usize,
        scene: &SkyScene<'_>,
        settings: &SkyCubeSettings,
        frame_kernel: &Arc<dyn GlareKernel>,
    ) -> bool {
        self.held.get(slot).and_then(|held| held[kind_of(settings)].as_ref()).is_some_and(|held| {
            let Key { stars, settings: held_settings, kernel } = &held.key;
            Arc::ptr_eq(stars, scene.stars) && held_settings == settings && Arc::ptr_eq(kernel, frame_kernel)
        })
    }

    fn hold_new(&mut self, gpu: &Gpu, pass: &mut wgpu::ComputePass<'_>, slot: usize, map: &GlareMap, key: Key) {
        let kind = kind_of(&key.settings);
        let passes = self.passes.get_or_init(|| MapPasses::new(gpu));
        let made = passes.make(gpu, pass, map, (key, &mut self.far), self.held.iter().flatten().flatten());
        self.held[slot][kind] = Some(made);
    }
}

/// Returns the index of the map for these settings: 0 for exact frames, 1 for frames whose veil is in the sums.
fn kind_of(settings: &SkyCubeSettings) -> usize {
    usize::from(!settings.is_exact())
}

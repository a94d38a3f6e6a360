//! Rendering: draws one snapshot of the scene in many views at once.
//!
//! [`Renderer::render`] plans a frame (`crate::plan`, independent of the GPU), records all phases of all techniques into one submission, waits, and
//! reads back the requested images. [`Renderer::submit`] and [`Renderer::finish`] are its two halves, for callers that do other work meanwhile. Two
//! frames may be in flight. A frame does not depend on the previous one, except for the exposure that the caller passes in.
//!
//! Each technique has a folder, for example `stars`, `smooth_light`, `bodies`, `asteroids`, `glare` and `display`.
//! `technique` defines their common interface, `sequence` their order, and `targets` the buffers that they share. No
//! technique imports another.

mod air;
pub(crate) mod asteroids;
mod bodies;
pub(crate) mod constants;
mod diffuse;
mod display;
mod display_variant;
mod error;
mod frame;
mod glare;
pub(crate) mod layout;
mod meter;
mod overlay;
#[cfg(test)]
mod pass_tests;
mod plain_blocks;
mod point_grid;
mod prepare;
#[doc(hidden)]
mod presentation;
#[cfg(test)]
mod presentation_tests;
pub mod probe;
mod read;
mod request;
mod sequence;
mod shader;
mod smooth_light;
mod stars;
mod submit;
mod tabulated;
mod targets;
mod technique;
pub(crate) mod viewport;

use std::collections::VecDeque;

pub use self::{
    asteroids::{
        AsteroidCounts,
        impostors::atlas::{BakedImpostors, ImpostorAtlasError},
    },
    error::RenderError,
    frame::{Frame, FrameImage, FrameTimes, ViewStatistics, Wanted},
    prepare::{PipelinesAhead, PrepareStep},
    presentation::Presentation,
    request::{FrameRequest, SkyMapUse},
    submit::SubmittedFrame,
};
// Used by tests, not part of the public interface.
#[doc(hidden)]
pub use self::{
    asteroids::impostors::probe as impostor_probe,
    constants::tables as constant_tables,
    shader::{SHADER_FOLDER_VARIABLE, Shader, checked_shader_folder, shaders},
};
use self::{
    meter::MeterTargets,
    submit::{FrameSlot, InFlight},
    tabulated::MappingTables,
    targets::Targets,
    technique::{Holding, Technique},
};
use crate::plan::tables::TableForm;
use crate::{
    gpu::{AdapterReport, Gpu, GpuError, GpuOptions, StructLayout},
    plan::{Limits, Methods, PlanError, Planner},
    view::{Rig, Viewport},
};

/// Draws frames on one GPU.
pub struct Renderer {
    gpu: Gpu,
    limits: Limits,
    /// Three planners per series of frames: for the frames, for their meters, and for HDR images within a budget.
    planners: Vec<Planner>,
    /// Plans pictures of maps of faint light. The other planners keep their data for frames.
    map_planner: Planner,
    techniques: Vec<Box<dyn Technique + Send>>,
    /// Impostor atlases baked in advance.
    baked: BakedImpostors,
    pipelines_ahead: PipelinesAhead,
    /// Techniques for another form of the tables, kept from an earlier rig, and that form.
    idle_techniques: Option<(TableForm, Vec<Box<dyn Technique + Send>>)>,
    targets: Targets,
    /// Targets for drawing pictures of the map of faint light; present as long as some must still be drawn.
    sky_targets: Option<Targets>,
    meter: MeterTargets,
    tables: MappingTables,
    frames: u64,
    /// Frames that were submitted and are not yet finished, the oldest first.
    in_flight: VecDeque<InFlight>,
    /// Slots for future frames.
    spare_slots: Vec<FrameSlot>,
    /// Whether to skip chunks outside every view; false only to measure the benefit.
    pub culling: bool,
    /// Factor on the fixed-point units, normally 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
    /// Order in which stars are uploaded. `None`: by right ascension for methods that read the whole catalogue, by
    /// chunk for methods that read the result of culling. `Some(seed)`: shuffled star by star, to measure the influence
    /// of the order.
    #[doc(hidden)]
    pub catalogue_order: Option<u64>,
}

impl Renderer {
    /// Creates a renderer on an open device.
    pub fn new(gpu: Gpu) -> Self {
        let baked = BakedImpostors::new(&gpu);
        Self::with_baked(gpu, baked)
    }

    /// Reopens the adapter after its device was lost. Frames in flight are lost; frame numbers continue.
    ///
    /// # Errors
    ///
    /// The adapter cannot be opened at present.
    pub fn reopen(&mut self) -> Result<(), GpuError> {
        let options = self.gpu.options().clone();
        let frames = self.frames;
        let gpu = Gpu::open(&options)?;
        self.baked.forget_textures();
        self.pipelines_ahead.begin_again();
        let pipelines_ahead = self.pipelines_ahead.clone();
        *self = Self { frames, pipelines_ahead, ..Self::with_baked(gpu, self.baked.clone()) };
        Ok(())
    }

    /// Returns the options that open the same adapter in the same way.
    pub fn gpu_options(&self) -> &GpuOptions {
        self.gpu.options()
    }

    /// Destroys the device, as a driver reset does, to test the recovery.
    #[doc(hidden)]
    pub fn destroy_device(&self) {
        self.gpu.device.destroy();
    }

    fn with_baked(gpu: Gpu, baked: BakedImpostors) -> Self {
        Self {
            limits: gpu.limits(),
            planners: vec![Planner::new()],
            map_planner: Planner::new(),
            techniques: sequence::techniques(&gpu, &baked),
            baked,
            pipelines_ahead: PipelinesAhead::default(),
            idle_techniques: None,
            targets: Targets::new(&gpu),
            sky_targets: None,
            meter: MeterTargets::default(),
            tables: MappingTables::default(),
            frames: 0,
            in_flight: VecDeque::new(),
            spare_slots: Vec::new(),
            culling: true,
            unit_factor: 1.0,
            catalogue_order: None,
            gpu,
        }
    }

    /// Returns the store into which another thread puts the impostor atlases that this renderer will need, so that no frame waits for them.
    pub fn baked_impostors(&self) -> &BakedImpostors {
        &self.baked
    }

    /// Returns the adapter in use.
    pub fn adapter(&self) -> &AdapterReport {
        self.gpu.report()
    }

    /// Limits of the adapter for plans.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Returns the device, for computations besides frames.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Checks that the adapter can hold the images of a rig.
    ///
    /// # Errors
    ///
    /// A view is too large, or there are too many views. The error names the first such view.
    pub fn check(&self, rig: &Rig) -> Result<(), PlanError> {
        self.limits.check(rig)
    }

    /// Releases everything that depends on the scene or on the size of images. Frames in flight keep their buffers and
    /// can still be finished.
    fn forget_buffers(&mut self) {
        self.techniques.iter_mut().for_each(|technique| technique.release());
        self.targets.release();
        self.sky_targets = None;
        self.meter = MeterTargets::default();
        self.tables.release();
        self.gpu.forget_frames();
        self.spare_slots.clear();
    }

    /// Uploads the tables of tabulated pictures. If their form differs from the previous one, techniques with matching pipelines replace the current
    /// techniques, which are kept for later.
    fn hold_tables(&mut self, viewports: &[Viewport]) -> Result<(), RenderError> {
        let form = self.tables.needed(&self.gpu, viewports);
        if form != self.gpu.table_form() {
            // A frame in flight can be read back only by the techniques that recorded it.
            while !self.in_flight.is_empty() {
                self.abandon_oldest()?;
            }
            let before = self.gpu.table_form();
            self.tables.hold(&mut self.gpu, viewports);
            self.techniques.iter_mut().for_each(|technique| technique.release());
            self.gpu.forget_frames();
            let idle = self.idle_techniques.take().filter(|(of_form, _)| *of_form == form);
            let others =
                idle.map_or_else(|| sequence::techniques(&self.gpu, &self.baked), |(_, techniques)| techniques);
            self.idle_techniques = Some((before, std::mem::replace(&mut self.techniques, others)));
        }
        self.tables.hold(&mut self.gpu, viewports);
        Ok(())
    }

    /// Runs `step` for every technique, with the inputs for holding the scene of a series of frames.
    fn holding<'a>(
        &'a mut self,
        slot: usize,
        scene: &'a crate::scene::SceneSnapshot,
        settings: &'a crate::plan::settings::RenderSettings,
        mut step: impl FnMut(&mut dyn Technique, &Holding<'_>) -> Result<(), RenderError>,
    ) -> Result<(), RenderError> {
        let (gpu, catalogue_order) = (&self.gpu, self.catalogue_order);
        let (methods, asteroids) = (&Methods::new(settings), &settings.asteroids);
        let kernel = self.planners[slot].kernel();
        let holding = Holding { gpu, scene, methods, asteroids, kernel, catalogue_order };
        self.techniques.iter_mut().try_for_each(|technique| step(&mut **technique, &holding))
    }
}

/// Returns every structure that Rust and the shaders share.
#[doc(hidden)]
pub fn struct_layouts() -> Vec<StructLayout> {
    let layouts_of_techniques = [
        layout::struct_layouts,
        air::layout::struct_layouts,
        asteroids::layout::struct_layouts,
        bodies::layout::struct_layouts,
        diffuse::layout::struct_layouts,
        display::layout::struct_layouts,
        glare::layout::struct_layouts,
        overlay::layout::struct_layouts,
        plain_blocks::layout::struct_layouts,
        smooth_light::layout::struct_layouts,
        stars::layout::struct_layouts,
    ];
    layouts_of_techniques.iter().flat_map(|layouts| layouts()).collect()
}

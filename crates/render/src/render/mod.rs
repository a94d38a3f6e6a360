//! Rendering: one snapshot of the scene in many views at once.
//!
//! [`Renderer::render`] makes the plan of a frame (`crate::plan`, no GPU in sight), records all phases of all techniques into one
//! submission, waits, and reads back what was asked for. [`Renderer::submit`] and [`Renderer::finish`] are its two halves, for callers that
//! have better to do than to wait; two frames may be in flight. Nothing of a frame depends on the frame before it but the exposure that the caller hands in.
//!
//! A technique is a folder: `stars`, `smooth_light`, `bodies`, `asteroids`, `glare`, `display`. `technique` says what each one does, `sequence`
//! in which order; what two of them share lies in `targets`. No technique imports another.

mod air;
pub(crate) mod asteroids;
mod bodies;
pub(crate) mod constants;
mod diffuse;
mod display;
mod error;
mod frame;
mod glare;
pub(crate) mod layout;
mod meter;
mod overlay;
#[cfg(test)]
mod pass_tests;
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
    prepare::PrepareStep,
    presentation::Presentation,
    request::{FrameRequest, SkyMapUse},
    submit::SubmittedFrame,
};
// What tests look at, and no part of the interface.
#[doc(hidden)]
pub use self::{
    asteroids::impostors::probe as impostor_probe,
    constants::tables as constant_tables,
    shader::{Shader, shaders},
};
use self::{
    meter::Meter,
    submit::{FrameSlot, InFlight},
    tabulated::MappingTables,
    targets::Targets,
    technique::{Holding, Technique},
};
use crate::{
    gpu::{AdapterReport, Gpu, GpuError, GpuOptions, StructLayout},
    plan::{Limits, PlanError, Planner},
    view::{Rig, Viewport},
};

/// Draws frames on one GPU.
pub struct Renderer {
    gpu: Gpu,
    limits: Limits,
    /// One for each series of frames.
    planners: Vec<Planner>,
    techniques: Vec<Box<dyn Technique + Send>>,
    /// Atlases of impostors that were baked ahead.
    baked: BakedImpostors,
    /// Those of the last rig whose tables took another number of buffers (0: no picture of it was tabulated), and that number.
    idle_techniques: Option<(usize, Vec<Box<dyn Technique + Send>>)>,
    targets: Targets,
    /// Those of the pictures of a map of faint light, while there are some to draw.
    sky_targets: Option<Targets>,
    meter: Meter,
    tables: MappingTables,
    frames: u64,
    /// The frames that have been submitted and not finished, the oldest first.
    in_flight: VecDeque<InFlight>,
    /// For the frames to come.
    spare_slots: Vec<FrameSlot>,
    /// Whether chunks outside of every view are left out; false only to measure what that saves.
    pub culling: bool,
    /// Factor on the fixed-point units: 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
    /// Order in which the stars reach the GPU. `None`: that of right ascension for methods that read the whole catalogue, that of
    /// the chunks for those that read what culling leaves. `Some(seed)`: one that the seed shuffles, star by star, to measure
    /// what depends on it.
    #[doc(hidden)]
    pub catalogue_order: Option<u64>,
}

impl Renderer {
    /// A renderer on an open device.
    pub fn new(gpu: Gpu) -> Self {
        Self::with_baked(gpu, BakedImpostors::default())
    }

    /// Opens the adapter again in place of a device that is lost. Frames in flight are gone; numbers of frames go on.
    ///
    /// # Errors
    ///
    /// The adapter cannot be opened at present.
    pub fn reopen(&mut self) -> Result<(), GpuError> {
        let options = GpuOptions { adapter: Some(self.adapter().adapter.clone()), ..GpuOptions::default() };
        let frames = self.frames;
        *self = Self { frames, ..Self::with_baked(Gpu::open(&options)?, self.baked.clone()) };
        Ok(())
    }

    /// Destroys the device, as a driver does that is reset: tests look at what follows.
    #[doc(hidden)]
    pub fn destroy_device(&self) {
        self.gpu.device.destroy();
    }

    fn with_baked(gpu: Gpu, baked: BakedImpostors) -> Self {
        Self {
            limits: gpu.limits(),
            planners: vec![Planner::new()],
            techniques: sequence::techniques(&gpu, &baked),
            baked,
            idle_techniques: None,
            targets: Targets::new(&gpu),
            sky_targets: None,
            meter: Meter::default(),
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

    /// Where another device puts atlases of impostors that this renderer is going to need, so that its frames need not wait for them.
    pub fn baked_impostors(&self) -> &BakedImpostors {
        &self.baked
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterReport {
        self.gpu.report()
    }

    /// What plans may ask of the adapter.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The device, to compute on it beside frames.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Whether the adapter can hold the images of a rig.
    ///
    /// # Errors
    ///
    /// The first view that is too large, or that is one too many.
    pub fn check(&self, rig: &Rig) -> Result<(), PlanError> {
        self.limits.check(rig)
    }

    /// Lets go of everything that belongs to a scene or a size. Frames in flight keep what they use and can still be finished.
    fn forget_buffers(&mut self) {
        self.techniques.iter_mut().for_each(|technique| technique.release());
        self.targets.release();
        self.sky_targets = None;
        self.meter = Meter::default();
        self.tables.release();
        self.gpu.forget_frames();
        self.spare_slots.clear();
    }

    /// Puts the tables of tabulated pictures onto the device. Where they take another number of buffers than those of the last
    /// rig did, pipelines for that number take the place of those in use, which are kept.
    fn hold_tables(&mut self, viewports: &[Viewport]) -> Result<(), RenderError> {
        let buffers = self.tables.needed(&self.gpu, viewports);
        if buffers != self.gpu.table_buffers() {
            // Who has recorded a frame reads it back.
            while !self.in_flight.is_empty() {
                self.abandon_oldest()?;
            }
            let before = self.gpu.table_buffers();
            self.tables.hold(&mut self.gpu, viewports);
            self.techniques.iter_mut().for_each(|technique| technique.release());
            self.gpu.forget_frames();
            let idle = self.idle_techniques.take().filter(|(of, _)| *of == buffers);
            let others =
                idle.map_or_else(|| sequence::techniques(&self.gpu, &self.baked), |(_, techniques)| techniques);
            self.idle_techniques = Some((before, std::mem::replace(&mut self.techniques, others)));
        }
        self.tables.hold(&mut self.gpu, viewports);
        Ok(())
    }

    /// Runs `step` for every technique, with what it takes to hold a scene for frames of a series.
    fn holding<'a>(
        &'a mut self,
        slot: usize,
        scene: &'a crate::scene::SceneSnapshot,
        settings: &'a crate::plan::settings::RenderSettings,
        mut step: impl FnMut(&mut dyn Technique, &Holding<'_>) -> Result<(), RenderError>,
    ) -> Result<(), RenderError> {
        let (gpu, catalogue_order) = (&self.gpu, self.catalogue_order);
        let holding = Holding { gpu, scene, settings, kernel: self.planners[slot].kernel(), catalogue_order };
        self.techniques.iter_mut().try_for_each(|technique| step(&mut **technique, &holding))
    }
}

/// The layout of every structure that Rust shares with the shaders.
#[doc(hidden)]
pub fn struct_layouts() -> Vec<StructLayout> {
    let of_techniques = [
        layout::struct_layouts,
        air::layout::struct_layouts,
        asteroids::layout::struct_layouts,
        bodies::layout::struct_layouts,
        diffuse::layout::struct_layouts,
        display::layout::struct_layouts,
        glare::layout::struct_layouts,
        overlay::layout::struct_layouts,
        smooth_light::layout::struct_layouts,
        stars::layout::struct_layouts,
    ];
    of_techniques.iter().flat_map(|layouts| layouts()).collect()
}

//! The plan of a frame: all decisions that are made before the adapter draws, as plain data in f64.
//!
//! A plan has one part per technique ([`super::sequence`]), which the technique computes in the steps of [`super::technique`]. The same
//! scene, views, settings and limits give the same plan.

use std::sync::Arc;

use glam::DVec3;

use super::{
    Limits, ViewsPlan,
    asteroids::{self, glare::clouds_of},
    bodies::textures::texture_bytes,
    budget::Output,
    error::PlanError,
    exposure::exposure_of_views,
    kept::Kept,
    methods::Methods,
    sequence::{self, Plan, Techniques},
    settings::{Accumulator, RenderSettings, StarMethod},
    smooth_light::SkyPart,
    stars::kernels::margin_px,
    technique::{CheckInputs, PlanInputs},
};
use crate::{
    photometry::glare::GlareKernel,
    scene::{SceneObjects, SceneSnapshot, bodies::suns},
    view::Rig,
};

impl Plan {
    /// Plans a frame with HDR images and the exposure of a fully adapted eye.
    ///
    /// # Errors
    ///
    /// The scene cannot be drawn in these views with these settings within these limits.
    pub fn new(
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        limits: &Limits,
    ) -> Result<Self, PlanError> {
        Planner::new().plan(scene, rig, settings, None, PlanOutputs::new(Output::Hdr), limits)
    }
}

/// Purpose of a plan.
#[derive(Clone, Copy, Debug)]
pub struct PlanOutputs<'a> {
    /// Kind of images.
    pub output: Output,
    /// Whether each view is wanted, in the order of the rig; `None`: all views are wanted. Unwanted views are drawn only if the exposure is metered.
    pub views: Option<&'a [bool]>,
    /// Use of maps of faint light.
    pub sky: SkyUse,
    /// Source of an automatic exposure.
    pub exposure: ExposureSource,
}

impl PlanOutputs<'_> {
    /// Requests images of the given kind for all views, without a map of faint light and with an exposure from these views.
    pub fn new(output: Output) -> Self {
        Self { output, views: None, sky: SkyUse::StarByStar, exposure: ExposureSource::Own }
    }
}

/// Source of the automatic exposure of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ExposureSource {
    /// The frame's own views: planned or metered.
    #[default]
    Own,
    /// The plan of other views, with the given exposure.
    Planned(f64),
    /// A separate meter. It runs before the frame is drawn, so the exposure is known.
    Meter,
}

/// Use of maps of faint light by a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SkyUse {
    /// Draw every star individually.
    StarByStar,
    /// Read a map if that is cheaper.
    Map,
    /// Draw pictures of a map.
    Part(SkyPart),
}

/// Checks whether a star method, a camera that moves or rests, and objects can be drawn together. Fast.
///
/// # Errors
///
/// The combination that cannot be drawn.
pub fn check_together(
    method: StarMethod,
    moves: bool,
    objects: &SceneObjects,
    limits: &Limits,
) -> Result<(), PlanError> {
    if moves && method.accumulator() != Accumulator::FixedPoint {
        return Err(PlanError::AtRestOnly(method.name()));
    }
    if objects.is_empty() {
        return Ok(());
    }
    if method.accumulator() != Accumulator::FixedPoint {
        return Err(PlanError::StarsOnly(method.name()));
    }
    if moves {
        return Err(PlanError::ObjectsAtRest);
    }
    let (bytes, limit) = (texture_bytes(objects), limits.max_binding_bytes);
    if bytes > limit {
        return Err(PlanError::TooManyTexels { bytes, limit });
    }
    asteroids::frame::check(objects, limits)
}

/// Makes plans. Results that take long to compute are kept from plan to plan; keeping them does not change any plan.
pub struct Planner {
    techniques: Techniques,
    kept: Kept,
    /// Whether to skip chunks of stars outside every view; false only to measure the benefit.
    pub culling: bool,
    /// Whether to ask for pages of a deep store that are not in memory; false for plans from which nothing is drawn.
    pub asks_for_pages: bool,
    /// Whether stars of a deep store may be read while the frame is drawn, if they do not fit into the memory.
    pub streams_stars: bool,
    /// Factor on the fixed-point units, normally 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
}

impl Default for Planner {
    fn default() -> Self {
        Self::new()
    }
}

impl Planner {
    /// Creates a planner that keeps nothing yet.
    pub fn new() -> Self {
        Self {
            techniques: sequence::techniques(),
            kept: Kept::default(),
            culling: true,
            asks_for_pages: true,
            streams_stars: false,
            unit_factor: 1.0,
        }
    }

    /// Checks that a scene can be drawn with these settings in any view, and computes data that depends on the settings alone.
    ///
    /// # Errors
    ///
    /// The scene cannot be drawn, or a file that the settings name cannot be read.
    pub fn check(
        &mut self,
        scene: &SceneSnapshot,
        settings: &RenderSettings,
        limits: &Limits,
    ) -> Result<(), PlanError> {
        let methods = &Methods::new(settings);
        check_together(methods.stars, scene.camera.velocity_c != DVec3::ZERO, &scene.objects, limits)?;
        let inputs = CheckInputs { scene, settings, methods };
        self.techniques.iter_mut().try_for_each(|technique| technique.check(&inputs, &mut self.kept))
    }

    /// The planned exposure of views: that of [`Self::plan`], without the rest of the plan.
    ///
    /// # Errors
    ///
    /// Those of [`Self::check`].
    pub fn exposure(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        limits: &Limits,
    ) -> Result<Option<f64>, PlanError> {
        self.check(scene, settings, limits)?;
        Ok(exposure_of_views(&mut self.kept, scene, rig, settings))
    }

    /// The glare kernel that was computed last.
    pub(crate) fn kernel(&self) -> Option<&Arc<dyn GlareKernel>> {
        self.kept.kernel()
    }

    /// Plans a frame. With automatic exposure, `adapted_ev100` is the exposure to show the frame with; if it is `None`, the exposure is that of a
    /// fully adapted eye.
    ///
    /// # Errors
    ///
    /// The scene cannot be drawn in these views with these settings within these limits.
    pub fn plan(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
        outputs: PlanOutputs<'_>,
        limits: &Limits,
    ) -> Result<Plan, PlanError> {
        // Checks.
        limits.check(rig)?;
        self.techniques.iter().try_for_each(|technique| technique.check_rig(rig, settings, limits))?;
        self.check(scene, settings, limits)?;
        // Select the views to draw: all of them if the exposure is metered. A planned exposure is computed for all views too, because lit objects in
        // any view may raise it.
        let PlanOutputs { output, views: wanted, sky, exposure } = outputs;
        let is_own = exposure == ExposureSource::Own;
        let wanted = wanted.filter(|_| !(is_own && settings.exposure.is_metered()));
        let has_unseen_objects =
            is_own && !scene.objects.is_empty() && wanted.is_some_and(|wanted| wanted.contains(&false));
        let exposure_of_all = if has_unseen_objects { self.exposure(scene, rig, settings, limits)? } else { None };
        let exposure = exposure_of_all.map_or(exposure, ExposureSource::Planned);
        let camera = &scene.camera;
        let views = ViewsPlan::new(rig.viewports(camera.world_from_camera), wanted, camera, limits);
        // Objects as the camera and the eyes see them.
        let objects = self.kept.objects_seen(scene);
        let suns = suns(&objects);
        let clouds = clouds_of(&objects, &suns, camera.position_m, &views.viewports);
        // The parts of the plan.
        let inputs = PlanInputs {
            scene,
            rig,
            settings,
            methods: &Methods::new(settings),
            limits,
            adapted_ev100,
            output,
            sky,
            exposure,
            objects: &objects,
            suns: &suns,
            clouds: &clouds,
            margin_px: margin_px(settings, &views.viewports),
            culling: self.culling,
            asks_for_pages: self.asks_for_pages,
            streams_stars: self.streams_stars,
            unit_factor: self.unit_factor,
        };
        let mut plan = Plan { views, ..Plan::default() };
        sequence::plan(&mut self.techniques, &inputs, &mut self.kept, &mut plan)?;
        Ok(plan)
    }
}

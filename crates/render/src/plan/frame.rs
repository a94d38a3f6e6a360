//! The plan of a frame: everything that is decided before a GPU is asked for anything, as plain data in f64.
//!
//! In order: checks against the adapter's [`Limits`]; viewports and their tiles; stars that may be seen, bodies, fields of asteroids,
//! and what scatters light in the eye; the units that light adds up in; the kernel of every star; the certificate. The same scene, views,
//! settings and limits give the same plan.

use std::{
    f64::consts::PI,
    sync::{Arc, Weak},
    time::Instant,
};

use glam::DVec3;

use super::{
    Limits,
    asteroids::{
        self, AsteroidInputs, AsteroidPlan, Tables,
        glare::{Cloud, field_clouds},
    },
    bodies::{
        seen::{BodyPlan, HeldLights, PointSource, plan_bodies},
        textures::texture_bytes,
    },
    budget::{Output, are_smooth, display_step_cd_m2, draws_outputs_apart, least_veil_cd_m2, may_have_veil_in_sums},
    certificate::{Approximation, FramePlan, plan_stars},
    error::PlanError,
    exposure::{ShownStars, guard::Lit, pictures::Pictures, planned_ev100},
    glare::objects::ExtendedSource,
    overlay::{OverlayInputs, OverlayPlan, OverlayPlanner},
    settings::{
        Accumulator, ExposureSettings, GlareMethod, GlareSettings, PsfTextureSettings, RenderSettings, StarMethod,
        ToneMapSettings,
    },
    smooth_light::{BRIGHTEST_STEPS, SkyFace, SkyInputs, SkyMaps, SkyPlan},
    stars::{
        billboards::{BillboardPlan, DrawnPsf},
        cull::{CullSettings, SPLAT_MARGIN_PX, VisibleChunk, distinct_eyes_pc, visible_chunks},
        kernels::{GaussianWidth, KernelPlan, gaussian_of},
        range::{self, OtherLight, Ranges},
        travel,
    },
    tiles::{BYTES_PER_PIXEL, Batch, batches},
};
use crate::{
    catalogue::{chunks::StarSet, diffuse::DiffuseSky},
    photometry::{exposure::white_luminance_cd_m2, glare::GlareKernel},
    relativity::Motion,
    scene::{
        SceneObjects, SceneSnapshot,
        asteroids::AsteroidField,
        bodies::{Sun, suns},
        surroundings::LocalSky,
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Rig, Viewport},
};

/// The plan of a frame.
#[derive(Clone)]
pub struct Plan {
    /// What is reported: methods by name, and the certificate.
    pub report: FramePlan,
    /// Every image of every view that is drawn.
    pub viewports: Vec<Viewport>,
    /// Every image of every view, drawn or not: what frames of one rig share depends on these.
    pub all_viewports: Vec<Viewport>,
    /// The tiles of all viewports, in batches that fit into one binding each.
    pub batches: Vec<Batch>,
    /// Kernels of the stars of each viewport.
    pub kernels: Vec<KernelPlan>,
    /// Stars that may be seen, by chunks.
    pub visible: Vec<VisibleChunk>,
    /// Units that light adds up in.
    pub ranges: Ranges,
    /// Solid angle of all pictures, sr.
    pub total_solid_angle_sr: f64,
    /// The camera's place, pc.
    pub camera_pc: DVec3,
    /// How it moves; `None`: it rests.
    pub motion: Option<Motion>,
    /// Fainter stars are not drawn, lx.
    pub faintest_lx: f64,
    /// Exposure of the display images as far as it is known before the frame is drawn.
    pub known_ev100: Option<f64>,
    /// The exposure that the frame asks for, where that follows from the plan; elsewhere the meter tells.
    pub planned_ev100: Option<f64>,
    /// Which stars the views show.
    pub shown_stars: ShownStars,
    /// The ground and the air around the camera; `None`: space.
    pub local_sky: Option<Arc<LocalSky>>,
    /// Bodies, and points of light that are no stars; `None`: the scene has neither bodies nor fields.
    pub bodies: Option<BodyPlan>,
    /// Fields of asteroids; `None`: there are none.
    pub asteroids: Option<AsteroidPlan>,
    /// The least luminance that display images show, where the frame is made for those alone and they have a budget, cd/m^2.
    pub display_step_cd_m2: Option<f64>,
    /// Glare.
    pub glare: GlarePlan,
    /// Lines and text over display images; `None`: nothing.
    pub overlay: Option<Arc<OverlayPlan>>,
    /// The numbers of star methods that blend; `None` for the others.
    pub billboards: Option<BillboardPlan>,
    /// The point-spread function of `psf_texture`.
    pub psf: Option<Arc<DrawnPsf>>,
    /// The map of faint light that the frame reads; `None`: it draws all stars one by one.
    pub sky: Option<SkyPlan>,
    /// Light of no single star; `None`: there is none, or it is not drawn.
    pub diffuse: Option<Arc<DiffuseSky>>,
    /// What that light may err by where it is read between points, cd/m^2; `None`: every pixel reads it by itself.
    pub diffuse_step_cd_m2: Option<f64>,
    /// The picture of such a map that the frame is.
    pub sky_face: Option<SkyFace>,
    /// Time that culling took, ms.
    pub cull_ms: f64,
}

/// The glare of a frame.
#[derive(Clone)]
pub struct GlarePlan {
    /// What draws it; never `auto`.
    pub method: GlareMethod,
    /// Share of the light that is scattered.
    pub fraction: f64,
    /// The kernel of `sky_cube`.
    pub kernel: Option<Arc<dyn GlareKernel>>,
    /// What fields of asteroids scatter in the eye of each viewport; empty: nothing.
    pub extended_sources: Vec<Vec<ExtendedSource>>,
    /// `sky_cube` for display images alone: the veil of single sources adds up with the stars, and the rest is read from a coarse grid.
    pub in_sums: Option<VeilInSums>,
}

/// The glare of display images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VeilInSums {
    /// A source's veil below this is part of the smooth rest, cd/m^2 as if all light were scattered.
    pub least_cd_m2: f64,
}

impl GlarePlan {
    /// Share of the light of stars and points that adds up in their images before glare is drawn.
    pub fn share_in_sums(&self) -> f64 {
        if self.in_sums.is_some() { 1.0 - self.fraction } else { 1.0 }
    }

    /// Factor on light of surfaces that is smooth over degrees: a pass takes away what is scattered of them, and brings back the scattered light of stars and bodies alone, though as much of
    /// it comes from all around as goes there.
    pub fn share_of_smooth_surfaces(&self) -> f64 {
        let is_taken = self.method == GlareMethod::SkyCube && self.fraction < 1.0;
        if is_taken { 1.0 / (1.0 - self.fraction) } else { 1.0 }
    }

    /// The same of light that is added where sums become luminance: no pass comes after that where the veil is in the sums.
    pub fn share_of_smooth_light(&self) -> f64 {
        if self.in_sums.is_some() { 1.0 } else { self.share_of_smooth_surfaces() }
    }
}

impl Plan {
    /// The plan of a frame with HDR images that is shown as fully adapted.
    ///
    /// # Errors
    ///
    /// What of the scene cannot be drawn in these views with these settings within these limits.
    pub fn new(
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        limits: &Limits,
    ) -> Result<Self, PlanError> {
        Planner::new().plan(scene, rig, settings, None, PlanOutputs::new(Output::Hdr), limits)
    }
}

/// What a plan is for.
#[derive(Clone, Copy, Debug)]
pub struct PlanOutputs<'a> {
    /// Kind of images.
    pub output: Output,
    /// Which views are wanted, in the order of the rig; `None`: all of them. Others are drawn only where the exposure is metered.
    pub views: Option<&'a [bool]>,
    /// What it has to do with maps of faint light.
    pub sky: SkyUse,
    /// Where an automatic exposure comes from.
    pub exposure: ExposureSource,
}

impl PlanOutputs<'_> {
    /// Images of that kind of all views, star by star, with an exposure of their own.
    pub fn new(output: Output) -> Self {
        Self { output, views: None, sky: SkyUse::StarByStar, exposure: ExposureSource::Own }
    }
}

/// Where the automatic exposure of a frame comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ExposureSource {
    /// From its own views: planned or metered.
    #[default]
    Own,
    /// From the plan of other views: this is what they ask for.
    Planned(f64),
    /// From a meter of its own, which has looked before the frame is drawn. Its exposure is known then.
    Meter,
}

/// What a frame has to do with maps of faint light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SkyUse {
    /// It draws every star by itself.
    StarByStar,
    /// It may read one.
    Map,
    /// It is one of the pictures of one.
    Face(SkyFace),
}

/// Whether a star method, a camera that moves or rests, and bodies and fields can be drawn together. Takes no time.
///
/// # Errors
///
/// What cannot be drawn with what.
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

/// Makes plans, and keeps what takes its time to compute and depends on settings alone: kernels of glare, point-spread functions,
/// tables of directions. Plans do not depend on what is kept.
pub struct Planner {
    tables: Tables,
    kernel: Option<(GlareSettings, Arc<dyn GlareKernel>)>,
    psf: Option<(PsfTextureSettings, Arc<DrawnPsf>)>,
    overlay: OverlayPlanner,
    pictures: Pictures,
    sky_maps: SkyMaps,
    /// Objects through the air around a camera: of which, from where, and how they are seen.
    seen: Option<(Weak<SceneObjects>, DVec3, Arc<SceneObjects>)>,
    /// What bodies give to the eyes of the last frames.
    lights: HeldLights,
    /// Greatest slope of a display transform.
    slope: Option<(ToneMapSettings, f64)>,
    /// Whether chunks outside of every view are left out; false only to measure what that saves.
    pub culling: bool,
    /// Factor on the fixed-point units: 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
}

impl Default for Planner {
    fn default() -> Self {
        Self::new()
    }
}

impl Planner {
    /// A planner that keeps nothing yet.
    pub fn new() -> Self {
        Self {
            tables: Tables::default(),
            kernel: None,
            psf: None,
            overlay: OverlayPlanner::default(),
            pictures: Pictures::default(),
            sky_maps: SkyMaps::default(),
            seen: None,
            lights: HeldLights::default(),
            slope: None,
            culling: true,
            unit_factor: 1.0,
        }
    }

    /// Whether a scene can be drawn with these settings, whatever views look at it; keeps what takes its time.
    ///
    /// # Errors
    ///
    /// What cannot be drawn, or read from the files that the settings name.
    pub fn check(
        &mut self,
        scene: &SceneSnapshot,
        settings: &RenderSettings,
        limits: &Limits,
    ) -> Result<(), PlanError> {
        let method = settings.stars.method;
        check_together(method, scene.camera.velocity_c != DVec3::ZERO, &scene.objects, limits)?;
        // A file that changes alone is not read again.
        if method == StarMethod::PsfTexture && self.psf.as_ref().is_none_or(|(of, _)| *of != settings.stars.psf_texture)
        {
            let psf = DrawnPsf::new(&settings.stars.psf_texture.texture()?);
            self.psf = Some((settings.stars.psf_texture.clone(), Arc::new(psf)));
        }
        let glare = settings.glare.chosen(method);
        if glare == GlareMethod::SkyCube && !method.draws_catalogue() {
            return Err(PlanError::GlareOfCatalogue(method.name()));
        }
        // The exposure weighs the glare of bodies by the kernel, whichever method draws it.
        if glare == GlareMethod::SkyCube || (glare != GlareMethod::None && !scene.objects.is_empty()) {
            self.hold_kernel(&settings.glare)?;
        }
        Ok(())
    }

    /// The exposure that the plan alone gives views: what [`Self::plan`] finds for them, without the rest of the plan.
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
        let viewports = rig.viewports(scene.camera.world_from_camera);
        let pictures = self.pictures.of(&viewports);
        let stars = ShownStars::new(settings, &viewports, &pictures);
        if scene.objects.is_empty() {
            return Ok(as_told(planned_ev100(settings, &stars, &pictures, None)));
        }
        let camera_m = scene.camera.position_m;
        let objects = self.objects_seen(scene);
        let suns = suns(&objects);
        let glare = settings.glare.chosen(settings.stars.method);
        let fraction = settings.glare.fraction_scattered();
        let bodies = plan_bodies(&objects, &suns, &mut self.lights, camera_m, &viewports, SPLAT_MARGIN_PX);
        let clouds = clouds_of(&objects, &suns, camera_m, &viewports);
        let kernel = self.kernel().filter(|_| glare != GlareMethod::None);
        let lit = Lit {
            objects: &objects,
            suns: &suns,
            camera_m,
            viewports: &viewports,
            bodies: &bodies,
            clouds: &clouds,
            glare: kernel.map(|kernel| (&**kernel, fraction)),
        };
        Ok(as_told(planned_ev100(settings, &stars, &pictures, Some(&lit))))
    }

    /// The objects of a scene as its camera sees them: those of the plan before, where that was of the same.
    fn objects_seen(&mut self, scene: &SceneSnapshot) -> Arc<SceneObjects> {
        let (of, camera_m) = (&scene.objects, scene.camera.position_m);
        if let Some((before, at_m, seen)) = &self.seen
            && before.upgrade().is_some_and(|before| Arc::ptr_eq(&before, of))
            && *at_m == camera_m
        {
            return Arc::clone(seen);
        }
        let seen = of.seen_from(camera_m);
        self.seen = seen.local_sky.is_some().then(|| (Arc::downgrade(of), camera_m, Arc::clone(&seen)));
        seen
    }

    fn hold_kernel(&mut self, settings: &GlareSettings) -> Result<(), PlanError> {
        // What the kernel does not depend on is left out.
        let GlareSettings { method, fraction, absolute, weights, .. } = GlareSettings::default();
        let of_kernel = GlareSettings { method, fraction, absolute, weights, ..settings.clone() };
        if self.kernel.as_ref().is_none_or(|(of, _)| *of != of_kernel) {
            self.kernel = Some((of_kernel, settings.kernel()?));
        }
        Ok(())
    }

    /// See [`ToneMapSettings::greatest_slope`], which looks at hundreds of luminances.
    fn slope_of(&mut self, tone_map: &ToneMapSettings) -> f64 {
        match self.slope {
            Some((of, slope)) if of == *tone_map => slope,
            _ => {
                let slope = tone_map.greatest_slope();
                self.slope = Some((*tone_map, slope));
                slope
            }
        }
    }

    /// The kernel of glare that is kept.
    pub(crate) fn kernel(&self) -> Option<&Arc<dyn GlareKernel>> {
        self.kernel.as_ref().map(|(_, kernel)| kernel)
    }

    /// The plan of a frame. With automatic exposure, `adapted_ev100` is the exposure to show it with; without it the frame is shown as
    /// fully adapted.
    ///
    /// # Errors
    ///
    /// What of the scene cannot be drawn in these views with these settings within these limits.
    pub fn plan(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
        outputs: PlanOutputs<'_>,
        limits: &Limits,
    ) -> Result<Plan, PlanError> {
        limits.check(rig)?;
        let method = settings.stars.method;
        if method.accumulator() == Accumulator::Blending {
            limits.check_blended(rig)?;
        }
        if method == StarMethod::PixelGaussian {
            let width = GaussianWidth::new(&settings.stars.pixel_gaussian);
            Limits::check_round_kernels(rig, method.name(), |projection| width.reach_px(projection))?;
        }
        self.check(scene, settings, limits)?;

        let camera = &scene.camera;
        let motion = Motion::new(camera.velocity_c);
        let PlanOutputs { output, views, sky, exposure } = outputs;
        let all_viewports = rig.viewports(camera.world_from_camera);
        // The meter looks at all views, so they are drawn.
        let metered_here = settings.exposure.is_metered() && exposure == ExposureSource::Own;
        let views = views.filter(|_| !metered_here);
        // Bodies and asteroids in any view may ask for another exposure: then the plan looks at all of them.
        let looks_at_all = exposure == ExposureSource::Own
            && !scene.objects.is_empty()
            && views.is_some_and(|views| views.contains(&false));
        let of_all = if looks_at_all { self.exposure(scene, rig, settings, limits)? } else { None };
        let exposure = of_all.map_or(exposure, ExposureSource::Planned);
        let is_drawn = |viewport: &&Viewport| views.is_none_or(|views| views[viewport.view]);
        let viewports: Vec<Viewport> = all_viewports.iter().filter(is_drawn).cloned().collect();
        let sizes: Vec<[u32; 2]> = viewports.iter().map(Viewport::size).collect();
        let batches = batches(&sizes, limits.max_binding_bytes / BYTES_PER_PIXEL);
        // How far over a border the widest kernel reaches.
        let reaches = viewports.iter().filter_map(|viewport| gaussian_of(settings, viewport));
        let margin_px = reaches.map(|(_, reach_px)| reach_px).fold(SPLAT_MARGIN_PX, f64::max);
        let faintest_lx = illuminance_lx_from_magnitude(settings.stars.magnitude_limit);

        // Bodies, asteroids, and what they scatter in the eye.
        let objects = self.objects_seen(scene);
        let suns = suns(&objects);
        let held = &mut self.lights;
        let mut bodies =
            (!objects.is_empty()).then(|| plan_bodies(&objects, &suns, held, camera.position_m, &viewports, margin_px));
        let inputs = AsteroidInputs {
            objects: &objects,
            settings: &settings.asteroids,
            viewports: &viewports,
            margin_px,
            camera_m: camera.position_m,
            suns: &suns,
            limits,
        };
        let asteroids = AsteroidPlan::new(&inputs, &mut self.tables)?;
        if let (Some(bodies), Some(asteroids)) = (&mut bodies, &asteroids) {
            let through_air = |point: PointSource| {
                let through =
                    objects.local_sky.as_ref().map(|sky| sky.transmission(point.offset_m.normalize_or(DVec3::Y)));
                let kept = |c: usize| through.map_or(1.0, |through| through[c]);
                PointSource { intensity_cd: [0, 1, 2].map(|c| point.intensity_cd[c] * kept(c)), ..point }
            };
            bodies.points.extend(asteroids.cut.unresolved.iter().map(|node| through_air(node.point)));
        }
        let mut glare = GlarePlan {
            method: settings.glare.chosen(method),
            fraction: settings.glare.fraction_scattered(),
            kernel: None,
            extended_sources: Vec::new(),
            in_sums: None,
        };
        let clouds = clouds_of(&objects, &suns, camera.position_m, &viewports);
        if glare.method == GlareMethod::SkyCube {
            let kernel = self.kernel.as_ref().map(|(_, kernel)| Arc::clone(kernel));
            if let (Some(bodies), Some(kernel)) = (&mut bodies, &kernel) {
                bodies.keep_own_glare(&**kernel, glare.fraction);
            }
            glare.kernel = kernel;
            glare.extended_sources =
                clouds.iter().map(|clouds| clouds.iter().map(|cloud| cloud.source).collect()).collect();
        }

        // Kernels and certificate.
        let total_solid_angle_sr = viewports.iter().map(|v| v.projection.picture_solid_angle_sr()).sum();
        let pictures = self.pictures.of(&all_viewports);
        let shown_stars = ShownStars::new(settings, &all_viewports, &pictures);
        let planned_ev100 = if let ExposureSource::Planned(ev100) = exposure {
            Some(ev100)
        } else {
            let kernel = self.kernel().filter(|_| glare.method != GlareMethod::None);
            let lit = bodies.as_ref().map(|bodies| Lit {
                objects: &objects,
                suns: &suns,
                camera_m: camera.position_m,
                viewports: &viewports,
                bodies,
                clouds: &clouds,
                glare: kernel.map(|kernel| (&**kernel, glare.fraction)),
            });
            as_told(planned_ev100(settings, &shown_stars, &pictures, lit.as_ref()))
        };
        let known_ev100 = settings.exposure.known_ev100(adapted_ev100, planned_ev100);
        // Stars that may be seen: all of them, or those that the map of faint light leaves, which follows from the exposure.
        let camera_pc = camera.position_m / PARSEC_M;
        let mut cull_ms = 0.0;
        let culling = self.culling;
        let refraction = objects.local_sky.as_ref().and_then(|sky| sky.refraction);
        let mut seen_from = |stars: &StarSet, faintest_lx: f64| {
            let cull = CullSettings { faintest_lx, enabled: culling, motion, refraction, margin_px };
            let start = Instant::now();
            let visible = match method.reads_visible() {
                true => visible_chunks(stars, camera_pc, &viewports, cull),
                false => Vec::new(),
            };
            cull_ms += start.elapsed().as_secs_f64() * 1e3;
            visible
        };
        let known_white_ev100 = settings.known_white_ev100(known_ev100);
        let (expected_ev100, all_visible) = match known_white_ev100 {
            Some(ev100) => (Some(ev100), None),
            None => {
                let visible = seen_from(&scene.stars, faintest_lx);
                let air_cd_m2 = objects.local_sky.as_ref().map_or(0.0, |sky| sky.mean_cd_m2);
                let diffuse_cd_m2 = scene.stars.unresolved.as_ref().map_or(0.0, |diffuse| diffuse.mean_cd_m2());
                let air_lx = (air_cd_m2 + diffuse_cd_m2) * total_solid_angle_sr;
                let ev100 = expected_ev100(&visible, bodies.as_ref(), air_lx, total_solid_angle_sr, &settings.exposure);
                (ev100, Some(visible))
            }
        };
        let mut step_cd_m2 = None;
        if output == Output::Display && draws_outputs_apart(settings, &objects, &all_viewports) {
            let white_cd_m2 = expected_ev100.map_or(0.0, white_luminance_cd_m2);
            let slope = self.slope_of(&settings.tone_map);
            step_cd_m2 = display_step_cd_m2(&settings.accuracy, slope, white_cd_m2);
            let veil_step_cd_m2 = step_cd_m2.filter(|_| may_have_veil_in_sums(settings, &objects, &all_viewports));
            glare.in_sums =
                veil_step_cd_m2.map(|step| VeilInSums { least_cd_m2: least_veil_cd_m2(step) / glare.fraction });
        }
        let may_read_map = sky == SkyUse::Map && all_visible.is_none() && motion.is_none();
        let sky_plan = step_cd_m2.filter(|_| may_read_map).and_then(|step_cd_m2| {
            self.sky_maps.choose(&SkyInputs {
                settings,
                stars: &scene.stars,
                camera_pc,
                viewports: &viewports,
                step_cd_m2,
                faintest_lx,
                limits,
            })
        });
        let (stars, drawn_from_lx) =
            sky_plan.as_ref().map_or((&scene.stars, faintest_lx), |sky| (&sky.others, sky.map.others_from_lx()));
        let visible = all_visible.unwrap_or_else(|| seen_from(stars, drawn_from_lx));
        // Units of light.
        let eyes_pc = distinct_eyes_pc(&viewports);
        let eyes_m: Vec<DVec3> = eyes_pc.iter().map(|eye| *eye * PARSEC_M).collect();
        let smallest_sr = viewports.iter().map(|v| v.projection.smallest_pixel_sr()).fold(f64::INFINITY, f64::min);
        let pixel_step_lx = glare.in_sums.map_or(0.0, |veil| veil.least_cd_m2 * glare.fraction * smallest_sr);
        let other = bodies.as_ref().map_or(OtherLight { pixel_step_lx, ..Default::default() }, |bodies| OtherLight {
            pixel_step_lx,
            points_lx: bodies
                .points
                .iter()
                .map(|point| eyes_m.iter().map(|eye| point.light_at_lx(*eye)).collect())
                .collect(),
            crowd_lx: asteroids.iter().flat_map(|plan| &plan.cut.points_lx).copied().fold(0.0, f64::max),
        });
        let mut ranges = range::choose(stars, &visible, &eyes_pc, drawn_from_lx, motion, &other);
        let sky_face = if let SkyUse::Face(face) = sky { Some(face) } else { None };
        // A published method draws stars alone, as it was published.
        let draws_diffuse = sky_face.is_none() && method.accumulator() == Accumulator::FixedPoint;
        let diffuse = scene.stars.unresolved.clone().filter(|_| draws_diffuse);
        let diffuse_step_cd_m2 = step_cd_m2.filter(|_| diffuse.is_some() && motion.is_none() && are_smooth(&viewports));
        if let Some(SkyFace { map, .. }) = sky_face {
            ranges.main.brightest_lx = map.below_lx;
            ranges.bright = None;
        }
        ranges.main.units_per_lx *= self.unit_factor;

        let accumulator = limits.accumulator_name(method.accumulator());
        let mut stars = plan_stars(settings, &viewports, &ranges, expected_ev100, accumulator);
        if let Some(motion) = motion {
            let of_travel = travel::certificate(&scene.stars, &visible, &motion, &settings.accuracy);
            stars.report.certificate.extend(of_travel);
        }
        stars.report.certificate.extend(sky_plan.as_ref().map(|_| of_sky_map(settings.accuracy.display_codes)));
        let of_diffuse = diffuse_step_cd_m2.map(|_| of_diffuse_points(settings.accuracy.display_codes));
        stars.report.certificate.extend(of_diffuse);
        stars.report.certificate.extend(asteroids.iter().flat_map(|plan| plan.certificate.iter().cloned()));

        let psf = self.psf.as_ref().filter(|_| method == StarMethod::PsfTexture).map(|(_, psf)| Arc::clone(psf));
        let billboards = (method.accumulator() == Accumulator::Blending).then(|| {
            let shown_ev100 = settings
                .known_white_ev100(known_ev100)
                .unwrap_or_else(|| settings.exposure.metered_ev100(mean_luminance_cd_m2(&scene.stars, camera_pc)));
            BillboardPlan::new(&settings.stars, settings.exposure.unit_ev100(), shown_ev100, psf.as_deref())
        });
        // Lines and text.
        let views: Vec<String> = rig.views().iter().map(|view| view.name.clone()).collect();
        let inputs = OverlayInputs { objects: &scene.objects, camera, viewports: &viewports, views: &views };
        let overlay = self.overlay.plan(&inputs)?;

        Ok(Plan {
            overlay,
            report: stars.report,
            kernels: stars.kernels,
            known_ev100,
            planned_ev100,
            shown_stars,
            viewports,
            all_viewports,
            batches,
            visible,
            ranges,
            total_solid_angle_sr,
            camera_pc,
            motion,
            faintest_lx,
            local_sky: objects.local_sky.clone(),
            bodies,
            asteroids,
            display_step_cd_m2: step_cd_m2,
            glare,
            billboards,
            psf,
            sky: sky_plan,
            diffuse,
            diffuse_step_cd_m2,
            sky_face,
            cull_ms,
        })
    }
}

/// In f32, as frames tell their exposure: one that has adapted to it is shown with the very same value.
fn as_told(ev100: Option<f64>) -> Option<f64> {
    ev100.map(|ev100| f64::from(ev100 as f32))
}

/// What the map of faint light costs in accuracy: weights of its kernel and of the tent lie between 0 and 1.
fn of_sky_map(display_codes: f64) -> Approximation {
    let bound = BRIGHTEST_STEPS * display_codes;
    Approximation {
        what: "a star of the map of faint light, against itself drawn alone".to_owned(),
        bound,
        unit: "codes of 8 bits".to_owned(),
        within_budget: Some(bound <= display_codes),
    }
}

/// Certificate of the light of no single star where it is read between points.
fn of_diffuse_points(display_codes: f64) -> Approximation {
    Approximation {
        what: "light of no single star, read between points where it is smooth".to_owned(),
        bound: display_codes,
        unit: "codes of 8 bits".to_owned(),
        within_budget: Some(true),
    }
}

/// Mean luminance of the whole sky of stars, cd/m^2.
fn mean_luminance_cd_m2(stars: &StarSet, camera_pc: DVec3) -> f64 {
    let light_lx: f64 = stars
        .chunks
        .iter()
        .map(|chunk| {
            let distance_pc = if chunk.at_infinity { 1.0 } else { (chunk.origin_pc - camera_pc).length() };
            chunk.total_lx / (distance_pc * distance_pc).max(1e-12)
        })
        .sum();
    light_lx / (4.0 * PI)
}

/// What the eye of each viewport has fields of asteroids as; nothing where there are none.
fn clouds_of(objects: &SceneObjects, suns: &[Sun], camera_m: DVec3, viewports: &[Viewport]) -> Vec<Vec<Cloud>> {
    if objects.fields.is_empty() {
        return Vec::new();
    }
    let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
    let mut clouds: Vec<Vec<Cloud>> = Vec::with_capacity(viewports.len());
    for (index, viewport) in viewports.iter().enumerate() {
        // Eyes at one place see the same.
        let same = viewports[..index].iter().position(|other| other.eye_offset_m == viewport.eye_offset_m);
        clouds.push(match same {
            Some(other) => clouds[other].clone(),
            None => field_clouds(&fields, camera_m + viewport.eye_offset_m, suns),
        });
    }
    clouds
}

/// The exposure that a frame will be metered at, as far as the stars' positions tell: good to a fraction of a stop.
fn expected_ev100(
    visible: &[VisibleChunk],
    bodies: Option<&BodyPlan>,
    air_lx: f64,
    total_solid_angle_sr: f64,
    settings: &ExposureSettings,
) -> Option<f64> {
    if total_solid_angle_sr <= 0.0 {
        return None;
    }
    let stars_lx: f64 = visible.iter().map(|chunk| chunk.total_lx * f64::from(chunk.viewports.count_ones())).sum();
    let light_lx = stars_lx + air_lx + bodies.map_or(0.0, BodyPlan::light_in_view_lx);
    Some(settings.metered_ev100(light_lx / total_solid_angle_sr))
}

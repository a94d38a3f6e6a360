//! Stars of a frame: the visible ones, their kernels, and the units of the sums of light.

use std::{f64::consts::PI, sync::Arc, time::Instant};

use glam::DVec3;

use super::{
    billboards::{BillboardPlan, DrawnPsf},
    cell_sky::CellSkyPlan,
    certificate::{certificate, reported_method},
    cull::{CullSettings, VisibleChunk, distinct_eyes_pc, visible_chunks},
    deep::{self, DIRECT_CELL_PX, DeepInputs, DeepPlan, Drawn, Residual, Turning},
    kernels::{GaussianWidth, KernelPlan, kernels_of},
    method::{Accumulator, StarMethod},
    range::{self, OtherLight, Ranges},
    settings::PsfTextureSettings,
    travel,
};
use crate::{
    catalogue::chunks::StarSet,
    photometry::exposure::white_luminance_cd_m2,
    plan::{
        Approximation, Limits, Plan, PlanError, SkyUse,
        budget::CODES,
        kept::Kept,
        settings::RenderSettings,
        smooth_light::{CELL_PX, SkyPart, SkyPlan},
        technique::{CheckInputs, PlanInputs, Step, Technique},
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::Rig,
};

/// Stars of a frame, and the units of all its light.
#[derive(Clone, Default)]
pub struct StarsPlan {
    /// Method.
    pub method: StarMethod,
    /// Fainter stars are not drawn, lx.
    pub faintest_lx: f64,
    /// Chunks that may be visible.
    pub visible: Vec<VisibleChunk>,
    /// Kernels of each viewport.
    pub kernels: Vec<KernelPlan>,
    /// Units of the sums of light, for stars and everything that is added to them.
    pub ranges: Ranges,
    /// Parameters of methods that blend; `None` for the others.
    pub billboards: Option<BillboardPlan>,
    /// Point-spread function of `psf_texture`.
    pub psf: Option<Arc<DrawnPsf>>,
    /// Stars of a deep store.
    pub deep: DeepPlan,
    /// Parameters of `cell_sky`; `None` for the other methods.
    pub cell_sky: Option<CellSkyPlan>,
    /// Time that culling took, ms.
    pub cull_ms: f64,
}

/// Plans [`StarsPlan`], and keeps the point-spread function of the last settings and the rotation of the views.
#[derive(Default)]
pub(in crate::plan) struct Stars {
    psf: Option<(PsfTextureSettings, Arc<DrawnPsf>)>,
    turning: Turning,
}

impl Stars {
    pub(in crate::plan) fn cull_settings(inputs: &PlanInputs<'_>, plan: &Plan, faintest_lx: f64) -> CullSettings {
        CullSettings {
            faintest_lx,
            enabled: inputs.culling,
            motion: plan.views.motion,
            refraction: inputs.objects.local_sky.as_ref().and_then(|sky| sky.refraction),
            margin_px: inputs.margin_px,
        }
    }

    /// Selects the visible chunks of a set of stars, and adds the time to the plan.
    fn cull(inputs: &PlanInputs<'_>, plan: &mut Plan, stars: &StarSet, faintest_lx: f64) -> Vec<VisibleChunk> {
        let cull = Self::cull_settings(inputs, plan, faintest_lx);
        let start = Instant::now();
        let visible = match inputs.methods.stars.reads_visible() {
            true => visible_chunks(stars, plan.views.camera_pc, &plan.views.viewports, cull),
            false => Vec::new(),
        };
        plan.stars.cull_ms += start.elapsed().as_secs_f64() * 1e3;
        visible
    }

    /// Selects the pages of the scene's deep store, and requests those that turning views will need next. Returns false if the frame would read a map
    /// of faint light that is not worth its cost.
    fn select_deep(&mut self, inputs: &PlanInputs<'_>, plan: &mut Plan) -> Result<bool, PlanError> {
        let Some(sky) = inputs.scene.stars.deep.as_ref() else { return Ok(true) };
        let start = Instant::now();
        let settings = &inputs.settings.stars;
        let map = plan.smooth_light.map.as_ref().map(|sky| sky.map);
        let part = if let SkyUse::Part(part) = inputs.sky { Some(part.map) } else { None };
        let drawn = match (map, part) {
            (Some(map), _) => Drawn::Brighter { from_lx: map.below_lx },
            (None, Some(map)) => Drawn::Fainter { below_lx: map.below_lx },
            (None, None) => Drawn::All { seen_cd_m2: plan.display.seen_cd_m2 },
        };
        let deep = DeepInputs {
            sky,
            camera_pc: plan.views.camera_pc,
            viewports: &plan.views.viewports,
            cull: Self::cull_settings(inputs, plan, plan.stars.faintest_lx),
            cell_px: part.map_or(DIRECT_CELL_PX, |map| map.cell_texels()),
            drawn,
            magnitude_limit: settings.magnitude_limit,
            every_star: settings.every_star,
            skip_damaged: settings.skip_damaged,
            asks: inputs.asks_for_pages,
            // A frame that reads stars while it is drawn cannot replace a damaged page.
            streams: inputs.streams_stars && !settings.skip_damaged,
            memory_bytes: settings.memory.bytes,
        };
        let white_cd_m2 = plan.exposure.expected_ev100.map_or(f64::INFINITY, white_luminance_cd_m2);
        let codes_per_cd_m2 = CODES * inputs.settings.tone_map.greatest_slope() / white_cd_m2;
        plan.stars.deep = DeepPlan { codes_per_cd_m2, ..deep::select(&deep)? };
        if let Some(sky) = &plan.smooth_light.map {
            let without = DeepInputs { drawn: Drawn::All { seen_cd_m2: plan.display.seen_cd_m2 }, ..deep };
            if !sky.pays_at_once() && !deep::has_stars(&without, plan.stars.deep.stars + sky.least_saved()) {
                return Ok(false);
            }
        }
        if part.is_none()
            && inputs.asks_for_pages
            && let Some(turned) = self.turning.ahead(deep.viewports, start)
        {
            // Stars that come into view are drawn in the map, so request pages for the map.
            let ahead = map.map_or(deep, |map| DeepInputs {
                drawn: Drawn::Fainter { below_lx: map.below_lx },
                cell_px: CELL_PX,
                ..deep
            });
            deep::ask_ahead(&ahead, &turned, &plan.stars.deep);
        }
        plan.stars.cull_ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(true)
    }

    /// Reports the cell size of composite stars and the missing stars of a deep store.
    fn report_deep(inputs: &PlanInputs<'_>, plan: &mut Plan) {
        let deep = &plan.stars.deep;
        if deep.sky.is_none() {
            return;
        }
        let name = "size of the cells whose stars are drawn as composite stars, the root of the area";
        let most_px = if let SkyUse::Part(part) = inputs.sky { part.map.cell_texels() } else { DIRECT_CELL_PX };
        plan.report.certificate.push(Approximation::new(name, deep.cell_px, "px", Some(most_px)));
        plan.state_missing_stars(Residual::default());
    }

    /// Chooses the units of the sums of light for the visible stars, for points of light, and for the veil that is added to the sums.
    fn ranges(inputs: &PlanInputs<'_>, plan: &Plan, stars: &StarSet, faintest_lx: f64) -> Ranges {
        let eyes_pc = distinct_eyes_pc(&plan.views.viewports);
        let eyes_m: Vec<DVec3> = eyes_pc.iter().map(|eye| *eye * PARSEC_M).collect();
        let glare = &plan.glare;
        let pixel_step_lx =
            glare.in_sums.map_or(0.0, |veil| veil.least_cd_m2 * glare.fraction * plan.views.smallest_pixel_sr());
        // Light besides stars.
        let other =
            plan.bodies.as_ref().map_or(OtherLight { pixel_step_lx, ..Default::default() }, |bodies| OtherLight {
                pixel_step_lx,
                points_lx: bodies
                    .points
                    .iter()
                    .map(|point| eyes_m.iter().map(|eye| point.light_at_lx(*eye)).collect())
                    .collect(),
                crowd_lx: plan.asteroids.iter().flat_map(|plan| &plan.cut.points_lx).copied().fold(0.0, f64::max),
                ..Default::default()
            });
        let deep = &plan.stars.deep;
        let crowd_lx = other.crowd_lx + deep.total_lx;
        let mut other =
            OtherLight { crowd_lx, faintest_lx: deep.faintest_lx.max(faintest_lx), many: deep.stars, ..other };
        if let Some(SkyPlan { map, caps: Some(caps), .. }) = &plan.smooth_light.map {
            let limits_lx = [plan.stars.faintest_lx, map.below_lx];
            other.add_crowd(&inputs.scene.stars, &caps.visible, &eyes_pc, limits_lx);
        }
        let mut ranges = range::choose(stars, &plan.stars.visible, &eyes_pc, faintest_lx, plan.views.motion, &other);
        if let SkyUse::Part(SkyPart { map, .. }) = inputs.sky {
            ranges.main.brightest_lx = map.below_lx;
            ranges.bright = None;
        }
        ranges.main.units_per_lx *= inputs.unit_factor;
        ranges
    }

    /// Plans the light of the stars: all of them, or those that are not part of the map of faint light.
    fn plan_light(&mut self, inputs: &PlanInputs<'_>, plan: &mut Plan) -> Result<(), PlanError> {
        let PlanInputs { settings, methods, scene, limits, .. } = *inputs;
        let is_selected = match self.select_deep(inputs, plan) {
            // The stars that are not in the map do not fit into memory: draw without the map, since composite stars may fit.
            Err(PlanError::DeepMemory { .. }) if plan.smooth_light.map.is_some() => false,
            selected => selected?,
        };
        if !is_selected {
            plan.smooth_light.map = None;
            self.select_deep(inputs, plan)?;
        }
        // Select the visible stars. Without a known exposure they were already selected, to estimate the exposure.
        let others = plan.smooth_light.map.as_ref().map(|sky| (Arc::clone(&sky.others), sky.map.others_from_lx()));
        let (stars, drawn_from_lx) = others.unwrap_or_else(|| (Arc::clone(&scene.stars), plan.stars.faintest_lx));
        if plan.exposure.known_white_ev100.is_some() {
            plan.stars.visible = Self::cull(inputs, plan, &stars, drawn_from_lx);
        }
        // Units, kernels and the certificate.
        plan.stars.ranges = Self::ranges(inputs, plan, &stars, drawn_from_lx);
        let viewports = &plan.views.viewports;
        let kernels = viewports.iter().map(|viewport| kernels_of(settings, viewport, plan.exposure.expected_ev100));
        plan.stars.kernels = kernels.collect();
        plan.report.stars = reported_method(methods.stars, viewports, &plan.stars.kernels);
        plan.report.accumulator = limits.accumulator_name(methods.stars.accumulator()).to_owned();
        plan.report.certificate.extend(certificate(settings, viewports, &plan.stars.ranges));
        // Parameters of published methods.
        let uses_psf = methods.stars == StarMethod::PsfTexture;
        plan.stars.psf = self.psf.as_ref().filter(|_| uses_psf).map(|(_, psf)| Arc::clone(psf));
        plan.stars.billboards = (methods.stars.accumulator() == Accumulator::Blending).then(|| {
            let white_ev100 = plan.exposure.known_white_ev100.unwrap_or_else(|| {
                settings.exposure.metered_ev100(mean_luminance_cd_m2(&scene.stars, plan.views.camera_pc))
            });
            BillboardPlan::new(&settings.stars, settings.exposure.unit_ev100(), white_ev100, plan.stars.psf.as_deref())
        });
        let is_procedural = methods.stars == StarMethod::CellSky;
        plan.stars.cell_sky =
            is_procedural.then(|| CellSkyPlan::new(&settings.stars.cell_sky, settings.exposure.unit_ev100()));
        Ok(())
    }
}

impl Technique for Stars {
    fn check_rig(&self, rig: &Rig, settings: &RenderSettings, limits: &Limits) -> Result<(), PlanError> {
        let method = settings.stars.method;
        if method.accumulator() == Accumulator::Blending {
            limits.check_blended(rig)?;
        }
        if method == StarMethod::PixelGaussian {
            let width = GaussianWidth::new(&settings.stars.pixel_gaussian);
            Limits::check_round_kernels(rig, method.name(), |projection| width.reach_px(projection))?;
        }
        Ok(())
    }

    fn check(&mut self, inputs: &CheckInputs<'_>, _kept: &mut Kept) -> Result<(), PlanError> {
        if inputs.scene.stars.deep.is_some() {
            let method = inputs.methods.stars;
            if method.accumulator() != Accumulator::FixedPoint {
                return Err(PlanError::DeepMethod(method.name()));
            }
            if inputs.scene.camera.velocity_c != DVec3::ZERO {
                return Err(PlanError::DeepAtRest);
            }
        }
        let texture = &inputs.settings.stars.psf_texture;
        // A file is not read again if only its content changes.
        let is_held = self.psf.as_ref().is_some_and(|(held, _)| held == texture);
        if inputs.methods.stars == StarMethod::PsfTexture && !is_held {
            let psf = DrawnPsf::new(&texture.texture()?);
            self.psf = Some((texture.clone(), Arc::new(psf)));
        }
        Ok(())
    }

    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Objects => {
                plan.stars.method = inputs.methods.stars;
                plan.stars.faintest_lx = illuminance_lx_from_magnitude(inputs.settings.stars.magnitude_limit);
            }
            Step::Exposure if plan.exposure.known_white_ev100.is_none() => {
                let faintest_lx = plan.stars.faintest_lx;
                plan.stars.visible = Self::cull(inputs, plan, &inputs.scene.stars, faintest_lx);
            }
            Step::Light => self.plan_light(inputs, plan)?,
            Step::Report => {
                Self::report_deep(inputs, plan);
                if let Some(motion) = plan.views.motion {
                    let (stars, accuracy) = (&inputs.scene.stars, &inputs.settings.accuracy);
                    let of_motion = travel::certificate(stars, &plan.stars.visible, &motion, accuracy);
                    plan.report.certificate.extend(of_motion);
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Approximation of a frame whose stars have not all been read.
const MISSING_STARS: &str = "stars of the deep store that have not been read, in a pixel";

impl Plan {
    /// Reports the missing stars of a deep store: in the frame, and in the map of faint light that it reads.
    pub(crate) fn state_missing_stars(&mut self, of_map: Residual) {
        self.stars.deep.residual.add(of_map);
        let report = self.stars.deep.report();
        if report.missing > 0 {
            self.report.certificate.retain(|approximation| approximation.name != MISSING_STARS);
            let missing = Approximation::new(MISSING_STARS, report.residual_codes, "codes of 8 bits", Some(0.0));
            self.report.certificate.push(missing);
        }
        self.report.deep = Some(report);
    }
}

/// Mean luminance of all stars over the whole sky, cd/m^2.
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

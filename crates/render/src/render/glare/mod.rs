//! Glare: when the pictures of all batches are complete, scattered light is added to their pixels, either from a map of the whole sky and its
//! brightest sources (`sky_cube`) or from a pyramid of blurred pictures as published (`pyramid`).

mod composite;
pub(crate) mod layout;
mod pyramid;
mod sky_cube;

use self::{pyramid::GlarePyramid, sky_cube::SkyCube};
use super::{
    targets::Targets,
    technique::{FrameInputs, Holding, Phase, PipelineJob, Recording, Technique, Wish},
};
use crate::{
    gpu::Gpu,
    plan::{glare::pyramid::PyramidAxes, settings::GlareMethod},
};

/// Lazily created passes and buffers of both kinds of glare.
pub(super) struct Glare {
    sky_cube: SkyCube,
    pyramid: GlarePyramid,
}

impl Glare {
    pub(super) fn new() -> Self {
        Self { sky_cube: SkyCube::new(), pyramid: GlarePyramid::new() }
    }
}

impl Technique for Glare {
    fn warm(&mut self, holding: &Holding<'_>) {
        if holding.methods.glare == GlareMethod::SkyCube {
            self.sky_cube.hold_map(holding);
        }
    }

    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let method = wish.forecast.methods.glare;
        match PyramidAxes::for_method(method) {
            _ if method == GlareMethod::SkyCube => self.sky_cube.pipelines(wish),
            Some(axes) => self.pyramid.pipelines(wish, axes),
            None => Vec::new(),
        }
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        // A frame that reads a map of faint light needs the stored data; the pictures of the map have no glare.
        if frame.plan.smooth_light.part.is_some() {
            return;
        }
        let method = frame.plan.glare.method;
        if method != GlareMethod::SkyCube {
            self.sky_cube.release_series(frame.series);
        } else {
            self.sky_cube.keep(frame.series);
        }
        if PyramidAxes::for_method(method).is_none() {
            self.pyramid.release();
        }
        if frame.plan.glare.in_sums.is_some() {
            SkyCube::reserve_grids(gpu, frame, targets);
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        match (phase, recording.frame.plan.glare.in_sums) {
            (Phase::Points, Some(_)) => return self.sky_cube.record_points(recording),
            (Phase::Splat(batch), Some(_)) => return self.sky_cube.record_in_sums(recording, batch),
            (Phase::Glare, None) => {}
            _ => return,
        }
        let method = recording.frame.plan.glare.method;
        if method == GlareMethod::SkyCube {
            self.sky_cube.record(recording);
        } else if let Some(axes) = PyramidAxes::for_method(method) {
            self.pyramid.record(recording, axes);
        }
    }

    fn release(&mut self) {
        self.sky_cube.release();
        self.pyramid.release();
    }
}

//! Meters of their own: where the exposure of a frame is not that of its own views, a picture that nobody sees is drawn and metered before it.
//!
//! With `spot` that is a small round picture of the cone, with `mean` all views of the frame's group of views, of which the frame draws some. The
//! meter's picture has targets and maps of its own, so frames and meters disturb each other in nothing. What it finds is copied into the
//! frame on the device; where the frame's exposure follows from it at once, because there is none to adapt from, it is waited for. An
//! exposure that follows from the plan is found on the CPU.

use std::mem;

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    submit::FrameSlot,
    targets::Targets,
    technique::{FrameInputs, Outputs, Series},
};
use crate::{
    plan::{
        ExposureSource, Output, PlanError, PlanOutputs, Planner,
        settings::{Metering, RenderSettings},
        view_settings::{meter_settings, spot_rig},
    },
    scene::SceneSnapshot,
    view::Rig,
};

/// What meters draw into; made when the first one is needed.
#[derive(Default)]
pub(super) struct Meter {
    targets: Option<Targets>,
    slot: Option<FrameSlot>,
}

/// Where the exposure of a frame comes from.
pub(super) struct Metered {
    pub exposure: ExposureSource,
    /// The exposure to show it with, where that is known.
    pub adapted_ev100: Option<f64>,
    /// What the meter has found, for the device.
    pub buffer: Option<wgpu::Buffer>,
}

impl Renderer {
    /// Makes room for the series that a frame belongs to. Every other one is that of meters.
    pub(super) fn keep_series(&mut self, request: &FrameRequest<'_>) -> Series {
        let [number, of] = request.series;
        self.planners.resize_with(2 * of, Planner::new);
        for planner in &mut self.planners {
            (planner.culling, planner.unit_factor) = (self.culling, self.unit_factor);
        }
        Series { slot: 2 * number, slots: 2 * of }
    }

    /// Finds the exposure of a frame, as far as its own plan does not.
    pub(super) fn meter_for(&mut self, request: &FrameRequest<'_>, series: Series) -> Result<Metered, RenderError> {
        let FrameRequest { scene, adapted_ev100, .. } = *request;
        let (rig, settings) = request.exposed_as.unwrap_or((request.rig, request.settings));
        let exposure = &settings.exposure;
        let of_others = request.exposed_as.is_some();
        let of_meter = Series { slot: series.slot + 1, ..series };
        if of_others && exposure.goes_by(Metering::LimitingMagnitude) {
            let planner = &mut self.planners[of_meter.slot];
            let planned = planner.exposure(scene, rig, settings, &self.limits)?;
            let source = planned.map_or(ExposureSource::Own, ExposureSource::Planned);
            return Ok(Metered { exposure: source, adapted_ev100, buffer: None });
        }
        let spot = match exposure.goes_by(Metering::Spot) {
            true => spot_rig(rig, exposure).map_err(PlanError::from)?,
            false => None,
        };
        let metered = match &spot {
            Some(spot) => Some(spot),
            None => Some(rig).filter(|_| of_others && exposure.goes_by(Metering::Mean)),
        };
        let Some(metered) = metered else {
            return Ok(Metered { exposure: ExposureSource::Own, adapted_ev100, buffer: None });
        };
        let settings = meter_settings(settings);
        let (buffer, adapted_ev100) = self.draw_meter(scene, metered, &settings, adapted_ev100, of_meter)?;
        Ok(Metered { exposure: ExposureSource::Meter, adapted_ev100: Some(adapted_ev100), buffer: Some(buffer) })
    }

    /// Draws and meters a picture; returns what was found, for the device, and the exposure of the frame that it is for: the given one, or what
    /// was found.
    fn draw_meter(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
        series: Series,
    ) -> Result<(wgpu::Buffer, f64), RenderError> {
        let outputs = PlanOutputs::new(Output::Hdr);
        let planner = &mut self.planners[series.slot];
        let mut plan = planner.plan(scene, rig, settings, adapted_ev100, outputs, &self.limits)?;
        plan.overlay = None;
        // Pipelines that read tables draw pictures without any too: a meter of such a rig need not exchange them.
        if self.tables.needed(&self.gpu, &plan.viewports) > 0 || self.gpu.table_buffers() == 0 {
            self.hold_tables(&plan.viewports)?;
        }
        self.hold_scene(series.slot, scene, settings)?;
        let wanted = vec![Wanted::default(); rig.views().len()];
        let inputs = FrameInputs {
            plan: &plan,
            scene,
            settings,
            outputs: Outputs { wanted: &wanted, presentations: &[] },
            catalogue_order: self.catalogue_order,
            series,
            metered: None,
        };
        let mut slot = self.meter.slot.take().unwrap_or_else(|| FrameSlot::new(&self.gpu));
        let targets = self.meter.targets.take().unwrap_or_else(|| Targets::new(&self.gpu));
        let of_frames = mem::replace(&mut self.targets, targets);
        let (commands, places) = self.record(&inputs, wanted.len(), &mut slot);
        let targets = mem::replace(&mut self.targets, of_frames);
        let found = targets.exposure.clone();
        self.meter.targets = Some(targets);
        let submission = self.gpu.queue.submit([commands]);
        let ev100 = match adapted_ev100 {
            Some(ev100) => ev100,
            None => {
                slot.readback.map(&self.gpu);
                self.forget_what_failed()?;
                self.gpu.wait(Some(submission))?;
                let ev100 = places.metered_ev100(&self.gpu, &mut slot.readback)?;
                slot.readback.unmap(&self.gpu);
                ev100
            }
        };
        self.meter.slot = Some(slot);
        self.forget_what_failed()?;
        Ok((found, ev100))
    }
}

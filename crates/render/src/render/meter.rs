//! Separate meters. If the exposure of a frame is not based on its own views, another picture is drawn and metered first.
//!
//! With `spot`, that picture is a small round picture of the metered cone. With `mean`, it consists of all views of the
//! frame's exposure group, of which the frame draws only some. The meter has its own targets and maps, so meters and
//! frames do not disturb each other. The result is copied into the frame on the device. The CPU waits for it only if
//! the frame's exposure is the metered one, because there is no previous exposure to adapt from. An exposure that
//! follows from the plan is computed on the CPU.

use std::mem;

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    submit::FrameSlot,
    targets::Targets,
    technique::{FrameInputs, Outputs, Series},
};
use crate::plan::tables::TableForm;
use crate::{
    plan::{ExposureSource, Output, PlanOutputs, Planner, exposure::origin::ExposureOrigin, settings::RenderSettings},
    scene::SceneSnapshot,
    view::Rig,
};

/// Number of planners of a series, and the indices of two of them: the planner for meters, and the planner for HDR images within a budget.
const SLOTS: usize = 3;
const METER_SLOT: usize = 1;
const HDR_STREAM_SLOT: usize = 2;

/// Buffers of meters, created by the first frame that needs them.
#[derive(Default)]
pub(super) struct MeterTargets {
    targets: Option<Targets>,
    slot: Option<FrameSlot>,
}

/// Exposure of a frame.
pub(super) struct Metered {
    pub exposure: ExposureSource,
    /// Exposure with which the frame is displayed, if it is known.
    pub adapted_ev100: Option<f64>,
    /// Result of the meter, on the device.
    pub buffer: Option<wgpu::Buffer>,
}

impl Renderer {
    /// Ensures that the series of a frame has planners. Each series has a second one for its meters, and a third one for HDR images within a budget,
    /// which are drawn in turn with display images and have other maps.
    pub(super) fn keep_series(&mut self, request: &FrameRequest<'_>) -> Series {
        let [number, count] = request.series;
        self.planners.resize_with(SLOTS * count, Planner::new);
        for planner in &mut self.planners {
            (planner.culling, planner.unit_factor) = (self.culling, self.unit_factor);
        }
        let own = if request.output() == Output::HdrStream { HDR_STREAM_SLOT } else { 0 };
        Series { slot: SLOTS * number + own, slots: SLOTS * count }
    }

    /// Determines the exposure of a frame if its own plan does not.
    pub(super) fn meter_for(&mut self, request: &FrameRequest<'_>, series: Series) -> Result<Metered, RenderError> {
        let FrameRequest { scene, adapted_ev100, .. } = *request;
        let (rig, settings) = request.exposed_as.unwrap_or((request.rig, request.settings));
        let meter_series = Series { slot: series.slot / SLOTS * SLOTS + METER_SLOT, ..series };
        match ExposureOrigin::new(rig, settings, request.exposed_as.is_some())? {
            ExposureOrigin::Own => Ok(Metered { exposure: ExposureSource::Own, adapted_ev100, buffer: None }),
            ExposureOrigin::Plan => {
                let planner = &mut self.planners[meter_series.slot];
                let planned = planner.exposure(scene, rig, settings, &self.limits)?;
                let source = planned.map_or(ExposureSource::Own, ExposureSource::Planned);
                Ok(Metered { exposure: source, adapted_ev100, buffer: None })
            }
            ExposureOrigin::Picture { rig, settings } => {
                let (buffer, adapted_ev100) = self.draw_meter(scene, &rig, &settings, adapted_ev100, meter_series)?;
                let adapted_ev100 = Some(adapted_ev100);
                Ok(Metered { exposure: ExposureSource::Meter, adapted_ev100, buffer: Some(buffer) })
            }
        }
    }

    /// Draws and meters a picture. Returns the result on the device, and the exposure of the frame to be drawn:
    /// `adapted_ev100`, or else the metered exposure.
    fn draw_meter(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
        series: Series,
    ) -> Result<(wgpu::Buffer, f64), RenderError> {
        // Plan the picture.
        let outputs = PlanOutputs::new(Output::Hdr);
        let planner = &mut self.planners[series.slot];
        let mut plan = planner.plan(scene, rig, settings, adapted_ev100, outputs, &self.limits)?;
        plan.overlay = None;
        // Pipelines that read tables can also draw pictures without tables, so the current pipelines are kept for a meter without tabulated pictures.
        let needed = self.tables.needed(&self.gpu, &plan.views.viewports);
        if needed != TableForm::None || self.gpu.table_form() == TableForm::None {
            self.hold_tables(&plan.views.viewports)?;
        }
        self.hold_scene(series.slot, scene, settings)?;
        let wanted = vec![Wanted::default(); rig.views().len()];
        let inputs = FrameInputs {
            plan: &plan,
            scene,
            outputs: Outputs { wanted: &wanted, presentations: &[] },
            catalogue_order: self.catalogue_order,
            series,
            metered: None,
        };
        // Record and submit with the meter's own targets.
        let mut slot = self.meter.slot.take().unwrap_or_else(|| FrameSlot::new(&self.gpu));
        let targets = self.meter.targets.take().unwrap_or_else(|| Targets::new(&self.gpu));
        let frame_targets = mem::replace(&mut self.targets, targets);
        let (commands, places) = self.record(&inputs, wanted.len(), &mut slot);
        let targets = mem::replace(&mut self.targets, frame_targets);
        let found = targets.exposure.clone();
        self.meter.targets = Some(targets);
        let submission = self.gpu.queue.submit([commands]);
        // Wait for the exposure only if the frame needs it at once.
        let ev100 = match adapted_ev100 {
            Some(ev100) => ev100,
            None => {
                slot.readback.map(&self.gpu);
                self.check_driver_errors()?;
                self.gpu.wait(Some(submission))?;
                let ev100 = places.metered_ev100(&self.gpu, &mut slot.readback)?;
                slot.readback.unmap(&self.gpu);
                ev100
            }
        };
        self.meter.slot = Some(slot);
        self.check_driver_errors()?;
        Ok((found, ev100))
    }
}

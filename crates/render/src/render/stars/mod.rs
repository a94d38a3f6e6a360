//! Stars. The default method splats the result of culling in fixed point (`splat`). The published methods output luminance, most of them from all
//! stars in the order of the catalogue (`packed`, `billboards`, `cell_sky`); a separate resolve pass writes it to the buffers that the other passes
//! read (`luminance`).

mod billboards;
mod buffers;
mod catalogue_buffers;
mod cell_sky;
mod items;
pub(crate) mod layout;
pub(crate) mod luminance;
mod packed;
mod pages;
mod splat;
mod streamed;

use self::{
    billboards::Billboards,
    buffers::StarBuffers,
    catalogue_buffers::CatalogueBuffers,
    cell_sky::CellSky,
    items::{ItemBuffers, ItemRun, ItemSource, Items, StarDraw, StarKind, push_chunks, push_pages},
    packed::{Packed, PackedFrame},
    pages::PageBuffers,
    splat::{StarForm, StarPass},
    streamed::StreamedPages,
};
use super::{
    RenderError, ViewStatistics,
    read::Places,
    targets::Targets,
    technique::{FrameInputs, Holding, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::{
    gpu::{Gpu, ReadbackBuffer},
    plan::{Plan, settings::Accumulator, smooth_light::SkyPlan},
};

/// Passes and buffers of all methods. Those of the published methods are created at first use.
pub(super) struct Stars {
    splat: StarPass,
    packed: Packed,
    billboards: Billboards,
    cell_sky: CellSky,
    /// All stars, the input of culling.
    held: Option<StarBuffers>,
    /// Stars that are not part of the map of faint light, if the frame reads one.
    beside_map: Option<StarBuffers>,
    /// All stars in the order of a catalogue.
    catalogue: Option<CatalogueBuffers>,
    /// Pages of a deep store.
    pages: PageBuffers,
    item_buffers: ItemBuffers,
    /// Stars that are read while the frame is drawn.
    streamed: StreamedPages,
    /// Item runs of the frame being recorded.
    runs: Vec<ItemRun>,
    /// Whether that frame reads a map of faint light.
    reads_map: bool,
}

impl Stars {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self {
            splat: StarPass::new(gpu),
            packed: Packed::new(),
            billboards: Billboards::new(),
            cell_sky: CellSky::new(),
            held: None,
            beside_map: None,
            catalogue: None,
            pages: PageBuffers::default(),
            item_buffers: ItemBuffers::new(),
            streamed: StreamedPages::new(),
            runs: Vec::new(),
            reads_map: false,
        }
    }

    /// Returns the star buffers to which the items of a run refer.
    fn drawn(&self, kind: StarKind) -> Option<&StarBuffers> {
        let is_beside_map = self.reads_map && kind != StarKind::Caps;
        if is_beside_map { self.beside_map.as_ref() } else { self.held.as_ref() }
    }

    /// Draws of a batch: the runs of items left by culling.
    fn draws(&self, batch: usize) -> Vec<StarDraw<'_>> {
        let (Some(items), Some(near)) = (self.item_buffers.items.held(), self.item_buffers.near.held()) else {
            return Vec::new();
        };
        let runs = self.runs.iter().filter(|run| run.batch == batch);
        let draw = |run: &ItemRun| {
            let stars = match (run.source, run.kind) {
                (ItemSource::Near, _) => near,
                (ItemSource::Segment(segment), StarKind::Pages) => self.pages.buffer(segment),
                (ItemSource::Segment(segment), kind) => self.drawn(kind).map_or(near, |stars| stars.buffer(segment)),
            };
            run.draw(stars, items)
        };
        runs.map(draw).collect()
    }

    fn splat(&mut self, recording: &mut Recording<'_>, batch: usize) {
        let frame = recording.frame;
        let gpu = recording.gpu;
        match frame.plan.stars.method.accumulator() {
            Accumulator::FixedPoint => {
                let ranges = [(Some(frame.plan.stars.ranges.main), false), (frame.plan.stars.ranges.bright, true)];
                for (range, bright) in ranges {
                    let (Some(range), Some(sums)) = (range, recording.targets.sums(batch, bright)) else { continue };
                    let mut pass = begin_pass(recording.encoder, recording.timer, "stars");
                    self.splat.record(gpu, &mut pass, (&range, bright), frame.plan, &sums, &self.draws(batch));
                }
                self.streamed.record(recording, batch, &self.splat);
            }
            Accumulator::PackedCompareExchange => {
                let words = self.packed.clear_words(gpu, recording.encoder, frame.plan.views.batches[batch].pixels);
                let drawn = PackedFrame {
                    camera_pc: frame.plan.views.camera_pc.as_vec3().to_array(),
                    faintest_lx: frame.plan.stars.faintest_lx,
                    tiles: frame.plan.views.batches[batch].tiles.len() as u32,
                    visible: &self.draws(batch),
                    catalogue: self.catalogue.as_ref().filter(|_| frame.plan.stars.method.reads_catalogue()),
                };
                let mut pass = begin_pass(recording.encoder, recording.timer, "stars");
                self.packed.record(gpu, &mut pass, &drawn, &words, recording.targets, batch);
                drop(pass);
                let mut pass = begin_pass(recording.encoder, recording.timer, "resolve");
                let (picture, grid) = (recording.targets.picture(batch), recording.targets.batches[batch].grid);
                self.packed.resolve(gpu, &mut pass, &words, self.splat.colours(), &picture, grid);
            }
            Accumulator::Blending => {
                let catalogue = self.catalogue.as_ref();
                self.billboards.record_batch(recording, batch, catalogue, self.splat.colours());
            }
            Accumulator::PerPixel => self.cell_sky.record_batch(recording, batch),
        }
    }
}

impl Technique for Stars {
    fn hold(&mut self, holding: &Holding<'_>) -> Result<(), RenderError> {
        let Holding { gpu, scene, methods, catalogue_order: order, .. } = *holding;
        let (method, set) = (methods.stars, &scene.stars);
        if method.reads_catalogue() && self.catalogue.as_ref().is_none_or(|catalogue| !catalogue.holds(set, order)) {
            // Drop the old buffers before the new ones are made, so that both never exist at once.
            self.catalogue = None;
            self.catalogue = Some(CatalogueBuffers::new(gpu, set.clone(), order));
        }
        if method.reads_visible() && self.held.as_ref().is_none_or(|stars| !stars.holds(set)) {
            self.held = None;
            self.beside_map = None;
            self.held = Some(StarBuffers::new(gpu, set.clone()));
        }
        Ok(())
    }

    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let (gpu, method) = (wish.gpu, wish.forecast.methods.stars);
        let has_geometry = !wish.objects.is_empty();
        match method.accumulator() {
            Accumulator::FixedPoint if !method.draws_catalogue() => Vec::new(),
            Accumulator::FixedPoint => {
                let has_round_kernel = method.has_round_kernel();
                let form =
                    StarForm { has_round_kernel, has_geometry, has_air: wish.objects.has_air(), from_pages: false };
                vec![PipelineJob::new("stars", move || self.splat.pipeline(gpu, form))]
            }
            Accumulator::PackedCompareExchange => {
                vec![PipelineJob::new("stars", move || self.packed.prepare(gpu, method.reads_catalogue()))]
            }
            Accumulator::Blending => self.billboards.pipelines(wish, method),
            Accumulator::PerPixel => vec![PipelineJob::new("stars", move || {
                self.cell_sky.pass(gpu);
            })],
        }
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, _targets: &mut Targets) {
        let method = frame.plan.stars.method;
        self.reads_map = frame.plan.smooth_light.map.is_some();
        self.streamed.begin();
        if let Some(SkyPlan { others, .. }) = &frame.plan.smooth_light.map
            && self.beside_map.as_ref().is_none_or(|stars| !stars.holds(others))
        {
            self.beside_map = None;
            self.beside_map = Some(StarBuffers::new(gpu, others.clone()));
        }
        let mut items = Items::default();
        let caps = frame.plan.smooth_light.map.as_ref().and_then(|sky| sky.caps.as_ref());
        let of_caps = caps.map_or(&[][..], |caps| &caps.visible);
        for (kind, visible) in [(StarKind::Chunks, &*frame.plan.stars.visible), (StarKind::Caps, of_caps)] {
            if let Some(buffers) = self.drawn(kind).filter(|_| method.reads_visible()) {
                let batches = &frame.plan.views.batches;
                push_chunks(&mut items, kind, buffers, visible, batches, frame.catalogue_order);
            }
        }
        let deep = &frame.plan.stars.deep;
        let places = self.pages.hold(gpu, deep);
        push_pages(&mut items, &deep.visible, &places, self.pages.segments(), &frame.plan.views.batches);
        self.item_buffers.items.upload(gpu, &items.items);
        self.item_buffers.near.upload(gpu, &items.near);
        self.runs = items.runs;
        if frame.plan.stars.billboards.is_some() {
            self.billboards.begin(gpu, method, frame.plan.stars.psf.as_ref());
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        match phase {
            Phase::Splat(batch) => self.splat(recording, batch),
            Phase::Count => {
                if let (Some(plan), Some(catalogue)) = (&recording.frame.plan.stars.billboards, &self.catalogue) {
                    self.billboards.record_count(recording, plan, catalogue);
                }
            }
            _ => {}
        }
    }

    fn read(
        &self,
        _gpu: &Gpu,
        _readback: &mut ReadbackBuffer,
        _places: &Places,
        _plan: &Plan,
        _views: &mut [ViewStatistics],
    ) -> Result<(), RenderError> {
        self.streamed.result()
    }

    fn release(&mut self) {
        self.held = None;
        self.beside_map = None;
        self.catalogue = None;
        self.pages = PageBuffers::default();
        self.item_buffers = ItemBuffers::new();
        self.streamed = StreamedPages::new();
        self.runs.clear();
        self.packed.release();
        self.billboards.release();
    }
}

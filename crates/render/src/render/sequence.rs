//! Order of a frame: the techniques, and the phases in which they record.

use super::{
    air::Air,
    asteroids::{Asteroids, impostors::atlas::BakedImpostors},
    bodies::Bodies,
    diffuse::Diffuse,
    display::Display,
    glare::Glare,
    overlay::Overlay,
    plain_blocks::PlainBlocks,
    smooth_light::SmoothLight,
    stars::Stars,
    technique::{Phase, Recording, Technique},
};
use crate::{gpu::Gpu, plan::Plan};

/// Creates all techniques. Within a phase they record in this order.
pub(super) fn techniques(gpu: &Gpu, baked: &BakedImpostors) -> Vec<Box<dyn Technique + Send>> {
    vec![
        Box::new(Asteroids::new(baked.clone())),
        Box::new(Bodies::new(gpu)),
        Box::new(Air::new(gpu)),
        Box::new(Diffuse::new()),
        Box::new(Stars::new(gpu)),
        Box::new(Glare::new()),
        Box::new(PlainBlocks::new()),
        Box::new(Display::new(gpu)),
        Box::new(SmoothLight::new()),
        Box::new(Overlay::new()),
    ]
}

/// Returns the phases of a frame in order: visible objects and smooth light, then surfaces tile by tile, then light batch by batch, then the rest for
/// all batches at once.
fn phases(plan: &Plan) -> Vec<Phase> {
    let mut phases = vec![Phase::Cull, Phase::Points];
    for (number, batch) in plan.views.batches.iter().enumerate() {
        phases.extend((0..batch.tiles.len()).map(|tile| Phase::Geometry(number, tile)));
    }
    for batch in 0..plan.views.batches.len() {
        phases.extend([Phase::Splat(batch), Phase::Resolve(batch)]);
    }
    phases.extend([Phase::Glare, Phase::Meter, Phase::Display, Phase::Overlay, Phase::Present, Phase::Count]);
    phases
}

/// Records a whole frame.
pub(super) fn record(techniques: &mut [Box<dyn Technique + Send>], recording: &mut Recording<'_>) {
    // An empty pass, whose timestamp marks the start of GPU work.
    drop(recording.compute_pass("begin"));
    for phase in phases(recording.frame.plan) {
        recording.targets.enter(phase, recording.encoder, recording.gpu, &recording.frame);
        for technique in techniques.iter_mut() {
            technique.record(phase, recording);
        }
    }
}

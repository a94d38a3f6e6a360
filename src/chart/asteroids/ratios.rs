//! Ratios that show whether work is shared: the time for a field outside of every view relative to that for a visible one, culling for two eyes
//! relative to one, and culling for six cube faces relative to one equirectangular picture. Both sides of a ratio are drawn in turn.

use super::{
    AsteroidExtent, Place,
    turn::{FrameParts, Parts, turn},
    workload::{Fields, Variant, count_name},
};
use crate::{
    chart::{
        Axis, Budget, ChartError, Row, Score, Spread, ViewShape,
        timing::{self, Case},
        workloads::{EYE_HALF_FOV_RAD, rig_of},
    },
    render::Renderer,
    view::ViewKind,
};

/// A ratio. It defines the workload's name, the metric's name and the compared quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ratio {
    /// Total time without the pass that composites layers into pictures, because that pass scales with pixels and
    /// includes bodies.
    OutsideOverInside,
    /// Planning and culling.
    TwoEyesOverOne,
    /// Planning and culling.
    SixFacesOverSky,
}

/// All ratios.
pub const RATIOS: [Ratio; 3] = [Ratio::OutsideOverInside, Ratio::TwoEyesOverOne, Ratio::SixFacesOverSky];

impl Ratio {
    fn metric(self) -> &'static str {
        match self {
            Self::OutsideOverInside => "outside_over_inside",
            Self::TwoEyesOverOne => "culling_two_eyes_over_one",
            Self::SixFacesOverSky => "culling_six_faces_over_sky",
        }
    }

    /// Returns the view and the camera's place for the two sides of the ratio.
    fn sides(self, px: u32) -> [(ViewKind, Place); 2] {
        let one = ViewKind::Perspective { size: [px; 2], fov_y_rad: 2.0 * EYE_HALF_FOV_RAD };
        match self {
            Self::OutsideOverInside => [(one.clone(), Place::TurnedAway), (one, Place::Before)],
            Self::TwoEyesOverOne => [(ViewShape::Stereo([px; 2]).kind(), Place::Before), (one, Place::Before)],
            Self::SixFacesOverSky => [
                (ViewShape::Cubemap(px / 2).kind(), Place::Within),
                (ViewShape::FullSky([2 * px, px]).kind(), Place::Within),
            ],
        }
    }

    fn compared_ms(self, parts: &Parts) -> f64 {
        match self {
            Self::OutsideOverInside => parts.whole_ms() - parts.geometry_ms,
            Self::TwoEyesOverOne | Self::SixFacesOverSky => parts.culling_ms(),
        }
    }
}

/// Returns one row per ratio and method of culling.
pub fn rows(
    renderer: &mut Renderer,
    extent: &AsteroidExtent,
    fields: &mut Fields,
    variants: &[Variant],
    budget: Budget,
    step: &mut dyn FnMut(String),
) -> Result<Vec<Row>, ChartError> {
    let charted = ["cpu_culling", "gpu_culling_octahedral_blend"];
    let mut rows = Vec::new();
    for (done, ratio) in RATIOS.into_iter().enumerate() {
        step(format!("timing {}", ratio.metric()));
        let budget = budget.part(1.0, RATIOS.len() - done);
        let mut sides = Vec::new();
        for (kind, place) in ratio.sides(extent.ratio_px) {
            sides.push((rig_of(vec![("chart", kind)])?, fields.scene(extent.ratio_instances, place)?));
        }
        for (index, variant) in variants.iter().filter(|variant| charted.contains(&variant.name)).enumerate() {
            let mut records = [FrameParts::default(), FrameParts::default()];
            let budget = budget.part(1.0, charted.len() - index);
            let mut timed = timing::rounds(2, extent.rounds, budget, |side| {
                let (rig, scene) = &sides[side];
                turn(renderer, variant, scene, rig, &mut records[side])
            })?;
            let medians = records.each_ref().map(|records| {
                let values: Vec<f64> = records.counted().iter().map(|parts| ratio.compared_ms(parts)).collect();
                Spread::from_values(&values)
            });
            let value = match medians {
                [Some(above), Some(below)] if below.median_ms > 0.0 => Some(above.median_ms / below.median_ms),
                _ => None,
            };
            let notes = ["numerator", "denominator"]
                .iter()
                .zip(&records)
                .map(|(side, records)| format!("{side}: {}", records.note()));
            let note = notes.collect::<Vec<_>>().join("; ");
            let above = timed.swap_remove(0);
            let case = Case {
                axis: Axis::Asteroids,
                workload: format!("{} asteroids {}", count_name(extent.ratio_instances), ratio.metric()),
                adapter: renderer.adapter().adapter.clone(),
                size: [extent.ratio_px; 2],
                items: u64::from(extent.ratio_instances),
                planes: ratio != Ratio::SixFacesOverSky,
            };
            let score = Score { value, note: String::new() };
            rows.push(case.named_row([variant.name, variant.source.name()], &above, ratio.metric(), &score, &note));
        }
    }
    Ok(rows)
}

//! Ratios that say whether work is shared: of a field that no view sees to one that is seen, of culling for two eyes to
//! one, of culling for the six faces of a cube to one equirectangular picture. Both sides of a ratio are drawn in turn.

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

/// A ratio: name of the workload and of the metric, and what is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ratio {
    /// Everything that a field takes but for the pass that puts layers into pictures, which goes by pixels and holds
    /// bodies too.
    OutsideOverInside,
    /// Planning and culling.
    TwoEyesOverOne,
    /// Planning and culling.
    SixFacesOverSky,
}

/// All of them.
pub const RATIOS: [Ratio; 3] = [Ratio::OutsideOverInside, Ratio::TwoEyesOverOne, Ratio::SixFacesOverSky];

impl Ratio {
    fn metric(self) -> &'static str {
        match self {
            Self::OutsideOverInside => "outside_over_inside",
            Self::TwoEyesOverOne => "culling_two_eyes_over_one",
            Self::SixFacesOverSky => "culling_six_faces_over_sky",
        }
    }

    /// Views and places of both sides.
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

    fn of(self, parts: &Parts) -> f64 {
        match self {
            Self::OutsideOverInside => parts.whole_ms() - parts.geometry_ms,
            Self::TwoEyesOverOne | Self::SixFacesOverSky => parts.culling_ms(),
        }
    }
}

/// A row per ratio and way of culling.
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
            let mut seen = [FrameParts::default(), FrameParts::default()];
            let budget = budget.part(1.0, charted.len() - index);
            let mut timed = timing::rounds(2, extent.rounds, budget, |side| {
                let (rig, scene) = &sides[side];
                turn(renderer, variant, scene, rig, &mut seen[side])
            })?;
            let medians = seen.each_ref().map(|seen| {
                let values: Vec<f64> = seen.counted().iter().map(|parts| ratio.of(parts)).collect();
                Spread::of(&values)
            });
            let value = match medians {
                [Some(above), Some(below)] if below.median_ms > 0.0 => Some(above.median_ms / below.median_ms),
                _ => None,
            };
            let what =
                ["over", "under"].iter().zip(&seen).map(|(side, seen)| format!("{side} the line: {}", seen.note()));
            let note = what.collect::<Vec<_>>().join("; ");
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

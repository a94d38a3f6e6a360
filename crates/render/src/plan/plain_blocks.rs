//! Plain blocks of an image within an error budget: squares of pixels that show stars in front of light that is smooth over the square, and nothing else. In them
//! a pixel is its sum of starlight plus light that is interpolated between the points of one grid. All other blocks are computed pixel by pixel.

use super::{
    Plan, PlanError,
    budget::{ErrorBudget, are_smooth},
    grid_spacing::{GridSpacing, widest_pixel_rad},
    kept::Kept,
    settings::GlareMethod,
    technique::{PlanInputs, Step, Technique},
};
use crate::view::{Viewport, projection::Projection};

/// Side of a block, pixels.
pub const PLAIN_BLOCK_PX: u32 = 8;
/// Least spacing of the grid, pixels: a block has at most two cells along a side.
const LEAST_SPACING_PX: u32 = 4;
/// Greatest angle between adjacent points of the grid at the centre of a picture, rad. Second differences reveal light that is too curved for this
/// spacing.
const MOST_RAD: f64 = 0.0246;
/// Error of the interpolated light that a block may have, as a fraction of the budget.
pub const SHARE_OF_BUDGET: f64 = 0.5;

/// Distance between the points of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainSpacing {
    /// In the picture, pixels.
    pub px: u32,
    /// Greatest angle between adjacent points, rad.
    pub rad: f64,
}

/// Plain blocks of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PlainBlocksPlan {
    /// Spacing of the grid of each viewport; `None`: the picture has no plain blocks, because of its projection or its wide pixels, or because they
    /// would not save time.
    pub spacings: Vec<Option<PlainSpacing>>,
    /// Budget of the images. Interpolated light may use [`SHARE_OF_BUDGET`] of it.
    pub budget: ErrorBudget,
}

/// Plans [`PlainBlocksPlan`].
pub(super) struct PlainBlocks;

/// Returns the spacings of the grids of viewports: see [`PlainBlocksPlan::spacings`]. `is_costly`: whether pixels contain light from the air or from
/// a map of faint light, which is costly to compute.
pub(super) fn plain_spacings(viewports: &[Viewport], is_costly: bool) -> Vec<Option<PlainSpacing>> {
    let are_smooth = are_smooth(viewports);
    let spacing = GridSpacing { most_rad: MOST_RAD, most_px: PLAIN_BLOCK_PX };
    let of_viewport = |viewport: &Viewport| {
        // Measured with llvmpipe (docs/benchmarks.md): in other flat views of space, marking the blocks takes more time than it saves.
        let pays = match viewport.projection {
            Projection::Perspective(_) => is_costly,
            Projection::Fisheye(_) => true,
            _ => false,
        };
        let px = spacing.in_viewport(viewport);
        let rad = f64::from(px) * widest_pixel_rad(viewport);
        (are_smooth && pays && px >= LEAST_SPACING_PX).then_some(PlainSpacing { px, rad })
    };
    viewports.iter().map(of_viewport).collect()
}

/// Plain blocks for a plan; `None`: its pictures are computed pixel by pixel.
fn plain_blocks(plan: &Plan) -> Option<PlainBlocksPlan> {
    let budget = plan.display.budget?;
    let is_resolved_at_once = match budget {
        ErrorBudget::Codes(_) => plan.display.resolves_to_display,
        ErrorBudget::Hdr { .. } => plan.display.adds_up && !plan.display.is_scattered_after,
    };
    let is_costly = plan.air.sky.is_some() || plan.smooth_light.map.is_some();
    let spacings = plain_spacings(&plan.views.viewports, is_costly);
    let has_veil_if_any = plan.glare.method == GlareMethod::None || plan.glare.in_sums.is_some();
    let mut tiles = plan.views.batches.iter().flat_map(|batch| &batch.tiles);
    let is_possible = spacings.iter().any(Option::is_some)
        && is_resolved_at_once
        && has_veil_if_any
        && plan.views.motion.is_none()
        && tiles.all(|tile| tile.first_row.is_multiple_of(PLAIN_BLOCK_PX));
    is_possible.then_some(PlainBlocksPlan { spacings, budget })
}

impl Technique for PlainBlocks {
    fn plan(
        &mut self,
        step: Step,
        _inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Light => plan.plain_blocks = plain_blocks(plan),
            Step::Report => {
                let name = "smooth light of plain blocks, interpolated between grid points";
                let bound = plan.plain_blocks.as_ref().map(|plain| plain.budget.bound(name, SHARE_OF_BUDGET));
                plan.report.certificate.extend(bound);
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::f64::consts::PI;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::view::{Rig, View, ViewKind, projection::FisheyeMapping};

    fn spacing_of(kind: ViewKind) -> u32 {
        let view = View::new("view", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        let viewports = Rig::new(vec![view]).unwrap().viewports(DQuat::IDENTITY);
        GridSpacing { most_rad: MOST_RAD, most_px: PLAIN_BLOCK_PX }.in_viewport(&viewports[0])
    }

    #[test]
    fn the_spacing_follows_the_angle_of_a_pixel() {
        let dome = |size| spacing_of(ViewKind::DomeMaster { size, fov_rad: PI, tilt_rad: 0.0 });
        assert_eq!([256, 512, 1024, 4096].map(dome), [2, 4, 8, 8]);
        let mapping = FisheyeMapping::Orthographic;
        assert_eq!(spacing_of(ViewKind::Fisheye { size: [1024; 2], mapping, fov_rad: 3.0 }), 2);
    }
}

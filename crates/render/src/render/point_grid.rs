//! Grids of points over pictures, at which smooth light is computed. Shader: `shaders/shared/point_grid.wgsl`.

use super::{constants::workgroups::VEIL_SIDE, layout::PointGrid};
pub(crate) use crate::plan::plain_blocks::GridSpacing;
use crate::{plan::Plan, view::Viewport};

/// Dispatches the current pipeline over all points of all grids: workgroups of [`VEIL_SIDE`] x [`VEIL_SIDE`] points,
/// one layer per grid.
pub(crate) fn dispatch_points(pass: &mut wgpu::ComputePass<'_>, grids: &[PointGrid]) {
    let most = |side: fn(&PointGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
    pass.dispatch_workgroups(most(|grid| grid.columns), most(|grid| grid.rows), grids.len() as u32);
}

/// Creates consecutive grids over all pictures of a plan. With plain blocks, all smooth light has the grids of these blocks; otherwise the grids have
/// the given spacing. Returns them and the total number of points.
pub(crate) fn point_grids(plan: &Plan, spacing: GridSpacing) -> (Vec<PointGrid>, u32) {
    let viewports = &plan.views.viewports;
    match &plan.plain_blocks {
        Some(plain) => {
            let other = |number: usize| spacing.in_viewport(&viewports[number]);
            grids_of(viewports, |number| plain.spacings_px[number].unwrap_or_else(|| other(number)))
        }
        None => grids_of(viewports, |number| spacing.in_viewport(&viewports[number])),
    }
}

fn grids_of(viewports: &[Viewport], spacing_px: impl Fn(usize) -> u32) -> (Vec<PointGrid>, u32) {
    let mut first = 0;
    let grids = viewports
        .iter()
        .enumerate()
        .map(|(number, viewport)| {
            let spacing = spacing_px(number);
            let [columns, rows] = viewport.size().map(|side| side.div_ceil(spacing) + 1);
            let grid = PointGrid { first, columns, rows, spacing };
            first += columns * rows;
            grid
        })
        .collect();
    (grids, first)
}

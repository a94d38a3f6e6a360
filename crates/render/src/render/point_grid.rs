//! Grids of points over pictures, at which smooth light is computed. Shader: `shaders/shared/point_grid.wgsl`.

use super::{constants::workgroups::VEIL_SIDE, layout::PointGrid};
pub(crate) use crate::plan::grid_spacing::GridSpacing;
use crate::{
    plan::{Plan, plain_blocks::PlainSpacing},
    view::Viewport,
};

/// Dispatches the current pipeline over all points of all grids, in workgroups of [`VEIL_SIDE`] x [`VEIL_SIDE`] points, one layer per grid.
pub(crate) fn dispatch_points(pass: &mut wgpu::ComputePass<'_>, grids: &[PointGrid]) {
    let most = |side: fn(&PointGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
    pass.dispatch_workgroups(most(|grid| grid.columns), most(|grid| grid.rows), grids.len() as u32);
}

/// Creates consecutive grids over all pictures of a plan. If the plan has plain blocks, the grids are those of these blocks, for all smooth light.
/// Otherwise the grids have the given spacing. Returns the grids and their total number of points.
pub(crate) fn point_grids(plan: &Plan, spacing: GridSpacing) -> (Vec<PointGrid>, u32) {
    let viewports = &plan.views.viewports;
    match &plan.plain_blocks {
        Some(plain) => grids_of(viewports, spacing, &plain.spacings),
        None => grids_of(viewports, spacing, &[]),
    }
}

fn grids_of(viewports: &[Viewport], spacing: GridSpacing, plain: &[Option<PlainSpacing>]) -> (Vec<PointGrid>, u32) {
    let mut first = 0;
    let grids = viewports
        .iter()
        .enumerate()
        .map(|(number, viewport)| {
            let own = plain.get(number).copied().flatten();
            let PlainSpacing { px: spacing, rad: spacing_rad } =
                own.unwrap_or_else(|| PlainSpacing { px: spacing.in_viewport(viewport), rad: spacing.most_rad });
            let [columns, rows] = viewport.size().map(|side| side.div_ceil(spacing) + 1);
            let grid = PointGrid {
                first,
                columns,
                rows,
                spacing,
                spacing_rad: spacing_rad as f32,
                spacing_log2: spacing.ilog2(),
                ..Default::default()
            };
            first += columns * rows;
            grid
        })
        .collect();
    (grids, first)
}

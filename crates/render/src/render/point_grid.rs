//! Grids of points over pictures, at which light is computed that is smooth from pixel to pixel. Shader: `shaders/shared/point_grid.wgsl`.

use super::{constants::workgroups::VEIL_SIDE, layout::PointGrid};
use crate::view::{
    Viewport,
    projection::{FisheyeMapping, Projection},
};

/// The spacing of pictures that end in an infinite derivative, pixels.
const ORTHOGRAPHIC_SPACING_PX: u32 = 2;

/// How close together points stand at least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GridSpacing {
    /// Greatest angle between two of them in the middle of a picture, rad.
    pub most_rad: f64,
    /// The same in pixels: a power of two.
    pub most_px: u32,
}

/// How much wider than in the middle of a picture pixels are on the sky. Those of the other mappings are nowhere wider, but for orthographic ones, which have a spacing of their own, and for tables: pixels
/// of projectors are wider by a third at most, which budgets have room for.
fn stretch(projection: &Projection) -> f64 {
    match projection {
        // Along the meridian pixels are 1 / cos(theta / 2) of those in the middle.
        Projection::Fisheye(fisheye) if fisheye.mapping == FisheyeMapping::Equisolid => {
            1.0 / (0.5 * fisheye.half_fov_rad).cos().max(1e-3)
        }
        _ => 1.0,
    }
}

impl GridSpacing {
    /// Pixels from point to point: as many as keep points close together on the sky.
    fn of(self, viewport: &Viewport) -> u32 {
        if let Projection::Fisheye(fisheye) = &viewport.projection
            && fisheye.mapping == FisheyeMapping::Orthographic
        {
            return ORTHOGRAPHIC_SPACING_PX.min(self.most_px);
        }
        let widest_rad = viewport.projection.middle_pixel_rad() * stretch(&viewport.projection);
        let fitting = (self.most_rad / widest_rad).clamp(1.0, f64::from(self.most_px));
        1 << fitting.log2().floor() as u32
    }
}

/// Runs a pass, whose pipeline and groups are set, over all points of grids: workgroups of [`VEIL_SIDE`] points a side, and one layer of them a grid.
pub(crate) fn dispatch_points(pass: &mut wgpu::ComputePass<'_>, grids: &[PointGrid]) {
    let most = |side: fn(&PointGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
    pass.dispatch_workgroups(most(|grid| grid.columns), most(|grid| grid.rows), grids.len() as u32);
}

/// Grids over all pictures, one after the other, and the number of their points.
pub(crate) fn point_grids(viewports: &[Viewport], spacing: GridSpacing) -> (Vec<PointGrid>, u32) {
    let mut first = 0;
    let grids = viewports
        .iter()
        .map(|viewport| {
            let spacing = spacing.of(viewport);
            let [columns, rows] = viewport.size().map(|side| side.div_ceil(spacing) + 1);
            let grid = PointGrid { first, columns, rows, spacing };
            first += columns * rows;
            grid
        })
        .collect();
    (grids, first)
}

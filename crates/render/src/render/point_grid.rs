//! Grids of points over pictures, at which smooth light is computed. Shader: `shaders/shared/point_grid.wgsl`.

use super::{constants::workgroups::VEIL_SIDE, layout::PointGrid};
use crate::view::{
    Viewport,
    projection::{FisheyeMapping, Projection},
};

/// Spacing for orthographic pictures, whose derivative is infinite at the rim, pixels.
const ORTHOGRAPHIC_SPACING_PX: u32 = 2;

/// Limits of the distance between grid points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GridSpacing {
    /// Greatest angle between two points at the centre of a picture, rad.
    pub most_rad: f64,
    /// Greatest distance, pixels: a power of two.
    pub most_px: u32,
}

/// Greatest size of a pixel on the sky, relative to a pixel at the centre. Other mappings have their widest pixels at
/// the centre, with two exceptions: orthographic ones, which have a separate spacing, and tables. Pixels of
/// projectors are at most a third wider, which budgets allow for.
/// of projectors are wider by a third at most, which budgets have room for.
fn stretch(projection: &Projection) -> f64 {
    match projection {
        // Along the meridian, pixels are 1 / cos(theta / 2) times as large as at the centre.
        Projection::Fisheye(fisheye) if fisheye.mapping == FisheyeMapping::Equisolid => {
            1.0 / (0.5 * fisheye.half_fov_rad).cos().max(1e-3)
        }
        _ => 1.0,
    }
}

impl GridSpacing {
    /// Distance between points in a viewport, pixels.
    fn in_viewport(self, viewport: &Viewport) -> u32 {
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

/// Dispatches the current pipeline over all points of all grids: workgroups of [`VEIL_SIDE`] x [`VEIL_SIDE`] points,
/// one layer per grid.
pub(crate) fn dispatch_points(pass: &mut wgpu::ComputePass<'_>, grids: &[PointGrid]) {
    let most = |side: fn(&PointGrid) -> u32| grids.iter().map(side).max().unwrap_or(0).div_ceil(VEIL_SIDE);
    pass.dispatch_workgroups(most(|grid| grid.columns), most(|grid| grid.rows), grids.len() as u32);
}

/// Creates consecutive grids over all pictures. Returns them and the total number of points.
pub(crate) fn point_grids(viewports: &[Viewport], spacing: GridSpacing) -> (Vec<PointGrid>, u32) {
    let mut first = 0;
    let grids = viewports
        .iter()
        .map(|viewport| {
            let spacing = spacing.in_viewport(viewport);
            let [columns, rows] = viewport.size().map(|side| side.div_ceil(spacing) + 1);
            let grid = PointGrid { first, columns, rows, spacing };
            first += columns * rows;
            grid
        })
        .collect();
    (grids, first)
}

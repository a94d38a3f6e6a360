//! Spacing of the points of a picture at which smooth light is evaluated.

use std::f64::consts::FRAC_PI_2;

use crate::view::{
    Viewport,
    projection::{FisheyeMapping, Projection},
};

/// Spacing for orthographic pictures, pixels. The derivative of their mapping is infinite at the rim.
const ORTHOGRAPHIC_SPACING_PX: u32 = 2;

/// Limits of the distance between the points of a grid over a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSpacing {
    /// Greatest angle between adjacent points at the centre of a picture, rad.
    pub most_rad: f64,
    /// Greatest distance between adjacent points, pixels: a power of two.
    pub most_px: u32,
}

impl GridSpacing {
    /// Distance between points in a viewport, pixels.
    pub fn in_viewport(self, viewport: &Viewport) -> u32 {
        if let Projection::Fisheye(fisheye) = &viewport.projection
            && fisheye.mapping == FisheyeMapping::Orthographic
        {
            return ORTHOGRAPHIC_SPACING_PX.min(self.most_px);
        }
        let fitting = (self.most_rad / widest_pixel_rad(viewport)).clamp(1.0, f64::from(self.most_px));
        1 << fitting.log2().floor() as u32
    }
}

/// Angle of the widest pixel of a picture, rad. Most mappings have their widest pixels at the centre. There are two exceptions. Orthographic pictures
/// have a separate spacing. The pixels of tabulated pictures are at most a third wider, and budgets allow for that.
pub(super) fn widest_pixel_rad(viewport: &Viewport) -> f64 {
    let stretch = match &viewport.projection {
        // Along the meridian, pixels are 1 / cos(theta / 2) times as large as at the centre.
        Projection::Fisheye(fisheye) if fisheye.mapping == FisheyeMapping::Equisolid => {
            1.0 / (0.5 * fisheye.half_fov_rad).cos().max(1e-3)
        }
        _ => 1.0,
    };
    (viewport.projection.middle_pixel_rad() * stretch).min(FRAC_PI_2)
}

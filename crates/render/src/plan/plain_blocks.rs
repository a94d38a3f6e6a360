//! Plain blocks of a display image: squares of pixels that show stars in front of light that is smooth over the square, and nothing else. In them
//! a pixel is its sum of starlight plus light that is interpolated between the points of one grid. All other blocks are computed pixel by pixel.

use std::f64::consts::FRAC_PI_2;

use super::{
    Approximation, Plan, PlanError,
    budget::are_smooth,
    kept::Kept,
    settings::GlareMethod,
    technique::{PlanInputs, Step, Technique},
};
use crate::view::{
    Viewport,
    projection::{FisheyeMapping, Projection},
};

/// Side of a block, pixels.
pub const PLAIN_BLOCK_PX: u32 = 8;
/// Least spacing of the grid, pixels: a block has at most two cells along a side.
const LEAST_SPACING_PX: u32 = 4;
/// Greatest angle between two points of the grid at the centre of a picture, rad. Light that is too curved for it is found by its second
/// differences.
const MOST_RAD: f64 = 0.0246;
/// Error of the interpolated light that a block may have, as a fraction of the budget of display images.
const SHARE_OF_BUDGET: f64 = 0.5;
/// Spacing for orthographic pictures, whose derivative is infinite at the rim, pixels.
const ORTHOGRAPHIC_SPACING_PX: u32 = 2;

/// Limits of the distance between the points of a grid over a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSpacing {
    /// Greatest angle between two points at the centre of a picture, rad.
    pub most_rad: f64,
    /// Greatest distance, pixels: a power of two.
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

/// Angle of the widest pixel of a picture, rad. Most mappings have their widest pixels at the centre. The exceptions are orthographic ones, which have a
/// separate spacing, and tables, whose pixels are at most a third wider, which budgets allow for.
fn widest_pixel_rad(viewport: &Viewport) -> f64 {
    let stretch = match &viewport.projection {
        // Along the meridian, pixels are 1 / cos(theta / 2) times as large as at the centre.
        Projection::Fisheye(fisheye) if fisheye.mapping == FisheyeMapping::Equisolid => {
            1.0 / (0.5 * fisheye.half_fov_rad).cos().max(1e-3)
        }
        _ => 1.0,
    };
    (viewport.projection.middle_pixel_rad() * stretch).min(FRAC_PI_2)
}

/// Plain blocks of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlainBlocksPlan {
    /// Spacing of the grid of each viewport, pixels; `None`: the picture has no plain blocks, because of its projection or its wide pixels.
    pub spacings_px: Vec<Option<u32>>,
    /// The widest spacing, rad.
    pub spacing_rad: f64,
    /// Greatest error of the interpolated light, codes of 8 bits.
    pub most_error_codes: f64,
}

/// Plans [`PlainBlocksPlan`].
pub(super) struct PlainBlocks;

/// Spacings of the grids of viewports: see [`PlainBlocksPlan::spacings_px`]. `None`: no picture has plain blocks.
pub(super) fn spacings_px(viewports: &[Viewport]) -> Option<Vec<Option<u32>>> {
    let spacing = GridSpacing { most_rad: MOST_RAD, most_px: PLAIN_BLOCK_PX };
    let of_viewport = |viewport: &Viewport| {
        let has_mapping = matches!(viewport.projection, Projection::Perspective(_) | Projection::Fisheye(_));
        let px = spacing.in_viewport(viewport);
        (has_mapping && px >= LEAST_SPACING_PX).then_some(px)
    };
    let spacings: Vec<_> = viewports.iter().map(of_viewport).collect();
    (are_smooth(viewports) && spacings.iter().any(Option::is_some)).then_some(spacings)
}

/// Plain blocks for a plan; `None`: its pictures are computed pixel by pixel.
fn plain_blocks(plan: &Plan, display_codes: f64) -> Option<PlainBlocksPlan> {
    plan.display.step_cd_m2?;
    let viewports = &plan.views.viewports;
    let spacings_px = spacings_px(viewports)?;
    let has_veil_if_any = plan.glare.method == GlareMethod::None || plan.glare.in_sums.is_some();
    let mut tiles = plan.views.batches.iter().flat_map(|batch| &batch.tiles);
    let is_possible = plan.display.resolves_to_display
        && has_veil_if_any
        && plan.views.motion.is_none()
        && tiles.all(|tile| tile.first_row.is_multiple_of(PLAIN_BLOCK_PX));
    let spacing_rad =
        |(viewport, px): (&Viewport, &Option<u32>)| f64::from(px.unwrap_or(0)) * widest_pixel_rad(viewport);
    is_possible.then(|| PlainBlocksPlan {
        spacing_rad: viewports.iter().zip(&spacings_px).map(spacing_rad).fold(0.0, f64::max),
        spacings_px,
        most_error_codes: SHARE_OF_BUDGET * display_codes,
    })
}

impl Technique for PlainBlocks {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Light => plan.plain_blocks = plain_blocks(plan, inputs.settings.accuracy.display_codes),
            Step::Report if plan.plain_blocks.is_some() => {
                let codes = inputs.settings.accuracy.display_codes;
                let name = "smooth light of plain blocks, interpolated between grid points";
                let bound = Approximation::new(name, SHARE_OF_BUDGET * codes, "codes of 8 bits", Some(codes));
                plan.report.certificate.push(bound);
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
    use crate::view::{Rig, View, ViewKind};

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

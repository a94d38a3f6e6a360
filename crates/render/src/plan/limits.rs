//! Limits of an adapter for plans, as plain numbers.

use serde::Serialize;

use super::{
    error::PlanError,
    settings::Accumulator,
    stars::{cube_faces::CubeFaces, cull::MAX_VIEWPORTS},
    tables::table_limit_bytes,
    tiles::BYTES_PER_PIXEL,
};
use crate::view::{
    Rig,
    projection::{FRINGE, PlaneMapping, Projection},
};

/// Maximum memory of the pixels of one frame, bytes.
const MAX_FRAME_BYTES: u64 = 12 << 30;
/// Bytes of a pixel of the display image.
pub const DISPLAY_BYTES: u64 = 4;
/// Maximum memory per pixel: sums (or HDR image) and display image, each on the adapter, in readback and in the frame.
const FRAME_BYTES_PER_PIXEL: u64 = 3 * (BYTES_PER_PIXEL + DISPLAY_BYTES) + BYTES_PER_PIXEL / 2;

/// Limits and abilities of an adapter that plans depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Limits {
    /// Maximum size of one buffer binding, bytes.
    pub max_binding_bytes: u64,
    /// Largest side of a view or a texture, pixels.
    pub max_view_side_px: u32,
    /// Whether sums of light use 64-bit words.
    pub wide_sums: bool,
    /// Bytes of a texel of the textures that methods blend into: 16 (32-bit floats) or 8 (16-bit floats).
    pub blend_texel_bytes: u64,
    /// Whether the pass that converts sums to luminance may also write the display image; otherwise a separate pass does.
    pub fuses_display: bool,
    /// Whether that pass may read a map of faint light; otherwise every star is drawn individually.
    pub reads_faint_map: bool,
}

impl Default for Limits {
    /// Limits of a software Vulkan driver.
    fn default() -> Self {
        Self {
            max_binding_bytes: 128 << 20,
            max_view_side_px: 16384,
            wide_sums: true,
            blend_texel_bytes: 16,
            fuses_display: true,
            reads_faint_map: true,
        }
    }
}

impl Limits {
    /// Name of the accumulator within these limits, as reported in plans.
    pub fn accumulator_name(&self, accumulator: Accumulator) -> &'static str {
        match accumulator {
            Accumulator::FixedPoint if self.wide_sums => "fixed point, 2 x 64 bits",
            Accumulator::FixedPoint => "fixed point, 4 x 32 bits",
            Accumulator::PackedCompareExchange => "two halves in a word, compare-exchange",
            Accumulator::Blending if self.blend_texel_bytes >= 16 => "additive blending, 32-bit floats",
            Accumulator::Blending => "additive blending, 16-bit floats",
            Accumulator::PerPixel => "none: every pixel individually",
        }
    }

    /// Checks that the images of a rig fit within the limits.
    ///
    /// # Errors
    ///
    /// Names the first view that is too large or makes a total exceed its limit.
    pub fn check(&self, rig: &Rig) -> Result<(), PlanError> {
        let limit = self.max_view_side_px;
        let mut bytes = 0;
        let mut images = 0;
        let mut tables = Vec::new();
        for view in rig.views() {
            for image in &view.images {
                let [width, height] = image.projection.mapping().size();
                let name = || view.name.clone();
                if width > limit || height > limit {
                    return Err(PlanError::TooLarge { view: name(), width, height, limit });
                }
                if let Projection::Tabulated(table) = &image.projection
                    && !tables.contains(&table)
                {
                    tables.push(table);
                    let limit = table_limit_bytes(self.max_view_side_px);
                    let bytes: u64 = tables.iter().map(|table| table.bytes()).sum();
                    if bytes > limit {
                        return Err(PlanError::TooLargeTables { view: name(), bytes, limit });
                    }
                }
                bytes += u64::from(width) * u64::from(height) * FRAME_BYTES_PER_PIXEL;
                if bytes > MAX_FRAME_BYTES {
                    return Err(PlanError::TooManyPixels { view: name(), bytes, limit: MAX_FRAME_BYTES });
                }
                images += 1;
            }
        }
        if images > MAX_VIEWPORTS {
            return Err(PlanError::TooManyImages { images, limit: MAX_VIEWPORTS });
        }
        Ok(())
    }

    /// Checks that kernels that are round on the sky do not reach outside the tabulated pictures of a rig. Such pictures have no pixels beyond a cut,
    /// and contain directions only up to a certain number of pixels beyond their border.
    pub(super) fn check_round_kernels(
        rig: &Rig,
        method: &'static str,
        reach_px: impl Fn(&Projection) -> f64,
    ) -> Result<(), PlanError> {
        for view in rig.views() {
            for image in &view.images {
                let Projection::Tabulated(table) = &image.projection else { continue };
                let view = || view.name.clone();
                if table.has_cut() || table.shows_full_sphere() {
                    return Err(PlanError::RoundKernelAtCut { view: view(), method });
                }
                let (reach_px, limit_px) = (reach_px(&image.projection), FRINGE as f64);
                if reach_px > limit_px {
                    return Err(PlanError::KernelBeyondTable { view: view(), method, reach_px, limit_px });
                }
            }
        }
        Ok(())
    }

    /// Checks that there is enough memory for the images in addition to the texture into which blending methods draw the largest image. For a fisheye
    /// of a few degrees, the texture is a cube's face with the picture's resolution, which is far larger than the picture.
    pub(super) fn check_blended(&self, rig: &Rig) -> Result<(), PlanError> {
        let images = || rig.views().iter().flat_map(|view| view.images.iter().map(move |image| (view, image)));
        let pixels: u64 =
            images().map(|(_, image)| image.projection.mapping().size().map(u64::from).iter().product::<u64>()).sum();
        for (view, image) in images() {
            let bytes = pixels * FRAME_BYTES_PER_PIXEL + self.blended_bytes(&image.projection);
            if bytes > MAX_FRAME_BYTES {
                return Err(PlanError::TooManyPixels { view: view.name.clone(), bytes, limit: MAX_FRAME_BYTES });
            }
        }
        Ok(())
    }

    /// Size of the texture that a picture is blended into, bytes.
    fn blended_bytes(&self, projection: &Projection) -> u64 {
        let cube = CubeFaces::for_projection(projection, self.max_view_side_px);
        let (size, layers) =
            cube.map_or((projection.mapping().size(), 1), |cube| ([cube.side_px(); 2], cube.layers() as u64));
        size.map(u64::from).iter().product::<u64>() * layers * self.blend_texel_bytes
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "an unexpected error fails the test")]
mod tests {
    use std::sync::Arc;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::view::{
        View, ViewKind,
        projection::{Perspective, TabulatedMapping},
    };

    #[test]
    fn tables_that_do_not_fit_are_refused_with_the_view() {
        let views = (0..60).map(|index| {
            let plane = Perspective::symmetric([64, 64], 0.5 + 0.01 * f64::from(index)).unwrap();
            let mapping = Arc::new(TabulatedMapping::new(plane).unwrap());
            View::new(&format!("v{index}"), ViewKind::Tabulated { mapping }, DQuat::IDENTITY, DVec3::ZERO).unwrap()
        });
        let rig = Rig::new(views.collect()).unwrap();
        assert!(Limits::default().check(&rig).is_ok());
        let small = Limits { max_view_side_px: 64, ..Limits::default() };
        let error = small.check(&rig).unwrap_err();
        assert!(matches!(&error, PlanError::TooLargeTables { limit: 4_194_304, .. }), "{error}");
        assert!(error.to_string().starts_with("view `v"), "{error}");
    }
}

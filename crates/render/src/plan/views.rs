//! Viewports of a frame, the tiles that they are cut into, and the camera.

use glam::DVec3;

use super::{
    Limits,
    tiles::{BYTES_PER_PIXEL, Batch, batches},
};
use crate::{relativity::Motion, scene::Camera, units::PARSEC_M, view::Viewport};

/// Views of a frame.
#[derive(Clone, Default)]
pub struct ViewsPlan {
    /// Every image of every view that is drawn.
    pub viewports: Vec<Viewport>,
    /// Every image of every view, drawn or not: data shared by all frames of a rig depends on these.
    pub all_viewports: Vec<Viewport>,
    /// Tiles of all drawn viewports, in batches that fit into one binding each.
    pub batches: Vec<Batch>,
    /// Solid angle of all drawn pictures, sr.
    pub total_solid_angle_sr: f64,
    /// Position of the camera, pc.
    pub camera_pc: DVec3,
    /// Motion of the camera; `None`: it is at rest.
    pub motion: Option<Motion>,
}

impl ViewsPlan {
    /// Draws the views for which `wanted` is true, or all of them.
    pub(super) fn new(all_viewports: Vec<Viewport>, wanted: Option<&[bool]>, camera: &Camera, limits: &Limits) -> Self {
        let is_drawn = |viewport: &&Viewport| wanted.is_none_or(|wanted| wanted[viewport.view]);
        let viewports: Vec<Viewport> = all_viewports.iter().filter(is_drawn).cloned().collect();
        let sizes: Vec<[u32; 2]> = viewports.iter().map(Viewport::size).collect();
        Self {
            batches: batches(&sizes, limits.max_binding_bytes / BYTES_PER_PIXEL),
            total_solid_angle_sr: viewports.iter().map(|v| v.projection.picture_solid_angle_sr()).sum(),
            camera_pc: camera.position_m / PARSEC_M,
            motion: Motion::new(camera.velocity_c),
            viewports,
            all_viewports,
        }
    }

    /// Solid angle of the smallest pixel of all drawn pictures, sr; infinite without pictures.
    pub(super) fn smallest_pixel_sr(&self) -> f64 {
        self.viewports.iter().map(|v| v.projection.smallest_pixel_sr()).fold(f64::INFINITY, f64::min)
    }
}

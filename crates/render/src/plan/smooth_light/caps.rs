//! Caps of whole-sky maps. The pixels of a whole-sky map become narrow towards its poles, so a star that is hardly visible at the equator is bright in
//! a pixel there. The map of faint light is not read in these caps: their faint stars are drawn individually.
//!
//! At the edge of a cap, the map and the drawn stars share the light: a star is drawn with its share, and a pixel reads the map with the rest. The
//! share changes over many rows, so that the light that a kernel carries from row to row does not show.

use std::{f64::consts::PI, sync::Arc};

use glam::DVec3;

use super::fitting::SkyInputs;
use crate::{
    plan::stars::cull::{Field, VisibleChunk, visible_in},
    view::{Viewport, projection::Projection},
};

/// Width of the narrowest pixels that read the map, relative to those at the equator. With a smaller width, fewer stars would be in a cap, but the map
/// could hold only fainter ones.
const LEAST_WIDTH: f64 = 0.36;
/// Rows of pixels over which a star's share changes from 1 to 0.
const SHARED_ROWS: f64 = 8.0;
/// Greatest ratio of the sides of a pixel at the equator.
const MOST_SIDE_RATIO: f64 = 1.5;

/// The caps of the whole-sky maps of a frame. Their edges are cosines of the latitude in the picture, which are also the widths of a pixel relative to
/// one at the equator.
#[derive(Clone, Debug, PartialEq)]
pub struct Caps {
    /// Stars with a smaller cosine are only drawn individually.
    pub inner: f64,
    /// Stars with a greater cosine are only in the map.
    pub outer: f64,
    /// Chunks whose stars may be in a cap, with the viewports that show it.
    pub visible: Arc<[VisibleChunk]>,
}

impl Caps {
    /// The caps of the viewports; `None`: no viewport is a whole-sky map.
    pub(super) fn of(inputs: &SkyInputs<'_>) -> Option<Self> {
        let SkyInputs { stars, camera_pc, viewports, cull, .. } = *inputs;
        let outer = outer_edge(viewports)?;
        // A margin for the rounding of directions in the shader.
        let half_angle_rad = outer.asin() + 1e-5;
        let whole_skies = viewports.iter().enumerate().filter(|(_, viewport)| is_whole_sky(viewport));
        let fields: Vec<(usize, Field)> = whole_skies
            .flat_map(|(index, viewport)| {
                [DVec3::Y, DVec3::NEG_Y].map(|pole| (index, Field::round(viewport, &cull, pole, half_angle_rad)))
            })
            .collect();
        let visible = visible_in(stars, camera_pc, viewports, &fields, cull);
        Some(Self { inner: LEAST_WIDTH, outer, visible: visible.into() })
    }

    /// The inner and the outer edge as shaders read them; 0 without caps.
    pub fn edges(caps: Option<&Self>) -> [f32; 2] {
        caps.map_or([0.0; 2], |caps| [caps.inner, caps.outer].map(|edge| edge as f32))
    }
}

/// Cosine of the latitude beyond which pixels only read the map; `None`: no viewport is a whole-sky map.
fn outer_edge(viewports: &[Viewport]) -> Option<f64> {
    let rows = viewports.iter().filter(|viewport| is_whole_sky(viewport)).map(|viewport| viewport.size()[1]).min()?;
    let latitude_rad = LEAST_WIDTH.acos() - SHARED_ROWS * PI / f64::from(rows);
    Some(latitude_rad.max(0.0).cos())
}

/// Whether a viewport is a whole-sky map.
pub(super) fn is_whole_sky(viewport: &Viewport) -> bool {
    matches!(viewport.projection, Projection::Equirectangular(_))
}

/// Solid angle of the smallest pixel of a viewport that reads a map of the whole sky, sr.
pub(super) fn smallest_read_sr(viewport: &Viewport) -> f64 {
    let projection = &viewport.projection;
    match is_whole_sky(viewport) {
        true => projection.smallest_pixel_sr().max(LEAST_WIDTH * projection.middle_pixel_rad().powi(2)),
        false => projection.smallest_pixel_sr(),
    }
}

/// Whether the pixels of a whole-sky map of this size are nearly square at the equator.
pub(super) fn has_square_pixels([width, height]: [u32; 2]) -> bool {
    (1.0 / MOST_SIDE_RATIO..=MOST_SIDE_RATIO).contains(&(0.5 * f64::from(width) / f64::from(height)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
pub(super) mod tests {
    use std::f64::consts::PI;

    use glam::DQuat;

    use super::*;
    use crate::view::{Rig, View, ViewKind};

    pub fn viewports(kinds: Vec<ViewKind>) -> Vec<Viewport> {
        let view = |(number, kind)| View::new(&format!("view-{number}"), kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        Rig::new(kinds.into_iter().enumerate().map(view).collect()).unwrap().viewports(DQuat::IDENTITY)
    }

    #[test]
    fn the_edge_is_where_rows_of_shared_light_begin() {
        let edge = |height| outer_edge(&viewports(vec![ViewKind::Equirectangular { size: [2 * height, height] }]));
        for height in [256, 1024, 4096] {
            let rows = (edge(height).unwrap().asin() - LEAST_WIDTH.asin()) / PI * f64::from(height);
            assert!((rows - SHARED_ROWS).abs() < 1e-6, "{height}: {rows}");
        }
        // Rows of a tiny picture are wide, so all of it shares the light.
        assert_eq!(edge(8), Some(1.0));
        let dome = ViewKind::DomeMaster { size: 512, fov_rad: PI, tilt_rad: 0.0 };
        assert_eq!(outer_edge(&viewports(vec![dome])), None);
    }

    #[test]
    fn pixels_that_read_the_map_are_at_least_as_large_as_at_the_edge() {
        let viewport = &viewports(vec![ViewKind::Equirectangular { size: [1024, 512] }])[0];
        let read_sr = smallest_read_sr(viewport);
        let mapping = viewport.projection.mapping();
        for row in 0..512 {
            let latitude_rad = (0.5 - (f64::from(row) + 0.5) / 512.0) * PI;
            let is_in_cap = latitude_rad.cos() < LEAST_WIDTH;
            assert_eq!(mapping.solid_angle_sr(0, row) < 0.999 * read_sr, is_in_cap, "row {row}");
        }
    }
}

//! Lets methods that were published for a flat image plane draw other projections: they draw the six faces of a cube around the view's axes as
//! planes, and the picture reads the faces by direction.
//!
//! The picture reads luminance with bilinear interpolation, so a footprint of a few pixels keeps its light only if
//! its pixels and those of the picture have a similar size; the light of a point depends on its sub-pixel position. This error is inherent in the
//! intermediate step and is not corrected here.

use std::f64::consts::{FRAC_PI_4, PI};

use crate::view::projection::{Face, Perspective, PlaneMapping, Projection};

/// Guard texels on each side of a face: interpolation reaches one texel beyond the edge.
pub const GUARD_PX: u32 = 2;

/// The cube of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubeFaces {
    /// Texels along an edge of the cube.
    pub edge_px: u32,
    /// For each face of [`Face::ALL`], whether it is visible in the picture.
    pub needed: [bool; 6],
}

impl CubeFaces {
    /// The cube for a projection; `None` for flat planes. Its texels have on average the solid angle of the picture's pixels,
    /// limited by `max_side_px`.
    pub fn for_projection(projection: &Projection, max_side_px: u32) -> Option<Self> {
        let [width, height] = projection.mapping().size();
        let (pixels, reach_rad) = match projection {
            Projection::Perspective(_) | Projection::CubeFace(_) => return None,
            Projection::Fisheye(fisheye) => (PI * fisheye.radius_px().powi(2), fisheye.half_fov_rad),
            Projection::Equirectangular(_) => (f64::from(width) * f64::from(height), PI),
            Projection::Tabulated(table) => (table.pixels() as f64, table.bounding_cone(0.0).around_view_axis_rad()),
        };
        let mean_sr = projection.picture_solid_angle_sr() / pixels;
        let edge = (4.0 * PI / 6.0 / mean_sr).sqrt().ceil();
        let edge_px = (edge as u32).clamp(1, max_side_px.saturating_sub(2 * GUARD_PX).max(1));
        // Angles between -z and the nearest direction of a face: 0 for the front, 45 degrees for the sides, and for the back the angle to a corner. A
        // texel of slack is added for interpolation.
        let slack = 4.0 / f64::from(edge_px);
        let needed = Face::ALL.map(|face| {
            let nearest = match face {
                Face::Front => 0.0,
                Face::Back => PI - 2.0_f64.sqrt().atan(),
                _ => FRAC_PI_4,
            };
            nearest <= reach_rad + slack
        });
        Some(Self { edge_px, needed })
    }

    /// Number of array layers: the faces in the order of [`Face::ALL`], up to the last one that is needed. A narrow picture needs only one face,
    /// which is large.
    pub fn layers(&self) -> usize {
        self.needed.iter().rposition(|needed| *needed).map_or(1, |last| last + 1)
    }

    /// Texels along a side of a face, including the guard.
    pub fn side_px(&self) -> u32 {
        self.edge_px + 2 * GUARD_PX
    }

    /// The plane of a face, including the guard.
    pub fn plane(&self) -> Perspective {
        let edge = 1.0 + 2.0 * f64::from(GUARD_PX) / f64::from(self.edge_px);
        Perspective::from_tangents([self.side_px(); 2], [-edge, edge, -edge, edge])
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::view::projection::{CubeFace, Equirectangular, Fisheye, FisheyeMapping};

    #[test]
    fn flat_planes_need_no_cube_and_texels_match_pixels() {
        let flat = Projection::Perspective(Perspective::symmetric([64, 64], 1.0).unwrap());
        assert_eq!(CubeFaces::for_projection(&flat, 4096), None);
        let face = Projection::CubeFace(CubeFace::new(Face::Up, 64).unwrap());
        assert_eq!(CubeFaces::for_projection(&face, 4096), None);

        let sky = Projection::Equirectangular(Equirectangular::new([512, 256]).unwrap());
        let cube = CubeFaces::for_projection(&sky, 4096).unwrap();
        // The 512 x 256 pixels are distributed over six faces.
        assert_eq!(cube, CubeFaces { edge_px: 148, needed: [true; 6] });
        assert_eq!(CubeFaces::for_projection(&sky, 64).unwrap().edge_px, 60);
    }

    #[test]
    fn invisible_faces_of_a_fisheye_are_left_out() {
        let needed = |degrees: f64| {
            let lens = Fisheye::new([256, 256], FisheyeMapping::Equidistant, degrees.to_radians()).unwrap();
            CubeFaces::for_projection(&Projection::Fisheye(lens), 4096).unwrap().needed
        };
        assert_eq!(needed(60.0), [true, false, false, false, false, false]);
        assert_eq!(needed(180.0), [true, true, true, false, true, true]);
        assert_eq!(needed(260.0), [true; 6]);
        let layers = |needed: [bool; 6]| CubeFaces { edge_px: 8, needed }.layers();
        assert_eq!([layers(needed(60.0)), layers(needed(180.0)), layers(needed(260.0))], [1, 6, 6]);
    }

    #[test]
    fn the_guard_continues_the_grid_of_texels() {
        let cube = CubeFaces { edge_px: 100, needed: [true; 6] };
        let face = CubeFace::new(Face::Front, 100).unwrap();
        for direction in [DVec3::new(0.3, -0.2, -1.0), DVec3::new(-0.99, 0.99, -1.0)] {
            let guarded = cube.plane().pixel_from_direction(direction).unwrap();
            let plain = face.pixel_from_direction(direction).unwrap();
            assert!((guarded - plain - DVec2::splat(f64::from(GUARD_PX))).length() < 1e-9);
        }
    }
}

//! One face of a cubemap. All six faces share their edges: a kernel that reaches over an edge is divided by the sum of
//! the weights that lie inside any of the six faces, so that the light of a star is complete at any position.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{BoundingCone, Footprint, Perspective, PlaneMapping, ProjectionError, Tap, check_size};

/// The faces of a cubemap, named as seen from the centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Face {
    /// Looks -z, +y up.
    Front,
    /// Looks +x, +y up.
    Right,
    /// Looks -x, +y up.
    Left,
    /// Looks +z, +y up.
    Back,
    /// Looks +y, +z at the top of the image.
    Up,
    /// Looks -y, -z at the top of the image.
    Down,
}

named!(Face {
    Front = "front",
    Right = "right",
    Left = "left",
    Back = "back",
    Up = "up",
    Down = "down",
});

impl Face {
    /// Viewing direction of the face and up direction of its image, in cube space.
    pub const fn forward_and_up(self) -> [DVec3; 2] {
        match self {
            Face::Front => [DVec3::NEG_Z, DVec3::Y],
            Face::Right => [DVec3::X, DVec3::Y],
            Face::Left => [DVec3::NEG_X, DVec3::Y],
            Face::Back => [DVec3::Z, DVec3::Y],
            Face::Up => [DVec3::Y, DVec3::Z],
            Face::Down => [DVec3::NEG_Y, DVec3::NEG_Z],
        }
    }

    /// Axes of the face's image in cube space: right, up, backwards (the viewing direction is minus the third).
    pub fn axes(self) -> DMat3 {
        let [forward, up] = self.forward_and_up();
        DMat3::from_cols(forward.cross(up), up, -forward)
    }

    /// Rotation that takes the face's view axes to cube axes.
    pub fn cube_from_face(self) -> DQuat {
        DQuat::from_mat3(&self.axes())
    }
}

/// One square face with 90 degrees of field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeFace {
    plane: Perspective,
    /// Which face.
    pub face: Face,
}

impl CubeFace {
    /// A face of `face_size` x `face_size` pixels.
    pub fn new(face: Face, face_size: u32) -> Result<Self, ProjectionError> {
        let size = [face_size; 2];
        check_size(size)?;
        Ok(Self { plane: Perspective::from_tangents(size, [-1.0, 1.0, -1.0, 1.0]), face })
    }

    /// The flat plane of the face.
    pub fn plane(&self) -> &Perspective {
        &self.plane
    }
}

impl PlaneMapping for CubeFace {
    fn size(&self) -> [u32; 2] {
        self.plane.size()
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        self.plane.pixel_from_direction(direction)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        self.plane.direction_from_pixel(pixel)
    }

    fn contains(&self, x: u32, y: u32) -> bool {
        self.plane.contains(x, y)
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        self.plane.solid_angle_sr(x, y)
    }

    fn light_with_neighbours(&self, direction: DVec3, light: &dyn Fn(&dyn PlaneMapping, DVec3) -> f64) -> Option<f64> {
        let in_cube = self.face.axes() * direction;
        Some(Face::ALL.into_iter().map(|face| light(&Self { face, ..*self }, face.axes().transpose() * in_cube)).sum())
    }

    /// Use the extent on the face that contains the direction, so that all faces draw the same star.
    fn pixel_extent_rad(&self, direction: DVec3) -> Option<[f64; 2]> {
        self.plane.pixel_extent_rad(DVec3::new(0.0, 0.0, -direction.abs().max_element()))
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        self.plane.bounding_cone(margin_px)
    }

    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.plane.pixel_from_direction(direction) else { return Vec::new() };
        let footprint = kernel(centre);
        let mut taps: Vec<Tap> = footprint.iter().filter_map(|&tap| self.tap_inside(tap)).collect();
        if taps.len() == footprint.len() || taps.is_empty() {
            return taps;
        }
        // The kernel crosses an edge: sum the weights that lie inside the pictures of all six faces, rendered or not.
        let in_cube = self.face.axes() * direction;
        let total: f64 = Face::ALL
            .into_iter()
            .filter_map(|face| self.plane.pixel_from_direction(face.axes().transpose() * in_cube))
            .flat_map(kernel)
            .filter_map(|tap| self.tap_inside(tap))
            .map(|tap| tap.weight)
            .sum();
        for tap in &mut taps {
            tap.weight /= total;
        }
        taps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn face_orientations_match_the_conventions() {
        let looks_at = |face: Face| face.cube_from_face() * DVec3::NEG_Z;
        let top = |face: Face| face.cube_from_face() * DVec3::Y;
        for (face, forward, up) in [
            (Face::Front, DVec3::NEG_Z, DVec3::Y),
            (Face::Right, DVec3::X, DVec3::Y),
            (Face::Left, DVec3::NEG_X, DVec3::Y),
            (Face::Back, DVec3::Z, DVec3::Y),
            (Face::Up, DVec3::Y, DVec3::Z),
            (Face::Down, DVec3::NEG_Y, DVec3::NEG_Z),
        ] {
            assert!((looks_at(face) - forward).length() < 1e-12, "{face:?}");
            assert!((top(face) - up).length() < 1e-12, "{face:?}");
        }
    }

    #[test]
    fn six_faces_cover_the_sphere() {
        let face = CubeFace::new(Face::Front, 64).unwrap();
        let sum: f64 = (0..64).flat_map(|y| (0..64).map(move |x| (x, y))).map(|(x, y)| face.solid_angle_sr(x, y)).sum();
        assert!((6.0 * sum / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-12);
    }
}

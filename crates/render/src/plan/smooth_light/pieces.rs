//! A map of the sky in pieces: small flat pictures, each around its own direction, fixed in the world. A narrow view needs few of them, so their
//! texels may be smaller than those of pictures of the whole sky. While the camera turns, only pieces that come into view are drawn.
//!
//! A face of a cube around the camera is divided into `per_edge` by `per_edge` pieces by lines of constant [`edge_from_tangent`] of the two tangents.
//! Such a piece is a quadrilateral with straight edges in its own flat picture. Each picture has texels of one of several sizes, because pixels at
//! the edge of a flat view are smaller than at its centre. Shader: `shaders/shared/sky_pieces.wgsl`.

use glam::{DMat3, DVec2, DVec3};

use crate::{sky_pictures::world_from_face, view::projection::BoundingCone};

/// Greatest side of a picture, texels.
pub const PIECE_SIDE: u32 = 512;
/// Greatest number of pieces along the edge of a face.
pub const MOST_PER_EDGE: u32 = 256;
/// Width of the margin around a piece, texels. Each part of 8 by 8 pixels of a plain block reads the piece at its middle. So the piece is read for
/// pixels up to 5.7 pixels outside it. In texels, this distance is multiplied by 1.25 (largest size of pixels relative to the finest view), by the
/// factor of [`LEVELS_READ`] levels, and by 2.23 (texels per pixel, at most). Two texels are added for the tent and rounding, and two for blur.
const MARGIN_TEXELS: f64 = 31.0;
/// Number of levels per doubling of the size of texels.
const LEVELS_PER_OCTAVE: f64 = 8.0;
/// The coarsest level.
const COARSEST_LEVEL: u8 = 24;
/// A picture is read if its level differs by at most this from the wanted one. The error of the brightest star of a map is then less than a code.
const LEVELS_READ: f32 = 6.0;
/// If the level of a picture differs by more than this from the wanted one, the picture is drawn again when there is time.
const LEVELS_KEPT: f32 = 0.75;
/// Number of steps per doubling of the size of the finest texels. Sizes change in steps so that they seldom change during a zoom.
pub const SIZES_PER_OCTAVE: f64 = 16.0;
/// Parameter of the division of a face that makes pieces nearly equally large.
pub const PIECE_EVENNESS: f64 = 0.4;

/// A division of the sky into pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceGrid {
    /// Pieces along the edge of a face.
    pub per_edge: u32,
    /// Tangent of the angle of the finest texels at the centre of a picture.
    pub texel: f64,
}

/// A picture of the sky that a frame reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedPicture {
    /// Number of the picture.
    pub number: u32,
    /// Level of its texels: 0 are the finest ones.
    pub level: f32,
}

/// A picture of the sky that is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkyPicture {
    /// Number of the picture.
    pub number: u32,
    /// Level of its texels.
    pub level: u8,
}

impl WantedPicture {
    /// The picture that is drawn for this wanted one.
    pub fn drawn(&self) -> SkyPicture {
        SkyPicture { number: self.number, level: self.level.round() as u8 }
    }

    /// Whether a picture of the same number with texels of this level may be read.
    pub fn accepts(&self, level: u8) -> bool {
        self.off_by(level) <= LEVELS_READ
    }

    /// Whether a picture with texels of this level is as good as a newly drawn one.
    pub fn keeps(&self, level: u8) -> bool {
        self.off_by(level) <= LEVELS_KEPT
    }

    /// Difference of this level from the wanted one.
    pub fn off_by(&self, level: u8) -> f32 {
        (f32::from(level) - self.level).abs()
    }
}

/// The picture of a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceFrame {
    /// Columns: right, up, and backwards, world axes.
    pub world_from_piece: DMat3,
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Tangent of the angle of a texel at its centre.
    pub texel: f64,
}

/// Converts the tangent of an angle to a coordinate on a face, from -1 to 1.
fn edge_from_tangent(tangent: f64) -> f64 {
    tangent * (1.0 + PIECE_EVENNESS) / (1.0 + PIECE_EVENNESS * tangent.abs())
}

/// The inverse of [`edge_from_tangent`].
fn tangent_from_edge(edge: f64) -> f64 {
    edge / (1.0 + PIECE_EVENNESS - PIECE_EVENNESS * edge.abs())
}

/// A cone that contains a quadrilateral on a face. Its edges are great circles, so no point is farther from the middle than a corner.
fn cone_around(corners: &[DVec3; 4]) -> BoundingCone {
    let axis = corners.iter().sum::<DVec3>().normalize();
    let half_angle_rad = corners.map(|corner| axis.angle_between(corner)).into_iter().fold(0.0, f64::max);
    BoundingCone { axis, half_angle_rad: half_angle_rad + 1e-9 }
}

impl PieceGrid {
    /// The division into the fewest pieces with texels of about this angle, rad; `None` if there would be too many pieces.
    pub fn of_texels(texel_rad: f64) -> Option<Self> {
        let texel = ((texel_rad.log2() * SIZES_PER_OCTAVE).round() / SIZES_PER_OCTAVE).exp2();
        // A piece at the centre of a face is nearly a square.
        let at_centre = 2.0 * tangent_from_edge(1.0) / (1.0 + PIECE_EVENNESS) / (f64::from(PIECE_SIDE) * texel);
        let fewest = at_centre.max(1.0).floor();
        (texel > 0.0 && fewest <= f64::from(MOST_PER_EDGE)).then_some(())?;
        (fewest as u32..=MOST_PER_EDGE).map(|per_edge| Self { per_edge, texel }).find(Self::fits)
    }

    /// Whether the pictures of all pieces are within the limit of their size. The largest ones are at the corners of a face, in the middle of its
    /// edges, or at its centre.
    fn fits(&self) -> bool {
        let [middle, end] = [self.per_edge / 2, self.per_edge - 1];
        [[end, end], [middle, end], [end, middle], [middle, middle]].into_iter().all(|[column, row]| {
            let picture = SkyPicture { number: row * self.per_edge + column, level: 0 };
            self.frame(picture).size.iter().all(|side| *side <= PIECE_SIDE)
        })
    }

    /// The wanted picture of a piece, with texels of about this angle, rad.
    pub fn wanted(&self, number: u32, texel_rad: f64) -> WantedPicture {
        let level = LEVELS_PER_OCTAVE * (texel_rad / self.texel).log2();
        WantedPicture { number, level: level.clamp(0.0, f64::from(COARSEST_LEVEL)) as f32 }
    }

    /// Number of pieces of the sky.
    pub fn pieces(&self) -> u32 {
        6 * self.per_edge * self.per_edge
    }

    /// Number of the piece that contains a direction (not 0), world axes.
    pub fn piece_of(&self, towards: DVec3) -> u32 {
        let axis = towards.abs().max_position();
        let sign = 1_f64.copysign(towards[axis]);
        let tangents = DVec2::new(sign * towards[(axis + 2) % 3], -towards[(axis + 1) % 3]) / towards[axis].abs();
        let place = tangents.to_array().map(|tangent| {
            let along = 0.5 * (edge_from_tangent(tangent) + 1.0) * f64::from(self.per_edge);
            (along as u32).min(self.per_edge - 1)
        });
        let face = axis as u32 + if sign < 0.0 { 3 } else { 0 };
        (face * self.per_edge + place[1]) * self.per_edge + place[0]
    }

    /// The direction of a position on a face, given as column and row in pieces. Not a unit vector.
    fn direction(&self, face: u32, column: f64, row: f64) -> DVec3 {
        let tangent = |along: f64| tangent_from_edge(2.0 * along / f64::from(self.per_edge) - 1.0);
        world_from_face(face) * DVec3::new(tangent(column), -tangent(row), -1.0)
    }

    /// Face, column and row of a piece.
    fn place(&self, number: u32) -> (u32, f64, f64) {
        let column = number % self.per_edge;
        let row = number / self.per_edge % self.per_edge;
        (number / self.per_edge / self.per_edge, f64::from(column), f64::from(row))
    }

    /// The corners of a piece in order, unit vectors.
    pub fn corners(&self, number: u32) -> [DVec3; 4] {
        let (face, column, row) = self.place(number);
        self.corners_of(face, [column, row], [column + 1.0, row + 1.0])
    }

    /// The corners of a rectangle of pieces between two positions, unit vectors.
    fn corners_of(&self, face: u32, [left, top]: [f64; 2], [right, bottom]: [f64; 2]) -> [DVec3; 4] {
        [[left, top], [right, top], [right, bottom], [left, bottom]]
            .map(|[column, row]| self.direction(face, column, row).normalize())
    }

    /// A cone that contains a piece.
    pub fn cone(&self, number: u32) -> BoundingCone {
        cone_around(&self.corners(number))
    }

    /// Numbers of the pieces that may be visible, ascending. Rectangles of pieces are halved as long as their cone may be visible. The result
    /// contains at least all visible pieces.
    pub fn pieces_where(&self, may_see: impl Fn(BoundingCone) -> bool) -> Vec<u32> {
        let mut found = Vec::new();
        let mut rectangles: Vec<(u32, [u32; 2], [u32; 2])> =
            (0..6).map(|face| (face, [0; 2], [self.per_edge; 2])).collect();
        while let Some((face, from, to)) = rectangles.pop() {
            let corners = self.corners_of(face, from.map(f64::from), to.map(f64::from));
            if !may_see(cone_around(&corners)) {
                continue;
            }
            let size = [to[0] - from[0], to[1] - from[1]];
            if size == [1; 2] {
                found.push((face * self.per_edge + from[1]) * self.per_edge + from[0]);
                continue;
            }
            // Halve the longer side.
            let side = usize::from(size[1] > size[0]);
            let middle = from[side] + size[side] / 2;
            let (mut first_to, mut second_from) = (to, from);
            (first_to[side], second_from[side]) = (middle, middle);
            rectangles.extend([(face, from, first_to), (face, second_from, to)]);
        }
        found.sort_unstable();
        found
    }

    /// The picture of a piece, whose axes are along the columns and rows of the face.
    pub fn frame(&self, SkyPicture { number, level }: SkyPicture) -> PieceFrame {
        let texel = self.texel * (f64::from(level) / LEVELS_PER_OCTAVE).exp2();
        let (face, column, row) = self.place(number);
        let backward = -self.direction(face, column + 0.5, row + 0.5).normalize();
        let along = self.direction(face, column + 0.75, row + 0.5) - self.direction(face, column + 0.25, row + 0.5);
        let right = along.reject_from_normalized(backward).normalize();
        let world_from_piece = DMat3::from_cols(right, backward.cross(right), backward);
        let most = self.corners(number).map(|corner| {
            let in_piece = world_from_piece.transpose() * corner;
            DVec2::new(in_piece.x, in_piece.y).abs() / -in_piece.z
        });
        let most = most.into_iter().fold(DVec2::ZERO, DVec2::max) / texel + MARGIN_TEXELS;
        PieceFrame { world_from_piece, size: most.to_array().map(|half| 2 * half.ceil() as u32), texel }
    }
}

impl PieceFrame {
    /// Position of a direction in the picture, texels: the centre of the first texel is at 0.5.
    #[cfg(test)]
    fn texel_of(&self, towards: DVec3) -> DVec2 {
        let in_piece = self.world_from_piece.transpose() * towards;
        let [width, height] = self.size.map(f64::from);
        0.5 * DVec2::new(width, height) + DVec2::new(in_piece.x, -in_piece.y) / -in_piece.z / self.texel
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// Directions everywhere on a sphere.
    fn directions(count: u32) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        })
    }

    #[test]
    fn every_direction_is_inside_the_picture_of_its_piece() {
        for texel_rad in [3e-2, 3.8e-4, 1e-4] {
            let grid = PieceGrid::of_texels(texel_rad).unwrap();
            let mut least = f64::INFINITY;
            for (index, towards) in directions(20_000).enumerate() {
                let number = grid.piece_of(towards);
                assert!(number < grid.pieces());
                let frame = grid.frame(SkyPicture { number, level: (index % 25) as u8 });
                let texel = frame.texel_of(towards);
                let [width, height] = frame.size.map(f64::from);
                let inside = texel.min(DVec2::new(width, height) - texel).min_element();
                least = least.min(inside);
                assert!(grid.cone(number).axis.angle_between(towards) <= grid.cone(number).half_angle_rad);
            }
            assert!(least >= MARGIN_TEXELS - 1e-6, "{texel_rad}: {least}");
        }
    }

    #[test]
    fn pieces_are_found_by_the_cones_of_rectangles() {
        for per_edge in [1, 2, 3, 7, 20] {
            let grid = PieceGrid { per_edge, texel: 2e-3 };
            for (towards, radius_rad) in directions(30).zip([0.01, 0.1, 0.5, 1.5].into_iter().cycle()) {
                let sees = |cone: BoundingCone| cone.axis.angle_between(towards) <= cone.half_angle_rad + radius_rad;
                let found = grid.pieces_where(sees);
                assert!(found.is_sorted() && found.iter().all(|number| sees(grid.cone(*number))));
                let seen = directions(2000).filter(|place| place.angle_between(towards) <= radius_rad);
                assert!(seen.map(|place| grid.piece_of(place)).all(|number| found.contains(&number)), "{grid:?}");
                assert!(found.contains(&grid.piece_of(towards)));
            }
        }
    }

    #[test]
    fn pictures_are_within_their_limit_and_well_filled() {
        for texel_rad in [8e-4, 3.8e-4, 1.5e-4] {
            let grid = PieceGrid::of_texels(texel_rad).unwrap();
            assert!((grid.texel / texel_rad - 1.0).abs() < 0.022, "{grid:?}");
            let frames = (0..grid.pieces()).map(|number| grid.frame(SkyPicture { number, level: 0 }));
            let texels: u64 = frames
                .map(|frame| {
                    assert!(frame.size.iter().all(|side| *side <= PIECE_SIDE), "{frame:?}");
                    u64::from(frame.size[0]) * u64::from(frame.size[1])
                })
                .sum();
            // Ratio of the number of texels of all pictures to the number that the sky itself would need.
            let ratio = texels as f64 * grid.texel.powi(2) / (4.0 * std::f64::consts::PI);
            assert!((1.0..1.9).contains(&ratio), "{grid:?}: {ratio}");
        }
        assert_eq!(PieceGrid::of_texels(1e-6), None);
        assert_eq!(PieceGrid::of_texels(0.0), None);
    }

    #[test]
    fn a_picture_is_kept_while_its_texels_have_about_the_right_size() {
        let grid = PieceGrid { per_edge: 5, texel: 2e-3 };
        let wanted = grid.wanted(9, 2.83e-3);
        assert_eq!(wanted.drawn(), SkyPicture { number: 9, level: 4 });
        assert!((grid.frame(wanted.drawn()).texel / 2e-3 - 2.0_f64.sqrt()).abs() < 1e-9);
        assert!(wanted.keeps(4) && !wanted.keeps(3) && !wanted.keeps(5));
        assert!(grid.wanted(9, 2.72e-3).keeps(3) && grid.wanted(9, 2.72e-3).keeps(4));
        assert!(wanted.accepts(0) && wanted.accepts(10) && !wanted.accepts(11));
        assert_eq!([1e-9, 1.0].map(|texel_rad| grid.wanted(9, texel_rad).drawn().level), [0, 24]);
    }

    #[test]
    fn a_piece_is_a_right_handed_picture_that_looks_outwards() {
        let grid = PieceGrid { per_edge: 5, texel: 2e-3 };
        for number in 0..grid.pieces() {
            let PieceFrame { world_from_piece, .. } = grid.frame(SkyPicture { number, level: 3 });
            assert!((world_from_piece.determinant() - 1.0).abs() < 1e-12);
            assert_eq!(grid.piece_of(-world_from_piece.z_axis), number);
        }
    }
}

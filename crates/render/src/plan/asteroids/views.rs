//! Properties of a picture for culling and detail: its borders, the size of its pixels in each direction, and the curvature of
//! images of straight edges.
//!
//! Pixel size and bend depend on the direction. Both are tabulated as functions of s = sin(t / 2), where t is the angle from the optical axis, or
//! from the zenith for equirectangular pictures. The pixel size is the finer side of a pixel, in rad. The bend is the norm of the second derivative
//! of the pixel position along a great circle, px/rad^2. It is computed by central differences, and the greatest value of all directions is used: an
//! edge of angular length h that is drawn as a straight line deviates from its true image by at most h^2 / 8 times the bend. In flat pictures it is
//! 0.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};

use super::{bounds::impostor_distances, settings::AsteroidSettings};
use crate::{
    plan::stars::cull::edge_planes,
    view::{
        Viewport,
        projection::{Face, PlaneMapping, Projection},
    },
};

/// Steps of a table, which has one entry more.
pub const TABLE_STEPS: usize = 64;

/// Value of an unbounded bend, px/rad^2.
pub const UNBOUNDED_BEND: f64 = 1e30;

/// Coordinate of a picture's directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// A plane: straight edges stay straight.
    Flat,
    /// Around the optical axis.
    Round,
    /// Longitude and latitude.
    Longitude,
}

/// Pixel sizes and bends by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionTable {
    /// Finer side of a pixel, rad, at s = i / [`TABLE_STEPS`].
    pub pixel_rad: Vec<f64>,
    /// Bend, px/rad^2.
    pub bend: Vec<f64>,
    /// The shortest of the longer sides of the picture's pixels, rad.
    pub needed_rad: f64,
}

/// Distance from which an impostor may replace a mesh. For an asteroid within a sphere of radius R (m), with the angle p of a pixel divided by the
/// quality (rad), it is the greatest of sqrt(2 b R / p), `linear` R / p and R p^-`exponent`; `bounds` has the derivation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpostorReach {
    /// b, distance between the eyes, m, for the disparity.
    pub eyes_m: f64,
    /// Factor for the resolution of the tiles and the error of their direction.
    pub linear: f64,
    /// Exponent for parallel instead of central projection.
    pub exponent: f64,
}

/// Bounds of a picture for culling and detail.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureBounds {
    /// Coordinate of directions.
    pub kind: PictureKind,
    /// Rotation from world to view axes.
    pub view_from_world: DMat3,
    /// Eye minus camera, world axes, m.
    pub eye_m: DVec3,
    /// Inward normals of the planes through the eye and the edges, view axes; empty for pictures that are not flat.
    pub planes: Vec<DVec3>,
    /// Sine and cosine of the half angle of the cone around -z that contains the picture.
    pub cone: [f64; 2],
    /// Pixel sizes and bends.
    pub table: std::sync::Arc<DirectionTable>,
    /// Distances of impostors; `None`: there are none.
    pub impostor: Option<ImpostorReach>,
}

/// Position of a direction in the tables: s, from the cosine of its angle.
pub fn table_place(cosine: f64) -> f64 {
    (0.5 * (1.0 - cosine)).clamp(0.0, 1.0).sqrt()
}

impl DirectionTable {
    /// The table of a projection.
    pub fn new(projection: &Projection) -> Self {
        let nodes = (0..=TABLE_STEPS).map(|step| 2.0 * (step as f64 / TABLE_STEPS as f64).asin());
        let mapping = projection.mapping();
        let [width, height] = mapping.size().map(f64::from);
        match projection {
            Projection::Perspective(_) | Projection::CubeFace(_) => {
                let corner = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]]
                    .iter()
                    .filter_map(|[x, y]| mapping.direction_from_pixel(DVec2::new(*x, *y)))
                    .map(|direction| direction.angle_between(DVec3::NEG_Z))
                    .fold(0.0, f64::max);
                let pixel_rad = nodes.map(|angle| finest_pixel_rad(mapping, angle.min(corner))).collect();
                Self { pixel_rad, bend: vec![0.0; TABLE_STEPS + 1], needed_rad: projection.middle_pixel_rad() }
            }
            Projection::Fisheye(fisheye) => {
                let pixel_rad =
                    nodes.clone().map(|angle| finest_pixel_rad(mapping, angle.min(fisheye.half_fov_rad))).collect();
                let place = |angle: f64| DVec3::new(angle.sin(), 0.0, -angle.cos());
                let longer = nodes
                    .clone()
                    .filter(|angle| *angle <= fisheye.half_fov_rad)
                    .filter_map(|angle| mapping.pixel_extent_rad(place(angle)).map(|[longer, _]| longer));
                let needed_rad = longer.fold(f64::INFINITY, f64::min);
                Self { pixel_rad, bend: nodes.map(|angle| bend(mapping, place(angle))).collect(), needed_rad }
            }
            Projection::Equirectangular(_) => {
                // Towards the poles pixels become ever narrower, but there neighbouring pixels show almost the same direction: use the size at the
                // equator.
                let pixel = (PI / height).min(TAU / width);
                let place = |angle: f64| DVec3::new(0.0, angle.cos(), -angle.sin());
                Self {
                    pixel_rad: vec![pixel; TABLE_STEPS + 1],
                    bend: nodes.map(|angle| bend(mapping, place(angle))).collect(),
                    needed_rad: (PI / height).max(TAU / width),
                }
            }
            Projection::Tabulated(table) => {
                // Pixels of any size may occur in any direction: use the smallest size. Edges always cross faces.
                let [shortest_rad, needed_rad] = table.finest_pixel_rad();
                let entries = TABLE_STEPS + 1;
                Self { pixel_rad: vec![shortest_rad; entries], bend: vec![UNBOUNDED_BEND; entries], needed_rad }
            }
        }
    }

    /// Finer side of a pixel at a position, rad, interpolated.
    pub fn pixel_rad_at(&self, place: f64) -> f64 {
        let x = place.clamp(0.0, 1.0) * TABLE_STEPS as f64;
        let i = (x as usize).min(TABLE_STEPS - 1);
        let f = x - i as f64;
        self.pixel_rad[i] * (1.0 - f) + self.pixel_rad[i + 1] * f
    }

    /// The greatest bend within `reach` of a position, from the table entries around both ends and the centre of that range.
    pub fn bend_around(&self, place: f64, reach: f64) -> f64 {
        [place - reach, place, place + reach].map(|place| self.bend_beside(place)).into_iter().fold(0.0, f64::max)
    }

    /// The greatest bend within `reach` of a position, from all table entries in that range.
    pub fn bend_around_all(&self, place: f64, reach: f64) -> f64 {
        let entry = |place: f64| place.clamp(0.0, 1.0) * TABLE_STEPS as f64;
        let last = (entry(place + reach).ceil() as usize).min(TABLE_STEPS);
        self.bend[entry(place - reach) as usize..=last].iter().copied().fold(0.0, f64::max)
    }

    fn bend_beside(&self, place: f64) -> f64 {
        let i = ((place.clamp(0.0, 1.0) * TABLE_STEPS as f64) as usize).min(TABLE_STEPS - 1);
        self.bend[i].max(self.bend[i + 1])
    }

    /// Finest and coarsest pixel, rad.
    pub fn pixel_range_rad(&self) -> [f64; 2] {
        let range = |[low, high]: [f64; 2], p: &f64| [low.min(*p), high.max(*p)];
        self.pixel_rad.iter().fold([f64::INFINITY, 0.0], range)
    }
}

/// The finest side of a pixel at an angle from the axis: the least of all directions at that angle.
fn finest_pixel_rad(mapping: &dyn PlaneMapping, angle: f64) -> f64 {
    (0..8)
        .filter_map(|step| {
            let (sin, cos) = (f64::from(step) / 8.0 * TAU).sin_cos();
            let direction = DVec3::new(angle.sin() * cos, angle.sin() * sin, -angle.cos());
            mapping.pixel_extent_rad(direction).map(|[_, shorter]| shorter)
        })
        .fold(f64::INFINITY, f64::min)
        .min(1.0)
}

/// Norm of the second derivative of the pixel position along great circles through a direction, px/rad^2.
fn bend(mapping: &dyn PlaneMapping, direction: DVec3) -> f64 {
    const STEP: f64 = 1e-3;
    let (right, up) = direction.any_orthonormal_pair();
    let (sin_step, cos_step) = STEP.sin_cos();
    (0..8)
        .map(|step| {
            let (sin, cos) = (f64::from(step) / 8.0 * PI).sin_cos();
            let along = right * cos + up * sin;
            let pixel_at = |side: f64| mapping.pixel_from_direction(direction * cos_step + along * (side * sin_step));
            match (pixel_at(-1.0), mapping.pixel_from_direction(direction), pixel_at(1.0)) {
                (Some(before), Some(here), Some(after)) => {
                    ((before + after - here * 2.0).length() / (STEP * STEP)).min(UNBOUNDED_BEND)
                }
                _ => UNBOUNDED_BEND,
            }
        })
        .fold(0.0, f64::max)
}

impl PictureBounds {
    /// Bounds of a viewport with its table. Points reach over its border, so asteroids up to `margin_px` outside count as visible.
    pub fn new(
        viewport: &Viewport,
        margin_px: f64,
        table: std::sync::Arc<DirectionTable>,
        impostor: Option<ImpostorReach>,
    ) -> Self {
        let cone = viewport.projection.mapping().bounding_cone(margin_px);
        let half_angle_rad = match viewport.projection {
            Projection::Tabulated(_) => cone.around_view_axis_rad(),
            _ => cone.half_angle_rad,
        };
        let (sin, cos) = half_angle_rad.sin_cos();
        Self {
            kind: match viewport.projection {
                Projection::Perspective(_) | Projection::CubeFace(_) => PictureKind::Flat,
                Projection::Fisheye(_) | Projection::Tabulated(_) => PictureKind::Round,
                Projection::Equirectangular(_) => PictureKind::Longitude,
            },
            view_from_world: DMat3::from_quat(viewport.world_from_view.conjugate()),
            eye_m: viewport.eye_offset_m,
            planes: edge_planes(&viewport.projection, margin_px),
            cone: [sin.max(0.0), cos],
            table,
            impostor,
        }
    }

    /// Whether a sphere may be visible. Its centre is in view axes, relative to the eye. Never false for a visible sphere.
    pub fn touches(&self, middle: DVec3, radius: f64) -> bool {
        if self.kind == PictureKind::Flat {
            return self.planes.iter().all(|normal| normal.dot(middle) >= -radius);
        }
        // Compare the radius with the distance of the centre from the cone's surface, in the half plane of axis and centre. Behind the apex the true
        // distance is greater.
        let [sin, cos] = self.cone;
        middle.x.hypot(middle.y) * cos + middle.z * sin <= radius
    }

    /// Position of a direction (any length but 0) in the table.
    pub fn place_of(&self, direction: DVec3, distance: f64) -> f64 {
        let along = if self.kind == PictureKind::Longitude { direction.y } else { -direction.z };
        table_place(along / distance)
    }

    /// Whether a sphere crosses the seam of an equirectangular picture.
    pub fn crosses_seam(&self, middle: DVec3, radius: f64) -> bool {
        self.kind == PictureKind::Longitude && middle.x.abs() <= radius && middle.z > -radius
    }
}

/// Whether a sphere may touch a face of the cube around view axes, according to the planes through the eye and the edges of the face.
pub fn touches_face(face: Face, middle: DVec3, radius: f64) -> bool {
    let [right, up, back] = [0, 1, 2].map(|column| face.axes().col(column).dot(middle));
    let reach = radius * std::f64::consts::SQRT_2 * (1.0 + 1e-4);
    -back + reach >= right.abs() && -back + reach >= up.abs()
}

/// Greatest distance between this viewport's eye and the eyes of the other viewports of the same view, m; 0 if they have the same position.
pub fn eye_distance_m(viewports: &[Viewport], of: &Viewport) -> f64 {
    let others = viewports.iter().filter(|viewport| viewport.view == of.view);
    others.map(|viewport| (viewport.eye_offset_m - of.eye_offset_m).length()).fold(0.0, f64::max)
}

/// Parameters of the distances of impostors; `None`: there are no impostors. See [`nearest_distance_m`](super::bounds::nearest_distance_m).
pub fn impostor_reach(settings: &AsteroidSettings, eyes_m: f64) -> Option<ImpostorReach> {
    if settings.finest_only {
        return None;
    }
    // The distances for a radius of one metre and a pixel of one radian are the factors.
    let of_one = impostor_distances(settings.impostor, settings, 1.0, 1.0, eyes_m, 1.0)?;
    let smaller = impostor_distances(settings.impostor, settings, 1.0, 0.5, eyes_m, 1.0)?;
    Some(ImpostorReach {
        eyes_m,
        linear: of_one.resolution_m.max(of_one.direction_m),
        exponent: (smaller.perspective_m / of_one.perspective_m).log2(),
    })
}

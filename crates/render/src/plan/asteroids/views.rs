//! What culling and detail have to know of a picture: where it ends, how fine its pixels are in each direction, and how much it bends
//! a straight edge.
//!
//! Pixels and bends depend on the direction. Both stand in a table over s = sin(t / 2), where t is the angle from the optical axis, of
//! equirectangular pictures that from the zenith. The pixel is the finer side of what a pixel covers, in rad; the bend is the norm of the
//! second derivative of the pixel along a great circle, px/rad^2, the greatest of all directions, by central differences: an edge
//! of angular length h that is drawn straight misses its image by at most h^2 / 8 times the bend. In flat pictures it is 0.

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

/// Steps of a table; it has one entry more.
pub const TABLE_STEPS: usize = 64;

/// What stands for a bend beyond all bounds, px/rad^2.
pub const UNBOUNDED_BEND: f64 = 1e30;

/// How a picture's directions are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// A plane: straight edges stay straight.
    Flat,
    /// Around the optical axis.
    Round,
    /// Longitude and latitude.
    Longitude,
}

/// Pixels and bends by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionTable {
    /// Finer side of a pixel, rad, at s = i / [`TABLE_STEPS`].
    pub pixel_rad: Vec<f64>,
    /// Bend, px/rad^2.
    pub bend: Vec<f64>,
    /// The finest of the longer sides of the picture's pixels, rad.
    pub needed_rad: f64,
}

/// From where on an impostor may stand in for a mesh: of an asteroid that a sphere of radius R (m) holds, where a pixel over the
/// quality is p (rad), from the greatest of sqrt(2 b R / p), linear R / p and R p^-exponent on; `bounds` has the reasons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpostorReach {
    /// b, distance of the eyes, m: their disparity.
    pub eyes_m: f64,
    /// Of the tiles' resolution and the error of their direction.
    pub linear: f64,
    /// Of parallel instead of central projection.
    pub exponent: f64,
}

/// A picture as culling and detail see it.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureBounds {
    /// How directions are counted.
    pub kind: PictureKind,
    /// Rotation from world to view axes.
    pub view_from_world: DMat3,
    /// Eye minus camera, world axes, m.
    pub eye_m: DVec3,
    /// Inward normals of the planes through the eye and the edges, view axes; none if it is not flat.
    pub planes: Vec<DVec3>,
    /// Sine and cosine of the half angle of the cone around -z that holds the picture.
    pub cone: [f64; 2],
    /// Pixels and bends.
    pub table: std::sync::Arc<DirectionTable>,
    /// Where impostors begin; `None`: nowhere.
    pub impostor: Option<ImpostorReach>,
}

/// Place of a direction in the tables: s of the cosine of its angle.
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
                // Towards the poles pixels grow ever narrower, but neighbours then show the same place on the sky.
                let pixel = (PI / height).min(TAU / width);
                let place = |angle: f64| DVec3::new(0.0, angle.cos(), -angle.sin());
                Self {
                    pixel_rad: vec![pixel; TABLE_STEPS + 1],
                    bend: nodes.map(|angle| bend(mapping, place(angle))).collect(),
                    needed_rad: (PI / height).max(TAU / width),
                }
            }
            Projection::Tabulated(table) => {
                // Pixels are of any size in any direction: the finest of all stands for each. Edges always go through faces.
                let [shortest_rad, needed_rad] = table.finest_pixel_rad();
                let entries = TABLE_STEPS + 1;
                Self { pixel_rad: vec![shortest_rad; entries], bend: vec![UNBOUNDED_BEND; entries], needed_rad }
            }
        }
    }

    /// Finer side of a pixel at a place, rad: interpolated.
    pub fn pixel_rad_at(&self, place: f64) -> f64 {
        let x = place.clamp(0.0, 1.0) * TABLE_STEPS as f64;
        let i = (x as usize).min(TABLE_STEPS - 1);
        let f = x - i as f64;
        self.pixel_rad[i] * (1.0 - f) + self.pixel_rad[i + 1] * f
    }

    /// The greatest bend within `reach` of a place: of the entries around both ends and the middle.
    pub fn bend_around(&self, place: f64, reach: f64) -> f64 {
        [place - reach, place, place + reach].map(|place| self.bend_beside(place)).into_iter().fold(0.0, f64::max)
    }

    /// The greatest bend within `reach` of a place, every entry looked at.
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

/// The finest side of a pixel at an angle from the axis, whatever the direction from there.
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

/// Norm of the second derivative of the pixel along great circles through a direction, px/rad^2.
fn bend(mapping: &dyn PlaneMapping, direction: DVec3) -> f64 {
    const STEP: f64 = 1e-3;
    let (right, up) = direction.any_orthonormal_pair();
    let (sin_step, cos_step) = STEP.sin_cos();
    (0..8)
        .map(|step| {
            let (sin, cos) = (f64::from(step) / 8.0 * PI).sin_cos();
            let along = right * cos + up * sin;
            let at = |side: f64| mapping.pixel_from_direction(direction * cos_step + along * (side * sin_step));
            match (at(-1.0), mapping.pixel_from_direction(direction), at(1.0)) {
                (Some(before), Some(here), Some(after)) => {
                    ((before + after - here * 2.0).length() / (STEP * STEP)).min(UNBOUNDED_BEND)
                }
                _ => UNBOUNDED_BEND,
            }
        })
        .fold(0.0, f64::max)
}

impl PictureBounds {
    /// A viewport with its table; asteroids up to `margin_px` outside of it count as seen: points reach over its border.
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

    /// Whether a sphere may be seen: its middle in view axes, relative to the eye. Never false for one that is.
    pub fn touches(&self, middle: DVec3, radius: f64) -> bool {
        if self.kind == PictureKind::Flat {
            return self.planes.iter().all(|normal| normal.dot(middle) >= -radius);
        }
        // Distance from the cone's surface in the half plane of the axis and the middle: beyond the apex it is more.
        let [sin, cos] = self.cone;
        middle.x.hypot(middle.y) * cos + middle.z * sin <= radius
    }

    /// Place of a direction (any length but 0) in the table.
    pub fn place_of(&self, direction: DVec3, distance: f64) -> f64 {
        let along = if self.kind == PictureKind::Longitude { direction.y } else { -direction.z };
        table_place(along / distance)
    }

    /// Whether a sphere reaches over the seam of an equirectangular picture.
    pub fn crosses_seam(&self, middle: DVec3, radius: f64) -> bool {
        self.kind == PictureKind::Longitude && middle.x.abs() <= radius && middle.z > -radius
    }
}

/// Whether a sphere touches a face of the cube around view axes, as far as the planes through its edges tell.
pub fn touches_face(face: Face, middle: DVec3, radius: f64) -> bool {
    let [right, up, back] = [0, 1, 2].map(|column| face.axes().col(column).dot(middle));
    let reach = radius * std::f64::consts::SQRT_2 * (1.0 + 1e-4);
    -back + reach >= right.abs() && -back + reach >= up.abs()
}

/// Greatest distance between the eyes that look from different places in one view, m: 0 for views of one eye.
pub fn eye_distance_m(viewports: &[Viewport], of: &Viewport) -> f64 {
    let others = viewports.iter().filter(|viewport| viewport.view == of.view);
    others.map(|viewport| (viewport.eye_offset_m - of.eye_offset_m).length()).fold(0.0, f64::max)
}

/// Where the impostors of a method begin; `None`: nowhere. It is [`nearest_distance_m`](super::bounds::nearest_distance_m) taken apart.
pub fn impostor_reach(settings: &AsteroidSettings, eyes_m: f64) -> Option<ImpostorReach> {
    if settings.finest_only {
        return None;
    }
    // Each of the distances for one metre and one radian is the factor in it.
    let of_one = impostor_distances(settings.impostor, settings, 1.0, 1.0, eyes_m, 1.0)?;
    let smaller = impostor_distances(settings.impostor, settings, 1.0, 0.5, eyes_m, 1.0)?;
    Some(ImpostorReach {
        eyes_m,
        linear: of_one.resolution_m.max(of_one.direction_m),
        exponent: (smaller.perspective_m / of_one.perspective_m).log2(),
    })
}

//! Projections: the mapping from directions in view space to the pixels of an image, and the solid angle of every
//! pixel.
//!
//! View space is +x right, +y up, looking along -z. Pixel coordinates are continuous: (0, 0) is the top left corner of
//! the image, pixel (i, j) covers [i, i+1) x [j, j+1), its centre is (i + 0.5, j + 0.5). Everything here is f64; the
//! shader `shaders/shared/projection.wgsl` has the same functions in f32 under the same names.
//!
//! A custom projection implements [`PlaneMapping`]; the f64 renderer in [`crate::reference`] accepts any
//! implementation. The GPU renderer uses a table of it: bake the table with [`TabulatedMapping::new`] and add it to a
//! rig as a view of kind [`ViewKind::Tabulated`](super::ViewKind::Tabulated). See `examples/own_projection.rs`.

mod cube;
mod equirectangular;
mod fisheye;
mod perspective;
mod tabulated;
mod warp;

use std::{f64::consts::PI, sync::Arc};

pub use cube::{CubeFace, Face};
pub use equirectangular::Equirectangular;
pub use fisheye::{Fisheye, FisheyeMapping};
use glam::{DVec2, DVec3};
pub use perspective::{MAX_EDGE_DEG, Perspective};
pub(crate) use tabulated::{
    DONE_PX, FRINGE, HEADER, LONGEST_STEP_PX, MOST_STEPS, NEAR_PX, NO_START, PATCH_BIT, PATCH_STEPS,
};
pub use tabulated::{LIMIT_PX, MOST_SIDE_PX, TableAccuracy, TabulatedMapping, TabulationError};
pub use warp::{Border, ContentShape, DirectionGrid, Interpolation, MOST_SAMPLES, Placement, Warp, WarpError};

/// Why a projection cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// A side of the image is zero.
    #[error("size {width} x {height}: both sides must be at least 1 pixel")]
    ZeroSize {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A parameter is outside the range that the mapping can show.
    #[error("{parameter} = {value}: {allowed}")]
    OutOfRange {
        /// The parameter's name in the configuration.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// Valid values, and the reason.
        allowed: &'static str,
    },
}

pub(crate) fn check_size(size: [u32; 2]) -> Result<(), ProjectionError> {
    if size[0] == 0 || size[1] == 0 {
        return Err(ProjectionError::ZeroSize { width: size[0], height: size[1] });
    }
    Ok(())
}

/// A part of the sky, used for culling: a cone around `axis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingCone {
    /// Unit vector; in view space for the part that can have an image.
    pub axis: DVec3,
    /// Half of the opening angle, rad; pi for the whole sphere.
    pub half_angle_rad: f64,
}

impl BoundingCone {
    /// Half of the opening angle of the smallest cone around the viewing axis (-z) that contains this one, rad.
    pub fn around_view_axis_rad(&self) -> f64 {
        (self.axis.angle_between(DVec3::NEG_Z) + self.half_angle_rad).min(PI)
    }
}

/// One pixel that a splat reaches, with its share of the kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Weight; the weights of a star whose kernel lies inside the picture sum to 1.
    pub weight: f64,
}

/// A map between directions in view space and the pixels of an image.
pub trait PlaneMapping: Sync {
    /// Width and height in pixels.
    fn size(&self) -> [u32; 2];

    /// Continuous pixel coordinates of the image of `direction` (any length but 0). Also defined outside of the
    /// picture, as far as the mapping continues; `None` if the direction has no image.
    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2>;

    /// Unit direction of a point of the image plane; `None` outside of the picture.
    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3>;

    /// Whether the pixel's centre lies inside the picture.
    fn contains(&self, x: u32, y: u32) -> bool {
        let [width, height] = self.size();
        x < width && y < height && self.direction_from_pixel(pixel_centre(x, y)).is_some()
    }

    /// Solid angle of a pixel in sr; 0 outside of the picture. The default takes the norm of d(dir)/du x d(dir)/dv at
    /// the pixel's centre, by central differences.
    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if !self.contains(x, y) {
            return 0.0;
        }
        let centre = pixel_centre(x, y);
        let h = 1e-3;
        let direction_at = |dx: f64, dy: f64| self.direction_from_pixel(centre + DVec2::new(dx, dy));
        match (direction_at(h, 0.0), direction_at(-h, 0.0), direction_at(0.0, h), direction_at(0.0, -h)) {
            (Some(right), Some(left), Some(down), Some(up)) => (right - left).cross(down - up).length() / (4.0 * h * h),
            _ => 0.0,
        }
    }

    /// Whether every direction lies in the picture, so that its rim is not a border.
    fn shows_full_sphere(&self) -> bool {
        false
    }

    /// Whether the mapping consists of flat facets with edges between them, at which it has no derivative.
    fn is_faceted(&self) -> bool {
        false
    }

    /// Sum of `light` over this picture and the pictures that continue it beyond its borders. `light` gets each picture and the direction in the axes
    /// of that picture. `None` if there are no such pictures.
    fn light_with_neighbours(&self, direction: DVec3, light: &dyn Fn(&dyn PlaneMapping, DVec3) -> f64) -> Option<f64> {
        let _ = (direction, light);
        None
    }

    /// The longer and the shorter angle that a pixel covers around `direction` (a unit vector), rad: the inverse
    /// singular values of the mapping's derivative. `None` if the direction has no image. The default uses central
    /// differences.
    fn pixel_extent_rad(&self, direction: DVec3) -> Option<[f64; 2]> {
        let (right, up) = direction.any_orthonormal_pair();
        let h = 1e-6;
        let derivative = |axis: DVec3| {
            let ahead = self.pixel_from_direction((direction + axis * h).normalize())?;
            let behind = self.pixel_from_direction((direction - axis * h).normalize())?;
            Some((ahead - behind) / (2.0 * h))
        };
        let (a, b) = (derivative(right)?, derivative(up)?);
        // Singular values of the matrix with columns a and b.
        let sum = a.length_squared() + b.length_squared();
        let difference = (sum * sum - 4.0 * a.perp_dot(b).powi(2)).max(0.0).sqrt();
        let (largest, smallest) = (((sum + difference) / 2.0).sqrt(), ((sum - difference) / 2.0).max(0.0).sqrt());
        Some([1.0 / smallest.max(1e-12), 1.0 / largest.max(1e-12)])
    }

    /// A cone that contains every direction that can affect a pixel, including kernels of `margin_px`.
    fn bounding_cone(&self, margin_px: f64) -> BoundingCone;

    /// The pixels that a star in `direction` reaches with `kernel`. They are exact at every border of the mapping: wrapped, reflected and shared
    /// edges. `kernel` returns the footprint around continuous pixel coordinates as if the plane had no border. Empty if the star has no image.
    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.pixel_from_direction(direction) else { return Vec::new() };
        kernel(centre).into_iter().filter_map(|tap| self.tap_inside(tap)).collect()
    }

    /// Returns the tap if its pixel lies inside the picture.
    fn tap_inside(&self, (x, y, weight): (i64, i64, f64)) -> Option<Tap> {
        let (x, y) = (u32::try_from(x).ok()?, u32::try_from(y).ok()?);
        self.contains(x, y).then_some(Tap { x, y, weight })
    }
}

/// A kernel's pixels (column, row, weight) around continuous pixel coordinates, on a plane without borders.
pub type Footprint<'a> = &'a dyn Fn(DVec2) -> Vec<(i64, i64, f64)>;

/// Centre of a pixel.
pub fn pixel_centre(x: u32, y: u32) -> DVec2 {
    DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)
}

/// The projections that the GPU supports.
#[derive(Clone, Debug, PartialEq)]
pub enum Projection {
    /// Flat image plane, symmetric or off-axis.
    Perspective(Perspective),
    /// One face of a cubemap.
    CubeFace(CubeFace),
    /// Azimuthal mappings of domes and fisheye lenses.
    Fisheye(Fisheye),
    /// Longitude and latitude.
    Equirectangular(Equirectangular),
    /// Any other projection, as a table.
    Tabulated(Arc<TabulatedMapping>),
}

impl Projection {
    /// The mapping of this projection.
    pub fn mapping(&self) -> &dyn PlaneMapping {
        match self {
            Projection::Perspective(p) => p,
            Projection::CubeFace(p) => p,
            Projection::Fisheye(p) => p,
            Projection::Equirectangular(p) => p,
            Projection::Tabulated(p) => &**p,
        }
    }

    /// Solid angle of the whole picture, sr: in closed form, or the sum over the pixels if the projection is a table. The sum over the pixels of a
    /// round picture differs from the closed form by the difference between a circle and its pixels (2e-7 at 4096 pixels).
    pub fn picture_solid_angle_sr(&self) -> f64 {
        match self {
            Projection::Perspective(plane) => plane.picture_solid_angle_sr(),
            Projection::CubeFace(face) => face.plane().picture_solid_angle_sr(),
            Projection::Fisheye(fisheye) => 4.0 * PI * (fisheye.half_fov_rad / 2.0).sin().powi(2),
            Projection::Equirectangular(_) => 4.0 * PI,
            Projection::Tabulated(table) => table.picture_solid_angle_sr(),
        }
    }

    /// Angular size of the pixel in the middle of the picture, rad: the square root of its solid angle. If a table has no pixel there, the size of
    /// the mean pixel is used.
    pub fn middle_pixel_rad(&self) -> f64 {
        let mapping = self.mapping();
        let [width, height] = mapping.size();
        let middle_sr = mapping.solid_angle_sr(width / 2, height / 2);
        match self {
            Projection::Tabulated(table) if middle_sr <= 0.0 => {
                (table.picture_solid_angle_sr() / table.pixels() as f64).sqrt()
            }
            _ => middle_sr.sqrt(),
        }
    }

    /// Smallest solid angle of a pixel of the picture, sr. Closed-form mappings have their extremes at the centre, the corners or the middles of the
    /// edges (half a pixel inside for round pictures), so only these are compared; for a table all pixels are compared.
    pub fn smallest_pixel_sr(&self) -> f64 {
        if let Projection::Tabulated(table) = self {
            return table.smallest_pixel_sr();
        }
        let mapping = self.mapping();
        let [width, height] = mapping.size();
        let mut smallest = f64::INFINITY;
        for y in [0, height / 2, height - 1] {
            for x in [0, width / 2, width - 1] {
                let omega = mapping.solid_angle_sr(x, y);
                if omega > 0.0 {
                    smallest = smallest.min(omega);
                }
            }
        }
        smallest
    }
}

/// Gauss-Legendre quadrature of `density` (per unit area of the plane) over a rectangle that is given by its centre and half sides. It uses three
/// points along each axis and is exact for polynomials of degree five.
pub(crate) fn integrate_over_rectangle(centre: DVec2, half: DVec2, density: impl Fn(DVec2) -> f64) -> f64 {
    const NODES: [(f64, f64); 3] =
        [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
    let mut sum = 0.0;
    for (u, weight_u) in NODES {
        for (v, weight_v) in NODES {
            sum += weight_u * weight_v * density(centre + DVec2::new(u, v) * half);
        }
    }
    sum * half.x * half.y
}

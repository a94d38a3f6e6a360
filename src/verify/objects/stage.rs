//! A stage for single asteroids. It has up to 64 asteroids, each in front of a separate eye. They are in front of a
//! bright wall or in the light of a sun.
//!
//! Black asteroids in front of a wall of 1 cd/m^2 show their silhouettes, by whichever method they are drawn: the
//! silhouette is the missing part of the wall. Every scene has the same number of fields, with the same instances and
//! shapes, so that atlases are baked only once.

use std::{
    f64::consts::PI,
    sync::{Arc, OnceLock},
};

use glam::{DQuat, DVec2, DVec3, Vec3};

use super::super::{
    context::{CheckError, Context, hdr_pixels, hdr_view, images},
    scenes::snapshot,
};
use crate::{
    metrics::{self, HdrView},
    photometry::rec709::luminance,
    plan::{
        asteroids::{
            classes::BAND,
            views::{DirectionTable, ImpostorReach, impostor_reach, table_place},
        },
        settings::AsteroidSettings,
    },
    render::{Frame, FrameImage},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        asteroids::{AsteroidField, Instances, Node, ShapeSet, packed::Asteroid},
        bodies::{Body, Emission, ReflectionLaw, Spin, Surface},
    },
    view::{
        Fov, Rig, ViewImage, ViewKind,
        projection::{PlaneMapping, Projection, pixel_centre},
    },
};

/// Mean radius of the asteroids, m.
pub const RADIUS_M: f64 = 1.0;
/// Maximum number of asteroids in a scene.
pub const PLACES: usize = 64;
/// Position of the camera: far from the origin, as in the Solar System.
const CAMERA_M: DVec3 = DVec3::new(1.3e11, -7e10, 2e10);
/// Distance of the wall, m, and its radius: it covers 70 degrees around -z.
const WALL_M: [f64; 2] = [1e10, 9.4e9];
/// Distance of the sun, m.
const SUN_M: f64 = 1e11;
/// Geometric albedo of lit asteroids.
pub const ALBEDO: f64 = 0.2;

/// Difference between the truth and the drawn objects. There is none unless a test makes a check fail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Factor on albedos.
    pub albedo: f64,
    /// Factor on the radii of bodies.
    pub radius: f64,
    /// Shift of asteroids to the right of the camera, mean radii.
    pub shift: f64,
}

impl Fault {
    /// No difference.
    pub const NONE: Self = Self { albedo: 1.0, radius: 1.0, shift: 0.0 };
}

/// An asteroid on the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posed {
    /// Position, camera axes, m.
    pub place_m: DVec3,
    /// Rotation from the shape's axes to those of the camera.
    pub camera_from_shape: DQuat,
}

/// Illumination of asteroids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Black in front of a wall that covers 70 degrees around -z.
    Wall,
    /// Grey in the light of a sun in this direction, camera axes.
    Sun(DVec3),
}

/// Returns a set with only the most elongated shape, because its orientation is the most visible.
pub fn shape() -> Arc<ShapeSet> {
    static SHAPE: OnceLock<Arc<ShapeSet>> = OnceLock::new();
    let longest = || {
        let mut set = all_shapes().as_ref().clone();
        set.shapes = set.shapes.pop().into_iter().collect();
        // The digest identifies a set, so this set needs a different one.
        set.digest = set.digest.rotate_left(17) ^ 1;
        Arc::new(set)
    };
    SHAPE.get_or_init(longest).clone()
}

/// Returns the procedural shapes.
pub fn all_shapes() -> Arc<ShapeSet> {
    static SHAPES: OnceLock<Arc<ShapeSet>> = OnceLock::new();
    SHAPES.get_or_init(|| Arc::new(ShapeSet::procedural(4))).clone()
}

/// Radius of the bounding sphere of an asteroid, m.
pub fn bound_m() -> f64 {
    shape().shapes.first().map_or(1.0, |shape| shape.bound) * RADIUS_M
}

/// One asteroid that does not rotate, with the axes of its field.
fn one() -> Arc<Instances> {
    static ONE: OnceLock<Arc<Instances>> = OnceLock::new();
    let make = || {
        let asteroid =
            Asteroid { offset_m: Vec3::ZERO, radius_over_largest: 1.0, shape: 0, axis: DVec3::Z, phase: 0, rate: 0 };
        let group = Node {
            middle_m: DVec3::ZERO,
            radius_m: bound_m() * (1.0 + 1e-6),
            centroid_m: DVec3::ZERO,
            area_m2: PI * RADIUS_M * RADIUS_M,
            largest_m: RADIUS_M,
            smallest_m: RADIUS_M,
            first: 0,
            count: 1,
        };
        Arc::new(Instances {
            packed: vec![asteroid.into()],
            levels: vec![vec![group]],
            largest_m: RADIUS_M,
            base_period_s: 1e6,
        })
    };
    ONE.get_or_init(make).clone()
}

/// Returns a black body.
pub fn black(name: &str, position_m: DVec3, radii_m: DVec3) -> Body {
    Body {
        name: name.to_owned(),
        ephemeris: None,
        position_m,
        radii_m,
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law: ReflectionLaw::Lambert, geometric_albedo: [0.0; 3], phase_curve: None, texture: None },
        emission: None,
        seen_through: [1.0; 3],
    }
}

/// Returns a scene of bodies and fields whose positions are relative to the camera, camera axes.
pub fn scene_of(bodies: Vec<Body>, fields: Vec<AsteroidField>) -> SceneSnapshot {
    let body = |body: Body| Arc::new(Body { position_m: CAMERA_M + body.position_m, ..body });
    let field = |field: AsteroidField| Arc::new(AsteroidField { position_m: CAMERA_M + field.position_m, ..field });
    let objects = SceneObjects {
        bodies: bodies.into_iter().map(body).collect(),
        fields: fields.into_iter().map(field).collect(),
        ..SceneObjects::default()
    };
    SceneSnapshot {
        objects: Arc::new(objects),
        camera: Camera { position_m: CAMERA_M, ..Camera::default() },
        ..snapshot(Vec::new())
    }
}

/// Returns a sun in a direction, which illuminates the stage with some 1e5 lx.
pub fn sun(direction: DVec3) -> Body {
    let emission = Some(Emission { luminance_cd_m2: [2e9; 3], limb_darkening: 0.0, corona: false });
    Body { emission, ..black("sun", direction.normalize() * SUN_M, DVec3::splat(4e8)) }
}

/// Returns asteroids on the stage; the remaining ones are behind the camera, out of sight.
pub fn scene(posed: &[Posed], light: Light, fault: Fault) -> SceneSnapshot {
    let body = match light {
        Light::Wall => {
            let emission = Some(Emission { luminance_cd_m2: [1.0; 3], limb_darkening: 0.0, corona: false });
            Body { emission, ..black("wall", DVec3::NEG_Z * WALL_M[0], DVec3::splat(WALL_M[1])) }
        }
        Light::Sun(direction) => sun(direction),
    };
    let albedo = if light == Light::Wall { 0.0 } else { ALBEDO * fault.albedo };
    let field = |index: usize| {
        let away = Posed { place_m: DVec3::Z * 1e9, camera_from_shape: DQuat::IDENTITY };
        let posed = posed.get(index).copied().unwrap_or(away);
        AsteroidField {
            name: format!("asteroid {index}"),
            position_m: posed.place_m + DVec3::X * (fault.shift * RADIUS_M),
            orientation: posed.camera_from_shape,
            law: ReflectionLaw::LommelSeeliger,
            geometric_albedo: [albedo; 3],
            instances: one(),
            shapes: shape(),
        }
    };
    scene_of(vec![body], (0..PLACES).map(field).collect())
}

/// Returns the position of the eye for a place of the stage, camera axes, m. The eyes form a grid of eight by eight.
pub fn eye_m(place: usize, spacing_m: f64) -> DVec3 {
    let along = |index: usize| (index as f64 - 3.5) * spacing_m;
    DVec3::new(along(place % 8), along(place / 8), 0.0)
}

/// Returns a square flat window of `side` pixels of `pixel_rad` around a direction `off_axis_rad` to the right.
pub fn window(side: u32, pixel_rad: f64, off_axis_rad: f64) -> ViewKind {
    let (middle, step) = (off_axis_rad.tan(), pixel_rad / off_axis_rad.cos().powi(2));
    let half = 0.5 * f64::from(side) * step;
    let fov = Fov {
        left_rad: (middle - half).atan(),
        right_rad: (middle + half).atan(),
        up_rad: half.atan(),
        down_rad: -half.atan(),
    };
    ViewKind::OffAxis { size: [side; 2], fov }
}

/// Distances at which detail is reduced, for an asteroid of the stage that is seen in a direction (view axes, unit) of a picture.
pub struct Detail {
    /// Angle of a pixel there divided by the quality, rad.
    allowed_rad: f64,
    impostor: Option<ImpostorReach>,
}

impl Detail {
    /// Computes the distances for eyes that are `eyes_m` apart.
    pub fn new(settings: &AsteroidSettings, projection: &Projection, direction: DVec3, eyes_m: f64) -> Self {
        let along = match projection {
            Projection::Equirectangular(_) => direction.y,
            _ => -direction.z,
        };
        let pixel_rad = DirectionTable::new(projection).pixel_rad_at(table_place(along));
        Self { allowed_rad: pixel_rad / settings.quality, impostor: impostor_reach(settings, eyes_m) }
    }

    /// Distance from which on only its impostor is drawn, or only its coarsest mesh if there are no impostors, m.
    pub fn nearest_m(&self) -> f64 {
        let coarsest = || {
            let error = shape().shapes.iter().flat_map(|shape| &shape.lods).map(|lod| lod.error).fold(0.0, f64::max);
            2.0 * error * RADIUS_M / self.allowed_rad
        };
        let start_m = self.impostor.map_or_else(coarsest, |reach| reach.start_m(bound_m(), self.allowed_rad));
        // This is slightly beyond the end of the fade.
        start_m * (1.0 + BAND) * 1.001
    }

    /// Distance from which on it is partly drawn as a point, m.
    pub fn points_m(&self) -> f64 {
        RADIUS_M / self.allowed_rad
    }
}

impl Context<'_> {
    /// Settings for asteroids in full detail, 4 x 4 samples per pixel.
    pub(super) fn finest(&self) -> AsteroidSettings {
        AsteroidSettings { finest_only: true, samples: 4, ..self.settings.asteroids.clone() }
    }

    /// Renders the asteroids of the stage twice: with the settings, and in full detail. The second frame is the truth. Both frames have 4 x 4 samples
    /// per pixel, so that the sampling of edges does not matter.
    pub(super) fn drawn_and_true(
        &mut self,
        posed: &[Posed],
        light: Light,
        rig: &Rig,
    ) -> Result<[Vec<FrameImage>; 2], CheckError> {
        let kept = self.settings.asteroids.clone();
        self.settings.asteroids.samples = 4;
        let drawn = self.render(&scene(posed, light, Fault::NONE), rig);
        self.settings.asteroids = self.finest();
        let truth = self.render(&scene(posed, light, self.object_fault), rig);
        self.settings.asteroids = kept;
        Ok([drawn?.images, truth?.images])
    }
}

/// Returns how much of a wall of 1 cd/m^2 an asteroid covers. For each pixel within an angle of a direction (view
/// axes), this is the covered part of its solid angle, sr. For other pixels it is 0.
pub fn silhouette(
    image: &FrameImage,
    view_image: &ViewImage,
    direction: DVec3,
    within_rad: f64,
) -> Result<Vec<f64>, CheckError> {
    let mapping = view_image.projection.mapping();
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y))).zip(hdr_pixels(image)?);
    Ok(pixels
        .map(|((x, y), [r, g, b, _])| {
            let seen = mapping.direction_from_pixel(pixel_centre(x, y));
            let near = seen.is_some_and(|seen| seen.angle_between(direction) <= within_rad);
            let covered = 1.0 - luminance([*r, *g, *b].map(f64::from));
            if near { covered.clamp(0.0, 1.0) * mapping.solid_angle_sr(x, y) } else { 0.0 }
        })
        .collect())
}

/// Intersection over union of two silhouettes; NaN if both are empty.
pub fn iou(a: &[f64], b: &[f64]) -> f64 {
    let sum = |pick: fn(f64, f64) -> f64| a.iter().zip(b).map(|(a, b)| pick(*a, *b)).sum::<f64>();
    sum(f64::min) / sum(f64::max)
}

/// Measures the light of an image, lx, and its centroid in pixels.
pub fn light_and_middle(image: &FrameImage, mapping: &dyn PlaneMapping) -> Result<(f64, DVec2), CheckError> {
    let view = HdrView::new(mapping, hdr_pixels(image)?)?;
    let (mut sum, mut middle) = (0.0, DVec2::ZERO);
    for y in 0..image.height {
        for x in 0..image.width {
            let light = view.illuminance_lx(x, y)?;
            sum += light;
            middle += light * pixel_centre(x, y);
        }
    }
    Ok((sum, middle / sum))
}

/// Measures the light of every view around a direction in camera axes, lx, for one eye.
pub fn light_around_lx(frame: &Frame, rig: &Rig, direction: DVec3, reach_rad: f64) -> Result<Vec<f64>, CheckError> {
    let mut light = vec![0.0; rig.views().len()];
    for (image, view_image) in images(frame, rig) {
        let view = hdr_view(image, view_image.projection.mapping())?.turned(view_image.camera_from_view);
        // Points extend four pixels around their centre.
        let reach_rad = reach_rad + 12.0 * view_image.projection.middle_pixel_rad();
        let eyes = if matches!(rig.views()[image.view].kind, ViewKind::Stereo { .. }) { 2.0 } else { 1.0 };
        light[image.view] += metrics::illuminance_near_direction_lx(&[view], direction, reach_rad)? / eyes;
    }
    Ok(light)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iou_is_intersection_over_union() {
        let iou_of = |a: &[f64], b: &[f64]| iou(a, b);
        assert_eq!(iou_of(&[1.0, 1.0, 0.0], &[1.0, 1.0, 0.0]), 1.0);
        assert_eq!(iou_of(&[1.0, 1.0, 0.0], &[0.0, 1.0, 1.0]), 1.0 / 3.0);
        assert_eq!(iou_of(&[1.0, 0.5], &[0.5, 1.0]), 0.5);
        assert!(iou_of(&[0.0], &[0.0]).is_nan(), "empty silhouettes have no IoU");
    }

    #[test]
    fn places_have_separate_eyes_and_windows_contain_their_direction() {
        for (index, place) in (0..PLACES).map(|place| eye_m(place, 2.0)).enumerate() {
            assert!((0..index).all(|other| (eye_m(other, 2.0) - place).length() > 1.9));
        }
        for off_axis in [0.0_f64, 0.5] {
            let kind = window(40, 1e-3, off_axis);
            let image = crate::verify::scenes::rig([("window", kind)]).unwrap().views()[0].images[0].clone();
            let mapping = image.projection.mapping();
            let direction = DVec3::new(off_axis.sin(), 0.0, -off_axis.cos());
            assert!((mapping.pixel_from_direction(direction).unwrap() - DVec2::splat(20.0)).length() < 1e-3);
            let [longer, shorter] = mapping.pixel_extent_rad(direction).unwrap();
            assert!((shorter / 1e-3 - 1.0).abs() < 1e-3 && longer < 1.3e-3, "{longer} {shorter}");
        }
    }
}

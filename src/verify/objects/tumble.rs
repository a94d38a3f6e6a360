//! A tumbling asteroid. In its axes, the eye passes the poles of the shape, where an atlas of angles is singular, and
//! the corners and folds of an octahedral map.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
    },
    stage::{Detail, Light, PLACES, Posed, bound_m, eye_m, iou, scene, silhouette, window},
};
use crate::{
    plan::asteroids::tiles::AtlasLayout,
    render::FrameImage,
    view::{Rig, View, ViewKind},
};

/// Angle between two pictures, degrees.
const STEP_DEG: f64 = 0.5;
/// Angle of a pixel of the windows, rad.
const PIXEL_RAD: f64 = 1e-3;

/// Rotations about one axis, in several ranges of equal steps. At the angle 0, the direction to the eye is z in the axes of the shape. It is turned
/// by the angle about y, and then rotated by `circle`.
struct Tumble {
    circle: DMat3,
    /// First angle of each range, degrees, and its number of pictures.
    stretches: Vec<(f64, usize)>,
}

impl Tumble {
    /// Passes the pole +z, the gimbal's pole +x and the map's corner -z, each at a distance of some tenths of a degree,
    /// so that none is hit exactly.
    fn over_poles(steps: usize) -> Self {
        let circle = DMat3::from_rotation_z(0.003) * DMat3::from_rotation_x(0.002);
        let before_deg = 0.5 * STEP_DEG * steps as f64;
        Self { circle, stretches: [0.0, 90.0, 180.0].map(|pole_deg| (pole_deg - before_deg, steps)).to_vec() }
    }

    /// Passes obliquely across faces, folds and an edge of the map.
    fn oblique() -> Self {
        let circle = DMat3::from_rotation_y(0.9) * DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(0.4);
        Self { circle, stretches: vec![(62.0, PLACES)] }
    }

    fn angles_deg(&self) -> impl Iterator<Item = f64> {
        let stretch = |(from_deg, count): &(f64, usize)| {
            let from_deg = *from_deg;
            (0..*count).map(move |step| from_deg + STEP_DEG * step as f64)
        };
        self.stretches.iter().flat_map(stretch)
    }

    /// Rotation from the shape's axes to those of a view that sees it in a direction (view axes, unit), at an angle.
    fn view_from_shape(&self, angle_deg: f64, direction: DVec3) -> DQuat {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let (to_eye, axis) = (self.circle * DVec3::new(sin, 0.0, cos), self.circle.y_axis);
        let shape = DMat3::from_cols(axis, to_eye.cross(axis), to_eye);
        let right = direction.cross(DVec3::Y).normalize();
        let view = DMat3::from_cols(right, right.cross(direction), -direction);
        // The asteroid is oblique, so that the rows of the picture are not a special direction.
        DQuat::from_axis_angle(direction, 0.6) * DQuat::from_mat3(&(view * shape.transpose()))
    }
}

/// Largest angle between neighbouring tiles, rad: 2 pi / n for pitch and yaw; 2 sqrt(6) / n for the octahedral map,
/// whose tiles are largest at the centres of its faces.
fn tile_rad(layout: Option<AtlasLayout>, tiles: u32) -> f64 {
    let n = f64::from(tiles);
    match layout {
        Some(AtlasLayout::Euler) => TAU / n,
        Some(AtlasLayout::Octahedral) | None => 2.0 * 6.0_f64.sqrt() / n,
    }
}

/// A kind of picture, the direction of the asteroid in it (view axes), and the way in which the asteroid tumbles.
struct Scene {
    name: &'static str,
    kind: ViewKind,
    off_axis_deg: f64,
    tumbles: Vec<Tumble>,
}

/// Returns the scenes. The size of windows depends on the quality setting, with which impostors may start near the eye.
fn scenes(quality: f64) -> [Scene; 3] {
    let side = (44.0 / quality.min(1.0)).ceil() as u32;
    // Draw only the centre of a dome: a whole dome with equally fine pixels would be large.
    let dome = ViewKind::DomeMaster { size: 192, fov_rad: 0.5 * PI, tilt_rad: 0.0 };
    let off_axis = window(side, PIXEL_RAD, 30.0_f64.to_radians());
    let both = vec![Tumble::over_poles(PLACES / 3), Tumble::oblique()];
    let poles = |steps: usize| vec![Tumble::over_poles(steps)];
    [
        Scene { name: "window", kind: window(side, PIXEL_RAD, 0.0), off_axis_deg: 0.0, tumbles: both },
        Scene { name: "30 deg off the axis", kind: off_axis, off_axis_deg: 30.0, tumbles: poles(PLACES / 3) },
        Scene { name: "dome", kind: dome, off_axis_deg: 35.0, tumbles: poles(6) },
    ]
}

/// 24: turns an asteroid in steps of half a degree, compares its silhouette at each step with that of the finest mesh, and measures how much the
/// silhouette changes from step to step.
pub(in crate::verify) fn tumbles(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let mut figures = Vec::new();
    for Scene { name, kind, off_axis_deg, tumbles } in scenes(context.settings.asteroids.quality) {
        let (sin, cos) = off_axis_deg.to_radians().sin_cos();
        let direction = DVec3::new(sin, 0.0, -cos);
        for (far, times) in [("", 1.0), (", twice as far", 2.0)] {
            let mut found = Vec::new();
            for tumble in &tumbles {
                found.push(measure(context, &kind, direction, tumble, times)?);
            }
            let [differing, jump] = [0, 1].map(|index| worst(found.iter().map(|figures| figures[index])));
            figures.push(Figure::at_most(format!("1 - IoU, {name}{far}"), differing, 0.05, ""));
            figures.push(Figure::at_most(format!("jump, {name}{far}"), jump, 1.0, "steps and a tile"));
        }
    }
    Ok(figures)
}

/// The asteroid is at the smallest distance at which impostors are drawn, times a factor. Returns the largest 1 - IoU
/// with the truth, and the largest area that changes in a step. That area is relative to the largest change of the
/// truth in a turn by a step and a tile.
fn measure(
    context: &mut Context<'_>,
    kind: &ViewKind,
    direction: DVec3,
    tumble: &Tumble,
    times: f64,
) -> Result<[f64; 2], CheckError> {
    let settings = context.settings.asteroids.clone();
    let single = View::new("single", kind.clone(), DQuat::IDENTITY, DVec3::ZERO)?;
    let image = single.images.first().ok_or(CheckError::Missing("an image"))?;
    // Images of a dome are rotated relative to the camera's axes; undo that rotation.
    let orientation = image.camera_from_view.conjugate();
    let detail = Detail::new(&settings, &image.projection, direction, 0.0);
    // Beyond this distance, asteroids are drawn as points, which cover nothing.
    let distance_m = (times * detail.nearest_m()).min(detail.points_m());
    let spacing_m = 3.0 * distance_m;
    let pose = |(place, angle_deg): (usize, f64)| Posed {
        place_m: eye_m(place, spacing_m) + direction * distance_m,
        camera_from_shape: tumble.view_from_shape(angle_deg, direction),
    };
    let posed: Vec<Posed> = tumble.angles_deg().enumerate().map(pose).collect();
    let further_deg = STEP_DEG + tile_rad(AtlasLayout::for_method(settings.impostor), settings.tiles).to_degrees();
    let turned: Vec<Posed> =
        tumble.angles_deg().map(|angle_deg| angle_deg + further_deg).enumerate().map(pose).collect();
    let view = |place: usize| View::new(&format!("step-{place}"), kind.clone(), orientation, eye_m(place, spacing_m));
    let rig = Rig::new((0..posed.len()).map(view).collect::<Result<_, _>>()?)?;

    let within_rad = 1.5 * (bound_m() / distance_m).asin();
    let silhouettes = |images: &[FrameImage]| -> Result<Vec<Vec<f64>>, CheckError> {
        let view_images = rig.views().iter().flat_map(|view| &view.images);
        images
            .iter()
            .zip(view_images)
            .map(|(image, view_image)| silhouette(image, view_image, direction, within_rad))
            .collect()
    };
    let [drawn, truth] = context.drawn_and_true(&posed, Light::Wall, &rig)?;
    let [drawn, truth] = [silhouettes(&drawn)?, silhouettes(&truth)?];
    context.settings.asteroids = context.finest();
    let turned = context.render(&scene(&turned, Light::Wall, context.object_fault), &rig);
    context.settings.asteroids = settings;
    let turned = silhouettes(&turned?.images)?;

    let differing = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
    let allowed = worst(truth.iter().zip(&turned).map(|(a, b)| differing(a, b)));
    let mut steps = Vec::new();
    let mut rest = drawn.as_slice();
    for (_, count) in &tumble.stretches {
        let (stretch, after) = rest.split_at(*count);
        steps.extend(stretch.windows(2).map(|pair| differing(&pair[0], &pair[1])));
        rest = after;
    }
    Ok([worst(drawn.iter().zip(&truth).map(|(a, b)| 1.0 - iou(a, b))), worst(steps) / allowed])
}

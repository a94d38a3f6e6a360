//! Artificial skies and views for checks and tests.

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec2, DVec3};

use crate::{
    catalogue::{StarRecord, chunks::StarSet},
    scene::{Camera, SceneSnapshot},
    view::{
        Fov, Rig, RigError, View, ViewKind,
        projection::{Face, FisheyeMapping, PlaneMapping},
    },
};

/// Returns a star at infinity, as hot as the Sun.
pub fn star(direction: DVec3, magnitude: f32) -> StarRecord {
    StarRecord { position: direction.normalize(), magnitude, temperature_k: 5772.0, distance_known: false }
}

/// Returns a star at a position, pc, with its absolute magnitude.
pub fn star_at(position_pc: DVec3, absolute_magnitude: f32) -> StarRecord {
    StarRecord { position: position_pc, magnitude: absolute_magnitude, temperature_k: 5772.0, distance_known: true }
}

/// Returns directions spread evenly over the sphere (a Fibonacci spiral).
pub fn spiral(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
    })
}

/// Returns a scene of these stars with the camera at the origin.
pub fn snapshot(records: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot {
        revision: 1,
        stars: Arc::new(StarSet::from_records(records)),
        objects: Default::default(),
        camera: Camera::default(),
    }
}

/// Returns a rig of views that have the axes of the camera.
///
/// # Errors
/// Those of [`View::new`] and [`Rig::new`].
pub fn rig<'a>(kinds: impl IntoIterator<Item = (&'a str, ViewKind)>) -> Result<Rig, RigError> {
    let view = |(name, kind)| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO);
    Rig::new(kinds.into_iter().map(view).collect::<Result<_, _>>()?)
}

/// Returns all six faces of a cube.
pub fn cube(face_size: u32) -> ViewKind {
    ViewKind::Cubemap { face_size, faces: Face::ALL.to_vec() }
}

/// Returns a square fisheye view.
pub fn fisheye(size: u32, mapping: FisheyeMapping, degrees: f64) -> ViewKind {
    ViewKind::Fisheye { size: [size; 2], mapping, fov_rad: degrees.to_radians() }
}

/// Returns every projection with its name.
pub fn all_views() -> Vec<(&'static str, ViewKind)> {
    let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.85 };
    vec![
        ("perspective", ViewKind::Perspective { size: [192, 108], fov_y_rad: PI / 3.0 }),
        ("perspective-150", ViewKind::Perspective { size: [160, 160], fov_y_rad: 150f64.to_radians() }),
        ("off-axis", ViewKind::OffAxis { size: [128, 130], fov }),
        ("stereo", ViewKind::Stereo { size: [96, 100], ipd_m: 0.064, fov_left: fov, fov_right: fov.mirrored() }),
        ("cube", cube(64)),
        ("equidistant-180", fisheye(160, FisheyeMapping::Equidistant, 180.0)),
        ("equidistant-360", fisheye(160, FisheyeMapping::Equidistant, 360.0)),
        ("equisolid-220", fisheye(160, FisheyeMapping::Equisolid, 220.0)),
        ("orthographic-180", fisheye(160, FisheyeMapping::Orthographic, 180.0)),
        ("stereographic-220", fisheye(160, FisheyeMapping::Stereographic, 220.0)),
        ("domemaster", ViewKind::DomeMaster { size: 160, fov_rad: PI, tilt_rad: 0.3 }),
        ("equirectangular", ViewKind::Equirectangular { size: [192, 96] }),
    ]
}

/// Returns up to `count` evenly spread directions that are at least `margin_px` inside of the borders of every image of
/// the view. For a cube, whose faces share their edges, one of the faces suffices.
pub fn directions_inside(view: &View, count: usize, margin_px: i32) -> Vec<DVec3> {
    let reaches_inside = |mapping: &dyn PlaneMapping, direction: DVec3| {
        let Some(pixel) = mapping.pixel_from_direction(direction) else { return false };
        let inside = |i: i32, j: i32| {
            let shifted = pixel + DVec2::new(f64::from(i), f64::from(j));
            shifted.x >= 0.0 && shifted.y >= 0.0 && mapping.contains(shifted.x as u32, shifted.y as u32)
        };
        (-margin_px..=margin_px).all(|j| (-margin_px..=margin_px).all(|i| inside(i, j)))
    };
    let inside = |direction: &DVec3| {
        let mut images = view
            .images
            .iter()
            .map(|image| reaches_inside(image.projection.mapping(), image.camera_from_view.conjugate() * *direction));
        match view.kind {
            ViewKind::Cubemap { .. } => images.any(|inside| inside),
            _ => images.all(|inside| inside),
        }
    };
    let found: Vec<DVec3> = spiral(20_000).filter(inside).collect();
    let step = (found.len() / count.max(1)).max(1);
    found.into_iter().step_by(step).take(count).collect()
}

/// Returns the edges and corners of a cube, the poles and the date line: places where a careless projection cuts a
/// star.
pub fn hard_places() -> Vec<DVec3> {
    let mut places = vec![DVec3::Y, DVec3::NEG_Y];
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                let place = DVec3::new(x, y, z);
                match [x, y, z].iter().filter(|v: &&f64| v.abs() > 0.0).count() {
                    3 => places.push(place),
                    // The midpoint of an edge, and another point on it.
                    2 => places.extend([place, place + 0.37 * (DVec3::ONE - place * place)]),
                    _ => {}
                }
            }
        }
    }
    places.extend([-1.2_f64, -0.4, 0.0, 0.7, 1.4].map(|latitude| DVec3::new(0.0, latitude.sin(), latitude.cos())));
    places.into_iter().map(DVec3::normalize).collect()
}

//! The rig: every view of a frame with its images, and the flat list of viewports that the renderer draws.
//!
//! Three frames of reference meet here: *view* axes (+x right, +y up, looking -z) of one image, *camera* axes of the rig,
//! and *world* axes (ICRS). `camera_from_view` and `world_from_camera` are rotations between them.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use super::{
    kind::{Fov, ViewKind},
    projection::{
        CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping, Projection,
        ProjectionError, TabulatedMapping,
    },
};

/// Reasons why a rig cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// A view's projection is impossible.
    #[error("view `{view}`: {source}")]
    Projection {
        /// The view's name.
        view: String,
        /// The error.
        source: ProjectionError,
    },
    /// A view's name is empty or has characters other than letters, digits, `_` and `-`.
    #[error("`{name}` is not a valid name: must be one or more letters, digits, `_` and `-`")]
    Name {
        /// The name.
        name: String,
    },
    /// Two views have the same name.
    #[error("view name `{name}` is used twice: names must be unique")]
    Duplicate {
        /// The name.
        name: String,
    },
    /// Another parameter is invalid.
    #[error("view `{view}`: {problem}")]
    Parameter {
        /// The view's name.
        view: String,
        /// The problem, and the valid values.
        problem: String,
    },
}

/// Maximum distance of an eye from the camera along each axis, m. Positions of near stars are f32 relative to the
/// camera.
pub const MAX_EYE_OFFSET_M: f64 = 1e9;

/// Name of one of several images of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The only image.
    Whole,
    /// The left eye.
    LeftEye,
    /// The right eye.
    RightEye,
    /// A cube face.
    Face(Face),
}

impl Part {
    /// The part's name in file names and messages; `None` for a view's only image.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Part::Whole => None,
            Part::LeftEye => Some("left"),
            Part::RightEye => Some("right"),
            Part::Face(face) => Some(face.name()),
        }
    }
}

/// One image of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewImage {
    /// Which part of the view.
    pub part: Part,
    /// How directions map to its pixels.
    pub projection: Projection,
    /// Rotation from view axes to camera axes.
    pub camera_from_view: DQuat,
    /// Position of the eye in camera axes, m.
    pub eye_position_m: DVec3,
    /// Omnidirectional stereo: radius of the circle on which the eye moves with the viewing direction, m; positive for
    /// the right eye. 0: the eye is fixed. See [`Viewport::eye_on_circle_m`].
    pub viewing_circle_m: f64,
}

/// Layout of the pictures of two eyes in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Packing {
    /// Each picture in its own file.
    #[default]
    None,
    /// In one file, with the left eye's picture above the right eye's.
    TopBottom,
    /// In one file, with the left eye's picture to the left of the right eye's.
    SideBySide,
}

/// A picture as stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewPicture {
    /// The part of the view that it shows.
    pub part: Part,
    /// Width and height, pixels.
    pub size: [u32; 2],
}

/// A view: one or several images under one name.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Unique name.
    pub name: String,
    /// The requested kind.
    pub kind: ViewKind,
    /// Its images.
    pub images: Vec<ViewImage>,
    /// Layout of its images in files.
    pub packing: Packing,
}

/// Checks the name of a view: one or more letters, digits, `_` and `-`.
pub fn check_name(name: &str) -> Result<(), RigError> {
    let valid = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(valid) {
        return Err(RigError::Name { name: name.to_owned() });
    }
    Ok(())
}

impl View {
    /// Builds a view. `orientation` (of unit length) rotates view axes to camera axes; `position_m` is in camera axes.
    pub fn new(name: &str, kind: ViewKind, orientation: DQuat, position_m: DVec3) -> Result<Self, RigError> {
        check_name(name)?;
        let images = images_of(name, &kind, orientation, position_m)?;
        if let Some(image) = images.iter().find(|image| image.eye_position_m.abs().max_element() > MAX_EYE_OFFSET_M) {
            return Err(RigError::Parameter {
                view: name.to_owned(),
                problem: format!(
                    "an eye at {:?} m from the camera: must be at most {MAX_EYE_OFFSET_M:e} m along each axis; move the camera instead",
                    image.eye_position_m.to_array()
                ),
            });
        }
        Ok(Self { name: name.to_owned(), kind, images, packing: Packing::None })
    }

    /// The same view with the pictures of its eyes combined into one.
    ///
    /// # Errors
    ///
    /// The view does not consist of two eyes with pictures of the same size.
    pub fn packed(self, packing: Packing) -> Result<Self, RigError> {
        let sizes: Vec<[u32; 2]> = self.images.iter().map(|image| image.projection.mapping().size()).collect();
        let eyes = self.images.iter().map(|image| image.part).eq([Part::LeftEye, Part::RightEye]);
        if packing != Packing::None && !(eyes && sizes[0] == sizes[1]) {
            return Err(RigError::Parameter {
                view: self.name,
                problem: "packing: the view does not have two eyes: packing is valid only in views of type stereo, or of type dome_master with ipd_m"
                    .to_owned(),
            });
        }
        Ok(Self { packing, ..self })
    }

    /// Its pictures, as they are stored in files.
    pub fn pictures(&self) -> Vec<ViewPicture> {
        let sized = |image: &ViewImage| ViewPicture { part: image.part, size: self.output_size(image) };
        let pictures: Vec<ViewPicture> = self.images.iter().map(sized).collect();
        match (self.packing, &pictures[..]) {
            (Packing::TopBottom, [ViewPicture { size: [width, height], .. }, _]) => {
                vec![ViewPicture { part: Part::Whole, size: [*width, 2 * height] }]
            }
            (Packing::SideBySide, [ViewPicture { size: [width, height], .. }, _]) => {
                vec![ViewPicture { part: Part::Whole, size: [2 * width, *height] }]
            }
            _ => pictures,
        }
    }

    /// For a projector: the mapping of its raster, and the rotation from the axes of the raster to camera axes. The camera axes are those of the
    /// dome.
    pub fn raster(&self) -> Option<(&Arc<TabulatedMapping>, DQuat)> {
        let ViewKind::Projector { mapping, output } = &self.kind else { return None };
        let camera_from_picture = self.images.first()?.camera_from_view;
        let picture_from_view = output.resampling().map(|resampling| resampling.view_from_source.inverse());
        Some((mapping, picture_from_view.map_or(camera_from_picture, |rotation| camera_from_picture * rotation)))
    }

    /// Width and height of one of its images as it leaves the renderer, pixels.
    pub fn output_size(&self, image: &ViewImage) -> [u32; 2] {
        self.kind.projector().map_or_else(|| image.projection.mapping().size(), |output| output.size())
    }
}

fn images_of(name: &str, kind: &ViewKind, orientation: DQuat, position_m: DVec3) -> Result<Vec<ViewImage>, RigError> {
    let wrong = |source: ProjectionError| RigError::Projection { view: name.to_owned(), source };
    let parameter = |problem: String| RigError::Parameter { view: name.to_owned(), problem };
    let image = |part: Part, projection: Projection, camera_from_view: DQuat, eye_position_m: DVec3| ViewImage {
        part,
        projection,
        camera_from_view,
        eye_position_m,
        viewing_circle_m: 0.0,
    };
    let whole = |projection: Projection| Ok(vec![image(Part::Whole, projection, orientation, position_m)]);
    let off_axis = |size: [u32; 2], fov: Fov| {
        Perspective::off_axis(size, fov.left_rad, fov.right_rad, fov.up_rad, fov.down_rad).map(Projection::Perspective)
    };
    // AFDI domemaster: the centre is the zenith, tilted forwards; the bottom of the image is the front.
    let dome = |size: u32, fov_rad: f64, tilt_rad: f64| {
        if !tilt_rad.is_finite() {
            return Err(parameter(format!("tilt_deg = {}: must be finite", tilt_rad.to_degrees())));
        }
        let projection = Fisheye::new([size; 2], FisheyeMapping::Equidistant, fov_rad).map_err(wrong)?;
        let (sin, cos) = tilt_rad.sin_cos();
        let axis = DVec3::new(0.0, cos, -sin);
        let up = DVec3::new(0.0, sin, cos);
        Ok((projection, DQuat::from_mat3(&DMat3::from_cols(axis.cross(up), up, -axis))))
    };
    match kind {
        ViewKind::Perspective { size, fov_y_rad } => {
            whole(Projection::Perspective(Perspective::symmetric(*size, *fov_y_rad).map_err(wrong)?))
        }
        ViewKind::OffAxis { size, fov } => whole(off_axis(*size, *fov).map_err(wrong)?),
        ViewKind::Stereo { size, ipd_m, fov_left, fov_right } => {
            if !(ipd_m.is_finite() && *ipd_m >= 0.0) {
                return Err(parameter(format!("ipd_m = {ipd_m}: must be finite and at least 0 m")));
            }
            // The eyes are half the distance to the left and to the right of the view.
            let eyes = [(Part::LeftEye, fov_left, -0.5), (Part::RightEye, fov_right, 0.5)];
            eyes.into_iter()
                .map(|(part, fov, side)| {
                    let eye = position_m + orientation * (DVec3::X * (side * ipd_m));
                    Ok(image(part, off_axis(*size, *fov).map_err(wrong)?, orientation, eye))
                })
                .collect()
        }
        ViewKind::Headset { eyes } => {
            let parts = [Part::LeftEye, Part::RightEye];
            let images = parts.into_iter().zip(eyes).map(|(part, eye)| {
                let place = position_m + orientation * eye.position_m;
                Ok(image(part, off_axis(eye.size, eye.fov).map_err(wrong)?, orientation * eye.room_from_eye, place))
            });
            images.collect()
        }
        ViewKind::Cubemap { face_size, faces } => {
            if faces.is_empty() {
                return Err(parameter(
                    "faces = []: name at least one of front, right, left, back, up, down".to_owned(),
                ));
            }
            if let Some(twice) = faces.iter().enumerate().find(|(i, face)| faces[..*i].contains(face)) {
                return Err(parameter(format!("faces: `{}` is named twice", twice.1.name())));
            }
            faces
                .iter()
                .map(|&face| {
                    let projection = Projection::CubeFace(CubeFace::new(face, *face_size).map_err(wrong)?);
                    Ok(image(Part::Face(face), projection, orientation * face.cube_from_face(), position_m))
                })
                .collect()
        }
        ViewKind::Fisheye { size, mapping, fov_rad } => {
            whole(Projection::Fisheye(Fisheye::new(*size, *mapping, *fov_rad).map_err(wrong)?))
        }
        ViewKind::DomeMaster { size, fov_rad, tilt_rad } => {
            let (projection, tilt) = dome(*size, *fov_rad, *tilt_rad)?;
            Ok(vec![image(Part::Whole, Projection::Fisheye(projection), orientation * tilt, position_m)])
        }
        ViewKind::StereoDome { size, fov_rad, tilt_rad, ipd_m } => {
            let radius_m = 0.5 * ipd_m;
            if !(0.0..=MAX_EYE_OFFSET_M).contains(&radius_m) {
                let most = 2.0 * MAX_EYE_OFFSET_M;
                return Err(parameter(format!("ipd_m = {ipd_m}: must be between 0 and {most:e} m")));
            }
            let (projection, tilt) = dome(*size, *fov_rad, *tilt_rad)?;
            let eye = |part: Part, viewing_circle_m: f64| ViewImage {
                viewing_circle_m,
                ..image(part, Projection::Fisheye(projection), orientation * tilt, position_m)
            };
            Ok(vec![eye(Part::LeftEye, -radius_m), eye(Part::RightEye, radius_m)])
        }
        ViewKind::Equirectangular { size } => {
            whole(Projection::Equirectangular(Equirectangular::new(*size).map_err(wrong)?))
        }
        ViewKind::Projector { mapping, output } => {
            if output.size() != mapping.size() {
                let [output_px, mapping_px] = [output.size(), mapping.size()];
                return Err(parameter(format!(
                    "an output of {output_px:?} pixels does not fit a raster of {mapping_px:?}"
                )));
            }
            // Draw directly in the pixels of the raster, or the picture that is resampled.
            Ok(match output.resampling() {
                None => vec![image(Part::Whole, Projection::Tabulated(Arc::clone(mapping)), orientation, position_m)],
                Some(resampling) => {
                    let camera_from_source = orientation * resampling.view_from_source;
                    vec![image(Part::Whole, resampling.source.clone(), camera_from_source, position_m)]
                }
            })
        }
        ViewKind::Tabulated { mapping } => whole(Projection::Tabulated(Arc::clone(mapping))),
    }
}

/// All views of a frame.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Rig {
    views: Vec<View>,
}

/// One image to draw, in world axes: the renderer's input for a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewport {
    /// Index of the view in the rig.
    pub view: usize,
    /// Which image of the view.
    pub part: Part,
    /// How directions map to pixels.
    pub projection: Projection,
    /// Rotation from view axes to world axes.
    pub world_from_view: DQuat,
    /// Eye minus camera in world axes, m.
    pub eye_offset_m: DVec3,
    /// See [`ViewImage::viewing_circle_m`].
    pub viewing_circle_m: f64,
}

impl Viewport {
    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.projection.mapping().size()
    }

    /// Omnidirectional stereo: position of the eye that sees a direction (a unit vector), relative to the viewport's eye, in view axes, m. This
    /// position is perpendicular to the direction and in the plane of the picture's circle. Its distance is `viewing_circle_m` times the sine of the
    /// angle from the axis: the full radius on the horizon of a dome, zero at the zenith, and continuous in between (P. Bourke, "Omni-directional
    /// stereoscopic fisheye images for immersive hemispherical dome environments", 2009, rotates the camera in the same way).
    pub fn eye_on_circle_m(&self, direction: DVec3) -> DVec3 {
        direction.cross(DVec3::NEG_Z) * self.viewing_circle_m
    }
}

impl Rig {
    /// A rig of views with unique names.
    pub fn new(views: Vec<View>) -> Result<Self, RigError> {
        for (i, view) in views.iter().enumerate() {
            if views[..i].iter().any(|other| other.name == view.name) {
                return Err(RigError::Duplicate { name: view.name.clone() });
            }
        }
        Ok(Self { views })
    }

    /// The views.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Index of the view with this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.views.iter().position(|view| view.name == name)
    }

    /// A rig with only these views, by index; invalid indices are ignored.
    pub fn of_views(&self, numbers: &[usize]) -> Self {
        Self { views: numbers.iter().filter_map(|&number| self.views.get(number)).cloned().collect() }
    }

    /// The flat list of viewports for a camera with the rotation `world_from_camera` from camera to world axes, in the
    /// order of views and images.
    pub fn viewports(&self, world_from_camera: DQuat) -> Vec<Viewport> {
        let mut viewports = Vec::new();
        for (index, view) in self.views.iter().enumerate() {
            for image in &view.images {
                viewports.push(Viewport {
                    view: index,
                    part: image.part,
                    projection: image.projection.clone(),
                    world_from_view: world_from_camera * image.camera_from_view,
                    eye_offset_m: world_from_camera * image.eye_position_m,
                    viewing_circle_m: image.viewing_circle_m,
                });
            }
        }
        viewports
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Eye;

    fn view(name: &str, kind: ViewKind) -> Result<View, RigError> {
        View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO)
    }

    #[test]
    fn domemaster_has_the_zenith_in_its_centre_and_the_front_at_its_bottom() {
        for tilt_rad in [0.0, 0.4] {
            let dome =
                view("dome", ViewKind::DomeMaster { size: 100, fov_rad: std::f64::consts::PI, tilt_rad }).unwrap();
            let image = &dome.images[0];
            let direction_at = |x: f64, y: f64| {
                image.camera_from_view
                    * image.projection.mapping().direction_from_pixel(glam::DVec2::new(x, y)).unwrap()
            };
            let (sin, cos) = tilt_rad.sin_cos();
            assert!((direction_at(50.0, 50.0) - DVec3::new(0.0, cos, -sin)).length() < 1e-12);
            assert!((direction_at(50.0, 100.0) - DVec3::new(0.0, -sin, -cos)).length() < 1e-12, "bottom is front");
            assert!((direction_at(0.0, 50.0) - DVec3::NEG_X).length() < 1e-12, "left is left");
        }
    }

    #[test]
    fn the_right_eye_sees_the_mirrored_field_from_half_an_ipd_to_the_right() {
        let fov_left = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.8 };
        let kind = ViewKind::Stereo { size: [10, 10], ipd_m: 0.064, fov_left, fov_right: fov_left.mirrored() };
        let rig = Rig::new(vec![view("eyes", kind).unwrap()]).unwrap();
        let viewports = rig.viewports(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2));
        // After a quarter turn to the left, the camera's +x is the world's -z.
        assert!((viewports[1].eye_offset_m - DVec3::new(0.0, 0.0, -0.032)).length() < 1e-12);
        let omega = |v: &Viewport, x: u32| v.projection.mapping().solid_angle_sr(x, 4);
        assert!((omega(&viewports[0], 1) / omega(&viewports[1], 8) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_eyes_of_a_stereo_dome_are_perpendicular_to_every_viewing_direction() {
        let kind = ViewKind::StereoDome { size: 100, fov_rad: std::f64::consts::PI, tilt_rad: 0.3, ipd_m: 0.064 };
        let rig = Rig::new(vec![view("dome", kind.clone()).unwrap()]).unwrap();
        let [left, right] = &rig.viewports(DQuat::IDENTITY)[..] else { panic!("two eyes") };
        for pixel in [[50.0, 99.0], [3.0, 50.0], [70.0, 20.0], [50.0, 50.0]] {
            let direction = left.projection.mapping().direction_from_pixel(glam::DVec2::from(pixel)).unwrap();
            let apart_m = right.eye_on_circle_m(direction) - left.eye_on_circle_m(direction);
            assert!(apart_m.dot(direction).abs() < 1e-15 && apart_m.z == 0.0, "{apart_m}");
            assert!((apart_m.length() - 0.064 * direction.x.hypot(direction.y)).abs() < 1e-15, "{apart_m}");
        }
        // For a viewer who looks to the front (the bottom of the picture), the right eye is on the right.
        let front = left.projection.mapping().direction_from_pixel(glam::DVec2::new(50.0, 100.0)).unwrap();
        assert!((right.world_from_view * right.eye_on_circle_m(front) - DVec3::X * 0.032).length() < 1e-12);
        assert_eq!(kind.type_name(), "dome_master");
        for ipd_m in [-1.0, f64::NAN, 1e12] {
            let kind = ViewKind::StereoDome { size: 100, fov_rad: 3.0, tilt_rad: 0.0, ipd_m };
            assert!(view("dome", kind).unwrap_err().to_string().contains("ipd_m"));
        }
    }

    #[test]
    fn only_pictures_of_two_eyes_can_be_packed() {
        let stereo = ViewKind::StereoDome { size: 10, fov_rad: 3.0, tilt_rad: 0.0, ipd_m: 0.064 };
        let sizes = |packing| {
            let pictures = view("dome", stereo.clone()).unwrap().packed(packing).unwrap().pictures();
            pictures.into_iter().map(|ViewPicture { part, size }| (part, size)).collect::<Vec<_>>()
        };
        assert_eq!(sizes(Packing::None), [(Part::LeftEye, [10, 10]), (Part::RightEye, [10, 10])]);
        assert_eq!(sizes(Packing::TopBottom), [(Part::Whole, [10, 20])]);
        assert_eq!(sizes(Packing::SideBySide), [(Part::Whole, [20, 10])]);
        let flat = view("map", ViewKind::Equirectangular { size: [4, 2] }).unwrap();
        assert!(flat.packed(Packing::TopBottom).unwrap_err().to_string().contains("packing"));
    }

    #[test]
    fn a_headset_with_parallel_eyes_is_a_stereo_view() {
        let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.75 };
        let ipd_m = 0.064;
        let eye = |fov: Fov, side: f64| Eye {
            size: [12, 10],
            fov,
            room_from_eye: DQuat::IDENTITY,
            position_m: DVec3::X * (side * ipd_m),
        };
        let headset = ViewKind::Headset { eyes: [eye(fov, -0.5), eye(fov.mirrored(), 0.5)] };
        let stereo = ViewKind::Stereo { size: [12, 10], ipd_m, fov_left: fov, fov_right: fov.mirrored() };
        let (turn, place) = (DQuat::from_euler(glam::EulerRot::YXZ, 0.4, -0.2, 0.1), DVec3::new(1.0, 2.0, 3.0));
        let images = |kind: ViewKind| View::new("eyes", kind, turn, place).unwrap().images;
        assert_eq!(images(headset.clone()), images(stereo.clone()));
        // With the eyes swapped, the images differ.
        let ViewKind::Headset { eyes: [left, right] } = headset else { unreachable!("a headset was made") };
        assert_ne!(images(ViewKind::Headset { eyes: [right, left] }), images(stereo));
    }

    #[test]
    fn canted_eyes_turn_with_the_view_and_the_camera() {
        let (size, half) = ([20, 20], std::f64::consts::FRAC_PI_4);
        let fov = Fov { left_rad: -half, right_rad: half, up_rad: half, down_rad: -half };
        let cant_rad = 0.1;
        // Each eye is canted outwards: the left one to the left. A rotation about +y turns to the left.
        let eye = |side: f64, size: [u32; 2]| Eye {
            size,
            fov,
            room_from_eye: DQuat::from_rotation_y(-side * cant_rad),
            position_m: DVec3::new(side * 0.03, 1.7, -0.2),
        };
        let eyes = [eye(-1.0, size), eye(1.0, [30, 28])];
        // The view is turned a quarter to the left, the camera a quarter upwards.
        let quarter = std::f64::consts::FRAC_PI_2;
        let place = DVec3::new(0.0, 0.0, 5.0);
        let view = View::new("headset", ViewKind::Headset { eyes }, DQuat::from_rotation_y(quarter), place).unwrap();
        let viewports = Rig::new(vec![view]).unwrap().viewports(DQuat::from_rotation_x(quarter));
        assert_eq!([viewports[0].size(), viewports[1].size()], [size, [30, 28]]);
        assert_eq!([viewports[0].part, viewports[1].part], [Part::LeftEye, Part::RightEye]);
        let (sin, cos) = cant_rad.sin_cos();
        for (viewport, side) in viewports.iter().zip([-1.0, 1.0]) {
            // In the room, an eye looks along (side sin, 0, -cos). The rotation to the left maps x to -z and z to x; the rotation upwards maps -z to
            // y and y to z.
            let ahead = viewport.world_from_view * DVec3::NEG_Z;
            assert!((ahead - DVec3::new(-cos, side * sin, 0.0)).length() < 1e-12, "{ahead}");
            let up = viewport.world_from_view * DVec3::Y;
            assert!((up - DVec3::Z).length() < 1e-12, "{up}");
            let expected = DVec3::new(-0.2, side * 0.03 - 5.0, 1.7);
            assert!((viewport.eye_offset_m - expected).length() < 1e-12, "{}", viewport.eye_offset_m);
            let [width, height] = viewport.size().map(f64::from);
            let middle = viewport.projection.mapping().direction_from_pixel(glam::DVec2::new(width, height) / 2.0);
            assert!((middle.unwrap() - DVec3::NEG_Z).length() < 1e-12);
        }
    }

    #[test]
    fn bad_names_duplicate_names_and_bad_faces_are_refused() {
        let kind = ViewKind::Equirectangular { size: [4, 2] };
        for name in ["", "a b", "a/b", "ü"] {
            assert!(matches!(view(name, kind.clone()), Err(RigError::Name { .. })), "{name}");
        }
        let twins = vec![view("a", kind.clone()).unwrap(), view("a", kind).unwrap()];
        assert!(matches!(Rig::new(twins), Err(RigError::Duplicate { .. })));
        for faces in [vec![], vec![Face::Up, Face::Up]] {
            assert!(view("c", ViewKind::Cubemap { face_size: 8, faces }).is_err());
        }
    }
}

//! Glare: every view shows the light that the kernel scatters towards it, round in the sky, whole, and from sources beyond its
//! borders too.
//!
//! Most checks look at scattered light alone: with a share of 1 nothing else is left in a picture. What should be seen comes from
//! [`crate::reference::glare::sky_cube`], for the eye of each image. Within two pixels of a source scattered light cannot be told from the
//! source's own image; [`profile`] judges what is there by its sum. Pyramids have a kernel of their own that no setting reaches and
//! that ends nowhere in particular: they are compared with the kernel of the settings after one fitted scale.
//!
//! A scene is turned into place by its views, not moved, and all views stand in one rig where that is possible: so what a method
//! keeps from frame to frame is kept, as in a running system.

mod eyes;
mod faces;
mod frames;
mod reference;
mod shape;

use std::sync::Arc;

use glam::{DQuat, DVec3};

pub(super) use self::{
    eyes::two_eyes,
    faces::cut_into_faces,
    frames::{leaves_frame, night_to_sun},
    reference::against_reference,
    shape::{profile, roundness},
};
use super::context::{CheckError, Context, hdr_view, images};
use crate::{
    metrics::{self, HdrView},
    photometry::{glare::GlareKernel, rec709::luminance},
    plan::{glare::pyramid::PyramidAxes, settings::GlareSettings},
    reference::{
        glare::sky_cube::Veil,
        sky::{SkyStar, stars_for},
        stars::splat::Eye,
    },
    render::Frame,
    scene::SceneSnapshot,
    view::{Fov, Rig, RigError, View, ViewImage, ViewKind},
};

/// Pixels around a source within which its glare cannot be told from its image.
const UNRESOLVED_PX: f64 = 2.0;

impl Context<'_> {
    /// From now on frames show scattered light alone.
    fn scatter_all(&mut self) {
        self.settings.glare = GlareSettings { fraction: 1.0, absolute: false, ..self.glare.clone() };
    }

    /// Whether the method has a kernel of its own, so that one factor is fitted before it is judged.
    fn scatters_by_its_own_kernel(&self) -> bool {
        PyramidAxes::of(self.glare.chosen(self.method())).is_some()
    }

    /// The kernel that glare should have.
    fn expected_kernel(&self) -> Result<Arc<dyn GlareKernel>, CheckError> {
        Ok(self.expected_glare.kernel()?)
    }

    /// Factor to take scattered light by before it is judged, and what to say about it.
    fn glare_scale(&self, pairs: &[(f64, f64)]) -> Result<(f64, &'static str), CheckError> {
        if self.scatters_by_its_own_kernel() {
            Ok((metrics::fitted_scale(pairs)?, ", after one scale"))
        } else {
            Ok((1.0, ""))
        }
    }
}

/// An image of a frame, and what f64 needs to say what it should show.
struct Picture<'a> {
    /// Name of its view.
    name: &'a str,
    /// Its pixels, turned to the axes of the camera.
    hdr: HdrView<'a>,
    of_view: &'a ViewImage,
    /// Every source as the image's eye sees it, in the axes of the image.
    sources: Vec<SkyStar>,
}

impl Picture<'_> {
    /// The pixel that shows a direction in camera axes.
    fn pixel_of(&self, direction: DVec3) -> Option<[u32; 2]> {
        let mapping = self.hdr.mapping();
        let at = mapping.pixel_from_direction(self.of_view.camera_from_view.conjugate() * direction)?;
        let is_inside = at.min_element() >= 0.0 && mapping.contains(at.x as u32, at.y as u32);
        is_inside.then_some([at.x as u32, at.y as u32])
    }

    /// Scattered light as it should be.
    fn veil<'b>(&'b self, kernel: &'b dyn GlareKernel) -> Veil<'b> {
        Veil { sources: &self.sources, kernel, fraction: 1.0 }
    }

    /// Luminance of a pixel over what it should be. NaN for a pixel outside of the picture.
    fn ratio(&self, kernel: &dyn GlareKernel, [x, y]: [u32; 2]) -> f64 {
        let expected = self.veil(kernel).over_pixel(self.hdr.mapping(), [x, y]);
        expected.map_or(f64::NAN, |expected| self.hdr.luminance_cd_m2(x, y) / luminance(expected))
    }
}

/// The images of a frame.
fn pictures<'a>(scene: &SceneSnapshot, rig: &'a Rig, frame: &'a Frame) -> Result<Vec<Picture<'a>>, CheckError> {
    let viewports = rig.viewports(scene.camera.world_from_camera);
    if frame.images.len() != viewports.len() {
        return Err(CheckError::Missing("an image"));
    }
    let of_image = |((image, of_view), viewport): ((&'a _, &'a ViewImage), &crate::view::Viewport)| {
        let eye = Eye {
            position_m: scene.camera.position_m + viewport.eye_offset_m,
            world_from_view: viewport.world_from_view,
            velocity_c: scene.camera.velocity_c,
        };
        Ok(Picture {
            name: &rig.views()[viewport.view].name,
            hdr: hdr_view(image, of_view.projection.mapping())?.turned(of_view.camera_from_view),
            of_view,
            sources: stars_for(&scene.stars, eye, 0.0),
        })
    };
    images(frame, rig).zip(&viewports).map(of_image).collect()
}

/// A unit vector at an angle from -z, towards +x at azimuth 0 and +y at 90 degrees.
fn off_axis(off_deg: f64, azimuth_deg: f64) -> DVec3 {
    let ((sine, cosine), (up, right)) = (off_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
    DVec3::new(sine * right, sine * up, -cosine)
}

/// A view turned so that what stands at `place` in camera axes is seen at `direction` in its own.
fn turned(name: &str, kind: &ViewKind, direction: DVec3, place: DVec3) -> Result<View, RigError> {
    View::new(name, kind.clone(), DQuat::from_rotation_arc(direction.normalize(), place.normalize()), DVec3::ZERO)
}

/// A square flat window.
fn flat(side: u32, degrees: f64) -> ViewKind {
    ViewKind::Perspective { size: [side; 2], fov_y_rad: degrees.to_radians() }
}

/// Two eyes that see as far to every side.
fn stereo(side: u32, degrees: f64) -> ViewKind {
    let half = 0.5 * degrees.to_radians();
    let fov = Fov { left_rad: -half, right_rad: half, up_rad: half, down_rad: -half };
    ViewKind::Stereo { size: [side; 2], ipd_m: 0.064, fov_left: fov, fov_right: fov }
}

//! Glare: every view shows the light that the kernel scatters towards it. The light is round in view space, complete,
//! and includes light from sources beyond the borders of the view.
//!
//! Most checks evaluate only scattered light: with a fraction of 1, a picture contains nothing else. The expected
//! values come from [`crate::reference::glare::sky_cube`] for the eye of each image. Within two pixels of a source,
//! scattered light cannot be distinguished from the source's own image; [`profile`] judges that region by its sum.
//! Pyramids have a fixed kernel, which has no settings and no definite end. They are compared with the kernel of the
//! settings after fitting one scale.
//!
//! To place sources in a view, the view is turned and the scene stays the same. All views are in one rig if possible.
//! Thus methods keep the data that they keep between the frames of a running system.

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

/// Radius around a source within which its glare cannot be distinguished from its image, pixels.
const UNRESOLVED_PX: f64 = 2.0;

impl Context<'_> {
    /// Changes the settings so that frames contain only scattered light.
    fn scatter_all(&mut self) {
        self.settings.glare = GlareSettings { fraction: 1.0, absolute: false, ..self.glare.clone() };
    }

    /// Whether the method has a fixed kernel. If so, one factor is fitted before its light is judged.
    fn has_fixed_kernel(&self) -> bool {
        PyramidAxes::for_method(self.glare.chosen(self.method())).is_some()
    }

    /// Returns the kernel that glare should have.
    fn expected_kernel(&self) -> Result<Arc<dyn GlareKernel>, CheckError> {
        Ok(self.expected_glare.kernel()?)
    }

    /// Returns the factor by which scattered light is multiplied before it is judged, and a note about it for the figure.
    fn glare_scale(&self, pairs: &[(f64, f64)]) -> Result<(f64, &'static str), CheckError> {
        if self.has_fixed_kernel() { Ok((metrics::fitted_scale(pairs)?, ", after one scale")) } else { Ok((1.0, "")) }
    }
}

/// An image of a frame with the data to compute its expected pixels in f64.
struct Picture<'a> {
    /// Name of the view.
    name: &'a str,
    /// Pixels, turned to the axes of the camera.
    hdr: HdrView<'a>,
    view_image: &'a ViewImage,
    /// Every source, as the eye of the image sees it, in the axes of the image.
    sources: Vec<SkyStar>,
}

impl Picture<'_> {
    /// Returns the pixel that shows a direction in camera axes.
    fn pixel_of(&self, direction: DVec3) -> Option<[u32; 2]> {
        let mapping = self.hdr.mapping();
        let pixel = mapping.pixel_from_direction(self.view_image.camera_from_view.conjugate() * direction)?;
        let is_inside = pixel.min_element() >= 0.0 && mapping.contains(pixel.x as u32, pixel.y as u32);
        is_inside.then_some([pixel.x as u32, pixel.y as u32])
    }

    /// Returns the expected scattered light.
    fn veil<'b>(&'b self, kernel: &'b dyn GlareKernel) -> Veil<'b> {
        Veil { sources: &self.sources, kernel, fraction: 1.0 }
    }

    /// Ratio of a pixel's luminance to its expected value; NaN for a pixel outside of the picture.
    fn ratio(&self, kernel: &dyn GlareKernel, [x, y]: [u32; 2]) -> f64 {
        let expected = self.veil(kernel).over_pixel(self.hdr.mapping(), [x, y]);
        expected.map_or(f64::NAN, |expected| self.hdr.luminance_cd_m2(x, y) / luminance(expected))
    }
}

/// Returns the images of a frame.
fn pictures<'a>(scene: &SceneSnapshot, rig: &'a Rig, frame: &'a Frame) -> Result<Vec<Picture<'a>>, CheckError> {
    let viewports = rig.viewports(scene.camera.world_from_camera);
    if frame.images.len() != viewports.len() {
        return Err(CheckError::Missing("an image"));
    }
    let of_image = |((image, view_image), viewport): ((&'a _, &'a ViewImage), &crate::view::Viewport)| {
        let eye = Eye {
            position_m: scene.camera.position_m + viewport.eye_offset_m,
            world_from_view: viewport.world_from_view,
            velocity_c: scene.camera.velocity_c,
        };
        Ok(Picture {
            name: &rig.views()[viewport.view].name,
            hdr: hdr_view(image, view_image.projection.mapping())?.turned(view_image.camera_from_view),
            view_image,
            sources: stars_for(&scene.stars, eye, 0.0),
        })
    };
    images(frame, rig).zip(&viewports).map(of_image).collect()
}

/// Returns a unit vector at an angle from -z, towards +x at azimuth 0 and +y at 90 degrees.
fn off_axis(off_deg: f64, azimuth_deg: f64) -> DVec3 {
    let ((sine, cosine), (up, right)) = (off_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
    DVec3::new(sine * right, sine * up, -cosine)
}

/// Returns a view turned so that `place` in camera axes is seen at `direction` in the view's axes.
fn turned(name: &str, kind: &ViewKind, direction: DVec3, place: DVec3) -> Result<View, RigError> {
    View::new(name, kind.clone(), DQuat::from_rotation_arc(direction.normalize(), place.normalize()), DVec3::ZERO)
}

/// Returns a square flat window.
fn flat(side: u32, degrees: f64) -> ViewKind {
    ViewKind::Perspective { size: [side; 2], fov_y_rad: degrees.to_radians() }
}

/// Returns two eyes with the same field of view to all sides.
fn stereo(side: u32, degrees: f64) -> ViewKind {
    let half = 0.5 * degrees.to_radians();
    let fov = Fov { left_rad: -half, right_rad: half, up_rad: half, down_rad: -half };
    ViewKind::Stereo { size: [side; 2], ipd_m: 0.064, fov_left: fov, fov_right: fov }
}

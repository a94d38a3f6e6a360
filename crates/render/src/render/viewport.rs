//! Encodes viewports for the shaders.

use std::f64::consts::PI;

use glam::DMat3;

use super::layout;
use crate::render::constants::projections::{
    KIND_CUBE_FACE, KIND_EQUIDISTANT, KIND_EQUIRECTANGULAR, KIND_EQUISOLID, KIND_ORTHOGRAPHIC, KIND_PERSPECTIVE,
    KIND_STEREOGRAPHIC,
};
use crate::render::constants::tabulated::KIND_TABULATED;
use crate::{
    plan::{GaussianKernel, KernelPlan},
    units::PARSEC_M,
    view::{
        Viewport,
        projection::{FisheyeMapping, Perspective, PlaneMapping, Projection},
    },
};

/// If the midpoint formula of the solid angle has a greater relative error, the shader averages nine points.
const MIDPOINT_TOLERANCE: f64 = 3e-6;

/// Encodes a viewport with the kernels of its stars. For a tabulated viewport the caller adds the position of the
/// table.
pub(crate) fn encode_viewport(viewport: &Viewport, kernels: &KernelPlan) -> layout::Viewport {
    let view_from_world = DMat3::from_quat(viewport.world_from_view.conjugate());
    let eye_pc = viewport.eye_offset_m / PARSEC_M;
    let row = |index: usize| {
        let row = view_from_world.row(index);
        [row.x as f32, row.y as f32, row.z as f32, eye_pc[index] as f32]
    };
    let size = viewport.size();
    let width = match kernels.gaussian {
        GaussianKernel::Round(width) => Some(width),
        GaussianKernel::Plane => None,
    };
    // Fields common to all projections.
    let mut encoded = layout::Viewport {
        view_from_world_x: row(0),
        view_from_world_y: row(1),
        view_from_world_z: row(2),
        size,
        kind: KIND_PERSPECTIVE,
        tent_below_cd_m2: finite_f32(kernels.tent_below_cd_m2),
        gaussian_from_cd_m2: finite_f32(kernels.gaussian_from_cd_m2),
        gaussian_sigma_rad: width.map_or(0.0, |width| width.sigma_rad as f32),
        gaussian_sigma_px: width.map_or(0.0, |width| width.sigma_px as f32),
        gaussian_reach_px: kernels.gaussian_reach_px as f32,
        view: viewport.view as u32,
        viewing_circle_m: viewport.viewing_circle_m as f32,
        ..Default::default()
    };
    // Fields of the projection.
    match &viewport.projection {
        Projection::Perspective(plane) => encode_plane(&mut encoded, plane, size),
        Projection::CubeFace(face) => {
            encode_plane(&mut encoded, face.plane(), size);
            encoded.kind = KIND_CUBE_FACE;
            encoded.face = face.face as u32;
        }
        Projection::Fisheye(fisheye) => {
            let radius = fisheye.radius_px() as f32;
            encoded.plane_scale = [radius; 2];
            encoded.plane_offset = [size[0] as f32 / 2.0, size[1] as f32 / 2.0];
            encoded.rim = fisheye.rim as f32;
            encoded.full_sphere = u32::from(fisheye.is_full_sphere());
            (encoded.kind, encoded.rim_complement) = match fisheye.mapping {
                FisheyeMapping::Equidistant => (KIND_EQUIDISTANT, (PI - fisheye.rim) as f32),
                FisheyeMapping::Equisolid => (KIND_EQUISOLID, 0.0),
                FisheyeMapping::Orthographic => (KIND_ORTHOGRAPHIC, fisheye.half_fov_rad.cos().powi(2) as f32),
                FisheyeMapping::Stereographic => (KIND_STEREOGRAPHIC, 0.0),
            };
            // Test the centre and three points farther out. The shader treats the orthographic rim separately.
            let [x, y] = [size[0] / 2, size[1] / 2];
            encoded.quadrature = u32::from([0.0, 0.3, 0.6, 0.9].iter().any(|part| {
                let column = (x + (fisheye.radius_px() * part) as u32).min(size[0] - 1);
                let exact = fisheye.solid_angle_sr(column, y.min(size[1] - 1));
                let midpoint = fisheye.midpoint_solid_angle_sr(column, y.min(size[1] - 1));
                exact > 0.0 && (midpoint / exact - 1.0).abs() > MIDPOINT_TOLERANCE
            }));
        }
        Projection::Equirectangular(_) => encoded.kind = KIND_EQUIRECTANGULAR,
        Projection::Tabulated(table) => {
            encoded.kind = KIND_TABULATED;
            encoded.plane_scale = [1.0; 2];
            encoded.full_sphere = u32::from(table.shows_full_sphere());
        }
    }
    encoded
}

/// Converts to f32; values that are too large become the greatest finite f32.
fn finite_f32(value: f64) -> f32 {
    value.min(f64::from(f32::MAX)) as f32
}

fn encode_plane(encoded: &mut layout::Viewport, plane: &Perspective, size: [u32; 2]) {
    let [left, right, down, up] = plane.edge_tangents(0.0);
    let scale = [f64::from(size[0]) / (right - left), -f64::from(size[1]) / (up - down)];
    encoded.plane_scale = scale.map(|value| value as f32);
    encoded.plane_offset = [(-left * scale[0]) as f32, (-up * scale[1]) as f32];
    // The fourth-order term that the shader's series omits is about step^4 / 40.
    let step = (1.0 / scale[0]).abs().max((1.0 / scale[1]).abs());
    encoded.quadrature = u32::from(step.powi(4) / 40.0 > MIDPOINT_TOLERANCE / 3.0);
}

//! Between protobuf messages and plain types. Nothing else in the crate sees a generated type.

use glam::{DQuat, DVec3};

use super::{proto, render::CameraUpdate};
use crate::{gpu::AdapterReport, output::Encoding, scene::Camera, view::View};

pub(super) fn vector_to_pb(v: DVec3) -> proto::Vector3 {
    proto::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(super) fn vector_from_pb(v: proto::Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(super) fn quaternion_from_pb(q: proto::Quaternion) -> [f64; 4] {
    [q.x, q.y, q.z, q.w]
}

pub(super) fn camera_to_pb(camera: &Camera) -> proto::Camera {
    let DQuat { x, y, z, w } = camera.world_from_camera;
    proto::Camera {
        position_m: Some(vector_to_pb(camera.position_m)),
        orientation: Some(proto::Quaternion { x, y, z, w }),
        velocity_c: Some(vector_to_pb(camera.velocity_c)),
        revision: camera.revision,
    }
}

pub(super) fn update_from_pb(request: proto::SetCameraRequest) -> CameraUpdate {
    CameraUpdate {
        position_m: request.position_m.map(vector_from_pb),
        orientation: request.orientation.map(quaternion_from_pb),
        velocity_c: request.velocity_c.map(vector_from_pb),
    }
}

pub(super) fn update_to_pb(update: &CameraUpdate) -> proto::SetCameraRequest {
    proto::SetCameraRequest {
        position_m: update.position_m.map(|[x, y, z]| proto::Vector3 { x, y, z }),
        orientation: update.orientation.map(|[x, y, z, w]| proto::Quaternion { x, y, z, w }),
        velocity_c: update.velocity_c.map(|[x, y, z]| proto::Vector3 { x, y, z }),
    }
}

pub(super) fn view_to_pb(view: &View) -> proto::View {
    let images = view.images.iter().map(|image| {
        let [width, height] = image.projection.mapping().size();
        proto::ViewImage { part: image.part.name().unwrap_or_default().to_owned(), width, height }
    });
    proto::View { name: view.name.clone(), r#type: view.kind.type_name().to_owned(), images: images.collect() }
}

pub(super) fn encoding_to_pb(encoding: Encoding) -> proto::Encoding {
    match encoding {
        Encoding::Rgba8 => proto::Encoding::Rgba8,
        Encoding::Png => proto::Encoding::Png,
        Encoding::Jpeg => proto::Encoding::Jpeg,
        Encoding::Rgb32f => proto::Encoding::Rgb32f,
        Encoding::Exr => proto::Encoding::Exr,
    }
}

/// `None`: the number stands for no encoding.
pub(super) fn encoding_from_pb(encoding: i32) -> Option<Encoding> {
    match proto::Encoding::try_from(encoding).ok()? {
        proto::Encoding::Unspecified => None,
        proto::Encoding::Rgba8 => Some(Encoding::Rgba8),
        proto::Encoding::Png => Some(Encoding::Png),
        proto::Encoding::Jpeg => Some(Encoding::Jpeg),
        proto::Encoding::Rgb32f => Some(Encoding::Rgb32f),
        proto::Encoding::Exr => Some(Encoding::Exr),
    }
}

pub(super) fn info_to_pb(
    adapter: &AdapterReport,
    stars: u64,
    scene_revision: u64,
    frames_rendered: u64,
) -> proto::Info {
    proto::Info {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        adapter: adapter.adapter.clone(),
        driver: adapter.driver.clone(),
        backend: adapter.backend.clone(),
        device_type: adapter.device_type.clone(),
        features: adapter.features.clone(),
        limits: adapter.limits.iter().cloned().collect(),
        fallbacks: adapter.fallbacks.clone(),
        stars,
        scene_revision,
        frames_rendered,
    }
}

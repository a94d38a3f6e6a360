//! Between protobuf messages and plain types. Nothing else in the crate sees a generated type.

use glam::{DQuat, DVec3};

use super::{engine::EngineInfo, pb, render::CameraUpdate};
use crate::{output::Encoding, scene::Camera, view::View};

pub(super) fn vector_to_pb(v: DVec3) -> pb::Vector3 {
    pb::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(super) fn vector_from_pb(v: pb::Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(super) fn quaternion_from_pb(q: pb::Quaternion) -> [f64; 4] {
    [q.x, q.y, q.z, q.w]
}

pub(super) fn camera_to_pb(camera: &Camera) -> pb::Camera {
    let DQuat { x, y, z, w } = camera.world_from_camera;
    pb::Camera {
        position_m: Some(vector_to_pb(camera.position_m)),
        orientation: Some(pb::Quaternion { x, y, z, w }),
        velocity_c: Some(vector_to_pb(camera.velocity_c)),
        revision: camera.revision,
    }
}

pub(super) fn update_from_pb(request: pb::SetCameraRequest) -> CameraUpdate {
    CameraUpdate {
        position_m: request.position_m.map(vector_from_pb),
        orientation: request.orientation.map(quaternion_from_pb),
        velocity_c: request.velocity_c.map(vector_from_pb),
    }
}

pub(super) fn update_to_pb(update: &CameraUpdate) -> pb::SetCameraRequest {
    pb::SetCameraRequest {
        position_m: update.position_m.map(|[x, y, z]| pb::Vector3 { x, y, z }),
        orientation: update.orientation.map(|[x, y, z, w]| pb::Quaternion { x, y, z, w }),
        velocity_c: update.velocity_c.map(|[x, y, z]| pb::Vector3 { x, y, z }),
    }
}

pub(super) fn view_to_pb(view: &View) -> pb::View {
    let images = view.images.iter().map(|image| {
        let [width, height] = image.projection.mapping().size();
        pb::ViewImage { part: image.part.name().unwrap_or_default().to_owned(), width, height }
    });
    pb::View { name: view.name.clone(), r#type: view.kind.type_name().to_owned(), images: images.collect() }
}

pub(super) fn encoding_to_pb(encoding: Encoding) -> pb::Encoding {
    match encoding {
        Encoding::Rgba8 => pb::Encoding::Rgba8,
        Encoding::Png => pb::Encoding::Png,
        Encoding::Jpeg => pb::Encoding::Jpeg,
        Encoding::Rgb32f => pb::Encoding::Rgb32f,
        Encoding::Exr => pb::Encoding::Exr,
    }
}

/// `None`: the number stands for no encoding.
pub(super) fn encoding_from_pb(encoding: i32) -> Option<Encoding> {
    match pb::Encoding::try_from(encoding).ok()? {
        pb::Encoding::Unspecified => None,
        pb::Encoding::Rgba8 => Some(Encoding::Rgba8),
        pb::Encoding::Png => Some(Encoding::Png),
        pb::Encoding::Jpeg => Some(Encoding::Jpeg),
        pb::Encoding::Rgb32f => Some(Encoding::Rgb32f),
        pb::Encoding::Exr => Some(Encoding::Exr),
    }
}

pub(super) fn info_to_pb(engine: &EngineInfo, stars: u64, scene_revision: u64, frames_rendered: u64) -> pb::Info {
    pb::Info {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        adapter: engine.adapter.clone(),
        driver: engine.driver.clone(),
        backend: engine.backend.clone(),
        features: engine.features.clone(),
        limits: engine.limits.iter().cloned().collect(),
        fallbacks: engine.fallbacks.clone(),
        stars,
        scene_revision,
        frames_rendered,
    }
}

//! Cameras, vectors and reference frames: conversion between protobuf messages and plain types.

use glam::{DQuat, DVec3};

use super::objects::{time_from_j2000, time_from_pb, time_to_pb};
use crate::{
    observer::Frame,
    scene::{Camera, PoseError},
    service::{
        proto,
        scene::camera::{CameraUpdate, Horizontal},
    },
};

/// Reasons why a message is not a valid camera.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CameraMessageError {
    /// A field is missing or invalid.
    #[error("the answer lacks a valid {0}")]
    Field(&'static str),
    /// The values are out of range.
    #[error("the answer holds an impossible camera: {0}")]
    Pose(#[from] PoseError),
}

pub(crate) fn vector_to_pb(v: DVec3) -> proto::Vector3 {
    proto::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(crate) fn vector_from_pb(v: proto::Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

pub(crate) fn quaternion_from_pb(q: proto::Quaternion) -> [f64; 4] {
    [q.x, q.y, q.z, q.w]
}

fn quaternion_to_pb([x, y, z, w]: [f64; 4]) -> proto::Quaternion {
    proto::Quaternion { x, y, z, w }
}

pub(crate) fn camera_to_pb(camera: &Camera) -> proto::Camera {
    let DQuat { x, y, z, w } = camera.world_from_camera;
    proto::Camera {
        position_m: Some(vector_to_pb(camera.position_m)),
        orientation: Some(proto::Quaternion { x, y, z, w }),
        velocity_c: Some(vector_to_pb(camera.velocity_c)),
        revision: camera.revision,
        holder: String::new(),
        frame: sky_frame_to_pb(camera.frame).into(),
        scene_time: camera.frame.turns().then(|| time_to_pb(camera.as_of_s)).flatten(),
        scene_time_j2000_s: camera.frame.turns().then_some(camera.as_of_s),
        look: None,
    }
}

/// Returns the message of a direction for the scene's observer.
pub(crate) fn horizontal_to_pb(horizontal: Horizontal) -> proto::Look {
    proto::Look {
        frame: proto::SkyFrame::Horizon.into(),
        longitude_deg: horizontal.azimuth_deg,
        latitude_deg: horizontal.altitude_deg,
        roll_deg: horizontal.roll_deg,
        ..proto::Look::default()
    }
}

pub(crate) fn sky_frame_to_pb(frame: Frame) -> proto::SkyFrame {
    match frame {
        Frame::Icrs => proto::SkyFrame::Icrs,
        Frame::Galactic => proto::SkyFrame::Galactic,
        Frame::Ecliptic => proto::SkyFrame::Ecliptic,
        Frame::Horizon => proto::SkyFrame::Horizon,
        Frame::Sun => proto::SkyFrame::Sun,
        Frame::Mercury => proto::SkyFrame::Mercury,
        Frame::Venus => proto::SkyFrame::Venus,
        Frame::Earth => proto::SkyFrame::Earth,
        Frame::Moon => proto::SkyFrame::Moon,
        Frame::Mars => proto::SkyFrame::Mars,
        Frame::Jupiter => proto::SkyFrame::Jupiter,
        Frame::Saturn => proto::SkyFrame::Saturn,
        Frame::Uranus => proto::SkyFrame::Uranus,
        Frame::Neptune => proto::SkyFrame::Neptune,
        Frame::Io => proto::SkyFrame::Io,
        Frame::Europa => proto::SkyFrame::Europa,
        Frame::Ganymede => proto::SkyFrame::Ganymede,
        Frame::Callisto => proto::SkyFrame::Callisto,
        Frame::Titan => proto::SkyFrame::Titan,
    }
}

/// Returns the reference frame of a protobuf number; `None` if it is unspecified. The error lists the valid values.
pub(crate) fn sky_frame_from_pb(frame: i32) -> Result<Option<Frame>, String> {
    match proto::SkyFrame::try_from(frame) {
        Ok(proto::SkyFrame::Unspecified) => Ok(None),
        Ok(proto::SkyFrame::Icrs) => Ok(Some(Frame::Icrs)),
        Ok(proto::SkyFrame::Galactic) => Ok(Some(Frame::Galactic)),
        Ok(proto::SkyFrame::Ecliptic) => Ok(Some(Frame::Ecliptic)),
        Ok(proto::SkyFrame::Horizon) => Ok(Some(Frame::Horizon)),
        Ok(proto::SkyFrame::Sun) => Ok(Some(Frame::Sun)),
        Ok(proto::SkyFrame::Mercury) => Ok(Some(Frame::Mercury)),
        Ok(proto::SkyFrame::Venus) => Ok(Some(Frame::Venus)),
        Ok(proto::SkyFrame::Earth) => Ok(Some(Frame::Earth)),
        Ok(proto::SkyFrame::Moon) => Ok(Some(Frame::Moon)),
        Ok(proto::SkyFrame::Mars) => Ok(Some(Frame::Mars)),
        Ok(proto::SkyFrame::Jupiter) => Ok(Some(Frame::Jupiter)),
        Ok(proto::SkyFrame::Saturn) => Ok(Some(Frame::Saturn)),
        Ok(proto::SkyFrame::Uranus) => Ok(Some(Frame::Uranus)),
        Ok(proto::SkyFrame::Neptune) => Ok(Some(Frame::Neptune)),
        Ok(proto::SkyFrame::Io) => Ok(Some(Frame::Io)),
        Ok(proto::SkyFrame::Europa) => Ok(Some(Frame::Europa)),
        Ok(proto::SkyFrame::Ganymede) => Ok(Some(Frame::Ganymede)),
        Ok(proto::SkyFrame::Callisto) => Ok(Some(Frame::Callisto)),
        Ok(proto::SkyFrame::Titan) => Ok(Some(Frame::Titan)),
        Err(_) => Err(format!(
            "frame = {frame}: must be one of SKY_FRAME_ICRS, SKY_FRAME_GALACTIC, SKY_FRAME_ECLIPTIC, SKY_FRAME_HORIZON and the bodies from SKY_FRAME_SUN to SKY_FRAME_TITAN"
        )),
    }
}

pub(crate) fn update_from_pb(request: proto::SetCameraRequest) -> CameraUpdate {
    CameraUpdate {
        position_m: request.position_m.map(vector_from_pb),
        orientation: request.orientation.map(quaternion_from_pb),
        turn: request.turn.map(quaternion_from_pb),
        velocity_c: request.velocity_c.map(vector_from_pb),
        frame: None,
    }
}

/// Returns the update that sets a camera; the error describes the invalid field.
pub(crate) fn camera_update_from_pb(camera: proto::Camera) -> Result<CameraUpdate, String> {
    Ok(CameraUpdate {
        position_m: camera.position_m.map(vector_from_pb),
        orientation: camera.orientation.map(quaternion_from_pb),
        turn: None,
        velocity_c: camera.velocity_c.map(vector_from_pb),
        frame: sky_frame_from_pb(camera.frame)?,
    })
}

pub(crate) fn update_to_pb(update: &CameraUpdate) -> proto::SetCameraRequest {
    proto::SetCameraRequest {
        position_m: update.position_m.map(|[x, y, z]| proto::Vector3 { x, y, z }),
        orientation: update.orientation.map(quaternion_to_pb),
        turn: update.turn.map(quaternion_to_pb),
        velocity_c: update.velocity_c.map(|[x, y, z]| proto::Vector3 { x, y, z }),
        expected_revision: None,
        look: None,
        frame: update.frame.map_or(proto::SkyFrame::Unspecified, sky_frame_to_pb).into(),
    }
}

/// Reads a camera that the daemon has sent or saved.
pub(crate) fn camera_from_pb(camera: proto::Camera) -> Result<Camera, CameraMessageError> {
    let lacks = |field| CameraMessageError::Field(field);
    let plain = Camera::new(
        camera.position_m.map(vector_from_pb).ok_or_else(|| lacks("position_m"))?,
        camera.orientation.map(quaternion_from_pb).ok_or_else(|| lacks("orientation"))?,
        camera.velocity_c.map(vector_from_pb).ok_or_else(|| lacks("velocity_c"))?,
    )?;
    let frame = sky_frame_from_pb(camera.frame).map_err(|_| lacks("frame"))?.unwrap_or_default();
    // Cameras that were saved by an older version have only the timestamp.
    let as_of_s = match (camera.scene_time_j2000_s, camera.scene_time) {
        (Some(time_s), _) => time_from_j2000(Some(time_s)).map_err(|_| lacks("scene_time_j2000_s"))?,
        (None, Some(time)) => time_from_pb(Some(time)).map_err(|_| lacks("scene_time"))?,
        (None, None) => 0.0,
    };
    Ok(Camera { frame, as_of_s, revision: camera.revision, ..plain })
}

//! The cue of a STATE as protobuf: the inputs that a node needs for a frame, in addition to its configuration and the scene.

use glam::{DQuat, DVec3};
use prost::Message;

use crate::{
    scene::Camera,
    service::{
        engine::led::Cue,
        wire::camera::{sky_frame_from_pb, sky_frame_to_pb},
    },
};

/// Every number that affects pixels is sent as its exact bit pattern.
#[derive(Clone, PartialEq, Message)]
struct CuePb {
    #[prost(uint64, tag = "1")]
    scene: u64,
    #[prost(bytes = "vec", tag = "2")]
    scene_hash: Vec<u8>,
    #[prost(double, tag = "3")]
    time_s: f64,
    #[prost(double, repeated, tag = "4")]
    position_m: Vec<f64>,
    #[prost(double, repeated, tag = "5")]
    orientation: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    velocity_c: Vec<f64>,
    #[prost(int32, tag = "7")]
    frame: i32,
    #[prost(double, tag = "8")]
    as_of_s: f64,
    #[prost(uint64, tag = "9")]
    camera: u64,
    #[prost(bool, tag = "10")]
    rests: bool,
    #[prost(uint32, tag = "11")]
    level: u32,
    #[prost(float, repeated, tag = "12")]
    ev100: Vec<f32>,
}

/// A cue, and the hash of the scene for which it was composed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HashedCue {
    pub(super) cue: Cue,
    pub(super) scene_hash: [u8; 32],
}

/// Encodes a cue.
pub(super) fn encode(HashedCue { cue, scene_hash }: &HashedCue) -> Vec<u8> {
    let Camera { position_m, world_from_camera, velocity_c, frame, as_of_s, revision } = cue.camera;
    CuePb {
        scene: cue.scene,
        scene_hash: scene_hash.to_vec(),
        time_s: cue.time_s,
        position_m: position_m.to_array().to_vec(),
        orientation: world_from_camera.to_array().to_vec(),
        velocity_c: velocity_c.to_array().to_vec(),
        frame: sky_frame_to_pb(frame).into(),
        as_of_s,
        camera: revision,
        rests: cue.rests,
        level: cue.level,
        ev100: cue.ev100.clone(),
    }
    .encode_to_vec()
}

/// Decodes the cue of a frame.
pub(super) fn decode(number: u64, bytes: &[u8]) -> Result<HashedCue, String> {
    let cue = CuePb::decode(bytes).map_err(|error| error.to_string())?;
    let vector = |values: Vec<f64>| <[f64; 3]>::try_from(values).map(DVec3::from).map_err(|_| "no vector".to_owned());
    let orientation = <[f64; 4]>::try_from(cue.orientation).map_err(|_| "no quaternion".to_owned())?;
    let camera = Camera {
        position_m: vector(cue.position_m)?,
        world_from_camera: DQuat::from_array(orientation),
        velocity_c: vector(cue.velocity_c)?,
        frame: sky_frame_from_pb(cue.frame)?.ok_or("no frame of reference")?,
        as_of_s: cue.as_of_s,
        revision: cue.camera,
    };
    let scene_hash = cue.scene_hash.try_into().map_err(|_| "no hash of the scene".to_owned())?;
    let (level, ev100, rests) = (cue.level, cue.ev100, cue.rests);
    Ok(HashedCue { cue: Cue { number, scene: cue.scene, time_s: cue.time_s, camera, rests, level, ev100 }, scene_hash })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn a_cue_arrives_with_the_same_bits() {
        let camera = Camera {
            position_m: DVec3::new(1.0 / 3.0, -0.0, 1e300),
            world_from_camera: DQuat::from_rotation_x(0.1),
            velocity_c: DVec3::new(0.1, 0.2, 0.3),
            frame: crate::observer::Frame::Mars,
            as_of_s: 7.1,
            revision: 8,
        };
        let ev100 = vec![0.1, -3.3];
        let cue = Cue { number: 5, scene: 6, time_s: 0.1 + 0.2, camera, rests: true, level: 2, ev100 };
        let sent = HashedCue { cue, scene_hash: [3; 32] };
        let bytes = encode(&sent);
        let heard = decode(5, &bytes).unwrap();
        assert_eq!(heard, sent);
        assert_eq!(heard.cue.camera.position_m.y.to_bits(), (-0.0_f64).to_bits());
        assert!(decode(5, &bytes[1..]).is_err() && decode(5, &[]).is_err());
    }
}

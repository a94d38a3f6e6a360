//! Takes images from the swapchains: the order of a test, and the result, which the program of the runtime writes to
//! files for the test.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use glam::{DQuat, DVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};
use steradian::{
    config::Config,
    plan::settings::{HeadsetSettings, ReferenceSpace, RenderSettings, SwapchainFormat, SwapchainLayout},
    scene::{
        SceneSnapshot,
        bodies::{Body, Emission, SolarBody},
        loader::load_stars,
    },
    view::{Eye, Fov, Rig, View, ViewKind, projection::PlaneMapping},
    xr::{CapturedImage, CapturedPixels},
};

use crate::monado::{Pose, RemoteState, Service};

/// Environment variable that names the folder with the order and the images.
pub const FOLDER_VARIABLE: &str = "STERADIAN_TEST_FOLDER";
/// Time limit of a program, which takes some seconds on an idle machine.
const LIMIT: Duration = Duration::from_secs(240);

/// A sphere with uniform luminance over its disc.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Sphere {
    /// Position of its centre in the room, m.
    pub position_m: [f64; 3],
    /// Its radius, m.
    pub radius_m: f64,
    /// Its luminance, cd/m^2.
    pub luminance_cd_m2: f64,
}

/// Content of a shot.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Assignment {
    /// State of the headset.
    pub state: RemoteState,
    /// Configuration with the scene and its settings, TOML.
    pub scene: String,
    /// Bodies in addition to those of the configuration.
    pub spheres: Vec<Sphere>,
    /// Whether the host requests the frame too, as a mirror does.
    pub mirrored: bool,
}

impl Assignment {
    pub fn new(state: RemoteState, scene: &str) -> Self {
        Self { state, scene: scene.to_owned(), spheres: Vec::new(), mirrored: false }
    }

    pub fn mirrored(self) -> Self {
        Self { mirrored: true, ..self }
    }

    /// Loads the scene and its settings.
    pub fn load(&self) -> (SceneSnapshot, RenderSettings) {
        let config = Config::from_text(&self.scene, "the test's scene", Path::new(""), &[]).unwrap();
        let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| {}).unwrap();
        let mut objects = config.objects().unwrap();
        for (index, sphere) in self.spheres.iter().enumerate() {
            let mut body =
                Body::preset(SolarBody::Moon, &format!("sphere-{index}"), DVec3::from_array(sphere.position_m));
            body.radii_m = DVec3::splat(sphere.radius_m);
            body.surface.geometric_albedo = [0.0; 3];
            body.surface.texture = None;
            body.emission =
                Some(Emission { luminance_cd_m2: [sphere.luminance_cd_m2; 3], limb_darkening: 0.0, corona: false });
            body.check().unwrap();
            objects.bodies.push(Arc::new(body));
        }
        let camera = config.camera().unwrap();
        let snapshot = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects: Arc::new(objects), camera };
        (snapshot, config.render_settings())
    }
}

/// Order for the program.
#[derive(Debug, Serialize, Deserialize)]
pub struct Order {
    /// Port of the remote driver.
    pub port: u16,
    pub settings: HeadsetSettings,
    pub assignments: Vec<Assignment>,
}

/// Output of the program for each shot. Numbers are written as the bits of f64, so that none is rounded.
#[derive(Debug, Serialize, Deserialize)]
pub struct Taken {
    pub eyes: [EyeBits; 2],
    /// Whether the images hold linear light.
    pub linear: bool,
    /// Exposure of the frame received by the host.
    pub exposure_ev100: Option<u64>,
}

/// An eye, as bits of f64.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct EyeBits {
    /// Width and height, pixels.
    size: [u32; 2],
    /// Left, right, up, down, rad.
    fov: [u64; 4],
    /// x, y, z, w.
    orientation: [u64; 4],
    /// Position in the room, m.
    position: [u64; 3],
}

impl From<Eye> for EyeBits {
    fn from(Eye { size, fov, room_from_eye, position_m }: Eye) -> Self {
        Self {
            size,
            fov: [fov.left_rad, fov.right_rad, fov.up_rad, fov.down_rad].map(f64::to_bits),
            orientation: room_from_eye.to_array().map(f64::to_bits),
            position: position_m.to_array().map(f64::to_bits),
        }
    }
}

impl From<EyeBits> for Eye {
    fn from(bits: EyeBits) -> Self {
        let [left_rad, right_rad, up_rad, down_rad] = bits.fov.map(f64::from_bits);
        Self {
            size: bits.size,
            fov: Fov { left_rad, right_rad, up_rad, down_rad },
            room_from_eye: DQuat::from_array(bits.orientation.map(f64::from_bits)),
            position_m: DVec3::from_array(bits.position.map(f64::from_bits)),
        }
    }
}

/// Returns the file name of a shot and an eye.
pub fn file(folder: &Path, shot: usize, eye: usize, kind: &str) -> PathBuf {
    folder.join(format!("{shot}-{eye}-{kind}"))
}

/// Images of an eye received by the host.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirror {
    /// The display image.
    pub display: Vec<u8>,
    /// The HDR image.
    pub hdr: Vec<[f32; 4]>,
}

/// A frame as submitted to the runtime.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Left and right eye as drawn.
    pub eyes: [Eye; 2],
    /// Contents of the swapchain images.
    pub images: [CapturedImage; 2],
    /// Exposure and images received by the host, if requested.
    pub mirror: Option<(f64, [Mirror; 2])>,
}

impl Shot {
    /// Returns the linear light of an eye's image; display white is 1.
    pub fn linear(&self, eye: usize) -> &[[f32; 4]] {
        match &self.images[eye].pixels {
            CapturedPixels::Linear(pixels) => pixels,
            CapturedPixels::Srgb8(_) => panic!("the image has 8 bits"),
        }
    }
}

/// Returns settings with exact poses. They use the stage, because the local space is at the height of the head.
pub fn settings(format: SwapchainFormat, swapchains: SwapchainLayout, resolution_scale: f64) -> HeadsetSettings {
    HeadsetSettings {
        format,
        swapchains,
        resolution_scale,
        reference_space: ReferenceSpace::Stage,
        ..HeadsetSettings::default()
    }
}

/// Takes the shots one after the other in one session.
pub fn take(service: &Service, settings: HeadsetSettings, assignments: Vec<Assignment>) -> Vec<Shot> {
    let folder = tempfile::tempdir().unwrap();
    let order = Order { port: service.remote_port(), settings, assignments };
    std::fs::write(folder.path().join("order.json"), serde_json::to_vec(&order).unwrap()).unwrap();
    let mut command = service.inner("photograph");
    let printed = service.run(command.env(FOLDER_VARIABLE, folder.path()), LIMIT);
    let printed = printed.unwrap_or_else(|error| panic!("{error}"));
    let taken: Vec<Taken> = serde_json::from_str(&printed).unwrap();
    assert_eq!(taken.len(), order.assignments.len());
    taken.iter().enumerate().map(|(shot, taken)| read(folder.path(), shot, taken)).collect()
}

fn read(folder: &Path, shot: usize, taken: &Taken) -> Shot {
    let bytes = |eye: usize, kind: &str| std::fs::read(file(folder, shot, eye, kind)).unwrap();
    let floats = |eye: usize, kind: &str| -> Vec<[f32; 4]> {
        let of_pixel = |bytes: &[u8; 16]| {
            std::array::from_fn(|c| f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * c + byte])))
        };
        bytes(eye, kind).as_chunks().0.iter().map(of_pixel).collect()
    };
    let image = |eye: usize| CapturedImage {
        size: Eye::from(taken.eyes[eye]).size,
        pixels: if taken.linear {
            CapturedPixels::Linear(floats(eye, "image"))
        } else {
            CapturedPixels::Srgb8(bytes(eye, "image").as_chunks().0.to_vec())
        },
    };
    let mirror = |eye: usize| Mirror { display: bytes(eye, "display"), hdr: floats(eye, "hdr") };
    Shot {
        eyes: taken.eyes.map(Eye::from),
        images: [image(0), image(1)],
        mirror: taken.exposure_ev100.map(|bits| (f64::from_bits(bits), [mirror(0), mirror(1)])),
    }
}

/// Returns the expected eyes of a state, in f64.
pub fn sent_eyes(state: &RemoteState, sizes: [[u32; 2]; 2]) -> [Eye; 2] {
    let rotation = |pose: &Pose| DQuat::from_array(pose.orientation.map(f64::from)).normalize();
    let position = |pose: &Pose| DVec3::from_array(pose.position_m.map(f64::from));
    let head = rotation(&state.head);
    [0, 1].map(|index| {
        let eye = &state.eyes[index];
        let [left_rad, right_rad, up_rad, down_rad] = eye.fov_rad.map(f64::from);
        Eye {
            size: sizes[index],
            fov: Fov { left_rad, right_rad, up_rad, down_rad },
            room_from_eye: head * rotation(&eye.pose),
            position_m: position(&state.head) + head * position(&eye.pose),
        }
    })
}

/// Returns the rig with one view of both eyes.
pub fn rig(eyes: [Eye; 2]) -> Rig {
    let view = View::new("eyes", ViewKind::Headset { eyes }, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    Rig::new(vec![view]).unwrap()
}

/// Returns the mapping of an eye of a rig.
pub fn mapping(rig: &Rig, eye: usize) -> &dyn PlaneMapping {
    rig.views()[0].images[eye].projection.mapping()
}

/// Returns the state of a head at 1.6 m with this orientation.
pub fn head(orientation: Quat, eyes: [crate::monado::Eye; 2]) -> RemoteState {
    RemoteState { head: Pose::new(orientation, Vec3::new(0.0, 1.6, 0.0)), eyes, ..RemoteState::default() }
}

/// Returns eyes that differ in orientation and field of view. They are rotated outwards by 5 and 6 degrees.
pub fn canted_eyes() -> [crate::monado::Eye; 2] {
    let eye = |fov_rad, cant_deg: f32, position_m: [f32; 3]| crate::monado::Eye {
        fov_rad,
        pose: Pose::new(Quat::from_rotation_y(cant_deg.to_radians()), Vec3::from_array(position_m)),
    };
    [
        eye([-0.9, 0.7, 0.75, -0.8], 5.0, [-0.031, 0.001, 0.002]),
        eye([-0.65, 0.95, 0.7, -0.85], -6.0, [0.033, 0.0, -0.001]),
    ]
}

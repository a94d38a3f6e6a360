//! Client of Monado's remote driver, which receives the state of the headset and the controllers over TCP.
//!
//! A message is the driver's `struct r_remote_data` (`r_interface.h` of Monado 25.0.0, header `mndrmt3`) in
//! little-endian byte order: 376 bytes without a length prefix. On each connection, the driver first sends its initial
//! state and its current state in the same form. It serves one connection at a time, and keeps the state when a
//! connection ends.

use std::{
    io::{Read, Write},
    net::{Ipv4Addr, Shutdown, TcpStream},
    time::{Duration, Instant},
};

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

const MESSAGE_LEN: usize = 376;
const HEADER: [u8; 8] = *b"mndrmt3\0";
/// Time limit of one exchange with the driver, which takes some 100 us.
const TIME_LIMIT: Duration = Duration::from_secs(20);

/// A pose in metres, in OpenXR's axes: x to the right, y up, z backwards.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Unit quaternion, x, y, z, w.
    pub orientation: [f32; 4],
    /// Position, m.
    pub position_m: [f32; 3],
}

impl Pose {
    /// Pose at the origin of the space.
    pub const IDENTITY: Self = Self { orientation: [0.0, 0.0, 0.0, 1.0], position_m: [0.0; 3] };

    /// Returns the pose with this orientation and position.
    pub fn new(orientation: Quat, position_m: Vec3) -> Self {
        Self { orientation: orientation.to_array(), position_m: position_m.to_array() }
    }

    /// Converts `inner`, which is relative to this pose, to the space of this pose.
    pub fn then(&self, inner: &Self) -> Self {
        let rotation = Quat::from_array(self.orientation);
        Self::new(
            rotation * Quat::from_array(inner.orientation),
            Vec3::from_array(self.position_m) + rotation * Vec3::from_array(inner.position_m),
        )
    }
}

/// An eye of the headset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Eye {
    /// Angles of the edges of the field of view, rad: left, right, up, down. Left and down are negative.
    pub fov_rad: [f32; 4],
    /// Pose relative to the head.
    pub pose: Pose,
}

/// Buttons of a controller of the Valve Index: `/interaction_profiles/valve/index_controller`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buttons {
    pub system_click: bool,
    pub system_touch: bool,
    pub a_click: bool,
    pub a_touch: bool,
    pub b_click: bool,
    pub b_touch: bool,
    pub trigger_click: bool,
    pub trigger_touch: bool,
    pub thumbstick_click: bool,
    pub thumbstick_touch: bool,
    pub trackpad_touch: bool,
}

/// A controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Controller {
    /// Whether it is switched on; otherwise its inputs are inactive.
    pub active: bool,
    /// Pose of its grip in the tracking space.
    pub pose: Pose,
    /// Velocity, m/s.
    pub linear_velocity_m_s: [f32; 3],
    /// Angular velocity in the controller's axes, rad/s.
    pub angular_velocity_rad_s: [f32; 3],
    /// Trigger, 0 to 1.
    pub trigger: f32,
    /// Squeeze, 0 to 1.
    pub squeeze: f32,
    /// Force of the squeeze, 0 to 1.
    pub squeeze_force: f32,
    /// Thumbstick, -1 to 1: right, forwards.
    pub thumbstick: [f32; 2],
    /// Force on the trackpad, 0 to 1.
    pub trackpad_force: f32,
    /// Finger on the trackpad, -1 to 1: right, forwards.
    pub trackpad: [f32; 2],
    pub buttons: Buttons,
}

impl Controller {
    /// Returns a controller held at a pose, at rest, with nothing pressed.
    pub const fn at(pose: Pose) -> Self {
        Self {
            active: true,
            pose,
            linear_velocity_m_s: [0.0; 3],
            angular_velocity_rad_s: [0.0; 3],
            trigger: 0.0,
            squeeze: 0.0,
            squeeze_force: 0.0,
            thumbstick: [0.0; 2],
            trackpad_force: 0.0,
            trackpad: [0.0; 2],
            buttons: Buttons {
                system_click: false,
                system_touch: false,
                a_click: false,
                a_touch: false,
                b_click: false,
                b_touch: false,
                trigger_click: false,
                trigger_touch: false,
                thumbstick_click: false,
                thumbstick_touch: false,
                trackpad_touch: false,
            },
        }
    }
}

/// Complete state sent to the remote driver.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RemoteState {
    /// The eyes, left and right.
    pub eyes: [Eye; 2],
    /// Pose of the head in the tracking space.
    pub head: Pose,
    /// The controllers, left and right.
    pub controllers: [Controller; 2],
}

impl Default for RemoteState {
    /// Returns the state of a head that is 1.6 m above the floor and looks along -z, with eyes 64 mm apart and fields
    /// of view of 90 degrees.
    fn default() -> Self {
        let edge_rad = std::f32::consts::FRAC_PI_4;
        let eye = |x_m| Eye {
            fov_rad: [-edge_rad, edge_rad, edge_rad, -edge_rad],
            pose: Pose { position_m: [x_m, 0.0, 0.0], ..Pose::IDENTITY },
        };
        let hand = |x_m| Controller::at(Pose { position_m: [x_m, 1.3, -0.5], ..Pose::IDENTITY });
        Self {
            eyes: [eye(-0.032), eye(0.032)],
            head: Pose { position_m: [0.0, 1.6, 0.0], ..Pose::IDENTITY },
            controllers: [hand(-0.2), hand(0.2)],
        }
    }
}

impl RemoteState {
    /// Returns the poses of the eyes in the tracking space.
    pub fn eye_poses(&self) -> [Pose; 2] {
        self.eyes.map(|eye| self.head.then(&eye.pose))
    }

    /// Returns the driver's message.
    fn message(&self) -> [u8; MESSAGE_LEN] {
        let mut message = Message::default();
        message.bytes(&HEADER);
        for eye in &self.eyes {
            message.floats(&eye.fov_rad);
            message.pose(&eye.pose);
            message.bytes(&[0; 4]);
        }
        message.pose(&self.head);
        // This flag enables the eyes above. Otherwise the runtime would use its own.
        message.bytes(&[1, 0, 0, 0]);
        for controller in &self.controllers {
            message.controller(controller);
        }
        assert_eq!(message.len, MESSAGE_LEN, "the fields must fill the driver's structure");
        message.buffer
    }
}

/// A message under construction.
struct Message {
    buffer: [u8; MESSAGE_LEN],
    len: usize,
}

impl Default for Message {
    fn default() -> Self {
        Self { buffer: [0; MESSAGE_LEN], len: 0 }
    }
}

impl Message {
    fn bytes(&mut self, bytes: &[u8]) {
        self.buffer[self.len..self.len + bytes.len()].copy_from_slice(bytes);
        self.len += bytes.len();
    }

    fn floats(&mut self, values: &[f32]) {
        for value in values {
            self.bytes(&value.to_le_bytes());
        }
    }

    fn pose(&mut self, pose: &Pose) {
        self.floats(&pose.orientation);
        self.floats(&pose.position_m);
    }

    fn controller(&mut self, controller: &Controller) {
        self.pose(&controller.pose);
        self.floats(&controller.linear_velocity_m_s);
        self.floats(&controller.angular_velocity_rad_s);
        // Curl of five fingers, for tracked hands.
        self.floats(&[0.0; 5]);
        self.floats(&[controller.trigger, controller.squeeze, controller.squeeze_force]);
        self.floats(&controller.thumbstick);
        self.floats(&[controller.trackpad_force]);
        self.floats(&controller.trackpad);
        let buttons = &controller.buttons;
        // The first flag enables hand tracking.
        let flags = [
            false,
            controller.active,
            buttons.system_click,
            buttons.system_touch,
            buttons.a_click,
            buttons.a_touch,
            buttons.b_click,
            buttons.b_touch,
            buttons.trigger_click,
            buttons.trigger_touch,
            buttons.thumbstick_click,
            buttons.thumbstick_touch,
            buttons.trackpad_touch,
        ];
        self.bytes(&flags.map(u8::from));
        self.bytes(&[0; 3]);
    }
}

/// A connection to the remote driver of a service.
pub struct Remote {
    port: u16,
    stream: TcpStream,
}

impl Remote {
    /// Connects to the driver that listens on a port of this machine, or will soon do so.
    ///
    /// # Errors
    /// No driver answers in time.
    pub fn connect(port: u16) -> Result<Self, String> {
        let (stream, _) = greeted(port)?;
        Ok(Self { port, stream })
    }

    /// Sends a state and returns when the driver has received it. Every pose that a program queries afterwards is that
    /// of this state.
    ///
    /// The driver acknowledges nothing. However, it accepts the next connection only after it has read all of the
    /// previous one, and then sends its state. Therefore this function ends the connection and opens another one. The
    /// driver keeps a file open for each connection, so a service supports some 800 of these calls.
    ///
    /// # Errors
    /// The driver has ended, or has another state.
    pub fn send(&mut self, state: &RemoteState) -> Result<(), String> {
        self.send_unconfirmed(state)?;
        self.stream.shutdown(Shutdown::Both).map_err(|error| format!("remote driver: {error}"))?;
        let (stream, current) = greeted(self.port)?;
        self.stream = stream;
        if current == state.message() { Ok(()) } else { Err("the remote driver has another state".into()) }
    }

    /// Sends a state without confirmation. The driver receives states later, in the order in which they were sent.
    ///
    /// # Errors
    /// The driver has ended.
    pub fn send_unconfirmed(&mut self, state: &RemoteState) -> Result<(), String> {
        self.stream.write_all(&state.message()).map_err(|error| format!("remote driver: {error}"))
    }
}

/// Opens a connection and returns it with the driver's current state.
fn greeted(port: u16) -> Result<(TcpStream, [u8; MESSAGE_LEN]), String> {
    let start = Instant::now();
    let mut stream = loop {
        match TcpStream::connect((Ipv4Addr::LOCALHOST, port)) {
            Ok(stream) => break stream,
            Err(error) if start.elapsed() > TIME_LIMIT => {
                return Err(format!("no remote driver on port {port}: {error}"));
            }
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let mut greeting = [0; 2 * MESSAGE_LEN];
    stream
        .set_nodelay(true)
        .and_then(|()| stream.set_read_timeout(Some(TIME_LIMIT)))
        .and_then(|()| stream.read_exact(&mut greeting))
        .map_err(|error| format!("the server on port {port} is not a remote driver: {error}"))?;
    let mut current = [0; MESSAGE_LEN];
    current.copy_from_slice(&greeting[MESSAGE_LEN..]);
    Ok((stream, current))
}

//! `[headset]`: how a headset is driven.

use serde::{Deserialize, Serialize};

/// How the eyes' images are handed to the runtime.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum SwapchainLayout {
    /// One swapchain of two layers, or two where the runtime has none of layers or wants eyes of different sizes.
    #[default]
    Auto,
    /// One swapchain of two layers.
    Array,
    /// A swapchain for each eye.
    Two,
}

/// Format of the images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum SwapchainFormat {
    /// What the runtime likes best of the others.
    #[default]
    Auto,
    /// Linear light in 16-bit floats.
    Rgba16f,
    /// Eight bits, encoded as sRGB.
    Rgba8Srgb,
    /// The same with red and blue exchanged.
    Bgra8Srgb,
}

/// Where the scene's camera stands in the room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceSpace {
    /// Where the head was when the runtime was last recentred.
    #[default]
    Local,
    /// In the middle of the floor of the play area.
    Stage,
}

/// What a daemon does when the wearer ends the session in the runtime's own menu.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum AfterExit {
    /// It leaves the headset alone until it is started anew.
    #[default]
    Stop,
    /// It connects again, as after a loss.
    Reconnect,
}

/// `[headset]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HeadsetSettings {
    /// Whether `serve` drives a headset; `xr` always does.
    pub enabled: bool,
    /// Name of the view that shows clients what the eyes see.
    pub name: String,
    /// Swapchains.
    pub swapchains: SwapchainLayout,
    /// Format of their images.
    pub format: SwapchainFormat,
    /// Factor on the width and height that the runtime recommends, 0.1 to 4.
    pub resolution_scale: f64,
    /// Where the camera stands in the room.
    pub reference_space: ReferenceSpace,
    /// Speed of flight with a thumbstick pushed to its end, m/s, above 0 to 1e12.
    pub flight_m_s: f64,
    /// Speed of turning with a thumbstick pushed to its end, deg/s, 0 to 360.
    pub turn_deg_s: f64,
    /// After the wearer has ended the session.
    pub after_exit: AfterExit,
}

impl Default for HeadsetSettings {
    fn default() -> Self {
        Self {
            enabled: false,
            name: "headset".to_owned(),
            swapchains: SwapchainLayout::default(),
            format: SwapchainFormat::default(),
            resolution_scale: 1.0,
            reference_space: ReferenceSpace::default(),
            flight_m_s: 10.0,
            turn_deg_s: 45.0,
            after_exit: AfterExit::default(),
        }
    }
}

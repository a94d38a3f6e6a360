//! `[headset]`: how a headset is driven.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Layout of the swapchains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SwapchainLayout {
    /// `array`, or `two` if the runtime has no array swapchains or the eyes differ in size.
    #[default]
    Auto,
    /// One swapchain with two array layers.
    Array,
    /// One swapchain per eye.
    Two,
}

/// Format of the swapchain images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SwapchainFormat {
    /// The supported format that the runtime prefers.
    #[default]
    Auto,
    /// 16-bit float, linear.
    Rgba16f,
    /// 8 bits, sRGB.
    Rgba8Srgb,
    /// 8 bits, sRGB, channels in the order BGRA.
    Bgra8Srgb,
}

/// OpenXR reference space whose origin is the camera of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceSpace {
    /// LOCAL: the head position at the last recentring.
    #[default]
    Local,
    /// STAGE: the centre of the play area at floor level.
    Stage,
}

/// Behaviour of `serve` after the user has ended the session in the menu of the runtime.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AfterExit {
    /// Does not use the headset again until the daemon is restarted.
    #[default]
    Stop,
    /// Reconnects, as after a loss of the session.
    Reconnect,
}

/// `[headset]`: an OpenXR headset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadsetSettings {
    /// Whether `serve` drives a headset; `xr` always does.
    pub enabled: bool,
    /// Name of the view under which clients see the images of the eyes: letters, digits, `_` and `-`.
    pub name: String,
    /// Layout of the swapchains.
    pub swapchains: SwapchainLayout,
    /// Format of the swapchain images.
    pub format: SwapchainFormat,
    /// Factor on the width and height that the runtime recommends.
    #[schemars(range(min = 0.1, max = 4.0))]
    pub resolution_scale: f64,
    /// OpenXR reference space whose origin is the camera of the scene.
    pub reference_space: ReferenceSpace,
    /// Speed of flight at full deflection of the thumbstick.
    #[schemars(range(max = 1e12), extend("exclusiveMinimum" = 0.0, "x-unit" = "m/s"))]
    pub flight_m_s: f64,
    /// Turn rate at full deflection of the thumbstick.
    #[schemars(range(min = 0.0, max = 360.0), extend("x-unit" = "deg/s"))]
    pub turn_deg_s: f64,
    /// Behaviour of `serve` after the user has ended the session in the menu of the runtime.
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

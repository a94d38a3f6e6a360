//! Errors of headsets.

use openxr::sys;

use crate::{gpu::GpuError, render::RenderError};

/// Reason why a headset cannot be driven, or is no longer driven.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XrError {
    /// The OpenXR loader library is missing.
    #[error(
        "the OpenXR loader cannot be used: {0}. Install it (Debian and Ubuntu: apt install libopenxr-loader1; Fedora: dnf \
         install openxr; Arch: pacman -S openxr), and a runtime such as SteamVR, Monado or WiVRn"
    )]
    Loader(String),
    /// No runtime is set up, or it does not respond.
    #[error(
        "no OpenXR runtime answers ({call}: {result}). Start one (SteamVR, monado-service, WiVRn ...), make it the active one in \
         ~/.config/openxr/1/active_runtime.json, or name its manifest in XR_RUNTIME_JSON"
    )]
    NoRuntime {
        /// Name of the call.
        call: &'static str,
        /// Result of the call.
        result: sys::Result,
    },
    /// The runtime lacks an extension.
    #[error("the OpenXR runtime {runtime} has no extension {extension}, which is required: {needed_for}")]
    MissingExtension {
        /// Name and version of the runtime, if known.
        runtime: String,
        /// Name of the extension.
        extension: &'static str,
        /// Purpose of the extension.
        needed_for: &'static str,
    },
    /// The runtime has no headset.
    #[error(
        "the OpenXR runtime {runtime} has no headset: {result}. Connect it, switch it on, and check whether the runtime itself detects it"
    )]
    NoHeadset {
        /// Name and version of the runtime.
        runtime: String,
        /// Result of the query.
        result: sys::Result,
    },
    /// The runtime lacks a capability that is not an extension.
    #[error("the OpenXR runtime {runtime} cannot be used: {problem}")]
    Unsuitable {
        /// Name and version of the runtime.
        runtime: String,
        /// The capability that is missing, and what it is required for.
        problem: String,
    },
    /// A call failed.
    #[error("{call}: {result}")]
    Call {
        /// Name of the call.
        call: &'static str,
        /// Result of the call.
        result: sys::Result,
    },
    /// The runtime could not create a device.
    #[error("{call}: Vulkan answers {result}")]
    Vulkan {
        /// Name of the call.
        call: &'static str,
        /// Result of the call.
        result: i32,
    },
    /// The runtime announced that it is about to end.
    #[error("the runtime ends the session")]
    LossPending,
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The eyes' images cannot be rendered.
    #[error("the headset's frame: {0}")]
    Render(#[from] RenderError),
}

/// Adds the name of a call to its result.
pub(super) trait During<T> {
    /// Returns the value, or an error with the name of the call.
    fn during(self, call: &'static str) -> Result<T, XrError>;
}

impl<T> During<T> for Result<T, sys::Result> {
    fn during(self, call: &'static str) -> Result<T, XrError> {
        self.map_err(|result| XrError::Call { call, result })
    }
}

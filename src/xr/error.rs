//! Why a headset cannot be driven.

use openxr::sys;

use crate::{gpu::GpuError, render::RenderError};

/// Why a headset cannot be driven, or is not driven any more.
#[derive(Debug, thiserror::Error)]
pub enum XrError {
    /// The library through which programs find the runtime is not there.
    #[error(
        "the OpenXR loader cannot be used: {0}. Install it (Debian and Ubuntu: apt install libopenxr-loader1; Fedora: dnf \
         install openxr; Arch: pacman -S openxr), and a runtime such as SteamVR, Monado or WiVRn"
    )]
    Loader(String),
    /// No runtime is set up or it does not answer.
    #[error(
        "no OpenXR runtime answers ({call}: {result}). Start one (SteamVR, monado-service, WiVRn ...), make it the active one in \
         ~/.config/openxr/1/active_runtime.json, or name its manifest in XR_RUNTIME_JSON"
    )]
    NoRuntime {
        /// What was called.
        call: &'static str,
        /// What it answered.
        result: sys::Result,
    },
    /// The runtime lacks an extension.
    #[error("the OpenXR runtime {runtime} has no extension {extension}, which is needed: {needed_for}")]
    MissingExtension {
        /// Name and version of the runtime, as far as it tells them.
        runtime: String,
        /// The extension.
        extension: &'static str,
        /// What it is needed for.
        needed_for: &'static str,
    },
    /// There is a runtime without a headset.
    #[error(
        "the OpenXR runtime {runtime} has no headset: {result}. Connect it, switch it on, and look whether the runtime's own display sees it"
    )]
    NoHeadset {
        /// Name and version of the runtime.
        runtime: String,
        /// What it answered.
        result: sys::Result,
    },
    /// The runtime lacks something that is no extension.
    #[error("the OpenXR runtime {runtime} cannot be used: {problem}")]
    Unsuitable {
        /// Name and version of the runtime.
        runtime: String,
        /// What it lacks and what is needed.
        problem: String,
    },
    /// A call failed.
    #[error("{call}: {result}")]
    Call {
        /// The call.
        call: &'static str,
        /// What it answered.
        result: sys::Result,
    },
    /// The runtime's device could not be made.
    #[error("{call}: Vulkan answers {result}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// What it answered.
        result: i32,
    },
    /// The runtime says that it is about to go.
    #[error("the runtime ends the session")]
    LossPending,
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// What the eyes see cannot be rendered.
    #[error("the headset's frame: {0}")]
    Render(#[from] RenderError),
}

/// Names the call that a result is of.
pub(super) trait During<T> {
    /// The value, or the error of the call of that name.
    fn during(self, call: &'static str) -> Result<T, XrError>;
}

impl<T> During<T> for Result<T, sys::Result> {
    fn during(self, call: &'static str) -> Result<T, XrError> {
        self.map_err(|result| XrError::Call { call, result })
    }
}

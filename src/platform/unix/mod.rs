//! The subjects of `platform` on Unix systems.

#[cfg(feature = "service")]
pub(crate) mod clock;
#[cfg(feature = "service")]
pub(crate) mod files;
#[cfg(feature = "xr")]
pub(crate) mod openxr_clock;
#[cfg(feature = "service")]
pub(crate) mod process;
#[cfg(feature = "service")]
pub(crate) mod signals;
#[cfg(feature = "service")]
pub(crate) mod sockets;
#[cfg(feature = "cli")]
pub(crate) mod supervisor;

//! The GPU: adapter and device, buffers and their layouts, shader modules, timing, readback.

mod buffers;
mod device;
pub mod layout;
pub mod probe;
mod shaders;
mod timing;
mod viewport;

pub(crate) use buffers::{GrowingBuffer, ReadbackBuffer, ReadbackPlace, storage_buffer, uniform_buffer};
pub use device::{AdapterReport, Gpu, GpuError, GpuOptions};
pub use shaders::{ShaderSource, sources};
pub(crate) use shaders::{exposure, resolve, stars, tone_map};
pub(crate) use timing::GpuTimer;
pub(crate) use viewport::encode_viewport;

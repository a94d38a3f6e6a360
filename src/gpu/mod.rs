//! The GPU: adapter and device, buffers and their layouts, shader modules, timing, readback.

pub(crate) mod adopt;
mod binding;
mod buffers;
mod constants;
mod device;
mod pipelines;
mod shader;
mod structs;
mod texels;
mod timing;

pub(crate) use binding::{bind_buffers, bind_to, dispatch_rows};
pub(crate) use buffers::{GrowingBuffer, ReadbackBuffer, ReadbackPlace, filled_buffer, storage_buffer, uniform_buffer};
pub use constants::Table;
pub(crate) use constants::{Shared, shared_constants};
pub use device::{AdapterReport, Gpu, GpuError, GpuOptions};
pub(crate) use pipelines::{Stage, Variants};
pub(crate) use shader::{Choices, Library};
pub use shader::{Place, ShaderError, ShaderSource};
pub use structs::StructLayout;
pub(crate) use structs::gpu_structs;
pub(crate) use texels::{read_layer, texels_of_halves};
pub(crate) use timing::GpuTimer;

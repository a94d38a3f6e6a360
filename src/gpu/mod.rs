//! The GPU: adapter and device, buffers and their layouts, shader modules, timing, readback.

pub(crate) mod adopt;
mod binding;
mod buffers;
pub(crate) mod constants;
mod device;
mod pipelines;
mod shader;
mod shared_constants;
mod texels;
mod timing;

pub(crate) use binding::{bind_buffers, bind_to, dispatch_rows};
pub(crate) use buffers::{GrowingBuffer, ReadbackBuffer, ReadbackPlace, filled_buffer, storage_buffer, uniform_buffer};
pub use constants::tables as constant_tables;
pub use device::{AdapterReport, Gpu, GpuError, GpuOptions};
pub(crate) use pipelines::Stage;
pub use shader::{Place, Shader, ShaderError, ShaderSource, shaders};
pub use shared_constants::Table;
pub(crate) use texels::{read_layer, texels_of_halves};
pub(crate) use timing::GpuTimer;

//! The GPU: adapter and device, buffers and structures, shader modules, pipelines, timing and readback.

mod adapter;
#[cfg(feature = "xr")]
#[doc(hidden)]
pub mod adopt;
mod binding;
mod buffers;
mod compile_ahead;
mod constants;
mod device;
mod driver_cache;
mod frame_pool;
mod pipelines;
mod shader;
mod structs;
mod texels;
mod timing;

pub use adapter::{AdapterReport, GpuOptions, Need, RestrictionError};
pub(crate) use binding::{Tables, bind_buffers, bind_in_order, dispatch_rows};
pub(crate) use buffers::{
    GrowingBuffer, ReadbackBuffer, ReadbackPlace, filled_buffer, storage_buffer, uniform_buffer, uniform_list,
};
pub(crate) use compile_ahead::CollectedShaders;
#[doc(hidden)]
pub use constants::Table;
pub(crate) use constants::{ConstantValue, shared_constants};
pub(crate) use device::SUBMISSION_TIMEOUT;
pub use device::{Gpu, GpuError};
pub(crate) use frame_pool::LayoutOf;
pub use frame_pool::ObjectsMade;
pub(crate) use pipelines::{Stage, Variants};
pub(crate) use shader::{Choices, Joined, Library, read_folder};
#[doc(hidden)]
pub use shader::{Place, ShaderError, ShaderSource};
pub(crate) use structs::{ArrayElement, WgslType, gpu_structs};
#[doc(hidden)]
pub use structs::{StructField, StructLayout};
#[doc(hidden)]
pub use texels::{read_layer, texels_of_halves};
pub(crate) use timing::GpuTimer;

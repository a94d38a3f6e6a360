//! The GPU: adapter and device, buffers and their layouts, shader modules, timing, readback.

pub(crate) mod adopt;
mod binding;
mod buffers;
mod device;
mod impostor_shaders;
mod pipelines;
mod shaders;
mod texels;
mod timing;

pub(crate) use binding::{bind_buffers, bind_to, dispatch_rows};
pub(crate) use buffers::{GrowingBuffer, ReadbackBuffer, ReadbackPlace, filled_buffer, storage_buffer, uniform_buffer};
pub use device::{AdapterReport, Gpu, GpuError, GpuOptions};
pub use impostor_shaders::AsteroidSource;
pub(crate) use impostor_shaders::{
    asteroid_impostor, asteroid_impostor_shade, impostor_bake, impostor_bake_sample, impostor_filter,
};
pub(crate) use pipelines::Stage;
pub use shaders::{GlareSource, LuminanceSource, PresentSource, Profile, ShaderSource, sources};
pub(crate) use shaders::{
    asteroid_cull, asteroid_mesh, asteroid_offsets, asteroid_points, asteroid_scan, asteroid_shade, billboard_fragment,
    billboard_vertex, count_stars, exposure, geometry, glare_assign, glare_base, glare_blur, glare_combine,
    glare_composite, glare_find, glare_gather, glare_maximum, glare_sharpen, overlay, packed_cas, packed_cas_sorted, points,
    present, present_corner, projection_probe, resolve, resolve_luminance, stars, tone_map,
};
pub(crate) use texels::{read_layer, texels_of_halves};
pub(crate) use timing::GpuTimer;

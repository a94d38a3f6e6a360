//! Code that depends on the operating system: the graphics interfaces that are tried.

/// Vulkan; Metal on Apple's systems; on Windows also Direct3D 12.
pub(crate) const BACKENDS: wgpu::Backends = if cfg!(target_vendor = "apple") {
    wgpu::Backends::METAL
} else if cfg!(windows) {
    wgpu::Backends::VULKAN.union(wgpu::Backends::DX12)
} else {
    wgpu::Backends::VULKAN
};

//! What lies in the swapchains: the images that the runtime is going to show, read back.

use half::f16;

use super::swapchain::Swapchains;
use crate::gpu::{Gpu, GpuError};

/// An eye's image as it lies in the swapchain.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// R, G, B, A, row by row from the top.
    pub pixels: CapturedPixels,
}

/// Pixels of a swapchain's image.
#[derive(Clone, Debug, PartialEq)]
pub enum CapturedPixels {
    /// Linear light, display white is 1.
    Linear(Vec<[f32; 4]>),
    /// Eight bits, encoded as sRGB.
    Srgb8(Vec<[u8; 4]>),
}

/// Waits for the work submitted so far and reads the acquired images of both eyes: left, right.
pub(super) fn capture(gpu: &Gpu, swapchains: &Swapchains) -> Result<[CapturedImage; 2], GpuError> {
    Ok([capture_eye(gpu, swapchains, 0)?, capture_eye(gpu, swapchains, 1)?])
}

fn capture_eye(gpu: &Gpu, swapchains: &Swapchains, eye: usize) -> Result<CapturedImage, GpuError> {
    let size = swapchains.sizes[eye];
    let (texture, layer) =
        swapchains.texture(eye).ok_or_else(|| GpuError::Refused("no image of the swapchain is acquired".to_owned()))?;
    let pixel_bytes = if swapchains.format == wgpu::TextureFormat::Rgba16Float { 8 } else { 4 };
    let row_bytes = size[0] * pixel_bytes;
    let padded_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("capture"),
        size: u64::from(padded_bytes) * u64::from(size[1]),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("capture") });
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        },
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded_bytes), rows_per_image: None },
        },
        wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
    );
    // The runtime takes images back as colour attachments.
    let whole = wgpu::TextureTransition { texture, selector: None, state: wgpu::TextureUses::COLOR_TARGET };
    encoder.transition_resources(std::iter::empty(), std::iter::once(whole));
    gpu.queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.wait(None)?;
    gpu.take_failure()?;
    let bytes = buffer.get_mapped_range(..)?;
    let rows = bytes.chunks_exact(padded_bytes as usize).map(|row| &row[..row_bytes as usize]);
    let pixels = if swapchains.format == wgpu::TextureFormat::Rgba16Float {
        let half = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
        let texel = |texel: &[u8]| [0, 2, 4, 6].map(|first| half(&texel[first..]));
        CapturedPixels::Linear(rows.flat_map(|row| row.chunks_exact(8).map(texel)).collect())
    } else {
        let swaps = swapchains.format == wgpu::TextureFormat::Bgra8UnormSrgb;
        let texel = |t: &[u8]| if swaps { [t[2], t[1], t[0], t[3]] } else { [t[0], t[1], t[2], t[3]] };
        CapturedPixels::Srgb8(rows.flat_map(|row| row.chunks_exact(4).map(texel)).collect())
    };
    Ok(CapturedImage { size, pixels })
}

//! Reads back the swapchain images that the runtime is about to show.

use super::swapchain::Swapchains;
use crate::gpu::{Gpu, GpuError, read_layer, texels_of_halves};

/// An eye's image in the swapchain.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// R, G, B, A, row by row from the top.
    pub pixels: CapturedPixels,
}

/// Pixels of a swapchain image.
#[derive(Clone, Debug, PartialEq)]
pub enum CapturedPixels {
    /// Linear light; display white is 1.
    Linear(Vec<[f32; 4]>),
    /// Eight bits, encoded as sRGB.
    Srgb8(Vec<[u8; 4]>),
}

/// Waits for the work submitted so far and reads the acquired images of both eyes: left, right.
pub(super) fn capture(gpu: &Gpu, swapchains: &Swapchains) -> Result<[CapturedImage; 2], GpuError> {
    Ok([capture_eye(gpu, swapchains, 0)?, capture_eye(gpu, swapchains, 1)?])
}

fn capture_eye(gpu: &Gpu, swapchains: &Swapchains, eye: usize) -> Result<CapturedImage, GpuError> {
    let (texture, layer) =
        swapchains.texture(eye).ok_or_else(|| GpuError::Refused("no swapchain image is acquired".to_owned()))?;
    let bytes = read_layer(gpu, texture, layer)?;
    // The runtime expects images back in the layout of colour attachments.
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("capture") });
    let whole = wgpu::TextureTransition { texture, selector: None, state: wgpu::TextureUses::COLOR_TARGET };
    encoder.transition_resources(std::iter::empty(), std::iter::once(whole));
    gpu.queue.submit([encoder.finish()]);
    let pixels = if swapchains.format == wgpu::TextureFormat::Rgba16Float {
        CapturedPixels::Linear(texels_of_halves(&bytes))
    } else {
        let swaps = swapchains.format == wgpu::TextureFormat::Bgra8UnormSrgb;
        let texel = |&[a, b, c, d]: &[u8; 4]| if swaps { [c, b, a, d] } else { [a, b, c, d] };
        CapturedPixels::Srgb8(bytes.as_chunks::<4>().0.iter().map(texel).collect())
    };
    Ok(CapturedImage { size: swapchains.sizes[eye], pixels })
}

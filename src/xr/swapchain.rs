//! Swapchains: the images that the runtime hands out in turn, as textures of the renderer.
#![expect(unsafe_code, reason = "images of the runtime are adopted as textures")]

use ash::vk;
use openxr as xr;

use super::{
    error::{During, XrError},
    runtime::Runtime,
};
use crate::{
    gpu::Gpu,
    plan::settings::{HeadsetSettings, SwapchainFormat, SwapchainLayout},
};

/// Supported formats: the configured name, the format in Vulkan, and the format in the renderer.
const FORMATS: [(SwapchainFormat, vk::Format, wgpu::TextureFormat); 3] = [
    (SwapchainFormat::Rgba16f, vk::Format::R16G16B16A16_SFLOAT, wgpu::TextureFormat::Rgba16Float),
    (SwapchainFormat::Rgba8Srgb, vk::Format::R8G8B8A8_SRGB, wgpu::TextureFormat::Rgba8UnormSrgb),
    (SwapchainFormat::Bgra8Srgb, vk::Format::B8G8R8A8_SRGB, wgpu::TextureFormat::Bgra8UnormSrgb),
];

/// The layers of one image of a swapchain.
struct Image {
    texture: wgpu::Texture,
    /// One view for each layer.
    views: Vec<wgpu::TextureView>,
}

/// One swapchain.
struct Chain {
    // Declared before the swapchain, which owns the images, so that it is dropped first.
    images: Vec<Image>,
    swapchain: xr::Swapchain<xr::Vulkan>,
    acquired: Option<usize>,
}

/// Render targets of the eyes: one swapchain with two layers, or two swapchains.
pub(super) struct Swapchains {
    chains: Vec<Chain>,
    /// Format of all images.
    pub(super) format: wgpu::TextureFormat,
    /// Width and height of the left and of the right eye's image, pixels.
    pub(super) sizes: [[u32; 2]; 2],
}

/// Chooses a format from those offered, which are in the runtime's order of preference.
fn choose_format(offered: &[u32], wanted: SwapchainFormat) -> Result<(vk::Format, wgpu::TextureFormat), String> {
    let ours = |format: &(SwapchainFormat, vk::Format, wgpu::TextureFormat)| {
        wanted == SwapchainFormat::Auto || format.0 == wanted
    };
    let format_of =
        |raw: u32| FORMATS.iter().filter(|format| ours(format)).find(|format| format.1.as_raw() as u32 == raw);
    if let Some((_, vulkan, texture)) = offered.iter().find_map(|raw| format_of(*raw)) {
        return Ok((*vulkan, *texture));
    }
    let names = FORMATS.iter().filter(|format| ours(format)).map(|format| format!("{:?}", format.1));
    let offered = offered.iter().map(|raw| format!("{:?}", vk::Format::from_raw(*raw as i32)));
    Err(format!(
        "it offers no images in {}, only in {}",
        names.collect::<Vec<_>>().join(" or "),
        offered.collect::<Vec<_>>().join(", ")
    ))
}

impl Swapchains {
    /// Creates the swapchains that the settings require.
    pub(super) fn new(
        runtime: &Runtime,
        session: &xr::Session<xr::Vulkan>,
        gpu: &Gpu,
        settings: &HeadsetSettings,
    ) -> Result<Self, XrError> {
        let unsuitable = |problem: String| XrError::Unsuitable { runtime: runtime.name.clone(), problem };
        // Compute the size of each eye's image: the recommended size times the configured scale, within all limits.
        let views = runtime.instance.enumerate_view_configuration_views(runtime.system, super::runtime::STEREO);
        let views = views.during("xrEnumerateViewConfigurationViews")?;
        let [left, right] = views.as_slice() else {
            return Err(unsuitable(format!("its stereo configuration has {} views instead of 2", views.len())));
        };
        let limit = gpu.max_view_side_px();
        let side = |recommended: u32, most: u32| {
            let scaled = (f64::from(recommended) * settings.resolution_scale).round() as u32;
            scaled.min(most).min(limit).max(1)
        };
        let size = |view: &xr::ViewConfigurationView| {
            [
                side(view.recommended_image_rect_width, view.max_image_rect_width),
                side(view.recommended_image_rect_height, view.max_image_rect_height),
            ]
        };
        let sizes = [size(left), size(right)];
        // Format of the images.
        let offered = session.enumerate_swapchain_formats().during("xrEnumerateSwapchainFormats")?;
        let (vulkan, format) = choose_format(&offered, settings.format).map_err(unsuitable)?;
        let create = |size: [u32; 2], layers: u32| {
            session.create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: xr::SwapchainUsageFlags::COLOR_ATTACHMENT | xr::SwapchainUsageFlags::TRANSFER_SRC,
                format: vulkan.as_raw() as u32,
                sample_count: 1,
                width: size[0],
                height: size[1],
                face_count: 1,
                array_size: layers,
                mip_count: 1,
            })
        };
        // Create one swapchain with two layers if it is configured and possible, otherwise two swapchains.
        let equal = sizes[0] == sizes[1];
        let mut array = None;
        match settings.swapchains {
            SwapchainLayout::Two => {}
            SwapchainLayout::Array if !equal => {
                return Err(unsuitable(format!(
                    "its eyes have different sizes ({sizes:?}), which headset.swapchains = \"array\" does not support"
                )));
            }
            SwapchainLayout::Array => array = Some(create(sizes[0], 2).during("xrCreateSwapchain with two layers")?),
            SwapchainLayout::Auto if equal => match create(sizes[0], 2) {
                Ok(swapchain) => array = Some(swapchain),
                Err(result) => tracing::info!("headset: no swapchain with two layers ({result}): using two swapchains"),
            },
            SwapchainLayout::Auto => {}
        }
        // Use their images as textures of the renderer.
        let adopt = |swapchain, size, layers| Chain::new(gpu, swapchain, format, size, layers);
        let chains = match array {
            Some(swapchain) => vec![adopt(swapchain, sizes[0], 2)?],
            None => sizes
                .into_iter()
                .map(|size| adopt(create(size, 1).during("xrCreateSwapchain")?, size, 1))
                .collect::<Result<_, XrError>>()?,
        };
        Ok(Self { chains, format, sizes })
    }

    /// Returns the swapchain and the layer of an eye.
    fn place(&self, eye: usize) -> (usize, usize) {
        if self.chains.len() == 1 { (0, eye) } else { (eye, 0) }
    }

    /// Acquires the next images and waits until the runtime has finished reading them.
    pub(super) fn acquire(&mut self) -> Result<(), XrError> {
        for chain in &mut self.chains {
            let index = chain.swapchain.acquire_image().during("xrAcquireSwapchainImage")?;
            chain.swapchain.wait_image(xr::Duration::INFINITE).during("xrWaitSwapchainImage")?;
            chain.acquired = Some(index as usize);
        }
        Ok(())
    }

    /// Returns the render target of an eye; `None`: no image is acquired.
    pub(super) fn target(&self, eye: usize) -> Option<&wgpu::TextureView> {
        let (chain, layer) = self.place(eye);
        let chain = &self.chains[chain];
        Some(&chain.images[chain.acquired?].views[layer])
    }

    /// Returns the texture and layer of an eye's image; `None`: no image is acquired.
    pub(super) fn texture(&self, eye: usize) -> Option<(&wgpu::Texture, u32)> {
        let (chain, layer) = self.place(eye);
        let chain = &self.chains[chain];
        Some((&chain.images[chain.acquired?].texture, layer as u32))
    }

    /// Releases the images to the runtime. The work that draws them must have been submitted.
    pub(super) fn release(&mut self) -> Result<(), XrError> {
        for chain in &mut self.chains {
            if chain.acquired.take().is_some() {
                chain.swapchain.release_image().during("xrReleaseSwapchainImage")?;
            }
        }
        Ok(())
    }

    /// Returns an eye's part of a projection layer.
    pub(super) fn sub_image(&self, eye: usize) -> xr::SwapchainSubImage<'_, xr::Vulkan> {
        let (chain, layer) = self.place(eye);
        let extent = xr::Extent2Di { width: self.sizes[eye][0] as i32, height: self.sizes[eye][1] as i32 };
        xr::SwapchainSubImage::new()
            .swapchain(&self.chains[chain].swapchain)
            .image_array_index(layer as u32)
            .image_rect(xr::Rect2Di { offset: xr::Offset2Di { x: 0, y: 0 }, extent })
    }

    /// Whether both eyes are layers of one swapchain.
    pub(super) fn is_array(&self) -> bool {
        self.chains.len() == 1
    }
}

impl Chain {
    fn new(
        gpu: &Gpu,
        swapchain: xr::Swapchain<xr::Vulkan>,
        format: wgpu::TextureFormat,
        size: [u32; 2],
        layers: u32,
    ) -> Result<Self, XrError> {
        let raw = swapchain.enumerate_images().during("xrEnumerateSwapchainImages")?;
        let descriptor = wgpu::TextureDescriptor {
            label: Some("eye"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        };
        let adopt = |image: &u64| {
            // SAFETY: the image belongs to this device and matches the descriptor; according to XR_KHR_vulkan_enable2
            // it is in the layout of colour attachments when it is acquired. The textures are dropped before the
            // swapchain, after the device has finished.
            let texture = unsafe { gpu.adopt_image(*image, &descriptor) };
            let texture = texture.ok_or_else(|| {
                XrError::Gpu(crate::gpu::GpuError::Adopt("swapchain images cannot be adopted".to_owned()))
            })?;
            let view = |layer: u32| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    dimension: Some(wgpu::TextureViewDimension::D2),
                    base_array_layer: layer,
                    array_layer_count: Some(1),
                    ..Default::default()
                })
            };
            let views = (0..layers).map(view).collect();
            Ok(Image { texture, views })
        };
        let images = raw.iter().map(adopt).collect::<Result<_, XrError>>()?;
        Ok(Self { images, swapchain, acquired: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runtimes_preferred_format_is_used_unless_configured() {
        let raw = |format: vk::Format| format.as_raw() as u32;
        let offered =
            [raw(vk::Format::R16G16B16A16_UNORM), raw(vk::Format::B8G8R8A8_SRGB), raw(vk::Format::R16G16B16A16_SFLOAT)];
        let chosen = |wanted| choose_format(&offered, wanted).map(|(_, texture)| texture);
        assert_eq!(chosen(SwapchainFormat::Auto), Ok(wgpu::TextureFormat::Bgra8UnormSrgb));
        assert_eq!(chosen(SwapchainFormat::Rgba16f), Ok(wgpu::TextureFormat::Rgba16Float));
        let problem = chosen(SwapchainFormat::Rgba8Srgb).unwrap_err();
        assert!(problem.contains("R8G8B8A8_SRGB") && problem.contains("B8G8R8A8_SRGB"), "{problem}");
        assert!(choose_format(&[raw(vk::Format::R16G16B16A16_UNORM)], SwapchainFormat::Auto).is_err());
    }
}

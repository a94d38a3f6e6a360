//! A window's surface: which format it has, and what is drawn into it.

use std::sync::Arc;

use winit::window::Window;

use super::{
    WindowsError,
    adapter::WindowGpu,
    picture::{Picture, Pipelines, Placing},
    pixels::texture_format,
    plate::PlateText,
};
use crate::config::{WindowConfig, WindowFormat};

/// Images between the adapter and the monitor, at most: one is shown while the next is drawn.
const FRAME_LATENCY: u32 = 1;

/// The formats and colour spaces of a surface that a window of that format may have, the best first.
fn surfaces_of(format: WindowFormat) -> &'static [(wgpu::TextureFormat, wgpu::SurfaceColorSpace)] {
    use wgpu::{SurfaceColorSpace as Space, TextureFormat as Format};
    match format {
        // Codes are written as they are, so none that encodes by itself.
        WindowFormat::Srgb8 => &[(Format::Bgra8Unorm, Space::Srgb), (Format::Rgba8Unorm, Space::Srgb)],
        WindowFormat::Rgb10 => &[(Format::Rgb10a2Unorm, Space::Srgb)],
        WindowFormat::Hdr => &[(Format::Rgba16Float, Space::ExtendedSrgbLinear)],
    }
}

/// The surface's own format for a window, if there is one.
fn chosen_surface(
    capabilities: &wgpu::SurfaceCapabilities,
    format: WindowFormat,
) -> Option<(wgpu::TextureFormat, wgpu::SurfaceColorSpace)> {
    surfaces_of(format).iter().copied().find(|(texture, space)| {
        space.to_color_spaces().is_some_and(|space| capabilities.color_spaces(*texture).contains(space))
    })
}

/// What a screen shows now.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shown {
    pub(super) black: bool,
    pub(super) plate: Option<PlateText>,
}

/// The surface of a window.
pub(super) struct Screen {
    surface: wgpu::Surface<'static>,
    window: Arc<Window>,
    configuration: wgpu::SurfaceConfiguration,
    format: WindowFormat,
    picture: Option<Picture>,
    plate: Option<(PlateText, Picture)>,
}

impl Screen {
    /// Configures a window's surface.
    ///
    /// # Errors
    ///
    /// It lacks the format.
    pub(super) fn new(
        gpu: &WindowGpu,
        surface: wgpu::Surface<'static>,
        window: Arc<Window>,
        config: &WindowConfig,
        size: [u32; 2],
    ) -> Result<Self, WindowsError> {
        let capabilities = surface.get_capabilities(&gpu.adapter);
        let Some((texture_format, color_space)) = chosen_surface(&capabilities, config.format) else {
            let all = [WindowFormat::Srgb8, WindowFormat::Rgb10, WindowFormat::Hdr];
            let offered = all.into_iter().filter(|format| chosen_surface(&capabilities, *format).is_some());
            let offered: Vec<String> = offered.map(|format| format!("\"{}\"", format.name())).collect();
            return Err(WindowsError::Format {
                window: config.name.clone(),
                wanted: config.format.name(),
                adapter: gpu.name.clone(),
                offered: if offered.is_empty() { "none".to_owned() } else { offered.join(", ") },
            });
        };
        let configuration = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format: texture_format,
            color_space,
            width: size[0].max(1),
            height: size[1].max(1),
            present_mode: if config.vsync { wgpu::PresentMode::AutoVsync } else { wgpu::PresentMode::AutoNoVsync },
            desired_maximum_frame_latency: FRAME_LATENCY,
            alpha_mode: wgpu::CompositeAlphaMode::Auto,
            view_formats: Vec::new(),
        };
        surface.configure(&gpu.device, &configuration);
        tracing::debug!("window `{}`: {texture_format:?}, {color_space:?}, {size:?}", config.name);
        Ok(Self { surface, window, configuration, format: config.format, picture: None, plate: None })
    }

    /// Whether it is the surface of this window.
    pub(super) fn is_of(&self, window: &Arc<Window>) -> bool {
        Arc::ptr_eq(&self.window, window)
    }

    /// Has the window's size from now on.
    pub(super) fn resize(&mut self, gpu: &WindowGpu, size: [u32; 2]) {
        let size = size.map(|side| side.max(1));
        if [self.configuration.width, self.configuration.height] != size {
            [self.configuration.width, self.configuration.height] = size;
            self.surface.configure(&gpu.device, &self.configuration);
        }
    }

    /// Takes the texels of an image.
    pub(super) fn fill(&mut self, gpu: &WindowGpu, size: [u32; 2], texels: &[u8]) {
        let picture = match self.picture.take().filter(|picture| picture.size() == size) {
            Some(picture) => picture,
            None => Picture::new(gpu, size, texture_format(self.format)),
        };
        picture.fill(gpu, texels);
        self.picture = Some(picture);
    }

    /// The surface's next texture. `None`: not now; one is tried again with the next frame.
    pub(super) fn acquire(&self, gpu: &WindowGpu) -> Option<wgpu::SurfaceTexture> {
        use wgpu::CurrentSurfaceTexture as Current;
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                Current::Success(texture) => return Some(texture),
                Current::Suboptimal(texture) => {
                    // It is still shown as it should be; the next one has the new size.
                    return Some(texture);
                }
                Current::Outdated | Current::Lost => self.surface.configure(&gpu.device, &self.configuration),
                Current::Timeout | Current::Occluded | Current::Validation => return None,
            }
        }
        None
    }

    /// Records what is shown.
    pub(super) fn draw(
        &mut self,
        gpu: &WindowGpu,
        pipelines: &mut Pipelines,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::Texture,
        shown: &Shown,
    ) {
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("window"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        let size = [target.width(), target.height()];
        let into = (self.format, target.format());
        if let Some(picture) = self.picture.as_ref().filter(|_| !shown.black) {
            picture.draw(gpu, pipelines, &mut pass, into, Placing::fitted(picture.size(), size));
        }
        if let Some(text) = &shown.plate {
            let (_, plate) = match self.plate.take().filter(|(made, _)| made == text) {
                Some(plate) => self.plate.insert(plate),
                None => {
                    let (size, pixels) = text.pixels();
                    let plate = Picture::new(gpu, size, wgpu::TextureFormat::Rgba8Unorm);
                    plate.fill(gpu, &pixels);
                    self.plate.insert((text.clone(), plate))
                }
            };
            // What is left of a window that was made smaller meanwhile has room for a part of it.
            let room = [0, 1].map(|axis| plate.size()[axis].min(size[axis]));
            let corner = [0, 1].map(|axis| (size[axis] - room[axis]) / 2);
            pass.set_scissor_rect(corner[0], corner[1], room[0], room[1]);
            let placing = Placing { corner: corner.map(|place| place as f32), scale: 1.0 };
            plate.draw(gpu, pipelines, &mut pass, into, placing);
        }
    }

    /// Tells the window system that an image is about to be handed over.
    pub(super) fn about_to_present(&self) {
        self.window.pre_present_notify();
    }
}

//! The surface of a window: its format, and drawing into it.

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

/// Maximum number of images between the adapter and the monitor: one is displayed while the next is drawn.
const FRAME_LATENCY: u32 = 1;

/// Returns the formats and colour spaces that a surface may have for a window format, best first.
fn surfaces_of(format: WindowFormat) -> &'static [(wgpu::TextureFormat, wgpu::SurfaceColorSpace)] {
    use wgpu::{SurfaceColorSpace as Space, TextureFormat as Format};
    match format {
        // Codes are written unchanged, so formats that encode automatically are excluded.
        WindowFormat::Srgb8 => &[(Format::Bgra8Unorm, Space::Srgb), (Format::Rgba8Unorm, Space::Srgb)],
        WindowFormat::Rgb10 => &[(Format::Rgb10a2Unorm, Space::Srgb)],
        WindowFormat::Hdr => &[(Format::Rgba16Float, Space::ExtendedSrgbLinear)],
    }
}

/// Chooses the surface format for a window, if there is one.
fn chosen_surface(
    capabilities: &wgpu::SurfaceCapabilities,
    format: WindowFormat,
) -> Option<(wgpu::TextureFormat, wgpu::SurfaceColorSpace)> {
    surfaces_of(format).iter().copied().find(|(texture, space)| {
        space.to_color_spaces().is_some_and(|space| capabilities.color_spaces(*texture).contains(space))
    })
}

/// Content of a screen.
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
    /// Pictures that are not shown and whose textures can be filled again.
    spare: Vec<Picture>,
    /// The surface's next texture, if it was acquired ahead of the frame.
    acquired: Option<wgpu::SurfaceTexture>,
    plate: Option<(PlateText, Picture)>,
}

impl Screen {
    /// Configures a window's surface.
    ///
    /// # Errors
    ///
    /// The surface does not support the format.
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
        Ok(Self {
            surface,
            window,
            configuration,
            format: config.format,
            picture: None,
            spare: Vec::new(),
            acquired: None,
            plate: None,
        })
    }

    /// Whether this is the surface of `window`.
    pub(super) fn is_of(&self, window: &Arc<Window>) -> bool {
        Arc::ptr_eq(&self.window, window)
    }

    /// Adapts the surface to a new size of the window.
    pub(super) fn resize(&mut self, gpu: &WindowGpu, size: [u32; 2]) {
        let size = size.map(|side| side.max(1));
        if [self.configuration.width, self.configuration.height] != size {
            [self.configuration.width, self.configuration.height] = size;
            // A texture of the previous size must be returned before that.
            self.acquired = None;
            self.surface.configure(&gpu.device, &self.configuration);
        }
    }

    /// Uploads the texels of an image without showing it.
    pub(super) fn upload(&mut self, gpu: &WindowGpu, size: [u32; 2], texels: &[u8]) -> Picture {
        let fits = self.spare.iter().position(|picture| picture.size() == size);
        let picture = match fits {
            Some(index) => self.spare.swap_remove(index),
            None => {
                self.spare.clear();
                Picture::new(gpu, size, texture_format(self.format))
            }
        };
        picture.fill(gpu, texels);
        picture
    }

    /// Uploads the texels of an image. From the next drawing on, the screen shows the image.
    pub(super) fn fill(&mut self, gpu: &WindowGpu, size: [u32; 2], texels: &[u8]) {
        // The texture of the old picture can be filled again: nothing else is drawn before that.
        self.spare.extend(self.picture.take());
        let picture = self.upload(gpu, size, texels);
        self.picture = Some(picture);
    }

    /// Makes the screen show this picture from the next drawing on.
    pub(super) fn put(&mut self, picture: Picture) {
        self.spare.extend(self.picture.replace(picture));
    }

    /// Takes back a picture that is not shown, so that its texture can be used for another picture.
    pub(super) fn take_back(&mut self, picture: Picture) {
        self.spare.push(picture);
    }

    /// Acquires the surface's next texture ahead of the frame, if it has not been acquired yet.
    pub(super) fn acquire_ahead(&mut self, gpu: &WindowGpu) {
        if self.acquired.is_none() {
            self.acquired = self.acquire_now(gpu);
        }
    }

    /// Returns the surface's next texture. `None` if it is not available now; the next frame makes another attempt.
    pub(super) fn acquire(&mut self, gpu: &WindowGpu) -> Option<wgpu::SurfaceTexture> {
        self.acquired.take().or_else(|| self.acquire_now(gpu))
    }

    fn acquire_now(&self, gpu: &WindowGpu) -> Option<wgpu::SurfaceTexture> {
        use wgpu::CurrentSurfaceTexture as Current;
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                Current::Success(texture) => return Some(texture),
                Current::Suboptimal(texture) => {
                    // This texture is still displayed correctly; the next one will have the new size.
                    return Some(texture);
                }
                Current::Outdated | Current::Lost => self.surface.configure(&gpu.device, &self.configuration),
                Current::Timeout | Current::Occluded | Current::Validation => return None,
            }
        }
        None
    }

    /// Records the drawing of the content.
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
            // A window that has become smaller may have room only for a part of the plate.
            let room = [0, 1].map(|axis| plate.size()[axis].min(size[axis]));
            let corner = [0, 1].map(|axis| (size[axis] - room[axis]) / 2);
            pass.set_scissor_rect(corner[0], corner[1], room[0], room[1]);
            let placing = Placing { corner: corner.map(|place| place as f32), scale: 1.0 };
            plate.draw(gpu, pipelines, &mut pass, into, placing);
        }
    }

    /// Notifies the window system that an image is about to be presented.
    pub(super) fn about_to_present(&self) {
        self.window.pre_present_notify();
    }
}

//! Drawing a frame's images straight into textures, those of a headset's swapchain for example.

use super::{
    Wanted,
    error::RenderError,
    renderer::{BatchBuffers, DISPLAY_BYTES, Prepared},
};
use crate::{
    gpu::{Gpu, GpuTimer},
    passes::present::{PresentPass, PresentSource, PresentTile, present_source},
    plan::{settings::ToneMapSettings, tiles::BYTES_PER_PIXEL},
    view::{Rig, Viewport},
};

/// A texture that an image of the frame is drawn into.
#[derive(Clone, Copy, Debug)]
pub struct Presentation<'a> {
    /// Which image: an index into [`Rig::viewports`].
    pub viewport: usize,
    /// One layer and level of a texture of the renderer's device, as large as the image. All of it is written, with alpha 1.
    pub target: &'a wgpu::TextureView,
    /// The view's format. `Rgba8UnormSrgb` and `Bgra8UnormSrgb` hold the bytes of the display image. `Rgba16Float` holds the linear
    /// values that the tone mapping gives, 0 to 1 for black to display white, rounded to the nearest half and not dithered.
    pub format: wgpu::TextureFormat,
}

/// Whom a frame is made for: what is read back, and what is drawn into textures.
#[derive(Clone, Copy)]
pub(super) struct Outputs<'a> {
    /// One per view.
    pub wanted: &'a [Wanted],
    pub presentations: &'a [Presentation<'a>],
}

impl Outputs<'_> {
    /// What is made of each viewport, whether it is read back or not.
    pub(super) fn made(&self, viewports: &[Viewport]) -> Vec<Wanted> {
        let mut made: Vec<Wanted> = viewports.iter().map(|viewport| self.wanted[viewport.view]).collect();
        for presentation in self.presentations {
            let made = &mut made[presentation.viewport];
            match present_source(presentation.format) {
                Some(PresentSource::Codes) => made.display = true,
                Some(PresentSource::Light) => made.hdr_stays = true,
                None => {}
            }
        }
        made
    }
}

/// Whether the images of a rig can be drawn into these textures.
pub(super) fn check_presentations(rig: &Rig, presentations: &[Presentation<'_>]) -> Result<(), RenderError> {
    let images: Vec<_> =
        rig.views().iter().flat_map(|view| view.images.iter().map(|image| (&view.name, image))).collect();
    for presentation in presentations {
        let Some((name, image)) = images.get(presentation.viewport) else {
            return Err(RenderError::NoSuchImage { viewport: presentation.viewport, images: images.len() });
        };
        if present_source(presentation.format).is_none() {
            return Err(RenderError::PresentationFormat { view: (*name).clone(), format: presentation.format });
        }
        let [width, height] = image.projection.mapping().size();
        let texture = presentation.target.texture();
        if (texture.width(), texture.height()) != (width, height) {
            return Err(RenderError::PresentationSize {
                view: (*name).clone(),
                texture: [texture.width(), texture.height()],
                image: [width, height],
            });
        }
    }
    Ok(())
}

/// Records one presentation: after everything that its image is made of.
#[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
pub(super) fn record_presentation(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    timer: &mut GpuTimer,
    present: &mut PresentPass,
    prepared: &Prepared,
    batch_buffers: &mut [BatchBuffers],
    exposure: &wgpu::Buffer,
    tone_map: &ToneMapSettings,
    presentation: &Presentation<'_>,
) {
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("present"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: presentation.target,
            depth_slice: None,
            resolve_target: None,
            // Every pixel is written: what was there is not wanted.
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
        })],
        depth_stencil_attachment: None,
        timestamp_writes: timer.render_pass("present"),
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let width = prepared.viewports[presentation.viewport].size()[0];
    for (batch, buffers) in prepared.batches.iter().zip(batch_buffers) {
        let pixels = match present_source(presentation.format) {
            Some(PresentSource::Codes) => buffers.display.with_room(gpu, batch.pixels * DISPLAY_BYTES),
            _ => buffers.pixels.with_room(gpu, batch.pixels * BYTES_PER_PIXEL),
        };
        for tile in batch.tiles.iter().filter(|tile| tile.viewport == presentation.viewport) {
            let plane_pixels = batch.pixels as u32;
            let target = PresentTile { tile, width, plane_pixels, pixels, exposure };
            present.record(gpu, &mut pass, tone_map, presentation.format, &target);
        }
    }
}

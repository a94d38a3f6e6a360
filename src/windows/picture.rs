//! Images as textures, and how they are drawn into windows. Shader: `shaders/windows/picture.wgsl`.

use super::adapter::WindowGpu;
use crate::{config::WindowFormat, render::Shader};

/// Key of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Variant {
    /// Format of the surface.
    target: wgpu::TextureFormat,
    /// Whether the image contains sRGB codes, and whether the target does.
    codes: [bool; 2],
}

/// Pipelines, each created on first use.
#[derive(Default)]
pub(super) struct Pipelines {
    made: Vec<(Variant, wgpu::RenderPipeline)>,
}

impl Pipelines {
    fn get(&mut self, gpu: &WindowGpu, variant: Variant) -> wgpu::RenderPipeline {
        if let Some((_, pipeline)) = self.made.iter().find(|(made, _)| *made == variant) {
            return pipeline.clone();
        }
        let vertex = Shader::new("shared/whole_target").source();
        let fragment = Shader::new("windows/picture").source();
        let module = |label: &str, text: &str| {
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            })
        };
        let [image, target] = variant.codes.map(|codes| f64::from(u8::from(codes)));
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment.name),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module(vertex.name, &vertex.text),
                entry_point: Some(vertex.entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module(fragment.name, &fragment.text),
                entry_point: Some(fragment.entry_point),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[("IMAGE_CODES", image), ("TARGET_CODES", target)],
                    zero_initialize_workgroup_memory: false,
                },
                targets: &[Some(variant.target.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        self.made.push((variant, pipeline.clone()));
        pipeline
    }
}

/// Placement of an image in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placing {
    /// Upper left corner, pixels of the window.
    pub(super) corner: [f32; 2],
    /// Pixels of the window per pixel of the image.
    pub(super) scale: f32,
}

impl Placing {
    /// Centres the image and makes it as large as possible with its aspect ratio. An image of the window's size is drawn pixel by pixel.
    pub(super) fn fitted(image: [u32; 2], window: [u32; 2]) -> Self {
        let [of_width, of_height] = [0, 1].map(|axis| f64::from(window[axis]) / f64::from(image[axis]));
        let scale = of_width.min(of_height);
        let middle = |axis: usize| (f64::from(window[axis]) - f64::from(image[axis]) * scale) / 2.0;
        let corner = [middle(0), middle(1)].map(|place| if scale == 1.0 { place.floor() } else { place });
        Self { corner: corner.map(|place| place as f32), scale: scale as f32 }
    }
}

/// An image on the device.
pub(super) struct Picture {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    placed: wgpu::Buffer,
}

impl Picture {
    /// Creates an empty picture of a size.
    pub(super) fn new(gpu: &WindowGpu, size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("image of a window"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let placed = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("place of an image in a window"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self { texture, view, placed }
    }

    /// Returns width and height, pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.texture.width(), self.texture.height()]
    }

    /// Uploads texels, row by row from the top.
    pub(super) fn fill(&self, gpu: &WindowGpu, texels: &[u8]) {
        let [width, height] = self.size();
        let bytes = self.texture.format().block_copy_size(None).unwrap_or(4);
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * bytes), rows_per_image: Some(height) };
        gpu.queue.write_texture(self.texture.as_image_copy(), texels, layout, self.texture.size());
    }

    /// Records the commands that draw the picture into a target; `format` is the format of the window.
    pub(super) fn draw(
        &self,
        gpu: &WindowGpu,
        pipelines: &mut Pipelines,
        pass: &mut wgpu::RenderPass<'_>,
        (format, target): (WindowFormat, wgpu::TextureFormat),
        placing: Placing,
    ) {
        let codes = [self.texture.format() != wgpu::TextureFormat::Rgba16Float, format != WindowFormat::Hdr];
        let pipeline = pipelines.get(gpu, Variant { target, codes });
        let placed = [placing.corner[0], placing.corner[1], placing.scale, 0.0];
        gpu.queue.write_buffer(&self.placed, 0, bytemuck::cast_slice(&placed));
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&self.view) },
            wgpu::BindGroupEntry { binding: 1, resource: self.placed.as_entire_binding() },
        ];
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("image of a window"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_equal_size_map_pixel_to_pixel_and_others_keep_their_aspect() {
        assert_eq!(Placing::fitted([640, 360], [640, 360]), Placing { corner: [0.0, 0.0], scale: 1.0 });
        assert_eq!(Placing::fitted([640, 360], [801, 360]), Placing { corner: [80.0, 0.0], scale: 1.0 });
        assert_eq!(Placing::fitted([100, 100], [400, 200]), Placing { corner: [100.0, 0.0], scale: 2.0 });
        assert_eq!(Placing::fitted([400, 100], [200, 200]), Placing { corner: [0.0, 75.0], scale: 0.5 });
    }
}

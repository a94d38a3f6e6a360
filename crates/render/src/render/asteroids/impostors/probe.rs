//! Draws single asteroids as impostors into one flat picture, for tests and diagnostics.
//!
//! No shader: draws with the shaders of asteroids/impostors/draw, for tests.
//! No twin: reference/asteroids/impostors/picture.rs.

use glam::{DMat3, DVec3};

use super::atlas::{BakedImpostors, ImpostorAtlas, ImpostorAtlasError};
use super::draw::AsteroidSource;
use crate::render::constants::reflection::{LAW_LAMBERT, LAW_LOMMEL_SEELIGER};
use crate::{
    gpu::{Gpu, GpuError, LayoutOf, read_layer, storage_buffer, texels_of_halves, uniform_buffer},
    plan::{
        KernelPlan,
        asteroids::{AsteroidSettings, ImpostorMethod},
    },
    render::{
        asteroids::layout,
        asteroids::{
            impostors::draw::{AsteroidImpostorPass, CORNERS},
            raster::{ASTEROID_COLOUR, ASTEROID_DEPTH},
        },
        viewport::encode_viewport,
    },
    scene::{asteroids::ShapeSet, bodies::ReflectionLaw},
    view::Viewport,
};

/// Asteroid in view space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GivenAsteroid {
    /// Centre relative to the eye, view axes, m.
    pub centre_m: DVec3,
    /// Mean radius, m.
    pub radius_m: f64,
    /// Index of its shape.
    pub shape: u32,
    /// Rotation from the shape's axes to view axes.
    pub view_from_shape: DMat3,
    /// Unit vector towards the sun, view axes.
    pub sun: DVec3,
    /// Geometric albedo times illuminance divided by pi: luminance of a white disc that faces the sun, cd/m^2.
    pub luminance_cd_m2: DVec3,
    /// Reflection law.
    pub law: ReflectionLaw,
}

/// Picture of impostors, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ImpostorPicture {
    /// Luminance, linear Rec. 709, cd/m^2; zero in empty pixels.
    pub luminance_cd_m2: Vec<[f32; 3]>,
    /// Distance along the view's axis, m; `None` in empty pixels.
    pub distance_m: Vec<Option<f64>>,
}

/// Draws impostors of one set of shapes by one method.
pub struct ImpostorProbe {
    pass: AsteroidImpostorPass,
    source: wgpu::BindGroupLayout,
    atlas: ImpostorAtlas,
}

impl ImpostorProbe {
    /// Bakes the atlas of the method or reads it from the cache. Returns `None` for methods without impostors.
    pub fn new(
        gpu: &Gpu,
        shapes: &ShapeSet,
        method: ImpostorMethod,
        settings: &AsteroidSettings,
    ) -> Result<Option<Self>, ImpostorAtlasError> {
        let source = given_layout(gpu);
        let Some(pass) = AsteroidImpostorPass::new(gpu, AsteroidSource::Given, &source, method) else {
            return Ok(None);
        };
        let atlas = ImpostorAtlas::new(gpu, &BakedImpostors::new(gpu), shapes, method, settings)?;
        Ok(atlas.map(|atlas| Self { pass, source, atlas }))
    }

    /// Draws asteroids through a flat viewport. Parts nearer than `near_m` along the view's axis are clipped.
    pub fn picture(
        &self,
        gpu: &Gpu,
        viewport: &Viewport,
        near_m: f64,
        asteroids: &[GivenAsteroid],
    ) -> Result<ImpostorPicture, GpuError> {
        // Bind groups and targets.
        let [width, height] = viewport.size();
        let target = layout::GivenTarget {
            viewport: encode_viewport(viewport, &KernelPlan::bspline()),
            near: near_m as f32,
            ..Default::default()
        };
        let target = uniform_buffer(gpu, "given target", &target);
        let given: Vec<layout::GivenAsteroid> = asteroids.iter().map(encode).collect();
        let given = storage_buffer(gpu, "given asteroids", &given);
        let source = gpu
            .bind_once(LayoutOf::Own(&self.source), &[(0, target.as_entire_binding()), (1, given.as_entire_binding())]);
        let atlas = self.pass.atlas_group(gpu, &self.atlas.bindings());
        let texture = |format| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("impostor probe"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let (colour, depth) = (texture(ASTEROID_COLOUR), texture(ASTEROID_DEPTH));
        // Draw.
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("impostor probe"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &colour.create_view(&wgpu::TextureViewDescriptor::default()),
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &depth.create_view(&wgpu::TextureViewDescriptor::default()),
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            self.pass.begin(&mut pass, &source, &[], &atlas);
            pass.draw(0..CORNERS, 0..asteroids.len() as u32);
        }
        gpu.queue.submit([encoder.finish()]);
        // Read colour and depth back.
        let (colours, depths) = (read_layer(gpu, &colour, 0)?, read_layer(gpu, &depth, 0)?);
        let (depths, _) = depths.as_chunks::<4>();
        let distance = |depth: &[u8; 4]| Some(f32::from_le_bytes(*depth)).filter(|depth| *depth > 0.0);
        Ok(ImpostorPicture {
            luminance_cd_m2: texels_of_halves(&colours).into_iter().map(|[r, g, b, _]| [r, g, b]).collect(),
            distance_m: depths.iter().map(|depth| distance(depth).map(|depth| near_m / f64::from(depth))).collect(),
        })
    }
}

/// Returns the layout of group 0 of `shaders/asteroids/impostors/given.wgsl`.
fn given_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let entries = [
        entry(0, wgpu::ShaderStages::VERTEX_FRAGMENT, wgpu::BufferBindingType::Uniform),
        entry(1, wgpu::ShaderStages::VERTEX, wgpu::BufferBindingType::Storage { read_only: true }),
    ];
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("given asteroids"),
        entries: &entries,
    })
}

fn encode(asteroid: &GivenAsteroid) -> layout::GivenAsteroid {
    let column = |index| asteroid.view_from_shape.col(index).as_vec3().to_array();
    layout::GivenAsteroid {
        centre: asteroid.centre_m.as_vec3().to_array(),
        radius: asteroid.radius_m as f32,
        view_from_shape_x: column(0),
        shape: asteroid.shape,
        view_from_shape_y: column(1),
        law: match asteroid.law {
            ReflectionLaw::Lambert => LAW_LAMBERT,
            ReflectionLaw::LommelSeeliger => LAW_LOMMEL_SEELIGER,
        },
        view_from_shape_z: column(2),
        sun: asteroid.sun.as_vec3().to_array(),
        luminance: asteroid.luminance_cd_m2.as_vec3().to_array(),
        ..Default::default()
    }
}

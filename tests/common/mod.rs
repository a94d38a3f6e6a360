//! What the integration tests share: a renderer on the software adapter, made-up skies, and sums of light in f64.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::sync::Arc;

use glam::{DQuat, DVec3};
use steradian::{
    catalogue::{StarRecord, chunks::StarSet},
    frame::{Frame, FrameImage, Renderer, Wanted},
    gpu::{Gpu, GpuOptions},
    photometry::rec709::luminance,
    plan::settings::{RenderSettings, StarMethod},
    scene::{Camera, SceneSnapshot},
    view::{Rig, View, ViewKind, projection::PlaneMapping},
};

/// A renderer. There is always an adapter where tests run: `make test` sees to it, and without one this fails.
pub fn renderer() -> Renderer {
    renderer_with(&GpuOptions::default())
}

pub fn renderer_with(options: &GpuOptions) -> Renderer {
    Renderer::new(Gpu::open(options).expect("tests need a Vulkan adapter; `make test` installs the software one"))
}

/// A star at infinity.
pub fn star(direction: DVec3, magnitude: f32) -> StarRecord {
    StarRecord { position: direction.normalize(), magnitude, temperature_k: 5772.0, distance_known: false }
}

/// Directions spread evenly over the sphere.
pub fn spiral(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
    })
}

pub fn snapshot(records: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot { revision: 1, stars: Arc::new(StarSet::from_records(records)), camera: Camera::default() }
}

pub fn view(name: &str, kind: ViewKind) -> View {
    View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).expect("a valid view")
}

pub fn rig(kinds: Vec<(&str, ViewKind)>) -> Rig {
    Rig::new(kinds.into_iter().map(|(name, kind)| view(name, kind)).collect()).expect("a valid rig")
}

pub fn settings(method: StarMethod) -> RenderSettings {
    let mut settings = RenderSettings::default();
    settings.stars.method = method;
    settings
}

/// Renders the HDR images of all views.
pub fn render_hdr(renderer: &mut Renderer, snapshot: &SceneSnapshot, rig: &Rig, settings: &RenderSettings) -> Frame {
    let wanted = vec![Wanted { display: false, hdr: true }; rig.views().len()];
    renderer.render(snapshot, rig, settings, &wanted, None).expect("the frame renders")
}

/// Illuminance of an image in lux: the sum of luminance times the solid angle, which comes from f64, not from the shader.
pub fn illuminance_lx(image: &FrameImage, mapping: &dyn PlaneMapping) -> f64 {
    let hdr = image.hdr.as_ref().expect("HDR was asked for");
    hdr.iter()
        .enumerate()
        .filter(|(_, [r, g, b, _])| *r != 0.0 || *g != 0.0 || *b != 0.0)
        .map(|(i, [r, g, b, _])| {
            let omega = mapping.solid_angle_sr(i as u32 % image.width, i as u32 / image.width);
            luminance([*r, *g, *b].map(f64::from)) * omega
        })
        .sum()
}

/// Illuminance of all images of a frame.
pub fn total_illuminance_lx(frame: &Frame, rig: &Rig) -> f64 {
    let mappings = rig.views().iter().flat_map(|view| &view.images).map(|image| image.projection.mapping());
    frame.images.iter().zip(mappings).map(|(image, mapping)| illuminance_lx(image, mapping)).sum()
}

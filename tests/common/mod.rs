//! What the integration tests share: a renderer on the software adapter, made-up skies, and sums of light in f64.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec3};
use steradian::{
    catalogue::{StarRecord, chunks::StarSet},
    frame::{Frame, FrameImage, Renderer, Wanted},
    gpu::{Gpu, GpuOptions},
    metrics::{self, HdrView},
    plan::settings::{RenderSettings, StarMethod},
    reference::stars::ReferenceImage,
    scene::{Camera, SceneSnapshot},
    view::{
        Fov, Rig, View, ViewKind,
        projection::{Face, FisheyeMapping, PlaneMapping},
    },
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
    let wanted = vec![Wanted { display: false, hdr: true, ..Wanted::default() }; rig.views().len()];
    renderer.render(snapshot, rig, settings, &wanted, None).expect("the frame renders")
}

/// The HDR image as the metrics see it: solid angles come from f64, not from the shader.
pub fn hdr_view<'a>(image: &'a FrameImage, mapping: &'a dyn PlaneMapping) -> HdrView<'a> {
    HdrView::new(mapping, image.hdr.as_ref().expect("HDR was asked for")).expect("an image of light")
}

/// Illuminance of an image, lx.
pub fn illuminance_lx(image: &FrameImage, mapping: &dyn PlaneMapping) -> f64 {
    metrics::illuminance_lx(&hdr_view(image, mapping)).expect("no light outside of the picture")
}

/// Illuminance of all images of a frame.
pub fn total_illuminance_lx(frame: &Frame, rig: &Rig) -> f64 {
    let mappings = rig.views().iter().flat_map(|view| &view.images).map(|image| image.projection.mapping());
    frame.images.iter().zip(mappings).map(|(image, mapping)| illuminance_lx(image, mapping)).sum()
}

/// Largest difference of any channel between an image and that of the twin, relative to the brightest of the 3 x 3 pixels
/// around: f32 coordinates shift a kernel by some 1e-5 pixel, and with it the small weights at its edge.
pub fn difference_from_twin(image: &FrameImage, twin: &ReferenceImage, mapping: &dyn PlaneMapping) -> f64 {
    differences_from_twin(image, twin, mapping, 0.0, |rgb| rgb)
}

/// The same of what `of` makes of linear RGB, but for `free_lx`, the rounding of the sums of a pixel.
pub fn differences_from_twin<const N: usize>(
    image: &FrameImage,
    twin: &ReferenceImage,
    mapping: &dyn PlaneMapping,
    free_lx: f64,
    of: impl Fn([f64; 3]) -> [f64; N],
) -> f64 {
    let expected: Vec<[f64; N]> = twin.luminance_cd_m2(mapping).into_iter().map(&of).collect();
    let [width, height] = mapping.size().map(i64::from);
    let around = |index: usize, channel: usize| {
        let (x, y) = (index as i64 % width, index as i64 / width);
        let near = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (x + i, y + j)));
        near.filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y))
            .map(|(x, y)| expected[(y * width + x) as usize][channel])
            .fold(0.0_f64, f64::max)
    };
    // A star just outside of the picture leaves but the edge of its kernel: hence the second term.
    let brightest = expected.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
    let mut worst = 0.0_f64;
    for (index, pixel) in image.hdr.as_ref().expect("asked for").iter().enumerate() {
        let seen = of([pixel[0], pixel[1], pixel[2]].map(f64::from));
        let free = if pixel[3] > 0.0 { free_lx / f64::from(pixel[3]) } else { 0.0 };
        for channel in 0..N {
            let difference = (seen[channel] - expected[index][channel]).abs() - free;
            if difference > 0.0 {
                worst = worst.max(difference / (around(index, channel) + 1e-4 * brightest));
            }
        }
    }
    worst
}

/// Every projection, each with its name.
pub fn all_views() -> Vec<(&'static str, ViewKind)> {
    let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.85 };
    let fisheye =
        |mapping, degrees: f64| ViewKind::Fisheye { size: [160, 160], mapping, fov_rad: degrees.to_radians() };
    vec![
        ("perspective", ViewKind::Perspective { size: [192, 108], fov_y_rad: PI / 3.0 }),
        ("perspective-150", ViewKind::Perspective { size: [160, 160], fov_y_rad: 150f64.to_radians() }),
        ("off-axis", ViewKind::OffAxis { size: [128, 130], fov }),
        ("stereo", ViewKind::Stereo { size: [96, 100], ipd_m: 0.064, fov_left: fov, fov_right: fov.mirrored() }),
        ("cube", ViewKind::Cubemap { face_size: 64, faces: Face::ALL.to_vec() }),
        ("equidistant-180", fisheye(FisheyeMapping::Equidistant, 180.0)),
        ("equidistant-360", fisheye(FisheyeMapping::Equidistant, 360.0)),
        ("equisolid-220", fisheye(FisheyeMapping::Equisolid, 220.0)),
        ("orthographic-180", fisheye(FisheyeMapping::Orthographic, 180.0)),
        ("stereographic-220", fisheye(FisheyeMapping::Stereographic, 220.0)),
        ("domemaster", ViewKind::DomeMaster { size: 160, fov_rad: PI, tilt_rad: 0.3 }),
        ("equirectangular", ViewKind::Equirectangular { size: [192, 96] }),
    ]
}

//! Helpers of the integration tests: a renderer on the software adapter, artificial skies, and sums of light in f64.
#![allow(missing_docs, clippy::unwrap_used, reason = "code of tests: the caller sees the panic")]

pub mod exr_file;
pub mod figures;
pub mod hammer;
pub mod instruction_counts;
mod pool;
mod ports;
pub mod spk;
pub mod theatre;
pub mod trials;

use std::{
    path::Path,
    sync::{Arc, Once},
    time::SystemTime,
};

use glam::{DQuat, DVec3};
pub use pool::{Lent, Pool};
pub use ports::free_port;
pub use steradian::verify::scenes::{all_views, directions_inside, hard_places, snapshot, spiral, star};
use steradian::{
    cache::{self, Cache},
    config::Config,
    gpu::GpuOptions,
    metrics::{self, HdrView},
    plan::settings::{GlareSettings, RenderSettings, StarMethod},
    reference::stars::splat::ReferenceImage,
    render::{Frame, FrameImage, FrameRequest, Renderer, Wanted},
    scene::{SceneSnapshot, loader::load_stars},
    view::{Rig, View, ViewKind, projection::PlaneMapping},
};

/// Borrows a renderer from the pool: its pictures equal those of a new one, but its frame numbers continue.
pub fn renderer() -> Lent {
    renderer_with(&GpuOptions::default())
}

pub fn renderer_with(options: &GpuOptions) -> Lent {
    static POOL: Pool = Pool::new();
    POOL.lend(options)
}

/// Returns a renderer that has not drawn yet, for tests of the data that earlier frames leave in a renderer.
pub fn new_renderer() -> Renderer {
    new_renderer_with(&GpuOptions::default())
}

pub fn new_renderer_with(options: &GpuOptions) -> Renderer {
    pool::open(options)
}

pub fn view(name: &str, kind: ViewKind) -> View {
    View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).expect("a valid view")
}

pub fn rig(kinds: Vec<(&str, ViewKind)>) -> Rig {
    Rig::new(kinds.into_iter().map(|(name, kind)| view(name, kind)).collect()).expect("a valid rig")
}

/// Caches synthetic stars, tables and atlases for all tests of this executable and for its later runs, because many
/// tests use the same ones, and making them takes seconds. Removes the cache of an older build.
fn keep_made_content() {
    static BEGUN: Once = Once::new();
    BEGUN.call_once(|| {
        let executable = std::env::current_exe().unwrap();
        let name = executable.file_stem().unwrap().to_string_lossy().into_owned();
        let built = executable.metadata().unwrap().modified().unwrap();
        let built_s = built.duration_since(SystemTime::UNIX_EPOCH).unwrap().as_secs();
        let kept = executable.parent().unwrap().join("kept").join(name);
        let folder = kept.join(built_s.to_string());
        if !folder.exists() && kept.exists() {
            std::fs::remove_dir_all(&kept).unwrap();
        }
        cache::set_for_process(Some(Cache { folder, most_bytes: 1 << 30 }));
    });
}

/// Loads a configuration from `configs/` with overrides of keys; returns its scene, views and settings.
pub fn configured(file: &str, overrides: &[&str]) -> (SceneSnapshot, Rig, RenderSettings) {
    keep_made_content();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(file);
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    let config = Config::load(&path, &overrides).expect("the configuration is valid");
    let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| {}).expect("the stars can be loaded");
    let scene = SceneSnapshot {
        revision: 1,
        stars: Arc::new(stars),
        objects: Arc::new(config.objects().expect("the objects are valid")),
        camera: config.camera().expect("the camera is valid"),
    };
    (scene, config.rig().expect("the views are valid"), config.render_settings())
}

/// Returns settings without glare, which would take light from the stars.
pub fn settings(method: StarMethod) -> RenderSettings {
    let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
    settings.stars.method = method;
    settings
}

/// Renders the HDR images of all views.
pub fn render_hdr(renderer: &mut Renderer, snapshot: &SceneSnapshot, rig: &Rig, settings: &RenderSettings) -> Frame {
    renderer
        .render(FrameRequest::new(snapshot, rig).settings(settings).wanted(Wanted::hdr()))
        .expect("the frame renders")
}

/// Returns the HDR image in the form that the metrics need. Solid angles are computed in f64, not by the shader.
pub fn hdr_view<'a>(image: &'a FrameImage, mapping: &'a dyn PlaneMapping) -> HdrView<'a> {
    HdrView::new(mapping, image.hdr.as_ref().expect("HDR was requested")).expect("an image of light")
}

/// Returns the illuminance of an image, lx.
pub fn illuminance_lx(image: &FrameImage, mapping: &dyn PlaneMapping) -> f64 {
    metrics::illuminance_lx(&hdr_view(image, mapping)).expect("no light outside of the picture")
}

/// Returns the illuminance of all images of a frame, lx.
pub fn total_illuminance_lx(frame: &Frame, rig: &Rig) -> f64 {
    let mappings = rig.views().iter().flat_map(|view| &view.images).map(|image| image.projection.mapping());
    frame.images.iter().zip(mappings).map(|(image, mapping)| illuminance_lx(image, mapping)).sum()
}

/// Returns the largest difference of any channel between an image and that of the twin, relative to the brightest of
/// the 3 x 3 surrounding pixels. A single pixel is not a good reference, because f32 coordinates shift a kernel by some
/// 1e-5 pixel, which changes the small weights at its edge.
pub fn difference_from_twin(image: &FrameImage, twin: &ReferenceImage, mapping: &dyn PlaneMapping) -> f64 {
    differences_from_twin(image, twin, mapping, 0.0, |rgb| rgb)
}

/// Returns the largest difference of the quantities that `of` computes from linear RGB. A difference of `free_lx`, by
/// which the sums of a pixel are rounded, is not counted.
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
    // The reference includes a share of the image's brightest value, because a star just outside of the picture
    // contributes only the edge of its kernel.
    let brightest = expected.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
    let mut worst = 0.0_f64;
    for (index, pixel) in image.hdr.as_ref().expect("HDR was requested").iter().enumerate() {
        let found = of([pixel[0], pixel[1], pixel[2]].map(f64::from));
        let free = if pixel[3] > 0.0 { free_lx / f64::from(pixel[3]) } else { 0.0 };
        for channel in 0..N {
            let difference = (found[channel] - expected[index][channel]).abs() - free;
            if difference > 0.0 {
                worst = worst.max(difference / (around(index, channel) + 1e-4 * brightest));
            }
        }
    }
    worst
}

//! Compares display images of a deep store with frames that draw every star, in patches of the sky: errors in codes, light, and graininess (the
//! variance of a patch). Four views look in three directions at two exposures. Run: `cargo bench --bench deep_patches -- FOLDER [GIB]`; GIB is the
//! memory for a frame that draws every star.

use std::{f64::consts::PI, path::PathBuf, sync::Arc};

use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use steradian::{
    catalogue::epoch::Epoch,
    chart::DisplayErrors,
    coordinates::direction_from_lon_lat,
    memory_size::MemorySize,
    plan::{
        Output,
        settings::{ExposureSettings, GlareSettings, RenderSettings},
    },
    render::{Frame, FrameRequest, Renderer, SkyMapUse, Wanted},
    scene::{
        Camera, SceneSnapshot,
        loader::{StarSource, load_stars},
    },
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

const PATCHES: usize = 200;
/// Side of a patch, pixels.
const SIDE: usize = 32;
/// Directions, ICRS degrees: the galactic centre, Cygnus in the Milky Way, the north galactic pole.
const DIRECTIONS: [(&str, [f64; 2]); 3] =
    [("centre", [266.4, -28.94]), ("Cygnus", [308.0, 41.0]), ("pole", [192.86, 27.13])];
const EXPOSURES: [f64; 2] = [-5.4, -8.5];

fn views() -> [(&'static str, ViewKind); 4] {
    let flat = |degrees: f64| ViewKind::Perspective { size: [1280, 720], fov_y_rad: degrees.to_radians() };
    let dome = ViewKind::Fisheye { size: [1024; 2], mapping: FisheyeMapping::Equidistant, fov_rad: PI };
    [("dome", dome), ("60 deg", flat(60.0)), ("19 deg", flat(19.0)), ("8 deg", flat(8.0))]
}

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let folder = PathBuf::from(words.next().expect("the folder of a deep store"));
    let memory = MemorySize::gib(words.next().map_or(4, |word| word.parse().expect("a number of GiB")));
    let (stars, _) = load_stars(&[StarSource::File(folder)], &Epoch::default(), &mut |_| {}).expect("a deep store");
    let stars = Arc::new(stars);
    let mut renderer = testkit::new_renderer();
    println!("{}", renderer.adapter().adapter);
    println!(
        "view     towards  EV100   drawn      stars      light      99.9 %  patches  largest  variance: mean   least    most"
    );
    for (view, kind) in views() {
        let rig =
            Rig::new(vec![View::new("view", kind, DQuat::IDENTITY, DVec3::ZERO).expect("a view")]).expect("a rig");
        for (direction, [ra, dec]) in DIRECTIONS {
            let towards = direction_from_lon_lat(ra.to_radians(), dec.to_radians());
            let camera =
                Camera { world_from_camera: DQuat::from_rotation_arc(DVec3::NEG_Z, towards), ..Camera::default() };
            let scene = SceneSnapshot { revision: 1, stars: Arc::clone(&stars), objects: Arc::default(), camera };
            for ev100 in EXPOSURES {
                let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
                settings.exposure = ExposureSettings::manual(ev100);
                let mut every_star = settings.clone();
                every_star.stars.every_star = true;
                every_star.stars.memory = memory;
                let mut draw =
                    |settings: &RenderSettings, output: Output| draw(&mut renderer, &scene, &rig, settings, output);
                let exact = draw(&every_star, Output::Hdr);
                let drawn = draw(&settings, Output::Display);
                println!("{view:8} {direction:8} {ev100:5.1} {}", compared(&exact, &drawn, &settings));
            }
        }
    }
}

fn draw(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings, output: Output) -> Frame {
    let request = FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr()).sky_map(SkyMapUse::Wait);
    renderer.render(request.drawn_for(output)).expect("a frame")
}

/// Compares a frame with one that draws every star.
fn compared(exact: &Frame, drawn: &Frame, settings: &RenderSettings) -> String {
    let counts = [drawn, exact].map(|frame| frame.views.iter().map(|view| view.stars_drawn).sum::<u64>());
    let light = [drawn, exact].map(|frame| {
        let pixels = frame.images[0].hdr.iter().flatten();
        pixels.map(|pixel| f64::from(pixel[1]) * f64::from(pixel[3])).sum::<f64>()
    });
    let errors = DisplayErrors::between(exact, drawn, settings);
    // Use the same patches for all frames of the same size.
    let [width, height] = [exact.images[0].width, exact.images[0].height].map(|side| side as usize);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut ratios, mut of_patches) = (Vec::new(), Vec::new());
    let codes = steradian::chart::code_errors(exact, drawn, settings);
    while ratios.len() < PATCHES {
        let [x, y] = [width, height].map(|side| random.random_range(0..side - SIDE));
        let pixels: Vec<usize> = (0..SIDE * SIDE).map(|i| (y + i / SIDE) * width + x + i % SIDE).collect();
        let of = |frame: &Frame| -> Vec<[f32; 4]> {
            let hdr = frame.images[0].hdr.as_ref().expect("pixels");
            pixels.iter().map(|pixel| hdr[*pixel]).collect()
        };
        let (exact, drawn) = (of(exact), of(drawn));
        if exact.iter().any(|pixel| pixel[3] == 0.0) {
            continue;
        }
        let variance = |pixels: &[[f32; 4]]| {
            let mean = pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64;
            pixels.iter().map(|pixel| (f64::from(pixel[1]) - mean).powi(2)).sum::<f64>()
        };
        ratios.push(variance(&drawn) / variance(&exact));
        of_patches.extend(pixels.iter().flat_map(|pixel| codes[0][*pixel]).map(f64::abs));
    }
    ratios.sort_by(f64::total_cmp);
    of_patches.sort_by(f64::total_cmp);
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    format!(
        "{:>9} {:>10} {:+.2e}  {:.3}   {:.3}    {:.3}              {mean:.4}  {:.4}  {:.4}",
        counts[0],
        counts[1],
        light[0] / light[1] - 1.0,
        errors.quantile(0.999),
        of_patches[(0.999 * (of_patches.len() - 1) as f64) as usize],
        errors.quantile(1.0),
        ratios[0],
        ratios[ratios.len() - 1],
    )
}

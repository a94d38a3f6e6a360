//! Measures six projectors of 1920 x 1080 pixels on a dome in the default configuration, with computed blends, and with
//! display images that are read back. Compares drawing directly into the projectors' pixels with warping flat pictures.
//! The methods are interleaved in one run; medians are printed. Run: `cargo bench --bench projectors`, or with width
//! and height.

use testkit::theatre;

use std::{path::Path, sync::Arc, time::Instant};

use glam::{DQuat, DVec3};
use steradian::{
    config::Config,
    gpu::{Gpu, GpuOptions},
    render::{FrameRequest, Renderer, Wanted},
    scene::{SceneSnapshot, loader::load_stars},
    view::{
        Rig, View, ViewKind,
        projection::{DirectionGrid, Interpolation, Placement, PlaneMapping, TabulatedMapping, Warp},
        projector::{Beam, Blend, ProjectorOutput, Resampling, Response, edge_blends},
    },
};

const SAMPLES: usize = 65;
const ROUNDS: usize = 7;

fn mapping(projector: &theatre::Projector) -> Arc<TabulatedMapping> {
    let coordinate = |index: usize| theatre::centre(index, SAMPLES);
    let samples = (0..SAMPLES * SAMPLES)
        .map(|index| Some(projector.direction(coordinate(index % SAMPLES), coordinate(index / SAMPLES))));
    let grid = DirectionGrid {
        columns: SAMPLES,
        rows: SAMPLES,
        samples: samples.collect(),
        placement: Placement::Centres,
        interpolation: Interpolation::Smooth,
    };
    let warp = Warp::new(projector.size_px, &grid).expect("a warp");
    Arc::new(TabulatedMapping::new(warp).expect("a table"))
}

fn rig(mappings: &[Arc<TabulatedMapping>], blends: &[Blend], scale: Option<f64>) -> Rig {
    let view = |(index, (mapping, blend)): (usize, (&Arc<TabulatedMapping>, &Blend))| {
        let resampling = scale.map(|scale| Resampling::new(mapping, scale).expect("a picture"));
        let output = ProjectorOutput::new(mapping.size(), resampling, Some(blend.clone()), Response::default());
        let kind = ViewKind::Projector { mapping: Arc::clone(mapping), output: Arc::new(output.expect("an output")) };
        View::new(&format!("p{index}"), kind, DQuat::IDENTITY, DVec3::ZERO).expect("a view")
    };
    Rig::new(mappings.iter().zip(blends).enumerate().map(view).collect()).expect("a rig")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let sides: Vec<u32> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let size_px = <[u32; 2]>::try_from(sides).unwrap_or([1920, 1080]);
    let projectors = theatre::projectors_of(size_px);
    let start = Instant::now();
    let mappings: Vec<Arc<TabulatedMapping>> = projectors.iter().map(mapping).collect();
    let baked = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let beam = |mapping: &Arc<TabulatedMapping>| Beam {
        mapping: Arc::clone(mapping),
        dome_from_view: DQuat::IDENTITY,
        black: 0.0,
    };
    let beams: Vec<Beam> = mappings.iter().map(beam).collect();
    let blends = edge_blends(&beams);
    println!(
        "tables of {} x {} pixels {baked:.1} s, blends {:.1} s",
        size_px[0],
        size_px[1],
        start.elapsed().as_secs_f64()
    );

    let config = Config::from_text("", "defaults", Path::new("."), &[]).expect("the defaults");
    let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| {}).expect("the stars");
    let scene = SceneSnapshot {
        revision: 1,
        stars: Arc::new(stars),
        objects: Arc::new(config.objects().expect("the objects")),
        camera: config.camera().expect("the camera"),
    };
    let settings = config.render_settings();
    let gpu = Gpu::open(&GpuOptions::default()).expect("an adapter");
    println!("{}", gpu.report());
    let ways = [("direct", None), ("resampled", Some(1.0)), ("resampled, twice the pixels a side", Some(2.0))];
    let mut ways: Vec<(&str, Rig, Renderer, Vec<f64>)> = ways
        .into_iter()
        .map(|(name, scale)| {
            let gpu = Gpu::open(&GpuOptions::default()).expect("an adapter");
            (name, rig(&mappings, &blends, scale), Renderer::new(gpu), Vec::new())
        })
        .collect();
    let mut summary = String::new();
    let mut passes: Vec<Vec<(&str, f64)>> = vec![Vec::new(); ways.len()];
    for round in 0..=ROUNDS {
        for ((_, rig, renderer, times), passes) in ways.iter_mut().zip(&mut passes) {
            let start = Instant::now();
            let request = FrameRequest::new(&scene, rig).settings(&settings).wanted(Wanted::display());
            let frame = renderer.render(request).expect("the frame renders");
            // The first round builds pipelines and uploads stars.
            if round > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            *passes = frame.times.passes_ms.clone();
            let drawn: u64 = frame.views.iter().map(|view| view.stars_drawn).sum();
            summary = format!("ev100 {:.2}, {drawn} stars in all views", frame.exposure_ev100);
        }
    }
    println!("{summary}");
    let direct = median(ways[0].3.clone());
    for ((name, _, _, times), passes) in ways.into_iter().zip(passes) {
        let ms = median(times);
        let passes: Vec<String> = passes.iter().map(|(pass, ms)| format!("{pass} {ms:.0}")).collect();
        println!(
            "{name}: {ms:.0} ms per frame of six projectors, {:.2} of direct; last frame on the adapter, ms: {}",
            ms / direct,
            passes.join(", ")
        );
    }
}

//! Measures frame times on the adapter in use: of ten million stars with and without chunk culling, of a whole frame of
//! a planetarium dome, of the passes of every glare method, and of the passes of asteroid fields. Only the glare
//! benchmarks draw glare. Variants are interleaved in one run; medians are printed. Run: `cargo bench --bench
//! frame_time`, or with the names of some of the benchmarks.

use std::{f64::consts::PI, sync::Arc};

use glam::{DMat3, DQuat, DVec3};
use steradian::{
    catalogue::{
        chunks::StarSet,
        galaxy::{GalaxyParameters, generate},
    },
    coordinates::icrs_from_galactic,
    gpu::{Gpu, GpuOptions},
    plan::{
        settings::{ExposureSettings, GlareMethod, GlareSettings, RenderSettings, StarMethod},
        stars::cull::{CullSettings, SPLAT_MARGIN_PX, visible_chunks},
    },
    render::{FrameRequest, FrameTimes, Renderer, Wanted},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        asteroids::{FieldParameters, FieldSpec, Placement, ShapeSource},
        bodies::{Body, ReflectionLaw, SolarBody},
    },
    view::{
        Fov, Rig, View, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

fn galaxy(stars: usize) -> Arc<StarSet> {
    let parameters = GalaxyParameters { stars, seed: 1, fainter_than: Some(3.5), unresolved_light: false };
    Arc::new(StarSet::from_records(generate(&parameters).expect("the galaxy has so many stars").stars))
}

/// Default settings without glare.
fn stars_alone() -> RenderSettings {
    RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() }
}

fn rig(kind: ViewKind) -> Rig {
    let view = View::new("view", kind, DQuat::IDENTITY, DVec3::ZERO).expect("a valid view");
    Rig::new(vec![view]).expect("a valid rig")
}

/// Returns a camera at the Sun that looks along `direction`.
fn looking(direction: DVec3) -> Camera {
    let back = -direction.normalize();
    let right = DVec3::Z.cross(back).normalize();
    let world_from_camera = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
    Camera { world_from_camera, ..Camera::default() }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn gpu_ms(times: &FrameTimes) -> f64 {
    times.passes_ms.iter().map(|(_, ms)| ms).sum()
}

struct Bench {
    renderer: Renderer,
    settings: RenderSettings,
    frames: usize,
    adapted_ev100: Option<f64>,
}

impl Bench {
    fn frame(&mut self, scene: &SceneSnapshot, rig: &Rig) -> (FrameTimes, u64) {
        // As in the daemon, the exposure of a frame is the one to which the previous frames have adapted.
        let frame = self
            .renderer
            .render(
                FrameRequest::new(scene, rig)
                    .settings(&self.settings)
                    .wanted(Wanted::display())
                    .adapted_ev100(self.adapted_ev100),
            )
            .expect("the frame renders");
        self.adapted_ev100 = Some(frame.metered_ev100);
        (frame.times, frame.views[0].stars_drawn)
    }

    fn culling(&mut self, stars: &Arc<StarSet>) {
        let flat = || rig(ViewKind::Perspective { size: [1920, 1080], fov_y_rad: PI / 3.0 });
        let dome = || rig(ViewKind::Fisheye { size: [2048, 2048], mapping: FisheyeMapping::Equidistant, fov_rad: PI });
        println!(
            "direction             share   read  culled ms  unculled ms  ratio  allowed   (whole frame; star pass)"
        );
        for (name, galactic, rig, anticentre) in [
            ("centre 1080p", DVec3::X, flat(), false),
            ("anticentre 1080p", DVec3::NEG_X, flat(), true),
            ("pole 1080p", DVec3::Z, flat(), false),
            ("centre dome 2048", DVec3::X, dome(), false),
            ("pole dome 2048", DVec3::Z, dome(), false),
        ] {
            let camera = looking(icrs_from_galactic() * galactic);
            let scene = SceneSnapshot { revision: 1, stars: stars.clone(), objects: Default::default(), camera };
            let (mut culled, mut unculled, mut culled_stars, mut unculled_stars) = (vec![], vec![], vec![], vec![]);
            let mut drawn = 0;
            for _ in 0..self.frames {
                for culling in [true, false] {
                    self.renderer.culling = culling;
                    let (times, count) = self.frame(&scene, &rig);
                    drawn = count;
                    let star_ms = times.passes_ms.iter().filter(|p| p.0 == "stars").map(|p| p.1).sum();
                    if culling {
                        culled.push(times.total_ms);
                        culled_stars.push(star_ms);
                    } else {
                        unculled.push(times.total_ms);
                        unculled_stars.push(star_ms);
                    }
                }
            }
            self.renderer.culling = true;
            let share = drawn as f64 / stars.stars.len() as f64;
            let viewports = rig.viewports(camera.world_from_camera);
            let settings = CullSettings {
                faintest_lx: 0.0,
                enabled: true,
                motion: None,
                refraction: None,
                margin_px: SPLAT_MARGIN_PX,
            };
            let visible = visible_chunks(stars, DVec3::ZERO, &viewports, settings);
            let read: u64 = visible.iter().map(|chunk| u64::from(chunk.count)).sum();
            let read_share = read as f64 / stars.stars.len() as f64;
            let (a, b) = (median(culled), median(unculled));
            let (c, d) = (median(culled_stars), median(unculled_stars));
            let allowed = if anticentre { 0.35 } else { share + 0.15 };
            println!(
                "{name:20} {share:6.3} {read_share:6.3} {a:10.1} {b:12.1} {:6.2} {allowed:8.2}   star pass {c:.1} / {d:.1} = {:.2}",
                a / b,
                c / d
            );
        }
    }

    /// Compares our methods with the published rasteriser: GPU time from the first clear to the HDR image, including
    /// culling.
    fn rasterisers(&mut self, stars: &Arc<StarSet>) {
        let flat = rig(ViewKind::Perspective { size: [1920, 1080], fov_y_rad: PI / 3.0 });
        let sky = rig(ViewKind::Equirectangular { size: [2048, 1024] });
        let dome = rig(ViewKind::Fisheye { size: [2048, 2048], mapping: FisheyeMapping::Equidistant, fov_rad: PI });
        let methods = [
            StarMethod::PackedCas,
            StarMethod::PackedCasSorted,
            StarMethod::Auto,
            StarMethod::Tent,
            StarMethod::BSpline,
        ];
        for (name, rig) in [("anticentre 1080p", &flat), ("full sky 2048 x 1024", &sky), ("dome 2048", &dome)] {
            let camera = looking(icrs_from_galactic() * DVec3::NEG_X);
            let scene = SceneSnapshot { revision: 1, stars: stars.clone(), objects: Default::default(), camera };
            // The default manual exposure, at which a star of magnitude 3 reaches white: the naked-eye sky.
            self.settings.exposure = ExposureSettings::manual(-3.0);
            let mut times = vec![vec![]; methods.len()];
            let mut stars_ms = vec![vec![]; methods.len()];
            let mut resolve_ms = vec![vec![]; methods.len()];
            for round in 0..self.frames {
                for (i, method) in methods.into_iter().enumerate() {
                    self.settings.stars.method = method;
                    let frame = self.renderer.render(
                        FrameRequest::new(&scene, rig)
                            .settings(&self.settings)
                            .wanted(Wanted { hdr_stays: true, ..Wanted::default() })
                            .adapted_ev100(self.adapted_ev100),
                    );
                    let frame = frame.expect("the frame renders");
                    if round > 0 {
                        let pass_ms =
                            |pass| frame.times.passes_ms.iter().filter(|p| p.0 == pass).map(|p| p.1).sum::<f64>();
                        times[i].push(frame.times.gpu_ms.expect("timestamps") + frame.times.cull_ms);
                        stars_ms[i].push(pass_ms("stars"));
                        resolve_ms[i].push(pass_ms("resolve"));
                    } else {
                        self.adapted_ev100 = Some(frame.metered_ev100);
                    }
                }
            }
            let reference = median(times[0].clone());
            for (i, method) in methods.into_iter().enumerate() {
                let (all, splat, resolve) =
                    (median(times[i].clone()), median(stars_ms[i].clone()), median(resolve_ms[i].clone()));
                println!(
                    "{} stars, {name}: {:18} {all:7.1} ms, packed_cas / this = {:.2}; stars {splat:.1}, resolve {resolve:.1}",
                    stars.stars.len(),
                    method.name(),
                    reference / all
                );
            }
        }
        self.settings = stars_alone();
    }

    /// Measures the passes of every glare method: total GPU time for a picture that differs little from the previous
    /// one.
    fn glare(&mut self, stars: &Arc<StarSet>) {
        let camera = looking(icrs_from_galactic() * DVec3::X);
        let scene = SceneSnapshot { revision: 1, stars: stars.clone(), objects: Default::default(), camera };
        for size in [[1920, 1080], [3840, 2160]] {
            let rig = rig(ViewKind::Perspective { size, fov_y_rad: PI / 3.0 });
            let mut times = GlareMethod::ALL.map(|method| (method, vec![]));
            for round in 0..=self.frames {
                for (method, glare_ms) in &mut times {
                    self.settings.glare.method = *method;
                    // Draw one frame that does not count, because drawing with the other methods discards the cached
                    // data of this one.
                    self.frame(&scene, &rig);
                    let (times, _) = self.frame(&scene, &rig);
                    // The first round builds pipelines and textures.
                    if round > 0 {
                        glare_ms.push(times.passes_ms.iter().filter(|pass| pass.0 == "glare").map(|pass| pass.1).sum());
                    }
                }
            }
            for (method, glare_ms) in times {
                let fastest = glare_ms.iter().fold(f64::MAX, |a: f64, b| a.min(*b));
                let [width, height] = size;
                println!(
                    "glare, {} stars, {width} x {height}: {:15} {:8.2} ms (fastest {fastest:.2})",
                    stars.stars.len(),
                    method.name(),
                    median(glare_ms)
                );
            }
        }
        self.settings = stars_alone();
    }

    fn dome(&mut self, stars: usize) {
        let scene = SceneSnapshot {
            revision: 1,
            stars: galaxy(stars),
            objects: Default::default(),
            camera: looking(icrs_from_galactic() * DVec3::X),
        };
        let rig = rig(ViewKind::Fisheye { size: [1024, 1024], mapping: FisheyeMapping::Equidistant, fov_rad: PI });
        let mut methods = vec![];
        let mut count = 0;
        for method in [StarMethod::Auto, StarMethod::BSpline, StarMethod::Tent] {
            methods.push((method, vec![], vec![], vec![]));
        }
        for _ in 0..3 * self.frames {
            for (method, total, gpu, passes) in &mut methods {
                self.settings.stars.method = *method;
                let (times, drawn) = self.frame(&scene, &rig);
                total.push(times.total_ms);
                gpu.push(gpu_ms(&times));
                for (i, (name, ms)) in times.passes_ms.iter().enumerate() {
                    if passes.len() <= i {
                        passes.push((*name, *ms));
                    }
                    passes[i].1 = passes[i].1.min(*ms);
                }
                count = drawn;
            }
        }
        self.settings.stars.method = StarMethod::Auto;
        for (method, total, gpu, passes) in methods {
            println!(
                "dome 1024, {count} of {stars} stars in view, {method:?}: whole frame {:.1} ms (fastest {:.1}), passes {:.1} ms; fastest: {passes:.1?}",
                median(total.clone()),
                total.iter().fold(f64::MAX, |a, b| a.min(*b)),
                median(gpu)
            );
        }
    }
}

/// Returns a field of asteroids in a box with its centre 25 km in front of the camera at the Earth's distance from the
/// Sun.
fn asteroids(instances: u32) -> SceneSnapshot {
    let camera = Camera { position_m: DVec3::X * 1.496e11, ..Camera::default() };
    let spec = FieldSpec {
        name: "field".to_owned(),
        position_m: camera.position_m - DVec3::Z * 25_000.0,
        orientation: DQuat::IDENTITY,
        parameters: FieldParameters {
            instances,
            seed: 7,
            placement: Placement::Box { size_m: DVec3::new(20_000.0, 11_000.0, 30_000.0) },
            radius_m: [16.0, 1000.0],
            size_index: 2.5,
            spin_period_s: [600.0, 36_000.0],
        },
        shapes: ShapeSource::Procedural { seed: 3 },
        law: ReflectionLaw::LommelSeeliger,
        geometric_albedo: [0.1; 3],
    };
    let field = Arc::new(spec).make(&[]).expect("a valid field").field;
    let bodies = vec![Arc::new(Body::preset(SolarBody::Sun, "sun", DVec3::ZERO))];
    SceneSnapshot {
        revision: 1,
        stars: Arc::new(StarSet::from_records(Vec::new())),
        objects: Arc::new(SceneObjects { bodies, fields: vec![field], time_s: 0.0, ..Default::default() }),
        camera,
    }
}

/// Passes of a frame that draw asteroids.
const ASTEROID_PASSES: [&str; 4] = ["asteroid cull", "asteroids", "geometry", "stars"];

impl Bench {
    /// Measures a field of asteroids pass by pass: inside and outside of the view, for two eyes and for one, for six
    /// cube faces and for a map of the whole sky.
    fn asteroids(&mut self, instances: u32) {
        let scene = asteroids(instances);
        let moved = |camera: Camera| SceneSnapshot { camera, ..scene.clone() };
        let away = moved(Camera { world_from_camera: DQuat::from_rotation_y(PI), ..scene.camera });
        let within = moved(Camera { position_m: scene.camera.position_m - DVec3::Z * 25_000.0, ..scene.camera });
        let side = 512;
        let eye = Fov { left_rad: -PI / 4.0, right_rad: PI / 4.0, up_rad: PI / 4.0, down_rad: -PI / 4.0 };
        let one = || rig(ViewKind::Perspective { size: [side; 2], fov_y_rad: PI / 2.0 });
        let stereo = ViewKind::Stereo { size: [side; 2], ipd_m: 0.063, fov_left: eye, fov_right: eye.mirrored() };
        let cases = [
            ("one eye, inside", &scene, one()),
            ("one eye, outside", &away, one()),
            ("two eyes, inside", &scene, rig(stereo)),
            ("six faces, within", &within, rig(ViewKind::Cubemap { face_size: side / 2, faces: Face::ALL.to_vec() })),
            ("whole sky, within", &within, rig(ViewKind::Equirectangular { size: [2 * side, side] })),
        ];
        self.settings.exposure = ExposureSettings::manual(-3.0);
        let mut times = vec![vec![vec![]; ASTEROID_PASSES.len() + 1]; cases.len()];
        for round in 0..=self.frames {
            for ((_, scene, rig), times) in cases.iter().zip(&mut times) {
                let (found, _) = self.frame(scene, rig);
                // The first round bakes atlases and enlarges buffers.
                if round > 0 {
                    times[0].push(found.plan_ms);
                    for (pass, times) in ASTEROID_PASSES.iter().zip(&mut times[1..]) {
                        times.push(
                            found
                                .passes_ms
                                .iter()
                                .filter(|entry| entry.0 == *pass)
                                .fold(0.0, |sum, entry| sum + entry.1),
                        );
                    }
                }
            }
        }
        println!("{instances} asteroids, {side} px, medians of {} frames, ms", self.frames);
        println!(
            "{:20} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
            "", "plan", "cull", "layers", "geometry", "points", "all"
        );
        let mut medians = vec![];
        for ((name, _, _), times) in cases.iter().zip(times) {
            let of_case: Vec<f64> = times.into_iter().map(median).collect();
            let cells: String = of_case.iter().map(|ms| format!(" {ms:9.2}")).collect();
            println!("{name:20}{cells} {:9.2}", of_case.iter().sum::<f64>());
            medians.push(of_case);
        }
        // Exclude the pass that composites layers into pictures, which scales with pixels and includes bodies.
        let all = |case: usize| medians[case].iter().sum::<f64>() - medians[case][3];
        let culling = |case: usize| medians[case][..2].iter().sum::<f64>();
        let pass = |case: usize| medians[case][1];
        println!("outside over inside: {:.4}", all(1) / all(0));
        println!("culling, two eyes over one: {:.2} (pass alone {:.2})", culling(2) / culling(0), pass(2) / pass(0));
        println!(
            "culling, six faces over whole sky: {:.2} (pass alone {:.2})\n",
            culling(3) / culling(4),
            pass(3) / pass(4)
        );
        self.settings = stars_alone();
    }
}

fn main() {
    // Cargo passes `--bench`; the other words select benchmarks.
    let chosen: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let wanted = |name: &str| chosen.is_empty() || chosen.iter().any(|word| word == name);
    let gpu = Gpu::open(&GpuOptions::default()).expect("an adapter");
    println!("{}\n", gpu.report());
    let mut bench = Bench { renderer: Renderer::new(gpu), settings: stars_alone(), frames: 7, adapted_ev100: None };
    if wanted("dome") {
        bench.dome(265_000);
    }
    if wanted("rasterisers") {
        let counts: Vec<usize> = chosen.iter().filter_map(|word| word.parse().ok()).collect();
        for stars in if counts.is_empty() { vec![1_000_000, 10_000_000] } else { counts } {
            bench.rasterisers(&galaxy(stars));
        }
    }
    if wanted("glare") {
        bench.glare(&galaxy(1_000_000));
    }
    if wanted("asteroids") {
        let counts: Vec<u32> = chosen.iter().filter_map(|word| word.parse().ok()).collect();
        for instances in if counts.is_empty() { vec![10_000, 100_000] } else { counts } {
            bench.asteroids(instances);
        }
    }
    if wanted("culling") {
        let start = std::time::Instant::now();
        let stars = galaxy(10_000_000);
        println!("10 million stars in {} chunks made in {:.1} s", stars.chunks.len(), start.elapsed().as_secs_f64());
        bench.culling(&stars);
        println!("peak memory {} MiB", peak_memory_mib());
    }
}

/// Returns the peak resident memory of this process, if the system reports it (Linux).
fn peak_memory_mib() -> String {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| {
            let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
            line.split_whitespace().nth(1)?.parse::<u64>().ok()
        })
        .map_or_else(|| "unknown".to_owned(), |kib| (kib / 1024).to_string())
}

//! Compares lists of the adapter with f64 lists, and rasterised spheres with closed forms, read back from buffers and
//! layers.

mod lists;
mod points;
mod raster;

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::*;
use crate::{
    gpu::GpuOptions,
    plan::asteroids::{AsteroidInputs, Tables},
    scene::{
        asteroids::{AsteroidField, GROUP, Instances, Lod, Mesh, Node, PackedAsteroid, Shape, ShapeSet},
        bodies::{ReflectionLaw, Sun},
    },
    view::{Rig, View, ViewKind, Viewport, projection::FisheyeMapping},
};

/// Margin around pictures, pixels.
const MARGIN_PX: f64 = 2.0;

fn gpu() -> Gpu {
    Gpu::open(&GpuOptions::default()).expect("tests need a Vulkan adapter; `make test` installs the software one")
}

/// Returns a sphere made from an icosahedron by halving the edges of its faces `halvings` times.
fn sphere(halvings: u32) -> Mesh {
    let t = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).normalize();
    let mut places: Vec<DVec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|a| [-t, t].map(|b| [corner(a, b, 0.0), corner(0.0, a, b), corner(b, 0.0, a)]))
        .flatten()
        .collect();
    let edge = (places[0]
        - places[1..].iter().copied().min_by(|a, b| a.distance(places[0]).total_cmp(&b.distance(places[0]))).unwrap())
    .length();
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let near = |a: usize, b: usize| (places[a].distance(places[b]) - edge).abs() < 1e-9;
                if near(i, j) && near(j, k) && near(i, k) {
                    let outwards = (places[j] - places[i]).cross(places[k] - places[i]).dot(places[i]) > 0.0;
                    triangles.push(if outwards { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..halvings {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for triangle in triangles {
            let [a, b, c] = triangle;
            let mut middle = |i: usize, j: usize| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    places.push((places[i] + places[j]).normalize());
                    places.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let positions: Vec<[f32; 3]> = places.iter().map(|place| place.as_vec3().to_array()).collect();
    Mesh {
        normals: positions.clone(),
        albedos: vec![1.0; positions.len()],
        positions,
        triangles: triangles.into_iter().map(|triangle| triangle.map(|i| i as u32)).collect(),
    }
}

fn lod(halvings: u32) -> Lod {
    let mesh = sphere(halvings);
    let position = |i: u32| DVec3::from_array(mesh.positions[i as usize].map(f64::from));
    let mut error = 0.0_f64;
    let mut longest_edge = 0.0_f64;
    for [a, b, c] in &mesh.triangles {
        let (a, b, c) = (position(*a), position(*b), position(*c));
        error = error.max(1.0 - ((a + b + c) / 3.0).length());
        longest_edge = longest_edge.max(a.distance(b)).max(b.distance(c)).max(c.distance(a));
    }
    Lod { mesh, error, longest_edge }
}

/// Returns a sphere with three levels of detail, and another shape with two.
fn shapes() -> Arc<ShapeSet> {
    let finest = Lod { error: 0.0, ..lod(4) };
    let shape = |levels: Vec<Lod>| Shape { lods: levels, bound: 1.0 };
    let shapes = vec![shape(vec![finest.clone(), lod(2), lod(1)]), shape(vec![finest, lod(2)])];
    Arc::new(ShapeSet { shapes, digest: 1 })
}

/// Random numbers from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let place = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&place.length()) {
                return place.normalize();
            }
        }
    }
}

fn packed(offset: DVec3, radius_share: f64, shape: u32, random: &mut Random) -> PackedAsteroid {
    let bits = |random: &mut Random| (random.next() * 4_294_967_295.0) as u32;
    PackedAsteroid {
        offset: offset.as_vec3().to_array().map(f32::to_bits),
        radius_and_shape: (radius_share * 65535.0).round() as u32 | shape << 16,
        axis: bits(random),
        spin: bits(random),
    }
}

/// Builds a tree over asteroids in the given order: (position in the field, radius, shape).
fn instances(asteroids: &[(DVec3, f64, u32)], seed: u64) -> Arc<Instances> {
    let mut random = Random(seed);
    let largest_m = asteroids.iter().map(|asteroid| asteroid.1).fold(0.0, f64::max);
    let mut all = Vec::new();
    let mut groups = Vec::new();
    for run in asteroids.chunks(GROUP) {
        let count = run.len() as f64;
        let middle = run.iter().map(|asteroid| asteroid.0).sum::<DVec3>() / count;
        let area = |radius: f64| std::f64::consts::PI * radius * radius;
        let area_m2: f64 = run.iter().map(|asteroid| area(asteroid.1)).sum();
        groups.push(Node {
            middle_m: middle,
            radius_m: run.iter().map(|(place, radius, _)| place.distance(middle) + 1.001 * radius).fold(0.0, f64::max),
            centroid_m: run.iter().map(|(place, radius, _)| *place * area(*radius)).sum::<DVec3>() / area_m2,
            area_m2,
            largest_m: run.iter().map(|asteroid| asteroid.1).fold(0.0, f64::max) * 1.0001,
            smallest_m: run.iter().map(|asteroid| asteroid.1).fold(f64::INFINITY, f64::min) * 0.9999,
            first: all.len() as u32,
            count: run.len() as u32,
        });
        all.extend(
            run.iter().map(|(place, radius, shape)| packed(*place - middle, radius / largest_m, *shape, &mut random)),
        );
    }
    let mut levels = vec![groups];
    while levels.last().unwrap().len() > 1 {
        let below = levels.last().unwrap();
        let above = below.chunks(16).enumerate().map(|(i, run)| {
            let middle = run.iter().map(|node| node.middle_m).sum::<DVec3>() / run.len() as f64;
            let area_m2: f64 = run.iter().map(|node| node.area_m2).sum();
            Node {
                middle_m: middle,
                radius_m: run.iter().map(|node| node.middle_m.distance(middle) + node.radius_m).fold(0.0, f64::max),
                centroid_m: run.iter().map(|node| node.centroid_m * node.area_m2).sum::<DVec3>() / area_m2,
                area_m2,
                largest_m: run.iter().map(|node| node.largest_m).fold(0.0, f64::max),
                smallest_m: run.iter().map(|node| node.smallest_m).fold(f64::INFINITY, f64::min),
                first: 16 * i as u32,
                count: run.len() as u32,
            }
        });
        let above = above.collect();
        levels.push(above);
    }
    Arc::new(Instances { packed: all, levels, largest_m, base_period_s: 1e6 })
}

fn field(instances: Arc<Instances>, shapes: Arc<ShapeSet>) -> Arc<AsteroidField> {
    Arc::new(AsteroidField {
        name: "field".to_owned(),
        position_m: DVec3::new(3e11, -2e11, 1e11),
        orientation: DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0),
        law: ReflectionLaw::Lambert,
        geometric_albedo: [0.2, 0.15, 0.1],
        instances,
        shapes,
    })
}

/// Returns views of every kind.
fn kinds() -> Vec<(&'static str, ViewKind)> {
    let fisheye = |mapping, fov_rad| ViewKind::Fisheye { size: [200, 180], mapping, fov_rad };
    vec![
        ("flat", ViewKind::Perspective { size: [320, 180], fov_y_rad: 1.2 }),
        ("wide", ViewKind::Perspective { size: [160, 160], fov_y_rad: 2.6 }),
        ("dome", fisheye(FisheyeMapping::Equidistant, std::f64::consts::PI)),
        ("all round", fisheye(FisheyeMapping::Equidistant, std::f64::consts::TAU)),
        ("equisolid", fisheye(FisheyeMapping::Equisolid, 4.0)),
        ("orthographic", fisheye(FisheyeMapping::Orthographic, 3.0)),
        ("stereographic", fisheye(FisheyeMapping::Stereographic, 4.5)),
        ("sphere", ViewKind::Equirectangular { size: [360, 180] }),
    ]
}

fn viewports(kinds: &[(&str, ViewKind)], orientation: DQuat) -> Vec<Viewport> {
    let view = |(i, (name, kind)): (usize, &(&str, ViewKind))| {
        let name = format!("{}-{i}", name.replace(' ', "-"));
        View::new(&name, kind.clone(), DQuat::IDENTITY, DVec3::new(0.03 * i as f64, 0.0, 0.0)).unwrap()
    };
    Rig::new(kinds.iter().enumerate().map(view).collect()).unwrap().viewports(orientation)
}

/// Runs a plan and reads buffers and textures back.
struct Bench {
    gpu: Gpu,
    asteroids: Asteroids,
    timer: GpuTimer,
}

impl Bench {
    fn new() -> Self {
        let gpu = gpu();
        Self { asteroids: Asteroids::new(BakedImpostors::new(&gpu)), timer: GpuTimer::new(&gpu), gpu }
    }

    fn plan(
        &mut self,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
        viewports: &[Viewport],
        camera_m: DVec3,
    ) -> AsteroidPlan {
        let suns = [Sun {
            radius_m: 7e8,
            position_m: DVec3::ZERO,
            intensity_cd: [3e27, 2.9e27, 2.8e27],
            occluders: [].into(),
            reflectors: [].into(),
            year: 2000.0,
        }];
        self.plan_lit(objects, settings, viewports, camera_m, &suns)
    }

    fn plan_lit(
        &mut self,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
        viewports: &[Viewport],
        camera_m: DVec3,
        suns: &[Sun],
    ) -> AsteroidPlan {
        self.asteroids.hold_fields(&self.gpu, objects, settings, settings.drawn_impostors()).unwrap();
        let limits = &self.gpu.limits();
        let inputs = AsteroidInputs { objects, settings, viewports, margin_px: MARGIN_PX, camera_m, suns, limits };
        let plan = AsteroidPlan::new(&inputs, &mut Tables::default()).unwrap().unwrap();
        self.asteroids.targets.begin();
        self.asteroids.upload(&self.gpu, &plan, objects);
        plan
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Submits the encoder and returns the contents of buffers.
    fn read<T: bytemuck::Pod>(
        &self,
        mut encoder: wgpu::CommandEncoder,
        sources: &[(&wgpu::Buffer, usize)],
    ) -> Vec<Vec<T>> {
        let mut readback = ReadbackBuffer::new("readback");
        let bytes = |count: usize| ((count * size_of::<T>()) as u64).next_multiple_of(4);
        readback.begin(sources.iter().map(|(_, count)| bytes(*count) + 64).sum());
        let places: Vec<_> = sources
            .iter()
            .map(|(source, count)| readback.copy(&self.gpu, &mut encoder, source, 0, bytes(*count)))
            .collect();
        self.gpu.queue.submit([encoder.finish()]);
        readback.map(&self.gpu);
        self.gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        self.gpu.take_failure().unwrap();
        let values = places
            .iter()
            .zip(sources)
            .map(|(place, (_, count))| readback.read(&self.gpu, *place, *count).unwrap())
            .collect();
        readback.unmap(&self.gpu);
        values
    }
}

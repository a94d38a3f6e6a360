//! Compares rasterised spheres with closed forms, in every kind of picture, on the picture itself and through cube
//! faces.

use super::*;
use crate::{
    gpu::{read_layer, texels_of_halves},
    plan::{bodies::light::illuminance_of, tiles::Tile},
    scene::bodies::{Body, Spin, Surface},
    view::projection::{CubeFace, Face, PlaneMapping, pixel_centre},
};

/// Contents of the layers: colour (units) and depth per sample, of the window and of the faces.
struct LayerContents {
    colour: Vec<[f32; 4]>,
    depth: Vec<f32>,
    faces: Vec<(Face, Vec<[f32; 4]>, Vec<f32>)>,
    face_px: u32,
    samples: u32,
    near_m: f64,
    scale: f64,
}

/// Returns the bytes of the top left part of one texture layer, row by row.
fn texels(bench: &Bench, view: &wgpu::TextureView, layer: u32, [width, height]: [u32; 2], texel_bytes: u32) -> Vec<u8> {
    let row_bytes = view.texture().width() * texel_bytes;
    read_layer(&bench.gpu, view.texture(), layer)
        .unwrap()
        .chunks_exact(row_bytes as usize)
        .take(height as usize)
        .flat_map(|row| row[..(width * texel_bytes) as usize].to_vec())
        .collect()
}

/// Draws a tile and reads its layers back.
fn draw(bench: &mut Bench, plan: &AsteroidPlan, tile: &Tile) -> LayerContents {
    let mut encoder = bench.encoder();
    bench.asteroids.record_cull(&bench.gpu, &mut encoder, &mut bench.timer, plan);
    let size = plan.viewports[tile.viewport].size();
    let (views, faces, face_px, samples, near_m, scale) = {
        let layers = bench.asteroids.record_layers(&bench.gpu, &mut encoder, &mut bench.timer, plan, tile).unwrap();
        let views = [layers.colour, layers.depth, layers.faces_colour, layers.faces_depth];
        (views, layers.faces, layers.face_size_px, layers.samples, layers.near_m, layers.luminance_scale)
    };
    bench.gpu.queue.submit([encoder.finish()]);
    let colours = |bytes: Vec<u8>| texels_of_halves(&bytes);
    let depths = |bytes: Vec<u8>| -> Vec<f32> {
        bytes.chunks_exact(4).map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
    };
    let window = [size[0] * samples, tile.rows * samples];
    let read_face = |face: Face| {
        let side = [face_px; 2];
        let layer = face as u32;
        (face, colours(texels(bench, &views[2], layer, side, 8)), depths(texels(bench, &views[3], layer, side, 4)))
    };
    LayerContents {
        colour: colours(texels(bench, &views[0], 0, window, 8)),
        depth: depths(texels(bench, &views[1], 0, window, 4)),
        faces: Face::ALL.into_iter().filter(|face| faces >> *face as u32 & 1 == 1).map(read_face).collect(),
        face_px,
        samples,
        near_m: f64::from(near_m),
        scale: f64::from(scale),
    }
}

/// Covered solid angle, its centroid (view axes), its light (lx), and the smallest distance along the rays of samples.
#[derive(Clone, Copy, Debug)]
struct Measured {
    solid_angle_sr: f64,
    middle: DVec3,
    light_lx: [f64; 3],
    nearest_m: f64,
}

/// Composites the layers sample by sample and sums up the result. `mapping` treats samples as pixels.
fn measure(layers: &LayerContents, mapping: &dyn PlaneMapping, flat: bool, tile: &Tile) -> Measured {
    let width = mapping.size()[0];
    let first_row = tile.first_row * layers.samples;
    let mut sum = Measured { solid_angle_sr: 0.0, middle: DVec3::ZERO, light_lx: [0.0; 3], nearest_m: f64::INFINITY };
    for y in 0..tile.rows * layers.samples {
        for x in 0..width {
            {
                let omega = mapping.solid_angle_sr(x, y + first_row);
                let Some(direction) = mapping.direction_from_pixel(pixel_centre(x, y + first_row)) else { continue };
                let index = (y * width + x) as usize;
                let mut nearest = 0.0;
                let mut colour = [0.0; 3];
                let mut take = |depth: f32, rgba: [f32; 4], along: f64| {
                    let inverse = f64::from(depth) * along / layers.near_m;
                    if inverse > nearest {
                        assert!(rgba[3] == 1.0);
                        nearest = inverse;
                        colour = [rgba[0], rgba[1], rgba[2]].map(|value| f64::from(value) * layers.scale);
                    }
                };
                take(layers.depth[index], layers.colour[index], if flat { -direction.z } else { 1.0 });
                for (face, colours, depths) in &layers.faces {
                    let own = face.cube_from_face().conjugate() * direction;
                    let plane = CubeFace::new(*face, layers.face_px).unwrap();
                    let Some(pixel) = plane.pixel_from_direction(own) else { continue };
                    let side = f64::from(layers.face_px);
                    if pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < side && pixel.y < side {
                        let texel = pixel.y as usize * layers.face_px as usize + pixel.x as usize;
                        take(depths[texel], colours[texel], -own.z);
                    }
                }
                if nearest > 0.0 {
                    sum.solid_angle_sr += omega;
                    sum.middle += direction * omega;
                    sum.light_lx = std::array::from_fn(|i| sum.light_lx[i] + colour[i] * omega);
                    sum.nearest_m = sum.nearest_m.min(1.0 / nearest);
                }
            }
        }
    }
    sum.middle = sum.middle.normalize_or_zero();
    sum
}

const SUN_M: f64 = 2e11;

/// Returns a sphere of radius 10 m in `direction`, with `size` = radius / distance; the sun is to the upper left behind the camera.
fn scene(direction: DVec3, size: f64, halvings: u32) -> (SceneObjects, DVec3, Sun, Body) {
    let radius_m = 10.0;
    let shapes = ShapeSet { shapes: vec![Shape { lods: vec![lod(halvings)], bound: 1.0 }], digest: 2 };
    let one_asteroid = instances(&[(DVec3::new(3.0, -4.0, 5.0), radius_m, 0)], 3);
    let field = field(one_asteroid, Arc::new(shapes));
    let place_m = field.position_m + field.orientation * DVec3::new(3.0, -4.0, 5.0);
    let camera_m = place_m - direction * (radius_m / size);
    let across = direction.any_orthonormal_vector();
    let sun = Sun {
        position_m: place_m + (across * 0.8 - direction * 0.6) * SUN_M,
        intensity_cd: [2e27, 3e27, 4e27],
        radius_m: 7e8,
        occluders: [].into(),
        reflectors: [].into(),
        year: 2000.0,
    };
    let body = Body {
        name: "sphere".to_owned(),
        ephemeris: None,
        position_m: place_m,
        radii_m: DVec3::splat(radius_m),
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law: field.law, geometric_albedo: field.geometric_albedo, phase_curve: None, texture: None },
        emission: None,
        seen_through: [1.0; 3],
    };
    (SceneObjects { fields: vec![field], ..SceneObjects::default() }, camera_m, sun, body)
}

/// Returns the same view with `factor` times as many pixels along each axis.
fn finer(kind: &ViewKind, factor: u32) -> ViewKind {
    let mut finer = kind.clone();
    match &mut finer {
        ViewKind::Perspective { size, .. } | ViewKind::Fisheye { size, .. } | ViewKind::Equirectangular { size } => {
            *size = size.map(|side| side * factor);
        }
        _ => unreachable!("tests have no other kinds"),
    }
    finer
}

/// Draws the sphere in one view, in tiles of `rows` rows. Returns the measured values, the true values, and the cube
/// faces used.
fn show(bench: &mut Bench, kind: &ViewKind, direction: DVec3, size: f64, rows: u32) -> (Measured, Measured, u8) {
    let (objects, camera_m, sun, body) = scene(direction, size, 5);
    let settings = AsteroidSettings { finest_only: true, samples: 4, ..AsteroidSettings::default() };
    let viewports = viewports(&[("view", kind.clone())], DQuat::IDENTITY);
    let plan = bench.plan_lit(&objects, &settings, &viewports, camera_m, std::slice::from_ref(&sun));
    let height = viewports[0].size()[1];
    let sampled = super::viewports(&[("view", finer(kind, plan.samples[0]))], DQuat::IDENTITY);
    let mapping = sampled[0].projection.mapping();
    let flat = matches!(kind, ViewKind::Perspective { .. });
    let mut found = Measured { solid_angle_sr: 0.0, middle: DVec3::ZERO, light_lx: [0.0; 3], nearest_m: f64::INFINITY };
    for first_row in (0..height).step_by(rows as usize) {
        let tile = Tile { viewport: 0, first_row, rows: rows.min(height - first_row), first_pixel: 0 };
        let layers = draw(bench, &plan, &tile);
        let part = measure(&layers, mapping, flat, &tile);
        found.middle += part.middle * part.solid_angle_sr;
        found.solid_angle_sr += part.solid_angle_sr;
        found.light_lx = std::array::from_fn(|i| found.light_lx[i] + part.light_lx[i]);
        found.nearest_m = found.nearest_m.min(part.nearest_m);
    }
    found.middle = found.middle.normalize_or_zero();
    let distance_m = 10.0 / size;
    let truth = Measured {
        solid_angle_sr: 2.0 * std::f64::consts::PI * (1.0 - (1.0 - size * size).sqrt()),
        middle: direction,
        light_lx: illuminance_of(&body, camera_m, &[sun], 0.0),
        nearest_m: distance_m - 10.0,
    };
    (found, truth, plan.cut.faces[0])
}

fn check(name: &str, (found, truth, _): (Measured, Measured, u8), angle_rad: f64) {
    println!("{name}: {found:?}, expected {truth:?}");
    let off = |a: f64, b: f64| (a / b - 1.0).abs();
    assert!(off(found.solid_angle_sr, truth.solid_angle_sr) < 0.01, "{name}: {found:?} {truth:?}");
    assert!(found.middle.angle_between(truth.middle) < angle_rad, "{name}: {found:?} {truth:?}");
    for i in 0..3 {
        assert!(off(found.light_lx[i], truth.light_lx[i]) < 0.015, "{name}: {found:?} {truth:?}");
    }
    assert!(off(found.nearest_m, truth.nearest_m) < 0.02, "{name}: {found:?} {truth:?}");
}

#[test]
fn a_sphere_has_the_right_solid_angle_and_light_in_every_picture() {
    let mut bench = Bench::new();
    let dome = |fov_rad| ViewKind::Fisheye { size: [200, 200], mapping: FisheyeMapping::Equidistant, fov_rad };
    let flat = ViewKind::Perspective { size: [240, 160], fov_y_rad: 1.4 };
    let sphere = ViewKind::Equirectangular { size: [360, 180] };
    let towards = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).normalize();
    // Columns: name, view, direction, size, whether it is drawn through faces, rows of a tile.
    let cases = [
        ("flat, in the middle", &flat, towards(0.02, 0.01, -1.0), 0.1, false, 160),
        ("flat, near a corner", &flat, towards(0.9, 0.5, -1.0), 0.1, false, 50),
        ("dome, in the middle", &dome(3.1), towards(0.02, 0.03, -1.0), 0.1, false, 200),
        ("dome, far out", &dome(3.1), towards(0.7, -0.9, -0.4), 0.1, false, 64),
        ("dome, large", &dome(3.1), towards(0.3, 0.4, -1.0), 0.6, true, 200),
        ("all round, behind", &dome(std::f64::consts::TAU), towards(0.01, 0.02, 1.0), 0.1, true, 200),
        ("equirectangular, in front", &sphere, towards(0.5, 0.4, -1.0), 0.1, false, 180),
        ("equirectangular, on the seam", &sphere, towards(0.004, 0.2, 1.0), 0.1, false, 180),
        ("equirectangular, on the pole", &sphere, towards(0.01, 1.0, 0.01), 0.15, true, 180),
        ("equirectangular, large", &sphere, towards(1.0, -0.3, 0.2), 0.6, true, 70),
    ];
    for (name, kind, direction, size, through_faces, rows) in cases {
        let measured = show(&mut bench, kind, direction, size, rows);
        assert_eq!(measured.2 != 0, through_faces, "{name}");
        check(name, measured, 2e-3);
    }
}

#[test]
#[should_panic(expected = "too small")]
fn a_wrong_size_is_detected() {
    let mut bench = Bench::new();
    let flat = ViewKind::Perspective { size: [240, 160], fov_y_rad: 1.4 };
    let (found, mut truth, faces) = show(&mut bench, &flat, DVec3::NEG_Z, 0.1, 160);
    truth.solid_angle_sr *= 1.02;
    check("too small", (found, truth, faces), 2e-3);
}

#[test]
fn cpu_lists_draw_the_same_picture() {
    let mut bench = Bench::new();
    let mut random = Random(3);
    let asteroids: Vec<(DVec3, f64, u32)> = (0..600)
        .map(|i| (random.direction() * 30.0 * 60.0_f64.powf(random.next()), 2.0 + 5.0 * random.next(), i % 2))
        .collect();
    let instances = instances(&asteroids, 9);
    let objects = SceneObjects { fields: vec![field(instances, shapes())], ..SceneObjects::default() };
    let kinds = kinds();
    let viewports = viewports(&kinds, DQuat::from_rotation_x(0.7));
    let camera_m = objects.fields[0].position_m;
    let settings = |culling| AsteroidSettings {
        culling,
        impostor: crate::plan::settings::ImpostorMethod::None,
        ..AsteroidSettings::default()
    };
    for viewport in 0..viewports.len() {
        let tile = Tile { viewport, first_row: 0, rows: viewports[viewport].size()[1], first_pixel: 0 };
        let [gpu, cpu] = [crate::plan::settings::Culling::Gpu, crate::plan::settings::Culling::Cpu].map(|culling| {
            let plan = bench.plan(&objects, &settings(culling), &viewports, camera_m);
            draw(&mut bench, &plan, &tile)
        });
        let drawn = gpu.depth.iter().filter(|depth| **depth > 0.0).count();
        let differing = gpu.colour.iter().zip(&cpu.colour).filter(|(a, b)| a != b).count();
        assert!(drawn > gpu.depth.len() / 200, "viewport {viewport}: {drawn} samples");
        assert!(differing * 500 <= drawn, "viewport {viewport}: {differing} of {drawn} differ");
        assert_eq!(gpu.faces.len(), cpu.faces.len().max(gpu.faces.len()), "the CPU draws only faces of the plan");
    }
}

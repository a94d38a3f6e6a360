//! Compares impostors on the adapter with their f64 twins and with the mesh: atlas, pictures, cache.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{
    atlas::{BakedImpostors, ImpostorAtlas, ImpostorAtlasError},
    probe::{GivenAsteroid, ImpostorProbe},
};
use crate::{
    gpu::{Gpu, GpuOptions},
    plan::asteroids::{
        AsteroidSettings,
        ImpostorMethod::{EulerAtlas, Octahedral, OctahedralBlend},
        tiles::{AtlasLayout, AtlasTile},
    },
    reference::asteroids::impostors::{
        Atlas, Picture, Sight, impostor_picture, mesh_picture, silhouette_iou, test_shape::bumpy,
    },
    render::asteroids::impostors::bake::{AtlasSize, Samples, TileBaker, bake},
    scene::{
        asteroids::{Shape, ShapeSet},
        bodies::ReflectionLaw,
    },
    view::{Rig, View, ViewKind, Viewport},
};

const TILE_PX: u32 = 32;
const TILES: u32 = 12;

fn gpu() -> Gpu {
    Gpu::open(&GpuOptions::default()).expect("tests need a Vulkan adapter; `make test` installs the software one")
}

/// Returns two shapes. The second has a uniform albedo, so that only its normals shade it.
fn shapes() -> ShapeSet {
    let mut plain = bumpy(0.25);
    plain.lods[0].mesh.albedos.fill(1.0);
    ShapeSet { shapes: vec![bumpy(0.1), plain], digest: 7 }
}

fn settings() -> AsteroidSettings {
    AsteroidSettings { tiles: TILES, tile_px: TILE_PX, ..AsteroidSettings::default() }
}

/// Returns the differences between an atlas and that of the twin. For coverage it is the mean over all texels; for normal, depth and albedo it is the
/// mean over the covered texels.
fn atlas_difference(shape: &Shape, layout: AtlasLayout, twin: &Atlas, albedo_scale: f32) -> [f64; 4] {
    let (mut coverage, mut normal, mut depth, mut albedo, mut covered) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let baker = TileBaker::new(shape, AtlasSize { layout, tiles: TILES, tile_px: TILE_PX }, albedo_scale);
    let mut samples = Samples::default();
    for tile in (0..TILES * TILES).map(|i| AtlasTile { column: i % TILES, row: i / TILES }) {
        for (i, found) in (0..).zip(baker.texels(&mut samples, tile)) {
            let expected = twin.texel(tile, i % TILE_PX, i / TILE_PX);
            coverage += (f64::from(found.normal[3]) - expected.coverage).abs();
            if expected.coverage > 0.9 && found.normal[3] > 0.9 {
                let [x, y, z, _] = found.normal.map(|part| 2.0 * f64::from(part) - 1.0);
                normal += (DVec3::new(x, y, z) - expected.normal).length();
                depth += (2.0 * f64::from(found.surface[1]) - 1.0 - expected.depth).abs();
                albedo += (f64::from(found.surface[0] * albedo_scale) - expected.albedo).abs();
                covered += 1.0;
            }
        }
    }
    [coverage / f64::from((TILES * TILE_PX).pow(2)), normal / covered, depth / covered, albedo / covered]
}

#[test]
fn baked_atlases_match_the_twin() {
    let shape = bumpy(0.25);
    for layout in [AtlasLayout::Octahedral, AtlasLayout::Euler] {
        let twin = Atlas::bake(&shape, layout, TILES, TILE_PX, 4);
        let [coverage, normal, depth, albedo] = atlas_difference(&shape, layout, &twin, 1.5);
        println!("{layout:?}: coverage {coverage:.2e}, normal {normal:.2e}, depth {depth:.2e}, albedo {albedo:.2e}");
        assert!(coverage < 1e-5 && normal < 1e-5 && depth < 1e-5 && albedo < 1e-5);
        // The atlas of another shape must differ, even with the same layout.
        let other = Atlas::bake(&bumpy(0.1), layout, TILES, TILE_PX, 4);
        let [coverage, normal, ..] = atlas_difference(&shape, layout, &other, 1.5);
        assert!(coverage > 0.01 && normal > 0.05, "{coverage} {normal}");
    }
    // The border of a tile stays empty.
    let level = bake(&shape, AtlasSize { layout: AtlasLayout::Octahedral, tiles: 2, tile_px: 8 }, 1.5);
    assert!(level.normals.chunks(4).any(|texel| texel[3] == 255));
    for i in (0..256).filter(|i| i % 8 == 0 || i % 8 == 7 || i / 16 % 8 == 0 || i / 16 % 8 == 7) {
        assert_eq!(level.normals[4 * i + 3], 0);
    }
}

/// Returns a viewport of `side` pixels and 20 degrees, and the half width of the same window in f64.
fn window(side: u32) -> (Viewport, f64) {
    let fov: f64 = 20.0_f64.to_radians();
    let kind = ViewKind::Perspective { size: [side, side], fov_y_rad: fov };
    let view = View::new("v", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    (Rig::new(vec![view]).unwrap().viewports(DQuat::IDENTITY).remove(0), (0.5 * fov).tan())
}

struct Drawn {
    /// Coverage drawn by the adapter.
    picture: Picture,
    luminance: Vec<f64>,
    distance: Vec<Option<f64>>,
    sight: Sight,
}

const SIDE: u32 = 192;
const RADIUS_M: f64 = 300.0;

fn draw(gpu: &Gpu, probe: &ImpostorProbe, view_from_shape: DMat3, centre: DVec3, sun: DVec3) -> Drawn {
    let (viewport, half_width) = window(SIDE);
    let asteroid = GivenAsteroid {
        centre_m: centre * RADIUS_M,
        radius_m: RADIUS_M,
        shape: 1,
        view_from_shape,
        sun,
        luminance_cd_m2: DVec3::splat(0.25),
        law: ReflectionLaw::Lambert,
    };
    let picture = probe.picture(gpu, &viewport, 1.0, &[asteroid]).unwrap();
    let sight = Sight { view_from_shape, centre, middle: DVec2::ZERO, half_width, side: SIDE as usize, samples: 1 };
    let coverage: Vec<f64> =
        picture.distance_m.iter().map(|distance| f64::from(u8::from(distance.is_some()))).collect();
    Drawn {
        picture: Picture { normals: vec![DVec3::ZERO; coverage.len()], coverage },
        luminance: picture.luminance_cd_m2.iter().map(|rgb| f64::from(rgb[1])).collect(),
        distance: picture.distance_m,
        sight,
    }
}

/// Returns orientations and centres of asteroids, in mean radii; some are near the border of the view.
fn poses() -> impl Iterator<Item = (DMat3, DVec3)> {
    (0..10).map(|i| {
        let i = f64::from(i);
        let turn = DQuat::from_rotation_y(1.3 * i) * DQuat::from_rotation_x(0.9 * i) * DQuat::from_rotation_z(0.4 * i);
        let centre = DVec3::new(2.2 * (2.0 * i).sin(), 2.2 * (3.0 * i).cos(), -30.0);
        (DMat3::from_quat(turn), centre)
    })
}

#[test]
fn pictures_on_the_adapter_match_the_twin() {
    let gpu = gpu();
    let shape = bumpy(0.25);
    let sun = DVec3::new(0.6, 0.3, 0.74).normalize();
    for method in [OctahedralBlend, Octahedral, EulerAtlas] {
        let probe = ImpostorProbe::new(&gpu, &shapes(), method, &settings()).unwrap().unwrap();
        let atlas = Atlas::bake(&shape, AtlasLayout::for_method(method).unwrap(), TILES, TILE_PX, 4);
        let (mut least, mut worst_light, mut least_mesh) = (1.0_f64, 0.0_f64, 1.0_f64);
        for (view_from_shape, centre) in poses() {
            let drawn = draw(&gpu, &probe, view_from_shape, centre, sun);
            let twin = impostor_picture(method, &atlas, &drawn.sight).unwrap();
            least = least.min(silhouette_iou(&drawn.picture, &twin));
            let iou = silhouette_iou(&drawn.picture, &mesh_picture(&shape.lods[0].mesh, &drawn.sight));
            least_mesh = least_mesh.min(iou);
            // Lambert's law: 1.5 cos i.
            let (mut error, mut sum) = (0.0, 0.0);
            for (index, normal) in twin.normals.iter().enumerate() {
                let expected = 0.25 * 1.5 * normal.dot(sun).max(0.0);
                if drawn.picture.coverage[index] > 0.0 && twin.coverage[index] > 0.0 {
                    error += drawn.luminance[index] - expected;
                    sum += expected;
                }
            }
            worst_light = worst_light.max((error / sum).abs());
        }
        println!(
            "{}: IoU with the twin {least:.4}, with the mesh {least_mesh:.4}; error of light {worst_light:.4}",
            method.name()
        );
        assert!(least > 0.99, "{} {least}", method.name());
        assert!(worst_light < 0.02, "{} {worst_light}", method.name());
        // Another orientation must differ.
        let (view_from_shape, centre) = poses().nth(3).unwrap();
        let drawn = draw(&gpu, &probe, view_from_shape, centre, sun);
        let turned = Sight { view_from_shape: DMat3::from_rotation_z(0.6) * view_from_shape, ..drawn.sight };
        let wrong = silhouette_iou(&drawn.picture, &impostor_picture(method, &atlas, &turned).unwrap());
        assert!(wrong < 0.97, "{} {wrong}", method.name());
    }
}

#[test]
fn coarse_mip_levels_keep_area_and_light_of_distant_asteroids() {
    let gpu = gpu();
    let shape = bumpy(0.25);
    let sun = DVec3::new(0.6, 0.3, 0.74).normalize();
    for method in [OctahedralBlend, Octahedral] {
        let probe = ImpostorProbe::new(&gpu, &shapes(), method, &settings()).unwrap().unwrap();
        // At these distances the asteroid is 23, 11 and 5 pixels across.
        for distance in [60.0, 120.0, 240.0] {
            let (mut area, mut true_area, mut light, mut true_light) = (0.0, 0.0, 0.0, 0.0);
            for (view_from_shape, centre) in poses() {
                let drawn = draw(&gpu, &probe, view_from_shape, centre * (distance / 30.0), sun);
                let truth = mesh_picture(&shape.lods[0].mesh, &Sight { samples: 4, ..drawn.sight });
                area += drawn.picture.coverage.iter().sum::<f64>();
                light += drawn.luminance.iter().sum::<f64>();
                true_area += truth.coverage.iter().sum::<f64>();
                // Normals that face away from the sun count as 0; they are few.
                true_light += truth.normals.iter().map(|n| 0.25 * 1.5 * n.dot(sun).max(0.0) / 16.0).sum::<f64>();
            }
            let [area, light] = [area / true_area, light / true_light];
            println!("{} at {distance} radii: area {area:.3}, light {light:.3} of the mesh's", method.name());
            assert!((area - 1.0).abs() < 0.06 && (light - 1.0).abs() < 0.06, "{} {distance}", method.name());
        }
    }
}

#[test]
fn depth_follows_the_surface() {
    let gpu = gpu();
    let shape = bumpy(0.25);
    // Directions of the tiles deviate by up to 20 degrees here.
    for (method, tolerance) in [(OctahedralBlend, 0.06), (Octahedral, 0.25)] {
        let probe = ImpostorProbe::new(&gpu, &shapes(), method, &settings()).unwrap().unwrap();
        for (view_from_shape, centre) in poses() {
            let drawn = draw(&gpu, &probe, view_from_shape, centre, DVec3::Z);
            let nearest = drawn.distance.iter().flatten().copied().fold(f64::INFINITY, f64::min) / RADIUS_M;
            // The nearest vertex of the mesh.
            let vertices = shape.lods[0].mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from)));
            let expected = vertices.map(|p| -(centre + view_from_shape * p).z).fold(f64::INFINITY, f64::min);
            assert!((nearest - expected).abs() < tolerance, "{}: {nearest}, expected {expected}", method.name());
            // A flat square would be at the distance of the centre.
            assert!((nearest + centre.z).abs() > 0.5);
        }
    }
}

#[test]
fn atlases_baked_ahead_are_taken_once_by_matching_requests() {
    let gpu = gpu();
    let settings = AsteroidSettings { tiles: 4, tile_px: 8, ..settings() };
    let ahead = BakedImpostors::new(&gpu);
    let sets = [shapes(), ShapeSet { digest: 8, ..shapes() }].map(Arc::new);
    ahead.bake(&sets, &settings).unwrap();
    let size = AtlasSize::from_method(settings.impostor.chosen(), &settings).unwrap();
    assert!(ahead.take(&ShapeSet { digest: 9, ..shapes() }, size).is_none(), "other shapes");
    assert!(ahead.take(&sets[0], AtlasSize { tiles: 8, ..size }).is_none(), "another size");
    let of_none = ahead.take(&sets[0], size).unwrap();
    assert!(of_none.textures.is_none() && of_none.waiting.len() == 2, "no frame was drawn");
    assert!(
        of_none.waiting.iter().flat_map(|(_, levels)| levels).any(|level| level.normals.iter().any(|byte| *byte > 0))
    );
    assert!(ahead.take(&sets[0], size).is_none(), "already taken");
    ahead.bake(&sets[..1], &settings).unwrap();
    assert!(ahead.take(&sets[1], size).is_none(), "an atlas that was not taken is dropped");
    // Each frame uploads one layer. If the device is lost, only atlases that have textures are lost.
    ahead.upload_one(&gpu);
    let partly = ahead.take(&sets[0], size).unwrap();
    assert!(partly.textures.is_some() && partly.waiting.len() == 1);
    ahead.bake(&sets, &settings).unwrap();
    ahead.upload_one(&gpu);
    ahead.forget_textures();
    assert_eq!(sets.iter().filter_map(|shapes| ahead.take(shapes, size)).count(), 1);
}

#[test]
fn baking_waits_for_the_uploads_of_frames() {
    let gpu = gpu();
    let settings = AsteroidSettings { tiles: 4, tile_px: 8, ..settings() };
    let ahead = BakedImpostors::new(&gpu);
    let sets = [shapes(), ShapeSet { digest: 8, ..shapes() }].map(Arc::new);
    let size = AtlasSize::from_method(settings.impostor.chosen(), &settings).unwrap();
    std::thread::scope(|scope| {
        let baking = scope.spawn(|| ahead.bake(&sets, &settings));
        while !baking.is_finished() {
            ahead.upload_one(&gpu);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        baking.join().unwrap().unwrap();
    });
    for shapes in &sets {
        let atlas = ahead.take(shapes, size).unwrap();
        assert!(atlas.textures.is_some() && atlas.waiting.is_empty(), "{} layers wait", atlas.waiting.len());
    }
}

#[test]
fn invalid_atlases_are_refused_with_the_limit() {
    let gpu = gpu();
    let make = |shapes: &ShapeSet, tiles, tile_px| {
        let settings = AsteroidSettings { tiles, tile_px, ..AsteroidSettings::default() };
        ImpostorAtlas::new(&gpu, &BakedImpostors::new(&gpu), shapes, Octahedral, &settings).map(|_| ())
    };
    let limit = gpu.max_view_side_px();
    let error = make(&shapes(), limit, 4).unwrap_err();
    assert!(
        matches!(error, ImpostorAtlasError::TooLarge { .. }) && error.to_string().contains(&limit.to_string()),
        "{error}"
    );
    assert!(matches!(make(&shapes(), 32, 3), Err(ImpostorAtlasError::TooSmall { .. })));
    assert!(matches!(make(&shapes(), 1, 32), Err(ImpostorAtlasError::TooSmall { .. })));
    assert!(matches!(make(&ShapeSet::default(), 32, 32), Err(ImpostorAtlasError::Shapes { .. })));
    let many = ShapeSet { shapes: vec![Shape::default(); 5000], digest: 0 };
    assert!(matches!(make(&many, 32, 32), Err(ImpostorAtlasError::Shapes { .. })));
}

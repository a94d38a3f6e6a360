#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::sync::Arc;

use glam::DQuat;

use super::*;
use crate::{
    scene::{
        asteroids::{
            FieldParameters, Instances, Lod, Node, PackedAsteroid, Placement, Shape, ShapeSet,
            packed::{Asteroid, RADIUS_PARTS},
        },
        bodies::ReflectionLaw,
    },
    view::projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective},
};

/// Returns the luminance of a white Lambert surface.
fn lambert(albedo: f64, cos_light: f64, _: f64) -> f64 {
    albedo * cos_light / PI
}

/// Returns an octahedron subdivided `times` times, with its vertices on the unit sphere.
fn sphere_mesh(times: u32) -> Mesh {
    let mut triangles: Vec<[DVec3; 3]> = (0..8)
        .map(|k| {
            let sign = |bit: u32| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let [x, y, z] = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
            if sign(0) * sign(1) * sign(2) > 0.0 { [x, y, z] } else { [x, z, y] }
        })
        .collect();
    for _ in 0..times {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| (p + q).normalize());
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let corners: Vec<[f32; 3]> = triangles.concat().iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh {
        albedos: vec![1.0; corners.len()],
        triangles: (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        normals: corners.clone(),
        positions: corners,
    }
}

fn sphere_set() -> ShapeSet {
    let lods = vec![Lod { mesh: sphere_mesh(5), ..Lod::default() }];
    ShapeSet { shapes: vec![Shape { lods, bound: 1.0 + 1e-6 }], digest: 1 }
}

/// Returns a field with one asteroid at a position, spinning about `axis`.
fn one_asteroid(shapes: ShapeSet, position_m: DVec3, radius_m: f64, axis: DVec3) -> AsteroidField {
    let offset_m = glam::Vec3::ZERO;
    let packed =
        PackedAsteroid::from(Asteroid { offset_m, radius_over_largest: 1.0, shape: 0, axis, phase: 0, rate: 16_384 });
    assert_eq!(packed.radius_and_shape, RADIUS_PARTS);
    let node = Node {
        middle_m: DVec3::ZERO,
        radius_m: radius_m * shapes.shapes[0].bound,
        centroid_m: DVec3::ZERO,
        area_m2: PI * radius_m * radius_m,
        largest_m: radius_m,
        smallest_m: radius_m,
        first: 0,
        count: 1,
    };
    let instances =
        Instances { packed: vec![packed], levels: vec![vec![node]], largest_m: radius_m, base_period_s: 65_536.0 };
    field(instances, shapes, position_m)
}

fn field(instances: Instances, shapes: ShapeSet, position_m: DVec3) -> AsteroidField {
    AsteroidField {
        name: "field".to_owned(),
        position_m,
        orientation: DQuat::IDENTITY,
        law: ReflectionLaw::Lambert,
        geometric_albedo: [0.1; 3],
        instances: Arc::new(instances),
        shapes: Arc::new(shapes),
    }
}

fn lit(field: &AsteroidField) -> LitField<'_> {
    LitField { field, time_s: 0.0, towards_sun: DVec3::Z, illuminance_lx: 1.0, shade: &lambert }
}

const RAYS: MeshSampling = MeshSampling { level: 0, rays_per_side: 4 };

/// Returns the relative errors of the covered solid angle and of the light, compared with the closed form for a sphere lit from behind the eye.
fn errors_of(mapping: &dyn PlaneMapping, direction: DVec3, set: ShapeSet) -> [f64; 2] {
    let (radius_m, distance_m) = (100.0, 900.0);
    let field = one_asteroid(set, direction.normalize() * distance_m, radius_m, DVec3::new(0.3, -0.5, 0.2));
    // Light from the direction of the eye makes the sphere symmetric about the line of sight.
    let lit = LitField { towards_sun: -direction.normalize(), ..lit(&field) };
    let image = render_meshes(mapping, Eye::default(), &[lit], RAYS);
    let covered = covered_solid_angle_sr(&image, mapping);
    let width = image.size[0] as usize;
    let light: f64 = (0..image.pixels.len())
        .map(|k| image.pixels[k].luminance * mapping.solid_angle_sr((k % width) as u32, (k / width) as u32))
        .sum();
    // For a point at angle theta from the axis, find the cosine between the normal and the axis. With s = sin(theta) D
    // / R, the sine of the angle at which the ray meets the surface, the normal is at asin(s) - theta from the axis.
    // Integrate its cosine over the solid angle of the disc.
    let steps = 20_000;
    let rim = (radius_m / distance_m).asin();
    let expected: f64 = (0..steps)
        .map(|k| {
            let theta = rim * (f64::from(k) + 0.5) / f64::from(steps);
            let cosine = ((theta.sin() * distance_m / radius_m).asin() - theta).cos();
            cosine / PI * 2.0 * PI * theta.sin() * rim / f64::from(steps)
        })
        .sum();
    [covered / sphere_solid_angle_sr(radius_m, distance_m) - 1.0, light / expected - 1.0]
}

fn agree(errors: [f64; 2]) -> bool {
    errors.iter().all(|error| error.abs() < 3e-3)
}

#[test]
fn a_sphere_has_its_solid_angle_and_light_in_every_projection() {
    let perspective = Perspective::symmetric([160, 120], 0.9).unwrap();
    let fisheye = Fisheye::new([300, 300], FisheyeMapping::Equidistant, 220f64.to_radians()).unwrap();
    let equirectangular = Equirectangular::new([512, 256]).unwrap();
    let face = CubeFace::new(Face::Front, 128).unwrap();
    let cases: [(&dyn PlaneMapping, DVec3); 8] = [
        (&perspective, -DVec3::Z),
        (&perspective, DVec3::new(0.33, 0.2, -1.0)),
        (&face, DVec3::new(-0.5, 0.6, -1.0)),
        (&fisheye, DVec3::new(1.0, 0.3, 0.1)),
        (&equirectangular, DVec3::new(1.0, 0.1, 0.4)),
        // The poles, and a direction behind the eye. There the sphere crosses the picture's edge.
        (&equirectangular, DVec3::new(0.02, 1.0, 0.01)),
        (&equirectangular, DVec3::new(0.05, -1.0, 0.03)),
        (&equirectangular, DVec3::new(0.01, 0.2, 1.0)),
    ];
    for (mapping, direction) in cases {
        let errors = errors_of(mapping, direction, sphere_set());
        println!("{direction}: solid angle {:.1e}, light {:.1e}", errors[0], errors[1]);
        assert!(agree(errors), "{direction}: {errors:?}");
    }
    // The test detects a mesh that is one per cent too small, and a mesh with tilted normals.
    let mut small = sphere_set();
    small.shapes[0].lods[0].mesh.positions.iter_mut().flatten().for_each(|x| *x *= 0.99);
    assert!(!agree(errors_of(&perspective, -DVec3::Z, small)));
    let mut leaning = sphere_set();
    leaning.shapes[0].lods[0].mesh.normals.iter_mut().for_each(|n| n[0] += 0.3);
    assert!(!agree(errors_of(&perspective, -DVec3::Z, leaning)));
}

#[test]
fn normals_and_distances_match_the_sphere() {
    let mapping = Perspective::symmetric([64, 64], 0.3).unwrap();
    let field = one_asteroid(sphere_set(), DVec3::new(0.0, 0.0, -1000.0), 100.0, DVec3::X);
    let one_ray = MeshSampling { rays_per_side: 1, ..RAYS };
    let image = render_meshes(&mapping, Eye::default(), &[lit(&field)], one_ray);
    let mut seen = 0;
    for y in 0..64 {
        for x in 0..64 {
            let pixel = image.pixels[y * 64 + x];
            let ray = mapping.direction_from_pixel(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap();
            let along = -1000.0 * ray.z;
            let across2 = 1e6 - along * along;
            if across2 > 99.0f64.powi(2) {
                assert!(across2 > 1e4 || pixel.coverage <= 1.0);
                assert!(across2 < 1e4 || pixel == MeshPixel::EMPTY);
                continue;
            }
            seen += 1;
            let distance_m = along - (1e4 - across2).sqrt();
            assert!((pixel.distance_m - distance_m).abs() < 1.0, "{} {distance_m}", pixel.distance_m);
            let normal = (ray * distance_m + DVec3::Z * 1000.0) / 100.0;
            assert!(angle_rad(pixel.normal, normal) < 0.03, "{} {normal}", pixel.normal);
            assert!((pixel.luminance - pixel.normal.z / PI).abs() < 1e-5);
        }
    }
    assert!(seen > 1000, "{seen}");
}

#[test]
fn nearer_asteroids_hide_farther_ones_and_spin_rotates_the_shape() {
    let mapping = Perspective::symmetric([48, 48], 0.4).unwrap();
    let near = one_asteroid(sphere_set(), DVec3::new(0.0, 0.0, -500.0), 20.0, DVec3::X);
    let far = one_asteroid(sphere_set(), DVec3::new(0.0, 0.0, -1000.0), 100.0, DVec3::X);
    let both = render_meshes(&mapping, Eye::default(), &[lit(&far), lit(&near)], RAYS);
    let swapped = render_meshes(&mapping, Eye::default(), &[lit(&near), lit(&far)], RAYS);
    assert_eq!(both, swapped);
    let middle = both.pixels[24 * 48 + 24];
    assert!((480.0..480.1).contains(&middle.distance_m) && middle.coverage == 1.0);
    let only_near = render_meshes(&mapping, Eye::default(), &[lit(&near)], RAYS);
    assert_eq!(only_near.pixels[24 * 48 + 24], middle);

    // A long shape that spins around the line of sight: a quarter period later, its picture is rotated by a quarter
    // turn.
    let set = ShapeSet { shapes: vec![ShapeSet::procedural(3).shapes.swap_remove(4)], digest: 0 };
    let long = one_asteroid(set, DVec3::new(0.0, 0.0, -1000.0), 60.0, DVec3::Z);
    let rendered = |time_s: f64| render_meshes(&mapping, Eye::default(), &[LitField { time_s, ..lit(&long) }], RAYS);
    let (before, after) = (rendered(0.0), rendered(1.0));
    let mut covered = 0.0;
    for y in 0..48 {
        for x in 0..48 {
            // The point (x, y), right and up, maps to (-y, x); rows run down.
            let turned = after.pixels[(47 - x) * 48 + y].coverage;
            let coverage = before.pixels[y * 48 + x].coverage;
            covered += coverage;
            assert!((coverage - turned).abs() < 0.13, "{x} {y}: {coverage} {turned}");
        }
    }
    assert!(covered > 100.0);
    let same = |a: &MeshImage, b: &MeshImage| {
        a.pixels.iter().zip(&b.pixels).all(|(a, b)| (a.coverage - b.coverage).abs() < 0.13)
    };
    assert!(!same(&before, &after));
    assert!(same(&before, &rendered(4.0)));
}

#[test]
fn fields_look_the_same_far_from_the_origin() {
    let shapes = ShapeSet::procedural(1);
    let placement = Placement::Box { size_m: DVec3::splat(2e5) };
    let drawn = FieldParameters {
        instances: 3000,
        seed: 2,
        placement,
        radius_m: [500.0, 5000.0],
        size_index: 1.0,
        spin_period_s: [1e4, 1e5],
    };
    let instances = Instances::place(&drawn, shapes.shapes.len(), &shapes.bounds()).unwrap();
    let mapping = Perspective::symmetric([64, 48], 0.8).unwrap();
    let eye_m = DVec3::new(0.0, 1e4, 3e5);
    let render = |position_m: DVec3, orientation: DQuat| {
        let field = AsteroidField { orientation, ..field(instances.clone(), shapes.clone(), position_m) };
        let eye = Eye { position_m: position_m + orientation * eye_m, world_from_view: orientation, ..Eye::default() };
        let lit = LitField { time_s: 12_345.0, towards_sun: orientation * DVec3::Z, ..lit(&field) };
        render_meshes(&mapping, eye, &[lit], MeshSampling { level: 2, rays_per_side: 2 })
    };
    let here = render(DVec3::ZERO, DQuat::IDENTITY);
    let coverage = here.pixels.iter().map(|pixel| pixel.coverage).sum::<f64>() / here.pixels.len() as f64;
    assert!((0.1..0.95).contains(&coverage), "{coverage}");
    // f64 represents these positions exactly, so all bits are equal.
    assert_eq!(here, render(DVec3::new(1e13, -2e13, 4e12), DQuat::IDENTITY));
    // The field and the eye rotated together look the same, except for rounding at edges.
    let turned = render(DVec3::ZERO, DQuat::from_euler(glam::EulerRot::ZYX, 0.4, 1.1, -2.0));
    let differing = here.pixels.iter().zip(&turned.pixels).filter(|(a, b)| (a.coverage - b.coverage).abs() > 1e-9);
    assert!(differing.count() <= 3);
}

#[test]
fn the_tree_and_cones_find_all_instances() {
    let shapes = sphere_set();
    let drawn = FieldParameters {
        instances: 700,
        seed: 9,
        placement: Placement::Ring { inner_m: 3e4, outer_m: 9e4, thickness_m: 3e4 },
        radius_m: [300.0, 3000.0],
        size_index: 0.5,
        spin_period_s: [1e4, 1e5],
    };
    let instances = Instances::place(&drawn, 1, &shapes.bounds()).unwrap();
    let spheres: Vec<(DVec3, f64)> = (0..instances.packed.len())
        .map(|k| (instances.place_m(k).unwrap(), instances.packed[k].radius_m(instances.largest_m)))
        .collect();
    let mapping = Equirectangular::new([128, 64]).unwrap();
    let eye_m = DVec3::new(5e3, 6e4, 1e3);
    let eye = Eye { position_m: eye_m, ..Eye::default() };
    let field = field(instances, shapes, DVec3::ZERO);
    let image = render_meshes(&mapping, eye, &[lit(&field)], MeshSampling { level: 0, rays_per_side: 1 });
    let (mut hits, mut differing) = (0, 0);
    for y in 0..64 {
        for x in 0..128 {
            let ray = mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap();
            let nearest = spheres.iter().filter_map(|(place, radius)| {
                let middle = *place - eye_m;
                let along = middle.dot(ray);
                let inside = radius * radius - (middle.length_squared() - along * along);
                (inside > 0.0 && along > inside.sqrt()).then(|| along - inside.sqrt())
            });
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            let pixel = image.pixels[(y * 128 + x) as usize];
            hits += u32::from(nearest.is_finite());
            let near = pixel.distance_m == nearest || (pixel.distance_m - nearest).abs() < 30.0;
            differing += u32::from(!near);
        }
    }
    // Rims of the meshes lie slightly inside of those of the spheres.
    assert!(hits > 1000 && differing < hits / 100, "{differing} of {hits}");
}

//! Compares the solid angles of pixels, computed in f64 and on the adapter, with an independent table, with each other, and with closed forms.

use std::{f64::consts::PI, sync::LazyLock};

use crate::common::figures;
use glam::{DVec2, DVec3};
use steradian::{
    gpu::{Gpu, GpuOptions},
    render::probe::{Probe, probe},
    verify::solid_angle::{self, sample_pixels, viewport},
    view::projection::{
        CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping, Projection,
    },
};

/// Device that all tests in this file share.
static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&GpuOptions::default()).unwrap());

/// Returns the projection for a row of the reference table.
fn projection_of(name: &str, size: [u32; 2], parameters: &str) -> Projection {
    let values: Vec<(&str, f64)> = parameters
        .split(';')
        .filter_map(|pair| pair.split_once('='))
        .map(|(key, value)| (key, value.parse::<f64>().expect("a number").to_radians()))
        .collect();
    let get = |key: &str| values.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
    let fisheye = |mapping| {
        Projection::Fisheye(Fisheye::new(size, mapping, get("fov_deg").expect("fov_deg")).expect("a valid fisheye"))
    };
    match name {
        "perspective" => Projection::Perspective(match get("fov_y_deg") {
            Some(fov_y_rad) => Perspective::symmetric(size, fov_y_rad).expect("a valid view"),
            None => {
                let edge = |key: &str| get(key).expect("four angles");
                Perspective::off_axis(size, edge("left_deg"), edge("right_deg"), edge("up_deg"), edge("down_deg"))
                    .expect("a valid view")
            }
        }),
        "cube_face" => Projection::CubeFace(CubeFace::new(Face::Front, size[0]).expect("a valid face")),
        "equirectangular" => Projection::Equirectangular(Equirectangular::new(size).expect("a valid size")),
        "fisheye_equidistant" => fisheye(FisheyeMapping::Equidistant),
        "fisheye_equisolid" => fisheye(FisheyeMapping::Equisolid),
        "fisheye_orthographic" => fisheye(FisheyeMapping::Orthographic),
        "fisheye_stereographic" => fisheye(FisheyeMapping::Stereographic),
        other => panic!("unknown projection {other} in the reference table"),
    }
}

struct Reference {
    projection: Projection,
    name: String,
    pixel: [u32; 2],
    solid_angle_sr: f64,
}

fn references() -> Vec<Reference> {
    let table = include_str!("../data/solid_angle.csv");
    let rows: Vec<Reference> = table
        .lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            let number = |i: usize| fields[i].parse::<u32>().expect("a whole number");
            Reference {
                projection: projection_of(fields[0], [number(1), number(2)], fields[3]),
                name: format!("{} {} {}", fields[0], fields[1], fields[3]),
                pixel: [number(4), number(5)],
                solid_angle_sr: fields[6].parse().expect("a number"),
            }
        })
        .collect();
    assert_eq!(rows.len(), 128);
    rows
}

/// Limit for the difference between f64 and the table. The worst difference is 3.1e-9, because the table has a limited number of digits.
const F64_LIMIT: f64 = 1.3e-8;

#[test]
fn f64_agrees_with_the_reference_table() {
    let mut worst = (0.0, String::new());
    for row in references() {
        let [x, y] = row.pixel;
        let error = (row.projection.mapping().solid_angle_sr(x, y) / row.solid_angle_sr - 1.0).abs();
        assert!(error <= F64_LIMIT, "{} pixel {x}, {y}: relative error {error:.1e}", row.name);
        if error > worst.0 {
            worst = (error, row.name);
        }
    }
    println!("f64 against the table: worst relative error {:.1e} ({})", worst.0, worst.1);
}

#[test]
fn a_wrong_solid_angle_fails_the_comparison() {
    // The central pixel of a flat view, and a fisheye with a wrong field of view, must not match the table.
    let rows = references();
    let flat = rows.iter().filter(|row| row.name.starts_with("perspective"));
    assert!(flat.clone().any(|row| {
        let centre = row.projection.mapping().size().map(|side| side / 2);
        let constant = row.projection.mapping().solid_angle_sr(centre[0], centre[1]);
        (constant / row.solid_angle_sr - 1.0).abs() > figures::SOLID_ANGLE_TABLE.bound
    }));
    let wrong = Fisheye::new([1024, 1024], FisheyeMapping::Equidistant, 181f64.to_radians()).unwrap();
    let row = rows.iter().find(|row| row.name == "fisheye_equidistant 1024 fov_deg=180").unwrap();
    let error = (wrong.solid_angle_sr(row.pixel[0], row.pixel[1]) / row.solid_angle_sr - 1.0).abs();
    assert!(error > figures::SOLID_ANGLE_TABLE.bound);
}

#[test]
fn the_adapter_agrees_with_the_reference_table() {
    let mut worst = figures::SOLID_ANGLE_TABLE.worst();
    for row in references() {
        let probes = [Probe { direction: DVec3::NEG_Z, pixel: row.pixel }];
        let probed = probe(&GPU, &viewport(row.projection.clone()), &probes).unwrap()[0];
        let error = f64::from(probed.solid_angle_sr) / row.solid_angle_sr - 1.0;
        worst.add(error, format_args!("{} pixel {:?}", row.name, row.pixel));
    }
    worst.print();
}

fn all_projections(size: u32) -> Vec<(String, Projection)> {
    solid_angle::all_projections(size).expect("valid sizes")
}

/// At 16384 pixels per side, f32 has hardly more digits than needed.
#[test]
fn the_adapter_agrees_with_f64_at_16k_and_at_256() {
    let mut worst_at_16k = figures::SOLID_ANGLE_16K.worst();
    for size in [256, 16_384] {
        for (name, projection) in all_projections(size) {
            let mapping = projection.mapping();
            let pixels = sample_pixels(mapping);
            let probes: Vec<Probe> = pixels.iter().map(|&pixel| Probe { direction: DVec3::NEG_Z, pixel }).collect();
            let probed = probe(&GPU, &viewport(projection.clone()), &probes).unwrap();
            let (mut worst, mut worst_direction) = (0.0_f64, 0.0_f64);
            for (pixel, probed) in pixels.iter().zip(&probed) {
                let [x, y] = *pixel;
                let exact = mapping.solid_angle_sr(x, y);
                if exact == 0.0 {
                    assert_eq!(probed.solid_angle_sr, 0.0, "{name} {size}: {pixel:?} is outside of the picture");
                    continue;
                }
                let error = (f64::from(probed.solid_angle_sr) / exact - 1.0).abs();
                if size == 256 {
                    assert!(error <= 2.4e-6, "{name} at {pixel:?}: {} for {exact}: {error:.1e}", probed.solid_angle_sr);
                } else {
                    worst_at_16k.add(error, format_args!("{name} at {pixel:?}: {}", probed.solid_angle_sr));
                }
                worst = worst.max(error);
                let centre = mapping.direction_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                if let (Some(a), Some(b)) = (centre, probed.direction) {
                    worst_direction = worst_direction.max((a - DVec3::from_array(b.map(f64::from))).length());
                }
            }
            println!("{name} {size}: solid angle {worst:.1e}, direction {worst_direction:.1e} rad");
            // At the antipode of the equisolid full sphere and at the orthographic rim, pixels are about a hundred times as high as in the centre,
            // and the precision of f32 limits the accuracy of their radius accordingly.
            let stretched = name == "equisolid 360" || name == "orthographic 180";
            let limit = if stretched { 1e-5 } else { 1.4e-6 };
            assert!(worst_direction < limit, "{name} {size}: direction {worst_direction}");
        }
    }
    worst_at_16k.print();
}

#[test]
fn directions_map_to_the_same_pixel_on_the_adapter_and_in_f64() {
    for (name, projection) in all_projections(4096) {
        let mapping = projection.mapping();
        let probes: Vec<Probe> = crate::common::spiral(4000)
            .map(|direction| Probe { direction: direction.as_vec3().as_dvec3(), pixel: [0, 0] })
            .collect();
        let probed = probe(&GPU, &viewport(projection.clone()), &probes).unwrap();
        let mut worst = 0.0_f64;
        let mut compared = 0;
        for (input, output) in probes.iter().zip(&probed) {
            let Some(exact) = mapping.pixel_from_direction(input.direction) else { continue };
            let size = mapping.size().map(f64::from);
            if exact.x < -2.0 || exact.y < -2.0 || exact.x > size[0] + 2.0 || exact.y > size[1] + 2.0 {
                continue;
            }
            let image = output.image.unwrap_or_else(|| panic!("{name}: no image of {}", input.direction));
            worst = worst.max((exact - DVec2::new(f64::from(image[0]), f64::from(image[1]))).length());
            compared += 1;
        }
        println!("{name}: {compared} directions, worst {worst:.1e} px");
        assert!(worst < 2.3e-3, "{name}: {worst} px");
        assert!(compared > 0);
    }
}

#[test]
fn pixels_sum_to_the_closed_form() {
    for (name, projection) in all_projections(1024) {
        let mapping = projection.mapping();
        let [width, height] = mapping.size();
        let sum: f64 = (0..height).map(|y| (0..width).map(|x| mapping.solid_angle_sr(x, y)).sum::<f64>()).sum();
        let error = (sum / projection.picture_solid_angle_sr() - 1.0).abs();
        println!("{name}: relative error of the sum over pixels {error:.1e}");
        // The area of a circle 1024 pixels wide differs from the total area of its pixels by up to 5e-5. At the orthographic rim this has a larger
        // effect.
        let limit = match &projection {
            Projection::Fisheye(f) if f.mapping == FisheyeMapping::Orthographic => 1e-3,
            Projection::Fisheye(_) => 1e-4,
            _ => 3e-14,
        };
        assert!(error < limit, "{name}: {error}");
    }
}

/// Compare fisheyes with 4096 pixels in the same way.
#[test]
fn pixels_of_fisheyes_sum_to_the_closed_form_at_4k() {
    for (name, projection, limit) in [
        ("equidistant 180", Fisheye::new([4096; 2], FisheyeMapping::Equidistant, PI), 1e-6),
        ("equidistant 360", Fisheye::new([4096; 2], FisheyeMapping::Equidistant, 2.0 * PI), 1e-6),
        ("equisolid 220", Fisheye::new([4096; 2], FisheyeMapping::Equisolid, 220f64.to_radians()), 1e-6),
        ("stereographic 180", Fisheye::new([4096; 2], FisheyeMapping::Stereographic, PI), 1e-6),
        ("orthographic 180", Fisheye::new([4096; 2], FisheyeMapping::Orthographic, PI), 1e-3),
    ] {
        let fisheye = projection.unwrap();
        // One quadrant is enough, because the picture is symmetric.
        let sum: f64 = (0..2048).map(|y| (0..2048).map(|x| fisheye.solid_angle_sr(x, y)).sum::<f64>()).sum();
        let error = (4.0 * sum / Projection::Fisheye(fisheye).picture_solid_angle_sr() - 1.0).abs();
        println!("{name} at 4096: {error:.1e}");
        assert!(error < limit, "{name}: {error}");
    }
}

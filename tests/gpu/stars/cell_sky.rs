//! The procedural sky on the adapter: the shader is valid and agrees with the f64 reference.

use crate::common::*;
use glam::{DQuat, DVec3};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use steradian::{
    plan::PlanError,
    plan::settings::{CellSkySettings, ExposureSettings, StarMethod},
    reference::stars::cell_sky,
    render::{FrameRequest, RenderError, Shader},
    scene::{Camera, SceneSnapshot},
    view::{
        Rig, View, ViewKind,
        projection::{FisheyeMapping, Projection, pixel_centre},
    },
};
use wgpu::util::DeviceExt;

/// Entry point that calls the function: directions in, brightness out.
const ENTRY: &str = "
struct Parameters { pixel_rad: f32, radius_px: f32, cells: u32, layers: u32, seed: u32 }
@group(0) @binding(0) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> results: array<vec4<f32>>;
@group(0) @binding(2) var<uniform> parameters: Parameters;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&directions) {
        let p = parameters;
        let rgb = cell_sky_brightness(directions[id.x].xyz, p.pixel_rad, p.cells, p.layers, p.radius_px, p.seed);
        results[id.x] = vec4<f32>(rgb, 1.0);
    }
}
";

/// The shader of the sky with its imports.
fn sky() -> String {
    Shader::new("stars/cell_sky").text().unwrap()
}

fn source() -> String {
    sky() + ENTRY
}

fn validate(text: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|error| error.emit_to_string(text))?;
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|error| format!("{error:?}"))?;
    Ok(module)
}

#[test]
fn the_shader_is_valid_and_has_no_entry_point_or_binding() {
    validate(&source()).unwrap();
    let alone = validate(&sky()).unwrap();
    assert_eq!((alone.entry_points.len(), alone.global_variables.len()), (0, 0));
    assert!(validate(&source().replace("pixel_rad, p.cells", "p.cells, pixel_rad")).is_err());
}

fn on_the_adapter(directions: &[DVec3], pixel_rad: f64, settings: &CellSkySettings) -> Vec<[f32; 4]> {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
        .expect("tests need a Vulkan adapter; `make test` installs the software one");
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("cell sky test"),
        source: wgpu::ShaderSource::Wgsl(source().into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("cell sky test"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let inputs: Vec<[f32; 4]> = directions.iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect();
    let floats = |value: f64| (value as f32).to_bits();
    let CellSkySettings { cells, layers, radius_px, seed } = *settings;
    let parameters = [floats(pixel_rad), floats(radius_px), cells, layers, seed, 0, 0, 0];
    let buffer = |label, contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
    };
    let input = buffer("directions", bytemuck::cast_slice(&inputs), wgpu::BufferUsages::STORAGE);
    let parameters = buffer("parameters", bytemuck::cast_slice(&parameters), wgpu::BufferUsages::UNIFORM);
    let bytes = size_of_val(inputs.as_slice()) as u64;
    let buffer_of = |label, usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage,
            mapped_at_creation: false,
        })
    };
    let output = buffer_of("results", wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let readback = buffer_of("readback", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("cell sky test"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[(0, &input), (1, &output), (2, &parameters)]
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }),
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("cell sky test") });
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups((inputs.len() as u32).div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&output, 0, &readback, 0, bytes);
    queue.submit([encoder.finish()]);
    readback.slice(..).map_async(wgpu::MapMode::Read, |result| result.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let view = readback.slice(..).get_mapped_range().unwrap();
    bytemuck::cast_slice(&view).to_vec()
}

/// Returns the share of the directions in which the two renderers differ by more than `limit` in any channel.
fn share_that_differs(
    found: &[[f32; 4]],
    directions: &[DVec3],
    pixel_rad: f64,
    settings: &CellSkySettings,
    limit: f64,
) -> f64 {
    let wrong = found.iter().zip(directions).filter(|(found, direction)| {
        let expected = cell_sky::brightness(direction.as_vec3().as_dvec3(), pixel_rad, settings);
        (0..3).any(|c| found[c].is_nan() || (f64::from(found[c]) - expected[c]).abs() > limit)
    });
    wrong.count() as f64 / directions.len() as f64
}

#[test]
fn the_shader_equals_its_reference() {
    // Wide stars in coarse cells, so that most directions have some light.
    let settings = CellSkySettings { cells: 40, layers: 3, radius_px: 2.0, seed: 7 };
    let pixel_rad = 0.006;
    let directions: Vec<DVec3> = (0..60_000)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 60_000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        })
        .collect();
    let found = on_the_adapter(&directions, pixel_rad, &settings);
    let lit = found.iter().filter(|rgb| rgb[1] > 0.0).count() as f64 / found.len() as f64;
    // In f32 a direction near the border of a cell, or a cell near the density threshold, can fall on the other side.
    let differing = share_that_differs(&found, &directions, pixel_rad, &settings, 2e-4);
    println!("{:.1} % of the directions have light, {differing:.1e} of all directions disagree", 100.0 * lit);
    assert!(lit > 0.2, "{lit}");
    assert!(differing < 1e-3, "{differing}");
    for wrong in [
        CellSkySettings { seed: 8, ..settings },
        CellSkySettings { layers: 2, ..settings },
        CellSkySettings { cells: 41, ..settings },
        CellSkySettings { radius_px: 1.9, ..settings },
    ] {
        assert!(share_that_differs(&found, &directions, pixel_rad, &wrong, 2e-4) > 0.05, "{wrong:?}");
    }
}

const EV100: f64 = -3.0;

/// Returns the picture in f64, cd/m^2.
fn picture(projection: &Projection, world_from_view: DQuat, settings: &CellSkySettings) -> Vec<[f64; 3]> {
    let mapping = projection.mapping();
    let [width, height] = mapping.size();
    let middle = (width / 2, height / 2);
    let pixel_rad = mapping.solid_angle_sr(middle.0, middle.1).sqrt();
    let white_cd_m2 = 1.2 * EV100.exp2();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel_centre(x, y)));
    pixels
        .map(|at| {
            let direction = mapping.direction_from_pixel(at).map(|direction| world_from_view * direction);
            direction.map_or([0.0; 3], |direction| {
                cell_sky::brightness(direction, pixel_rad, settings).map(|channel| channel * white_cd_m2)
            })
        })
        .collect()
}

/// Returns the sum of the absolute differences divided by the sum of the expected light.
fn difference(found: &[[f32; 4]], expected: &[[f64; 3]]) -> f64 {
    let total: f64 = expected.iter().flatten().sum();
    let error =
        |found: &[f32; 4], expected: &[f64; 3]| (0..3).map(|c| (f64::from(found[c]) - expected[c]).abs()).sum::<f64>();
    found.iter().zip(expected).map(|(found, expected)| error(found, expected)).sum::<f64>() / total
}

#[test]
fn the_procedural_sky_equals_the_reference_in_every_projection() {
    let mut renderer = renderer();
    // Use a rotated camera, and a view that is rotated relative to the camera.
    let world_from_camera = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.4);
    let camera_from_view = DQuat::from_rotation_z(0.3) * DQuat::from_rotation_y(1.9);
    let kinds = [
        ("flat", ViewKind::Perspective { size: [150, 100], fov_y_rad: 1.2 }),
        ("lens", ViewKind::Fisheye { size: [110, 110], mapping: FisheyeMapping::Equidistant, fov_rad: 3.4 }),
        ("dome", ViewKind::Fisheye { size: [101, 90], mapping: FisheyeMapping::Stereographic, fov_rad: 2.8 }),
        ("all", ViewKind::Equirectangular { size: [160, 80] }),
    ];
    let views = kinds.map(|(name, kind)| View::new(name, kind, camera_from_view, DVec3::ZERO).unwrap());
    let rig = Rig::new(views.into()).unwrap();
    let camera = Camera { world_from_camera, ..Camera::default() };
    // A star of the catalogue must not appear.
    let scene = SceneSnapshot { camera, ..snapshot(vec![star(DVec3::NEG_Z, -5.0)]) };
    let mut settings = settings(StarMethod::CellSky);
    settings.exposure = ExposureSettings::manual(EV100);
    let sky = CellSkySettings { cells: 24, layers: 5, radius_px: 1.0, seed: 3 };
    settings.stars.cell_sky = sky;
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
    assert!(frame.views.iter().all(|view| view.stars_drawn == 0));
    assert_eq!(frame.plan.accumulator, "none: every pixel individually");
    assert!(frame.plan.stars.contains("no star of the catalogue") && frame.plan.certificate.is_empty());
    let world_from_view = world_from_camera * camera_from_view;
    for (view, image) in rig.views().iter().zip(&frame.images) {
        let projection = &view.images[0].projection;
        let found = image.hdr.as_ref().unwrap();
        let difference_from =
            |settings: &CellSkySettings| difference(found, &picture(projection, world_from_view, settings));
        let lit = found.iter().filter(|pixel| pixel[1] > 0.0).count() as f64 / found.len() as f64;
        println!("{}: {:.1} % of the pixels lit, difference {:.1e}", view.name, 100.0 * lit, difference_from(&sky));
        assert!(lit > 0.05, "{}", view.name);
        assert!(difference_from(&sky) < 3e-5, "{}", view.name);
        for wrong in [
            CellSkySettings { seed: 4, ..sky },
            CellSkySettings { layers: 4, ..sky },
            CellSkySettings { cells: 25, ..sky },
            CellSkySettings { radius_px: 0.95, ..sky },
        ] {
            assert!(difference_from(&wrong) > 1e-2, "{} {wrong:?}", view.name);
        }
        assert!(difference(found, &picture(projection, world_from_camera, &sky)) > 0.5, "{}", view.name);
    }
}

#[test]
fn the_sky_in_strips_is_identical_and_a_moving_camera_is_refused() {
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [160, 120], fov_y_rad: 1.2 })]);
    let scene = snapshot(vec![]);
    let settings = settings(StarMethod::CellSky);
    let whole = render_hdr(&mut renderer(), &scene, &rig, &settings);
    let options = steradian::gpu::GpuOptions { binding_limit_bytes: Some(160 * 16 * 25), ..Default::default() };
    let mut strips = renderer_with(&options);
    let found = render_hdr(&mut strips, &scene, &rig, &settings);
    assert!(found.images[0].hdr == whole.images[0].hdr);
    assert_eq!(found.exposure_ev100, whole.exposure_ev100);
    assert!(whole.mean_luminance_cd_m2 > 0.0);
    let camera = Camera { velocity_c: DVec3::X * 0.5, ..Camera::default() };
    let moving = SceneSnapshot { camera, ..scene };
    let error = strips.render(FrameRequest::new(&moving, &rig).settings(&settings)).unwrap_err();
    assert!(matches!(error, RenderError::Plan(PlanError::AtRestOnly("cell_sky"))), "{error}");
}

//! The procedural sky on the adapter: the shader is valid, and says what its twin in f64 says.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use glam::DVec3;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use steradian::{plan::settings::CellSkySettings, reference::cell_sky};
use wgpu::util::DeviceExt;

const MATH: &str = include_str!("../shaders/shared/math.wgsl");
const CELL_SKY: &str = include_str!("../shaders/cell_sky.wgsl");
/// An entry point about the function: directions in, brightness out.
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

fn source() -> String {
    [MATH, CELL_SKY, ENTRY].concat()
}

fn validate(text: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|error| error.emit_to_string(text))?;
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|error| format!("{error:?}"))?;
    Ok(module)
}

#[test]
fn the_shader_is_valid_and_brings_no_entry_point_or_binding() {
    validate(&source()).unwrap();
    let alone = validate(&[MATH, CELL_SKY].concat()).unwrap();
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

/// Share of the directions in which the two differ by more than `limit` in a channel.
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
fn the_shader_says_what_its_twin_says() {
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
    // A cell's border or the density's threshold may fall on the other side in f32.
    let differ = share_that_differs(&found, &directions, pixel_rad, &settings, 2e-4);
    println!("{:.1} % of the directions have light, {differ:.1e} of them all differ", 100.0 * lit);
    assert!(lit > 0.2, "{lit}");
    assert!(differ < 1e-3, "{differ}");
    for wrong in [
        CellSkySettings { seed: 8, ..settings },
        CellSkySettings { layers: 2, ..settings },
        CellSkySettings { cells: 41, ..settings },
        CellSkySettings { radius_px: 1.9, ..settings },
    ] {
        assert!(share_that_differs(&found, &directions, pixel_rad, &wrong, 2e-4) > 0.05, "{wrong:?}");
    }
}

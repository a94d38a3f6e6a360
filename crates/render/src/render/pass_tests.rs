//! Tests the exposure and tone-mapping passes alone on the adapter, with synthetic input, against their f64 twins.

use bytemuck::Pod;
use glam::{DQuat, DVec3};

use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::plan::tiles::MAX_TILES;
use crate::{
    gpu::{Gpu, GpuOptions, ReadbackBuffer, storage_buffer, uniform_list},
    photometry::exposure::{mean_luminance_cd_m2, metered_ev100},
    plan::{
        KernelPlan, MeteringPlan,
        budget::SHORT_CODES_ERROR,
        settings::{ExposureSettings, ExposureValues, Metering, ToneMapOperator, ToneMapSettings},
        tiles::Tile,
    },
    render::{
        display::{
            exposure::{ExposureInputs, ExposurePass},
            tone_map::ToneMapPass,
        },
        layout,
        stars::luminance::{LuminanceInputs, LuminancePass, LuminanceSource},
        targets::{PARTIAL_SUM_BYTES, PictureTarget, partial_sums, pixel_grid},
        viewport::encode_viewport,
    },
    view::{Rig, View, ViewKind, Viewport},
};

fn gpu() -> Gpu {
    Gpu::open(&GpuOptions::default()).expect("tests need a Vulkan adapter; `make test` installs the software one")
}

fn buffer_for_results(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some("results"),
        size: bytes.next_multiple_of(16),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// Runs the recorded commands and reads `count` values of `results`.
fn run<T: Pod>(
    gpu: &Gpu,
    results: &wgpu::Buffer,
    count: usize,
    record: impl FnOnce(&mut wgpu::ComputePass<'_>),
) -> Vec<T> {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
    let mut readback = ReadbackBuffer::new("readback");
    let bytes = (count * size_of::<T>()) as u64;
    readback.begin(bytes);
    let place = readback.copy(gpu, &mut encoder, results, 0, bytes);
    gpu.queue.submit([encoder.finish()]);
    readback.map(gpu);
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let values = readback.read(gpu, place, count).unwrap();
    readback.unmap(gpu);
    gpu.take_failure().unwrap();
    values
}

/// Runs the exposure pass on partial sums. Each is metered illuminance, and solid angle excluded from metering.
fn exposure_of(gpu: &Gpu, settings: &ExposureSettings, known: Option<f64>, partials: &[[f32; 2]]) -> layout::Exposure {
    let pass = ExposurePass::new();
    let found = buffer_for_results(gpu, size_of::<layout::Exposure>() as u64);
    let sums = storage_buffer(gpu, "partial sums", partials);
    run(gpu, &found, 1, |encoder| {
        let inputs = ExposureInputs {
            metering: &MeteringPlan::new(settings),
            known_ev100: known,
            total_solid_angle_sr: 12.5,
            partial_count: partials.len() as u32,
        };
        pass.record(gpu, encoder, &inputs, &sums, &found);
    })[0]
}

#[test]
fn exposure_of_sums_matches_f64_and_ignores_nan_and_infinity() {
    let gpu = gpu();
    let settings: ExposureSettings =
        ExposureValues { metering: Metering::Mean, key: 0.3, compensation_ev: 1.25, ..Default::default() }.into();
    let sums: Vec<[f32; 2]> = (0..1000_u32).map(|i| [1e-6 * ((i * i) % 997) as f32, 0.0]).collect();
    let light: f64 = sums.iter().map(|sum| f64::from(sum[0])).sum();
    let expected = settings.metered_ev100(light / 12.5);
    assert!((expected - metered_ev100(light / 12.5 / 0.3 * (0.125 / 1.2), 1.25, -20.0, 24.0)).abs() < 1e-12);
    let found = exposure_of(&gpu, &settings, None, &sums);
    assert!((f64::from(found.ev100) - expected).abs() < 1e-4, "{}, expected {expected}", found.ev100);
    assert_eq!((found.ev100, found.mean_luminance_cd_m2), (found.metered_ev100, (light / 12.5) as f32));
    // NaN and infinite sums at the front, in the middle and at the end.
    let mut broken = sums.clone();
    broken.insert(500, [f32::INFINITY, 0.0]);
    broken.insert(0, [f32::NAN, 0.0]);
    broken.push([f32::NEG_INFINITY, 0.0]);
    let survived = exposure_of(&gpu, &settings, None, &broken);
    assert!((f64::from(survived.ev100) - expected).abs() < 1e-4, "{}, expected {expected}", survived.ev100);
    // If half of the solid angle is excluded, all of the light comes from the other half: the exposure is one EV higher.
    broken.push([0.0, 6.25]);
    let half = exposure_of(&gpu, &settings, None, &broken);
    assert!((f64::from(half.ev100) - expected - 1.0).abs() < 1e-4, "{}", half.ev100);
    // A known exposure is used, and metering still works.
    let known = exposure_of(&gpu, &settings, Some(3.5), &sums);
    assert_eq!((known.ev100, known.metered_ev100), (3.5, found.ev100));
    assert!((known.display_per_cd_m2 * 1.2 * 2f32.powf(3.5) - 1.0).abs() < 1e-5);
}

#[test]
fn darkness_and_overflowing_light_give_the_exposure_limits() {
    let gpu = gpu();
    let settings = ExposureSettings::default();
    for dark in [vec![[0.0, 0.0]; 7], vec![[f32::NAN, 0.0]; 300], vec![[0.0, 12.5]], vec![[1.0, 100.0]]] {
        let found = exposure_of(&gpu, &settings, None, &dark);
        assert_eq!((found.ev100, found.mean_luminance_cd_m2), (-20.0, 0.0));
    }
    for bright in [vec![[1e9, 0.0]], vec![[3e38, 0.0]; 600], vec![[1e38, 12.4999]]] {
        let found = exposure_of(&gpu, &settings, None, &bright);
        assert!(found.ev100 == 24.0 && found.mean_luminance_cd_m2.is_finite(), "{found:?}");
    }
}

fn viewport(size: [u32; 2]) -> Viewport {
    let kind = ViewKind::Perspective { size, fov_y_rad: 2.0 };
    let view = View::new("v", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    Rig::new(vec![view]).unwrap().viewports(DQuat::IDENTITY).remove(0)
}

/// Returns the only tile of a viewport, and its number of pixels.
fn tile_of([width, height]: [u32; 2]) -> (Tile, layout::Tile, u32) {
    let tile = Tile { viewport: 0, first_row: 0, rows: height, first_pixel: 0 };
    (tile, layout::Tile { rows: height, ..Default::default() }, width * height)
}

/// A picture of half floats, some of them NaN or infinite, passes through resolve and exposure. A non-finite pixel must
/// be excluded from the mean, with its solid angle, and must not affect other pixels.
#[test]
fn a_non_finite_pixel_does_not_affect_the_others() {
    let gpu = gpu();
    let size = [70, 37];
    let (tile, encoded, pixels) = tile_of(size);
    let viewport = viewport(size);
    // Luminance as a half float in the low word, a temperature of 5888 K in the high word; all colours are white.
    let half = |exponent: u32, mantissa: u32| (0x6dc0 << 16) | (exponent << 10) | mantissa;
    let sane = |i: u32| half(14 + i % 5, (i * 37) % 1024);
    let value = |word: u32| match (word >> 10 & 31, word & 1023) {
        (31, 0) => f64::INFINITY,
        (31, _) => f64::NAN,
        (exponent, mantissa) => 2f64.powi(exponent as i32 - 15) * (1.0 + f64::from(mantissa) / 1024.0),
    };
    let metered = |words: &[u32]| -> layout::Exposure {
        let resolve = LuminancePass::new(&gpu, LuminanceSource::Packed);
        let meter = ExposurePass::new();
        let viewports =
            uniform_list(&gpu, "viewports", &[encode_viewport(&viewport, &KernelPlan::bspline())], MAX_VIEWPORTS);
        let tiles = uniform_list(&gpu, "tiles", &[encoded], MAX_TILES);
        let picture = buffer_for_results(&gpu, u64::from(pixels) * 16);
        let count = partial_sums(size[0], size[1]);
        let sums = buffer_for_results(&gpu, u64::from(count) * PARTIAL_SUM_BYTES);
        let found = buffer_for_results(&gpu, size_of::<layout::Exposure>() as u64);
        let packed = storage_buffer(&gpu, "packed", words);
        let colours = storage_buffer(&gpu, "colours", &[[1.0_f32; 4]; 2048]);
        run(&gpu, &found, 1, |pass| {
            let target = PictureTarget {
                viewports: &viewports,
                tiles: &tiles,
                pixels: &picture,
                partial_sums: &sums,
                plane_pixels: pixels,
            };
            let source_bindings = [(0, packed.as_entire_binding()), (1, colours.as_entire_binding())];
            let grid = pixel_grid(&[tile], &[size[0]]);
            let inputs = LuminanceInputs { scale: 1.0, numbers: [0, 0], source_bindings: &source_bindings };
            resolve.record(&gpu, pass, &inputs, &target, grid);
            let inputs = ExposureInputs {
                metering: &MeteringPlan::new(&ExposureSettings::default()),
                known_ev100: None,
                total_solid_angle_sr: viewport.projection.picture_solid_angle_sr(),
                partial_count: count,
            };
            meter.record(&gpu, pass, &inputs, &sums, &found);
        })[0]
    };
    let expected = |words: &[u32]| {
        mean_luminance_cd_m2(words.iter().enumerate().map(|(i, word)| {
            let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
            [value(*word), viewport.projection.mapping().solid_angle_sr(x, y)]
        }))
    };
    let sound: Vec<u32> = (0..pixels).map(sane).collect();
    let mut broken = sound.clone();
    // A pixel, its neighbour in the same column, and a quarter of the rows around the middle.
    for i in [5, 75, 2589].into_iter().chain(70 * 10..70 * 19) {
        broken[i] = if i % 2 == 0 { half(31, 0) } else { half(31, 512) };
    }
    for words in [&sound, &broken] {
        let (found, mean) = (metered(words), expected(words));
        println!("mean {:.6} cd/m^2, in f64 {mean:.6}", found.mean_luminance_cd_m2);
        assert!((f64::from(found.mean_luminance_cd_m2) / mean - 1.0).abs() < 1e-4, "{found:?}, expected {mean}");
    }
    // If the broken pixels counted as dark, the mean would be far lower.
    let as_dark: Vec<u32> = broken.iter().map(|word| if value(*word).is_finite() { *word } else { 0 }).collect();
    assert!(f64::from(metered(&as_dark).mean_luminance_cd_m2) < 0.8 * expected(&broken));
    let nothing = vec![half(31, 512); pixels as usize];
    assert_eq!(metered(&nothing).ev100, -20.0);
}

/// Runs the tone-mapping pass on a picture in cd/m^2 and returns its bytes.
fn displayed(gpu: &Gpu, settings: &ToneMapSettings, size: [u32; 2], picture: &[[f32; 3]], white: f32) -> Vec<[u8; 4]> {
    encoded(gpu, (settings, false), size, picture, white)
}

/// As [`displayed`], with short approximations of codes or without them.
fn encoded(
    gpu: &Gpu,
    (settings, has_short_codes): (&ToneMapSettings, bool),
    size: [u32; 2],
    picture: &[[f32; 3]],
    white: f32,
) -> Vec<[u8; 4]> {
    let (tile, encoded, pixels) = tile_of(size);
    // Stored pictures never contain zero bits of R and G for a lit pixel, since these would mark it as dark. So avoid them here.
    let red = |p: &[f32; 3]| if p[0].to_bits() == 0 && p[1].to_bits() == 0 && p[2] > 0.0 { -0.0 } else { p[0] };
    let planes: Vec<[f32; 2]> =
        picture.iter().map(|p| [red(p), p[1]]).chain(picture.iter().map(|p| [p[2], 1.0])).collect();
    let viewports =
        uniform_list(gpu, "viewports", &[encode_viewport(&viewport(size), &KernelPlan::bspline())], MAX_VIEWPORTS);
    let exposure = layout::Exposure { display_per_cd_m2: 1.0 / white, ..Default::default() };
    let display = buffer_for_results(gpu, u64::from(pixels) * 4);
    run(gpu, &display, pixels as usize, |pass| {
        let picture = PictureTarget {
            viewports: &viewports,
            tiles: &uniform_list(gpu, "tiles", &[encoded], MAX_TILES),
            pixels: &storage_buffer(gpu, "picture", &planes),
            partial_sums: &viewports,
            plane_pixels: pixels,
        };
        let exposure = storage_buffer(gpu, "exposure", &[exposure]);
        let grid = pixel_grid(&[tile], &[size[0]]);
        ToneMapPass::new().record(gpu, pass, (settings, has_short_codes), &picture, (&exposure, &display), grid);
    })
}

/// Returns colours from far below black to far beyond white, including invalid values.
fn colours() -> Vec<[f32; 3]> {
    let mut colours = Vec::new();
    for rgb in
        [[1.0, 1.0, 1.0], [1.0, 0.49, 0.13], [0.55, 0.69, 1.0], [1.0, 0.1, 0.0], [0.0, 0.1, 1.0], [0.2, 1.0, 0.3]]
    {
        colours.extend((-60..90).map(|step| rgb.map(|channel: f32| channel * 10f32.powf(step as f32 / 10.0))));
    }
    let odd = [0.0, -0.0, -1.0, 0.5, 1e-30, 1e30, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    colours.extend(odd.into_iter().flat_map(|a| odd.map(|b| [a, b, 0.5])));
    colours.resize(1024, [0.0; 3]);
    colours
}

/// Returns the number of bytes that differ from the twin by more than rounding explains.
fn differing(bytes: &[[u8; 4]], picture: &[[f32; 3]], settings: &ToneMapSettings, white: f32) -> usize {
    let mut found = 0;
    for (bytes, rgb) in bytes.iter().zip(picture) {
        let expected = settings.display_rgb(rgb.map(f64::from), f64::from(white));
        let rounding = if settings.dither { 1.03 } else { 0.53 };
        let far = |(byte, value): (&u8, f64)| (f64::from(*byte) - 255.0 * value).abs() > rounding;
        found += bytes.iter().zip(expected).filter(|pair| far(*pair)).count();
        assert_eq!(bytes[3], 255);
    }
    found
}

#[test]
fn every_tone_map_operator_and_option_matches_its_twin() {
    let gpu = gpu();
    let picture = colours();
    for operator in ToneMapOperator::ALL {
        for (desaturation, scotopic) in [(0.0, 0.0), (1.0, 0.0), (0.35, 0.8), (0.0, 1.0)] {
            for dither in [true, false] {
                let settings = ToneMapSettings {
                    operator,
                    desaturation,
                    scotopic,
                    dither,
                    white: 4.0,
                    peak_cd_m2: 50.0,
                    black_cd_m2: 0.02,
                };
                let bytes = displayed(&gpu, &settings, [64, 16], &picture, 3.0);
                assert_eq!(differing(&bytes, &picture, &settings, 3.0), 0, "{settings:?}");
                if dither {
                    continue;
                }
                // Compared with the twin of another operator or option, the test must fail.
                for other in ToneMapOperator::ALL.into_iter().filter(|other| *other != operator) {
                    let other = ToneMapSettings { operator: other, ..settings };
                    assert!(differing(&bytes, &picture, &other, 3.0) > 100, "{settings:?} as {other:?}");
                }
                for other in
                    [ToneMapSettings { desaturation: 0.7, ..settings }, ToneMapSettings { scotopic: 0.4, ..settings }]
                {
                    assert!(differing(&bytes, &picture, &other, 3.0) > 100, "{settings:?} as {other:?}");
                }
            }
        }
    }
}

/// Returns the largest distance of a byte from the twin's value, beyond half a code.
fn farthest(bytes: &[[u8; 4]], picture: &[[f32; 3]], settings: &ToneMapSettings, white: f32) -> f64 {
    let beyond = |(bytes, rgb): (&[u8; 4], &[f32; 3])| {
        let expected = settings.display_rgb(rgb.map(f64::from), f64::from(white));
        (0..3).map(|i| (f64::from(bytes[i]) - 255.0 * expected[i]).abs() - 0.5).fold(0.0, f64::max)
    };
    bytes.iter().zip(picture).map(beyond).fold(0.0, f64::max)
}

#[test]
fn short_codes_have_at_most_their_stated_error() {
    let gpu = gpu();
    let size = [256, 256];
    // From a third of a code of sRGB to white, in steps of up to 0.03 codes.
    let ramp = |tint: [f32; 3]| move |step: u32| tint.map(|channel| channel * 10f32.powf(step as f32 / 8192.0 - 4.0));
    let tints = [[1.0, 1.0, 1.0], [1.0, 0.8, 0.6]];
    let picture: Vec<[f32; 3]> = tints.into_iter().flat_map(|tint| (0..32768).map(ramp(tint))).collect();
    for operator in ToneMapOperator::ALL {
        for desaturation in [0.0, 1.0] {
            let settings = ToneMapSettings {
                desaturation,
                dither: false,
                peak_cd_m2: 1.0,
                black_cd_m2: 0.0,
                ..ToneMapSettings::of(operator)
            };
            let farthest = [false, true].map(|short| {
                let bytes = encoded(&gpu, (&settings, short), size, &picture, 1.0);
                self::farthest(&bytes, &picture, &settings, 1.0)
            });
            println!(
                "{operator:?}, desaturation {desaturation}: {:.4} codes, short ones {:.4}",
                farthest[0], farthest[1]
            );
            assert!(farthest[0] < 0.0004 && farthest[1] < SHORT_CODES_ERROR, "{operator:?}: {farthest:?}");
        }
    }
}

#[test]
fn white_stays_white_with_short_codes() {
    let gpu = gpu();
    // With dithering, any value below 1 would show in some of the pixels.
    let settings = ToneMapSettings { dither: true, ..ToneMapSettings::of(ToneMapOperator::Srgb) };
    let white = |light: f32| {
        let bytes = encoded(&gpu, (&settings, true), [64, 64], &vec![[light; 3]; 64 * 64], 1.0);
        bytes.iter().all(|bytes| *bytes == [255; 4])
    };
    assert!(white(1.0) && white(2.0));
    assert!(!white(0.998));
}

#[test]
fn dithering_preserves_the_mean_between_two_codes() {
    let gpu = gpu();
    let size = [128, 64];
    let picture = vec![[0.0317_f32, 0.0317, 0.0317]; 128 * 64];
    for operator in ToneMapOperator::ALL {
        let mut settings = ToneMapSettings { peak_cd_m2: 1.0, ..ToneMapSettings::of(operator) };
        let value = 255.0 * settings.display_rgb([0.0317_f32.into(); 3], 1.0)[0];
        let dithered = displayed(&gpu, &settings, size, &picture, 1.0);
        let mean = dithered.iter().map(|bytes| f64::from(bytes[0])).sum::<f64>() / dithered.len() as f64;
        assert!((mean - value).abs() < 0.02, "{operator:?}: {mean}, expected {value}");
        assert!(dithered.iter().all(|bytes| bytes[0] == bytes[1] && bytes[1] == bytes[2]), "no coloured noise");
        settings.dither = false;
        let rounded = displayed(&gpu, &settings, size, &picture, 1.0);
        assert!(rounded.iter().all(|bytes| f64::from(bytes[0]) == value.round()), "{operator:?}: {value}");
    }
}

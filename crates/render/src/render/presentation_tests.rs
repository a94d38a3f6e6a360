//! Tests split frames (submit and finish) and images in textures: the pictures of a headset's eyes against those that
//! `render` reads back, the f64 twin of the tone mapping, and the physical light of stars.

#![allow(clippy::unwrap_used, reason = "a panic in a helper fails the test")]

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::{Frame, FrameImage, FrameRequest, Presentation, Renderer, Wanted, error::RenderError};
use crate::{
    catalogue::{StarRecord, chunks::StarSet},
    gpu::{Gpu, GpuOptions, read_layer, storage_buffer},
    metrics::{self, HdrView},
    photometry::{exposure::white_luminance_cd_m2, tone_map::linear_from_srgb},
    plan::{
        settings::{
            ExposureMode, ExposureSettings, GlareMethod, GlareSettings, Metering, RenderSettings, StarMethod,
            ToneMapOperator, ToneMapSettings,
        },
        tiles::{BYTES_PER_PIXEL, Tile, batches},
    },
    render::display::present::{PresentPass, PresentTile},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, Emission, ReflectionLaw, Spin, Surface},
    },
    units::illuminance_lx_from_magnitude,
    view::{Eye, Fov, Rig, View, ViewKind},
};

const SIZES: [[u32; 2]; 2] = [[96, 84], [72, 64]];
const BYTES: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
const SWAPPED_BYTES: wgpu::TextureFormat = wgpu::TextureFormat::Bgra8UnormSrgb;
const HALVES: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Limits bindings to so few pixels that the eyes are drawn in several batches. One of the batches holds tiles of both eyes.
const STRIPS: u64 = 96 * 25 * BYTES_PER_PIXEL;

fn gpu(binding_limit_bytes: Option<u64>) -> Gpu {
    Gpu::open(&GpuOptions { binding_limit_bytes, ..GpuOptions::default() })
        .expect("tests need a Vulkan adapter; `make test` installs the software one")
}

fn renderer() -> Renderer {
    Renderer::new(gpu(None))
}

/// Returns two eyes that differ in size, asymmetric field of view, orientation and position.
fn headset() -> Rig {
    let fov = Fov { left_rad: -0.86, right_rad: 0.71, up_rad: 0.74, down_rad: -0.69 };
    let eye = |size: [u32; 2], fov: Fov, turn: DQuat, x: f64| Eye {
        size,
        fov,
        room_from_eye: turn,
        position_m: DVec3::new(x, 1.6, -0.1),
    };
    let eyes = [
        eye(SIZES[0], fov, DQuat::from_rotation_y(0.09) * DQuat::from_rotation_z(0.05), -0.031),
        eye(SIZES[1], Fov { up_rad: 0.66, ..fov.mirrored() }, DQuat::from_rotation_y(-0.07), 0.033),
    ];
    let view = View::new("headset", ViewKind::Headset { eyes }, DQuat::from_rotation_x(0.2), DVec3::ZERO);
    Rig::new(vec![view.unwrap()]).unwrap()
}

fn star(direction: DVec3, magnitude: f32, temperature_k: f32) -> StarRecord {
    StarRecord { position: direction.normalize(), magnitude, temperature_k, distance_known: false }
}

fn scene(stars: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot {
        revision: 1,
        stars: Arc::new(StarSet::from_records(stars)),
        objects: Default::default(),
        camera: Camera::default(),
    }
}

/// Returns stars of all colours and magnitudes over the whole sky, rotated by an angle.
fn sky(turn_rad: f64) -> SceneSnapshot {
    let count = 3000;
    let turn = DQuat::from_rotation_y(turn_rad);
    let stars = (0..count).map(|i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
        let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
        let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
        star(turn * direction, (i % 8) as f32 - 1.0, 2500.0 + 9.0 * i as f32)
    });
    scene(stars.collect())
}

fn settings(method: StarMethod) -> RenderSettings {
    let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
    settings.stars.method = method;
    settings
}

/// Settings without a budget, so that display images have the same codes in frames with HDR images and without them.
fn exact_settings() -> RenderSettings {
    let mut settings = settings(StarMethod::Auto);
    settings.accuracy.display_codes = 0.0;
    settings
}

/// Creates a texture of two layers and a view of its second layer.
fn target(gpu: &Gpu, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> (wgpu::Texture, wgpu::TextureView) {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("swapchain image"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 2 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer: 1,
        array_layer_count: Some(1),
        ..Default::default()
    });
    (texture, view)
}

/// Reads the texels of the second layer.
fn texels(gpu: &Gpu, texture: &wgpu::Texture) -> Vec<u8> {
    read_layer(gpu, texture, 1).unwrap()
}

/// Returns the value of a finite, non-negative half float.
fn value_of_half(bits: u16) -> f64 {
    assert!(bits < 0x7c00, "{bits:#x} is not a finite, non-negative half float");
    let (exponent, mantissa) = (i32::from(bits >> 10), f64::from(bits & 1023));
    if exponent == 0 { mantissa * 2f64.powi(-24) } else { (1024.0 + mantissa) * 2f64.powi(exponent - 25) }
}

/// Returns linear R, G, B of a texture of half floats; asserts that alpha is 1.
fn light_of(gpu: &Gpu, texture: &wgpu::Texture) -> Vec<[f64; 3]> {
    let bytes = texels(gpu, texture);
    let halves: Vec<f64> =
        bytes.as_chunks::<2>().0.iter().map(|pair| value_of_half(u16::from_le_bytes(*pair))).collect();
    let pixels = halves.as_chunks::<4>().0;
    pixels
        .iter()
        .map(|[r, g, b, a]| {
            assert_eq!(*a, 1.0);
            [*r, *g, *b]
        })
        .collect()
}

/// Draws a frame of both eyes into textures of one format, without reading images back.
fn presented(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    settings: &RenderSettings,
    adapted_ev100: Option<f64>,
    format: wgpu::TextureFormat,
) -> (Frame, [wgpu::Texture; 2]) {
    let rig = headset();
    let [left, right] = SIZES.map(|size| target(renderer.gpu(), size, format));
    let presentations =
        [(0, &left.1), (1, &right.1)].map(|(viewport, target)| Presentation { viewport, target, format });
    let submitted = renderer
        .submit(
            FrameRequest::new(scene, &rig)
                .settings(settings)
                .wanted(Wanted::default())
                .adapted_ev100(adapted_ev100)
                .presentations(&presentations),
        )
        .unwrap();
    let frame = renderer.finish(submitted).unwrap();
    assert!(frame.images.is_empty(), "no image was requested");
    (frame, [left.0, right.0])
}

/// Renders both eyes and reads all images back.
fn rendered(renderer: &mut Renderer, scene: &SceneSnapshot, settings: &RenderSettings, adapted: Option<f64>) -> Frame {
    let wanted = Wanted::both();
    renderer
        .render(FrameRequest::new(scene, &headset()).settings(settings).wanted(wanted).adapted_ev100(adapted))
        .unwrap()
}

/// Asserts that the textures hold the display images.
fn assert_same_bytes(renderer: &Renderer, textures: &[wgpu::Texture], images: &[FrameImage], case: &str) {
    assert_eq!(textures.len(), images.len());
    for (texture, image) in textures.iter().zip(images) {
        let mut found = texels(renderer.gpu(), texture);
        if texture.format() == SWAPPED_BYTES {
            found.as_chunks_mut::<4>().0.iter_mut().for_each(|texel| texel.swap(0, 2));
        }
        let expected = image.display.as_ref().unwrap();
        let lit = expected.as_chunks::<4>().0.iter().filter(|texel| texel[..3] != [0; 3]).count();
        assert!(lit > 100, "{case}: {lit} lit pixels are too few for this test");
        let differing = found.iter().zip(expected).filter(|(a, b)| a != b).count();
        assert!(found == *expected, "{case}, {:?}: {differing} bytes differ", image.part);
    }
}

/// Returns the number of pixels of a half-float texture that differ from the tone-mapped HDR image by more than the rounding to the nearest half
/// float.
fn halves_off(light: &[[f64; 3]], image: &FrameImage, tone_map: &ToneMapSettings, ev100: f64) -> usize {
    let white = white_luminance_cd_m2(ev100);
    let hdr = image.hdr.as_ref().unwrap();
    assert_eq!(light.len(), hdr.len());
    let far = |(found, expected): (&f64, f64)| {
        let exponent = expected.max(2f64.powi(-14)).log2().floor() as i32;
        // Half a step of the half float, plus the f32 error of curves and powers.
        (found - expected).abs() > 0.5 * 2f64.powi(exponent - 10) + 4e-5 * expected + 1e-9
    };
    light
        .iter()
        .zip(hdr)
        .filter(|(light, [r, g, b, _])| {
            let expected = tone_map.display_rgb([*r, *g, *b].map(f64::from), white).map(linear_from_srgb);
            light.iter().zip(expected).any(far)
        })
        .count()
}

/// Returns settings with exposures known in advance or not, each with and without glare.
fn exposures_and_glares(settings: &RenderSettings) -> Vec<(RenderSettings, Option<f64>)> {
    let mut manual = settings.clone();
    manual.exposure = ExposureSettings::manual(-9.0);
    let mut metered = settings.clone();
    metered.exposure = ExposureSettings::auto(Metering::Mean);
    let cases = [(metered, None), (settings.clone(), Some(-8.0)), (manual, None)];
    let with_glare = |(settings, adapted): (RenderSettings, Option<f64>)| {
        let glaring = RenderSettings { glare: GlareSettings::default(), ..settings.clone() };
        [(settings, adapted), (glaring, adapted)]
    };
    cases.into_iter().flat_map(with_glare).collect()
}

#[test]
fn every_code_of_every_channel_is_presented_unchanged() {
    let gpu = gpu(None);
    let size = [19, 27];
    let codes = |i: u32| [i % 256, 255 - i % 256, (i * 7 + 3) % 256];
    let words: Vec<u32> = (0..19 * 27).map(codes).map(|[r, g, b]| r | g << 8 | b << 16 | 255 << 24).collect();
    let expected: Vec<[u8; 4]> = words.iter().map(|word| word.to_le_bytes()).collect();
    // The lower tile comes first in the batch, after some other pixels.
    let tiles = [
        Tile { viewport: 0, first_row: 10, rows: 17, first_pixel: 5 },
        Tile { viewport: 0, first_row: 0, rows: 10, first_pixel: 5 + 19 * 17 },
    ];
    let batch = [&[0xff12_3456; 5][..], &words[190..], &words[..190]].concat();
    let pixels = storage_buffer(&gpu, "display", &batch);
    let exposure = storage_buffer(&gpu, "exposure", &[[0.0_f32; 4]]);
    let drawn = |format: wgpu::TextureFormat, tiles: &[Tile]| -> Vec<[u8; 4]> {
        let (texture, view) = target(&gpu, size, format);
        let present = PresentPass::new();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations::default(),
                })],
                ..Default::default()
            });
            for tile in tiles {
                let target = PresentTile { tile, width: 19, plane_pixels: 600, pixels: &pixels, exposure: &exposure };
                present.record(&gpu, &mut pass, &ToneMapSettings::default(), format, &target);
            }
        }
        gpu.queue.submit([encoder.finish()]);
        texels(&gpu, &texture).as_chunks::<4>().0.to_vec()
    };
    assert!(drawn(BYTES, &tiles) == expected);
    let swapped: Vec<[u8; 4]> = drawn(SWAPPED_BYTES, &tiles).iter().map(|[b, g, r, a]| [*r, *g, *b, *a]).collect();
    assert!(swapped == expected);
    for channel in 0..3 {
        let mut codes: Vec<u8> = expected.iter().map(|texel| texel[channel]).collect();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), 256);
    }
    // The test detects a tile that begins a pixel too late, and a missing tile.
    let late = [Tile { first_pixel: 6, ..tiles[0] }, tiles[1]];
    assert!(drawn(BYTES, &late) != expected);
    assert!(drawn(BYTES, &tiles[..1]) != expected);
}

#[test]
#[ignore = "long: make test-all"]
fn byte_textures_match_display_images_for_all_operators_and_tiled_for_one() {
    assert_byte_textures_match_display_images(&[
        (None, &ToneMapOperator::ALL),
        (Some(STRIPS), &[ToneMapOperator::Filmic]),
    ]);
}

#[test]
#[ignore = "long: make test-all"]
fn byte_textures_match_display_images_for_all_operators_whole_and_tiled() {
    let all = &ToneMapOperator::ALL;
    assert_byte_textures_match_display_images(&[(None, all), (Some(STRIPS), all)]);
}

/// `cases`: limits of a binding's size in bytes, each with the operators to test.
fn assert_byte_textures_match_display_images(cases: &[(Option<u64>, &[ToneMapOperator])]) {
    let pixels = STRIPS / BYTES_PER_PIXEL;
    let tiled = batches(&SIZES, pixels);
    assert!(tiled.len() > 3 && tiled.iter().any(|batch| batch.tiles.len() > 1), "{tiled:?}");
    let scene = sky(0.0);
    for &(limit, operators) in cases {
        let mut renderer = Renderer::new(gpu(limit));
        for &operator in operators {
            let tone_map = ToneMapSettings { peak_cd_m2: 0.01, ..ToneMapSettings::of(operator) };
            let base = RenderSettings { tone_map, ..settings(StarMethod::Auto) };
            for (settings, adapted) in exposures_and_glares(&base) {
                let glares = settings.glare.chosen(StarMethod::Auto) != GlareMethod::None;
                let case = format!("{operator:?}, {:?}, {adapted:?}, {glares}, {limit:?}", settings.exposure.mode());
                let reference = rendered(&mut renderer, &scene, &settings, adapted);
                let format = if glares { SWAPPED_BYTES } else { BYTES };
                let (frame, textures) = presented(&mut renderer, &scene, &settings, adapted, format);
                assert_eq!(frame.exposure_ev100, reference.exposure_ev100, "{case}");
                assert_eq!(frame.mean_luminance_cd_m2, reference.mean_luminance_cd_m2, "{case}");
                assert_same_bytes(&renderer, &textures, &reference.images, &case);
                if !frame.times.passes_ms.is_empty() {
                    let timed = frame.times.passes_ms.iter().filter(|(name, _)| *name == "present").count();
                    assert_eq!(timed, 2, "one pass per eye");
                }
            }
        }
    }
}

/// Shares of desaturation and of scotopic vision.
const PLAIN: (f64, f64) = (0.0, 0.0);
const NIGHT: (f64, f64) = (0.7, 0.6);

#[test]
#[ignore = "long: make test-all"]
fn half_float_textures_match_tone_mapped_light_for_all_operators() {
    let plain = ToneMapOperator::ALL.map(|operator| (operator, PLAIN));
    let filmic = ToneMapOperator::Filmic;
    assert_half_float_textures_match_tone_mapped_light(&[
        (None, &[&plain[..], &[(filmic, NIGHT)]].concat()),
        (Some(STRIPS), &[(filmic, PLAIN)]),
    ]);
}

#[test]
#[ignore = "long: make test-all"]
fn half_float_textures_match_tone_mapped_light_for_all_operators_at_night_and_tiled() {
    let [plain, night] = [PLAIN, NIGHT].map(|eye| ToneMapOperator::ALL.map(|operator| (operator, eye)));
    assert_half_float_textures_match_tone_mapped_light(&[(None, &[plain, night].concat()), (Some(STRIPS), &plain)]);
}

/// Test cases: limit of a binding's size in bytes, and operators with their desaturation and scotopic share.
type HalvesCase<'a> = (Option<u64>, &'a [(ToneMapOperator, (f64, f64))]);

fn assert_half_float_textures_match_tone_mapped_light(cases: &[HalvesCase<'_>]) {
    let scene = sky(0.0);
    for &(limit, eyes) in cases {
        let mut renderer = Renderer::new(gpu(limit));
        for &(operator, (desaturation, scotopic)) in eyes {
            let tone_map =
                ToneMapSettings { peak_cd_m2: 0.01, desaturation, scotopic, ..ToneMapSettings::of(operator) };
            let base = RenderSettings { tone_map, ..settings(StarMethod::Auto) };
            for (settings, adapted) in exposures_and_glares(&base) {
                let reference = rendered(&mut renderer, &scene, &settings, adapted);
                let (frame, textures) = presented(&mut renderer, &scene, &settings, adapted, HALVES);
                assert_eq!(frame.exposure_ev100, reference.exposure_ev100);
                for (texture, image) in textures.iter().zip(&reference.images) {
                    let light = light_of(renderer.gpu(), texture);
                    let off = halves_off(&light, image, &tone_map, frame.exposure_ev100);
                    assert_eq!(off, 0, "{operator:?}, {desaturation}, {scotopic}, {adapted:?}, {limit:?}");
                    // The test detects another operator, another exposure and truncated half floats.
                    let other =
                        if operator == ToneMapOperator::Aces { ToneMapOperator::Srgb } else { ToneMapOperator::Aces };
                    let other = ToneMapSettings { operator: other, ..tone_map };
                    assert!(halves_off(&light, image, &other, frame.exposure_ev100) > 50);
                    if operator != ToneMapOperator::Calibrated {
                        assert!(halves_off(&light, image, &tone_map, frame.exposure_ev100 + 0.01) > 50);
                    }
                    let below = |value: f64| value * (1.0 - 2f64.powi(-11));
                    let truncated: Vec<[f64; 3]> = light.iter().map(|rgb| rgb.map(below)).collect();
                    assert!(halves_off(&truncated, image, &tone_map, frame.exposure_ev100) > 50);
                }
            }
        }
    }
}

#[test]
#[ignore = "long: make test-all"]
fn every_star_method_is_presented_with_and_without_glare() {
    let scene = sky(0.3);
    let mut renderer = Renderer::new(gpu(Some(STRIPS)));
    for method in StarMethod::ALL {
        for (settings, adapted) in exposures_and_glares(&settings(method)) {
            // If the exposure is not known in advance, all methods except `auto` share one code path.
            if settings.exposure.mode() == ExposureMode::Manual && method != StarMethod::Auto {
                continue;
            }
            let case = format!("{method:?}, {adapted:?}, {:?}", settings.glare.chosen(method));
            let reference = rendered(&mut renderer, &scene, &settings, adapted);
            let (_, textures) = presented(&mut renderer, &scene, &settings, adapted, BYTES);
            for (texture, image) in textures.iter().zip(&reference.images) {
                let found = texels(renderer.gpu(), texture);
                assert!(found == *image.display.as_ref().unwrap(), "{case}");
            }
            let (frame, textures) = presented(&mut renderer, &scene, &settings, adapted, HALVES);
            for (texture, image) in textures.iter().zip(&reference.images) {
                let light = light_of(renderer.gpu(), texture);
                assert_eq!(halves_off(&light, image, &settings.tone_map, frame.exposure_ev100), 0, "{case}");
            }
        }
    }
}

#[test]
fn a_body_at_arm_s_length_is_presented_with_the_stars_behind_it() {
    let mut renderer = Renderer::new(gpu(Some(STRIPS)));
    let body = Body {
        name: "lamp".to_owned(),
        ephemeris: None,
        position_m: DVec3::new(0.1, 1.7, -2.0),
        radii_m: DVec3::new(0.5, 0.3, 0.4),
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law: ReflectionLaw::Lambert, geometric_albedo: [0.3; 3], phase_curve: None, texture: None },
        emission: Some(Emission { luminance_cd_m2: [0.004, 0.003, 0.002], limb_darkening: 0.6, corona: false }),
        seen_through: [1.0; 3],
    };
    let objects = Arc::new(SceneObjects { bodies: vec![Arc::new(body)], ..SceneObjects::default() });
    let scene = SceneSnapshot { objects, ..sky(0.0) };
    for (settings, adapted) in exposures_and_glares(&settings(StarMethod::Auto)) {
        let case = format!("{:?}, {adapted:?}", settings.exposure.mode());
        let reference = rendered(&mut renderer, &scene, &settings, adapted);
        let (_, textures) = presented(&mut renderer, &scene, &settings, adapted, BYTES);
        assert_same_bytes(&renderer, &textures, &reference.images, &case);
        let (frame, textures) = presented(&mut renderer, &scene, &settings, adapted, HALVES);
        for (texture, image) in textures.iter().zip(&reference.images) {
            let light = light_of(renderer.gpu(), texture);
            assert_eq!(halves_off(&light, image, &settings.tone_map, frame.exposure_ev100), 0, "{case}");
        }
    }
}

/// One eye may be mirrored on a screen while both are presented, in different formats.
#[test]
fn readback_and_presentation_do_not_disturb_each_other() {
    let mut renderer = renderer();
    let (scene, rig, settings) = (sky(0.0), headset(), exact_settings());
    let reference = rendered(&mut renderer, &scene, &settings, Some(-8.0));
    let left = target(renderer.gpu(), SIZES[0], BYTES);
    let right = target(renderer.gpu(), SIZES[1], HALVES);
    let presentations = [
        Presentation { viewport: 1, target: &right.1, format: HALVES },
        Presentation { viewport: 0, target: &left.1, format: BYTES },
    ];
    for wanted in [Wanted { display: true, ..Wanted::default() }, Wanted { hdr: true, ..Wanted::default() }] {
        let submitted = renderer
            .submit(
                FrameRequest::new(&scene, &rig)
                    .settings(&settings)
                    .wanted(wanted)
                    .adapted_ev100(-8.0)
                    .presentations(&presentations),
            )
            .unwrap();
        let frame = renderer.finish(submitted).unwrap();
        for (image, expected) in frame.images.iter().zip(&reference.images) {
            assert_eq!(image.display, expected.display.clone().filter(|_| wanted.display));
            assert_eq!(image.hdr, expected.hdr.clone().filter(|_| wanted.hdr));
        }
        assert!(texels(renderer.gpu(), &left.0) == *reference.images[0].display.as_ref().unwrap());
        let light = light_of(renderer.gpu(), &right.0);
        assert_eq!(halves_off(&light, &reference.images[1], &settings.tone_map, -8.0), 0);
    }
}

#[test]
fn both_eyes_show_the_light_of_stars() {
    let mut renderer = renderer();
    let rig = headset();
    let stars: Vec<(DVec3, f32)> = (-2..=2)
        .flat_map(|i| (-2..=2).map(move |j| (i, j)))
        .map(|(i, j)| {
            let direction = DQuat::from_rotation_x(0.2) * DVec3::new(0.2 * f64::from(i), 0.2 * f64::from(j), -1.0);
            (direction.normalize(), 0.1 * (i + 2) as f32 + 0.3 * (j + 2) as f32)
        })
        .collect();
    let scene = scene(stars.iter().map(|(direction, magnitude)| star(*direction, *magnitude, 5772.0)).collect());
    let mut settings = settings(StarMethod::Auto);
    settings.tone_map = ToneMapSettings::of(ToneMapOperator::Srgb);
    settings.exposure = ExposureSettings::manual(-5.0);
    let white = white_luminance_cd_m2(-5.0);
    let (_, textures) = presented(&mut renderer, &scene, &settings, None, HALVES);
    let viewports = rig.viewports(DQuat::IDENTITY);
    // Returns the greatest relative error of a star's light, with the eye rotated by an angle.
    let worst = |eye: usize, turn_rad: f64| {
        let pixels = light_of(renderer.gpu(), &textures[eye]);
        assert!(pixels.iter().flatten().all(|channel| *channel < 1.0), "no channel is clipped");
        let light: Vec<[f64; 3]> = pixels.iter().map(|rgb| rgb.map(|channel| channel * white)).collect();
        let turn = viewports[eye].world_from_view * DQuat::from_rotation_y(turn_rad);
        let image = HdrView::new(viewports[eye].projection.mapping(), &light).unwrap().turned(turn);
        let errors = stars.iter().map(|(direction, magnitude)| {
            let expected = illuminance_lx_from_magnitude(f64::from(*magnitude));
            let found = metrics::illuminance_near_direction_lx(&[image], *direction, 0.08).unwrap();
            (found / expected - 1.0).abs()
        });
        errors.fold(0.0, f64::max)
    };
    for eye in 0..2 {
        let error = worst(eye, 0.0);
        println!("eye {eye}: greatest error of the light of {} stars {error:.1e}", stars.len());
        assert!(error < 1e-3, "{error}");
        let turned = worst(eye, 0.08);
        assert!(turned > 0.1, "a rotated eye must not have the same image: {turned}");
    }
}

#[test]
fn a_shifted_eye_is_detected() {
    let mut renderer = renderer();
    let settings = settings(StarMethod::Auto);
    let reference = rendered(&mut renderer, &sky(0.0), &settings, Some(-8.0));
    let (_, textures) = presented(&mut renderer, &sky(0.003), &settings, Some(-8.0), BYTES);
    let (_, light_textures) = presented(&mut renderer, &sky(0.003), &settings, Some(-8.0), HALVES);
    for (eye, image) in reference.images.iter().enumerate() {
        assert!(texels(renderer.gpu(), &textures[eye]) != *image.display.as_ref().unwrap());
        let light = light_of(renderer.gpu(), &light_textures[eye]);
        assert!(halves_off(&light, image, &settings.tone_map, -8.0) > 100);
    }
}

#[test]
fn submitted_and_finished_frames_match_rendered_frames_in_any_order() {
    let mut renderer = renderer();
    let (rig, settings) = (headset(), exact_settings());
    let wanted = Wanted::both();
    let scenes = [sky(0.0), sky(1.0), scene(Vec::new()), sky(2.0)];
    let expected: Vec<Frame> = scenes
        .iter()
        .map(|scene| renderer.render(FrameRequest::new(scene, &rig).settings(&settings).wanted(wanted)).unwrap())
        .collect();
    let same = |frame: &Frame, expected: &Frame| {
        assert_eq!(frame.exposure_ev100, expected.exposure_ev100);
        let drawn = |frame: &Frame| -> Vec<u64> { frame.views.iter().map(|view| view.stars_drawn).collect() };
        assert_eq!(drawn(frame), drawn(expected));
        for (image, expected) in frame.images.iter().zip(&expected.images) {
            assert!(image.display == expected.display && image.hdr == expected.hdr);
        }
    };
    for (index, scene) in scenes.iter().enumerate() {
        renderer.hold(scene, &settings).unwrap();
        let submitted = renderer.submit(FrameRequest::new(scene, &rig).settings(&settings).wanted(wanted)).unwrap();
        let frame = renderer.finish(submitted).unwrap();
        assert_eq!(frame.number, (expected.len() + index + 1) as u64);
        same(&frame, &expected[index]);
    }
    let submit = |renderer: &mut Renderer, index: usize| {
        renderer.submit(FrameRequest::new(&scenes[index], &rig).settings(&settings).wanted(wanted)).unwrap()
    };
    // Two frames are in flight. They can be finished in any order, and a call of `hold` for a scene does not disturb them.
    let [first, second] = [1, 3].map(|index| submit(&mut renderer, index));
    renderer.hold(&scenes[0], &settings).unwrap();
    same(&renderer.finish(first).unwrap(), &expected[1]);
    let third = submit(&mut renderer, 0);
    same(&renderer.finish(third).unwrap(), &expected[0]);
    same(&renderer.finish(second).unwrap(), &expected[3]);
    // A frame that is dropped is discarded. A frame cannot be finished any more after two newer ones were submitted.
    drop(submit(&mut renderer, 0));
    let [overtaken, second, third] = [1, 3, 0].map(|index| submit(&mut renderer, index));
    assert!(matches!(renderer.finish(overtaken), Err(RenderError::Abandoned)));
    same(&renderer.finish(second).unwrap(), &expected[3]);
    same(&renderer.finish(third).unwrap(), &expected[0]);
    same(
        &renderer.render(FrameRequest::new(&scenes[0], &rig).settings(&settings).wanted(wanted)).unwrap(),
        &expected[0],
    );
    // A request that is refused before submission does not affect the frame in flight. A renderer does not accept a frame of another renderer.
    let submitted = renderer.submit(FrameRequest::new(&scenes[1], &rig).settings(&settings).wanted(wanted)).unwrap();
    let refused = renderer.submit(FrameRequest::new(&scenes[1], &rig).settings(&settings).wanted_per_view(&[])).err();
    assert!(matches!(refused, Some(RenderError::WantedCount { given: 0, views: 1 })));
    let mut other = self::renderer();
    let foreign = other.submit(FrameRequest::new(&scenes[0], &rig).settings(&settings).wanted(wanted)).unwrap();
    assert!(matches!(renderer.finish(foreign), Err(RenderError::Abandoned)));
    same(&renderer.finish(submitted).unwrap(), &expected[1]);
}

#[test]
fn unsupported_textures_are_refused_with_a_specific_message() {
    let mut renderer = renderer();
    let (scene, rig, settings) = (sky(0.0), headset(), settings(StarMethod::Auto));
    let mut refused = |viewport: usize, size: [u32; 2], format: wgpu::TextureFormat| {
        let (_texture, view) = target(renderer.gpu(), size, format);
        let presentations = [Presentation { viewport, target: &view, format }];
        renderer
            .submit(
                FrameRequest::new(&scene, &rig)
                    .settings(&settings)
                    .wanted(Wanted::default())
                    .presentations(&presentations),
            )
            .err()
            .unwrap()
            .to_string()
    };
    let message = refused(0, SIZES[0], wgpu::TextureFormat::Rgba8Unorm);
    for part in ["`headset`", "Rgba8Unorm;", "Rgba8UnormSrgb", "Bgra8UnormSrgb", "Rgba16Float"] {
        assert!(message.contains(part), "{message}");
    }
    let message = refused(0, SIZES[1], BYTES);
    assert!(message.contains("96 x 84") && message.contains("72 x 64"), "{message}");
    let message = refused(2, SIZES[0], BYTES);
    assert!(message.contains("image 2") && message.contains("2 images"), "{message}");
    // The driver rejects a declared format that differs from the actual one. The error affects only that frame.
    let (_texture, view) = target(renderer.gpu(), SIZES[0], BYTES);
    let presentations = [Presentation { viewport: 0, target: &view, format: HALVES }];
    // A frame that is still being drawn is not affected.
    let request = FrameRequest::new(&scene, &rig).settings(&settings);
    let before = renderer.submit(request).unwrap();
    let refused = renderer.submit(request.wanted(Wanted::default()).presentations(&presentations));
    assert!(matches!(refused, Err(RenderError::Gpu(_))));
    let before = renderer.finish(before).unwrap();
    let after = rendered(&mut renderer, &scene, &settings, None);
    assert!(before.images.iter().zip(&after.images).all(|(before, after)| before.display == after.display));
}

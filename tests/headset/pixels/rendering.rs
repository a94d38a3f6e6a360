//! Compares the images in the swapchains with the frames that the host receives, and with the images that `render`
//! draws for the same eyes with this machine's driver.

use glam::{DQuat, Quat};
use steradian::{
    gpu::{Gpu, GpuOptions},
    photometry::{
        exposure::white_luminance_cd_m2,
        tone_map::{ToneMapSettings, linear_from_srgb},
    },
    plan::settings::{RenderSettings, SwapchainFormat, SwapchainLayout},
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::Eye,
    xr::CapturedPixels,
};

use super::shots::{Assignment, Shot, canted_eyes, head, rig, settings, take};
use crate::{
    figures,
    monado::{Monado, Service},
};

/// Bright stars with glare, metered exposure, a filmic curve and dither.
const NIGHT: &str = r#"
[exposure]
metering = "mean"
adaptation_s = 0.0
[accuracy]
# With this, images are the same whether or not light for a host is drawn with them.
display_codes = 0.0
[tone_map]
# At other exposures and with the shift of hue a channel in ten thousand falls on the other half float.
desaturation = 0.0
"#;

/// Asteroids in front of Mars in sunlight. Their impostors are coarse, so that they are baked quickly.
const DAY: &str = r#"
[scene.camera]
position_m = [227895500000.0, 7794228.6, 0.0]
orientation = [0.1830127, -0.6830127, -0.6830127, 0.1830127]
[[bodies]]
name = "sun"
preset = "sun"
[[bodies]]
name = "mars"
preset = "mars"
position_m = [227900000000.0, 0.0, 0.0]
[[asteroid_fields]]
name = "swarm"
position_m = [227895512500.0, 7772578.0, 0.0]
instances = 400
seed = 7
shape = "box"
size_m = [60000.0, 30000.0, 20000.0]
radius_m = [150.0, 1200.0]
size_index = 1.8
spin_period_s = [600.0, 36000.0]
geometric_albedo = [0.11, 0.1, 0.085]
law = "lommel_seeliger"
shape_seed = 3
[asteroids]
tiles = 8
[exposure]
adaptation_s = 0.0
[tone_map]
# At other exposures and with the shift of hue a channel in ten thousand falls on the other half float.
desaturation = 0.0
"#;

/// Allowed difference of bytes, in codes, and allowed share of differing bytes. Bytes differ because two drivers round
/// differently. Monado draws with a software driver. If `render` uses one too, bytes are identical, and one channel in
/// many thousands is rounded to the next half float, which differs by 1e-9 of white ([`figures::HEADSET_PIXELS`]).
const CODES: u8 = 1;
const SHARE: f64 = 0.01;
/// Allowed difference of linear light in excess of the rounding to half floats, as a share of display white.
const LIGHT: f64 = 1e-3;
/// Allowed difference of exposures, EV.
const EXPOSURE_EV: f64 = 1e-4;

/// Difference between an image and the expected one.
#[derive(Clone, Copy, Debug)]
struct Difference {
    /// Largest difference, in codes or as a share of display white.
    most: f64,
    /// Share of differing channels. For linear light, only differences in excess of the rounding to half floats count.
    share: f64,
}

impl Difference {
    fn from_values(differences: impl ExactSizeIterator<Item = f64>) -> Self {
        let count = differences.len();
        let (most, different) =
            differences.fold((0.0_f64, 0), |(most, different), d| (most.max(d), different + usize::from(d > 0.0)));
        Self { most, share: different as f64 / count as f64 }
    }

    fn is_small(&self, format: SwapchainFormat) -> bool {
        let limit = if format == SwapchainFormat::Rgba16f { LIGHT } else { f64::from(CODES) };
        self.most <= limit && self.share <= SHARE
    }
}

/// Compares an eye's image with a frame.
fn difference(
    shot: &Shot,
    eye: usize,
    display: &[u8],
    hdr: &[[f32; 4]],
    ev100: f64,
    tone_map: &ToneMapSettings,
) -> Difference {
    match &shot.images[eye].pixels {
        CapturedPixels::Srgb8(captured) => {
            let captured = captured.as_flattened();
            assert_eq!(captured.len(), display.len());
            Difference::from_values(captured.iter().zip(display).map(|(a, b)| f64::from(a.abs_diff(*b))))
        }
        CapturedPixels::Linear(captured) => {
            assert_eq!(captured.len(), hdr.len());
            let white = white_luminance_cd_m2(ev100);
            let expected_light =
                |[r, g, b, _]: [f32; 4]| tone_map.display_rgb([r, g, b].map(f64::from), white).map(linear_from_srgb);
            let beyond_rounding = |(captured, hdr): (&[f32; 4], &[f32; 4])| {
                assert_eq!(captured[3].to_bits(), 1_f32.to_bits(), "alpha");
                let differences = captured.iter().zip(expected_light(*hdr)).map(|(captured, expected)| {
                    let rounding = expected.max(2_f64.powi(-14)) * 2_f64.powi(-11);
                    ((f64::from(*captured) - expected).abs() - rounding).max(0.0)
                });
                differences.fold(0.0, f64::max)
            };
            Difference::from_values(captured.iter().zip(hdr).map(beyond_rounding))
        }
    }
}

fn difference_from_frame(
    shot: &Shot,
    eye: usize,
    frame: &Frame,
    index: usize,
    tone_map: &ToneMapSettings,
) -> Difference {
    let image = &frame.images[index];
    let (display, hdr) = (image.display.as_ref().unwrap(), image.hdr.as_ref().unwrap());
    difference(shot, eye, display, hdr, frame.exposure_ev100, tone_map)
}

fn render(renderer: &mut Renderer, scene: &(SceneSnapshot, RenderSettings), eyes: [Eye; 2]) -> Frame {
    // Render both images in one frame, like the mirror of a headset.
    let rig = rig(eyes);
    let request = FrameRequest::new(&scene.0, &rig).settings(&scene.1).wanted(Wanted::both());
    let submitted = renderer.submit(request).unwrap();
    renderer.finish(submitted).unwrap()
}

/// Returns the same eyes turned by a tenth of a degree.
fn turned(eyes: [Eye; 2]) -> [Eye; 2] {
    let turn = DQuat::from_rotation_y(0.1_f64.to_radians());
    eyes.map(|eye| Eye { room_from_eye: turn * eye.room_from_eye, ..eye })
}

/// A scene and its expected frames.
struct Expected {
    name: &'static str,
    assignment: Assignment,
    scene: (SceneSnapshot, RenderSettings),
    /// The eyes, the expected frame for them, and the frame for a slightly turned head.
    frames: Option<([Eye; 2], (Frame, Frame))>,
}

impl Expected {
    fn new(name: &'static str, orientation: Quat, scene: &str) -> Self {
        let assignment = Assignment::new(head(orientation, canted_eyes()), scene).mirrored();
        let scene = assignment.load();
        Self { name, assignment, scene, frames: None }
    }

    /// Returns the expected frame, and the frame for a slightly turned head. Both are rendered only once.
    fn frames(&mut self, renderer: &mut Renderer, eyes: [Eye; 2]) -> &(Frame, Frame) {
        let (known_eyes, frames) = self.frames.get_or_insert_with(|| {
            (eyes, (render(renderer, &self.scene, eyes), render(renderer, &self.scene, turned(eyes))))
        });
        assert_eq!(*known_eyes, eyes, "the runtime must give the same poses in every session");
        frames
    }
}

/// Tests every format in every layout of swapchains, by day and by night; also tests that the host and the runtime get
/// the same images.
pub fn pixels_are_those_of_render(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
    println!("render draws with {}", renderer.adapter().driver);
    let both_by_software = renderer.adapter().device_type == "Cpu";
    let mut share = figures::HEADSET_PIXELS.worst();
    let looking = Quat::from_rotation_y(0.2) * Quat::from_rotation_x(-0.1);
    let mut scenes = [Expected::new("night", Quat::from_rotation_z(0.2), NIGHT), Expected::new("day", looking, DAY)];
    for (format, layout, count) in [
        (SwapchainFormat::Rgba8Srgb, SwapchainLayout::Array, 2),
        (SwapchainFormat::Bgra8Srgb, SwapchainLayout::Two, 1),
        (SwapchainFormat::Rgba16f, SwapchainLayout::Auto, 1),
    ] {
        let order = scenes[..count].iter().map(|scene| scene.assignment.clone()).collect();
        let shots = take(&service, settings(format, layout, 1.0), order);
        for (shot, scene) in shots.iter().zip(&mut scenes) {
            let (name, tone_map) = (scene.name, scene.scene.1.tone_map);
            let (expected, wrong) = scene.frames(&mut renderer, shot.eyes);
            let (mirrored_ev100, mirrors) = shot.mirror.as_ref().unwrap();
            let exposures_apart_ev = (mirrored_ev100 - expected.exposure_ev100).abs();
            assert!(exposures_apart_ev <= EXPOSURE_EV, "{exposures_apart_ev}");
            println!(
                "{name} in {format:?}, {layout:?}: exposure {:.4} EV, difference {exposures_apart_ev:.1e} EV; {:?}",
                expected.exposure_ev100, expected.views[0].asteroids
            );
            for eye in [0, 1] {
                let of_render = difference_from_frame(shot, eye, expected, eye, &tone_map);
                let of_mirror =
                    difference(shot, eye, &mirrors[eye].display, &mirrors[eye].hdr, *mirrored_ev100, &tone_map);
                let of_turned = difference_from_frame(shot, eye, wrong, eye, &tone_map);
                let of_other_eye = difference_from_frame(shot, eye, expected, 1 - eye, &tone_map);
                println!(
                    "    eye {eye}, from render's pixels {}; from the host's {}; from those of a head turned by 0.1 degrees {}; \
                     from the other eye's {}",
                    described(of_render, format),
                    described(of_mirror, format),
                    described(of_turned, format),
                    described(of_other_eye, format),
                );
                assert!(of_render.is_small(format) && of_mirror.is_small(format));
                if both_by_software {
                    share.add(of_render.share, format_args!("{name} in {format:?}, eye {eye}"));
                }
                if format != SwapchainFormat::Rgba16f {
                    assert_eq!(of_mirror.most, 0.0, "the host must get the bytes that the runtime gets");
                }
                assert!(!of_turned.is_small(format) && !of_other_eye.is_small(format), "wrong images must be detected");
            }
        }
    }
    println!("(only differences of light in excess of the rounding to half floats count)");
    if both_by_software {
        share.print();
    }
}

fn described(difference: Difference, format: SwapchainFormat) -> String {
    let Difference { most, share } = difference;
    let share = 100.0 * share;
    if format == SwapchainFormat::Rgba16f {
        format!("at most {most:.1e} of white, {share:.2} % of the pixels")
    } else {
        format!("at most {most} codes, {share:.2} % of the bytes")
    }
}

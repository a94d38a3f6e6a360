//! Light shared by both eyes: the exposure, and the glare around a star at infinity.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3, EulerRot, Quat};
use steradian::{
    catalogue::bright::named_bright_stars,
    gpu::{Gpu, GpuOptions},
    photometry::{exposure::white_luminance_cd_m2, rec709::luminance},
    plan::settings::{GlareSettings, SwapchainFormat, SwapchainLayout},
    render::{FrameRequest, Renderer, Wanted},
    units::illuminance_lx_from_magnitude,
    view::{
        Eye, Rig, View, ViewKind,
        projection::{PlaneMapping, pixel_centre},
    },
};

use super::shots::{Assignment, Shot, canted_eyes, head, mapping, rig, sent_eyes, settings, take};
use crate::{
    figures,
    monado::{Monado, Service},
};

/// Largest allowed relative difference between the factors from light to display.
const EXPOSURE_LIMIT: f64 = 1e-4;
/// Largest allowed relative difference between the glare and the kernel.
const KERNEL_LIMIT: f64 = 0.02;

/// Computes the ratio of displayed light to scene light in an eye's image, in units of the factor that the exposure
/// gives. Returns its mean, and its relative variation over the pixels that are bright enough for half floats.
fn factors(shot: &Shot, eye: usize, ev100: f64) -> [f64; 2] {
    let (_, mirrors) = shot.mirror.as_ref().unwrap();
    let mut sums = [0.0; 2];
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for (displayed, light) in shot.linear(eye).iter().zip(&mirrors[eye].hdr) {
        for (displayed, light) in displayed.iter().zip(light).take(3) {
            // Use only values that are neither clipped nor half floats with reduced precision.
            if (1e-3..0.99).contains(displayed) {
                let factor = f64::from(*displayed) / f64::from(*light) * white_luminance_cd_m2(ev100);
                (least, most) = (least.min(factor), most.max(factor));
                sums[0] += f64::from(*displayed);
                sums[1] += f64::from(*light) / white_luminance_cd_m2(ev100);
            }
        }
    }
    assert!(least.is_finite(), "some pixels are bright enough");
    // Half a unit in the last place of a half float is at most 2^-11 of its value.
    assert!(most / least - 1.0 < 2.0 * 2_f64.powi(-11) + EXPOSURE_LIMIT, "{least} {most}");
    [sums[0] / sums[1], most / least - 1.0]
}

/// Returns the exposure that the meter would read for one eye alone, EV.
fn alone_ev100(renderer: &mut Renderer, assignment: &Assignment, eye: &Eye) -> f64 {
    let (scene, settings) = assignment.load();
    let kind = ViewKind::OffAxis { size: eye.size, fov: eye.fov };
    let rig = Rig::new(vec![View::new("eye", kind, eye.room_from_eye, eye.position_m).unwrap()]).unwrap();
    renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr())).unwrap().exposure_ev100
}

/// The exposure is metered over both eyes, which see different parts of the sky, and used for both.
pub fn both_eyes_have_one_exposure(monado: &'static Monado) {
    let service = Service::remote(monado);
    let scene = "[exposure]\nmetering = \"mean\"\nadaptation_s = 0.0\ncompensation_ev = 6.0\n[tone_map]\noperator = \"srgb\"\ndesaturation = 0.0\n";
    let state = head(Quat::from_euler(EulerRot::YXZ, 1.9, -0.2, 0.4), canted_eyes());
    let assignment = Assignment::new(state, scene).mirrored();
    let settings = settings(SwapchainFormat::Rgba16f, SwapchainLayout::Auto, 1.0);
    let shot = take(&service, settings, vec![assignment.clone()]).remove(0);
    let (ev100, _) = *shot.mirror.as_ref().unwrap();
    let [left, right] = [0, 1].map(|eye| factors(&shot, eye, ev100));
    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
    let alone = [0, 1].map(|eye| alone_ev100(&mut renderer, &assignment, &shot.eyes[eye]));
    println!(
        "exposure {ev100:.4} EV: factor from light to display, relative to the exposure, {:.6} and {:.6}, apart by {:.1e}; \
         pixels spread by {:.1e} and {:.1e}; metered by one eye alone it would be {:.4} and {:.4} EV",
        left[0],
        right[0],
        (left[0] / right[0] - 1.0).abs(),
        left[1],
        right[1],
        alone[0],
        alone[1],
    );
    assert!((left[0] / right[0] - 1.0).abs() < EXPOSURE_LIMIT && (left[0] - 1.0).abs() < EXPOSURE_LIMIT);
    // The comparison would detect separate exposures of the eyes.
    assert!(((alone[0] - alone[1]).exp2() - 1.0).abs() > 10.0 * EXPOSURE_LIMIT);
}

/// Returns the luminance of the glare in a direction, in units of display white, interpolated between the four
/// surrounding pixels. The interpolated quantity is the luminance times the square of the angle from the star, which
/// varies little.
fn glare_at(
    image: &[[f32; 4]],
    mapping: &dyn PlaneMapping,
    room_from_eye: DQuat,
    star: DVec3,
    direction: DVec3,
) -> f64 {
    let position = mapping.pixel_from_direction(room_from_eye.conjugate() * direction).unwrap() - 0.5;
    let corner = position.floor();
    let share = position - corner;
    let mut sum = 0.0;
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (x, y) = (corner.x as u32 + i, corner.y as u32 + j);
        let centre = room_from_eye * mapping.direction_from_pixel(pixel_centre(x, y)).unwrap();
        let [r, g, b, _] = image[(y * mapping.size()[0] + x) as usize].map(f64::from);
        let weight =
            DVec2::new(if i == 1 { share.x } else { 1.0 - share.x }, if j == 1 { share.y } else { 1.0 - share.y });
        sum += weight.element_product() * luminance([r, g, b]) * centre.angle_between(star).powi(2);
    }
    sum / direction.angle_between(star).powi(2)
}

/// Largest and mean relative difference between the glare in both eyes, in the same directions, and the largest
/// relative difference between the glare and the kernel.
struct GlareDifference {
    between_eyes: f64,
    mean: f64,
    from_kernel: f64,
    samples: usize,
}

fn compare_glare(shot: &Shot, eyes: &[Eye; 2], star: DVec3, expected: impl Fn(f64) -> f64) -> GlareDifference {
    let rig = rig(*eyes);
    let (across, up) = star.any_orthonormal_pair();
    let (mut between_eyes, mut sum, mut from_kernel, mut samples) = (0.0_f64, 0.0, 0.0_f64, 0);
    for ring in 0..=14 {
        let angle = f64::to_radians(1.0 + 0.5 * f64::from(ring));
        for position in 0..24 {
            let (sin, cos) = (f64::from(position) / 24.0 * TAU).sin_cos();
            let direction = star * angle.cos() + (across * cos + up * sin) * angle.sin();
            let [left, right] = [0, 1]
                .map(|eye| glare_at(shot.linear(eye), mapping(&rig, eye), eyes[eye].room_from_eye, star, direction));
            let difference = (left / right - 1.0).abs();
            between_eyes = between_eyes.max(difference);
            sum += difference;
            for luminance in [left, right] {
                from_kernel = from_kernel.max((luminance / expected(angle) - 1.0).abs());
            }
            samples += 1;
        }
    }
    GlareDifference { between_eyes, mean: sum / f64::from(samples), from_kernel, samples: samples as usize }
}

/// Compares the glare on rings of 1 to 8 degrees around Sirius, for eyes with different axes and fields of view.
pub fn glare_is_the_same_around_a_star_for_both_eyes(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut between_eyes = figures::HEADSET_VEIL.worst();
    let ev100 = -12.5;
    let scene = format!(
        "[stars]\nmagnitude_limit = -1.0\n[exposure]\nmode = \"manual\"\nev100 = {ev100:?}\n[tone_map]\noperator = \"srgb\"\ndesaturation = 0.0\n"
    );
    // Use the position at the default time, 2026-01-01: Sirius has moved by 35 arcsec since J2000.0.
    let sirius = named_bright_stars(26.0).into_iter().find(|star| star.name == "Sirius").unwrap().star;
    let star = sirius.position.normalize();
    // The star is off the axes of both eyes, and the head is rolled.
    let ahead = Quat::from_rotation_arc(glam::Vec3::NEG_Z, star.as_vec3());
    let states = [(0.1, -0.08, 0.35), (-0.12, 0.15, -0.8)]
        .map(|(yaw, pitch, roll)| head(ahead * Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll), canted_eyes()));
    let assignments = states.map(|state| Assignment::new(state, &scene)).to_vec();
    let shots = take(&service, settings(SwapchainFormat::Rgba16f, SwapchainLayout::Two, 2.0), assignments);
    let glare = GlareSettings::default();
    let kernel = glare.kernel().unwrap();
    let scattered_lx = illuminance_lx_from_magnitude(sirius.apparent_magnitude()) * glare.fraction_scattered();
    let expected = |angle: f64| scattered_lx * kernel.per_sr(angle) / white_luminance_cd_m2(ev100);
    for (shot, state) in shots.iter().zip(&states) {
        let eyes = sent_eyes(state, [shot.images[0].size, shot.images[1].size]);
        let found = compare_glare(shot, &eyes, star, expected);
        let mut wrong = eyes;
        wrong[1].fov.right_rad *= 1.005;
        let of_wrong = compare_glare(shot, &wrong, star, expected);
        println!(
            "{} directions: the eyes differ by {:.2} % at most, {:.3} % in the mean, and from the kernel by {:.1} % at most; \
             with half a per cent more of field of view by {:.1} %",
            found.samples,
            100.0 * found.between_eyes,
            100.0 * found.mean,
            100.0 * found.from_kernel,
            100.0 * of_wrong.between_eyes,
        );
        between_eyes.add(found.between_eyes, format_args!("{} directions", found.samples));
        assert!(found.from_kernel <= KERNEL_LIMIT);
        assert!(!figures::HEADSET_VEIL.holds(of_wrong.between_eyes));
    }
    between_eyes.print();
}

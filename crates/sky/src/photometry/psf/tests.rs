//! Physics of diffraction, compared with closed forms and published figures.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::*;
use crate::photometry::blackbody::rec709_at_unit_luminance;

const DIAMETER_MM: f64 = 2.0;
const GREEN_M: f64 = 550e-9;

/// A picture in light of one wavelength, with pixels of `pixel_rad`.
fn monochromatic(aperture: Aperture, wavelength_m: f64, size: u32, pixel_rad: f64) -> Psf {
    let sampling = diffraction::Sampling::new(size as usize, pixel_rad, 1e-3 * DIAMETER_MM, wavelength_m)
        .expect("a fine sampling");
    let share = diffraction::monochromatic(aperture, 1e-3 * DIAMETER_MM, wavelength_m, &sampling);
    let covered = share.iter().sum();
    Psf::normalised(size, pixel_rad, share.into_iter().map(|value| [value; 3]).collect(), covered)
}

fn fringe_rad() -> f64 {
    GREEN_M / (1e-3 * DIAMETER_MM)
}

fn green(aperture: Aperture, size: u32, fraction: f64) -> Psf {
    monochromatic(aperture, GREEN_M, size, fraction * fringe_rad())
}

/// Density (Y) averaged over a circle around the star.
fn ring_mean(psf: &Psf, radius_rad: f64) -> f64 {
    (0..360).map(|k| luminance(psf.sample(DVec2::from_angle(f64::from(k) / 360.0 * TAU) * radius_rad))).sum::<f64>()
        / 360.0
}

/// Radius of the first minimum of the ring mean, in units of lambda / D.
fn first_dark_ring(psf: &Psf) -> f64 {
    let radii: Vec<f64> = (50..250).map(|i| f64::from(i) * 0.01).collect();
    let means: Vec<f64> = radii.iter().map(|r| ring_mean(psf, r * fringe_rad())).collect();
    let index =
        (1..radii.len() - 1).find(|&i| means[i] < means[i - 1] && means[i] <= means[i + 1]).expect("a dark ring");
    radii[index]
}

/// Density (Y) times the square of the distance, `r` in units of lambda / D.
fn ring_share(psf: &Psf, direction: DVec2, r: f64) -> f64 {
    luminance(psf.sample(direction * r * fringe_rad())) * r * r
}

fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / logs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}

/// Log-log slope of the density in a direction (a mean over some degrees and fringes) from 8 to 48 lambda / D.
fn spike_slope(psf: &Psf, angle: f64) -> f64 {
    let points: Vec<(f64, f64)> = (0..10)
        .map(|band| {
            let (low, high) = (8.0 * 1.2_f64.powi(band), 8.0 * 1.2_f64.powi(band + 1));
            // On the axis itself: mean over radii of the band.
            let mean = (0..200)
                .map(|i| low + (high - low) * (f64::from(i) + 0.5) / 200.0)
                .map(|r| luminance(psf.sample(DVec2::from_angle(angle) * r * fringe_rad())))
                .sum::<f64>()
                / 200.0;
            ((low * high).sqrt(), mean)
        })
        .collect();
    slope(&points)
}

/// Directions in which the mean over radii from 8 to 40 lambda / D is a maximum and twice the median, degrees.
fn spikes(psf: &Psf) -> Vec<u32> {
    let mean = |degrees: u32| -> f64 {
        let direction = DVec2::from_angle(f64::from(degrees).to_radians());
        (0..400).map(|i| 8.0 + f64::from(i) * 0.08).map(|r| ring_share(psf, direction, r)).sum()
    };
    let values: Vec<f64> = (0..360).map(mean).collect();
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    (0..360)
        .filter(|&i| {
            let near = (1..=10).all(|d| values[i] >= values[(i + d) % 360] && values[i] >= values[(i + 360 - d) % 360]);
            near && values[i] > 2.0 * sorted[180]
        })
        .map(|i| i as u32)
        .collect()
}

/// Largest difference of the densities from Airy's (2 J1(x) / x)^2 within 4 lambda / D, relative to the peak.
fn airy_error(psf: &Psf, wavelength_m: f64) -> f64 {
    // J1 by its integral, with the midpoint rule, which is exact for periodic functions.
    let j1 = |x: f64| {
        (0..200).map(|i| (f64::from(i) + 0.5) / 200.0 * PI).map(|t| (t - x * t.sin()).cos()).sum::<f64>() / 200.0
    };
    let (diameter_m, area_m2) = (1e-3 * DIAMETER_MM, 0.25 * PI * (1e-3 * DIAMETER_MM).powi(2));
    let peak = area_m2 / wavelength_m.powi(2);
    psf.places()
        .filter(|(offset, _)| offset.length() < 4.0 * wavelength_m / diameter_m)
        .map(|(offset, rgb)| {
            let x = PI * diameter_m * offset.length() / wavelength_m;
            let airy = if x == 0.0 { 1.0 } else { (2.0 * j1(x) / x).powi(2) };
            (luminance(rgb) * psf.covered / psf.pixel_rad.powi(2) / peak - airy).abs()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_circle_gives_the_airy_pattern() {
    let psf = green(Aperture::Circle, 256, 0.125);
    let ring = first_dark_ring(&psf);
    let inside = psf.encircled_energy(1.219_67 * fringe_rad()) * psf.covered;
    let error = airy_error(&psf, GREEN_M);
    println!(
        "first dark ring {ring:.3} lambda/D, light in it {inside:.4}, covered {:.4}, density {error:.1e}",
        psf.covered
    );
    assert!((ring - 1.22).abs() < 0.0122, "{ring}");
    assert!((inside - 0.8378).abs() < 2e-3, "{inside}");
    assert!(error < 2e-3, "{error}");
    // The light outside radius r is 2 / (pi^2 r) if r, in units of lambda / D, is much greater than 1. Within 16 lambda
    // / D there is 0.98733 of the light.
    let wide = psf.encircled_energy(15.9 * fringe_rad()) * psf.covered;
    println!("light within 15.9 lambda/D {wide:.5}, asymptotically {:.5}", 1.0 - 2.0 / (PI * PI * 15.9));
    assert!((wide - (1.0 - 2.0 / (PI * PI * 15.9))).abs() < 2e-3, "{wide}");
}

#[test]
fn other_apertures_and_wavelengths_fail_the_airy_comparison() {
    let hexagon = green(Aperture::Hexagon, 256, 0.125);
    assert!(airy_error(&hexagon, GREEN_M) > 0.02);
    assert!((first_dark_ring(&hexagon) - 1.22).abs() > 0.0122);
    // Near a dark ring the encircled energy is almost constant. A small change of the wavelength would pass this test.
    let blue = monochromatic(Aperture::Circle, 420e-9, 256, 0.125 * fringe_rad());
    assert!((first_dark_ring(&blue) - 1.22).abs() > 0.0122);
    assert!((blue.encircled_energy(1.219_67 * fringe_rad()) * blue.covered - 0.8378).abs() > 2e-3);
    assert!(airy_error(&blue, GREEN_M) > 0.02);
    assert!((hexagon.encircled_energy(1.219_67 * fringe_rad()) * hexagon.covered - 0.8378).abs() > 2e-3);
}

#[test]
fn odd_sizes_and_wide_pixels_give_the_same_light() {
    let fine = green(Aperture::Circle, 240, 0.125);
    for (size, fraction) in [(81, 0.375), (60, 0.5), (40, 0.75), (30, 1.0)] {
        let other = green(Aperture::Circle, size, fraction);
        let half = fine.half_width_rad().min(other.half_width_rad()) * 0.8;
        let (a, b) = (fine.encircled_energy(half) * fine.covered, other.encircled_energy(half) * other.covered);
        println!(
            "{size} pixels of {fraction} lambda/D: {b:.5} against {a:.5} within {:.2} lambda/D",
            half / fringe_rad()
        );
        assert!((a - b).abs() < 2e-3, "{size} {fraction}: {a} {b}");
        let sum = other.sum();
        assert!((luminance(sum) - 1.0).abs() < 1e-5, "{sum:?}");
    }
}

#[test]
fn the_picture_grows_with_the_wavelength() {
    // Measured in units of lambda / D, the green and the red picture must be the same.
    let green = monochromatic(Aperture::Hexagon, GREEN_M, 256, 0.125 * fringe_rad());
    let red = monochromatic(Aperture::Hexagon, 700e-9, 256, 0.125 * fringe_rad());
    let difference = |scale: f64| -> f64 {
        (0..64)
            .map(|i| DVec2::from_angle(f64::from(i)) * f64::from(i) * 0.04 * fringe_rad())
            .map(|offset| {
                let (a, b) = (luminance(green.sample(offset)), luminance(red.sample(offset * scale)) * scale * scale);
                (a * green.covered - b * red.covered).abs()
            })
            .fold(0.0, f64::max)
            / luminance(green.sample(DVec2::ZERO))
    };
    let (right, wrong) = (difference(700.0 / 550.0), difference(1.0));
    println!("largest difference scaled {right:.4}, not scaled {wrong:.4}");
    assert!(right < 0.02, "{right}");
    assert!(wrong > 0.2, "{wrong}");
}

#[test]
fn spikes_are_perpendicular_to_the_edges() {
    let hexagon = spikes(&green(Aperture::Hexagon, 400, 0.25));
    println!("spikes of the hexagon at {hexagon:?} degrees");
    // Perpendicular to the sides.
    assert_eq!(hexagon, [30, 90, 150, 210, 270, 330]);
    assert_eq!(spikes(&green(Aperture::Circle, 400, 0.25)), Vec::<u32>::new());
    let hubble = spikes(&green(Aperture::Hubble, 400, 0.25));
    println!("spikes of the Hubble-like aperture at {hubble:?} degrees");
    assert_eq!(hubble, [45, 135, 225, 315]);
    let jwst = spikes(&green(Aperture::Jwst, 400, 0.25));
    println!("spikes of the JWST-like aperture at {jwst:?} degrees");
    // Six from the segments' edges and two from the vertical strut.
    for degrees in [0, 30, 90, 150, 180, 210, 270, 330] {
        assert!(jwst.contains(&degrees), "{degrees} in {jwst:?}");
    }
    // Curved edges spread their spikes: their contrast is between that of a circle and that of straight edges.
    let contrast = |aperture: Aperture| {
        let psf = green(aperture, 400, 0.25);
        let density = |degrees: f64| {
            let direction = DVec2::from_angle(degrees.to_radians());
            (0..400).map(|i| 8.0 + f64::from(i) * 0.08).map(|r| ring_share(&psf, direction, r)).sum::<f64>()
        };
        density(90.0) / density(60.0)
    };
    let [circle, blades, straight] =
        [Aperture::Circle, Aperture::CurvedBlades { blades: 6 }, Aperture::Hexagon].map(contrast);
    println!(
        "ratio of the density towards an edge to that towards a corner: circle {circle:.2}, curved blades {blades:.2}, hexagon {straight:.1}"
    );
    assert!((circle - 1.0).abs() < 0.05 && blades > 1.5 && blades < 0.2 * straight);
}

#[test]
fn spikes_fall_off_as_the_inverse_square_and_rings_as_the_cube() {
    let hexagon = green(Aperture::Hexagon, 480, 0.25);
    let circle = green(Aperture::Circle, 480, 0.25);
    let (spike, ring) = (spike_slope(&hexagon, FRAC_PI_2), spike_slope(&circle, FRAC_PI_2));
    let between = spike_slope(&hexagon, 0.0);
    println!("slope of a hexagon's spike {spike:.3}, between its spikes {between:.3}, of a circle {ring:.3}");
    assert!((spike + 2.0).abs() < 0.05, "{spike}");
    assert!((ring + 3.0).abs() < 0.1, "{ring}");
    assert!(between < -3.5, "{between}");
}

fn coloured(aperture: Aperture, size: u32, wavelengths: usize, temperature_k: f64) -> Psf {
    let pixel_rad = Optics::fine_pixel_rad(DIAMETER_MM);
    let optics = Optics { aperture, diameter_mm: DIAMETER_MM, size, pixel_rad, wavelengths, temperature_k };
    Psf::from_aperture(&optics, |_, _| {}).expect("valid optics")
}

#[test]
fn colours_sum_to_the_star_and_blue_is_narrower_than_red() {
    let psf = coloured(Aperture::Circle, 128, 32, 5772.0);
    let (sum, star) = (psf.sum(), rec709_at_unit_luminance(5772.0));
    println!("covered {:.4}, sums {sum:.4?}, star {star:.4?}", psf.covered);
    assert!((luminance(sum) - 1.0).abs() < 1e-5);
    assert!((0..3).all(|c| (sum[c] / star[c] - 1.0).abs() < 0.02), "{sum:?} {star:?}");
    assert!(psf.covered > 0.97 && psf.covered < 1.0);
    assert!(psf.rgb.iter().flatten().all(|channel| *channel >= 0.0 && channel.is_finite()));
    let width = |c: usize| -> f64 {
        let within = psf.places().filter(|(offset, _)| offset.length() < 1.2 * fringe_rad());
        within.map(|(_, rgb)| rgb[c]).sum::<f64>() / sum[c]
    };
    println!("share within 1.2 lambda/D: red {:.3}, green {:.3}, blue {:.3}", width(0), width(1), width(2));
    assert!(width(2) > width(1) && width(1) > width(0));
    let white = psf.balanced_to_white().sum();
    assert!(white.iter().all(|channel| (channel - 1.0).abs() < 1e-5), "{white:?}");
    // A cool star is not white, so the balance has an effect.
    assert!(coloured(Aperture::Circle, 32, 8, 3000.0).sum()[2] < 0.5);
}

#[test]
fn bilinear_samples_keep_the_light() {
    let psf = coloured(Aperture::Hexagon, 32, 4, 6504.0);
    let step = psf.pixel_rad / 4.0;
    let (mut total, mut first_moment) = (0.0, DVec2::ZERO);
    for i in -80..80 {
        for j in -80..80 {
            let offset = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * step;
            let light = luminance(psf.sample(offset)) * step * step;
            total += light;
            first_moment += offset * light;
        }
    }
    assert!((total - 1.0).abs() < 1e-5, "{total}");
    assert!(first_moment.length() < 1e-4 * psf.pixel_rad, "{first_moment}");
    assert_eq!(psf.sample(DVec2::new(f64::NAN, 0.0)), [0.0; 3]);
    assert_eq!(psf.sample(DVec2::splat(2.0 * psf.half_width_rad())), [0.0; 3]);
    // x is to the right and y up.
    let mut marked = psf.clone();
    marked.rgb.fill([0.0; 3]);
    marked.rgb[2 * 32 + 30] = [1.0; 3];
    assert!(marked.sample(marked.offset_rad(30, 2))[0] > 0.0);
    assert!(marked.offset_rad(30, 2).x > 0.0 && marked.offset_rad(30, 2).y > 0.0);
}

#[test]
fn the_inverse_square_form_is_invertible_and_reduces_the_range() {
    for size in [63, 64] {
        let psf = coloured(Aperture::Hexagon, size, 8, 6504.0);
        let form = InverseSquare::from_psf(&psf);
        let worst = |other: &Psf| -> f32 {
            let pairs = psf.rgb.iter().flatten().zip(other.rgb.iter().flatten());
            pairs.map(|(a, b)| (a - b).abs() / a.max(1e-30)).fold(0.0, f32::max)
        };
        let error = worst(&form.restore());
        println!("size {size}: largest relative error of the round trip {error:.1e}");
        assert!(error < 1e-6, "{error}");
        // The published form loses the centre, and a form of another size differs.
        let mut published = form.clone();
        published.rgb[(size / 2 * size + size / 2) as usize] = [0.0; 3];
        assert!(worst(&published.restore()) > 0.5);
    }
    let psf = coloured(Aperture::Hexagon, 512, 24, 6504.0);
    let form = InverseSquare::from_psf(&psf);
    // Stops between the brightest pixel and a spike at the edge of the texture.
    let stops = |rgb: &[[f32; 3]]| {
        let y = |index: usize| luminance(rgb[index].map(f64::from));
        let brightest = (0..rgb.len()).map(y).fold(0.0, f64::max);
        let spike = (0..16).map(|row| y(row * 512 + 256)).sum::<f64>() / 16.0;
        (brightest / spike).log2()
    };
    let (before, after) = (stops(&psf.rgb), stops(&form.rgb));
    println!("stops from the brightest pixel to the end of a spike: {before:.1}, in inverse-square form {after:.1}");
    assert!(before > 10.0 && after < before - 8.0);
}

#[test]
fn the_crop_follows_the_square_root_and_agrees_with_the_texture() {
    let psf = coloured(Aperture::Hexagon, 512, 24, 6504.0);
    let rule = CropRule::new(&psf);
    let px = |angle: f64| angle / psf.pixel_rad;
    // The threshold at which a star of 1 lx needs half of the texture.
    let threshold = rule.spike_constant / (0.5 * psf.half_width_rad()).powi(2);
    println!("spike constant {:.3e}", rule.spike_constant);
    for illuminance_lx in [1e-3, 1e-2, 0.1, 0.25, 0.5, 1.0, 2.0] {
        let half = rule.half_angle_rad(illuminance_lx, threshold);
        let exact = rule.exact_half_angle_rad(illuminance_lx, threshold);
        println!(
            "{illuminance_lx:>6} lx: half side {:.1} px by the square root, {:.1} px by the texture; outside {:.5} and {:.5} of the light",
            px(half),
            px(exact),
            rule.light_outside(half),
            rule.light_outside(exact)
        );
        // No pixel beyond the exact crop reaches the threshold; a pixel of the ring inside does.
        let reach = |from: f64| {
            let outside = psf.places().filter(|(offset, _)| offset.abs().max_element() > from);
            outside.map(|(_, rgb)| illuminance_lx * luminance(rgb) / psf.pixel_rad.powi(2)).fold(0.0, f64::max)
        };
        assert!(reach(exact) < threshold);
        assert!(reach(exact - psf.pixel_rad) >= threshold);
        assert!((half / exact - 1.0).abs() < 0.35, "{half} {exact}");
        assert_eq!(half, crop_half_angle_rad(&psf, illuminance_lx, threshold));
    }
    let (one, four) = (rule.half_angle_rad(0.1, threshold), rule.half_angle_rad(0.4, threshold));
    assert!((four / one - 2.0).abs() < 1e-9);
    // A rule that uses brightness instead of its square root must fail the same comparison.
    let wrong = rule.half_angle_rad(1.0, threshold) * 0.1;
    assert!((wrong / rule.exact_half_angle_rad(0.1, threshold) - 1.0).abs() > 0.35);
    assert_eq!(rule.half_angle_rad(1e12, threshold), psf.half_width_rad());
    assert_eq!(rule.half_angle_rad(0.0, threshold), psf.pixel_rad);
    assert_eq!(rule.exact_half_angle_rad(0.0, threshold), 0.0);
    assert!((rule.light_outside(0.0) - 1.0).abs() < 1e-5 && rule.light_outside(psf.half_width_rad()) < 1e-12);
}

#[test]
fn light_outside_a_crop_is_the_sum_of_its_pixels() {
    for size in [15, 16] {
        let psf = coloured(Aperture::Jwst, size, 4, 6504.0);
        let rule = CropRule::new(&psf);
        for rings in 1..size / 2 {
            let half = (f64::from(rings) + if size % 2 == 1 { 0.5 } else { 0.0 }) * psf.pixel_rad;
            let outside = psf.places().filter(|(offset, _)| offset.abs().max_element() > half);
            let expected: f64 = outside.map(|(_, rgb)| luminance(rgb)).sum();
            assert!((rule.light_outside(half) - expected).abs() < 1e-9, "{size} {rings}");
        }
    }
}

#[test]
fn errors_name_the_invalid_parameter_of_optics() {
    let valid = Optics {
        aperture: Aperture::Circle,
        diameter_mm: 2.0,
        size: 32,
        pixel_rad: 1e-5,
        wavelengths: 4,
        temperature_k: 6504.0,
    };
    assert!(Psf::from_aperture(&valid, |_, _| {}).is_ok());
    for (wrong, name) in [
        (Optics { diameter_mm: 0.0, ..valid }, "diameter"),
        (Optics { diameter_mm: f64::NAN, ..valid }, "diameter"),
        (Optics { size: 1, ..valid }, "size"),
        (Optics { size: 100_000, ..valid }, "size"),
        (Optics { pixel_rad: 0.0, ..valid }, "pixel"),
        (Optics { pixel_rad: f64::NAN, ..valid }, "pixel"),
        (Optics { pixel_rad: 0.1, ..valid }, "pixel"),
        (Optics { wavelengths: 0, ..valid }, "wavelengths"),
        (Optics { wavelengths: 401, ..valid }, "wavelengths"),
        (Optics { temperature_k: 3.0, ..valid }, "temperature"),
        (Optics { aperture: Aperture::CurvedBlades { blades: 2 }, ..valid }, "blades"),
        (Optics { diameter_mm: 1e5, pixel_rad: 1e-3, ..valid }, "transform"),
    ] {
        let error = Psf::from_aperture(&wrong, |_, _| {}).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("must be"), "{name}: {error}");
    }
}

/// Compares the form for drawing with a sum over points other than those of its integral.
#[test]
fn the_inverse_square_form_for_drawing_keeps_the_light() {
    let light = |form: &InverseSquare| -> [f64; 3] {
        let (half, points) = (form.half_width_rad(), 1801_u32);
        let step = 2.0 * half / f64::from(points);
        let coordinate = |i: u32| (f64::from(i) + 0.5) * step - half;
        let mut sum = [0.0; 3];
        for j in 0..points {
            for i in 0..points {
                let offset = DVec2::new(coordinate(i), coordinate(j));
                let theta = offset.length();
                let omega = step * step * if theta > 0.0 { theta.sin() / theta } else { 1.0 };
                let density = form.density(offset);
                (0..3).for_each(|c| sum[c] += density[c] * omega);
            }
        }
        sum
    };
    for size in [63, 64] {
        let psf = coloured(Aperture::Hexagon, size, 8, 6504.0).balanced_to_white();
        let (found, plain) = (light(&InverseSquare::holding_light(&psf)), light(&InverseSquare::from_psf(&psf)));
        println!("size {size}: light drawn {found:.5?}, without the scale {plain:.5?}");
        assert!(found.iter().all(|light| (light - 1.0).abs() < 1e-3), "{found:?}");
        assert!(plain.iter().all(|light| (light - 1.0).abs() > 1e-3), "{plain:?}");
    }
}

/// A header may announce any size and any number of channels: both are checked before anything is allocated.
#[test]
fn exr_files_with_oversized_headers_are_refused_before_pixels_are_read() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Vec2, WritableImage,
    };
    let file = |channels: usize, last: i32| {
        let samples = FlatSamples::F32(vec![1.0; 4]);
        let list = (0..channels).map(|i| AnyChannel::new(format!("c{i}").as_str(), samples.clone())).collect();
        let channels = AnyChannels::sort(list);
        let layer = Layer::new(Vec2(2, 2), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
        let mut bytes = std::io::Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
        let mut bytes = bytes.into_inner();
        let name = b"dataWindow\0box2i\0";
        // The name is followed by its length, and the first pixel.
        let offset = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + 4 + 8;
        bytes[offset..offset + 4].copy_from_slice(&last.to_le_bytes());
        bytes[offset + 4..offset + 8].copy_from_slice(&last.to_le_bytes());
        bytes
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wide.exr");
    for (channels, last, expected) in [
        (1, 1 << 29, "must be a square of 2 to 4096"),
        (1, 4096, "4097 x 4097 pixels"),
        (5, 4095, "5 channels of 4096 x 4096 pixels"),
    ] {
        std::fs::write(&path, file(channels, last)).unwrap();
        let message = read(&path, Some(1.0)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

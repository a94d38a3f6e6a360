//! A painter in f64 draws the scoring scenes correctly and with errors: pictures with errors must have bad scores.

use std::time::Duration;

use super::*;
use crate::{
    catalogue::packed::temperature_of_step_k,
    chart::{Budget, ScoringSize},
    photometry::kernel::SplatKernel,
    plan::settings::StarMethod,
    view::projection::Perspective,
};

#[test]
fn window_matches_its_part_of_the_picture() {
    let mapping = Perspective::symmetric([20, 10], 1.0).unwrap();
    let pixels: Vec<[f32; 4]> = (0..200).map(|i| [i as f32, 0.0, 0.0, 0.0]).collect();
    let window = Window::around(&mapping, DVec2::new(18.2, 1.9), 3);
    assert_eq!((window.corner, window.size), ([15, 0], [5, 5]));
    let cut = window.cut(&pixels);
    assert_eq!(cut.len(), 25);
    assert_eq!((cut[0][0], cut[24][0]), (15.0, 4.0 * 20.0 + 19.0));
    assert_eq!(window.solid_angle_sr(2, 3), mapping.solid_angle_sr(17, 3));
    let direction = window.direction_from_pixel(DVec2::new(1.0, 2.0)).unwrap();
    assert!((mapping.pixel_from_direction(direction).unwrap() - DVec2::new(16.0, 2.0)).length() < 1e-9);
    assert!((window.pixel_from_direction(direction).unwrap() - DVec2::new(1.0, 2.0)).length() < 1e-9);
}

/// Introduces an error into a correct picture; gets the images, their size and the number of earlier frames.
type Spoil = fn(&mut Vec<Pixels>, [u32; 2], u32);

/// Returns a scorer whose painter draws B-splines in f64 and then applies `spoil`.
fn scorer(method: StarMethod, spoil: Spoil, stretch: bool) -> Scorer<'static> {
    let mut frames = 0;
    let draw = move |scene: &Scene, _: f64| {
        let mut images = Vec::new();
        let mut size = [0, 0];
        for image in &scene.rig.views()[0].images {
            let mapping = image.projection.mapping();
            size = mapping.size();
            let mut pixels = vec![[0.0_f64; 3]; (size[0] * size[1]) as usize];
            for (position, _, star) in scene.snapshot.stars.iter() {
                let kernel = |position: DVec2| {
                    let mut taps = SplatKernel::BSpline.footprint(position);
                    if stretch {
                        for tap in &mut taps {
                            tap.2 /= 2.0;
                        }
                        taps.extend(taps.clone().into_iter().map(|(x, y, weight)| (x + 3, y, weight)));
                    }
                    taps
                };
                let colour = rec709_in_gamut(temperature_of_step_k(star.temperature_step()));
                for tap in mapping.taps(&kernel, image.camera_from_view.conjugate() * position) {
                    let light = star.illuminance_at_1_pc_lx() * tap.weight / mapping.solid_angle_sr(tap.x, tap.y);
                    let pixel = &mut pixels[(tap.y * size[0] + tap.x) as usize];
                    for (sum, channel) in pixel.iter_mut().zip(colour) {
                        *sum += channel * light;
                    }
                }
            }
            images.push(pixels.into_iter().map(|[r, g, b]| [r as f32, g as f32, b as f32, 0.0]).collect());
        }
        spoil(&mut images, size, frames);
        frames += 1;
        Ok(images)
    };
    Scorer { draw: Box::new(draw), method, size: SIZE, budget: Budget::new(Duration::from_secs(60)), cell_px: 32 }
}

const SIZE: ScoringSize = ScoringSize { image_px: 256, positions: 300, crowd: 300, heap: 100, shuffles: 2 };

type Measure = fn(&mut Scorer<'static>) -> Result<Vec<Score>, Failure>;

fn figures(measure: Measure, method: StarMethod, spoil: Spoil, stretch: bool) -> Vec<f64> {
    match measure(&mut scorer(method, spoil, stretch)) {
        Ok(scores) => scores.into_iter().map(|score| score.value.unwrap()).collect(),
        Err(Failure::Method(message)) => panic!("{message}"),
        Err(Failure::Chart(error)) => panic!("{error}"),
    }
}

fn each_pixel(images: &mut [Pixels], change: impl Fn(usize, &mut [f32; 4])) {
    for image in images {
        image.iter_mut().enumerate().for_each(|(index, pixel)| change(index, pixel));
    }
}

/// Returns a figure of the correct picture and of a wrong one.
#[track_caller]
fn right_and_wrong(measure: Measure, index: usize, spoil: Spoil, stretch: bool) -> [f64; 2] {
    let right = figures(measure, StarMethod::BSpline, |_, _, _| {}, false)[index];
    [right, figures(measure, StarMethod::BSpline, spoil, stretch)[index]]
}

#[test]
fn wrong_pictures_have_bad_scores() {
    // Every second row loses a tenth of the light, so the star's sum depends on its position.
    let rows: Spoil = |images, [width, _], _| {
        each_pixel(images, |index, pixel| {
            if (index as u32 / width).is_multiple_of(2) {
                *pixel = pixel.map(|channel| 0.9 * channel);
            }
        });
    };
    // Flicker before tone mapping. The weight of every second row varies between 3/8 and 5/8.
    let [right, wrong] = right_and_wrong(Scorer::sweep, 3, rows, false);
    assert!(right < 1e-4 && wrong > 5e-3, "{right} {wrong}");
    let [right, wrong] = right_and_wrong(Scorer::single_stars, 0, rows, false);
    assert!(right < 1e-4 && (0.05..0.075).contains(&wrong), "{right} {wrong}");

    // The picture is shifted by one pixel to the right.
    let shifted: Spoil = |images, _, _| images.iter_mut().for_each(|image| image.rotate_right(1));
    let [right, wrong] = right_and_wrong(Scorer::sweep, 4, shifted, false);
    assert!(right < 1e-3 && (wrong - 1.0).abs() < 0.01, "{right} {wrong}");

    // Every star is drawn twice, three pixels apart: wide and far from round.
    let nothing: Spoil = |_, _, _| {};
    let [right, wrong] = right_and_wrong(Scorer::ellipticity, 0, nothing, true);
    assert!((right - 0.293).abs() < 0.01 && wrong > 0.4, "{right} {wrong}");

    let swapped: Spoil = |images, _, _| each_pixel(images, |_, pixel| pixel.swap(0, 2));
    let [right, wrong] = right_and_wrong(Scorer::colour, 0, swapped, false);
    assert!(right < 1e-3 && wrong > 0.01, "{right} {wrong}");

    // The range covers two decades instead of nine.
    let shallow: Spoil = |images, _, _| {
        let most = images.iter().flatten().map(|pixel| pixel[1]).fold(0.0, f32::max);
        each_pixel(images, |_, pixel| {
            if pixel[1] < 0.01 * most {
                *pixel = [0.0; 4];
            }
        });
    };
    let [right, wrong] = right_and_wrong(Scorer::range, 0, shallow, false);
    assert!(right < 1e-3 && (wrong - 1.0).abs() < 1e-6, "{right} {wrong}");

    // The last digit of every fourth pixel changes from frame to frame.
    let unsteady: Spoil = |images, _, frame| {
        each_pixel(images, |index, pixel| {
            if index % 4 == 0 {
                pixel[1] = f32::from_bits(pixel[1].to_bits() ^ (frame & 1));
            }
        });
    };
    let [right, wrong] = right_and_wrong(Scorer::order, 0, unsteady, false);
    assert!(right == 0.0 && (wrong - 0.25).abs() < 1e-9, "{right} {wrong}");

    // Sums stop growing at the light of five stars.
    let saturating: Spoil = |images, _, frame| {
        if frame > 0 {
            each_pixel(images, |_, pixel| *pixel = pixel.map(|channel| 0.05 * channel));
        }
    };
    let [right, wrong] = right_and_wrong(Scorer::heap, 0, saturating, false);
    assert!((right - 1.0).abs() < 1e-4 && (wrong - 0.05).abs() < 1e-4, "{right} {wrong}");

    // One face of the cube is a tenth too dark.
    let face: Spoil = |images, _, _| {
        if images.len() == 6 {
            each_pixel(&mut images[2..3], |_, pixel| *pixel = pixel.map(|channel| 0.9 * channel));
        }
    };
    let [right, wrong] = right_and_wrong(Scorer::seam, 0, face, false);
    assert!(right < 1e-4 && wrong > 0.05, "{right} {wrong}");
}

#[test]
fn scale_errors_are_ignored_for_relative_brightness_only() {
    let bright: Spoil = |images, _, _| each_pixel(images, |_, pixel| *pixel = pixel.map(|channel| 7.0 * channel));
    let measures: [(Measure, f64); 3] = [(Scorer::single_stars, 0.0), (Scorer::range, 0.0), (Scorer::heap, 1.0)];
    for (measure, best) in measures {
        let [relative, absolute] =
            [StarMethod::GaussianPsf, StarMethod::BSpline].map(|method| figures(measure, method, bright, false)[0]);
        assert!((relative - best).abs() < 1e-4 && (absolute - best - 6.0).abs() < 1e-3, "{relative} {absolute}");
    }
    // Flicker after tone mapping is evaluated at the same k.
    let found = figures(Scorer::sweep, StarMethod::GaussianPsf, bright, false)[1];
    let right = figures(Scorer::sweep, StarMethod::BSpline, |_, _, _| {}, false)[1];
    assert!((found - right).abs() < 1e-4, "{found} {right}");
}

#[test]
fn black_pictures_have_no_good_figure() {
    let black: Spoil = |images, _, _| each_pixel(images, |_, pixel| *pixel = [0.0; 4]);
    let measures: [Measure; 4] = [Scorer::sweep, Scorer::ellipticity, Scorer::colour, Scorer::order];
    for measure in measures {
        assert!(matches!(measure(&mut scorer(StarMethod::BSpline, black, false)), Err(Failure::Method(_))));
    }
    assert!(matches!(Scorer::seam(&mut scorer(StarMethod::BSpline, black, false)), Err(Failure::Method(_))));
    assert_eq!(figures(Scorer::single_stars, StarMethod::BSpline, black, false), [1.0]);
    assert_eq!(figures(Scorer::range, StarMethod::BSpline, black, false), [1.0]);
    assert_eq!(figures(Scorer::heap, StarMethod::BSpline, black, false), [0.0]);
}

#[test]
fn empty_inputs_have_no_figures() {
    assert_eq!((mean(&[]), root_mean_square(&[]), deviation_over_mean(&[])), (None, None, None));
    assert_eq!(deviation_over_mean(&[0.0, 0.0]), None);
    assert_eq!(deviation_over_mean(&[1.0, 3.0]), Some(0.5));
    assert_eq!(root_mean_square(&[3.0, -4.0]), Some(12.5_f64.sqrt()));
}

/// Detects a sum that depends on the order of the stars; the default order is drawn too.
#[test]
fn order_dependence_is_detected() {
    let orders = std::sync::Mutex::new(Vec::new());
    let draw = |scene: &Scene, _: f64| {
        orders.lock().unwrap().push(scene.order);
        let [width, height] = scene.mapping().size();
        let mut pixels = vec![[1.0_f32; 4]; (width * height) as usize];
        // One shuffle of two changes the last bit of a channel of one pixel.
        if scene.order == Some(1) {
            pixels[7][2] = pixels[7][2].next_up();
        }
        Ok(vec![pixels])
    };
    let budget = Budget::new(Duration::from_secs(60));
    let method = StarMethod::BSpline;
    let mut scorer = Scorer { draw: Box::new(draw), method, size: SIZE, budget, cell_px: 32 };
    let Ok(found) = scorer.order() else { panic!("no figure") };
    let pixels = f64::from(scenes::CROWD_PX).powi(2);
    assert!((found[0].value.unwrap() * pixels - 1.0).abs() < 1e-9, "{found:?}");
    assert!(found[0].note.starts_with("2 shuffles, largest difference"), "{found:?}");
    drop(scorer);
    assert_eq!(orders.into_inner().unwrap(), [None, None, Some(0), Some(1)]);
}

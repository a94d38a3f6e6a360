#![allow(clippy::unwrap_used, reason = "tests")]

use super::*;
use crate::chart::ViewShape;

fn scenes(view: ViewShape) -> AsteroidScenes {
    let settings = [ImpostorMethod::None, ImpostorMethod::EulerAtlas, ImpostorMethod::OctahedralBlend]
        .map(|impostor| AsteroidSettings { impostor, ..AsteroidSettings::default() });
    AsteroidScenes::new(view, &settings).unwrap()
}

/// Pictures of balls: dark before a background of 2, and lit by the three suns. `grown` changes radii by a factor,
/// `moved` moves them in the second image, `tilt` turns normals.
fn shown(scenes: &AsteroidScenes, grown: f64, moved: f64, tilt: f64, dimmed: f64) -> Shown {
    let directions = scenes.lit.each_ref().map(|scene| scene.objects.bodies[0].position_m.normalize());
    let image = |index: usize, sun: Option<usize>| -> Pixels {
        let [width, height] = scenes.viewports[index].size();
        let mut pixels = vec![[if sun.is_none() { 2.0_f32 } else { 0.0 }; 4]; (width * height) as usize];
        for cell in &scenes.cells {
            let middle = cell.middles[index] + glam::DVec2::X * if index == 1 { moved } else { 0.0 };
            for place in scenes.window(cell, index) {
                let at =
                    glam::DVec2::new((place % width as usize) as f64, (place / width as usize) as f64) + 0.5 - middle;
                let share = at / (grown * cell.radius_px.max(3.0));
                let inside = 1.0 - share.length_squared();
                if inside > 0.0 {
                    let normal =
                        glam::DQuat::from_rotation_x(tilt) * glam::DVec3::new(share.x, -share.y, inside.sqrt());
                    let light = sun.map_or(0.0, |sun| dimmed * normal.dot(directions[sun]).max(0.0));
                    pixels[place] = [light as f32; 4];
                }
            }
        }
        pixels
    };
    let images = |sun: Option<usize>| (0..scenes.viewports.len()).map(|index| image(index, sun)).collect();
    Shown { backlit: images(None), lit: [0, 1, 2].map(|sun| images(Some(sun))) }
}

#[test]
fn wrong_pictures_have_their_errors_and_right_ones_have_none() {
    let scenes = scenes(ViewShape::Stereo([256, 256]));
    let background = (0..2).map(|_| vec![[2.0_f32; 4]; 256 * 256]).collect();
    let truth = Truth { background, shown: shown(&scenes, 1.0, 0.0, 0.0, 1.0) };
    let of = |shown: &Shown, metric: AsteroidMetric| {
        let scores = compare(&scenes, shown, &truth).unwrap();
        scores.iter().find(|(of, _)| *of == metric).and_then(|(_, score)| score.value).unwrap()
    };
    for metric in AsteroidMetric::ALL {
        assert!((of(&truth.shown, metric) - metric.best()).abs() < 1e-9, "{metric:?}");
    }
    let grown = shown(&scenes, 1.2, 0.0, 0.0, 1.0);
    let iou = of(&grown, AsteroidMetric::SilhouetteIou);
    assert!((0.5..0.8).contains(&iou), "{iou}");
    // The largest are about 9 px: a fifth is 1.8.
    let outline = of(&grown, AsteroidMetric::OutlinePx);
    assert!((1.0..2.5).contains(&outline), "{outline}");
    let tilted = of(&shown(&scenes, 1.0, 0.0, 0.1, 1.0), AsteroidMetric::NormalDeg);
    assert!((4.0..6.5).contains(&tilted), "{tilted}");
    let moved = of(&shown(&scenes, 1.0, 1.0, 0.0, 1.0), AsteroidMetric::DisparityPx);
    assert!((0.9..1.1).contains(&moved), "{moved}");
    let dimmed = of(&shown(&scenes, 1.0, 0.0, 0.0, 0.8), AsteroidMetric::Light);
    assert!((dimmed - 0.2).abs() < 1e-6, "{dimmed}");
}

#[test]
fn every_asteroid_has_its_cell_and_the_size_of_its_row() {
    for view in [ViewShape::Flat([512, 512]), ViewShape::Dome(512)] {
        let scenes = scenes(view);
        assert_eq!(scenes.cells.len(), 7 * 8, "five sizes and two methods with impostors");
        let mut all: Vec<usize> = scenes.cells.iter().flat_map(|cell| scenes.window(cell, 0)).collect();
        let pixels = all.len();
        all.sort_unstable();
        all.dedup();
        // Windows are moved by less than a pixel, so neighbours share a column at most.
        assert!(all.len() as f64 > 0.9 * pixels as f64);
        let rows = scenes.rows();
        assert!(rows[0] >= rows[1] && rows[1] >= rows[2] && rows[2] > rows[3] && rows[3] > rows[4], "{rows:?}");
        // The published atlas takes over only when an asteroid is a few pixels large, the blended one far earlier.
        assert!(rows[5] < 3.0 && rows[6] > 4.0, "{rows:?}");
    }
}

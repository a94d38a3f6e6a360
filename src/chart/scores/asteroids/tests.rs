#![allow(clippy::unwrap_used, reason = "tests")]

use super::*;
use crate::chart::ViewShape;

fn scenes(view: ViewShape) -> AsteroidScenes {
    let settings = [ImpostorMethod::None, ImpostorMethod::EulerAtlas, ImpostorMethod::OctahedralBlend]
        .map(|impostor| AsteroidSettings { impostor, ..AsteroidSettings::default() });
    AsteroidScenes::new(view, &settings).unwrap()
}

/// Returns pictures of spheres: dark in front of a background of 2, and lit by the three suns. `grown` scales radii,
/// `moved` shifts the second image, `tilt` rotates normals.
fn draw(scenes: &AsteroidScenes, grown: f64, moved: f64, tilt: f64, dimmed: f64) -> Drawn {
    let directions = scenes.lit.each_ref().map(|scene| scene.objects.bodies[0].position_m.normalize());
    let image = |index: usize, sun: Option<usize>| -> Pixels {
        let [width, height] = scenes.viewports[index].size();
        let mut pixels = vec![[if sun.is_none() { 2.0_f32 } else { 0.0 }; 4]; (width * height) as usize];
        for cell in &scenes.cells {
            let middle = cell.middles[index] + glam::DVec2::X * if index == 1 { moved } else { 0.0 };
            for place in scenes.window(cell, index) {
                let distance_px =
                    glam::DVec2::new((place % width as usize) as f64, (place / width as usize) as f64) + 0.5 - middle;
                let share = distance_px / (grown * cell.radius_px.max(3.0));
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
    Drawn { backlit: images(None), lit: [0, 1, 2].map(|sun| images(Some(sun))) }
}

#[test]
fn wrong_pictures_have_expected_errors_and_correct_ones_none() {
    let scenes = scenes(ViewShape::Stereo([256, 256]));
    let background = (0..2).map(|_| vec![[2.0_f32; 4]; 256 * 256]).collect();
    let truth = Truth { background, drawn: draw(&scenes, 1.0, 0.0, 0.0, 1.0) };
    let figure = |draw: &Drawn, metric: AsteroidMetric| {
        let scores = compare(&scenes, draw, &truth).unwrap();
        scores.iter().find(|(name, _)| *name == metric).and_then(|(_, score)| score.value).unwrap()
    };
    for metric in AsteroidMetric::ALL {
        assert!((figure(&truth.drawn, metric) - metric.best()).abs() < 1e-9, "{metric:?}");
    }
    let grown = draw(&scenes, 1.2, 0.0, 0.0, 1.0);
    let iou = figure(&grown, AsteroidMetric::SilhouetteIou);
    assert!((0.5..0.8).contains(&iou), "{iou}");
    // The largest radius is about 9 px, and a fifth of it is 1.8 px.
    let outline = figure(&grown, AsteroidMetric::OutlinePx);
    assert!((1.0..2.5).contains(&outline), "{outline}");
    let tilted = figure(&draw(&scenes, 1.0, 0.0, 0.1, 1.0), AsteroidMetric::NormalDeg);
    assert!((4.0..6.5).contains(&tilted), "{tilted}");
    let moved = figure(&draw(&scenes, 1.0, 1.0, 0.0, 1.0), AsteroidMetric::DisparityPx);
    assert!((0.9..1.1).contains(&moved), "{moved}");
    let dimmed = figure(&draw(&scenes, 1.0, 0.0, 0.0, 0.8), AsteroidMetric::Light);
    assert!((dimmed - 0.2).abs() < 1e-6, "{dimmed}");
}

#[test]
fn asteroids_fill_their_cells_in_the_size_of_their_row() {
    for view in [ViewShape::Flat([512, 512]), ViewShape::Dome(512)] {
        let scenes = scenes(view);
        assert_eq!(scenes.cells.len(), 7 * 8, "five sizes and two methods with impostors");
        let mut all: Vec<usize> = scenes.cells.iter().flat_map(|cell| scenes.window(cell, 0)).collect();
        let pixels = all.len();
        all.sort_unstable();
        all.dedup();
        // Windows are shifted by less than a pixel, so neighbours share at most one column.
        assert!(all.len() as f64 > 0.9 * pixels as f64);
        let rows = scenes.rows();
        assert!(rows[0] >= rows[1] && rows[1] >= rows[2] && rows[2] > rows[3] && rows[3] > rows[4], "{rows:?}");
        // The published atlas starts only at a size of a few pixels, the blended one much earlier.
        assert!(rows[5] < 3.0 && rows[6] > 4.0, "{rows:?}");
    }
}

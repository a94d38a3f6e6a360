//! Scores the procedural sky on its own stars: their positions and brightnesses are known from its f64 twin and cannot
//! be chosen, so the camera moves instead of the stars.
//!
//! The sky has one layer of coarse cells, so that stars are separated; a star is left out if another one is nearer than
//! its window. The light of a star must be proportional to its brightness, independent of its position. Brightness has
//! no unit, so one scale is fitted, and the exposure follows each star to show it at k times white.

use glam::{DQuat, DVec2, DVec3};

use super::{
    Failure, Metric, Pixels, Score, Scorer, Scores, ScoringSize,
    measure::{NIGHT_EV100, deviation_over_mean, mean, pixels_of, root_mean_square, score},
    settings_of,
};
use crate::{
    catalogue::chunks::StarSet,
    chart::{
        Budget, ChartError,
        scenes::usual_view,
        workloads::{projection_of, rig_of},
    },
    metrics::{
        FlickerMeter, HdrView, centroid_error_px, fitted_scale, illuminance_near_pixel_lx, shape_px, shape_rad,
        sub_pixel_positions,
    },
    plan::settings::{CellSkySettings, StarMethod},
    reference::stars::cell_sky,
    render::{FrameRequest, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    view::{Rig, ViewKind, projection::PlaneMapping},
};

/// Cells along a side of the scored sky.
const CELLS: u32 = 100;
/// Note on every figure about its sky.
const NOTE: &str = "stars of the sky itself: one layer of 100 cells a side, in the middle of a face";
const NOTE_WIDE: &str = "stars of the sky itself: one layer of 100 cells a side, over a face and beyond";
/// Half side of a star's window, pixels: at the centre of a face, and off axis where pixels are small.
const NEAR_PX: f64 = 3.0;
const WIDE_PX: f64 = 5.0;
/// Range of off-axis angles of the stars whose ellipticity is measured, degrees.
const OFF_AXIS_DEG: std::ops::RangeInclusive<f64> = 43.0..=47.0;

/// The scored sky.
struct Sky<'a> {
    renderer: &'a mut Renderer,
    settings: CellSkySettings,
    stars: Vec<(DVec3, f64)>,
}

/// Returns all figures of the procedural sky.
pub(super) fn scores(
    renderer: &mut Renderer,
    size: ScoringSize,
    time: std::time::Duration,
) -> Result<Scores, ChartError> {
    let settings = CellSkySettings { cells: CELLS, layers: 1, ..CellSkySettings::default() };
    let mut sky = Sky { stars: cell_sky::stars(&settings).collect(), renderer, settings };
    let mut found = Vec::new();
    let pan = [
        Metric::FlickerK1,
        Metric::FlickerK10,
        Metric::FlickerK100,
        Metric::FlickerLinear,
        Metric::CentroidPx,
        Metric::WidthVariation,
    ];
    type Group<'a> = (&'a [Metric], Result<Vec<Score>, Failure>);
    let groups: [Group<'_>; 3] = [
        (&pan, sky.pan(size, &Budget::new(time))),
        (&[Metric::FluxStarRms, Metric::EllipticityView45Deg], sky.wide(size)),
        (&[Metric::OrderBitsDiffer], sky.order(size, time)),
    ];
    for (metrics, measured) in groups {
        match measured {
            Ok(scores) => found.extend(metrics.iter().copied().zip(scores)),
            Err(Failure::Method(note)) => {
                found.extend(metrics.iter().map(|metric| (*metric, Score::none(note.clone()))));
            }
            Err(Failure::Chart(error)) => return Err(error),
        }
    }
    let none = "does not apply: the sky is procedural, its stars cannot be placed";
    let rest = [Metric::ColourUv, Metric::DynamicRange, Metric::Keeps20000Stars, Metric::Seam];
    found.extend(rest.map(|metric| (metric, Score::none(none))));
    Ok(Scores(found))
}

/// A star in a picture.
struct VisibleStar {
    pixel: DVec2,
    direction: DVec3,
    brightness: f64,
}

impl Sky<'_> {
    fn draw(&mut self, rig: &Rig, world_from_camera: DQuat) -> Result<Pixels, Failure> {
        let mut settings = settings_of(StarMethod::CellSky, NIGHT_EV100, f64::INFINITY);
        settings.stars.cell_sky = self.settings;
        let camera = Camera { world_from_camera, ..Camera::default() };
        let scene = SceneSnapshot {
            revision: 1,
            stars: StarSet::from_records(Vec::new()).into(),
            objects: Default::default(),
            camera,
        };
        let frame = self.renderer.render(FrameRequest::new(&scene, rig).settings(&settings).wanted(Wanted::hdr()))?;
        let frame: Vec<Pixels> = frame.images.into_iter().filter_map(|image| image.hdr).collect();
        pixels_of(&frame, 0).cloned()
    }

    /// Returns the stars of a picture without a neighbour within two windows and with their whole window inside the
    /// picture.
    fn isolated(&self, mapping: &dyn PlaneMapping, world_from_camera: DQuat, window_px: f64) -> Vec<VisibleStar> {
        let [width, height] = mapping.size().map(f64::from);
        let camera_from_world = world_from_camera.conjugate();
        let visible = self.stars.iter().filter_map(|&(direction, brightness)| {
            let direction = camera_from_world * direction;
            let pixel = mapping.pixel_from_direction(direction)?;
            let near = |position: f64, side: f64| position > -window_px && position < side + window_px;
            (near(pixel.x, width) && near(pixel.y, height)).then_some(VisibleStar { pixel, direction, brightness })
        });
        let mut visible: Vec<VisibleStar> = visible.collect();
        visible.sort_by(|a, b| a.pixel.x.total_cmp(&b.pixel.x));
        let room = 2.0 * window_px;
        let alone = |index: usize| {
            let position = visible[index].pixel;
            let close = |other: &&VisibleStar| (other.pixel.x - position.x).abs() < room;
            let right = visible[index + 1..].iter().take_while(close);
            let left = visible[..index].iter().rev().take_while(close);
            right.chain(left).all(|other| other.pixel.distance(position) >= room)
        };
        let alone: Vec<bool> = (0..visible.len()).map(alone).collect();
        let inside = |position: DVec2| {
            position.x > window_px
                && position.y > window_px
                && position.x < width - window_px
                && position.y < height - window_px
        };
        visible
            .into_iter()
            .zip(alone)
            .filter(|(star, alone)| *alone && inside(star.pixel))
            .map(|(star, _)| star)
            .collect()
    }

    /// Measures the same stars at sub-pixel positions while the camera pans over the centre of a face.
    fn pan(&mut self, size: ScoringSize, budget: &Budget) -> Result<Vec<Score>, Failure> {
        let side = (size.image_px / 4).max(96);
        let rig = usual_view([side; 2])?;
        let projection = projection_of(&rig);
        let (mapping, pixel_rad) = (projection.mapping(), projection.middle_pixel_rad());
        let positions = (size.positions / 16).clamp(16, 64);
        // Keep stars whose window stays inside during the whole pan.
        let stars = self.isolated(mapping, DQuat::IDENTITY, NEAR_PX + 1.0);
        let mut meters: Vec<[FlickerMeter; 3]> = Vec::new();
        let (mut centroids, mut widths, mut frames) = (Vec::new(), Vec::new(), 0);
        for shift in sub_pixel_positions(positions) {
            if frames >= 2 && budget.is_over() {
                break;
            }
            frames += 1;
            let turn = DQuat::from_rotation_y(shift.x * pixel_rad) * DQuat::from_rotation_x(shift.y * pixel_rad);
            let pixels = self.draw(&rig, turn)?;
            let image = HdrView::new(mapping, &pixels)?;
            let place = |star: &VisibleStar| mapping.pixel_from_direction(turn.conjugate() * star.direction);
            let places: Vec<DVec2> = stars.iter().filter_map(place).collect();
            if meters.is_empty() {
                let light = light_of(&image, &stars, &places, NEAR_PX)?;
                let scale = fitted_scale(&light)?;
                for (star, position) in stars.iter().zip(&places) {
                    // A star of this light in a single pixel reaches k times white.
                    let own_sr = mapping.solid_angle_sr(position.x as u32, position.y as u32);
                    let luminance = star.brightness / scale / own_sr;
                    let meter = |k: f64| FlickerMeter::new(luminance / k);
                    meters.push([meter(1.0)?, meter(10.0)?, meter(100.0)?]);
                }
            }
            for (position, meters) in places.iter().zip(&mut meters) {
                for meter in meters {
                    meter.add_star(&image, *position, NEAR_PX)?;
                }
                centroids.push(centroid_error_px(&image, *position, NEAR_PX)?);
                widths.push(shape_px(&image, *position, NEAR_PX)?.rms_radius());
            }
        }
        let (mut displayed, mut linear) = ([const { Vec::new() }; 3], Vec::new());
        for meters in &meters {
            for (displayed, meter) in displayed.iter_mut().zip(meters) {
                displayed.push(meter.flicker()?.after);
            }
            linear.push(meters[0].flicker()?.before);
        }
        let note = format!("{NOTE}; {} stars at {frames} positions of a pan", meters.len());
        let no_star = "no star is isolated";
        let mut scores: Vec<Score> =
            displayed.iter().map(|displayed| score(root_mean_square(displayed), no_star)).collect();
        scores.push(score(root_mean_square(&linear), no_star));
        scores.push(score(root_mean_square(&centroids), no_star));
        scores.push(score(deviation_over_mean(&widths), no_star));
        Ok(scores.into_iter().map(|score| noted(score, &note)).collect())
    }

    /// Measures light and shape from the centre of a face to its corners and beyond.
    fn wide(&mut self, size: ScoringSize) -> Result<Vec<Score>, Failure> {
        let px = size.image_px;
        let (mut pairs, mut ellipticities) = (Vec::new(), Vec::new());
        for (size, fov_deg) in [([px, (px * 9 / 16).max(1)], 60.0_f64), ([px; 2], 110.0)] {
            let kind = ViewKind::Perspective { size, fov_y_rad: fov_deg.to_radians() };
            let rig = rig_of(vec![("score", kind)]).map_err(ChartError::from)?;
            let mapping = projection_of(&rig).mapping();
            let pixels = self.draw(&rig, DQuat::IDENTITY)?;
            let image = HdrView::new(mapping, &pixels)?;
            let stars = self.isolated(mapping, DQuat::IDENTITY, WIDE_PX);
            let places: Vec<DVec2> = stars.iter().map(|star| star.pixel).collect();
            pairs.extend(light_of(&image, &stars, &places, WIDE_PX)?);
            let off_axis =
                |star: &&VisibleStar| OFF_AXIS_DEG.contains(&star.direction.angle_between(DVec3::NEG_Z).to_degrees());
            for star in stars.iter().filter(off_axis) {
                let window_rad = WIDE_PX * mapping.solid_angle_sr(star.pixel.x as u32, star.pixel.y as u32).sqrt();
                ellipticities.extend(shape_rad(&[image], star.direction, window_rad)?.ellipticity());
            }
        }
        let scale = fitted_scale(&pairs)?;
        let errors: Vec<f64> = pairs.iter().map(|(measured, expected)| scale * measured / expected - 1.0).collect();
        let note = |count: usize| format!("{NOTE_WIDE}; {count} stars");
        let no_star = "no star is isolated";
        Ok(vec![
            noted(score(root_mean_square(&errors), no_star), &note(errors.len())),
            noted(score(mean(&ellipticities), no_star), &note(ellipticities.len())),
        ])
    }

    /// Compares repeated pictures. The sky accumulates nothing, so they must not depend on the order or on the run.
    fn order(&mut self, size: ScoringSize, time: std::time::Duration) -> Result<Vec<Score>, Failure> {
        let mut draw = |scene: &super::Scene, ev100: f64| {
            let settings = settings_of(StarMethod::CellSky, ev100, f64::INFINITY);
            let frame = self
                .renderer
                .render(FrameRequest::new(&scene.snapshot, &scene.rig).settings(&settings).wanted(Wanted::hdr()))?;
            Ok(frame.images.into_iter().filter_map(|image| image.hdr).collect())
        };
        let method = StarMethod::CellSky;
        Scorer { draw: Box::new(&mut draw), method, size, budget: Budget::new(time), cell_px: 32 }.order()
    }
}

/// Returns light and brightness of stars.
fn light_of(
    image: &HdrView<'_>,
    stars: &[VisibleStar],
    places: &[DVec2],
    window_px: f64,
) -> Result<Vec<(f64, f64)>, Failure> {
    let light = |(star, position): (&VisibleStar, &DVec2)| {
        Ok((illuminance_near_pixel_lx(image, *position, window_px)?, star.brightness))
    };
    stars.iter().zip(places).map(light).collect()
}

fn noted(mut score: Score, note: &str) -> Score {
    if score.value.is_some() {
        score.note = note.to_owned();
    }
    score
}

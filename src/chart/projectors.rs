//! The axis `projectors`: compares drawing directly into a projector's pixels with the usual method, which warps a flat
//! picture as a texture. The flat picture has half, the same and twice the number of pixels along each side.
//!
//! The projector throws across a dome. Light is weighted with closed-form solid angles. The time is that of a whole
//! frame with its display image read back, because the picture is warped on the CPU.

use std::{f64::consts::PI, sync::Arc, time::Instant};

use glam::{DMat3, DVec2, DVec3};

use super::{
    Axis, Budget, ChartError, Extent, ReportStep, Row, Score, Sky, Step,
    scores::settings_of,
    timing::{self, Case, TIMING_EV100, message_of},
    workloads::{Skies, rig_of, snapshot},
};
use crate::{
    catalogue::StarRecord,
    photometry::rec709::luminance,
    plan::settings::{RenderSettings, StarMethod},
    render::{FrameImage, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    units::illuminance_lx_from_magnitude,
    view::{
        Rig, ViewKind,
        projection::{BoundingCone, PlaneMapping, TabulatedMapping, pixel_centre},
        projector::{ProjectorOutput, Resampling, Response},
    },
};

/// Number of stars along each side of the lattice that covers the raster.
const LATTICE: [u32; 2] = [20, 10];
/// Half side of the window around a star, pixels; it contains all of the star's light.
const PATCH_PX: i64 = 8;

/// Error metric of stars on a projector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectorMetric {
    /// Root mean square relative error of their light.
    LightRms,
    /// Largest relative error of their light.
    LightLargest,
    /// Root mean square distance of the centroid of their light from their position, pixels.
    CentroidPx,
    /// Root mean square distance of their light from its centroid, mean over the stars, pixels.
    WidthPx,
    /// Standard deviation of that width over the stars, divided by its mean.
    WidthVariation,
}

named!(ProjectorMetric {
    LightRms = "light_rms",
    LightLargest = "light_largest",
    CentroidPx = "centroid_px",
    WidthPx = "width_px",
    WidthVariation = "width_variation",
});

impl ProjectorMetric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::LightRms => "rms relative error of the light of 200 stars on a projector, with exact solid angles",
            Self::LightLargest => "the largest relative error of the light of these stars",
            Self::CentroidPx => "rms distance of a star's centroid from its position, pixels",
            Self::WidthPx => "rms distance of a star's light from its centroid, pixels, mean: less is sharper",
            Self::WidthVariation => "std/mean of a star's width over the stars",
        }
    }
}

/// A pinhole projector at the rim of a dome of radius 1 that lights the opposite side, seen from the centre.
struct Throw {
    size: [u32; 2],
    place: DVec3,
    /// Columns: right, up, backwards.
    dome_from_projector: DMat3,
    half_tangents: DVec2,
}

impl Throw {
    fn new(size: [u32; 2]) -> Self {
        let pitch = PI / 6.0;
        let backwards = DVec3::new(0.0, -pitch.sin(), pitch.cos());
        let aspect = f64::from(size[1]) / f64::from(size[0]);
        let half = (PI / 5.0).tan();
        Self {
            size,
            place: DVec3::new(0.0, 0.0, 0.98),
            dome_from_projector: DMat3::from_cols(DVec3::X, backwards.cross(DVec3::X), backwards),
            half_tangents: DVec2::new(half, half * aspect),
        }
    }

    fn direction(&self, pixel: DVec2) -> DVec3 {
        let [width, height] = self.size.map(f64::from);
        let plane = DVec2::new(2.0 * pixel.x / width - 1.0, 1.0 - 2.0 * pixel.y / height) * self.half_tangents;
        let ray = (self.dome_from_projector * plane.extend(-1.0)).normalize();
        let half = self.place.dot(ray);
        (self.place + ray * ((half * half - self.place.length_squared() + 1.0).sqrt() - half)).normalize()
    }
}

impl PlaneMapping for Throw {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let ray = self.dome_from_projector.transpose() * (direction.normalize() - self.place);
        if ray.z >= 0.0 {
            return None;
        }
        let plane = ray.truncate() / -ray.z / self.half_tangents;
        let [width, height] = self.size.map(f64::from);
        Some(DVec2::new((plane.x + 1.0) * width, (1.0 - plane.y) * height) / 2.0)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let [width, height] = self.size.map(f64::from);
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= width && pixel.y <= height;
        inside.then(|| self.direction(pixel))
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        let [width, height] = self.size.map(f64::from);
        let axis = self.direction(DVec2::new(width, height) / 2.0);
        let corners = [0.0, 0.5, 1.0].map(|x| [0.0, 0.5, 1.0].map(|y| DVec2::new(x * width, y * height)));
        let reach =
            corners.iter().flatten().map(|corner| self.direction(*corner).angle_between(axis)).fold(0.0, f64::max);
        let pixel_rad = 2.0 * reach / width.min(height);
        BoundingCone { axis, half_angle_rad: (reach + (margin_px + 2.0) * pixel_rad).min(PI) }
    }
}

/// A method of filling the projector's pixels.
struct Method {
    name: &'static str,
    rig: Rig,
}

fn methods(size: [u32; 2]) -> Result<Vec<Method>, String> {
    let mapping = Arc::new(TabulatedMapping::new(Throw::new(size)).map_err(|error| error.to_string())?);
    let ways =
        [("direct", None), ("resampled_half", Some(0.5)), ("resampled", Some(1.0)), ("resampled_double", Some(2.0))];
    let methods = ways.into_iter().map(|(name, scale)| {
        let resampling = scale.map(|scale| Resampling::new(&mapping, scale)).transpose();
        let resampling = resampling.map_err(|error| error.to_string())?;
        let output = Arc::new(ProjectorOutput::new(size, resampling, None, Response::default())?);
        let kind = ViewKind::Projector { mapping: Arc::clone(&mapping), output };
        Ok(Method { name, rig: rig_of(vec![("throw", kind)]).map_err(|error| error.to_string())? })
    });
    methods.collect()
}

/// Measurements of one star.
struct Measured {
    light: f64,
    off_px: f64,
    width_px: f64,
}

/// Returns the measured stars, well within the raster and at varied positions within a pixel.
fn stars(size: [u32; 2]) -> Vec<(DVec2, StarRecord)> {
    let throw = Throw::new(size);
    let [columns, rows] = LATTICE;
    let places = (0..columns * rows).map(|index| {
        let along = |cell: u32, count: u32, side: u32, step: f64| {
            (f64::from(cell) + 0.5) / f64::from(count) * f64::from(side) + (f64::from(index) * step).fract() - 0.5
        };
        DVec2::new(
            along(index % columns, columns, size[0], 0.618_034),
            along(index / columns, rows, size[1], 0.754_878),
        )
    });
    places.map(|place| (place, at_infinity(throw.direction(place)))).collect()
}

const MAGNITUDE: f64 = 2.0;

fn at_infinity(direction: DVec3) -> StarRecord {
    StarRecord { position: direction, magnitude: MAGNITUDE as f32, temperature_k: 5772.0, distance_known: false }
}

fn measured(image: &FrameImage, place: DVec2) -> Option<Measured> {
    let hdr = image.hdr.as_ref()?;
    let throw = Throw::new([image.width, image.height]);
    let [left, top] = [place.x as i64 - PATCH_PX, place.y as i64 - PATCH_PX];
    let side = 2 * PATCH_PX + 1;
    let inside = |x: i64, y: i64| x >= 0 && y >= 0 && x < i64::from(image.width) && y < i64::from(image.height);
    let mut pixels = Vec::new();
    for (x, y) in
        (0..side * side).map(|index| (left + index % side, top + index / side)).filter(|(x, y)| inside(*x, *y))
    {
        let [red, green, blue, _] = hdr[y as usize * image.width as usize + x as usize].map(f64::from);
        let light = luminance([red, green, blue]);
        if light > 0.0 {
            pixels.push((pixel_centre(x as u32, y as u32), light * throw.solid_angle_sr(x as u32, y as u32)));
        }
    }
    let sum: f64 = pixels.iter().map(|(_, light)| light).sum();
    let middle = pixels.iter().map(|(pixel, light)| *pixel * *light).sum::<DVec2>() / sum;
    let square = pixels.iter().map(|(pixel, light)| light * pixel.distance_squared(middle)).sum::<f64>() / sum;
    Some(Measured {
        light: sum / illuminance_lx_from_magnitude(MAGNITUDE) - 1.0,
        off_px: middle.distance(place),
        width_px: square.sqrt(),
    })
}

fn scores(stars: &[Measured]) -> [f64; ProjectorMetric::ALL.len()] {
    let count = stars.len() as f64;
    let rms = |error: fn(&Measured) -> f64| (stars.iter().map(|star| error(star).powi(2)).sum::<f64>() / count).sqrt();
    let width = stars.iter().map(|star| star.width_px).sum::<f64>() / count;
    let variance = stars.iter().map(|star| (star.width_px - width).powi(2)).sum::<f64>() / count;
    ProjectorMetric::ALL.map(|metric| match metric {
        ProjectorMetric::LightRms => rms(|star| star.light),
        ProjectorMetric::LightLargest => stars.iter().map(|star| star.light.abs()).fold(0.0, f64::max),
        ProjectorMetric::CentroidPx => rms(|star| star.off_px),
        ProjectorMetric::WidthPx => width,
        ProjectorMetric::WidthVariation => variance.sqrt() / width,
    })
}

fn scored(
    renderer: &mut Renderer,
    rig: &Rig,
    settings: &RenderSettings,
    size: [u32; 2],
) -> Result<Vec<Score>, ChartError> {
    let stars = stars(size);
    let scene = snapshot_at_rest(stars.iter().map(|(_, record)| *record).collect());
    let request = FrameRequest::new(&scene, rig).settings(settings).wanted(Wanted::hdr());
    let frame = match renderer.render(request) {
        Ok(frame) => frame,
        Err(error) => return Ok(vec![Score::none(message_of(error)?); ProjectorMetric::ALL.len()]),
    };
    let found: Vec<Measured> = stars.iter().filter_map(|(place, _)| measured(&frame.images[0], *place)).collect();
    Ok(scores(&found).map(|value| Score { value: Some(value), note: String::new() }).to_vec())
}

/// Returns a scene with a camera whose axes are the world axes.
fn snapshot_at_rest(records: Vec<StarRecord>) -> SceneSnapshot {
    SceneSnapshot { camera: crate::scene::Camera::default(), ..snapshot(records) }
}

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    skies: &mut Skies,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let size = extent.projector;
    let mut step =
        |done: usize, task: &str| report_step(&Step { axis: Axis::Projectors, done, total: 3, task: task.to_owned() });
    step(0, "baking");
    let methods = methods(size).map_err(ChartError::Projector)?;
    let sky = Sky::Galaxy(extent.many_views_stars);
    let records = skies.records(sky)?;
    let faintest = records.iter().map(|record| record.apparent_magnitude()).fold(f64::NEG_INFINITY, f64::max);
    let settings = settings_of(StarMethod::BSpline, TIMING_EV100, illuminance_lx_from_magnitude(faintest));
    step(1, "scoring");
    let mut scores = Vec::new();
    for method in &methods {
        scores.push(scored(renderer, &method.rig, &settings, size)?);
    }
    step(2, &format!("timing with {} stars", sky.name()));
    let scene = snapshot(records.to_vec());
    let timed = timing::rounds(methods.len(), extent.rounds, budget, |index| {
        let start = Instant::now();
        let request = FrameRequest::new(&scene, &methods[index].rig).settings(&settings).wanted(Wanted::display());
        match renderer.render(request) {
            Ok(_) => Ok(Ok((Some(start.elapsed().as_secs_f64() * 1e3), start.elapsed()))),
            Err(error) => message_of(error).map(Err),
        }
    })?;
    let case = Case {
        axis: Axis::Projectors,
        workload: format!("throw-{}p", size[1]),
        adapter: renderer.adapter().adapter.clone(),
        size,
        items: extent.many_views_stars as u64,
        planes: false,
    };
    let mut rows = Vec::new();
    for ((method, timed), scores) in methods.iter().zip(&timed).zip(&scores) {
        for (metric, score) in ProjectorMetric::ALL.into_iter().zip(scores) {
            let note = "time of the whole frame, display image read back";
            rows.push(case.named_row([method.name, "steradian"], timed, metric.name(), score, note));
        }
    }
    Ok(rows)
}

//! Scores: the figures of one method over the scoring scenes. Truth is f64, from the stars' magnitudes and the projection's
//! own solid angles; the metrics are those that tests and `verify` use. Methods of relative brightness are scored after one
//! fitted scale per figure; they cannot be right in any other way.

mod asteroids;
mod cell_sky;
mod glare;
mod measure;

pub use self::{asteroids::AsteroidMetric, glare::GlareMetric};
pub(super) use self::{
    asteroids::{AsteroidScenes, score_asteroids},
    glare::{GlareScenes, ScoredSky, score_glare},
};
use super::{
    Budget, ChartError,
    scenes::{Placed, Scene},
    timing::message_of,
};
use crate::{
    metrics::MetricError,
    plan::settings::{ExposureMode, GlareSettings, RenderSettings, StarMethod},
    render::{RenderError, Renderer, Wanted},
    units::magnitude_from_illuminance_lx,
};

/// An error metric of the axis `stars`. Of a perfect method each is 0, apart from [`Metric::Keeps20000Stars`], which is 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Metric {
    /// Relative error of the light of the workload's whole frame, stars at the border left out.
    FluxTotal,
    /// Root mean square relative error of single stars' light, from centre to corner of views of 60 and 110 degrees.
    FluxStarRms,
    /// Root mean square error of the centroid over sub-pixel positions, pixels.
    CentroidPx,
    /// Flicker after tone mapping of a star whose peak is display white.
    FlickerK1,
    /// The same at ten times display white.
    FlickerK10,
    /// The same at a hundred times display white.
    FlickerK100,
    /// Flicker before tone mapping.
    FlickerLinear,
    /// Mean ellipticity in view space, 45 degrees off the axis of a view of 110 degrees.
    EllipticityView45Deg,
    /// Standard deviation over mean of a star's width over sub-pixel positions.
    WidthVariation,
    /// Distance in u'v' of a star of 3000 K and one of 20,000 K in one pixel from the sum of their light.
    ColourUv,
    /// The larger relative error of the light of Sirius and of a star of magnitude 21 beside it.
    DynamicRange,
    /// Share of the pixels of a crowded picture whose bits differ between shuffles of the stars, or from run to run.
    OrderBitsDiffer,
    /// Share of their light that 20,000 equal stars in one pixel keep.
    Keeps20000Stars,
    /// Largest over smallest light of a star at the edges and corners of a cubemap, less 1.
    Seam,
}

impl Metric {
    /// Every metric, in the order of the chart.
    pub const ALL: [Self; 14] = [
        Self::FluxTotal,
        Self::FluxStarRms,
        Self::CentroidPx,
        Self::FlickerK1,
        Self::FlickerK10,
        Self::FlickerK100,
        Self::FlickerLinear,
        Self::EllipticityView45Deg,
        Self::WidthVariation,
        Self::ColourUv,
        Self::DynamicRange,
        Self::OrderBitsDiffer,
        Self::Keeps20000Stars,
        Self::Seam,
    ];

    /// Name in `chart.csv`.
    pub fn name(self) -> &'static str {
        match self {
            Self::FluxTotal => "flux_total",
            Self::FluxStarRms => "flux_star_rms",
            Self::CentroidPx => "centroid_px",
            Self::FlickerK1 => "flicker_k1",
            Self::FlickerK10 => "flicker_k10",
            Self::FlickerK100 => "flicker_k100",
            Self::FlickerLinear => "flicker_linear",
            Self::EllipticityView45Deg => "ellipticity_view_45deg",
            Self::WidthVariation => "width_variation",
            Self::ColourUv => "colour_uv",
            Self::DynamicRange => "dynamic_range",
            Self::OrderBitsDiffer => "order_bits_differ",
            Self::Keeps20000Stars => "keeps_20000_stars",
            Self::Seam => "seam",
        }
    }

    /// What it tells, in a line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::FluxTotal => {
                "relative error of the light of the workload's whole frame (stars at its border left out)"
            }
            Self::FluxStarRms => {
                "rms relative error of single stars' light, magnitudes 2 to 5, centre to corner at 60 and 110 degrees"
            }
            Self::CentroidPx => "rms error of a star's centroid over sub-pixel positions, pixels",
            Self::FlickerK1 => "std/mean over sub-pixel positions of what is displayed of a star as bright as white",
            Self::FlickerK10 => "std/mean over sub-pixel positions of what is displayed of a star at 10 x white",
            Self::FlickerK100 => "std/mean over sub-pixel positions of what is displayed of a star at 100 x white",
            Self::FlickerLinear => "std/mean over sub-pixel positions of a star's light before tone mapping",
            Self::EllipticityView45Deg => {
                "1 - minor/major axis of a star in view space, 45 degrees off the axis of a 110-degree view, mean"
            }
            Self::WidthVariation => "std/mean of a star's width over sub-pixel positions",
            Self::ColourUv => "error in u'v' of two stars of 3000 and 20,000 K in one pixel",
            Self::DynamicRange => "larger relative error of Sirius and of a star of magnitude 21 beside it",
            Self::OrderBitsDiffer => {
                "share of pixels whose bits differ when the stars are shuffled, or from run to run"
            }
            Self::Keeps20000Stars => "share of their light that 20,000 equal stars in a pixel keep: 1 is right",
            Self::Seam => "largest over smallest light of a star at a cubemap's edges and corners, less 1",
        }
    }

    /// The value of a perfect method.
    pub fn best(self) -> f64 {
        if self == Self::Keeps20000Stars { 1.0 } else { 0.0 }
    }
}

/// A figure of a method, or why there is none.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Score {
    /// The figure; `None`: it does not apply or could not be measured.
    pub value: Option<f64>,
    /// What a reader must know about it.
    pub note: String,
}

impl Score {
    fn of(value: f64) -> Self {
        Self { value: Some(value), note: String::new() }
    }

    pub(super) fn none(note: impl Into<String>) -> Self {
        Self { value: None, note: note.into() }
    }
}

/// All figures of a method that do not depend on the workload: of a star method those of [`Metric::ALL`] without
/// [`Metric::FluxTotal`].
#[derive(Clone, Debug, PartialEq)]
pub struct Scores<M = Metric>(Vec<(M, Score)>);

impl<M: PartialEq> Scores<M> {
    /// The figure of a metric.
    pub fn get(&self, metric: M) -> Option<&Score> {
        self.0.iter().find(|(of, _)| *of == metric).map(|(_, score)| score)
    }
}

/// How large the scoring scenes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScoringSize {
    /// Side of the images, pixels.
    pub image_px: u32,
    /// Sub-pixel positions of a sweep, at least.
    pub positions: usize,
    /// Stars of the crowded picture whose order is shuffled; an eighth of them where a star covers thousands of pixels.
    pub crowd: usize,
    /// Stars in one pixel.
    pub heap: usize,
    /// Shuffles, beside two runs of the usual order.
    pub shuffles: u64,
}

impl Default for ScoringSize {
    fn default() -> Self {
        Self { image_px: 1024, positions: 1000, crowd: 4000, heap: 20_000, shuffles: 100 }
    }
}

/// Why one figure of a method could not be measured, or none of anything any more.
#[derive(Debug)]
enum Failure {
    Chart(ChartError),
    Method(String),
}

impl From<ChartError> for Failure {
    fn from(error: ChartError) -> Self {
        Self::Chart(error)
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        message_of(error).map_or_else(Self::Chart, Self::Method)
    }
}

impl From<MetricError> for Failure {
    fn from(error: MetricError) -> Self {
        Self::Method(error.to_string())
    }
}

/// Settings of a method at an exposure. The published Gaussians, whose exponent (lim - sat) (sat - m) ends 6.8 / (lim - sat)
/// magnitudes below saturation, are given limits 2.6 magnitudes apart around the faintest of the stars, so that all methods draw
/// all of them. Glare, which takes light from stars and has an axis of its own, is off.
pub(super) fn settings_of(method: StarMethod, ev100: f64, faintest_lx: f64) -> RenderSettings {
    let mut settings = RenderSettings::default();
    settings.stars.method = method;
    settings.glare = GlareSettings::none();
    settings.exposure.mode = ExposureMode::Manual;
    settings.exposure.ev100 = ev100;
    let faintest = magnitude_from_illuminance_lx(faintest_lx);
    if faintest.is_finite() {
        settings.stars.gaussian_psf.limiting_magnitude = faintest + 1.6;
        settings.stars.gaussian_psf.saturation_magnitude = faintest - 1.0;
    }
    settings
}

/// Illuminance of the faintest star, lx; infinite without any.
pub(super) fn faintest_lx(stars: &[Placed]) -> f64 {
    stars.iter().map(|star| star.illuminance_lx).fold(f64::INFINITY, f64::min)
}

/// Pixels of an HDR image, as a frame holds them.
type Pixels = Vec<[f32; 4]>;

/// Draws a scene at an exposure: the HDR images of its view.
type Draw<'a> = Box<dyn FnMut(&Scene, f64) -> Result<Vec<Pixels>, Failure> + 'a>;

/// One method over the scoring scenes.
struct Scorer<'a> {
    draw: Draw<'a>,
    method: StarMethod,
    size: ScoringSize,
    budget: Budget,
    /// Side of the cell of a star in the scenes, pixels: room for all of its light.
    cell_px: u32,
}

/// Measures all figures of a method that do not depend on a workload.
///
/// # Errors
/// [`ChartError`] where the device fails. A figure that cannot be measured has a note instead of a value.
pub fn score_method(
    renderer: &mut Renderer,
    method: StarMethod,
    size: ScoringSize,
    time: std::time::Duration,
) -> Result<Scores, ChartError> {
    if !method.draws_catalogue() {
        return cell_sky::scores(renderer, size, time);
    }
    let cell_px = match method {
        StarMethod::GlareDisc | StarMethod::PsfTexture => 128,
        _ => 32,
    };
    let draw = |scene: &Scene, ev100: f64| {
        let settings = settings_of(method, ev100, faintest_lx(&scene.stars));
        let wanted = [Wanted { hdr: true, ..Wanted::default() }];
        renderer.catalogue_order = scene.order;
        let frame = renderer.render(&scene.snapshot, &scene.rig, &settings, &wanted, None);
        renderer.catalogue_order = None;
        let frame = frame?;
        Ok(frame.images.into_iter().filter_map(|image| image.hdr).collect())
    };
    let mut scorer = Scorer { draw: Box::new(draw), method, size, budget: Budget::new(time), cell_px };
    type Measure<'a> = fn(&mut Scorer<'a>) -> Result<Vec<Score>, Failure>;
    let groups: [(&[Metric], Measure<'_>); 7] = [
        (
            &[
                Metric::FlickerK1,
                Metric::FlickerK10,
                Metric::FlickerK100,
                Metric::FlickerLinear,
                Metric::CentroidPx,
                Metric::WidthVariation,
            ],
            Scorer::sweep,
        ),
        (&[Metric::FluxStarRms], Scorer::single_stars),
        (&[Metric::EllipticityView45Deg], Scorer::ellipticity),
        (&[Metric::ColourUv], Scorer::colour),
        (&[Metric::DynamicRange], Scorer::range),
        (&[Metric::OrderBitsDiffer], Scorer::order),
        (&[Metric::Keeps20000Stars], Scorer::heap),
    ];
    let mut scores = Vec::new();
    let mut add = |metrics: &[Metric], found: Result<Vec<Score>, Failure>| -> Result<(), ChartError> {
        match found {
            Ok(found) => scores.extend(metrics.iter().copied().zip(found)),
            Err(Failure::Method(note)) => {
                scores.extend(metrics.iter().map(|metric| (*metric, Score::none(note.clone()))));
            }
            Err(Failure::Chart(error)) => return Err(error),
        }
        Ok(())
    };
    for (metrics, measure) in groups {
        add(metrics, measure(&mut scorer))?;
    }
    add(&[Metric::Seam], scorer.seam())?;
    Ok(Scores(scores))
}

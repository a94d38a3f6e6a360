//! Scores: the figures of one method over the scoring scenes. The true values are computed in f64 from the stars'
//! magnitudes and the projection's exact solid angles; the metrics are the same as in tests and `verify`. Methods with
//! relative brightness are scored after fitting one scale per figure, because they have no absolute scale.

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
    plan::settings::{ExposureSettings, GlareSettings, RenderSettings, StarMethod},
    render::{FrameRequest, RenderError, Renderer, Wanted},
    units::magnitude_from_illuminance_lx,
};

/// Error metric of the axis `stars`. A perfect method has 0 for each, except for [`Metric::Keeps20000Stars`], which is
/// 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Metric {
    /// Relative error of the light of the workload's whole frame, without stars at the border.
    FluxTotal,
    /// Root mean square relative error of single stars' light, from centre to corner of views of 60 and 110 degrees.
    FluxStarRms,
    /// Root mean square error of the centroid over sub-pixel positions, pixels.
    CentroidPx,
    /// Flicker after tone mapping of a star whose peak is display white.
    FlickerK1,
    /// Flicker at ten times display white.
    FlickerK10,
    /// Flicker at a hundred times display white.
    FlickerK100,
    /// Flicker before tone mapping.
    FlickerLinear,
    /// Mean ellipticity in view space, 45 degrees off the axis of a view of 110 degrees.
    EllipticityView45Deg,
    /// Standard deviation of a star's width over sub-pixel positions, divided by its mean.
    WidthVariation,
    /// Chromaticity error in u'v' of a star of 3000 K and one of 20,000 K that share a pixel.
    ColourUv,
    /// Larger of the relative errors of the light of Sirius and of a star of magnitude 21 near it.
    DynamicRange,
    /// Share of pixels in a crowded picture whose bits differ between shuffles of the stars, or between runs.
    OrderBitsDiffer,
    /// Share of their light that 20,000 equal stars in one pixel keep.
    Keeps20000Stars,
    /// Largest light of a star at the edges and corners of a cubemap divided by the smallest, minus 1.
    Seam,
}

named!(Metric {
    FluxTotal = "flux_total",
    FluxStarRms = "flux_star_rms",
    CentroidPx = "centroid_px",
    FlickerK1 = "flicker_k1",
    FlickerK10 = "flicker_k10",
    FlickerK100 = "flicker_k100",
    FlickerLinear = "flicker_linear",
    EllipticityView45Deg = "ellipticity_view_45deg",
    WidthVariation = "width_variation",
    ColourUv = "colour_uv",
    DynamicRange = "dynamic_range",
    OrderBitsDiffer = "order_bits_differ",
    Keeps20000Stars = "keeps_20000_stars",
    Seam = "seam",
});

impl Metric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::FluxTotal => {
                "relative error of the light of the workload's whole frame (without stars at its border)"
            }
            Self::FluxStarRms => {
                "rms relative error of single stars' light, magnitudes 2 to 5, centre to corner at 60 and 110 degrees"
            }
            Self::CentroidPx => "rms error of a star's centroid over sub-pixel positions, pixels",
            Self::FlickerK1 => "std/mean over sub-pixel positions of the displayed light of a star as bright as white",
            Self::FlickerK10 => "std/mean over sub-pixel positions of the displayed light of a star at 10 x white",
            Self::FlickerK100 => "std/mean over sub-pixel positions of the displayed light of a star at 100 x white",
            Self::FlickerLinear => "std/mean over sub-pixel positions of a star's light before tone mapping",
            Self::EllipticityView45Deg => {
                "1 - minor/major axis of a star in view space, 45 degrees off the axis of a 110-degree view, mean"
            }
            Self::WidthVariation => "std/mean of a star's width over sub-pixel positions",
            Self::ColourUv => "error in u'v' of two stars of 3000 and 20,000 K in one pixel",
            Self::DynamicRange => "larger of the relative errors of Sirius and of a star of magnitude 21 near it",
            Self::OrderBitsDiffer => "share of pixels whose bits differ when the stars are shuffled, or between runs",
            Self::Keeps20000Stars => "share of their light that 20,000 equal stars in a pixel keep: 1 is right",
            Self::Seam => "largest light of a star at a cubemap's edges and corners divided by the smallest, minus 1",
        }
    }

    /// Returns the value of a perfect method.
    pub fn best(self) -> f64 {
        if self == Self::Keeps20000Stars { 1.0 } else { 0.0 }
    }
}

/// A figure of a method, or the reason why it is missing.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Score {
    /// The figure; `None`: it does not apply or could not be measured.
    pub value: Option<f64>,
    /// Remark on the figure.
    pub note: String,
}

impl Score {
    fn from_value(value: f64) -> Self {
        Self { value: Some(value), note: String::new() }
    }

    pub(super) fn none(note: impl Into<String>) -> Self {
        Self { value: None, note: note.into() }
    }
}

/// All figures of a method that do not depend on the workload; for a star method all of [`Metric::ALL`] except
/// [`Metric::FluxTotal`].
#[derive(Clone, Debug, PartialEq)]
pub struct Scores<M = Metric>(Vec<(M, Score)>);

impl<M: PartialEq> Scores<M> {
    /// Returns the score of a metric.
    pub fn get(&self, metric: M) -> Option<&Score> {
        self.0.iter().find(|(name, _)| *name == metric).map(|(_, score)| score)
    }
}

/// Size of the scoring scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScoringSize {
    /// Side of the images, pixels.
    pub image_px: u32,
    /// Minimum number of sub-pixel positions of a sweep.
    pub positions: usize,
    /// Stars of the crowded picture whose order is shuffled; an eighth of them if a star covers thousands of pixels.
    pub crowd: usize,
    /// Stars in the same pixel.
    pub heap: usize,
    /// Number of shuffles, in addition to two runs in the default order.
    pub shuffles: u64,
}

impl Default for ScoringSize {
    fn default() -> Self {
        Self { image_px: 1024, positions: 1000, crowd: 4000, heap: 20_000, shuffles: 100 }
    }
}

/// Reason why one figure of a method, or all further figures, could not be measured.
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

/// Returns the settings of a method at an exposure. The published Gaussians have the exponent (lim - sat) (sat - m) and therefore end 6.8 / (lim -
/// sat) magnitudes below saturation. Their limits are set around the faintest star, 2.6 magnitudes apart, so that all methods draw all stars. Glare
/// is off, because it takes light from stars; it has a separate axis.
pub(super) fn settings_of(method: StarMethod, ev100: f64, faintest_lx: f64) -> RenderSettings {
    let mut settings = RenderSettings::default();
    settings.stars.method = method;
    settings.glare = GlareSettings::none();
    settings.exposure = ExposureSettings::manual(ev100);
    let faintest = magnitude_from_illuminance_lx(faintest_lx);
    if faintest.is_finite() {
        settings.stars.gaussian_psf.limiting_magnitude = faintest + 1.6;
        settings.stars.gaussian_psf.saturation_magnitude = faintest - 1.0;
    }
    settings
}

/// Returns the illuminance of the faintest star, lx; infinite without stars.
pub(super) fn faintest_lx(stars: &[Placed]) -> f64 {
    stars.iter().map(|star| star.illuminance_lx).fold(f64::INFINITY, f64::min)
}

/// Pixels of an HDR image, as stored in a frame.
type Pixels = Vec<[f32; 4]>;

/// Draws a scene at an exposure and returns the HDR images of its view.
type Draw<'a> = Box<dyn FnMut(&Scene, f64) -> Result<Vec<Pixels>, Failure> + 'a>;

/// Measures one method over the scoring scenes.
struct Scorer<'a> {
    draw: Draw<'a>,
    method: StarMethod,
    size: ScoringSize,
    budget: Budget,
    /// Side of a star's cell in the scenes, pixels; it contains all of the star's light.
    cell_px: u32,
}

/// Measures all figures of a method that do not depend on a workload.
///
/// # Errors
/// [`ChartError`] if the device fails. A figure that cannot be measured has a note instead of a value.
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
    // Draws a scene with the method at an exposure.
    let draw = |scene: &Scene, ev100: f64| {
        let settings = settings_of(method, ev100, faintest_lx(&scene.stars));
        renderer.catalogue_order = scene.order;
        let frame =
            renderer.render(FrameRequest::new(&scene.snapshot, &scene.rig).settings(&settings).wanted(Wanted::hdr()));
        renderer.catalogue_order = None;
        let frame = frame?;
        Ok(frame.images.into_iter().filter_map(|image| image.hdr).collect())
    };
    let mut scorer = Scorer { draw: Box::new(draw), method, size, budget: Budget::new(time), cell_px };
    // The metrics and the function that measures them together.
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
    // Measure all groups; a failure of the method becomes a note.
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

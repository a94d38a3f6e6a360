//! Scores of glare: compares the light that a method scatters in one view with the convolution on the sphere in f64.
//!
//! All light is scattered (a fraction of 1), so the picture contains only the veil. `scenes` holds the scenes and the
//! expected values, built once per view and shared by all methods.

mod scenes;

use glam::DVec3;

use self::scenes::{Compared, Placed};
pub(in crate::chart) use self::scenes::{GlareScenes, ScoredSky};
use super::{Failure, Pixels, Score, Scores, measure::pixels_of};
use crate::{
    chart::ChartError,
    metrics::{HdrView, log_log_slope, radial_profile, relative_errors, roundness, total_illuminance_lx},
    plan::settings::{ExposureSettings, GlareSettings, RenderSettings},
    render::{FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{Rig, ViewImage},
};

/// Error metric of the axis `glare`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GlareMetric {
    /// Root mean square relative error of the veil over pixels spread evenly over the picture.
    VeilRms,
    /// Largest relative error of the veil over these pixels.
    VeilLargest,
    /// Largest deviation from the mean on a circle around an off-axis source.
    Roundness,
    /// Slope of log luminance over log angle.
    Slope,
    /// Light in the picture from a source two degrees outside of it, divided by the correct value.
    FromOutside,
    /// Largest step of the veil across an edge of a cube, relative to the correct value.
    Seam,
    /// Scattered light of one source in the picture, divided by the correct value.
    FluxKept,
}

named!(GlareMetric {
    VeilRms = "veil_rms",
    VeilLargest = "veil_largest",
    Roundness = "veil_roundness",
    Slope = "veil_slope",
    FromOutside = "veil_from_outside",
    Seam = "veil_seam",
    FluxKept = "veil_flux_kept",
});

impl GlareMetric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::VeilRms => "rms relative error of the scattered light at sampled pixels of a starry sky",
            Self::VeilLargest => "largest relative error of the scattered light at the same pixels",
            Self::Roundness => {
                "largest deviation from the mean around a source 45 and 60 degrees off the axis, or 0.85 of the half field"
            }
            Self::Slope => "slope of log luminance over log angle around one source: -2 is right",
            Self::FromOutside => {
                "veil of a source 2 degrees outside of the picture divided by the correct one: 1 is right"
            }
            Self::Seam => "largest step of the veil across a cube's edge, relative to the correct value",
            Self::FluxKept => {
                "scattered light of one source inside of the picture divided by the correct one: 1 is right"
            }
        }
    }

    /// Returns the value of a perfect method.
    pub fn best(self) -> f64 {
        match self {
            Self::Slope => -2.0,
            Self::FromOutside | Self::FluxKept => 1.0,
            Self::VeilRms | Self::VeilLargest | Self::Roundness | Self::Seam => 0.0,
        }
    }
}

/// Draws only the scattered light of a scene: the HDR images of the rig's view.
type DrawVeil<'a> = dyn FnMut(&SceneSnapshot, &Rig) -> Result<Vec<Pixels>, Failure> + 'a;

/// Measures all figures of a method in one view.
///
/// # Errors
/// [`ChartError`] if the device fails. A figure that cannot be measured has a note instead of a value.
pub(in crate::chart) fn score_glare(
    renderer: &mut Renderer,
    settings: &GlareSettings,
    scenes: &GlareScenes,
) -> Result<Scores<GlareMetric>, ChartError> {
    let glare = GlareSettings { fraction: 1.0, ..settings.clone() };
    let mut all = RenderSettings { glare, ..RenderSettings::default() };
    all.exposure = ExposureSettings::manual(-3.0);
    score(scenes, &mut |scene, rig| {
        let frame = renderer.render(FrameRequest::new(scene, rig).settings(&all).wanted(Wanted::hdr()))?;
        Ok(frame.images.into_iter().filter_map(|image| image.hdr).collect())
    })
}

/// A function that measures some of the figures.
type Measure<'a> = dyn Fn(&mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> + 'a;

/// Measures all figures of the pictures that `draw` returns.
fn score(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Scores<GlareMetric>, ChartError> {
    let groups: [(&[GlareMetric], &Measure<'_>); 6] = [
        (&[GlareMetric::VeilRms, GlareMetric::VeilLargest], &|draw| veil(scenes, draw)),
        (&[GlareMetric::Roundness], &|draw| round(scenes, draw)),
        (&[GlareMetric::Slope], &|draw| slope(scenes, draw)),
        (&[GlareMetric::FromOutside], &|draw| from_outside(scenes, draw)),
        (&[GlareMetric::Seam], &|draw| seam(scenes, draw)),
        (&[GlareMetric::FluxKept], &|draw| flux_kept(scenes, draw)),
    ];
    let mut scores = Vec::new();
    for (metrics, measure) in groups {
        match measure(draw) {
            Ok(found) => scores.extend(metrics.iter().copied().zip(found)),
            Err(Failure::Method(note)) => {
                scores.extend(metrics.iter().map(|metric| (*metric, Score::none(note.clone()))));
            }
            Err(Failure::Chart(error)) => return Err(error),
        }
    }
    Ok(Scores(scores))
}

/// Returns the images in the form that the metrics need, in camera axes.
fn hdr_views<'a>(images: &'a [ViewImage], pixels: &'a [Pixels]) -> Result<Vec<HdrView<'a>>, Failure> {
    let view = |(index, image): (usize, &'a ViewImage)| {
        Ok(HdrView::new(image.projection.mapping(), pixels_of(pixels, index)?)?.turned(image.camera_from_view))
    };
    images.iter().enumerate().map(view).collect()
}

fn measured(views: &[HdrView<'_>], place: &Compared) -> f64 {
    let [x, y] = place.pixel;
    views[place.image].luminance_cd_m2(x, y)
}

/// Measures the starry sky pixel by pixel.
fn veil(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    let pixels = draw(&scenes.sky, &scenes.rig)?;
    let views = hdr_views(scenes.images(), &pixels)?;
    let pairs: Vec<(f64, f64)> =
        scenes.places.iter().map(|place| (measured(&views, place), place.expected_cd_m2)).collect();
    let errors = relative_errors(&pairs)?;
    let note = format!("{} of {} pixels, the others are next to a source", pairs.len(), scenes.sampled);
    Ok([errors.rms, errors.largest].map(|value| Score { value: Some(value), note: note.clone() }).to_vec())
}

/// Measures circles around off-axis sources.
fn round(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    let mut worst = 0.0_f64;
    for Placed { direction, scene } in &scenes.off_axis {
        let pixels = draw(scene, &scenes.rig)?;
        let found = roundness(&hdr_views(scenes.images(), &pixels)?, *direction, scenes.circle_rad)?;
        worst = worst.max(found.largest_deviation);
    }
    let angles: Vec<String> = scenes
        .off_axis
        .iter()
        .map(|source| format!("{:.0}", source.direction.angle_between(DVec3::NEG_Z).to_degrees()))
        .collect();
    let circle = scenes.circle_rad.to_degrees();
    Ok(vec![Score {
        value: Some(worst),
        note: format!("{} degrees off the axis, on circles of radius {circle:.1} degrees", angles.join(" and ")),
    }])
}

/// Measures the falloff around a source.
fn slope(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    let Placed { direction, scene } = &scenes.central;
    let pixels = draw(scene, &scenes.rig)?;
    let [from, to] = scenes.slope_rad;
    let edges: Vec<f64> = (0..=12).map(|i| from * (to / from).powf(f64::from(i) / 12.0)).collect();
    let profile =
        radial_profile(&hdr_views(scenes.images(), &pixels)?, *direction, &edges, |angle| scenes.per_sr(angle))?;
    Ok(vec![Score::from_value(log_log_slope(&profile, [from, to])?)])
}

/// Measures a source just outside of the picture.
fn from_outside(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    let Some((scene, places)) = &scenes.outside else {
        return Ok(vec![Score::none("does not apply: the view shows the whole sky")]);
    };
    let pixels = draw(scene, &scenes.rig)?;
    let views = hdr_views(scenes.images(), &pixels)?;
    let light = |luminance: &dyn Fn(&Compared) -> f64| {
        places.iter().map(|place| luminance(place) * place.omega_sr).sum::<f64>()
    };
    Ok(vec![Score::from_value(light(&|place| measured(&views, place)) / light(&|place| place.expected_cd_m2))])
}

/// Measures pixels on both sides of the edges of a cube.
fn seam(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    if scenes.edges.is_empty() {
        return Ok(vec![Score::none("does not apply: the view has no edges")]);
    }
    let pixels = draw(&scenes.central.scene, &scenes.rig)?;
    let views = hdr_views(scenes.images(), &pixels)?;
    let share = |place: &Compared| measured(&views, place) / place.expected_cd_m2;
    let step = |[here, there]: &[Compared; 2]| (share(here) - share(there)).abs();
    Ok(vec![Score::from_value(scenes.edges.iter().map(step).fold(0.0, f64::max))])
}

/// Measures all scattered light of one source.
fn flux_kept(scenes: &GlareScenes, draw: &mut DrawVeil<'_>) -> Result<Vec<Score>, Failure> {
    let pixels = draw(&scenes.central.scene, &scenes.rig)?;
    Ok(vec![Score::from_value(total_illuminance_lx(&hdr_views(scenes.images(), &pixels)?)? / scenes.flux_lx)])
}

#[cfg(test)]
mod tests;

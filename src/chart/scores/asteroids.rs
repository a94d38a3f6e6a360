//! Scores of asteroids: compares single asteroids drawn by a method with meshes at the finest level of detail, drawn by
//! the same renderer with 4 x 4 samples per pixel. Every asteroid has its own cell of the picture. Rows of cells differ
//! in size; the last rows have the sizes at which the impostors of each method just start.
//!
//! - *silhouettes*: asteroids without reflection in front of a luminous body; dark pixels are covered;
//! - *normals*: a Lambert surface lit by three suns, one picture per sun (`metrics::normals`);
//! - *light* and, between the eyes, *disparity*: the pictures under the suns.

mod scenes;

pub(in crate::chart) use self::scenes::AsteroidScenes;
use self::scenes::Cell;
use super::{
    Failure, Pixels, Score, Scores,
    measure::{mean, pixels_of, root_mean_square},
};
use crate::{
    chart::ChartError,
    metrics::{Overlap, mean_normal_error_rad, overlap},
    photometry::rec709::luminance,
    plan::settings::{AsteroidSettings, ExposureSettings, GlareSettings, ImpostorMethod, RenderSettings},
    render::{FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
};

/// Error metric of the axis `asteroids`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AsteroidMetric {
    /// Intersection over union of silhouettes, mean over all asteroids.
    SilhouetteIou,
    /// Mean displacement of the outline, pixels: maximum over all sizes.
    OutlinePx,
    /// Mean angle between normals, degrees.
    NormalDeg,
    /// Largest error of an asteroid's displacement between the eyes, pixels.
    DisparityPx,
    /// Root mean square relative error of single asteroids' light.
    Light,
}

named!(AsteroidMetric {
    SilhouetteIou = "silhouette_iou",
    OutlinePx = "outline_px",
    NormalDeg = "normal_error_deg",
    DisparityPx = "disparity_px",
    Light = "light_rms",
});

impl AsteroidMetric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::SilhouetteIou => {
                "silhouette's intersection over union with that of the finest mesh, mean: 1 is right"
            }
            Self::OutlinePx => "mean displacement of the outline, pixels, at the size where it is largest",
            Self::NormalDeg => {
                "mean angle between normals and those of the finest mesh, reconstructed from three suns, degrees"
            }
            Self::DisparityPx => "largest error of an asteroid's displacement between the eyes, pixels",
            Self::Light => "rms relative error of single asteroids' light",
        }
    }

    /// Returns the value of a perfect method.
    pub fn best(self) -> f64 {
        if self == Self::SilhouetteIou { 1.0 } else { 0.0 }
    }
}

/// All pictures of the scenes drawn by a method.
pub(in crate::chart) struct Drawn {
    backlit: Vec<Pixels>,
    lit: [Vec<Pixels>; 3],
}

/// The correct pictures.
pub(in crate::chart) struct Truth {
    /// The luminous body without asteroids.
    background: Vec<Pixels>,
    drawn: Drawn,
}

fn draw(
    renderer: &mut Renderer,
    scenes: &AsteroidScenes,
    scene: &SceneSnapshot,
    asteroids: &AsteroidSettings,
) -> Result<Vec<Pixels>, Failure> {
    let mut settings = RenderSettings { asteroids: asteroids.clone(), ..RenderSettings::default() };
    settings.glare = GlareSettings::none();
    settings.exposure = ExposureSettings::manual(12.0);
    let frame = renderer.render(FrameRequest::new(scene, &scenes.rig).settings(&settings).wanted(Wanted::hdr()))?;
    Ok(frame.images.into_iter().filter_map(|image| image.hdr).collect())
}

impl Drawn {
    fn draw(renderer: &mut Renderer, scenes: &AsteroidScenes, asteroids: &AsteroidSettings) -> Result<Self, Failure> {
        let backlit = draw(renderer, scenes, &scenes.backlit, asteroids)?;
        let [a, b, c] = &scenes.lit;
        let mut lit = |scene| draw(renderer, scenes, scene, asteroids);
        Ok(Self { backlit, lit: [lit(a)?, lit(b)?, lit(c)?] })
    }
}

impl AsteroidScenes {
    /// Draws meshes at the finest detail.
    ///
    /// # Errors
    /// [`ChartError`] if the device fails. If the scenes cannot be drawn, the message becomes the note of every figure.
    pub fn truth(&self, renderer: &mut Renderer) -> Result<Result<Truth, String>, ChartError> {
        let finest = AsteroidSettings {
            finest_only: true,
            samples: 4,
            impostor: ImpostorMethod::None,
            ..AsteroidSettings::default()
        };
        let mut drawn = || -> Result<Truth, Failure> {
            let background = draw(renderer, self, &self.empty, &finest)?;
            Ok(Truth { background, drawn: Drawn::draw(renderer, self, &finest)? })
        };
        match drawn() {
            Ok(truth) => Ok(Ok(truth)),
            Err(Failure::Method(note)) => Ok(Err(note)),
            Err(Failure::Chart(error)) => Err(error),
        }
    }
}

/// Measures all figures of a method in one view.
///
/// # Errors
/// [`ChartError`] if the device fails. A figure that cannot be measured has a note instead of a value.
pub(in crate::chart) fn score_asteroids(
    renderer: &mut Renderer,
    settings: &AsteroidSettings,
    scenes: &AsteroidScenes,
    truth: &Result<Truth, String>,
) -> Result<Scores<AsteroidMetric>, ChartError> {
    let measured = match truth {
        Err(note) => Err(Failure::Method(note.clone())),
        Ok(truth) => Drawn::draw(renderer, scenes, settings).and_then(|drawn| compare(scenes, &drawn, truth)),
    };
    let scores = match measured {
        Ok(scores) => scores,
        Err(Failure::Method(note)) => AsteroidMetric::ALL.map(|metric| (metric, Score::none(note.clone()))).to_vec(),
        Err(Failure::Chart(error)) => return Err(error),
    };
    Ok(Scores(scores))
}

/// A window of one image.
struct Window<'a> {
    pixels: &'a Pixels,
    places: Vec<usize>,
}

impl Window<'_> {
    fn luminances(&self) -> Vec<f64> {
        let luminance = |place: &usize| {
            let [r, g, b, _] = self.pixels[*place];
            luminance([r, g, b].map(f64::from))
        };
        self.places.iter().map(luminance).collect()
    }
}

/// Returns the covered share of each pixel of an asteroid's window.
fn coverage(backlit: &Window<'_>, background: &Window<'_>) -> Vec<f64> {
    let pairs = backlit.luminances().into_iter().zip(background.luminances());
    pairs.map(|(visible, whole)| if whole > 0.0 { (1.0 - visible / whole).clamp(0.0, 1.0) } else { 0.0 }).collect()
}

/// Figures of one asteroid.
struct Compared {
    overlap: Overlap,
    normal_rad: Option<f64>,
    light: Option<f64>,
    disparity_px: Option<f64>,
}

/// Minimum luminance, as a share of the brightest, and minimum coverage of pixels whose normals are compared.
const LEAST_LIGHT: f64 = 0.02;
const LEAST_COVERAGE: f64 = 0.5;

fn compare(scenes: &AsteroidScenes, drawn: &Drawn, truth: &Truth) -> Result<Vec<(AsteroidMetric, Score)>, Failure> {
    let found: Vec<Compared> =
        scenes.cells.iter().map(|cell| compare_cell(scenes, cell, drawn, truth)).collect::<Result<_, _>>()?;
    let sizes = scenes.rows();
    let by_size = |value: &dyn Fn(&Compared) -> Option<f64>| -> Vec<Option<f64>> {
        let of_row = |row: usize| {
            let cells = scenes.cells.iter().zip(&found).filter(|(cell, _)| cell.row == row);
            mean(&cells.filter_map(|(_, found)| value(found)).collect::<Vec<_>>())
        };
        (0..sizes.len()).map(of_row).collect()
    };
    let listed = |values: &[Option<f64>]| {
        let entry = |(size, value): (&f64, &Option<f64>)| value.map(|value| format!("{value:.3} at {size:.1} px"));
        format!("by radius: {}", sizes.iter().zip(values).filter_map(entry).collect::<Vec<_>>().join(", "))
    };
    let all = |value: &dyn Fn(&Compared) -> Option<f64>| found.iter().filter_map(value).collect::<Vec<f64>>();
    let iou = |found: &Compared| Some(found.overlap.iou());
    let outline = |found: &Compared| Some(found.overlap.outline_px());
    let degrees = |found: &Compared| found.normal_rad.map(f64::to_degrees);
    let light = |found: &Compared| found.light;
    let outlines = by_size(&outline);
    let disparities = all(&|found| found.disparity_px);
    let score = |value: Option<f64>, note: String| match value {
        Some(_) => Score { value, note },
        None => Score::none("no asteroid yields this figure"),
    };
    let disparity = if scenes.viewports.len() < 2 {
        Score::none("does not apply: the view has one eye")
    } else {
        score(disparities.iter().copied().reduce(f64::max), String::new())
    };
    let relative = |found: &Compared| light(found).map(f64::abs);
    Ok(vec![
        (AsteroidMetric::SilhouetteIou, score(mean(&all(&iou)), listed(&by_size(&iou)))),
        (AsteroidMetric::OutlinePx, score(outlines.iter().flatten().copied().reduce(f64::max), listed(&outlines))),
        (AsteroidMetric::NormalDeg, score(mean(&all(&degrees)), listed(&by_size(&degrees)))),
        (AsteroidMetric::DisparityPx, disparity),
        (AsteroidMetric::Light, score(root_mean_square(&all(&light)), listed(&by_size(&relative)))),
    ])
}

fn compare_cell(scenes: &AsteroidScenes, cell: &Cell, drawn: &Drawn, truth: &Truth) -> Result<Compared, Failure> {
    // Luminances and pixels of the cell in an image, and the coverage of its pixels.
    let window = |images: &'_ [Pixels], image: usize| -> Result<(Vec<f64>, Vec<usize>), Failure> {
        let places = scenes.window(cell, image);
        let window = Window { pixels: pixels_of(images, image)?, places };
        Ok((window.luminances(), window.places))
    };
    let covered = |backlit: &[Pixels]| -> Result<Vec<f64>, Failure> {
        let places = scenes.window(cell, 0);
        let backlit = Window { pixels: pixels_of(backlit, 0)?, places: places.clone() };
        Ok(coverage(&backlit, &Window { pixels: pixels_of(&truth.background, 0)?, places }))
    };
    // Silhouettes.
    let [ours, right] = [covered(&drawn.backlit)?, covered(&truth.drawn.backlit)?];
    let overlap = overlap(&ours, &right)?;
    // Light under each sun.
    let mut sums = [[0.0; 2]; 3];
    let mut pictures = Vec::new();
    for (index, (ours, right)) in drawn.lit.iter().zip(&truth.drawn.lit).enumerate() {
        let [(ours, places), (right, _)] = [window(ours, 0)?, window(right, 0)?];
        for (place, (ours, right)) in places.iter().zip(ours.iter().zip(&right)) {
            let omega = scenes.solid_angle_sr(0, *place);
            sums[index][0] += ours * omega;
            sums[index][1] += right * omega;
        }
        pictures.push([ours, right]);
    }
    let [ours_lx, right_lx] = [0, 1].map(|side| sums.iter().map(|sums| sums[side]).sum::<f64>());
    let light = (right_lx > 0.0).then(|| ours_lx / right_lx - 1.0);
    // Reconstruct the normals from the three pictures, in pixels that both silhouettes cover sufficiently.
    let brightest = pictures.iter().flat_map(|[_, right]| right).copied().fold(0.0, f64::max);
    let normal = |side: usize, pixel: usize| {
        let luminances = [0, 1, 2].map(|sun| pictures[sun][side][pixel]);
        scenes.suns.normal(luminances, LEAST_LIGHT * brightest)
    };
    let inner = (0..ours.len()).filter(|pixel| ours[*pixel].min(right[*pixel]) >= LEAST_COVERAGE);
    let normal_rad =
        mean_normal_error_rad(inner.map(|pixel| (normal(0, pixel), normal(1, pixel), ours[pixel].min(right[pixel]))))?;
    // Disparity: displacement of the centroid between the eyes.
    let centroid = |images: &[Pixels], image: usize| -> Result<Option<[f64; 2]>, Failure> {
        let (luminances, places) = window(images, image)?;
        let width = scenes.viewports[image].size()[0] as usize;
        let mut sum = [0.0; 3];
        for (place, luminance) in places.iter().zip(luminances) {
            let light = luminance * scenes.solid_angle_sr(image, *place);
            sum[0] += light * (place % width) as f64;
            sum[1] += light * (place / width) as f64;
            sum[2] += light;
        }
        Ok((sum[2] > 0.0).then(|| [sum[0] / sum[2], sum[1] / sum[2]]))
    };
    let mut disparity_px = None;
    if scenes.viewports.len() > 1 {
        let displaced = |images: &[Pixels]| -> Result<Option<[f64; 2]>, Failure> {
            let pair = centroid(images, 0)?.zip(centroid(images, 1)?);
            Ok(pair.map(|(left, right)| [left[0] - right[0], left[1] - right[1]]))
        };
        let pair = displaced(&drawn.lit[0])?.zip(displaced(&truth.drawn.lit[0])?);
        disparity_px = pair.map(|(ours, right)| (ours[0] - right[0]).hypot(ours[1] - right[1]));
    }
    Ok(Compared { overlap, normal_rad, light, disparity_px })
}

#[cfg(test)]
mod tests;

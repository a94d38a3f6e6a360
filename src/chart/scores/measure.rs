//! Measures each figure: draws a scene and evaluates its stars one by one.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{Failure, Metric, Pixels, Score, Scorer};
use crate::{
    chart::scenes::{self, EDGE_WINDOW_RAD, PAIR_K, Placed, Scene},
    metrics::{
        FlickerMeter, HdrView, MetricError, PointSource, centroid_error_px, faint_beside_bright, fitted_scale,
        illuminance_near_direction_lx, illuminance_near_pixel_lx, order_dependence, relative_variation, shape_px,
        shape_rad, uv_distance,
    },
    photometry::{blackbody::rec709_in_gamut, exposure::WHITE_LUMINANCE_AT_EV0_CD_M2},
    view::projection::{BoundingCone, PlaneMapping},
};

/// Exposure of the scenes whose figures are computed from the light before exposure; that of a typical night.
pub(super) const NIGHT_EV100: f64 = -8.0;

/// Returns the pixels of an image of a frame.
pub(super) fn pixels_of(frame: &[Pixels], index: usize) -> Result<&Pixels, Failure> {
    frame.get(index).ok_or_else(|| Failure::Method("the frame has no HDR image".to_owned()))
}

pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

pub(super) fn root_mean_square(values: &[f64]) -> Option<f64> {
    Some(mean(&values.iter().map(|value| value * value).collect::<Vec<_>>())?.sqrt())
}

/// Returns the standard deviation divided by the mean; `None` if the mean is 0.
pub(super) fn deviation_over_mean(values: &[f64]) -> Option<f64> {
    let middle = mean(values).filter(|middle| *middle > 0.0)?;
    Some(root_mean_square(&values.iter().map(|value| value - middle).collect::<Vec<_>>())? / middle)
}

/// Returns a score, or the reason why it is missing.
pub(super) fn score(value: Option<f64>, why_not: &str) -> Score {
    value.map_or_else(|| Score::none(why_not), Score::from_value)
}

/// The part of a picture around a star, so that the rest need not be evaluated.
struct Window<'a> {
    mapping: &'a dyn PlaneMapping,
    corner: [u32; 2],
    size: [u32; 2],
}

impl<'a> Window<'a> {
    fn around(mapping: &'a dyn PlaneMapping, centre: DVec2, radius_px: u32) -> Self {
        let [width, height] = mapping.size();
        let range = |centre: f64, side: u32| {
            let first = (centre.floor() as i64 - i64::from(radius_px)).clamp(0, i64::from(side) - 1);
            let end = (centre.floor() as i64 + i64::from(radius_px) + 1).clamp(first + 1, i64::from(side));
            (first as u32, (end - first) as u32)
        };
        let ((left, width), (top, height)) = (range(centre.x, width), range(centre.y, height));
        Self { mapping, corner: [left, top], size: [width, height] }
    }

    fn corner(&self) -> DVec2 {
        DVec2::new(f64::from(self.corner[0]), f64::from(self.corner[1]))
    }

    /// Returns the pixels of the window.
    fn cut(&self, pixels: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let row = self.mapping.size()[0] as usize;
        let [left, top] = self.corner.map(|side| side as usize);
        let [width, height] = self.size.map(|side| side as usize);
        (top..top + height).flat_map(|y| &pixels[y * row + left..y * row + left + width]).copied().collect()
    }
}

impl PlaneMapping for Window<'_> {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        Some(self.mapping.pixel_from_direction(direction)? - self.corner())
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        self.mapping.direction_from_pixel(pixel + self.corner())
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        self.mapping.solid_angle_sr(x + self.corner[0], y + self.corner[1])
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        self.mapping.bounding_cone(margin_px)
    }
}

/// Returns the light per channel within `radius_px` of a position, lx.
fn colour_near(image: &HdrView<'_>, centre: DVec2, radius_px: u32) -> [f64; 3] {
    let window = Window::around(image.mapping(), centre, radius_px);
    let mut sum = [0.0; 3];
    for y in window.corner[1]..window.corner[1] + window.size[1] {
        for x in window.corner[0]..window.corner[0] + window.size[0] {
            let omega = image.mapping().solid_angle_sr(x, y);
            for (sum, channel) in sum.iter_mut().zip(image.rgb_cd_m2(x, y)) {
                *sum += channel * omega;
            }
        }
    }
    sum
}

impl Scorer<'_> {
    /// Radius around a star within which its light is measured, pixels.
    fn radius_px(&self) -> f64 {
        f64::from(self.cell_px) / 2.0 - 1.0
    }

    fn draw(&mut self, scene: &Scene, ev100: f64) -> Result<Vec<Pixels>, Failure> {
        (self.draw)(scene, ev100)
    }

    /// Returns the fitted scale of a method with relative brightness; 1 for other methods.
    fn scale(&self, measured_and_expected_lx: &[(f64, f64)]) -> Result<f64, MetricError> {
        if self.method.is_relative() { fitted_scale(measured_and_expected_lx) } else { Ok(1.0) }
    }

    /// Returns the light of every star of a scene as (measured, expected), lx.
    fn light_of(&self, image: &HdrView<'_>, stars: &[Placed]) -> Result<Vec<(f64, f64)>, MetricError> {
        stars
            .iter()
            .map(|star| Ok((illuminance_near_pixel_lx(image, star.pixel, self.radius_px())?, star.illuminance_lx)))
            .collect()
    }

    /// Measures flicker at three brightnesses and before tone mapping, centroid and width.
    pub(super) fn sweep(&mut self) -> Result<Vec<Score>, Failure> {
        let side = (self.size.image_px / self.cell_px).max(1) as usize;
        let pages = self.size.positions.div_ceil(side * side);
        let (mut scores, mut linear) = (Vec::new(), None);
        let (mut centroids, mut widths) = (Vec::new(), Vec::new());
        let radius_px = self.radius_px();
        let mut positions = usize::MAX;
        let narrow = self.method.accumulator() == crate::plan::settings::Accumulator::FixedPoint;
        for k in [1.0, 10.0, 100.0] {
            let mut meter: Option<FlickerMeter> = None;
            let mut positions_drawn = 0;
            for page in 0..pages {
                // The first page of each brightness is always drawn: two positions are the minimum.
                if page > 0 && self.budget.is_over() {
                    break;
                }
                let (scene, luminance) = scenes::sweep(self.size.image_px, self.cell_px, page, narrow)?;
                let white = luminance / k;
                let frame = self.draw(&scene, (white / WHITE_LUMINANCE_AT_EV0_CD_M2).log2())?;
                let image = HdrView::new(scene.mapping(), pixels_of(&frame, 0)?)?;
                let meter = match &mut meter {
                    Some(meter) => meter,
                    none => {
                        let scale = self.scale(&self.light_of(&image, &scene.stars)?)?;
                        none.insert(FlickerMeter::new(white / scale)?)
                    }
                };
                for star in &scene.stars {
                    meter.add_star(&image, star.pixel, radius_px)?;
                    if k == 10.0 {
                        centroids.push(centroid_error_px(&image, star.pixel, radius_px)?);
                        widths.push(shape_px(&image, star.pixel, radius_px)?.rms_radius());
                    }
                }
                positions_drawn += scene.stars.len();
            }
            positions = positions.min(positions_drawn);
            let flicker = meter.ok_or(MetricError::NoLight("flicker"))?.flicker()?;
            scores.push(Score::from_value(flicker.after));
            if k == 10.0 {
                linear = Some(flicker.before);
            }
        }
        let width = score(deviation_over_mean(&widths), "does not apply: a single pixel has no width");
        scores.push(score(linear, "no light"));
        scores.push(score(root_mean_square(&centroids), "no light"));
        scores.push(width);
        if positions < self.size.positions {
            for score in &mut scores {
                if score.note.is_empty() {
                    score.note = format!("{positions} sub-pixel positions: the budget was used up");
                }
            }
        }
        Ok(scores)
    }

    /// Measures the light of single stars from centre to corner.
    pub(super) fn single_stars(&mut self) -> Result<Vec<Score>, Failure> {
        let px = self.size.image_px;
        let mut pairs = Vec::new();
        for (size, fov_deg) in [([px, (px * 9 / 16).max(1)], 60.0_f64), ([px; 2], 110.0)] {
            let scene = scenes::grid(size, fov_deg.to_radians(), self.cell_px)?;
            let frame = self.draw(&scene, NIGHT_EV100)?;
            let image = HdrView::new(scene.mapping(), pixels_of(&frame, 0)?)?;
            pairs.extend(self.light_of(&image, &scene.stars)?);
        }
        let scale = self.scale(&pairs)?;
        let errors: Vec<f64> = pairs.iter().map(|(measured, expected)| scale * measured / expected - 1.0).collect();
        Ok(vec![score(root_mean_square(&errors), "no star fits into the picture")])
    }

    /// Measures ellipticity in view space, 45 degrees off the axis.
    pub(super) fn ellipticity(&mut self) -> Result<Vec<Score>, Failure> {
        let scene = scenes::ring(self.size.image_px, self.cell_px)?;
        let frame = self.draw(&scene, NIGHT_EV100)?;
        let pixels = pixels_of(&frame, 0)?;
        let mut found = Vec::new();
        for star in &scene.stars {
            let window = Window::around(scene.mapping(), star.pixel, self.cell_px / 2 - 1);
            let cut = window.cut(pixels);
            let image = HdrView::new(&window, &cut)?;
            found.extend(shape_rad(&[image], star.direction, PI)?.ellipticity());
        }
        Ok(vec![score(mean(&found), "does not apply: a single pixel has no shape")])
    }

    /// Measures two colours in one pixel.
    pub(super) fn colour(&mut self) -> Result<Vec<Score>, Failure> {
        let scene = scenes::pairs(self.cell_px)?;
        let frame = self.draw(&scene, NIGHT_EV100)?;
        let image = HdrView::new(scene.mapping(), pixels_of(&frame, 0)?)?;
        let [red, blue] = PAIR_K.map(|kelvin| rec709_in_gamut(f64::from(kelvin)));
        let expected = [red[0] + blue[0], red[1] + blue[1], red[2] + blue[2]];
        let distances: Option<Vec<f64>> = scene
            .stars
            .iter()
            .map(|star| uv_distance(colour_near(&image, star.pixel, self.cell_px / 2 - 1), expected))
            .collect();
        let distances = distances.ok_or(MetricError::NoLight("a colour"))?;
        Ok(vec![score(root_mean_square(&distances), "no light")])
    }

    /// Measures a faint star near a bright one.
    pub(super) fn range(&mut self) -> Result<Vec<Score>, Failure> {
        let scene = scenes::faint_near_bright(self.cell_px)?;
        let frame = self.draw(&scene, NIGHT_EV100)?;
        let image = HdrView::new(scene.mapping(), pixels_of(&frame, 0)?)?;
        let source = |star: &Placed| PointSource { pixel: star.pixel, illuminance_lx: star.illuminance_lx };
        let [bright, faint] = [&scene.stars[0], &scene.stars[1]].map(source);
        let found = faint_beside_bright(&image, bright, faint, self.radius_px())?;
        let kept = [found.bright_error, found.faint_error].map(|error| error + 1.0);
        let scale = self.scale(&kept.map(|kept| (kept, 1.0)))?;
        Ok(vec![Score::from_value(kept.map(|kept| (scale * kept - 1.0).abs()).into_iter().fold(0.0, f64::max))])
    }

    /// Compares pictures of the same stars in different orders, and two pictures in the same order.
    pub(super) fn order(&mut self) -> Result<Vec<Score>, Failure> {
        let mut frames = Vec::new();
        let crowd = if self.cell_px > 32 { self.size.crowd / 8 } else { self.size.crowd };
        let mut scene = scenes::crowd(crowd)?;
        // The default order is drawn twice to detect differences between runs.
        let repeats = 2;
        for shuffle in 0..repeats + self.size.shuffles.max(1) {
            // At least one shuffle is drawn, otherwise there is no figure.
            if shuffle > repeats && self.budget.is_over() {
                break;
            }
            scene.order = shuffle.checked_sub(repeats);
            frames.push(self.draw(&scene, NIGHT_EV100)?);
        }
        let shuffles = frames.len() as u64 - repeats;
        let images = frames
            .iter()
            .map(|frame| Ok(HdrView::new(scene.mapping(), pixels_of(frame, 0)?)?))
            .collect::<Result<Vec<_>, Failure>>()?;
        let lit = images[0].size().map(f64::from).iter().product::<f64>();
        let [width, height] = images[0].size();
        if (0..height).all(|y| (0..width).all(|x| images[0].luminance_cd_m2(x, y) == 0.0)) {
            // A black picture is the same in every order, so it yields no figure.
            return Err(MetricError::NoLight("the order of stars").into());
        }
        let difference = order_dependence(&images)?;
        let mut found = Score::from_value(difference.pixels as f64 / lit);
        found.note = format!("{shuffles} shuffles");
        if shuffles < self.size.shuffles {
            found.note += ": the budget was used up";
        }
        if !difference.identical {
            found.note += &format!(
                ", largest difference {:.1e} relative to the brightest channel, {:.1e} relative to the same channel",
                difference.largest_of_brightest, difference.largest_relative
            );
        }
        Ok(vec![found])
    }

    /// Measures many equal stars in one pixel.
    pub(super) fn heap(&mut self) -> Result<Vec<Score>, Failure> {
        let light = |scorer: &mut Self, stars: usize| -> Result<(f64, f64), Failure> {
            let scene = scenes::heap(stars)?;
            let frame = scorer.draw(&scene, NIGHT_EV100)?;
            let image = HdrView::new(scene.mapping(), pixels_of(&frame, 0)?)?;
            let expected: f64 = scene.stars.iter().map(|star| star.illuminance_lx).sum();
            Ok((crate::metrics::illuminance_lx(&image)?, expected))
        };
        let one = light(self, 1)?;
        let scale = self.scale(&[one])?;
        let (measured, expected) = light(self, self.size.heap)?;
        let mut found = Score::from_value(scale * measured / expected);
        if self.size.heap != 20_000 {
            found.note = format!("of {} stars", self.size.heap);
        }
        Ok(vec![found])
    }

    /// Measures stars at the edges of a cubemap.
    pub(super) fn seam(&mut self) -> Result<Vec<Score>, Failure> {
        let scene = scenes::cube_edges((self.size.image_px / 8).max(64))?;
        let frame = self.draw(&scene, NIGHT_EV100)?;
        let view_images = &scene.rig.views()[0].images;
        let images = view_images
            .iter()
            .enumerate()
            .map(|(index, image)| {
                let view = HdrView::new(image.projection.mapping(), pixels_of(&frame, index)?)?;
                Ok(view.turned(image.camera_from_view))
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let kept = scene
            .stars
            .iter()
            .map(|star| {
                let light = illuminance_near_direction_lx(&images, star.direction, EDGE_WINDOW_RAD)?;
                Ok(light / star.illuminance_lx)
            })
            .collect::<Result<Vec<f64>, MetricError>>()?;
        let variation = relative_variation(&kept)?;
        let why_not = format!("unbounded: a star at an edge is lost ({})", Metric::Seam.name());
        let mut found = score(Some(variation).filter(|variation| variation.is_finite()), &why_not);
        if self.method.needs_planes() {
            found.note = [found.note.as_str(), "through cube faces"].join(" ").trim().to_owned();
        }
        Ok(vec![found])
    }
}

#[cfg(test)]
mod tests;

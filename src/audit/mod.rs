//! The audit of a frame: compares a sample of the drawn pixels with an exact f64 computation.
//!
//! The exact image comes from `reference::sampled`: each star separately, with the kernel that the view uses; glare
//! source by source, as in the exact method; exposure and tone mapping as on the display. It shares no grid, no map of
//! faint stars, no error budget and no fixed-point sums with the frame.
//!
//! **Display images**: a display code determines the display value before rounding to within one code (exactly, if
//! dithering is known). The error is the distance of the exact value from that interval, so an error is never
//! overstated. 99.9 % of the channels must lie within `accuracy.display_codes`, and none may exceed
//! [`MOST_OVER_BUDGET`] times that. [`NUMERICAL_CODES`] are added to both limits; if the budget is 0, they are the
//! whole limit.
//!
//! **HDR images**: the allowed error is `accuracy.flux` of the starlight plus `accuracy.glare` of the veil. Three
//! errors that the exact method does not bound any tighter are added: a star may be up to [`POSITION_PX`] away from its
//! exact position; each star is rounded by at most one unit of the fixed-point sums; and sources too faint to be drawn
//! individually spread the light that they scatter within 1.5 pixels over the degrees around them
//! (`docs/glare-methods.md`); stars of a deep store do so with the light that they scatter within about a degree.
//! Display images with a budget of 0 are drawn with the same accuracy and have the same tolerance.
//!
//! **Deep stores**: the exact image has every star. It reads the leaves around the compared pixels by itself, and shares
//! no page with the frame. The residual that a frame states is added to the limits.
//!
//! **The cost** is bounded: at most [`MOST_PIXELS`] pixels of an image and [`MOST_PIXELS_OF_FRAME`] of a frame, and one
//! pass over the stars for each eye, at most [`MOST_DEEP_STARS`] of a deep store.
//!
//! Content without an f64 reference here is reported as not audited: published star and glare methods, kernels that are
//! round on the sphere, bodies and asteroids, glare in pixels wider than 4.7 degrees, and HDR images with composite
//! stars, whose error in a pixel has no bound. Overlays are not part of the
//! exact image: pixels that they touch are left out.

mod sample;

use glam::DVec3;

use self::sample::Place;
use crate::{
    photometry::{
        exposure::white_luminance_cd_m2, glare::split::ShownCore, rec709::luminance, tone_map::dither_threshold,
    },
    plan::{
        ExposureSource, FramePlan, Limits, Output, Plan, PlanError, PlanOutputs, Planner,
        audit::{Audit, AuditedOutput, ImageAudit, WorstPixel},
        budget::ErrorBudget,
        glare::sky_cube::{shown_rad_of, smooth_angle_rad},
        settings::{Accumulator, GlareMethod, RenderSettings, StarMethod, ToneMapSettings},
        view_settings::FrameGroup,
    },
    reference::{
        overlay::draw::{OverlayTarget, draw},
        sampled::{PixelLight, SampledGlare, SampledImage, SampledSky, pixels, stars_to_read},
        stars::splat::{Eye, Sight},
    },
    render::{Frame, FrameImage},
    scene::SceneSnapshot,
    view::{Rig, Viewport, projection::pixel_centre},
};

/// Maximum number of compared pixels per image.
pub const MOST_PIXELS: usize = 512;
/// Maximum number of compared pixels per frame, except that every image gets at least 64.
pub const MOST_PIXELS_OF_FRAME: usize = 2048;
/// Maximum number of stars of a deep store that are read for each eye. On one core these take about two minutes.
pub const MOST_DEEP_STARS: u64 = 300_000_000;
/// Largest error of any pixel, in units of the budget that 99.9 % of them keep.
pub const MOST_OVER_BUDGET: f64 = 4.0;
/// Error that f32 arithmetic may add to a display value, codes.
pub const NUMERICAL_CODES: f64 = 0.1;
/// Largest distance between the drawn and the exact position of a star, pixels.
pub const POSITION_PX: f64 = 1e-3;
/// Largest change of a kernel per pixel of displacement.
const STEEPEST_PER_PX: f64 = 1.0;

/// Input from which the audited frame was drawn.
#[derive(Clone, Copy, Debug)]
pub struct AuditedScene<'a> {
    /// The scene, with the camera of the frame.
    pub scene: &'a SceneSnapshot,
    /// Views of the frame.
    pub rig: &'a Rig,
    /// Render settings of the frame, including its error budgets.
    pub settings: &'a RenderSettings,
    /// Whether the exposure was known before the frame was drawn. This is always so, except for the first frame with
    /// mean-luminance metering.
    pub exposure_known: bool,
    /// Maximum number of compared pixels per image; see [`MOST_PIXELS`].
    pub most_pixels: usize,
    /// View numbers that the frame uses, in the order of the rig; `None`: the numbers of the rig.
    pub numbers: Option<&'a [usize]>,
}

impl<'a> AuditedScene<'a> {
    /// Input of a frame of one group of views. `adapted`: whether the exposure was adapted from earlier frames.
    pub fn for_group(scene: &'a SceneSnapshot, group: &'a FrameGroup, adapted: bool) -> Self {
        let FrameGroup { rig, settings, exposed_as, .. } = group;
        // Only a frame that meters itself is drawn before its exposure is known.
        let exposure_known = adapted || exposed_as.is_some() || !settings.exposure.is_metered();
        Self { scene, rig, settings, exposure_known, most_pixels: MOST_PIXELS, numbers: None }
    }

    /// Index in the rig of the view with a given number in the frame.
    fn view_of(&self, number: usize) -> Option<usize> {
        match self.numbers {
            Some(numbers) => numbers.iter().position(|own| *own == number),
            None => (number < self.rig.views().len()).then_some(number),
        }
    }
}

/// Compares a frame with the exact image. The second result is for HDR images that were drawn by a separate plan.
///
/// # Errors
///
/// The scene cannot be planned with these settings.
pub fn audit(audited: &AuditedScene<'_>, frame: &Frame, limits: &Limits) -> Result<[Audit; 2], PlanError> {
    let mut audits = [Audit::default(), Audit::default()];
    let reasons = reasons_against(audited);
    let [displayed, exact] = &mut audits;
    if !reasons.is_empty() {
        displayed.not_audited.clone_from(&reasons);
        exact.not_audited = reasons;
        return Ok(audits);
    }
    let expected = Expected::new(audited, frame, limits)?;
    let images = match expected.images_of(audited, frame) {
        Ok(images) => images,
        Err(reason) => {
            displayed.not_audited.push(reason);
            return Ok(audits);
        }
    };
    for image in &images {
        if expected.has_glare() && shown_rad_of(&image.viewport.projection) > smooth_angle_rad(0) {
            let pixel_deg = image.viewport.projection.middle_pixel_rad().to_degrees();
            let why = "too wide: the glare reference differs there from the exact method";
            displayed.not_audited.push(format!("view {}: pixels of {pixel_deg:.1} degrees, {why}", image.name));
            continue;
        }
        let own = if frame.hdr_plan.is_some() { &mut *exact } else { &mut *displayed };
        let hdr_plan = frame.hdr_plan.as_ref().unwrap_or(&frame.plan);
        let compared = image.compare_hdr(&expected, audited.settings, hdr_plan);
        add(own, compared, has_composites(hdr_plan));
        let compared = image.compare_display(&expected, audited.settings, &frame.plan);
        let is_exact = audited.settings.accuracy.display_codes == 0.0;
        add(displayed, compared, is_exact && has_composites(&frame.plan));
    }
    if images.is_empty() {
        displayed.not_audited.push("the frame has no images".to_owned());
    }
    Ok(audits)
}

/// Adds the errors of an image, or the reason why they have no bound.
fn add(audit: &mut Audit, compared: Option<ImageAudit>, has_no_bound: bool) {
    match compared {
        Some(image) if has_no_bound => audit.not_audited.push(format!(
            "view {}: the error of composite stars in a pixel has no bound in an exact image; with stars.every_star = true every star is drawn",
            image.view
        )),
        compared => audit.images.extend(compared),
    }
}

/// Whether composite stars were drawn in place of the stars of a deep store.
fn has_composites(plan: &FramePlan) -> bool {
    plan.deep.as_ref().is_some_and(|deep| deep.cell_px > 0.0)
}

/// Luminance that a pixel may be off because stars of a deep store had not been read or did not fit into the memory, cd/m^2.
fn residual_cd_m2(plan: &FramePlan) -> f64 {
    plan.deep.as_ref().map_or(0.0, |deep| deep.residual_cd_m2)
}

/// Audits a frame and stores the results in its plans.
///
/// # Errors
///
/// As [`audit`].
pub fn audit_into(audited: &AuditedScene<'_>, frame: &mut Frame, limits: &Limits) -> Result<(), PlanError> {
    let [displayed, exact] = audit(audited, frame, limits)?;
    frame.plan.audit = Some(displayed);
    if let Some(plan) = &mut frame.hdr_plan {
        plan.audit = Some(exact);
    }
    Ok(())
}

/// Reasons why a frame cannot be compared; empty if it can.
fn reasons_against(audited: &AuditedScene<'_>) -> Vec<String> {
    let (method, objects) = (audited.settings.stars.method, &audited.scene.objects);
    let glare = audited.settings.glare.chosen(method);
    let mut reasons = Vec::new();
    if method.accumulator() != Accumulator::FixedPoint {
        reasons.push(format!("the star method {}: a published method without an error budget", method.name()));
    }
    if method == StarMethod::PixelGaussian {
        reasons.push(format!("the star method {}: its reference visits all pixels for every star", method.name()));
    }
    if !matches!(glare, GlareMethod::None | GlareMethod::SkyCube) {
        reasons.push(format!("the glare method {}: a published method without an error budget", glare.name()));
    }
    if objects.surroundings.is_some() {
        reasons.push(
            "the ground and the air around an observer: light that they hide or scatter has no per-pixel reference"
                .to_owned(),
        );
    }
    let count = |count: usize, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
    if !objects.bodies.is_empty() {
        let bodies = count(objects.bodies.len(), "body", "bodies");
        reasons.push(format!("{bodies}: light that they hide or scatter has no per-pixel reference"));
    }
    if !objects.fields.is_empty() {
        let fields = count(objects.fields.len(), "asteroid field", "asteroid fields");
        reasons.push(format!("{fields}: light that they hide or scatter has no per-pixel reference"));
    }
    reasons
}

/// Data for computing the exact image of a frame.
struct Expected {
    /// A separate plan for exact rendering: the kernel of each brightness, the viewports, the unit of the fixed-point
    /// sums.
    plan: Plan,
    /// Display white, cd/m^2.
    white_cd_m2: f64,
}

impl Expected {
    fn new(audited: &AuditedScene<'_>, frame: &Frame, limits: &Limits) -> Result<Self, PlanError> {
        let known = audited.exposure_known.then_some(frame.exposure_ev100);
        let outputs = PlanOutputs {
            exposure: known.map_or(ExposureSource::Own, |_| ExposureSource::Meter),
            ..PlanOutputs::new(Output::Hdr)
        };
        let mut planner = Planner::new();
        planner.asks_for_pages = false;
        let plan = planner.plan(audited.scene, audited.rig, audited.settings, known, outputs, limits)?;
        Ok(Self { plan, white_cd_m2: white_luminance_cd_m2(frame.exposure_ev100) })
    }

    fn has_glare(&self) -> bool {
        self.plan.glare.method == GlareMethod::SkyCube
    }

    /// Images of a frame, each with the sample of pixels to compare. The error says why the stars of a deep store are not compared.
    fn images_of<'a>(&'a self, audited: &AuditedScene<'_>, frame: &'a Frame) -> Result<Vec<AuditedImage<'a>>, String> {
        let each = (MOST_PIXELS_OF_FRAME / frame.images.len().max(1)).max(64).min(audited.most_pixels);
        let camera = &audited.scene.camera;
        let eye = |viewport: &Viewport| Eye {
            position_m: camera.position_m + viewport.eye_offset_m,
            velocity_c: camera.velocity_c,
            ..Eye::default()
        };
        // The brightest stars of the sky, around which part of the sample is taken.
        let bright = {
            let sight =
                Sight::new(Eye { position_m: camera.position_m, velocity_c: camera.velocity_c, ..Eye::default() });
            let seen = audited
                .scene
                .stars
                .iter()
                .filter_map(|(position, at_infinity, star)| sight.seen_star(position, at_infinity, star));
            sample::brightest(seen.map(|star| (star.illuminance_lx, star.direction.normalize())))
        };
        // Choose the sample of every image that has a viewport in the plan.
        let mut images: Vec<AuditedImage<'a>> = Vec::new();
        for image in &frame.images {
            let Some(view) = audited.view_of(image.view) else { continue };
            let is_of = |viewport: &Viewport| (viewport.view, viewport.part) == (view, image.part);
            let Some(number) = self.plan.views.viewports.iter().position(is_of) else { continue };
            let viewport = &self.plan.views.viewports[number];
            let name = audited.rig.views()[view].name.clone();
            images.push(AuditedImage::new(image, viewport, number, name, &bright, each));
        }
        images.iter_mut().for_each(|image| image.leave_out_overlay(&self.plan));
        let glare = self.plan.glare.kernel.as_deref().filter(|_| self.has_glare());
        // Each eye sees the stars from its own position.
        let mut eyes: Vec<DVec3> = images.iter().map(|image| image.viewport.eye_offset_m).collect();
        eyes.sort_by(|a, b| a.to_array().map(f64::to_bits).cmp(&b.to_array().map(f64::to_bits)));
        eyes.dedup();
        for offset in eyes {
            // The sampled pixels of all images of this eye.
            let mut seen: Vec<&mut AuditedImage<'_>> =
                images.iter_mut().filter(|image| image.viewport.eye_offset_m == offset).collect();
            let chosen: Vec<Vec<[u32; 2]>> =
                seen.iter().map(|image| image.sample.iter().map(|(pixel, _)| *pixel).collect()).collect();
            let sampled: Vec<SampledImage<'_>> = seen
                .iter()
                .zip(&chosen)
                .map(|(image, pixels)| SampledImage {
                    projection: &image.viewport.projection,
                    world_from_view: image.viewport.world_from_view,
                    kernels: self.plan.stars.kernels[image.number],
                    shown: glare.map(|kernel| ShownCore::new(kernel, shown_rad_of(&image.viewport.projection))),
                    pixels,
                })
                .collect();
            let Eye { position_m, velocity_c, .. } = eye(seen[0].viewport);
            // Their exact light, in one pass over the stars.
            let sky = SampledSky {
                stars: &audited.scene.stars,
                eye_m: position_m,
                velocity_c,
                zodiacal: self.plan.diffuse.as_ref().and_then(|diffuse| diffuse.zodiacal.as_ref()),
                faintest_lx: self.plan.stars.faintest_lx,
                glare: glare.map(|kernel| SampledGlare {
                    kernel,
                    fraction: self.plan.glare.fraction,
                    tolerance: audited.settings.accuracy.glare,
                }),
            };
            if let Some(deep) = &audited.scene.stars.deep {
                let stars = stars_to_read(deep, self.plan.stars.faintest_lx, &sampled);
                if stars > MOST_DEEP_STARS {
                    return Err(format!(
                        "the deep store has {stars} stars around the compared pixels: at most {MOST_DEEP_STARS} are read"
                    ));
                }
            }
            let lights = pixels(&sky, &sampled).map_err(|error| format!("the deep store: {error}"))?;
            drop(sampled);
            seen.iter_mut().zip(lights).for_each(|(image, lights)| image.lights = lights);
        }
        Ok(images)
    }
}

/// An image with its sample.
struct AuditedImage<'a> {
    image: &'a FrameImage,
    viewport: &'a Viewport,
    /// Index of the viewport in the plan.
    number: usize,
    name: String,
    sample: Vec<([u32; 2], Place)>,
    /// Which pixels of the sample are covered by an overlay.
    covered: Vec<bool>,
    /// Exact light of each pixel of the sample.
    lights: Vec<PixelLight>,
}

/// One channel of a pixel.
struct Compared {
    error: f64,
    /// Index in the sample.
    pixel: usize,
    channel: usize,
    drawn: f64,
    exact: f64,
}

impl<'a> AuditedImage<'a> {
    fn new(
        image: &'a FrameImage,
        viewport: &'a Viewport,
        number: usize,
        name: String,
        bright: &[DVec3],
        count: usize,
    ) -> Self {
        let pixel_index = |[x, y]: [u32; 2]| y as usize * image.width as usize + x as usize;
        let darkness = |pixel: [u32; 2]| match (&image.display, &image.hdr) {
            (Some(display), _) => display[4 * pixel_index(pixel)..][..3].iter().map(|code| u64::from(*code)).sum(),
            // The bit patterns of positive floats are ordered like their values.
            (None, Some(hdr)) => {
                hdr[pixel_index(pixel)][..3].iter().map(|light| u64::from(light.max(0.0).to_bits())).sum()
            }
            (None, None) => 0,
        };
        let mapping = viewport.projection.mapping();
        let sample = sample::pixels(mapping, viewport.world_from_view, bright, &darkness, count);
        let covered = vec![false; sample.len()];
        Self { image, viewport, number, name, sample, covered, lights: Vec::new() }
    }

    /// Marks pixels of the display image that lines and text touch: those where drawing the overlay changes a black or
    /// a white background.
    fn leave_out_overlay(&mut self, plan: &Plan) {
        let Some(overlay) = &plan.overlay else { return };
        let items = overlay.first_items.get(self.number..self.number + 2).map(|ends| &overlay.items[ends[0]..ends[1]]);
        let Some(items) = items.filter(|items| !items.is_empty()) else { return };
        let size = [self.image.width, self.image.height];
        let pixels = size[0] as usize * size[1] as usize;
        let mapping = self.viewport.projection.mapping();
        for blank in [0, 255] {
            let mut codes = vec![blank; 4 * pixels];
            let mut target = OverlayTarget {
                size,
                codes: &mut codes,
                contains: &|_, _| true,
                direction: &|x, y| mapping.direction_from_pixel(pixel_centre(x, y)),
                cover: &|_, _| None,
            };
            draw(&mut target, items, &overlay.texels);
            for (([x, y], _), covered) in self.sample.iter().zip(&mut self.covered) {
                let index = 4 * (*y as usize * size[0] as usize + *x as usize);
                *covered |= codes[index..index + 3].iter().any(|code| *code != blank);
            }
        }
    }

    /// Errors of the display image; `None` without a display image.
    fn compare_display(&self, expected: &Expected, settings: &RenderSettings, plan: &FramePlan) -> Option<ImageAudit> {
        let display = self.image.display.as_ref()?;
        let (tone_map, codes) = (&settings.tone_map, settings.accuracy.display_codes);
        let displayed = |rgb: [f64; 3]| tone_map.display_rgb(rgb, expected.white_cd_m2).map(|value| 255.0 * value);
        let mut compared = Vec::new();
        let mut left_out = 0;
        for (pixel, (([x, y], _), light)) in self.sample.iter().zip(&self.lights).enumerate() {
            if light.undecided || self.covered[pixel] {
                left_out += 1;
                continue;
            }
            let luminance = light.luminance_cd_m2();
            let without_budget =
                if codes > 0.0 { 0.0 } else { self.allowed_cd_m2(light, [*x, *y], expected, settings) };
            let allowed = residual_cd_m2(plan) + without_budget;
            let [exact, least, most] =
                [0.0, -allowed, allowed].map(|by| displayed(luminance.map(|c| (c + by).max(0.0))));
            let index = 4 * self.index_of([*x, *y]);
            for channel in 0..3 {
                let code = display[index + channel];
                let error = beyond_rounding(code, [least[channel], most[channel]], tone_map, [*x, *y]);
                compared.push(Compared { error, pixel, channel, drawn: f64::from(code), exact: exact[channel] });
            }
        }
        let budget = [codes + NUMERICAL_CODES, MOST_OVER_BUDGET * codes + NUMERICAL_CODES];
        Some(self.verdict(AuditedOutput::Display, &compared, left_out, budget))
    }

    /// Errors of the HDR image; `None` without an HDR image.
    fn compare_hdr(&self, expected: &Expected, settings: &RenderSettings, plan: &FramePlan) -> Option<ImageAudit> {
        let hdr = self.image.hdr.as_ref()?;
        let mut compared = Vec::new();
        let mut left_out = 0;
        for (pixel, (([x, y], _), light)) in self.sample.iter().zip(&self.lights).enumerate() {
            if light.undecided {
                left_out += 1;
                continue;
            }
            let within_budget = match plan.budget {
                Some(ErrorBudget::Hdr { relative, floor_cd_m2 }) => {
                    (relative * luminance(light.luminance_cd_m2())).max(floor_cd_m2)
                }
                _ => 0.0,
            };
            let allowed =
                residual_cd_m2(plan) + within_budget + self.allowed_cd_m2(light, [*x, *y], expected, settings);
            let drawn = hdr[self.index_of([*x, *y])];
            for (channel, exact) in light.luminance_cd_m2().into_iter().enumerate() {
                let drawn = f64::from(drawn[channel]);
                compared.push(Compared { error: (drawn - exact).abs() / allowed, pixel, channel, drawn, exact });
            }
        }
        Some(self.verdict(AuditedOutput::Hdr, &compared, left_out, [1.0, MOST_OVER_BUDGET]))
    }

    /// Allowed error of a pixel of an HDR image, cd/m^2.
    fn allowed_cd_m2(
        &self,
        light: &PixelLight,
        [x, y]: [u32; 2],
        Expected { plan, .. }: &Expected,
        settings: &RenderSettings,
    ) -> f64 {
        let main = plan.stars.ranges.main.units_per_lx;
        let coarsest = plan.stars.ranges.bright.as_ref().map_or(main, |bright| bright.units_per_lx.min(main));
        let omega_sr = self.viewport.projection.mapping().solid_angle_sr(x, y);
        let rounding_cd_m2 = f64::from(light.near_stars) / coarsest / omega_sr;
        let position_cd_m2 = POSITION_PX * STEEPEST_PER_PX * light.near_cd_m2;
        let most = |rgb: [f64; 3]| rgb.into_iter().fold(0.0, f64::max);
        settings.accuracy.flux * (most(light.stars_cd_m2) + most(light.diffuse_cd_m2))
            + settings.accuracy.glare * most(light.veil_cd_m2)
            + light.unresolved_cd_m2
            + position_cd_m2
            + rounding_cd_m2
            + f64::from(f32::MIN_POSITIVE)
    }

    fn index_of(&self, [x, y]: [u32; 2]) -> usize {
        y as usize * self.image.width as usize + x as usize
    }

    fn verdict(
        &self,
        output: AuditedOutput,
        compared: &[Compared],
        left_out: usize,
        [budget, most]: [f64; 2],
    ) -> ImageAudit {
        let mut errors: Vec<f64> = compared.iter().map(|compared| compared.error).collect();
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            errors.get((errors.len().saturating_sub(1) as f64 * share) as usize).copied().unwrap_or(f64::INFINITY)
        };
        let (error_999, largest) = (quantile(0.999), quantile(1.0));
        // The last in total order: NaN counts as the worst.
        let worst = compared.iter().max_by(|a, b| a.error.total_cmp(&b.error));
        let worst = worst.map(|compared| {
            let ([x, y], place) = self.sample[compared.pixel];
            let towards = self.viewport.projection.mapping().direction_from_pixel(pixel_centre(x, y));
            WorstPixel {
                x,
                y,
                place: place.name(),
                towards: (self.viewport.world_from_view * towards.unwrap_or(DVec3::ZERO)).to_array(),
                channel: ["R", "G", "B"][compared.channel],
                drawn: compared.drawn,
                exact: compared.exact,
            }
        });
        ImageAudit {
            view: self.name.clone(),
            part: self.image.part.name().map(str::to_owned),
            output,
            pixels: self.sample.len() - left_out,
            left_out,
            error_999,
            largest,
            budget,
            most,
            unit: output.unit(),
            within_budget: error_999 <= budget && largest <= most,
            worst,
        }
    }
}

/// Distance in codes between the allowed interval of display values, from `least` to `most`, and the interval of values
/// that are drawn as `code`; 0 if the two overlap.
fn beyond_rounding(code: u8, [least, most]: [f64; 2], tone_map: &ToneMapSettings, [x, y]: [u32; 2]) -> f64 {
    let threshold = if tone_map.dither { dither_threshold(x, y) } else { 0.5 };
    let lower = if code == 0 { f64::NEG_INFINITY } else { f64::from(code) - threshold };
    let upper = if code == 255 { f64::INFINITY } else { f64::from(code) + 1.0 - threshold };
    if least.is_nan() || most.is_nan() { f64::NAN } else { (lower - most).max(least - upper).max(0.0) }
}

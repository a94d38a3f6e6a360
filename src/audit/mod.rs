//! The audit of a frame: a sample of the pixels that were drawn, against what f64 says that they are.
//!
//! The exact picture is that of `reference::sampled`: every star by itself with the kernel that belongs to the picture, glare source by source as
//! the exact method has it, exposure and tone mapping as the display has them. It shares no grid, no map of faint stars, no budget and no
//! fixed-point sums with the frame.
//!
//! **Display images**: a code tells the display value before rounding to within one code, or exactly where dithering puts that code; an error is by how much the exact value lies
//! outside of that. So an error is never overstated. 99.9 % of the channels must lie within
//! `accuracy.display_codes`, and none may be off by more than [`MOST_OVER_BUDGET`] times that; [`NUMERICAL_CODES`] are added, which is all where the budget is 0.
//!
//! **HDR images**: what is allowed is `accuracy.flux` of the stars' light plus `accuracy.glare` of the veil. To that comes what the exact method
//! promises no more of: a star may stand [`POSITION_PX`] from its place, each one is rounded by at most a unit of the sums, and what sources too faint to be
//! drawn by themselves scatter within a pixel and a half of themselves lies in the degrees around them (`docs/glare-methods.md`). Display images
//! with a budget of 0 are drawn as exactly, and may differ by as much.
//!
//! **The cost** is known beforehand: at most [`MOST_PIXELS`] pixels of an image and [`MOST_PIXELS_OF_FRAME`] of a frame, and one walk through the stars for each eye.
//!
//! What has no twin here is told as not audited: published star methods and glare, kernels that are round in the sky, bodies and asteroids, and glare in pixels wider than 4.7 degrees. Overlays are no
//! part of the picture: pixels that they touch are left out.

mod sample;

use glam::DVec3;

use self::sample::Place;
use crate::{
    photometry::{exposure::white_luminance_cd_m2, glare::split::ShownCore, tone_map::dither_threshold},
    plan::{
        ExposureSource, Limits, Output, Plan, PlanError, PlanOutputs, Planner,
        audit::{Audit, AuditedOutput, ImageAudit, WorstPixel},
        glare::sky_cube::{shown_rad_of, smooth_angle_rad},
        settings::{Accumulator, GlareMethod, RenderSettings, StarMethod, ToneMapSettings},
        view_settings::FrameGroup,
    },
    reference::{
        overlay::draw::{OverlayTarget, draw},
        sampled::{PixelLight, SampledGlare, SampledImage, SampledSky, pixels},
        stars::splat::{Eye, Sight},
    },
    render::{Frame, FrameImage},
    scene::SceneSnapshot,
    view::{Rig, Viewport, projection::pixel_centre},
};

/// Pixels compared of an image at most.
pub const MOST_PIXELS: usize = 512;
/// Pixels compared of all images of a frame at most, but for 64 of each.
pub const MOST_PIXELS_OF_FRAME: usize = 2048;
/// Largest error over the budget of 99.9 % that a pixel may have.
pub const MOST_OVER_BUDGET: f64 = 4.0;
/// What f32 may add to a display value, codes.
pub const NUMERICAL_CODES: f64 = 0.1;
/// How far from its place a star may be drawn, pixels.
pub const POSITION_PX: f64 = 1e-3;
/// What a kernel changes by per pixel at most.
const STEEPEST_PER_PX: f64 = 1.0;

/// What a frame was drawn from.
#[derive(Clone, Copy, Debug)]
pub struct AuditedScene<'a> {
    /// The scene, with the camera of the frame.
    pub scene: &'a SceneSnapshot,
    /// Its views.
    pub rig: &'a Rig,
    /// How it was to be drawn; the budgets are its own.
    pub settings: &'a RenderSettings,
    /// Whether its exposure was known before it was drawn, as it is but for the first frame by mean luminance.
    pub exposure_known: bool,
    /// Pixels compared of each image at most; see [`MOST_PIXELS`].
    pub most_pixels: usize,
    /// The numbers that its views have in the frame, in the order of the rig; `None`: those of the rig.
    pub numbers: Option<&'a [usize]>,
}

impl<'a> AuditedScene<'a> {
    /// What a frame of one group of views was drawn from. `adapted`: with an exposure that the frames before have led to.
    pub fn of_group(scene: &'a SceneSnapshot, group: &'a FrameGroup, adapted: bool) -> Self {
        let FrameGroup { rig, settings, exposed_as, .. } = group;
        // Only a frame that meters itself is drawn before its exposure is known.
        let exposure_known = adapted || exposed_as.is_some() || !settings.exposure.is_metered();
        Self { scene, rig, settings, exposure_known, most_pixels: MOST_PIXELS, numbers: None }
    }

    /// The number of a view of the frame in the rig.
    fn view_of(&self, number: usize) -> Option<usize> {
        match self.numbers {
            Some(numbers) => numbers.iter().position(|of| *of == number),
            None => (number < self.rig.views().len()).then_some(number),
        }
    }
}

/// Compares a frame with what it was drawn from. The second result is that of the HDR images where they were drawn apart.
///
/// # Errors
///
/// The scene cannot be planned with these settings.
pub fn audit(of: &AuditedScene<'_>, frame: &Frame, limits: &Limits) -> Result<[Audit; 2], PlanError> {
    let mut audits = [Audit::default(), Audit::default()];
    let reasons = reasons_against(of);
    let [shown, exact] = &mut audits;
    if !reasons.is_empty() {
        shown.not_audited.clone_from(&reasons);
        exact.not_audited = reasons;
        return Ok(audits);
    }
    let expected = Expected::new(of, frame, limits)?;
    let images = expected.images_of(of, frame);
    for image in &images {
        if expected.has_glare() && shown_rad_of(&image.viewport.projection) > smooth_angle_rad(0) {
            let pixel_deg = image.viewport.projection.middle_pixel_rad().to_degrees();
            let why = "so wide that the twin of glare is not what the exact method draws";
            shown.not_audited.push(format!("view {}: pixels of {pixel_deg:.1} degrees, {why}", image.name));
            continue;
        }
        let own = if frame.hdr_plan.is_some() { &mut *exact } else { &mut *shown };
        own.images.extend(image.compare_hdr(&expected, of.settings));
        shown.images.extend(image.compare_display(&expected, of.settings));
    }
    if images.is_empty() {
        shown.not_audited.push("the frame has no images".to_owned());
    }
    Ok(audits)
}

/// Audits a frame and writes into its plans what was found.
///
/// # Errors
///
/// Those of [`audit`].
pub fn audit_into(of: &AuditedScene<'_>, frame: &mut Frame, limits: &Limits) -> Result<(), PlanError> {
    let [shown, exact] = audit(of, frame, limits)?;
    frame.plan.audit = Some(shown);
    if let Some(plan) = &mut frame.hdr_plan {
        plan.audit = Some(exact);
    }
    Ok(())
}

/// Why a frame cannot be compared; none: it can.
fn reasons_against(of: &AuditedScene<'_>) -> Vec<String> {
    let (method, objects) = (of.settings.stars.method, &of.scene.objects);
    let glare = of.settings.glare.chosen(method);
    let mut reasons = Vec::new();
    if method.accumulator() != Accumulator::FixedPoint {
        reasons.push(format!("the star method {}: a published one, which keeps no budget", method.name()));
    }
    if method == StarMethod::PixelGaussian {
        reasons.push(format!("the star method {}: its twin goes through all pixels for every star", method.name()));
    }
    if !matches!(glare, GlareMethod::None | GlareMethod::SkyCube) {
        reasons.push(format!("the glare method {}: a published one, which keeps no budget", glare.name()));
    }
    if objects.surroundings.is_some() {
        reasons.push(
            "the ground and the air around an observer: what they cover and scatter has no twin by the pixel"
                .to_owned(),
        );
    }
    let count = |count: usize, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
    if !objects.bodies.is_empty() {
        let bodies = count(objects.bodies.len(), "body", "bodies");
        reasons.push(format!("{bodies}: what they cover and scatter has no twin by the pixel"));
    }
    if !objects.fields.is_empty() {
        let fields = count(objects.fields.len(), "asteroid field", "asteroid fields");
        reasons.push(format!("{fields}: what they cover and scatter has no twin by the pixel"));
    }
    reasons
}

/// What a frame is to show.
struct Expected {
    /// An exact plan of its own: which kernel serves which brightness, viewports, the unit of the sums.
    plan: Plan,
    /// Display white, cd/m^2.
    white_cd_m2: f64,
}

impl Expected {
    fn new(of: &AuditedScene<'_>, frame: &Frame, limits: &Limits) -> Result<Self, PlanError> {
        let known = of.exposure_known.then_some(frame.exposure_ev100);
        let outputs = PlanOutputs {
            exposure: known.map_or(ExposureSource::Own, |_| ExposureSource::Meter),
            ..PlanOutputs::new(Output::Hdr)
        };
        let plan = Planner::new().plan(of.scene, of.rig, of.settings, known, outputs, limits)?;
        Ok(Self { plan, white_cd_m2: white_luminance_cd_m2(frame.exposure_ev100) })
    }

    fn has_glare(&self) -> bool {
        self.plan.glare.method == GlareMethod::SkyCube
    }

    /// The images of a frame with the pixels that are to be compared.
    fn images_of<'a>(&'a self, of: &AuditedScene<'_>, frame: &'a Frame) -> Vec<AuditedImage<'a>> {
        let each = (MOST_PIXELS_OF_FRAME / frame.images.len().max(1)).max(64).min(of.most_pixels);
        let camera = &of.scene.camera;
        let eye = |viewport: &Viewport| Eye {
            position_m: camera.position_m + viewport.eye_offset_m,
            velocity_c: camera.velocity_c,
            ..Eye::default()
        };
        let bright = {
            let sight =
                Sight::new(Eye { position_m: camera.position_m, velocity_c: camera.velocity_c, ..Eye::default() });
            let seen = of.scene.stars.iter().filter_map(|(at, at_infinity, star)| sight.of(at, at_infinity, star));
            sample::brightest(seen.map(|star| (star.illuminance_lx, star.direction.normalize())))
        };
        let mut images: Vec<AuditedImage<'a>> = Vec::new();
        for image in &frame.images {
            let Some(view) = of.view_of(image.view) else { continue };
            let is_of = |viewport: &Viewport| (viewport.view, viewport.part) == (view, image.part);
            let Some(number) = self.plan.viewports.iter().position(is_of) else { continue };
            let viewport = &self.plan.viewports[number];
            let name = of.rig.views()[view].name.clone();
            images.push(AuditedImage::new(image, viewport, number, name, &bright, each));
        }
        images.iter_mut().for_each(|image| image.leave_out_overlay(&self.plan));
        let glare = self.plan.glare.kernel.as_deref().filter(|_| self.has_glare());
        // Each eye sees the stars from a place of its own.
        let mut eyes: Vec<DVec3> = images.iter().map(|image| image.viewport.eye_offset_m).collect();
        eyes.sort_by(|a, b| a.to_array().map(f64::to_bits).cmp(&b.to_array().map(f64::to_bits)));
        eyes.dedup();
        for offset in eyes {
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
                    kernels: self.plan.kernels[image.number],
                    shown: glare.map(|kernel| ShownCore::new(kernel, shown_rad_of(&image.viewport.projection))),
                    pixels,
                })
                .collect();
            let Eye { position_m, velocity_c, .. } = eye(seen[0].viewport);
            let sky = SampledSky {
                stars: &of.scene.stars,
                eye_m: position_m,
                velocity_c,
                faintest_lx: self.plan.faintest_lx,
                glare: glare.map(|kernel| SampledGlare {
                    kernel,
                    fraction: self.plan.glare.fraction,
                    tolerance: of.settings.accuracy.glare,
                }),
            };
            let lights = pixels(&sky, &sampled);
            drop(sampled);
            seen.iter_mut().zip(lights).for_each(|(image, lights)| image.lights = lights);
        }
        images
    }
}

/// An image with its sample.
struct AuditedImage<'a> {
    image: &'a FrameImage,
    viewport: &'a Viewport,
    /// Number of the viewport in the plan.
    number: usize,
    name: String,
    sample: Vec<([u32; 2], Place)>,
    /// Pixels of the sample that an overlay covers.
    covered: Vec<bool>,
    /// What each pixel of the sample is to show.
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
        let at = |[x, y]: [u32; 2]| y as usize * image.width as usize + x as usize;
        let darkness = |pixel: [u32; 2]| match (&image.display, &image.hdr) {
            (Some(display), _) => display[4 * at(pixel)..][..3].iter().map(|code| u64::from(*code)).sum(),
            // Of positive numbers the bits are in order.
            (None, Some(hdr)) => hdr[at(pixel)][..3].iter().map(|light| u64::from(light.max(0.0).to_bits())).sum(),
            (None, None) => 0,
        };
        let mapping = viewport.projection.mapping();
        let sample = sample::pixels(mapping, viewport.world_from_view, bright, &darkness, count);
        let covered = vec![false; sample.len()];
        Self { image, viewport, number, name, sample, covered, lights: Vec::new() }
    }

    /// Marks pixels of the display image that lines and text touch: what they leave of black and of white.
    fn leave_out_overlay(&mut self, plan: &Plan) {
        let Some(overlay) = &plan.overlay else { return };
        let items = overlay.first_items.get(self.number..self.number + 2).map(|ends| &overlay.items[ends[0]..ends[1]]);
        let Some(items) = items.filter(|items| !items.is_empty()) else { return };
        let size = [self.image.width, self.image.height];
        let pixels = size[0] as usize * size[1] as usize;
        for blank in [0, 255] {
            let mut codes = vec![blank; 4 * pixels];
            let mut target = OverlayTarget { size, codes: &mut codes, contains: &|_, _| true, cover: &|_, _| None };
            draw(&mut target, items, &overlay.texels);
            for (([x, y], _), covered) in self.sample.iter().zip(&mut self.covered) {
                let index = 4 * (*y as usize * size[0] as usize + *x as usize);
                *covered |= codes[index..index + 3].iter().any(|code| *code != blank);
            }
        }
    }

    /// The errors of its display image; none if it has none.
    fn compare_display(&self, expected: &Expected, settings: &RenderSettings) -> Option<ImageAudit> {
        let display = self.image.display.as_ref()?;
        let (tone_map, codes) = (&settings.tone_map, settings.accuracy.display_codes);
        let shown = |rgb: [f64; 3]| tone_map.display_rgb(rgb, expected.white_cd_m2).map(|value| 255.0 * value);
        let mut compared = Vec::new();
        let mut left_out = 0;
        for (pixel, (([x, y], _), light)) in self.sample.iter().zip(&self.lights).enumerate() {
            if light.undecided || self.covered[pixel] {
                left_out += 1;
                continue;
            }
            let luminance = light.luminance_cd_m2();
            let allowed = if codes > 0.0 { 0.0 } else { self.allowed_cd_m2(light, [*x, *y], expected, settings) };
            let [exact, least, most] = [0.0, -allowed, allowed].map(|by| shown(luminance.map(|c| (c + by).max(0.0))));
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

    /// The errors of its HDR image; none if it has none.
    fn compare_hdr(&self, expected: &Expected, settings: &RenderSettings) -> Option<ImageAudit> {
        let hdr = self.image.hdr.as_ref()?;
        let mut compared = Vec::new();
        let mut left_out = 0;
        for (pixel, (([x, y], _), light)) in self.sample.iter().zip(&self.lights).enumerate() {
            if light.undecided {
                left_out += 1;
                continue;
            }
            let allowed = self.allowed_cd_m2(light, [*x, *y], expected, settings);
            let drawn = hdr[self.index_of([*x, *y])];
            for (channel, exact) in light.luminance_cd_m2().into_iter().enumerate() {
                let drawn = f64::from(drawn[channel]);
                compared.push(Compared { error: (drawn - exact).abs() / allowed, pixel, channel, drawn, exact });
            }
        }
        Some(self.verdict(AuditedOutput::Hdr, &compared, left_out, [1.0, MOST_OVER_BUDGET]))
    }

    /// By how much a pixel of an HDR image may be off, cd/m^2.
    fn allowed_cd_m2(
        &self,
        light: &PixelLight,
        [x, y]: [u32; 2],
        Expected { plan, .. }: &Expected,
        settings: &RenderSettings,
    ) -> f64 {
        let main = plan.ranges.main.units_per_lx;
        let coarsest = plan.ranges.bright.as_ref().map_or(main, |bright| bright.units_per_lx.min(main));
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
        // The last of them in total order: one that is no number is the worst.
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

/// By how much display values from the least to the most that is allowed, in codes, all lie outside of those that are drawn as a code.
fn beyond_rounding(code: u8, [least, most]: [f64; 2], tone_map: &ToneMapSettings, [x, y]: [u32; 2]) -> f64 {
    let threshold = if tone_map.dither { dither_threshold(x, y) } else { 0.5 };
    let lower = if code == 0 { f64::NEG_INFINITY } else { f64::from(code) - threshold };
    let upper = if code == 255 { f64::INFINITY } else { f64::from(code) + 1.0 - threshold };
    if least.is_nan() || most.is_nan() { f64::NAN } else { (lower - most).max(least - upper).max(0.0) }
}

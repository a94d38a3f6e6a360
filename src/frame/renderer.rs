//! The renderer: what it holds from frame to frame, and the plan of a frame. `record` turns the plan into commands, `read`
//! takes the results back, and `submit` is the order of it all.

use std::{sync::Arc, time::Instant};

use glam::DVec3;

use super::{
    asteroids::{AsteroidPlan, Asteroids},
    blended::{self, Blended},
    error::RenderError,
    geometry::{self, Geometry},
    glare::Glare,
    published::Published,
    star_buffers::{ItemBuffers, StarBuffers},
    submit::InFlight,
};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{AdapterReport, Gpu, GpuTimer, GrowingBuffer, ReadbackBuffer, encode_viewport, layout},
    passes::{
        exposure::ExposurePass, present::PresentPass, resolve::ResolvePass, stars::StarPass, tone_map::ToneMapPass,
    },
    plan::{
        asteroids::glare::field_clouds,
        cull::{CullSettings, MAX_VIEWPORTS, SPLAT_MARGIN_PX, VisibleChunk, distinct_eyes_pc, visible_chunks},
        gaussian_of,
        object_glare::Cloud,
        plan_stars,
        range::{self, OtherLight, Ranges},
        settings::{Accumulator, AsteroidSettings, ExposureSettings, GlareMethod, RenderSettings, StarMethod},
        tiles::{BYTES_PER_PIXEL, Batch, batches},
        travel,
        view_bodies::{BodyPlan, plan_bodies},
    },
    relativity::Motion,
    scene::{
        SceneObjects, SceneSnapshot,
        asteroids::AsteroidField,
        bodies::{Sun, suns},
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Rig, Viewport},
};

/// Memory that the pixels of one frame may take in all.
const MAX_FRAME_BYTES: u64 = 12 << 30;
/// What a pixel takes at most: sums (or HDR image) and display image, on the adapter, in readback and in the frame.
const FRAME_BYTES_PER_PIXEL: u64 = 3 * (BYTES_PER_PIXEL + DISPLAY_BYTES) + BYTES_PER_PIXEL / 2;
/// Bytes of a pixel of the display image.
pub(super) const DISPLAY_BYTES: u64 = 4;

/// Buffers of one batch of tiles, kept from frame to frame.
pub(super) struct BatchBuffers {
    pub(super) pixels: GrowingBuffer,
    pub(super) high_words: GrowingBuffer,
    pub(super) bright_pixels: GrowingBuffer,
    pub(super) bright_high_words: GrowingBuffer,
    pub(super) display: GrowingBuffer,
}

impl BatchBuffers {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self {
            pixels: GrowingBuffer::new("pixels", usage),
            high_words: GrowingBuffer::new("high words", usage),
            bright_pixels: GrowingBuffer::new("bright pixels", usage),
            bright_high_words: GrowingBuffer::new("bright high words", usage),
            display: GrowingBuffer::new("display", usage),
        }
    }
}

/// Draws frames on one GPU.
pub struct Renderer {
    pub(super) gpu: Gpu,
    pub(super) star_pass: StarPass,
    pub(super) resolve_pass: ResolvePass,
    pub(super) exposure_pass: ExposurePass,
    pub(super) tone_map_pass: ToneMapPass,
    pub(super) present_pass: PresentPass,
    pub(super) published: Published,
    pub(super) blended: Blended,
    pub(super) geometry: Geometry,
    pub(super) asteroids: Asteroids,
    pub(super) glare: Glare,
    pub(super) timer: GpuTimer,
    pub(super) stars: Option<StarBuffers>,
    pub(super) item_buffers: ItemBuffers,
    pub(super) batch_buffers: Vec<BatchBuffers>,
    pub(super) partial_sums: GrowingBuffer,
    pub(super) readback: ReadbackBuffer,
    pub(super) frames: u64,
    /// The frame that has been submitted and not finished.
    pub(super) in_flight: Option<InFlight>,
    /// Whether chunks outside of every view are left out; false only to measure what that saves.
    pub culling: bool,
    /// Factor on the fixed-point units: 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
    /// Order in which the stars reach the GPU. `None`: that of right ascension for methods that read the whole catalogue, that of
    /// the chunks for those that read what culling leaves. `Some(seed)`: one that the seed shuffles, star by star, to measure
    /// what depends on it.
    #[doc(hidden)]
    pub catalogue_order: Option<u64>,
}

/// What the plan of a frame decides before anything is recorded.
pub(super) struct Prepared {
    pub(super) viewports: Vec<Viewport>,
    pub(super) batches: Vec<Batch>,
    pub(super) visible: Vec<VisibleChunk>,
    pub(super) ranges: Ranges,
    pub(super) encoded: Vec<layout::Viewport>,
    pub(super) plan: crate::plan::FramePlan,
    pub(super) total_solid_angle_sr: f64,
    pub(super) cull_ms: f64,
    pub(super) camera_pc: DVec3,
    pub(super) faintest_lx: f64,
    pub(super) motion: Option<Motion>,
    /// Bodies and asteroids; `None`: there are none.
    pub(super) bodies: Option<BodyPlan>,
    /// Fields of asteroids; `None`: there are none.
    pub(super) asteroids: Option<AsteroidPlan>,
    /// What fields of asteroids scatter in the eye of each viewport.
    pub(super) clouds: Vec<Vec<Cloud>>,
}

impl Renderer {
    /// A renderer on an open device.
    pub fn new(gpu: Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            star_pass: StarPass::new(&gpu),
            resolve_pass: ResolvePass::new(&gpu),
            exposure_pass: ExposurePass::new(&gpu),
            tone_map_pass: ToneMapPass::new(&gpu),
            present_pass: PresentPass::new(),
            published: Published::new(),
            blended: Blended::new(),
            geometry: Geometry::new(&gpu),
            asteroids: Asteroids::new(),
            glare: Glare::new(),
            timer: GpuTimer::new(&gpu),
            stars: None,
            item_buffers: ItemBuffers::new(),
            batch_buffers: Vec::new(),
            partial_sums: GrowingBuffer::new("partial sums", usage),
            readback: ReadbackBuffer::new("readback"),
            frames: 0,
            in_flight: None,
            culling: true,
            unit_factor: 1.0,
            catalogue_order: None,
            gpu,
        }
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterReport {
        self.gpu.report()
    }

    /// The device, to compute on it beside frames.
    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Whether the adapter can hold the images of a rig.
    pub fn check(&self, rig: &Rig) -> Result<(), RenderError> {
        let limit = self.gpu.max_view_side_px();
        let mut bytes = 0;
        let mut images = 0;
        for view in rig.views() {
            for image in &view.images {
                let [width, height] = image.projection.mapping().size();
                let name = || view.name.clone();
                if width > limit || height > limit {
                    return Err(RenderError::TooLarge { view: name(), width, height, limit });
                }
                bytes += u64::from(width) * u64::from(height) * FRAME_BYTES_PER_PIXEL;
                if bytes > MAX_FRAME_BYTES {
                    return Err(RenderError::TooManyPixels { view: name(), bytes, limit: MAX_FRAME_BYTES });
                }
                images += 1;
            }
        }
        if images > MAX_VIEWPORTS {
            return Err(RenderError::TooManyImages { images, limit: MAX_VIEWPORTS });
        }
        Ok(())
    }

    /// Whether the texture that methods which blend draw the largest image into leaves room for the images themselves: for a
    /// fisheye of a few degrees it is a cube's face as fine as the picture, far larger than the picture.
    pub(super) fn check_blended(&self, rig: &Rig) -> Result<(), RenderError> {
        let images = || rig.views().iter().flat_map(|view| view.images.iter().map(move |image| (view, image)));
        let pixels: u64 =
            images().map(|(_, image)| image.projection.mapping().size().map(u64::from).iter().product::<u64>()).sum();
        for (view, image) in images() {
            let bytes = pixels * FRAME_BYTES_PER_PIXEL + blended::target_bytes(&self.gpu, &image.projection);
            if bytes > MAX_FRAME_BYTES {
                return Err(RenderError::TooManyPixels { view: view.name.clone(), bytes, limit: MAX_FRAME_BYTES });
            }
        }
        Ok(())
    }

    /// Whether bodies and asteroids can be drawn with a star method, as the camera moves.
    pub(super) fn check_objects(&self, snapshot: &SceneSnapshot, method: StarMethod) -> Result<(), RenderError> {
        if snapshot.objects.is_empty() {
            return Ok(());
        }
        if method.accumulator() != Accumulator::FixedPoint {
            return Err(RenderError::StarsOnly(method.name()));
        }
        if snapshot.camera.velocity_c != DVec3::ZERO {
            return Err(RenderError::ObjectsAtRest);
        }
        let (bytes, limit) = (geometry::texture_bytes(&snapshot.objects), self.gpu.max_binding_bytes());
        if bytes > limit {
            return Err(RenderError::TooManyTexels { bytes, limit });
        }
        Ok(())
    }

    /// Lets go of everything that belongs to a scene or a size, a frame in flight included.
    pub(super) fn forget_buffers(&mut self) {
        self.in_flight = None;
        self.stars = None;
        self.published.forget_buffers();
        self.blended.forget_buffers();
        self.geometry.release();
        self.asteroids.release();
        self.glare.release();
        self.batch_buffers.clear();
        self.item_buffers = ItemBuffers::new();
        self.partial_sums.release();
        self.readback = ReadbackBuffer::new("readback");
    }

    pub(super) fn hold_stars(&mut self, method: StarMethod, set: &Arc<StarSet>) {
        self.published.hold_catalogue(&self.gpu, method, set, self.catalogue_order);
        if method.reads_visible() && self.stars.as_ref().is_none_or(|stars| !stars.holds(set)) {
            self.stars = None;
            self.stars = Some(StarBuffers::new(&self.gpu, set.clone()));
        }
    }

    pub(super) fn prepare(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
    ) -> Result<Prepared, RenderError> {
        let camera = &snapshot.camera;
        let motion = Motion::new(camera.velocity_c);
        let viewports = rig.viewports(camera.world_from_camera);
        let sizes: Vec<[u32; 2]> = viewports.iter().map(Viewport::size).collect();
        let batches = batches(&sizes, self.gpu.max_binding_bytes() / BYTES_PER_PIXEL);
        // How far over a border the widest kernel reaches.
        let reaches = viewports.iter().filter_map(|viewport| gaussian_of(settings, viewport));
        let margin_px = reaches.map(|(_, reach_px)| reach_px).fold(SPLAT_MARGIN_PX, f64::max);
        let faintest_lx = illuminance_lx_from_magnitude(settings.stars.magnitude_limit);
        let cull = CullSettings { faintest_lx, enabled: self.culling, motion, margin_px };
        let start = Instant::now();
        let camera_pc = camera.position_m / PARSEC_M;
        let visible = if settings.stars.method.reads_visible() {
            visible_chunks(&snapshot.stars, camera_pc, &viewports, cull)
        } else {
            Vec::new()
        };
        let cull_ms = start.elapsed().as_secs_f64() * 1e3;
        let suns = suns(&snapshot.objects);
        let mut bodies = (!snapshot.objects.is_empty())
            .then(|| plan_bodies(&snapshot.objects, &suns, camera.position_m, &viewports, margin_px));
        let asteroids = self.asteroids.plan(
            &self.gpu,
            &snapshot.objects,
            &settings.asteroids,
            &viewports,
            margin_px,
            camera.position_m,
            &suns,
        )?;
        if let (Some(bodies), Some(asteroids)) = (&mut bodies, &asteroids) {
            bodies.points.extend(asteroids.cut.unresolved.iter().map(|node| node.point));
        }
        let mut clouds = Vec::new();
        if settings.glare.chosen(settings.stars.method) == GlareMethod::SkyCube {
            if let (Some(bodies), Some(kernel)) = (&mut bodies, self.glare.kernel()) {
                bodies.keep_own_glare(kernel, settings.glare.fraction_scattered());
            }
            clouds = clouds_of(&snapshot.objects, &suns, camera.position_m, &viewports);
        }
        let eyes_pc = distinct_eyes_pc(&viewports);
        let eyes_m: Vec<DVec3> = eyes_pc.iter().map(|eye| *eye * PARSEC_M).collect();
        let other = bodies.as_ref().map_or_else(OtherLight::default, |bodies| OtherLight {
            points_lx: bodies
                .points
                .iter()
                .map(|point| eyes_m.iter().map(|eye| point.light_at_lx(*eye)).collect())
                .collect(),
            crowd_lx: asteroids.iter().flat_map(|plan| &plan.cut.points_lx).copied().fold(0.0, f64::max),
        });
        let mut ranges = range::choose(&snapshot.stars, &visible, &eyes_pc, faintest_lx, motion, &other);
        ranges.main.units_per_lx *= self.unit_factor;
        let total_solid_angle_sr = viewports.iter().map(|v| v.projection.picture_solid_angle_sr()).sum();
        let expected_ev100 = settings
            .known_white_ev100(adapted_ev100)
            .or_else(|| expected_ev100(&visible, bodies.as_ref(), total_solid_angle_sr, &settings.exposure));
        let accumulator = self.gpu.accumulator_name(settings.stars.method.accumulator());
        let mut plan = plan_stars(settings, &viewports, &ranges, expected_ev100, accumulator);
        if let Some(motion) = motion {
            plan.report.certificate.extend(travel::certificate(&snapshot.stars, &visible, &motion, &settings.accuracy));
        }
        plan.report.certificate.extend(asteroids.iter().flat_map(|plan| plan.certificate.iter().cloned()));
        let encoded = viewports.iter().zip(&plan.kernels).map(|(v, kernels)| encode_viewport(v, kernels)).collect();
        Ok(Prepared {
            viewports,
            batches,
            visible,
            ranges,
            encoded,
            plan: plan.report,
            total_solid_angle_sr,
            cull_ms,
            camera_pc,
            faintest_lx,
            motion,
            bodies,
            asteroids,
            clouds,
        })
    }

    /// Holds fields of asteroids, or nothing where there are none.
    pub(super) fn hold_asteroids(
        &mut self,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
    ) -> Result<(), RenderError> {
        if objects.fields.is_empty() {
            self.asteroids.release();
            return Ok(());
        }
        self.asteroids.hold(&self.gpu, objects, settings)
    }
}

/// What fields of asteroids scatter in the eye of each viewport; nothing where there are none.
fn clouds_of(objects: &SceneObjects, suns: &[Sun], camera_m: DVec3, viewports: &[Viewport]) -> Vec<Vec<Cloud>> {
    if objects.fields.is_empty() {
        return Vec::new();
    }
    let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
    let mut clouds: Vec<Vec<Cloud>> = Vec::with_capacity(viewports.len());
    for (index, viewport) in viewports.iter().enumerate() {
        // Eyes at one place see the same.
        let same = viewports[..index].iter().position(|other| other.eye_offset_m == viewport.eye_offset_m);
        clouds.push(match same {
            Some(other) => clouds[other].clone(),
            None => field_clouds(&fields, camera_m + viewport.eye_offset_m, suns),
        });
    }
    clouds
}

/// The exposure that a frame will be metered at, as far as the stars' positions tell: good to a fraction of a stop.
fn expected_ev100(
    visible: &[VisibleChunk],
    bodies: Option<&BodyPlan>,
    total_solid_angle_sr: f64,
    settings: &ExposureSettings,
) -> Option<f64> {
    if total_solid_angle_sr <= 0.0 {
        return None;
    }
    let stars_lx: f64 = visible.iter().map(|chunk| chunk.total_lx * f64::from(chunk.viewports.count_ones())).sum();
    let light_lx = stars_lx + bodies.map_or(0.0, BodyPlan::light_in_view_lx);
    Some(settings.metered_ev100(light_lx / total_solid_angle_sr))
}

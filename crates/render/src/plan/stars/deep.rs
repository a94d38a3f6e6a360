//! Stars of a deep store in a plan: the detail in which each part of the sky is drawn, and the pages that are needed for it.
//!
//! A composite star has the light of all faint stars of a cell. A cell may be as large as [`DIRECT_CELL_PX`] pixels where views draw composite stars
//! themselves, and [`crate::plan::smooth_light::SkyMap::cell_texels`] texels in the map of faint light. If no plane of composite stars is fine
//! enough, all stars are drawn. Pages that have not been read yet are replaced by coarser ones; [`Residual`] is a bound of the resulting error.

use std::{
    collections::HashSet,
    sync::{
        Arc, LazyLock,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::cull::{CullSettings, Field};
use crate::{
    catalogue::deep::{
        BUCKET_ORDER, BUCKETS, LAYERS, SUM_ORDER,
        live::{DeepSky, Detail, Page, PageKey, PageStar, page::MOST_PARALLAX},
    },
    photometry::rec709::luminance,
    plan::{DeepReport, PlanError},
    units::illuminance_lx_from_magnitude,
    view::{Viewport, projection::BoundingCone},
};

/// Largest cell of composite stars: root of the ratio of its area to that of a pixel. With 749 stars per pixel, the measured error at this size is
/// 0.18 codes.
pub const DIRECT_CELL_PX: f64 = 0.8;
/// Greatest luminance of a star that a composite star may replace, relative to the least luminance that may be visible. The star's luminance is
/// computed as if all of its light were in one pixel. Measured with `benches/deep_patches.rs`.
const MOST_SEEN: f64 = 1.5;
/// If the magnitude limit is at least this, all stars of a store are drawn. Composite stars may be used only then, because they cannot be divided by
/// magnitude.
pub const WHOLE_FROM_MAGNITUDE: f64 = 21.0;
/// Magnitude up to which all stars of a deep store are resident.
const RESIDENT_TO_MAGNITUDE: f64 = LAYERS[0].magnitude as f64;
/// The stars of a page are sorted by their light before rounding. The rounded light is more than this fraction of it.
const LIGHT_ROUNDING: f64 = 0.98;
/// Reach of the kernels of composite stars, pixels.
const KERNEL_REACH_PX: f64 = 1.5;
/// Illuminance of the brightest star of each layer, lx.
static BRIGHTEST_LX: LazyLock<[f64; LAYERS.len()]> =
    LazyLock::new(|| LAYERS.map(|layer| illuminance_lx_from_magnitude(layer.brightest_mag())));
/// Share of the memory for pages that the pages of one plan may take. The remainder is for pages of other views and of later frames.
const SHARE_OF_A_PLAN: f64 = 0.9;

/// Pages that views will need within this time, if they continue to turn at the same rate, are requested in advance. Reading the pages of a view from
/// a disk takes about half of this time.
const AHEAD: Duration = Duration::from_millis(500);
/// Urgency of pages that are requested in advance: lower than that of any page whose absence causes an error.
const AFTER_ALL_ELSE: f64 = -1.0;
/// If frames are farther apart than this, the turn of the views is unknown.
const LONGEST_FRAME: Duration = Duration::from_millis(500);
/// If the views turn by more than this within [`AHEAD`], the turn is a jump, rad.
const MOST_TURN_RAD: f64 = 1.0;
/// A turn of less than this fraction of a view's radius needs no new pages.
const LEAST_TURN: f64 = 1e-3;

/// The stars of a deep store that a frame draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drawn {
    /// All stars. Layers whose brightest stars exceed [`MOST_SEEN`] times the least luminance that may be visible are drawn star by star.
    All {
        /// The least luminance that may be visible, cd/m^2; `None`: any star may be part of a composite star.
        seen_cd_m2: Option<f64>,
    },
    /// The stars that are too bright for a map of faint light.
    Brighter {
        /// The limit.
        from_lx: f64,
    },
    /// The stars of a map of faint light. Layers with stars as bright as the limit are drawn star by star.
    Fainter {
        /// The limit.
        below_lx: f64,
    },
}

/// Parameters of the selection.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeepInputs<'a> {
    pub sky: &'a Arc<DeepSky>,
    pub camera_pc: DVec3,
    pub viewports: &'a [Viewport],
    pub cull: CullSettings,
    /// Largest cell, pixels.
    pub cell_px: f64,
    pub drawn: Drawn,
    pub magnitude_limit: f64,
    pub every_star: bool,
    /// Whether frames are drawn without leaves and tiles that are damaged.
    pub skip_damaged: bool,
    /// Whether to request pages that are not in memory.
    pub asks: bool,
    /// Whether stars may be read while the frame is drawn, if they do not fit into the memory.
    pub streams: bool,
    /// Memory for pages: half of it on the host, half on the device.
    pub memory_bytes: u64,
}

/// A page that is drawn.
#[derive(Clone, Debug)]
pub struct VisiblePage {
    /// The page.
    pub page: Arc<Page>,
    /// Bit i: visible in viewport i.
    pub viewports: u64,
    /// Number of its stars that are drawn, the brightest ones.
    pub count: u32,
}

/// Bound of the error due to pages that are missing, or coarser than the pixels require because finer ones do not fit into memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Error of the luminance of a pixel, cd/m^2.
    pub cd_m2: f64,
    /// Number of pages that have not been read yet.
    pub missing: u64,
}

/// Stars that a picture lacks because their pages have not been read, or do not fit into the memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lack {
    /// The resulting error.
    pub residual: Residual,
    /// The pages that have not been read.
    pub keys: Vec<PageKey>,
}

/// Deep stars of a frame.
#[derive(Clone, Debug, Default)]
pub struct DeepPlan {
    /// The store; `None`: the scene has none, or the frame draws nothing of it.
    pub sky: Option<Arc<DeepSky>>,
    /// Pages that are drawn.
    pub visible: Vec<VisiblePage>,
    /// Leaves that do not fit into memory together, with the viewports in which they may be visible. They are read while the frame is drawn.
    pub streamed: Vec<(PageKey, u64)>,
    /// Pages that were needed but not in memory.
    pub missing: Vec<PageKey>,
    /// Bound of the error that missing and coarser pages cause.
    pub residual: Residual,
    /// Stars that each viewport lacks; only in plans for pictures of a map.
    pub lacks: Vec<Lack>,
    /// Greatest number of codes of an 8-bit display image per cd/m^2; 0 if it is not known.
    pub codes_per_cd_m2: f64,
    /// Bound of the light of all drawn pages, lx.
    pub total_lx: f64,
    /// Illuminance of the faintest drawn star at the barycentre, lx.
    pub faintest_lx: f64,
    /// Number of stars and composite stars.
    pub stars: u64,
    /// Memory on the device, bytes.
    pub device_bytes: u64,
    /// Largest cell of composite stars, the root of its area, pixels; 0: every star is drawn.
    pub cell_px: f64,
}

/// A part of the sky that some viewports show with the same detail.
#[derive(Clone, Copy, Debug)]
struct Part {
    bucket: u64,
    detail: Detail,
    /// Whether the detail is coarser than the pixels require, because more does not fit into memory.
    is_coarser: bool,
    viewports: u64,
    /// Smallest pixel of these viewports there, sr.
    pixel_sr: f64,
}

/// The part with its visible pages.
struct PartPages {
    part: Part,
    pages: Vec<(PageKey, u64)>,
}

/// Selects the pages of a frame, and may request missing ones.
///
/// # Errors
/// Stars that cannot be replaced by composite stars do not fit into the memory.
pub(super) fn select(inputs: &DeepInputs<'_>) -> Result<DeepPlan, PlanError> {
    let sky = inputs.sky;
    // The stars that a picture lacks are listed only for pictures of a map, since each of these can be drawn again.
    let lacking = if matches!(inputs.drawn, Drawn::Fainter { .. }) { inputs.viewports.len() } else { 0 };
    let mut plan = DeepPlan {
        faintest_lx: f64::INFINITY,
        device_bytes: inputs.memory_bytes / 2,
        lacks: vec![Lack::default(); lacking],
        ..DeepPlan::default()
    };
    if inputs.magnitude_limit <= RESIDENT_TO_MAGNITUDE {
        return Ok(plan);
    }
    if let Some(problem) = sky.problem().filter(|_| !inputs.skip_damaged) {
        return Err(PlanError::DeepDamaged(problem));
    }
    if layers_of(inputs) == 0 {
        return Ok(plan);
    }
    plan.sky = Some(Arc::clone(sky));
    sky.set_limit(inputs.memory_bytes / 2);
    let fields: Vec<Field> = inputs.viewports.iter().map(|viewport| Field::new(viewport, &inputs.cull)).collect();
    // Choose the detail of each part of the sky, and reduce it if the memory requires.
    let mut parts: Vec<Part> =
        (0..BUCKETS).into_par_iter().flat_map_iter(|bucket| parts_of(inputs, &fields, bucket)).collect();
    let most_bytes = most_bytes_of_a_plan(inputs);
    let mut finest = Detail::Stars;
    let pages = loop {
        let pages: Vec<PartPages> = parts.par_iter().map(|part| visible_pages(inputs, &fields, *part)).collect();
        let bytes = bytes_of(inputs.sky, &pages);
        if bytes <= most_bytes {
            break pages;
        }
        // A map contains the stars of bright layers one by one, because the frames that read it draw some of them.
        let least_leaves = if let Drawn::Fainter { below_lx } = inputs.drawn { layers_from(below_lx) } else { 0 };
        let coarser = finest.coarser().filter(|coarser| is_divisible(inputs) && coarser.leaves() >= least_leaves);
        let Some(coarser) = coarser else {
            if inputs.streams && matches!(inputs.drawn, Drawn::All { .. }) {
                plan.stream(inputs, &pages);
                return Ok(plan);
            }
            return Err(PlanError::DeepMemory {
                needed_mib: bytes.div_ceil(1 << 20) * 20 / 9 + 1,
                memory_mib: inputs.memory_bytes >> 20,
            });
        };
        finest = coarser;
        for part in &mut parts {
            let detail = part.detail.at_most(finest);
            part.is_coarser |= detail != part.detail;
            part.detail = detail;
        }
    };
    // Take pages that are in memory, and coarser pages in place of the others.
    let keys: Vec<PageKey> = pages.iter().flat_map(|part| part.pages.iter().map(|(key, _)| *key)).collect();
    let held = sky.pages_of(&keys);
    let mut wants = Vec::new();
    let mut at = 0;
    for part in &pages {
        let of_part = &held[at..at + part.pages.len()];
        at += part.pages.len();
        plan.add_part(inputs, &fields, part, of_part, &mut wants);
    }
    if inputs.asks && !wants.is_empty() {
        sky.ask(&wants);
    }
    Ok(plan)
}

/// Whether the pages that views need contain at least this number of stars and composite stars. Counting ends as soon as the number is reached.
pub(super) fn has_stars(inputs: &DeepInputs<'_>, least: u64) -> bool {
    if least == 0 || inputs.magnitude_limit <= RESIDENT_TO_MAGNITUDE {
        return least == 0;
    }
    let fields: Vec<Field> = inputs.viewports.iter().map(|viewport| Field::new(viewport, &inputs.cull)).collect();
    let parts = (0..BUCKETS).into_par_iter().flat_map_iter(|bucket| parts_of(inputs, &fields, bucket));
    let counted = AtomicU64::new(0);
    let of_part = |part| stars_of(inputs.sky, &[visible_pages(inputs, &fields, part)]);
    parts.map(of_part).any(|stars| counted.fetch_add(stars, Ordering::Relaxed) + stars >= least)
}

/// Memory on the host that the pages of a plan may take, bytes.
fn most_bytes_of_a_plan(inputs: &DeepInputs<'_>) -> u64 {
    (SHARE_OF_A_PLAN * inputs.memory_bytes as f64 / 2.0) as u64
}

/// Rotation of the views over time: the orientations of the last frame, and its time.
#[derive(Debug, Default)]
pub(super) struct Turning {
    last: Option<(Vec<DQuat>, Instant)>,
}

impl Turning {
    /// Records the views of a frame, and returns the views as they will be after [`AHEAD`] if they continue to turn; `None`: they are at rest, or
    /// have jumped.
    pub(super) fn ahead(&mut self, viewports: &[Viewport], now: Instant) -> Option<Vec<Viewport>> {
        let orientations: Vec<DQuat> = viewports.iter().map(|viewport| viewport.world_from_view).collect();
        let (last, then) = self.last.replace((orientations, now))?;
        let passed = now.saturating_duration_since(then);
        if last.len() != viewports.len() || passed.is_zero() || passed > LONGEST_FRAME {
            return None;
        }
        let frames = AHEAD.as_secs_f64() / passed.as_secs_f64();
        let mut turns = false;
        let turned = viewports.iter().zip(last).map(|(viewport, last)| {
            let turn = (viewport.world_from_view * last.conjugate()).to_scaled_axis() * frames;
            let radius_rad = viewport.projection.mapping().bounding_cone(0.0).half_angle_rad;
            turns |= turn.length() > LEAST_TURN * radius_rad;
            let world_from_view = DQuat::from_scaled_axis(turn) * viewport.world_from_view;
            (turn.length() < MOST_TURN_RAD).then(|| Viewport { world_from_view, ..viewport.clone() })
        });
        let turned = turned.collect::<Option<Vec<_>>>()?;
        turns.then_some(turned)
    }
}

/// Requests the pages that the turned views need in addition to those of a plan, if there is memory for both. The missing pages of the plan itself
/// are read first.
pub(super) fn ask_ahead(inputs: &DeepInputs<'_>, turned: &[Viewport], plan: &DeepPlan) {
    let ahead = DeepInputs { viewports: turned, ..*inputs };
    let fields: Vec<Field> = turned.iter().map(|viewport| Field::new(viewport, &inputs.cull)).collect();
    let parts = (0..BUCKETS).into_par_iter().flat_map_iter(|bucket| parts_of(&ahead, &fields, bucket));
    let pages: Vec<PartPages> = parts.map(|part| visible_pages(&ahead, &fields, part)).collect();
    let drawn: u64 = plan.visible.iter().map(|visible| visible.page.bytes()).sum();
    if drawn + bytes_of(inputs.sky, &pages) > most_bytes_of_a_plan(inputs) {
        return;
    }
    let keys: Vec<PageKey> = pages.iter().flat_map(|part| part.pages.iter().map(|(key, _)| *key)).collect();
    let missing: HashSet<PageKey> = plan.missing.iter().copied().collect();
    let held = inputs.sky.pages_of(&keys);
    let absent = keys.into_iter().zip(held).filter(|(key, held)| held.is_none() && !missing.contains(key));
    let wants: Vec<(PageKey, f64)> = absent.map(|(key, _)| (key, AFTER_ALL_ELSE)).collect();
    if !wants.is_empty() {
        inputs.sky.ask(&wants);
    }
}

/// Whether composite stars may be drawn.
fn is_divisible(inputs: &DeepInputs<'_>) -> bool {
    let is_bright_part = matches!(inputs.drawn, Drawn::Brighter { .. });
    !inputs.every_star && !is_bright_part && inputs.magnitude_limit >= WHOLE_FROM_MAGNITUDE
}

/// Number of layers that have stars of this illuminance and more, lx.
pub(in crate::plan) fn layers_from(least_lx: f64) -> usize {
    BRIGHTEST_LX.iter().filter(|lx| **lx >= least_lx).count()
}

/// Whether any stars of leaves are drawn if only stars of at least this illuminance, lx, are drawn. All stars of leaves have a fainter magnitude than
/// the resident ones.
pub(crate) fn reaches_leaves(faintest_lx: f64) -> bool {
    faintest_lx < illuminance_lx_from_magnitude(RESIDENT_TO_MAGNITUDE)
}

/// Number of layers that may be drawn star by star.
fn layers_of(inputs: &DeepInputs<'_>) -> usize {
    let within = LAYERS.iter().filter(|layer| f64::from(layer.magnitude) < inputs.magnitude_limit).count();
    match inputs.drawn {
        Drawn::Brighter { from_lx } => within.min(layers_from(from_lx)),
        Drawn::All { .. } | Drawn::Fainter { .. } => within,
    }
}

/// Number of stars of a page, counted from the brightest, that may be drawn.
fn count_of(inputs: &DeepInputs<'_>, page: &Page) -> u32 {
    // A star's light at the camera is at most its light at the barycentre, divided by the square of this factor.
    let kept = 1.0 - inputs.camera_pc.length() * MOST_PARALLAX;
    let count = match inputs.drawn {
        Drawn::Brighter { from_lx } if kept > 0.0 => {
            let from_lx = from_lx * kept.powi(2) * LIGHT_ROUNDING;
            page.stars.partition_point(|star| star.packed().illuminance_at_1_pc_lx() >= from_lx)
        }
        _ => page.stars.len(),
    };
    count as u32
}

/// Returns the viewports that show a cell of the bucket order, grouped by detail.
fn parts_of(inputs: &DeepInputs<'_>, fields: &[Field], bucket: u64) -> Vec<Part> {
    let (axis, half_angle_rad) = PageKey::Tile { plane: 0, cell: bucket as u32 }.cone();
    let mut parts: Vec<Part> = Vec::new();
    for (index, (viewport, field)) in inputs.viewports.iter().zip(fields).enumerate() {
        if !sees(inputs, field, axis, half_angle_rad) {
            continue;
        }
        let pixel_sr = pixel_sr_near(viewport, axis, half_angle_rad);
        let detail = match is_divisible(inputs) {
            true => Detail::for_cells(inputs.cell_px * pixel_sr.sqrt(), leaves_of(inputs, pixel_sr)),
            false => Detail::Stars,
        };
        match parts.iter_mut().find(|part| part.detail == detail) {
            Some(part) => {
                part.viewports |= 1 << index;
                part.pixel_sr = part.pixel_sr.min(pixel_sr);
            }
            None => parts.push(Part { bucket, detail, is_coarser: false, viewports: 1 << index, pixel_sr }),
        }
    }
    parts
}

/// Number of layers that are too bright for composite stars in pixels of `pixel_sr`.
fn leaves_of(inputs: &DeepInputs<'_>, pixel_sr: f64) -> u8 {
    let leaves = match inputs.drawn {
        Drawn::All { seen_cd_m2: Some(seen_cd_m2) } => layers_from(MOST_SEEN * seen_cd_m2 * pixel_sr),
        Drawn::Fainter { below_lx } => layers_from(below_lx),
        Drawn::All { .. } | Drawn::Brighter { .. } => 0,
    };
    leaves as u8
}

/// Whether a viewport may show stars that are within a cone around an axis, as seen from the barycentre.
fn sees(inputs: &DeepInputs<'_>, field: &Field, axis: DVec3, half_angle_rad: f64) -> bool {
    // Widen the cone: the camera is displaced by this fraction of the distance of the nearest star, and aberration changes directions slightly.
    let displaced = (inputs.camera_pc + field.eye_pc()).length() * MOST_PARALLAX;
    !inputs.cull.enabled
        || displaced >= 1.0
        || field.touches_cone(BoundingCone { axis, half_angle_rad: half_angle_rad + displaced.asin() + 2e-4 })
}

/// Smallest pixel of a viewport near a direction, sr.
pub(in crate::plan) fn pixel_sr_near(viewport: &Viewport, axis: DVec3, half_angle_rad: f64) -> f64 {
    let mapping = viewport.projection.mapping();
    let to_view = viewport.world_from_view.conjugate();
    let (right, up) = axis.any_orthonormal_pair();
    let (sin, cos) = half_angle_rad.sin_cos();
    let around = [right, -right, up, -up].map(|side| axis * cos + side * sin);
    let extent = |direction: DVec3| mapping.pixel_extent_rad(to_view * direction).map(|[long, short]| long * short);
    let near = around.into_iter().chain([axis]).filter_map(extent).fold(f64::INFINITY, f64::min);
    // Directions beyond the picture may have no image: use the smallest pixel of the picture.
    let least = viewport.projection.smallest_pixel_sr();
    if near.is_finite() { near.max(least) } else { least }
}

/// The pages of a part that contain stars and may be visible in its viewports.
fn visible_pages(inputs: &DeepInputs<'_>, fields: &[Field], part: Part) -> PartPages {
    let layers = layers_of(inputs);
    let mut pages = Vec::new();
    part.detail.pages(part.bucket, layers, |key| {
        if key.stars(inputs.sky.store()) == 0 {
            return;
        }
        let viewports = if key.order() == BUCKET_ORDER {
            part.viewports
        } else {
            let (axis, half_angle_rad) = key.cone();
            let seen = (0..fields.len()).filter(|index| {
                part.viewports & 1 << index != 0 && sees(inputs, &fields[*index], axis, half_angle_rad)
            });
            seen.fold(0, |set, index| set | 1 << index)
        };
        if viewports != 0 {
            pages.push((key, viewports));
        }
    });
    PartPages { part, pages }
}

fn bytes_of(sky: &DeepSky, pages: &[PartPages]) -> u64 {
    stars_of(sky, pages) * size_of::<PageStar>() as u64
}

/// Number of stars and composite stars of pages.
fn stars_of(sky: &DeepSky, pages: &[PartPages]) -> u64 {
    pages.iter().flat_map(|part| &part.pages).map(|(key, _)| u64::from(key.stars(sky.store()))).sum()
}

impl Residual {
    /// Adds the pages of another part of the sky.
    pub(crate) fn add(&mut self, other: Self) {
        self.cd_m2 = self.cd_m2.max(other.cd_m2);
        self.missing += other.missing;
    }
}

impl DeepPlan {
    /// The part of a frame's report about these stars.
    pub(super) fn report(&self) -> DeepReport {
        let Residual { cd_m2, missing } = self.residual;
        let residual_codes = if cd_m2 > 0.0 { cd_m2 * self.codes_per_cd_m2 } else { 0.0 };
        DeepReport { stars: self.stars, cell_px: self.cell_px, missing, residual_cd_m2: cd_m2, residual_codes }
    }

    /// Plans that all pages are read while the frame is drawn.
    fn stream(&mut self, inputs: &DeepInputs<'_>, pages: &[PartPages]) {
        self.streamed = pages.iter().flat_map(|part| part.pages.iter().copied()).collect();
        self.stars = self.streamed.iter().map(|(key, _)| u64::from(key.stars(inputs.sky.store()))).sum();
        self.total_lx = inputs.sky.total_lx();
        // Most stars of a layer are at most a few magnitudes fainter than its brightest ones.
        let layers = self.streamed.iter().filter_map(|(key, _)| match key {
            PageKey::Leaf { layer, .. } => Some(BRIGHTEST_LX[usize::from(*layer)]),
            PageKey::Tile { .. } => None,
        });
        self.faintest_lx = 0.025 * layers.fold(f64::INFINITY, f64::min);
    }

    /// Adds the pages of a part, or coarser pages if some of them are missing.
    fn add_part(
        &mut self,
        inputs: &DeepInputs<'_>,
        fields: &[Field],
        wanted: &PartPages,
        held: &[Option<Arc<Page>>],
        wants: &mut Vec<(PageKey, f64)>,
    ) {
        if held.iter().all(Option::is_some) {
            self.note_cells(wanted.part.detail, wanted.part.pixel_sr);
            self.add_pages(inputs, &wanted.pages, held);
            if wanted.part.is_coarser {
                let cd_m2 = stand_in_error_lx(&wanted.part, held) / wanted.part.pixel_sr;
                self.add_lack(wanted.part.viewports, Residual { cd_m2, missing: 0 }, None);
            }
            return;
        }
        // Try coarser pages, down to the base. The base is always in memory; it also replaces pages that would be coarser than the base.
        let mut detail = is_divisible(inputs).then(|| wanted.part.detail.coarser().unwrap_or(Detail::BASE));
        let mut stand_in = None;
        while let Some(coarser) = detail {
            let part = visible_pages(inputs, fields, Part { detail: coarser, ..wanted.part });
            let keys: Vec<PageKey> = part.pages.iter().map(|(key, _)| *key).collect();
            let held = inputs.sky.pages_of(&keys);
            if held.iter().all(Option::is_some) {
                stand_in = Some((part, held));
                break;
            }
            detail = coarser.coarser();
        }
        let missing = || wanted.pages.iter().zip(held).filter(|(_, held)| held.is_none()).map(|((key, _), _)| *key);
        let error_lx = match &stand_in {
            Some((part, held)) => {
                self.note_cells(part.part.detail, wanted.part.pixel_sr);
                self.add_pages(inputs, &part.pages, held);
                stand_in_error_lx(&part.part, held)
            }
            None => {
                self.add_pages(inputs, &wanted.pages, held);
                missing().map(|key| most_of_leaf_lx(inputs.sky, key)).fold(0.0, f64::max)
            }
        };
        let error_cd_m2 = error_lx / wanted.part.pixel_sr;
        let of_page = Residual { cd_m2: error_cd_m2, missing: 1 };
        for key in missing() {
            // Coarser stars replace the whole part.
            self.add_lack(wanted.part.viewports, of_page, Some(key));
            self.missing.push(key);
            wants.push((key, error_cd_m2));
        }
    }

    /// Adds the error of a part of the sky that these viewports show, and the page whose absence causes it.
    fn add_lack(&mut self, viewports: u64, residual: Residual, key: Option<PageKey>) {
        self.residual.add(residual);
        for (index, lack) in self.lacks.iter_mut().enumerate() {
            if viewports & 1 << index != 0 {
                lack.residual.add(residual);
                lack.keys.extend(key);
            }
        }
    }

    /// Records the detail of pages that are drawn.
    fn note_cells(&mut self, detail: Detail, pixel_sr: f64) {
        self.cell_px = self.cell_px.max(detail.cell_rad() / pixel_sr.sqrt());
    }

    fn add_pages(&mut self, inputs: &DeepInputs<'_>, pages: &[(PageKey, u64)], held: &[Option<Arc<Page>>]) {
        for ((_, viewports), page) in pages.iter().zip(held) {
            let Some(page) = page else { continue };
            let count = count_of(inputs, page);
            if count == 0 {
                continue;
            }
            self.stars += u64::from(count);
            self.total_lx += page.total_lx;
            self.faintest_lx = self.faintest_lx.min(page.faintest_lx);
            self.visible.push(VisiblePage { page: Arc::clone(page), viewports: *viewports, count });
        }
    }
}

/// Bound of the error if a part is drawn with these pages instead of finer ones, lx per pixel.
fn stand_in_error_lx(part: &Part, pages: &[Option<Arc<Page>>]) -> f64 {
    let cell_px = part.detail.cell_rad() / part.pixel_sr.sqrt();
    pages.iter().flatten().map(|page| most_in_a_pixel_lx(page, cell_px)).fold(0.0, f64::max)
}

/// Bound of the light that a pixel receives from the composite stars of a page, or would receive from the stars that these replace. It is the light
/// of the cells whose kernels reach the pixel.
fn most_in_a_pixel_lx(page: &Page, cell_px: f64) -> f64 {
    let cells = ((2.0 * KERNEL_REACH_PX + 1.0) / cell_px + 1.0).ceil().powi(2);
    (cells * page.brightest_lx).min(page.total_lx)
}

/// Bound of the light that a pixel would receive from a leaf that has not been read.
fn most_of_leaf_lx(sky: &DeepSky, key: PageKey) -> f64 {
    let PageKey::Leaf { layer, .. } = key else { return 0.0 };
    let layer = usize::from(layer);
    let cell = (key.cell() >> (2 * (LAYERS[layer].order - SUM_ORDER))) as usize;
    let sum = sky.store().index().sums[layer].get(cell).map_or(0.0, |light| luminance(*light));
    sum.min(BRIGHTEST_LX[layer] * f64::from(key.stars(sky.store())))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::view::{Rig, View, ViewKind};

    fn viewports(yaw_rad: f64) -> Vec<Viewport> {
        let kind = ViewKind::Perspective { size: [64; 2], fov_y_rad: 0.1 };
        let view = View::new("view", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        Rig::new(vec![view]).unwrap().viewports(DQuat::from_rotation_y(yaw_rad))
    }

    #[test]
    fn a_turn_goes_on_and_a_jump_does_not() {
        let start = Instant::now();
        let after = |ms: u64| start + Duration::from_millis(ms);
        let mut turning = Turning::default();
        let yaw = |turned: Option<Vec<Viewport>>| {
            let towards = turned?[0].world_from_view * DVec3::NEG_Z;
            Some((-towards.x).atan2(-towards.z))
        };
        assert_eq!(yaw(turning.ahead(&viewports(0.0), after(0))), None, "one frame has no turn");
        // A turn of 0.01 rad in 50 ms extrapolates to 0.1 rad in half a second.
        let ahead = yaw(turning.ahead(&viewports(0.01), after(50))).unwrap();
        assert!((ahead - 0.11).abs() < 1e-9, "{ahead}");
        assert_eq!(yaw(turning.ahead(&viewports(0.01), after(100))), None, "at rest");
        assert_eq!(yaw(turning.ahead(&viewports(0.5), after(150))), None, "a jump");
        assert_eq!(yaw(turning.ahead(&viewports(0.51), after(800))), None, "frames too far apart");
        let two = [viewports(0.52), viewports(0.52)].concat();
        assert_eq!(yaw(turning.ahead(&two, after(850))), None, "other views");
    }
}

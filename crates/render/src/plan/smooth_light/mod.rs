//! The map of faint light: pictures of the sky, fixed in the world, that contain the sum of all stars that are at most a few steps bright in a
//! display image. A frame reads the map pixel by pixel, so that its cost does not depend on the number of these stars. The map is reused while the
//! camera turns, and is made again if the camera moves.
//!
//! Wide views read the six round pictures of the whole sky of [`crate::sky_pictures`]; whole-sky maps do so outside of their [`caps`]. Narrow views and
//! cubemaps need texels too small for that: they read the pieces of [`pieces`], of which only those in view are drawn. Neither kind of picture cuts a
//! star at its edge.
//!
//! The light of a star is divided among nine texels (the quadratic B-spline), and a pixel is interpolated between four (the tent). The average
//! variance is (1/4 + 1/6) texels^2. The size of texels in `OF_TENT` makes it equal to the variance of the tent with which exact images draw such
//! stars, 1/6 px^2. With the tent for both steps, the error would vary more with the position of a star among the texels. It varies less for smaller
//! texels that are blurred when they are stored, so such texels may hold brighter stars.

pub mod caps;
mod fitting;
pub mod pieces;

use std::sync::{Arc, Weak};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

pub(super) use self::fitting::{CELL_PX, fit_one_map};
use self::{
    caps::Caps,
    fitting::{BRIGHTEST_STEPS, SkyInputs, Texels, fitting, smallest_sr},
    pieces::{PieceFrame, PieceGrid, SkyPicture, WantedPicture},
};
use super::{
    Approximation, Plan, PlanError, SkyUse,
    budget::ErrorBudget,
    costs,
    kept::Kept,
    settings::{ExposureSettings, GlareMethod, RenderSettings, StarMethod},
    stars::{
        Stars,
        cull::{Field, light_at, near_stars},
        deep::layers_from,
    },
    technique::{PlanInputs, Step, Technique},
};
use crate::{
    catalogue::{
        StarRecord,
        chunks::{Chunk, StarSet},
        deep::index::Segments,
        packed::{PackedStar, temperature_of_step_k},
    },
    photometry::glare::GlareKernelName,
    sky_pictures::{SkyPictures, world_from_face},
    units::{PARSEC_M, magnitude_from_illuminance_lx},
    view::{Rig, RigError, View, ViewKind, Viewport, projection::FisheyeMapping},
};

/// Number of pictures of a map that are drawn together, in one separate frame.
pub const PICTURES_AT_ONCE: usize = 8;
/// Size of the buffer for pieces, divided by the size of the pieces that a frame reads. The spare room is for pieces of other sizes.
const SPARE: f64 = 1.3;
/// Number of words of a piece's header, which precedes its texels.
pub const PIECE_WORDS: u32 = 12;

/// Pictures of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SkyLayout {
    /// Six round pictures of the whole sky, of this side in texels.
    Whole {
        /// Side of a picture.
        side: u32,
    },
    /// Pieces, of which those in view are drawn.
    Pieces(PieceGrid),
}

/// A map that a frame reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyMap {
    /// Position from which its stars are seen, pc.
    pub place_pc: DVec3,
    /// Fainter stars belong to the map, lx.
    pub below_lx: f64,
    /// Still fainter stars are not drawn at all, lx.
    pub faintest_lx: f64,
    /// Unit of its texels: a step of the display image, cd/m^2.
    pub unit_cd_m2: f64,
    /// Its pictures.
    pub layout: SkyLayout,
    texels: Texels,
}

/// Pictures of a map that are drawn together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyPart {
    /// The map.
    pub map: SkyMap,
    pictures: [SkyPicture; PICTURES_AT_ONCE],
    count: usize,
}

impl SkyMap {
    /// Position from which its pictures are drawn, m.
    pub fn camera_m(&self) -> DVec3 {
        self.place_pc * PARSEC_M
    }

    /// Angle of a texel along the radius of a picture of the whole sky, rad. For pieces, the least tangent of a texel at their centre.
    pub fn texel_rad(&self) -> f64 {
        match self.layout {
            SkyLayout::Whole { side } => SkyPictures { side }.texel_rad(),
            SkyLayout::Pieces(grid) => grid.texel,
        }
    }

    /// Largest cell of composite stars in its pictures: the root of the ratio of its area to that of a texel.
    pub fn cell_texels(&self) -> f64 {
        CELL_PX / self.texels.side_px
    }

    /// Weights of the neighbours with which a texel is blurred, at distances of one and two texels along each axis.
    pub fn blur(&self) -> [f64; 2] {
        self.texels.blur
    }

    /// Least illuminance of the stars outside the map, lx, with a margin for the rounding of their positions in other chunks.
    pub fn others_from_lx(&self) -> f64 {
        self.below_lx * (1.0 - 1e-5)
    }

    fn view(&self, picture: SkyPicture) -> Result<View, RigError> {
        let (kind, world_from_view) = match self.layout {
            SkyLayout::Whole { side } => {
                let fov_rad = f64::from(side) * self.texel_rad();
                let kind = ViewKind::Fisheye { size: [side; 2], mapping: FisheyeMapping::Equidistant, fov_rad };
                (kind, world_from_face(picture.number))
            }
            SkyLayout::Pieces(grid) => {
                let PieceFrame { world_from_piece, size, texel } = grid.frame(picture);
                let fov_y_rad = 2.0 * (0.5 * f64::from(size[1]) * texel).atan();
                (ViewKind::Perspective { size, fov_y_rad }, world_from_piece)
            }
        };
        View::new(&format!("sky-{}", picture.number), kind, DQuat::from_mat3(&world_from_view), DVec3::ZERO)
    }
}

impl SkyPart {
    /// Divides the pictures of a map among frames.
    pub fn of(map: SkyMap, pictures: &[SkyPicture]) -> Vec<Self> {
        let at_once = if matches!(map.layout, SkyLayout::Whole { .. }) { 1 } else { PICTURES_AT_ONCE };
        let part = |some: &[SkyPicture]| {
            let mut pictures = [SkyPicture::default(); PICTURES_AT_ONCE];
            pictures[..some.len()].copy_from_slice(some);
            Self { map, pictures, count: some.len() }
        };
        pictures.chunks(at_once).map(part).collect()
    }

    /// The pictures. Numbers of those of the whole sky: +x, +y, +z, -x, -y, -z of the world.
    pub fn pictures(&self) -> &[SkyPicture] {
        &self.pictures[..self.count]
    }

    /// The pictures as a rig, for a camera along the world axes.
    ///
    /// # Errors
    ///
    /// None for a map within the limits.
    pub fn rig(&self) -> Result<Rig, RigError> {
        let views: Result<Vec<View>, RigError> =
            self.pictures().iter().map(|picture| self.map.view(*picture)).collect();
        Rig::new(views?)
    }

    /// Settings for drawing the picture: only the faint stars, without glare.
    pub fn settings(&self, of_frame: &RenderSettings) -> RenderSettings {
        let mut settings = of_frame.clone();
        settings.stars.method = StarMethod::BSpline;
        settings.glare.method = GlareMethod::None;
        settings.glare.kernel = GlareKernelName::InverseSquare;
        settings.exposure = ExposureSettings::manual(settings.exposure.unit_ev100());
        settings
    }
}

/// A map that a frame reads, and the division of the stars between the map and the frame.
#[derive(Clone, Debug)]
pub struct SkyPlan {
    /// The map.
    pub map: SkyMap,
    /// Number of stars in the map of the whole sky. Stars of a deep store are counted if the frame itself draws no star of their layer.
    pub in_map: u64,
    /// For each chunk of the scene, the number of its stars in the map.
    in_map_of_chunk: Arc<[u64]>,
    /// The other stars, collected into new, full chunks, since only few stars of each chunk of the scene remain.
    pub others: Arc<StarSet>,
    /// The pictures that the frame reads.
    pub read: Arc<[WantedPicture]>,
    /// Parts of whole-sky maps whose faint stars the frame draws, although they are in the map.
    pub caps: Option<Caps>,
    /// The map is worth its cost if it saves the frame from drawing this number of stars and composite stars of a deep store, in addition to the
    /// other stars in the map.
    least_saved: f64,
}

impl SkyPlan {
    /// Whether the map is worth its cost without stars of a deep store.
    pub(super) fn pays_at_once(&self) -> bool {
        self.least_saved <= 0.0
    }

    /// Number of stars and composite stars of a deep store that the map must save a frame from drawing to be worth its cost.
    pub(super) fn least_saved(&self) -> u64 {
        self.least_saved.ceil().max(0.0) as u64
    }
}

/// The map of faint light of a frame.
#[derive(Clone, Default)]
pub struct SmoothLightPlan {
    /// The map that the frame reads; `None`: it draws all stars individually.
    pub map: Option<SkyPlan>,
    /// The pictures of a map that the frame draws.
    pub part: Option<SkyPart>,
}

/// Plans [`SmoothLightPlan`], and keeps the last division of the stars between map and frame.
#[derive(Default)]
pub(super) struct SmoothLight {
    divided: Option<(Weak<StarSet>, SkyPlan)>,
}

impl SmoothLight {
    /// Chooses the map for these views and divides the stars; `None`: no map fits, or it is not worth its cost.
    fn choose(&mut self, inputs: &SkyInputs<'_>) -> Option<SkyPlan> {
        let SkyInputs { stars, viewports, .. } = inputs;
        if inputs.settings.stars.method != StarMethod::Auto {
            return None;
        }
        let pixels: f64 = viewports.iter().map(|viewport| viewport.size().map(f64::from).iter().product::<f64>()).sum();
        let pays_from = costs::BUILT_IN.map_from_stars_per_pixel * pixels;
        // Check before looking for a map and dividing the stars.
        let has_deep = stars.deep.is_some();
        if !has_deep && in_view(inputs, &|chunk| stars.chunks[chunk].count.into()) < pays_from {
            return None;
        }
        let (map, read) = fitting(inputs)?;
        let is_of = |held: &Weak<StarSet>| held.upgrade().is_some_and(|held| Arc::ptr_eq(&held, stars));
        let held = self.divided.as_ref().filter(|(set, divided)| divided.map == map && is_of(set));
        let divided = held.map_or_else(|| divide(stars, map), |(_, divided)| divided.clone());
        let of_chunks = in_view(inputs, &|chunk| divided.in_map_of_chunk[chunk]);
        let caps = Caps::of(inputs);
        let drawn = caps.iter().flat_map(|caps| &*caps.visible).map(|visible| divided.in_map_of_chunk[visible.chunk]);
        let drawn = drawn.sum::<u64>() as f64;
        let divided = SkyPlan { read, caps, least_saved: pays_from - (of_chunks - drawn), ..divided };
        self.divided = Some((Arc::downgrade(stars), divided.clone()));
        (has_deep || divided.pays_at_once()).then_some(divided)
    }
}

/// Number of stars in the chunks that are in view. `of_chunk` returns the number of stars in a chunk.
fn in_view(inputs: &SkyInputs<'_>, of_chunk: &(dyn Fn(usize) -> u64 + Sync)) -> f64 {
    let SkyInputs { stars, camera_pc, viewports, cull, .. } = inputs;
    let fields: Vec<Field> = viewports.iter().map(|viewport| Field::new(viewport, cull)).collect();
    let chunks = stars.chunks.par_iter().enumerate();
    let seen = chunks.filter(|(_, chunk)| fields.iter().any(|field| field.may_see(chunk, *camera_pc)));
    seen.map(|(index, _)| of_chunk(index)).sum::<u64>() as f64
}

impl Technique for SmoothLight {
    fn plan(
        &mut self,
        step: Step,
        inputs: &PlanInputs<'_>,
        _kept: &mut Kept,
        plan: &mut Plan,
    ) -> Result<(), PlanError> {
        match step {
            Step::Light => {
                // Without a known exposure, all stars have already been selected, to estimate the exposure.
                let may_read_map = inputs.sky == SkyUse::Map
                    && inputs.limits.reads_faint_map
                    && plan.exposure.known_white_ev100.is_some()
                    && plan.views.motion.is_none();
                let step_cd_m2 = plan.display.step_cd_m2.filter(|_| may_read_map);
                plan.smooth_light.map = step_cd_m2.and_then(|step_cd_m2| {
                    self.choose(&SkyInputs {
                        settings: inputs.settings,
                        stars: &inputs.scene.stars,
                        camera_pc: plan.views.camera_pc,
                        viewports: &plan.views.viewports,
                        cull: Stars::cull_settings(inputs, plan, plan.stars.faintest_lx),
                        step_cd_m2,
                        limits: inputs.limits,
                    })
                });
                plan.smooth_light.part = if let SkyUse::Part(part) = inputs.sky { Some(part) } else { None };
            }
            Step::Report => {
                let read = plan.smooth_light.map.as_ref().zip(plan.display.step_cd_m2.zip(plan.display.budget));
                let bound = read.map(|(sky, (step, budget))| map_error(&sky.map, &plan.views.viewports, step, budget));
                plan.report.certificate.extend(bound);
            }
            _ => {}
        }
        Ok(())
    }
}

/// Bound of the error of the brightest star that a map may contain in these views. The error is at most the star's light, since the weights of its
/// kernel and of the tent are between 0 and 1; blurred texels have a smaller error. The budget applies to the error of a pixel. A single star may
/// have an error of [`BRIGHTEST_STEPS`] steps, because its light is not lost but spread.
fn map_error(map: &SkyMap, viewports: &[Viewport], step_cd_m2: f64, budget: ErrorBudget) -> Approximation {
    let name = "the brightest star in the map of faint light, compared with that star drawn individually";
    let steps = map.texels.error * map.below_lx / (step_cd_m2 * smallest_sr(viewports));
    // The limit has a margin for rounding.
    budget.bound_in_steps(name, steps, BRIGHTEST_STEPS * (1.0 + 1e-9))
}

/// Words of a piece's picture.
pub fn piece_words(grid: &PieceGrid, picture: SkyPicture) -> u32 {
    let [width, height] = grid.frame(picture).size;
    PIECE_WORDS + width * height
}

/// Words of a buffer for the pictures that a frame reads: the table of the pieces, then the pieces, with spare room so that no piece has to move when
/// others are replaced.
pub fn words_needed(grid: &PieceGrid, read: &[WantedPicture]) -> u64 {
    let words: u64 = read.iter().map(|wanted| u64::from(piece_words(grid, wanted.drawn()))).sum();
    u64::from(grid.pieces()) + (SPARE * words as f64) as u64
}

/// Divides the stars between map and frame.
fn divide(set: &StarSet, map: SkyMap) -> SkyPlan {
    let of_chunk = |chunk: &Chunk| {
        let origin_pc = if chunk.at_infinity { DVec3::ZERO } else { chunk.origin_pc - map.place_pc };
        let mut in_map = 0;
        let mut others = Vec::new();
        for (place, star) in near_stars(set, chunk, origin_pc) {
            let light_lx = light_at(place, star, None);
            if light_lx >= map.below_lx {
                others.push(record_of(&map, chunk, place, star));
            } else if light_lx >= map.faintest_lx {
                in_map += 1;
            }
        }
        (in_map, others)
    };
    let divided: Vec<_> = set.chunks.par_iter().map(of_chunk).collect();
    let (in_map_of_chunk, others): (Vec<u64>, Vec<Vec<StarRecord>>) = divided.into_iter().unzip();
    let of_deep = set.deep.as_ref().map_or(0, |deep| {
        let layers = &deep.store().index().leaves[layers_from(map.below_lx)..];
        layers.iter().map(Segments::stars).sum()
    });
    SkyPlan {
        map,
        in_map: in_map_of_chunk.iter().sum::<u64>() + of_deep,
        in_map_of_chunk: in_map_of_chunk.into(),
        others: Arc::new(StarSet::from_records(others.into_iter().flatten().collect())),
        read: Arc::default(),
        caps: None,
        least_saved: 0.0,
    }
}

/// A star of the scene as a catalogue record. If it is packed again, its light is exactly the same, so it gets the same kernel.
fn record_of(map: &SkyMap, chunk: &Chunk, place: DVec3, star: &PackedStar) -> StarRecord {
    let (position, of_lx) = match chunk.at_infinity {
        true => (place, star.illuminance_at_1_pc_lx()),
        false => (map.place_pc + place, star.illuminance_at_1_pc_lx() / (10.0 * 10.0)),
    };
    StarRecord {
        position,
        magnitude: magnitude_from_illuminance_lx(of_lx) as f32,
        temperature_k: temperature_of_step_k(star.temperature_step()) as f32,
        distance_known: !chunk.at_infinity,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::f64::consts::PI;

    use super::{fitting::OF_TENT, *};
    use crate::units::illuminance_lx_from_magnitude;

    fn map(side: u32) -> SkyMap {
        SkyMap {
            place_pc: DVec3::ZERO,
            below_lx: illuminance_lx_from_magnitude(8.0),
            faintest_lx: illuminance_lx_from_magnitude(12.0),
            unit_cd_m2: 1e-5,
            layout: SkyLayout::Whole { side },
            texels: OF_TENT,
        }
    }

    #[test]
    fn a_map_is_within_its_limit_unless_it_has_brighter_stars_than_it_takes() {
        let kind = ViewKind::DomeMaster { size: 256, fov_rad: PI, tilt_rad: 0.0 };
        let view = View::new("dome", kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        let viewports = Rig::new(vec![view]).unwrap().viewports(DQuat::IDENTITY);
        let pixel_sr = viewports[0].projection.smallest_pixel_sr();
        for codes in [0.5, 1.0, 4.0] {
            let budget = ErrorBudget::Codes(codes);
            let error = |below_lx: f64| map_error(&SkyMap { below_lx, ..map(64) }, &viewports, 2e-5, budget);
            let taken = error(1.8 * 2e-5 * pixel_sr);
            assert!((taken.bound - 1.8 * codes).abs() < 1e-6 && taken.within_budget == Some(true), "{taken:?}");
            let brighter = error(1.9 * 2e-5 * pixel_sr);
            assert!(
                (brighter.bound - 1.9 * codes).abs() < 1e-6 && brighter.within_budget == Some(false),
                "{brighter:?}"
            );
        }
    }

    #[test]
    fn every_direction_is_in_the_picture_of_its_largest_axis() {
        for side in [64, 838, 2400] {
            let map = map(side);
            let parts = SkyPart::of(map, &[0, 1, 2, 3, 4, 5].map(|number| SkyPicture { number, level: 0 }));
            let viewports: Vec<Viewport> =
                parts.iter().flat_map(|part| part.rig().unwrap().viewports(DQuat::IDENTITY)).collect();
            for i in 0..2000 {
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 2000.0;
                let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
                let towards = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
                let axis = towards.abs().max_position();
                let face = axis + if towards[axis] < 0.0 { 3 } else { 0 };
                let viewport = &viewports[face];
                let in_view = viewport.world_from_view.conjugate() * towards;
                let pixel = viewport.projection.mapping().pixel_from_direction(in_view).unwrap();
                let off = pixel - 0.5 * f64::from(side);
                assert!(off.length() < 0.5 * f64::from(side) - 3.0, "{side} {towards} {off}");
                // The axes right, up and forwards are world axes, as in the shader.
                let sign = if towards[axis] < 0.0 { -1.0 } else { 1.0 };
                let [right, up] = [sign * towards[(axis + 2) % 3], towards[(axis + 1) % 3]];
                let scale = (right.hypot(up)).atan2(towards[axis].abs()) / right.hypot(up) / map.texel_rad();
                assert!((off - glam::DVec2::new(right, -up) * scale).length() < 1e-6 * f64::from(side), "{towards}");
            }
        }
    }

    #[test]
    fn each_star_is_either_in_the_map_or_outside_it() {
        let records = (0..20_000)
            .map(|i| {
                let turn = f64::from(i) * 2.399_963;
                let position =
                    DVec3::new(turn.cos(), turn.sin(), (f64::from(i) * 0.7).sin()) * (0.2 + f64::from(i % 89));
                StarRecord { position, magnitude: (i % 13) as f32 - 1.0, temperature_k: 6000.0, distance_known: true }
            })
            .collect();
        let set = StarSet::from_records(records);
        let map = SkyMap { place_pc: DVec3::new(0.3, 0.0, -2.0), ..map(64) };
        let seen: Vec<f64> = set.iter().map(|(place, _, star)| light_at(place - map.place_pc, star, None)).collect();
        let SkyPlan { in_map, others, .. } = divide(&set, map);
        assert_eq!(in_map, seen.iter().filter(|lx| (map.faintest_lx..map.below_lx).contains(*lx)).count() as u64);
        assert_eq!(others.stars.len(), seen.iter().filter(|lx| **lx >= map.below_lx).count());
        let seen_from_map = |(place, _, star): (DVec3, bool, &PackedStar)| light_at(place - map.place_pc, star, None);
        let light: f64 = others.iter().map(seen_from_map).sum();
        let expected: f64 = seen.iter().filter(|lx| **lx >= map.below_lx).sum();
        assert!((light / expected - 1.0).abs() < 1e-6, "{light} {expected}");
        // The stars' light is preserved to the last bit.
        let words = |set: &StarSet, least_lx: f64| {
            let bright = set.iter().filter(|(place, _, star)| light_at(*place - map.place_pc, star, None) >= least_lx);
            let mut words: Vec<u32> = bright.map(|(.., star)| star.light).collect();
            words.sort_unstable();
            words
        };
        assert_eq!(words(&others, 0.0), words(&set, map.below_lx));
    }
}

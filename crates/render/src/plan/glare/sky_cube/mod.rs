//! The method `sky_cube`: glare as a convolution on the sphere, computed on the sky and not in pictures.
//!
//! The kernel is split (`photometry::glare::split`). The part that is smooth over some degrees comes from a map of the whole sky: a cube in
//! world axes, shared by all views of a frame. The rest ends within those degrees and is added source by source, for sources bright enough
//! to be visible. So glare is round on the sky in every projection, has no seams, and includes sources outside the picture.
//!
//! `cells` bins the stars into cells of the sky, `sprites` selects the sources that are drawn individually, `levels` splits the kernel. All
//! results depend only on the scene, the position and motion of the camera and the settings, not on the orientation of the views, and are
//! reused until one of these changes. Units: lx, 1/sr, pc; directions in world axes.

mod cells;
mod far;
mod levels;
mod sprites;

use std::sync::Arc;

use glam::DVec3;

pub use self::{
    cells::{Cell, cell_of, direction_of_cell},
    far::FarLight,
    levels::{Level, TABLE_ENTRIES},
    sprites::{Sprite, SpriteCell, Sprites},
};
use crate::plan::glare::VeilInSums;
use crate::plan::stars::{
    cull::{CullSettings, SPLAT_MARGIN_PX, VisibleChunk, light_at, visible_chunks},
    travel,
};
use crate::{
    catalogue::{chunks::StarSet, packed::PackedStar},
    photometry::{
        glare::{
            GlareKernel,
            split::{ShownCore, SoftCore, bump_share, chord_squared},
        },
        rec709::luminance,
    },
    relativity::Motion,
    scene::surroundings::LocalSky,
    units::PARSEC_M,
    view::{
        Part, Viewport,
        projection::{Equirectangular, Projection},
    },
};

/// Cells along an edge of a face of the finest level.
pub const FINEST_CELLS: u32 = 64;
/// Number of levels, each with half as many cells along an edge as the previous one.
pub const LEVELS: usize = 3;
/// Width over which the kernel of a level is smooth, in cells of the level (the width of a cell at the centre of a face).
const SMOOTH_CELLS: f64 = 4.0;
/// Radius of the bump that represents the light near sources too faint to be drawn individually, in cells of the finest level.
const BUMP_CELLS: f64 = 2.5;
/// Width within which a picture cannot resolve the distribution of light, pixels. The light that pixels sample from a core varies with the position
/// of the source within a pixel. This variation is least at 1.55 pixels: 0.4 % of the scattered light for pixels 0.7 degrees wide, compared with 1.3
/// % at 1.7 pixels. Cores of 2 pixels and more are equally accurate, but they smear light visibly.
const SHOWN_PIXELS: f64 = 1.52;
/// A source gets a separate direction for each eye if the directions differ by more than this, rad.
const SHARED_PARALLAX_RAD: f64 = 1e-4;

/// Maximum number of stars with separate directions, since every pixel evaluates all of them. If there are more, for example because eyes are parsecs
/// apart, only the brightest ones are used.
pub const MOST_NEAR: usize = 256;

/// Angle over which the kernel of a level is smooth, rad.
pub fn smooth_angle_rad(level: usize) -> f64 {
    SMOOTH_CELLS * 2.0 / f64::from(FINEST_CELLS >> level)
}

/// Inputs of the map of the sky.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyCubeSettings {
    /// Position for which the map is made, near the camera, ICRS, pc.
    pub place_pc: DVec3,
    /// Motion of the camera.
    pub motion: Option<Motion>,
    /// Air and ground around the camera; `None`: space.
    pub local_sky: Option<Arc<LocalSky>>,
    /// Fainter stars do not scatter, lx.
    pub faintest_lx: f64,
    /// Distance from `place_pc` to the farthest eye, pc.
    pub farthest_eye_pc: f64,
    /// Relative error of the veil that all sources that are not drawn individually may cause together: a standard deviation.
    pub tolerance: f64,
    /// Budget of the same veil; `None` for frames without one, such as exact frames.
    pub in_sums: Option<VeilInSums>,
    /// Pixel angles of the views, rad, rounded by [`pixel_class_rad`]; ascending and distinct.
    pub pixel_classes_rad: Vec<f64>,
}

impl SkyCubeSettings {
    /// Whether maps of these stars with these settings have the same light in all cells. Settings that are not compared only select the sources that
    /// are drawn individually.
    pub fn has_same_cells(&self, other: &Self, set: &StarSet) -> bool {
        // All settings are listed, so that the compiler reports a new one that is not considered here.
        let Self {
            place_pc,
            motion,
            local_sky,
            faintest_lx,
            farthest_eye_pc,
            tolerance: _,
            // Only whether there is one matters: see `keeps_far`.
            in_sums: _,
            pixel_classes_rad: _,
        } = self;
        *place_pc == other.place_pc
            && *motion == other.motion
            && *local_sky == other.local_sky
            && *faintest_lx == other.faintest_lx
            && *farthest_eye_pc == other.farthest_eye_pc
            && self.keeps_far(set) == other.keeps_far(set)
    }

    /// Whether the map is for frames without a budget for the veil, such as exact frames.
    pub fn is_exact(&self) -> bool {
        self.in_sums.is_none()
    }

    /// The stars as these settings show them.
    fn sky<'a>(&'a self, set: &'a StarSet) -> cells::Sky<'a> {
        let Self { place_pc, motion, faintest_lx, .. } = *self;
        let local_sky = self.local_sky.as_deref();
        cells::Sky { set, place_pc, motion, local_sky, faintest_lx, near_pc: self.near_pc() }
    }

    /// Distance below which a star has a separate direction for each eye, pc.
    fn near_pc(&self) -> f64 {
        self.farthest_eye_pc / SHARED_PARALLAX_RAD
    }

    /// Whether the map takes the light of distant stars from [`FarLight`]. It does for display images of many stars, if the camera is at rest and
    /// without air.
    fn keeps_far(&self, set: &StarSet) -> bool {
        !self.is_exact()
            && self.motion.is_none()
            && self.local_sky.is_none()
            && self.near_pc() < far::NEAREST_PC
            && set.stars.len() >= far::FEWEST_STARS
    }
}

/// Angle within which pixels cannot resolve the distribution of light, rad.
fn shown_rad(pixel_rad: f64) -> f64 {
    (SHOWN_PIXELS * pixel_rad).min(std::f64::consts::PI)
}

/// The same angle for the pixels of a picture, by their typical size.
pub fn shown_rad_of(projection: &Projection) -> f64 {
    shown_rad(pixel_class_rad(projection.middle_pixel_rad()))
}

/// Rounds a pixel angle up by at most 4.5 %, so that similar views share a map and the core is hardly wider
/// than necessary.
pub fn pixel_class_rad(pixel_rad: f64) -> f64 {
    (16.0 * pixel_rad.log2()).ceil().exp2().powf(0.0625)
}

/// Edge of the cubes of space that share a map, m: large enough that neither a walk through a room nor the motion of a headset makes a
/// new map in every frame, and small enough to be far from all stars but the Sun.
pub const SHARED_CUBE_M: f64 = 1e9;

/// Position for which a map is made: the centre of the camera's cube, pc. A camera at the origin is at a centre.
pub fn map_place_pc(camera_pc: DVec3) -> DVec3 {
    let cube_pc = SHARED_CUBE_M / PARSEC_M;
    (camera_pc / cube_pc).round() * cube_pc
}

/// Rounds the distance of the farthest eye from the map's position up by at most 29 %, m, so that rounding errors of a turning head do not
/// change the map. The smallest class covers the farthest camera of a cube. Powers of e are unlikely as configured distances, so no
/// configuration is at the border of two classes.
pub fn eye_class_m(farthest_eye_m: f64) -> f64 {
    (((4.0 * farthest_eye_m.max(SHARED_CUBE_M).ln() - 0.5).ceil() + 0.5) / 4.0).exp()
}

/// A star so near that each eye sees it in a different direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearStar {
    /// Position relative to the map's, pc.
    pub place_pc: DVec3,
    /// Its light.
    pub star: PackedStar,
}

/// Sources that are drawn individually, for views with one size of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelClass {
    /// The kernel as displayed by such pixels.
    pub shown: ShownCore,
    /// Square of the chord within which the narrowest sprite of this class ends.
    pub least_squared: f64,
    /// Light in the bump of every cell of the finest level, linear Rec. 709, lx per unit of the bump's height.
    pub bumps: Vec<[f64; 3]>,
}

/// Light of all stars, as sources of glare. It depends neither on the exposure nor on the pixels of the views.
#[derive(Clone, Debug, PartialEq)]
pub struct StarLight {
    /// Cells and kernels, the finest level first.
    pub levels: Vec<Level>,
    /// Stars that each eye sees in a different direction, at most [`MOST_NEAR`].
    pub near: Vec<NearStar>,
    /// Stars in the cells, by brightness, for the plans of exact frames.
    brightnesses: Option<sprites::Brightnesses>,
}

impl StarLight {
    /// Bins all stars that may scatter light.
    fn new(set: &StarSet, kernel: &dyn GlareKernel, settings: &SkyCubeSettings, far: Option<&mut FarLight>) -> Self {
        let visible = visible_everywhere(set, settings.place_pc, settings.motion, settings.faintest_lx);
        let far = far.filter(|_| settings.keeps_far(set));
        // Exact frames need the brightnesses. In air, the map is kept for a minute of the scene's time, so a display frame counts them for an exact frame
        // that may follow.
        let counts_brightnesses = settings.is_exact() || settings.local_sky.is_some();
        let sky = settings.sky(set);
        let cells::Gathered { cells, near, brightnesses } =
            sky.gather(&visible, FINEST_CELLS, counts_brightnesses, far);
        Self { levels: levels::of_kernel(kernel, cells), near, brightnesses }
    }
}

/// Glare of the whole sky.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyCubePlan {
    /// Light of the stars.
    pub light: Arc<StarLight>,
    /// Sources that are drawn individually.
    pub sprites: Sprites,
    /// Data for each class of pixels.
    pub classes: Vec<PixelClass>,
    /// Smooth part of the kernel at the finest level.
    pub soft: SoftCore,
    /// Square of the radius of bumps.
    pub bump_squared: f64,
    /// Fainter stars do not scatter, lx.
    pub faintest_lx: f64,
}

/// A star as the camera sees it.
#[derive(Clone, Copy, Debug)]
struct Source {
    /// Unit vector.
    direction: DVec3,
    illuminance_lx: f64,
    /// Linear Rec. 709, lx.
    light: [f64; 3],
}

impl SkyCubePlan {
    /// Plans the glare of a set of stars. `with_same_cells`: a plan with the same cells ([`SkyCubeSettings::has_same_cells`]) and kernel, whose light is
    /// shared if it has what this plan needs. Otherwise all stars are read; `far` has sums of the same stars, kept from earlier plans.
    pub fn new(
        set: &StarSet,
        kernel: &dyn GlareKernel,
        settings: &SkyCubeSettings,
        with_same_cells: Option<&Self>,
        far: Option<&mut FarLight>,
    ) -> Self {
        let sufficient = with_same_cells.filter(|plan| !settings.is_exact() || plan.light.brightnesses.is_some());
        let light = match sufficient {
            Some(plan) => Arc::clone(&plan.light),
            None => Arc::new(StarLight::new(set, kernel, settings, far)),
        };
        let StarLight { levels, brightnesses, .. } = &*light;
        // The veil that hides individual sources.
        let soft = SoftCore::new(kernel, smooth_angle_rad(0));
        let hidden = sprites::Hidden { tolerance: settings.tolerance, budget: settings.in_sums };
        let local_sky = settings.local_sky.as_deref();
        let mut veil = sprites::Veil::new(kernel, &levels[LEVELS - 1].cells, local_sky, hidden);
        let finest = settings.pixel_classes_rad.first().map(|pixel| ShownCore::new(kernel, shown_rad(*pixel)));
        let reach = sprites::Reach::new(kernel, finest.as_ref(), smooth_angle_rad(0));
        // In a display image, the veil of a single source is visible if it exceeds a fraction of the budget. For an exact image the thresholds are
        // lower.
        if let Some(brightnesses) = brightnesses.as_ref().filter(|_| settings.is_exact()) {
            veil.hide_less(settings.tolerance, &reach, brightnesses);
        }
        // Select the sources that are drawn individually. In each class of pixels, bumps contain the light near sources that are not drawn
        // individually.
        let sprites = settings.sky(set).sprites(&reach, &veil);
        let narrow_share = kernel.share_within(smooth_angle_rad(0)) - soft.share();
        let bump_squared = chord_squared(BUMP_CELLS * 2.0 / f64::from(FINEST_CELLS));
        let per_height = 1.0 / bump_share(bump_squared);
        let classes = settings.pixel_classes_rad.iter().map(|pixel_rad| {
            let shown = ShownCore::new(kernel, shown_rad(*pixel_rad));
            let least_squared = shown.core.squared;
            let shares = sprites::Shares::new(kernel, &shown, soft.squared, narrow_share);
            let mut bumps: Vec<[f64; 3]> =
                levels[0].cells.iter().map(|cell| cell.light.map(|c| c * narrow_share)).collect();
            for sprite in sprites.iter().filter(|sprite| sprite.squared >= least_squared) {
                let bump = &mut bumps[cell_of(sprite.direction, FINEST_CELLS)];
                let share = shares.share_of(sprite);
                (0..3).for_each(|c| bump[c] -= sprite.light[c] * share);
            }
            let bumps = bumps.into_iter().map(|light| light.map(|c| c * per_height)).collect();
            PixelClass { shown, least_squared, bumps }
        });
        let classes = classes.collect();
        let sprites = Sprites::new(sprites);
        Self { light, sprites, classes, soft, bump_squared, faintest_lx: settings.faintest_lx }
    }

    /// Near stars for an eye at this position relative to that of the map: directions in world axes, light in lx.
    pub fn near_for(
        &self,
        eye_pc: DVec3,
        motion: Option<Motion>,
        local_sky: Option<&LocalSky>,
    ) -> Vec<(DVec3, [f64; 3])> {
        self.light
            .near
            .iter()
            .filter_map(|near| {
                let source = Source::at_position(near.place_pc - eye_pc, &near.star, motion, local_sky)?;
                (source.illuminance_lx >= self.faintest_lx).then_some((source.direction, source.light))
            })
            .collect()
    }
}

/// Returns all chunks, in all directions, that have stars of at least this illuminance (lx) at a position (pc).
fn visible_everywhere(set: &StarSet, place_pc: DVec3, motion: Option<Motion>, faintest_lx: f64) -> Vec<VisibleChunk> {
    let everywhere = Viewport {
        view: 0,
        part: Part::Whole,
        projection: Projection::Equirectangular(
            Equirectangular::new([8, 4]).expect("a picture of 8 x 4 pixels is valid"),
        ),
        world_from_view: glam::DQuat::IDENTITY,
        eye_offset_m: DVec3::ZERO,
        viewing_circle_m: 0.0,
    };
    let cull = CullSettings { faintest_lx, enabled: false, motion, refraction: None, margin_px: SPLAT_MARGIN_PX };
    visible_chunks(set, place_pc, &[everywhere], cull)
}

impl Source {
    /// A star at a position relative to the eye, pc; `None` at the eye itself, where it has no direction.
    fn at_position(
        place_pc: DVec3,
        star: &PackedStar,
        motion: Option<Motion>,
        local_sky: Option<&LocalSky>,
    ) -> Option<Self> {
        let illuminance_lx = light_at(place_pc, star, motion);
        let (seen, doppler) =
            motion.map_or((place_pc, 1.0), |motion| (motion.seen(place_pc), motion.doppler_of(place_pc)));
        let direction = seen.try_normalize()?;
        let colour = travel::colour_of(star.temperature_step(), doppler);
        let light = colour.map(|c| f64::from(c) * illuminance_lx);
        Some(Self { direction, illuminance_lx, light }.through_air(local_sky))
    }

    /// The source as it is seen through the air around the camera.
    fn through_air(self, local_sky: Option<&LocalSky>) -> Self {
        let Some(sky) = local_sky else { return self };
        let direction = sky.seen(self.direction);
        let through = sky.transmission(direction);
        let light = [0, 1, 2].map(|c| self.light[c] * through[c]);
        Self { direction, illuminance_lx: luminance(light), light }
    }
}

#[cfg(test)]
mod tests;

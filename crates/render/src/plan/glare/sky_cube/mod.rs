//! The method `sky_cube`: glare as a convolution on the sphere, computed on the sky and not in pictures.
//!
//! The kernel is split (`photometry::glare::split`): what is smooth over some degrees comes from a map of the whole sky, a
//! cube in world axes that all views of a frame share; the rest reaches no farther than those degrees and comes from the
//! sources one by one, where a source is bright enough for it to be seen. So glare is round in the sky in every projection,
//! has no seams, and a source that leaves the frame goes on glaring into it.
//!
//! `cells` gathers the stars into cells of the sky, `sprites` chooses the sources that are drawn one by one, `levels` splits
//! the kernel. All of it is a function of the scene, of the camera's place and motion and of the settings, not of where
//! the views look: it is made once and serves until one of them changes. Units: lx, 1/sr, pc; directions in world axes.

mod cells;
mod levels;
mod sprites;

use std::sync::Arc;

use glam::DVec3;

pub use self::{
    cells::{Cell, cell_of, direction_of_cell},
    levels::{Level, TABLE_ENTRIES},
    sprites::{Sprite, SpriteCell, Sprites},
};
use crate::plan::stars::{
    cull::{CullSettings, SPLAT_MARGIN_PX, light_at, visible_chunks},
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
/// Number of levels, each with half as many cells along an edge as the one before.
pub const LEVELS: usize = 3;
/// The kernel of a level is smooth within this many of its cells, as wide as in the middle of a face.
const SMOOTH_CELLS: f64 = 4.0;
/// Radius of the bump that stands for the light near sources too faint to be drawn one by one, such cells.
const BUMP_CELLS: f64 = 2.5;
/// Pixels within which a picture cannot tell how light is spread. The light that pixels find in a core by sampling it depends on where in
/// a pixel the source stands, the least at 1.55 pixels: 0.4 % of all that is scattered where pixels are 0.7 degrees wide, 1.3 % at 1.7
/// pixels. Cores of 2 pixels and more would be as good, and smear light visibly.
const SHOWN_PIXELS: f64 = 1.52;
/// A source is an eye's own where the eyes see it in directions that differ by more than this, rad.
const SHARED_PARALLAX_RAD: f64 = 1e-4;

/// Stars that are the eyes' own at most: every pixel goes through all of them. Of more, as eyes parsecs apart have, the brightest.
pub const MOST_NEAR: usize = 256;

/// Angle that the kernel of a level is smooth within, rad.
pub fn smooth_angle_rad(level: usize) -> f64 {
    SMOOTH_CELLS * 2.0 / f64::from(FINEST_CELLS >> level)
}

/// What the map of the sky depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyCubeSettings {
    /// Place that the map is made for, near the camera's, ICRS, pc.
    pub place_pc: DVec3,
    /// Its motion.
    pub motion: Option<Motion>,
    /// The air and the ground around it; `None`: space.
    pub local_sky: Option<Arc<LocalSky>>,
    /// Fainter stars do not glare, lx.
    pub faintest_lx: f64,
    /// Distance from there to the farthest eye, pc.
    pub farthest_eye_pc: f64,
    /// By how much the veil may be off for what sources add to it where they are not drawn by themselves, relative.
    pub tolerance: f64,
    /// What it may add at least, cd/m^2 as if all light were scattered: what a display image does not show; 0 for exact images.
    pub least_cd_m2: f64,
    /// Angles of the pixels of the views, rad, rounded by [`pixel_class_rad`]; ascending, no two the same.
    pub pixel_classes_rad: Vec<f64>,
}

/// Angle within which pixels cannot tell how light is spread, rad.
fn shown_rad(pixel_rad: f64) -> f64 {
    (SHOWN_PIXELS * pixel_rad).min(std::f64::consts::PI)
}

/// The same for the pixels of a picture, by the size that stands for theirs.
pub fn shown_rad_of(projection: &Projection) -> f64 {
    shown_rad(pixel_class_rad(projection.middle_pixel_rad()))
}

/// The angle that stands for a pixel's: up to 4.5 % larger, so that views that are much alike share a map and the core is hardly wider
/// than it must be.
pub fn pixel_class_rad(pixel_rad: f64) -> f64 {
    (16.0 * pixel_rad.log2()).ceil().exp2().powf(0.0625)
}

/// Edge of the cubes of space that share a map, m: so large that neither a walk through a room nor a flight in a headset makes a
/// map in every frame, and so small that it is far from all stars but the Sun.
pub const SHARED_CUBE_M: f64 = 1e9;

/// The place that a map is made for: the middle of the cube that the camera is in, pc. A camera at the origin is in the middle.
pub fn map_place_pc(camera_pc: DVec3) -> DVec3 {
    let cube_pc = SHARED_CUBE_M / PARSEC_M;
    (camera_pc / cube_pc).round() * cube_pc
}

/// The distance that stands for that of the farthest eye from the map's place, m: up to 29 % larger, so that what a turning head
/// changes by rounding changes no map. No class is smaller than the farthest camera of a cube has. Powers of e are no distance that
/// anyone sets, so none stands on the border of two classes.
pub fn eye_class_m(farthest_eye_m: f64) -> f64 {
    (((4.0 * farthest_eye_m.max(SHARED_CUBE_M).ln() - 0.5).ceil() + 0.5) / 4.0).exp()
}

/// A star so near that every eye sees it elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearStar {
    /// Place relative to the map's, pc.
    pub place_pc: DVec3,
    /// Its light.
    pub star: PackedStar,
}

/// How views of one size of pixels draw the sources one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelClass {
    /// The kernel as such pixels show it.
    pub shown: ShownCore,
    /// Square of the chord within which the narrowest sprite of this class ends.
    pub least_squared: f64,
    /// Light that is spread over bumps, of every cell of the finest level, linear Rec. 709, lx per unit of the bump's height.
    pub bumps: Vec<[f64; 3]>,
}

/// The sky that glares.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyCubePlan {
    /// Cells and kernels, from the finest on.
    pub levels: Vec<Level>,
    /// Sources that are drawn one by one.
    pub sprites: Sprites,
    /// Per class of pixels.
    pub classes: Vec<PixelClass>,
    /// The kernel's smooth part of the finest level.
    pub soft: SoftCore,
    /// Square of the radius of bumps.
    pub bump_squared: f64,
    /// Stars that every eye sees elsewhere, at most [`MOST_NEAR`].
    pub near: Vec<NearStar>,
    /// Fainter stars do not glare, lx.
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
    /// Gathers the stars of a set.
    pub fn new(set: &StarSet, kernel: &dyn GlareKernel, settings: &SkyCubeSettings) -> Self {
        let everywhere = Viewport {
            view: 0,
            part: Part::Whole,
            projection: Projection::Equirectangular(
                Equirectangular::new([8, 4]).expect("a picture of 8 x 4 pixels is allowed"),
            ),
            world_from_view: glam::DQuat::IDENTITY,
            eye_offset_m: DVec3::ZERO,
            viewing_circle_m: 0.0,
        };
        let SkyCubeSettings { place_pc, motion, faintest_lx, .. } = *settings;
        let cull = CullSettings { faintest_lx, enabled: false, motion, refraction: None, margin_px: SPLAT_MARGIN_PX };
        let visible = visible_chunks(set, place_pc, &[everywhere], cull);
        let near_pc = settings.farthest_eye_pc / SHARED_PARALLAX_RAD;
        let local_sky = settings.local_sky.as_deref();
        let sky = cells::Sky { set, visible: &visible, motion, local_sky, faintest_lx, near_pc };
        let (finest, near) = sky.gather(FINEST_CELLS);
        let levels = levels::of_kernel(kernel, finest);
        let soft = SoftCore::new(kernel, smooth_angle_rad(0));
        let hidden = sprites::Hidden { tolerance: settings.tolerance, least_cd_m2: settings.least_cd_m2 };
        let mut veil = sprites::Veil::new(kernel, &levels[LEVELS - 1].cells, hidden);
        let finest = settings.pixel_classes_rad.first().map(|pixel| ShownCore::new(kernel, shown_rad(*pixel)));
        let reach = sprites::Reach::new(kernel, finest.as_ref(), smooth_angle_rad(0));
        // What single sources are hidden by on a display is a share of its budget.
        if settings.least_cd_m2 == 0.0 {
            veil.hide_less(settings.tolerance, &reach, &sky.brightnesses());
        }
        let sprites = sky.sprites(&reach, &veil);
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
                let share = shares.of(sprite);
                (0..3).for_each(|c| bump[c] -= sprite.light[c] * share);
            }
            let bumps = bumps.into_iter().map(|light| light.map(|c| c * per_height)).collect();
            PixelClass { shown, least_squared, bumps }
        });
        let classes = classes.collect();
        let sprites = Sprites::new(sprites);
        Self { levels, sprites, classes, soft, bump_squared, near, faintest_lx }
    }

    /// The near stars as an eye at this place, relative to the map's, sees them: directions in world axes, light in lx.
    pub fn near_for(
        &self,
        eye_pc: DVec3,
        motion: Option<Motion>,
        local_sky: Option<&LocalSky>,
    ) -> Vec<(DVec3, [f64; 3])> {
        self.near
            .iter()
            .filter_map(|near| {
                let source = Source::of(near.place_pc - eye_pc, &near.star, motion, local_sky)?;
                (source.illuminance_lx >= self.faintest_lx).then_some((source.direction, source.light))
            })
            .collect()
    }
}

impl Source {
    /// A star at a place relative to the eye, pc; none at the eye's very place, where there is no direction.
    fn of(place_pc: DVec3, star: &PackedStar, motion: Option<Motion>, local_sky: Option<&LocalSky>) -> Option<Self> {
        let illuminance_lx = light_at(place_pc, star, motion);
        let (seen, doppler) =
            motion.map_or((place_pc, 1.0), |motion| (motion.seen(place_pc), motion.doppler_of(place_pc)));
        let direction = seen.try_normalize()?;
        let colour = travel::colour_of(star.temperature_step(), doppler);
        let light = colour.map(|c| f64::from(c) * illuminance_lx);
        let Some(sky) = local_sky else { return Some(Self { direction, illuminance_lx, light }) };
        let direction = sky.seen(direction);
        let through = sky.transmission(direction);
        let light = [0, 1, 2].map(|c| light[c] * through[c]);
        Some(Self { direction, illuminance_lx: luminance(light), light })
    }
}

#[cfg(test)]
mod tests;

//! Chosen pixels of images in f64: the exact result of the star passes and of `sky_cube` there, star by star, without
//! maps or grids.
//!
//! A whole frame in f64 takes minutes. A few hundred pixels take about as long as one pass over the catalogue. Each chunk of stars is processed
//! separately: a star that may reach a chosen pixel is spread with the kernel that the view uses (selected by its luminance over the pixel at its
//! position, as by `image_of` in `shaders/shared/splat.wgsl`), and the chunk's stars form a tree that sums their glare ([`veil_tree`]). The
//! leaves of a deep store are processed in the same way ([`leaves`]). Chunks are distributed in a fixed way and summed in a fixed order: the result
//! is bit-identical for any number of threads. Units: lx, cd/m^2, pc.

mod leaves;
mod veil_tree;

use std::{collections::HashMap, f64::consts::PI};

use glam::{DQuat, DVec2, DVec3, Vec3};
use rayon::prelude::*;

pub use self::leaves::stars_to_read;
use self::veil_tree::{Scattered, Source, VeilTree};
use super::stars::splat::{Eye, Sight};
use crate::{
    catalogue::{
        chunks::{Chunk, StarSet},
        deep::DeepError,
        packed::{PackedStar, TEMPERATURE_STEPS, temperature_of_step_k},
        zodiacal_light::ZodiacalLight,
    },
    photometry::{
        blackbody::rec709_in_gamut,
        glare::{
            GlareKernel,
            split::{ShownCore, angle_of_chord_squared},
        },
        kernel::{SplatKernel, bright_kernel, gaussian_part},
    },
    plan::KernelPlan,
    view::projection::{Projection, pixel_centre},
};

/// Number of parts into which the chunks are distributed.
const PARTS: usize = 32;
/// Largest distance at which a star affects a pixel, measured from the star's image: the reach of the widest kernel, plus the f32 error of positions,
/// pixels.
const REACH_PX: f64 = 5.0;
/// Side of the pixel blocks that record whether a star is near a chosen pixel.
const BLOCK_PX: f64 = 8.0;
/// Veil in the middle of the Milky Way relative to the mean veil.
const BRIGHTEST_VEIL: f64 = 4.0;
/// Within this relative distance from a threshold, f32 may select the kernel on either side of it.
const UNDECIDED: f64 = 1e-4;

/// Input sky.
#[derive(Clone, Copy)]
pub struct SampledSky<'a> {
    /// Its stars.
    pub stars: &'a StarSet,
    /// Position of the eye, ICRS, barycentric, m.
    pub eye_m: DVec3,
    /// Its velocity in units of the speed of light, world axes.
    pub velocity_c: DVec3,
    /// Zodiacal light, if it is drawn.
    pub zodiacal: Option<&'a ZodiacalLight>,
    /// Illuminance below which stars are not drawn, lx.
    pub faintest_lx: f64,
    /// Glare, if there is any.
    pub glare: Option<SampledGlare<'a>>,
}

/// Scattered light.
#[derive(Clone, Copy)]
pub struct SampledGlare<'a> {
    /// Its angular distribution.
    pub kernel: &'a dyn GlareKernel,
    /// Fraction of the light that is scattered.
    pub fraction: f64,
    /// A source is drawn individually if its veil exceeds this fraction of the veil around it.
    pub tolerance: f64,
}

/// An image with its chosen pixels.
pub struct SampledImage<'a> {
    /// Its projection.
    pub projection: &'a Projection,
    /// Rotation from view axes to world axes.
    pub world_from_view: DQuat,
    /// Kernel for each range of brightness.
    pub kernels: KernelPlan,
    /// The glare kernel at the resolution of the image's pixels.
    pub shown: Option<ShownCore>,
    /// Column and row of each chosen pixel, inside of the picture.
    pub pixels: &'a [[u32; 2]],
}

/// Exact light of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelLight {
    /// Luminance of the stars' images, without scattered light, linear Rec. 709, cd/m^2.
    pub stars_cd_m2: [f64; 3],
    /// Luminance of the veil, in the same units.
    pub veil_cd_m2: [f64; 3],
    /// Luminance of unresolved light at the centre of the pixel, in the same units.
    pub diffuse_cd_m2: [f64; 3],
    /// Luminance that the nearby stars would have if all their light were in this pixel, cd/m^2. The effect of errors of position is proportional to
    /// it.
    pub near_cd_m2: f64,
    /// Number of these stars.
    pub near_stars: u32,
    /// Glare that the frame does not draw at its true place, cd/m^2. Each faint source scatters most of this glare within two pixels of itself; this
    /// value is the mean over some degrees around the pixel. This includes the glare of stars of a deep store within about a degree.
    pub unresolved_cd_m2: f64,
    /// Whether a nearby star is so close to a threshold that f32 may draw it with another kernel, or not at all.
    pub undecided: bool,
}

impl PixelLight {
    /// Returns the total luminance, cd/m^2.
    pub fn luminance_cd_m2(&self) -> [f64; 3] {
        std::array::from_fn(|channel| {
            self.stars_cd_m2[channel] + self.veil_cd_m2[channel] + self.diffuse_cd_m2[channel]
        })
    }
}

/// Sums of a pixel: illuminance of stars, lx, and the veil for a fraction of 1, cd/m^2.
#[derive(Clone, Copy, Default)]
struct Sums {
    light_lx: [f64; 3],
    veil: [f64; 3],
    near_lx: f64,
    near_stars: u32,
    faint: f64,
    /// Glare of stars of a deep store that may be drawn at another place.
    deep: f64,
    undecided: bool,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        for channel in 0..3 {
            self.light_lx[channel] += other.light_lx[channel];
            self.veil[channel] += other.veil[channel];
        }
        self.near_lx += other.near_lx;
        self.near_stars += other.near_stars;
        self.faint += other.faint;
        self.deep += other.deep;
        self.undecided |= other.undecided;
    }
}

/// Computes the chosen pixels of all images, in order. All images must have the same eye. Kernels that are round in
/// view space ([`crate::plan::GaussianKernel::Round`]) are not drawn.
///
/// # Errors
/// A leaf of the deep store is damaged or cannot be read.
pub fn pixels(sky: &SampledSky<'_>, images: &[SampledImage<'_>]) -> Result<Vec<Vec<PixelLight>>, DeepError> {
    let places: Vec<Places> = images.iter().map(Places::new).collect();
    let directions: Vec<Scattered> = images.iter().flat_map(Scattered::of_image).collect();
    // An exact colour requires an integral over the spectrum. Catalogues use only these temperature steps.
    let colours: Vec<[f64; 3]> =
        (0..TEMPERATURE_STEPS).map(|step| rec709_in_gamut(temperature_of_step_k(step))).collect();
    let eye = Eye { position_m: sky.eye_m, world_from_view: DQuat::IDENTITY, velocity_c: sky.velocity_c };
    let sight = Sight::new(eye);
    let faint_below_lx = faint_below_lx(sky, images, &sight);
    let (places, directions, colours) = (&places[..], &directions[..], &colours[..]);
    let painter = Painter { sky, images, places, directions, colours, sight, faint_below_lx };
    // Process parts of the chunks in parallel, each with its own sums.
    let chunks = &sky.stars.chunks;
    let part = chunks.len().div_ceil(PARTS).max(1);
    let parts: Vec<Vec<Sums>> = chunks.par_chunks(part).map(|chunks| painter.sums_of_chunks(chunks)).collect();
    let of_leaves = sky.stars.deep.as_ref().map_or(Ok(Vec::new()), |deep| painter.sums_of_leaves(deep))?;
    // Add the parts in a fixed order.
    let mut sums = vec![Sums::default(); directions.len()];
    for part in parts.iter().chain(&of_leaves) {
        sums.iter_mut().zip(part).for_each(|(sum, part)| sum.add(part));
    }
    // Convert the sums to luminance.
    let fraction = sky.glare.map_or(0.0, |glare| glare.fraction);
    let mut sums = sums.into_iter();
    let of_image = |image: &SampledImage<'_>| -> Vec<PixelLight> {
        let mapping = image.projection.mapping();
        let core_share = sky.glare.map_or(0.0, |glare| {
            image.shown.map_or(0.0, |shown| glare.kernel.share_within(angle_of_chord_squared(shown.core.squared)))
        });
        let finished = |([x, y], sums): (&[u32; 2], Sums)| {
            let omega_sr = mapping.solid_angle_sr(*x, *y);
            let per_sr = if omega_sr > 0.0 { 1.0 / omega_sr } else { 0.0 };
            PixelLight {
                stars_cd_m2: sums.light_lx.map(|channel| (1.0 - fraction) * channel * per_sr),
                veil_cd_m2: sums.veil.map(|channel| fraction * channel),
                diffuse_cd_m2: diffuse_at(sky, image, [*x, *y]),
                near_cd_m2: (1.0 - fraction) * sums.near_lx * per_sr,
                near_stars: sums.near_stars,
                unresolved_cd_m2: fraction * (core_share * sums.faint + sums.deep),
                undecided: sums.undecided,
            }
        };
        image.pixels.iter().zip(sums.by_ref()).map(finished).collect()
    };
    Ok(images.iter().map(of_image).collect())
}

/// Returns the diffuse light at the centre of a pixel.
fn diffuse_at(sky: &SampledSky<'_>, image: &SampledImage<'_>, [x, y]: [u32; 2]) -> [f64; 3] {
    let towards = image.projection.mapping().direction_from_pixel(pixel_centre(x, y));
    let Some(towards) = towards.map(|towards| image.world_from_view * towards) else { return [0.0; 3] };
    let of_stars = sky.stars.unresolved.as_ref();
    let of_stars =
        of_stars.map_or([0.0; 3], |light| super::diffuse::luminance_cd_m2(light, towards, sky.velocity_c, None));
    let of_dust = sky.zodiacal.map_or([0.0; 3], |light| super::diffuse::zodiacal_cd_m2(light, towards, None));
    [0, 1, 2].map(|c| of_stars[c] + of_dust[c])
}

/// Returns the illuminance below which a source may be too faint to be drawn individually. It is computed for the worst case: the brightest veil of
/// the sky, the coarsest pixels, and a kernel as wide as these pixels can resolve.
fn faint_below_lx(sky: &SampledSky<'_>, images: &[SampledImage<'_>], sight: &Sight) -> f64 {
    let Some(SampledGlare { kernel, tolerance, .. }) = sky.glare else { return 0.0 };
    let chunk_light = |chunk: &Chunk| -> f64 {
        let seen = sky.stars.stars_of(chunk).iter().filter_map(|star| {
            sight.seen_star(chunk.origin_pc + Vec3::from_array(star.offset_pc).as_dvec3(), chunk.at_infinity, star)
        });
        seen.map(|star| star.illuminance_lx).sum()
    };
    // The sum is formed in the order of the chunks, so it does not depend on the number of threads.
    let of_chunks: f64 = sky.stars.chunks.par_iter().map(chunk_light).collect::<Vec<_>>().iter().sum();
    let light_lx = of_chunks + sky.stars.deep.as_ref().map_or(0.0, |deep| deep.total_lx());
    let cores = images.iter().filter_map(|image| image.shown).map(|shown| shown.core.squared);
    let widest = cores.fold(0.0, f64::max);
    BRIGHTEST_VEIL * tolerance * light_lx / (4.0 * PI) / kernel.per_sr(angle_of_chord_squared(widest))
}

/// The positions of an image's chosen pixels.
struct Places {
    /// Index of each chosen pixel, by row times width plus column.
    numbers: HashMap<u32, usize>,
    /// For each block of pixels, whether a star in it may reach a chosen pixel.
    near: Vec<bool>,
    blocks_across: usize,
    size: [u32; 2],
    wraps: bool,
}

impl Places {
    fn new(image: &SampledImage<'_>) -> Self {
        let size = image.projection.mapping().size();
        let [blocks_across, blocks_down] = size.map(|side| (f64::from(side) / BLOCK_PX).ceil() as usize);
        let mut near = vec![false; blocks_across * blocks_down];
        let mut numbers = HashMap::with_capacity(image.pixels.len());
        for (number, [x, y]) in image.pixels.iter().enumerate() {
            numbers.insert(y * size[0] + x, number);
            let [columns, rows] = [(*x, blocks_across), (*y, blocks_down)].map(|(coordinate, blocks)| {
                let block = (f64::from(coordinate) / BLOCK_PX) as usize;
                block.saturating_sub(1)..(block + 2).min(blocks)
            });
            for row in rows {
                near[row * blocks_across..][columns.clone()].fill(true);
            }
        }
        let wraps = matches!(image.projection, Projection::Equirectangular(_));
        Self { numbers, near, blocks_across, size, wraps }
    }

    /// Whether a star with its image at `pixel` may reach a chosen pixel.
    fn may_reach(&self, pixel: DVec2) -> bool {
        let size = DVec2::new(f64::from(self.size[0]), f64::from(self.size[1]));
        let inside = pixel.cmpge(DVec2::splat(-REACH_PX)).all() && pixel.cmple(size + REACH_PX).all();
        // In a picture that wraps, a kernel that crosses the border reappears elsewhere.
        if self.wraps && (pixel.cmplt(DVec2::splat(REACH_PX)).any() || pixel.cmpgt(size - REACH_PX).any()) {
            return inside;
        }
        let held = pixel.clamp(DVec2::ZERO, size - 1.0) / BLOCK_PX;
        inside && self.near[held.y as usize * self.blocks_across + held.x as usize]
    }
}

struct Painter<'a> {
    sky: &'a SampledSky<'a>,
    images: &'a [SampledImage<'a>],
    places: &'a [Places],
    directions: &'a [Scattered],
    colours: &'a [[f64; 3]],
    sight: Sight,
    /// Illuminance below which sources may be too faint to be drawn individually, lx.
    faint_below_lx: f64,
}

/// A star of the current chunk.
#[derive(Clone, Copy)]
struct Star {
    /// Unit vector, world axes.
    direction: DVec3,
    illuminance_lx: f64,
    rgb_lx: [f64; 3],
}

impl Painter<'_> {
    fn sums_of_chunks(&self, chunks: &[Chunk]) -> Vec<Sums> {
        let mut sums = vec![Sums::default(); self.directions.len()];
        let mut stars = Vec::new();
        let mut tree = VeilTree::default();
        for chunk in chunks {
            stars.clear();
            stars.extend(self.stars_of(chunk));
            self.spread_all(&stars, |image| image.kernels, &mut sums);
            let sources = stars.iter().filter_map(|star| {
                let is_faint = star.illuminance_lx < self.faint_below_lx;
                self.source(star, if is_faint { star.illuminance_lx } else { 0.0 })
            });
            self.add_veil(sources, &mut tree, &mut sums, |_, sums, _, faint| sums.faint += faint);
        }
        sums
    }

    /// Adds the images of stars. `kernels_of` returns the kernels of the stars in an image.
    fn spread_all(&self, stars: &[Star], kernels_of: impl Fn(&SampledImage<'_>) -> KernelPlan, sums: &mut [Sums]) {
        let mut first = 0;
        for (image, places) in self.images.iter().zip(self.places) {
            let (kernels, of_image) = (kernels_of(image), &mut sums[first..first + image.pixels.len()]);
            stars.iter().for_each(|star| spread(star, self.sky.faintest_lx, (image, kernels), places, of_image));
            first += image.pixels.len();
        }
    }

    /// Returns a star as a source of glare; `None`: stars that are not drawn cause none.
    fn source(&self, star: &Star, faint_lx: f64) -> Option<Source> {
        let source = Source { direction: star.direction, rgb_lx: star.rgb_lx, faint_lx };
        (star.illuminance_lx >= self.sky.faintest_lx).then_some(source)
    }

    /// Adds the glare of sources that form a tree. `note` receives the veil of these sources in each pixel, and the mean luminance of the faint
    /// sources around the pixel.
    fn add_veil(
        &self,
        sources: impl Iterator<Item = Source>,
        tree: &mut VeilTree,
        sums: &mut [Sums],
        note: impl Fn(&Scattered, &mut Sums, [f64; 3], f64),
    ) {
        let Some(SampledGlare { kernel, .. }) = self.sky.glare else { return };
        tree.build(sources);
        for (direction, sums) in self.directions.iter().zip(sums) {
            let (mut veil, mut faint) = ([0.0; 3], 0.0);
            tree.add_veil(kernel, direction, &mut veil, &mut faint);
            (0..3).for_each(|channel| sums.veil[channel] += veil[channel]);
            note(direction, sums, veil, faint);
        }
    }

    fn stars_of<'b>(&'b self, chunk: &'b Chunk) -> impl Iterator<Item = Star> + 'b {
        self.sky.stars.stars_of(chunk).iter().filter_map(move |star| {
            let position = chunk.origin_pc + Vec3::from_array(star.offset_pc).as_dvec3();
            self.star(position, chunk.at_infinity, star)
        })
    }

    /// Computes how the eye sees a star at a position in pc, or in a direction if it is at infinity.
    fn star(&self, position: DVec3, at_infinity: bool, star: &PackedStar) -> Option<Star> {
        let seen = self.sight.seen_star(position, at_infinity, star)?;
        let colour = match self.sight.moves() {
            true => rec709_in_gamut(seen.temperature_k),
            false => self.colours[star.temperature_step() as usize],
        };
        Some(Star {
            direction: seen.direction.normalize(),
            illuminance_lx: seen.illuminance_lx,
            rgb_lx: colour.map(|channel| channel * seen.illuminance_lx),
        })
    }
}

/// Adds a star to the pixels that it reaches.
fn spread(
    star: &Star,
    faintest_lx: f64,
    (image, kernels): (&SampledImage<'_>, KernelPlan),
    places: &Places,
    sums: &mut [Sums],
) {
    let over_limit = star.illuminance_lx / faintest_lx;
    if over_limit < 1.0 - UNDECIDED {
        return;
    }
    let mapping = image.projection.mapping();
    let direction = image.world_from_view.conjugate() * star.direction;
    let Some(pixel) = mapping.pixel_from_direction(direction) else { return };
    if !places.may_reach(pixel) {
        return;
    }
    let Some([longer, shorter]) = mapping.pixel_extent_rad(direction) else { return };
    let peak_cd_m2 = star.illuminance_lx / (longer * shorter);
    let KernelPlan { tent_below_cd_m2, gaussian_from_cd_m2, .. } = kernels;
    let between = (peak_cd_m2 / tent_below_cd_m2 - 1.0).abs() < UNDECIDED || (over_limit - 1.0).abs() < UNDECIDED;
    let number = |x: u32, y: u32| places.numbers.get(&(y * places.size[0] + x)).copied();
    // All pixels that the star may reach with an error of its position.
    let around = |centre: DVec2| -> Vec<(i64, i64, f64)> {
        let [column, row] = [centre.x, centre.y].map(|coordinate| coordinate.floor() as i64);
        let reach = if peak_cd_m2 >= gaussian_from_cd_m2 { 4 } else { 2 };
        (-reach..=reach).flat_map(|j| (-reach..=reach).map(move |i| (column + i, row + j, 1.0))).collect()
    };
    let mut touches = false;
    for tap in mapping.taps(&around, direction) {
        if let Some(number) = number(tap.x, tap.y) {
            touches = true;
            sums[number].near_lx += star.illuminance_lx;
            sums[number].near_stars += 1;
            sums[number].undecided |= between;
        }
    }
    if !touches || over_limit < 1.0 {
        return;
    }
    let taps = if peak_cd_m2 >= gaussian_from_cd_m2 {
        let part = gaussian_part(peak_cd_m2, gaussian_from_cd_m2);
        mapping.taps(&|centre| bright_kernel(part, centre), direction)
    } else {
        let kernel = if peak_cd_m2 < tent_below_cd_m2 { SplatKernel::Tent } else { SplatKernel::BSpline };
        mapping.taps(&|centre| kernel.footprint(centre), direction)
    };
    for tap in taps {
        if let Some(number) = number(tap.x, tap.y) {
            (0..3).for_each(|channel| sums[number].light_lx[channel] += star.rgb_lx[channel] * tap.weight);
        }
    }
}

/// Returns the direction of a pixel's centre in world axes; `None` outside of the picture.
pub fn world_direction(image: &SampledImage<'_>, [x, y]: [u32; 2]) -> Option<DVec3> {
    let direction = image.projection.mapping().direction_from_pixel(pixel_centre(x, y))?;
    Some(image.world_from_view * direction)
}

//! Sources that are drawn individually because they are so bright that their glare is visible against the veil around them.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{Cell, Source, cell_of, cells::directions_around_cell, direction_of_cell};
use crate::{
    photometry::{
        glare::{
            GlareKernel,
            split::{ShownCore, angle_of_chord_squared, chord_squared},
        },
        rec709::luminance,
    },
    plan::glare::VeilInSums,
    scene::surroundings::LocalSky,
};

/// Cells along an edge of a face in which the veil is estimated.
const VEIL_CELLS: u32 = 8;
/// Cells along an edge of a face that contain sprites, and regions that contain these cells.
const SPRITE_CELLS: u32 = 32;
const SPRITE_REGIONS: u32 = 8;
/// Sprites with at least this chord count as wide.
const WIDE_CHORD: f64 = 0.015;

/// A source that is drawn individually: its kernel, faded out towards the chord at which it ends. At the maximum reach it is the part of
/// the kernel that the map does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sprite {
    /// Unit vector.
    pub direction: DVec3,
    /// Linear Rec. 709, lx.
    pub light: [f64; 3],
    /// Square of the chord at which it ends, s_R.
    pub squared: f64,
    /// Whether it extends to the maximum reach.
    pub whole: bool,
}

/// Sprites whose sources are in one cell of the sky, or cells in one region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpriteCell {
    /// Unit vector to the centre of the cell.
    pub direction: DVec3,
    /// Chord from the centre beyond which no sprite of the cell reaches.
    pub reach: f64,
    /// First sprite, or cell.
    pub first: u32,
    /// Number of sprites, or cells.
    pub count: u32,
}

/// Sprites, cells of sprites and regions of cells, each sorted by the containing cell or region.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Sprites {
    /// The sources.
    pub sprites: Vec<Sprite>,
    /// Cells of the sources.
    pub cells: Vec<SpriteCell>,
    /// Regions of the cells.
    pub regions: Vec<SpriteCell>,
}

/// Share of the glow of the night sky that counts as veil. In small pictures, the greatest error is 0.9 times the tolerance without the glow, 1.25 times
/// with this share and 1.9 times with twice this share; in large ones it was 5 times with a share of 1.
const SHARE_OF_SKY: f64 = 0.05;

/// Estimate of the veil over a part of the sky, as if all light were scattered. It includes a share of the glow of the night sky: if all light were
/// scattered, the light of a smooth sky would be as bright as the sky.
pub(super) struct Veil {
    cd_m2: Vec<f64>,
    /// For each cell, the luminance below which no single source is visible.
    hidden_cd_m2: Vec<f64>,
}

impl Veil {
    /// Estimates the veil of the light in `cells` and of the glow of the sky.
    pub(super) fn new(kernel: &dyn GlareKernel, cells: &[Cell], local_sky: Option<&LocalSky>, hidden: Hidden) -> Self {
        // Spread the light of a cell over the cell, so that a source does not hide its own glare: within the cell, use the kernel's value at the edge
        // of the cell, but at least a hundredth of its mean, since the kernel may end before the edge.
        let spread_rad = 2.0 / (cells.len() as f64 / 6.0).sqrt();
        let spread = chord_squared(spread_rad);
        let within = kernel.per_sr(spread_rad).max(0.01 * kernel.share_within(spread_rad) / (PI * spread));
        let per_sr =
            |squared: f64| if squared < spread { within } else { kernel.per_sr(angle_of_chord_squared(squared)) };
        let lights: Vec<(DVec3, f64)> = cells.iter().map(|cell| (cell.direction, luminance(cell.light))).collect();
        let uses_glow = hidden.budget.is_none_or(|budget| budget.least_of_glow > 0.0);
        let glowing = local_sky.filter(|_| uses_glow);
        let luminance_and_hidden = |index: usize| {
            let direction = direction_of_cell(index, VEIL_CELLS);
            let of_stars: f64 = lights.iter().map(|(from, lx)| lx * per_sr((direction - *from).length_squared())).sum();
            hidden.behind_cd_m2(of_stars, glowing.map_or(0.0, |sky| least_glow_cd_m2(sky, index)))
        };
        let cells = (0..6 * (VEIL_CELLS * VEIL_CELLS) as usize).into_par_iter();
        let (cd_m2, hidden_cd_m2) = cells.map(luminance_and_hidden).unzip();
        Self { cd_m2, hidden_cd_m2 }
    }

    /// Lowers the thresholds of cells in which the hidden sources would be visible together. The standard deviation of their error must not exceed
    /// the tolerance plus the light that sources too faint for sprites scatter into their own pixels; no sprite shows that light.
    pub(super) fn hide_less(&mut self, tolerance: f64, reach: &Reach, sources: &Brightnesses) {
        const STEPS: i32 = 10;
        for ((veil, hidden), sources) in self.cd_m2.iter().zip(&mut self.hidden_cd_m2).zip(&sources.lx) {
            let whole = *hidden;
            let allowed = tolerance * veil + reach.unresolved_cd_m2(whole, sources);
            let is_kept = |hidden: f64| reach.deviation_cd_m2(hidden, sources) <= allowed;
            let share = |step: i32| 0.5_f64.powf(0.5 * f64::from(step));
            let step = (0..STEPS).find(|step| is_kept(whole * share(*step))).unwrap_or(STEPS);
            *hidden = whole * share(step);
        }
    }

    pub(super) fn hidden_at(&self, direction: DVec3) -> f64 {
        self.hidden_cd_m2[cell_of(direction, VEIL_CELLS)]
    }

    pub(super) fn least_hidden(&self) -> f64 {
        self.hidden_cd_m2.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Least luminance of the glow at points in a cell of a [`Veil`] and around it, cd/m^2. `sky` has no sources, and its ground is dark.
fn least_glow_cd_m2(sky: &LocalSky, index: usize) -> f64 {
    // The glare of a source in the cell may cover ground around the cell. Half a cell is the reach of the widest sprites.
    const BEYOND: f64 = 0.5;
    const ALONG_EDGE: u32 = 8;
    directions_around_cell(index, VEIL_CELLS, BEYOND, ALONG_EDGE)
        .map(|direction| luminance(sky.luminance_cd_m2(direction)))
        .fold(f64::INFINITY, f64::min)
}

/// Number of brightness ranges, a quarter of an e-fold each, starting at [`LEAST_LN_LX`].
const BRIGHTNESSES: usize = 224;
const PER_E_FOLD: f64 = 4.0;
const LEAST_LN_LX: f64 = -42.0;
/// Mean solid angle of a cell of a [`Veil`], sr.
const CELL_SR: f64 = 4.0 * PI / (6 * VEIL_CELLS * VEIL_CELLS) as f64;

/// Brightness of the sources in each cell of a [`Veil`]: sums of illuminances by brightness range, lx.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Brightnesses {
    lx: Vec<[f64; BRIGHTNESSES]>,
}

impl Default for Brightnesses {
    fn default() -> Self {
        Self { lx: vec![[0.0; BRIGHTNESSES]; 6 * (VEIL_CELLS * VEIL_CELLS) as usize] }
    }
}

impl Brightnesses {
    pub(super) fn add(&mut self, source: &Source) {
        let range = ((source.illuminance_lx.ln() - LEAST_LN_LX) * PER_E_FOLD) as usize;
        self.lx[cell_of(source.direction, VEIL_CELLS)][range.min(BRIGHTNESSES - 1)] += source.illuminance_lx;
    }

    pub(super) fn add_all(&mut self, other: &Self) {
        for (sums, parts) in self.lx.iter_mut().zip(&other.lx) {
            sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        }
    }
}

/// Each brightness range that contains sources: illuminance of one source and of all sources, lx.
fn with_illuminances(sources: &[f64; BRIGHTNESSES]) -> impl Iterator<Item = (f64, f64)> {
    let of_range = |range: usize| (LEAST_LN_LX + (range as f64 + 0.5) / PER_E_FOLD).exp();
    sources.iter().enumerate().filter(|(_, lx)| **lx > 0.0).map(move |(range, lx)| (of_range(range), *lx))
}

/// Threshold below which the glare of a source is not visible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hidden {
    /// Fraction of the veil around it.
    pub tolerance: f64,
    /// Thresholds of frames with a budget for the veil. In other frames, [`SHARE_OF_SKY`] counts as veil.
    pub budget: Option<VeilInSums>,
}

impl Hidden {
    /// The veil of stars and of the glow that hides a source, and the threshold behind it, cd/m^2.
    fn behind_cd_m2(&self, of_stars_cd_m2: f64, glow_cd_m2: f64) -> (f64, f64) {
        match self.budget {
            Some(VeilInSums { least_cd_m2, least_of_glow }) => {
                let threshold = (self.tolerance * of_stars_cd_m2).max(least_cd_m2).max(least_of_glow * glow_cd_m2);
                (of_stars_cd_m2, threshold)
            }
            None => {
                let veil_cd_m2 = of_stars_cd_m2 + SHARE_OF_SKY * glow_cd_m2;
                (veil_cd_m2, self.tolerance * veil_cd_m2)
            }
        }
    }
}

/// Distances from a source at which its glare falls below a threshold.
pub(super) struct Reach {
    /// Squares of chords, and the kernel there, 1/sr, from the narrowest sprite to the widest.
    squares: Vec<f64>,
    per_sr: Vec<f64>,
    /// Mean of the kernel within the narrowest sprite, 1/sr.
    narrowest_per_sr: f64,
    /// Integrals of the squared kernel over the sky, from each of these chords to the widest sprite, 1/sr.
    beyond: Vec<f64>,
    /// Fraction of a source's light that is scattered by angles too small for the pixels to resolve.
    core_share: f64,
}

impl Reach {
    /// Computes the distances for sprites whose sizes range from the resolution of the pixels (`shown`) to `most_rad`.
    pub(super) fn new(kernel: &dyn GlareKernel, shown: Option<&ShownCore>, most_rad: f64) -> Self {
        const ENTRIES: u32 = 512;
        let least_squared = shown.map_or(f64::INFINITY, |shown| shown.core.squared);
        let (least, most) = (least_squared.ln(), chord_squared(most_rad).ln());
        let squares: Vec<f64> = if least < most {
            (0..ENTRIES)
                .map(|i| (least + (most - least) * f64::from(i) / f64::from(ENTRIES - 1)).exp())
                // Rounding must not make the narrowest sprite too narrow for its class of pixels.
                .map(|squared| squared.max(least_squared))
                .collect()
        } else {
            Vec::new()
        };
        // Include the kernel farther out, in case a tabulated kernel is not monotonic.
        let mut per_sr: Vec<f64> =
            squares.iter().map(|squared| kernel.per_sr(angle_of_chord_squared(*squared))).collect();
        for index in (1..per_sr.len()).rev() {
            per_sr[index - 1] = per_sr[index - 1].max(per_sr[index]);
        }
        let narrowest_per_sr =
            shown.map_or(0.0, |shown| shown.faded_share(kernel, least_squared) / (PI * least_squared));
        let mut beyond = vec![0.0; squares.len()];
        for index in (1..squares.len()).rev() {
            let mean = per_sr[index - 1] * per_sr[index];
            beyond[index - 1] = beyond[index] + PI * (squares[index] - squares[index - 1]) * mean;
        }
        let core_share = shown.map_or(0.0, |shown| kernel.share_within(angle_of_chord_squared(shown.core.squared)));
        Self { squares, per_sr, narrowest_per_sr, beyond, core_share }
    }

    /// Standard deviation, within a cell of a [`Veil`], of the light that is missing if sources below `hidden_cd_m2` have no sprites, cd/m^2. The
    /// sources are independent and uniformly distributed in the cell.
    fn deviation_cd_m2(&self, hidden_cd_m2: f64, sources: &[f64; BRIGHTNESSES]) -> f64 {
        // For a kernel c / s with the fade 1 - u^2 (3 - 2 u), the part that the sprite lacks inside s_R is (3 u - 2 u^2) c / s_R. The constant is the
        // mean of (3 u - 2 u^2)^2 over u.
        const INSIDE: f64 = 0.8;
        let variance: f64 = with_illuminances(sources)
            .map(|(lx, of_all)| {
                let integral = match self.ends_at(hidden_cd_m2 / lx) {
                    Some(last) if last + 1 == self.squares.len() => 0.0,
                    Some(last) => self.beyond[last] + INSIDE * PI * self.squares[last] * self.per_sr[last].powi(2),
                    None => self.beyond.first().copied().unwrap_or(0.0),
                };
                of_all * lx * integral
            })
            .sum();
        (variance / CELL_SR).sqrt()
    }

    /// Mean luminance over a cell of the light that sources below `hidden_cd_m2` scatter into their own pixels, where they have no sprite,
    /// cd/m^2.
    fn unresolved_cd_m2(&self, hidden_cd_m2: f64, sources: &[f64; BRIGHTNESSES]) -> f64 {
        let faint = with_illuminances(sources).filter(|(lx, _)| self.ends_at(hidden_cd_m2 / lx).is_none());
        self.core_share * faint.map(|(_, of_all)| of_all).sum::<f64>() / CELL_SR
    }

    /// Index of the entry at which the sprite of a source ends: where the kernel falls below the given value, 1/sr. It is the narrowest entry if only
    /// the mean within the narrowest sprite exceeds the value.
    fn ends_at(&self, hidden_per_sr: f64) -> Option<usize> {
        let visible = self.per_sr.partition_point(|per_sr| *per_sr > 0.0 && *per_sr >= hidden_per_sr);
        let narrowest = self.narrowest_per_sr > 0.0 && self.narrowest_per_sr >= hidden_per_sr;
        let entries = if narrowest { visible.max(1) } else { visible };
        entries.checked_sub(1).filter(|last| *last < self.squares.len())
    }

    /// Illuminance above which the glare of a source exceeds a luminance, lx.
    pub(super) fn least_lx(&self, hidden_cd_m2: f64) -> f64 {
        let most = self.per_sr.first().map_or(0.0, |narrowest| narrowest.max(self.narrowest_per_sr));
        if most > 0.0 { hidden_cd_m2 / most } else { f64::INFINITY }
    }

    /// Sprite of a source, if its glare exceeds a luminance.
    pub(super) fn sprite(&self, source: &Source, hidden_cd_m2: f64) -> Option<Sprite> {
        let last = self.ends_at(hidden_cd_m2 / source.illuminance_lx)?;
        let (squared, whole) = (self.squares[last], last + 1 == self.squares.len());
        Some(Sprite { direction: source.direction, light: source.light, squared, whole })
    }
}

/// Fraction of a source's light that its sprite contains, for a class of pixels.
pub(super) struct Shares {
    squares: Vec<f64>,
    shares: Vec<f64>,
    whole: f64,
}

impl Shares {
    /// Sprites end at squares of chords up to `most`. A sprite that extends to the maximum reach contains the fraction `whole` of its source's light.
    pub(super) fn new(kernel: &dyn GlareKernel, shown: &ShownCore, most: f64, whole: f64) -> Self {
        const ENTRIES: u32 = 64;
        let least = shown.core.squared;
        let e_folds = (most / least).max(1.0).ln() / f64::from(ENTRIES - 1);
        let squares: Vec<f64> = (0..ENTRIES).map(|i| least * (f64::from(i) * e_folds).exp()).collect();
        let shares = squares.iter().map(|squared| shown.faded_share(kernel, *squared)).collect();
        Self { squares, shares, whole }
    }

    pub(super) fn share_of(&self, sprite: &Sprite) -> f64 {
        if sprite.whole {
            return self.whole;
        }
        let above = self.squares.partition_point(|squared| *squared < sprite.squared).clamp(1, self.squares.len() - 1);
        let (from, to) = (self.squares[above - 1], self.squares[above]);
        let part = if to > from { ((sprite.squared / from).ln() / (to / from).ln()).clamp(0.0, 1.0) } else { 0.0 };
        self.shares[above - 1] + part * (self.shares[above] - self.shares[above - 1])
    }
}

/// Makes one cell of each run of consecutive items with the same key. `middle` returns the centre of a key's cell. `reach` returns the direction and
/// the reach of an item.
fn runs<T, K: PartialEq>(
    items: &[T],
    key: impl Fn(&T) -> K,
    middle: impl Fn(&K) -> DVec3,
    reach: impl Fn(&T) -> (DVec3, f64),
) -> Vec<SpriteCell> {
    let mut cells: Vec<SpriteCell> = Vec::new();
    let mut last = None;
    for (index, item) in items.iter().enumerate() {
        let own = key(item);
        let same = last.as_ref() == Some(&own);
        let (from, reach) = reach(item);
        match cells.last_mut().filter(|_| same) {
            Some(cell) => {
                cell.count += 1;
                // Chords satisfy the triangle inequality.
                cell.reach = cell.reach.max((from - cell.direction).length() + reach);
            }
            None => {
                let direction = middle(&own);
                let reach = (from - direction).length() + reach;
                cells.push(SpriteCell { direction, reach, first: index as u32, count: 1 });
            }
        }
        last = Some(own);
    }
    cells
}

impl Sprites {
    /// Sorts sprites by cell: first the narrow ones, then the wide ones, so that the few wide ones do not extend the reach
    /// of every cell.
    pub(super) fn new(mut sprites: Vec<Sprite>) -> Self {
        let wide = |sprite: &Sprite| sprite.squared > WIDE_CHORD * WIDE_CHORD;
        let region = |direction: DVec3| cell_of(direction, SPRITE_REGIONS);
        let cell = |direction: DVec3| cell_of(direction, SPRITE_CELLS);
        let key = |sprite: &Sprite| (wide(sprite), region(sprite.direction), cell(sprite.direction));
        // The sort is stable, so that the sprites of a cell keep the order of the stars.
        sprites.par_sort_by_cached_key(key);
        let cells = runs(
            &sprites,
            key,
            |(_, _, cell)| direction_of_cell(*cell, SPRITE_CELLS),
            |sprite| (sprite.direction, sprite.squared.sqrt()),
        );
        let of_cell = |cell: &SpriteCell| (wide(&sprites[cell.first as usize]), region(cell.direction));
        let regions = runs(
            &cells,
            of_cell,
            |(_, region)| direction_of_cell(*region, SPRITE_REGIONS),
            |cell| (cell.direction, cell.reach),
        );
        Self { sprites, cells, regions }
    }
}

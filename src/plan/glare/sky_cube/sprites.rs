//! The sources that are drawn one by one: bright enough for their glare to stand out of the veil around them.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{Cell, Source, cell_of, direction_of_cell};
use crate::photometry::{
    glare::{
        GlareKernel,
        split::{Fade, ShownCore, angle_of_chord_squared, chord_squared},
    },
    rec709::luminance,
};

/// Cells along an edge of a face in which the veil is estimated.
const VEIL_CELLS: u32 = 8;
/// Cells along an edge of a face by which sprites are found, and those by which these are.
const SPRITE_CELLS: u32 = 32;
const SPRITE_REGIONS: u32 = 8;
/// Chord from which on a sprite is wide.
const WIDE_CHORD: f64 = 0.015;

/// A source that is drawn by itself: its kernel, faded out towards the chord at which it
/// ends; where it reaches as far as any, what the map's kernel
/// leaves of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sprite {
    /// Unit vector.
    pub direction: DVec3,
    /// Linear Rec. 709, lx.
    pub light: [f64; 3],
    /// Square of the chord at which it ends, s_R.
    pub squared: f64,
    /// Whether it reaches as far as any sprite may.
    pub whole: bool,
}

/// Sprites whose sources stand in one cell of the sky; or cells of one region of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpriteCell {
    /// Unit vector to the middle of the cell.
    pub direction: DVec3,
    /// No sprite of the cell reaches a direction farther away than this chord.
    pub reach: f64,
    /// First sprite, or cell.
    pub first: u32,
    /// Number of sprites, or cells.
    pub count: u32,
}

/// Sprites, cells of sprites and regions of cells, each where those that hold them say.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Sprites {
    /// The sources.
    pub sprites: Vec<Sprite>,
    /// Where they stand.
    pub cells: Vec<SpriteCell>,
    /// Where the cells lie.
    pub regions: Vec<SpriteCell>,
}

/// An estimate of the light that is scattered towards a part of the sky, as if all of it were.
pub(super) struct Veil {
    cd_m2: Vec<f64>,
}

impl Veil {
    pub(super) fn new(kernel: &dyn GlareKernel, cells: &[Cell]) -> Self {
        // A cell's light is spread over the cell: within it the kernel is taken as at its edge, so that a source does not count as the
        // veil that hides it; a kernel that has ended there, as a hundredth of its mean.
        let spread_rad = 2.0 / (cells.len() as f64 / 6.0).sqrt();
        let spread = chord_squared(spread_rad);
        let within = kernel.per_sr(spread_rad).max(0.01 * kernel.share_within(spread_rad) / (PI * spread));
        let per_sr =
            |squared: f64| if squared < spread { within } else { kernel.per_sr(angle_of_chord_squared(squared)) };
        let lights: Vec<(DVec3, f64)> = cells.iter().map(|cell| (cell.direction, luminance(cell.light))).collect();
        let at = |index: usize| {
            let direction = direction_of_cell(index, VEIL_CELLS);
            lights.iter().map(|(from, lx)| lx * per_sr((direction - *from).length_squared())).sum()
        };
        Self { cd_m2: (0..6 * (VEIL_CELLS * VEIL_CELLS) as usize).map(at).collect() }
    }

    pub(super) fn at(&self, direction: DVec3) -> f64 {
        self.cd_m2[cell_of(direction, VEIL_CELLS)]
    }

    pub(super) fn faintest(&self) -> f64 {
        self.cd_m2.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// What the glare of a source does not stand out by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hidden {
    /// Share of the veil around it.
    pub tolerance: f64,
    /// Luminance, whatever the veil, cd/m^2.
    pub least_cd_m2: f64,
}

impl Hidden {
    fn behind_cd_m2(&self, veil_cd_m2: f64) -> f64 {
        (self.tolerance * veil_cd_m2).max(self.least_cd_m2)
    }
}

/// How far from its source glare stands out of the veil.
pub(super) struct Reach {
    hidden: Hidden,
    /// Squares of chords, and the kernel there, 1/sr, from the narrowest sprite to the widest.
    squares: Vec<f64>,
    per_sr: Vec<f64>,
    /// Mean of what the narrowest sprite has, 1/sr.
    narrowest_per_sr: f64,
}

impl Reach {
    /// Sprites from what pixels as `shown` can show to `most_rad`.
    pub(super) fn new(
        kernel: &dyn GlareKernel,
        fade: Fade,
        shown: Option<&ShownCore>,
        most_rad: f64,
        hidden: Hidden,
    ) -> Self {
        const ENTRIES: u32 = 512;
        let least_squared = shown.map_or(f64::INFINITY, |shown| shown.core.squared);
        let (least, most) = (least_squared.ln(), chord_squared(most_rad).ln());
        let squares: Vec<f64> = if least < most {
            (0..ENTRIES)
                .map(|i| (least + (most - least) * f64::from(i) / f64::from(ENTRIES - 1)).exp())
                // Rounding must not make the narrowest too narrow for its class of pixels.
                .map(|squared| squared.max(least_squared))
                .collect()
        } else {
            Vec::new()
        };
        // What the kernel still has farther out counts too, where a table goes down and up again.
        let mut per_sr: Vec<f64> =
            squares.iter().map(|squared| kernel.per_sr(angle_of_chord_squared(*squared))).collect();
        for index in (1..per_sr.len()).rev() {
            per_sr[index - 1] = per_sr[index - 1].max(per_sr[index]);
        }
        let narrowest_per_sr =
            shown.map_or(0.0, |shown| shown.faded_share(kernel, fade, least_squared) / (PI * least_squared));
        Self { hidden, squares, per_sr, narrowest_per_sr }
    }

    /// Illuminance from which on a source stands out of a veil, lx.
    pub(super) fn least_lx(&self, veil_cd_m2: f64) -> f64 {
        let most = self.per_sr.first().map_or(0.0, |narrowest| narrowest.max(self.narrowest_per_sr));
        if most > 0.0 { self.hidden.behind_cd_m2(veil_cd_m2) / most } else { f64::INFINITY }
    }

    /// The sprite of a source in front of a veil, if it stands out: as wide as the kernel does, and the narrowest one where what
    /// that has does.
    pub(super) fn sprite(&self, source: &Source, veil_cd_m2: f64) -> Option<Sprite> {
        let hidden = self.hidden.behind_cd_m2(veil_cd_m2) / source.illuminance_lx;
        // Entries where it stands out.
        let visible = self.per_sr.partition_point(|per_sr| *per_sr > 0.0 && *per_sr >= hidden);
        let last =
            if self.narrowest_per_sr > 0.0 && self.narrowest_per_sr >= hidden { visible.max(1) } else { visible };
        let squared = *self.squares.get(last.checked_sub(1)?)?;
        let whole = last == self.squares.len();
        Some(Sprite { direction: source.direction, light: source.light, squared, whole })
    }
}

/// Shares of a source's light that sprites have in a class of pixels.
pub(super) struct Shares {
    squares: Vec<f64>,
    shares: Vec<f64>,
    whole: f64,
}

impl Shares {
    /// Sprites end at squares of chords up to `most`; one that is whole has `whole` of its source's light.
    pub(super) fn new(kernel: &dyn GlareKernel, fade: Fade, shown: &ShownCore, most: f64, whole: f64) -> Self {
        const ENTRIES: u32 = 64;
        let least = shown.core.squared;
        let e_folds = (most / least).max(1.0).ln() / f64::from(ENTRIES - 1);
        let squares: Vec<f64> = (0..ENTRIES).map(|i| least * (f64::from(i) * e_folds).exp()).collect();
        let shares = squares.iter().map(|squared| shown.faded_share(kernel, fade, *squared)).collect();
        Self { squares, shares, whole }
    }

    pub(super) fn of(&self, sprite: &Sprite) -> f64 {
        if sprite.whole {
            return self.whole;
        }
        let above = self.squares.partition_point(|squared| *squared < sprite.squared).clamp(1, self.squares.len() - 1);
        let (from, to) = (self.squares[above - 1], self.squares[above]);
        let part = if to > from { ((sprite.squared / from).ln() / (to / from).ln()).clamp(0.0, 1.0) } else { 0.0 };
        self.shares[above - 1] + part * (self.shares[above] - self.shares[above - 1])
    }
}

/// A cell of each run of items with the same key, in their order: numbers of the run's items, the middle of a cell with that key,
/// and what each item reaches from where.
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
                // Chords obey the triangle inequality.
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
    /// Sorts sprites by where they stand: first the narrow ones, then the wide ones, so that the few wide ones do not make every
    /// cell reach far.
    pub(super) fn new(mut sprites: Vec<Sprite>) -> Self {
        let wide = |sprite: &Sprite| sprite.squared > WIDE_CHORD * WIDE_CHORD;
        let region = |direction: DVec3| cell_of(direction, SPRITE_REGIONS);
        let cell = |direction: DVec3| cell_of(direction, SPRITE_CELLS);
        let key = |sprite: &Sprite| (wide(sprite), region(sprite.direction), cell(sprite.direction));
        // Stable, so that sprites of a cell keep the order of the stars.
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

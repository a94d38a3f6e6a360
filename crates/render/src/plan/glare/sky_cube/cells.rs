//! Bins the stars into the cells of a cube in world axes: their light and its centroid.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    MOST_NEAR, NearStar, Source,
    far::FarLight,
    sprites::{Brightnesses, Reach, Sprite, Veil},
};
use crate::{
    catalogue::{chunks::StarSet, packed::PackedStar},
    photometry::rec709::luminance,
    plan::stars::{
        cull::{VisibleChunk, light_at, near_stars},
        deep::reaches_leaves,
    },
    relativity::Motion,
    scene::surroundings::LocalSky,
    view::projection::Face,
};

/// Number of chunks that one thread bins at a time, and maximum number of such groups. These, and not the number of threads, determine the order of
/// the sum.
const GROUP_CHUNKS: usize = 64;
const MOST_GROUPS: usize = 16;

/// Greatest number of sources that are drawn individually: the buffer of their 32 bytes fits into every adapter's limit.
const MOST_SPRITES: usize = 2_000_000;

/// The light of a part of the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Unit vector to the centroid of its light; to the centre of the cell if it is dark.
    pub direction: DVec3,
    /// Linear Rec. 709, lx.
    pub light: [f64; 3],
}

/// Index of the cell that contains a direction (of any length but 0), for faces with `cells` along an edge; row by row from the top
/// left of each face.
pub fn cell_of(direction: DVec3, cells: u32) -> usize {
    let size = direction.abs();
    let face = if size.z >= size.x && size.z >= size.y {
        if direction.z > 0.0 { Face::Back } else { Face::Front }
    } else if size.y >= size.x {
        if direction.y > 0.0 { Face::Up } else { Face::Down }
    } else if direction.x > 0.0 {
        Face::Right
    } else {
        Face::Left
    };
    let on_face = face.axes().transpose() * direction;
    let place = |tangent: f64| ((0.5 * (1.0 + tangent) * f64::from(cells)) as u32).min(cells - 1) as usize;
    let (column, row) = (place(on_face.x / -on_face.z), place(on_face.y / on_face.z));
    (face as usize * cells as usize + row) * cells as usize + column
}

/// Unit vector to the centre of a cell.
pub fn direction_of_cell(index: usize, cells: u32) -> DVec3 {
    direction_in_cell(index, cells, [0.5, 0.5])
}

/// Unit vectors to points in a cell and around it, in a square that extends beyond each edge of the cell by the share `beyond` of the cell. It has
/// `intervals` intervals along an edge.
pub(super) fn directions_around_cell(
    index: usize,
    cells: u32,
    beyond: f64,
    intervals: u32,
) -> impl Iterator<Item = DVec3> {
    let part = move |point: u32| (1.0 + 2.0 * beyond) * f64::from(point) / f64::from(intervals) - beyond;
    let points = (0..=intervals).flat_map(move |row| (0..=intervals).map(move |column| [part(column), part(row)]));
    points.map(move |place| direction_in_cell(index, cells, place))
}

/// Unit vector to a place in a cell: shares of its width and of its height, from the top left.
fn direction_in_cell(index: usize, cells: u32, [across, down]: [f64; 2]) -> DVec3 {
    let n = cells as usize;
    let (face, row, column) = (index / (n * n), index / n % n, index % n);
    let tangent = |place: usize, share: f64| 2.0 * (place as f64 + share) / n as f64 - 1.0;
    (Face::ALL[face].axes() * DVec3::new(tangent(column, across), -tangent(row, down), -1.0)).normalize()
}

/// Sums over the sources of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moments {
    pub light: [f64; 3],
    /// Directions, weighted by illuminance.
    pub place: DVec3,
}

impl Moments {
    pub(super) fn of(source: &Source) -> Self {
        Self { light: source.light, place: source.direction * source.illuminance_lx }
    }

    pub(super) fn add(&mut self, other: &Self) {
        (0..3).for_each(|c| self.light[c] += other.light[c]);
        self.place += other.place;
    }
}

/// All stars of the sky, binned.
pub(super) struct Gathered {
    /// Cells of all stars except the near ones.
    pub cells: Vec<Cell>,
    /// The brightest of the near stars.
    pub near: Vec<NearStar>,
    /// All stars except the near ones, by brightness.
    pub brightnesses: Option<Brightnesses>,
}

/// Stars of some chunks, binned.
struct Group {
    sums: Vec<Moments>,
    near: Vec<NearStar>,
    brightnesses: Option<Brightnesses>,
}

impl Group {
    fn new(cells: u32, counts_brightnesses: bool) -> Self {
        Self {
            sums: vec![Moments::default(); 6 * cells as usize * cells as usize],
            near: Vec::new(),
            brightnesses: counts_brightnesses.then(Brightnesses::default),
        }
    }

    fn add(&mut self, source: &Source, cells: u32) {
        self.sums[cell_of(source.direction, cells)].add(&Moments::of(source));
        if let Some(brightnesses) = &mut self.brightnesses {
            brightnesses.add(source);
        }
    }

    fn add_all(&mut self, other: Self) {
        self.sums.iter_mut().zip(&other.sums).for_each(|(sum, part)| sum.add(part));
        self.near.extend(other.near);
        if let (Some(sums), Some(parts)) = (&mut self.brightnesses, &other.brightnesses) {
            sums.add_all(parts);
        }
    }
}

/// Stars that scatter light.
pub(super) struct Sky<'a> {
    pub set: &'a StarSet,
    /// Position of the camera, pc.
    pub place_pc: DVec3,
    pub motion: Option<Motion>,
    pub local_sky: Option<&'a LocalSky>,
    pub faintest_lx: f64,
    /// Distance below which a star has a separate direction for each eye, pc.
    pub near_pc: f64,
}

impl Sky<'_> {
    /// Returns the stars of a chunk that may scatter light, with their positions relative to the camera, pc.
    pub(super) fn stars(&self, visible: &VisibleChunk) -> impl Iterator<Item = (DVec3, &PackedStar)> {
        near_stars(self.set, &self.set.chunks[visible.chunk], visible.origin_pc).take(visible.count as usize)
    }

    fn is_near(&self, visible: &VisibleChunk, place_pc: DVec3) -> bool {
        !self.set.chunks[visible.chunk].at_infinity && place_pc.length_squared() < self.near_pc * self.near_pc
    }

    /// A star whose illuminance at the camera is at least `least_lx`.
    pub(super) fn source(&self, place_pc: DVec3, star: &PackedStar, least_lx: f64) -> Option<Source> {
        // Air can only dim a star, so a star that is too faint can be skipped before its refraction is computed.
        if light_at(place_pc, star, self.motion) < least_lx {
            return None;
        }
        Source::at_position(place_pc, star, self.motion, self.local_sky)
            .filter(|source| source.illuminance_lx >= least_lx)
    }

    /// The composite stars of the set's deep store, if their light is drawn at all.
    fn deep_light(&self) -> impl Iterator<Item = Source> {
        let deep = self.set.deep.as_ref().filter(|_| reaches_leaves(self.faintest_lx));
        deep.into_iter().flat_map(|deep| deep.base_light(self.place_pc)).filter_map(|(towards, light)| {
            let source = Source { direction: towards.try_normalize()?, illuminance_lx: luminance(light), light };
            Some(source.through_air(self.local_sky))
        })
    }

    /// Bins the stars of the visible chunks, with `cells` cells along an edge of a face. `counts_brightnesses`: whether the stars are also counted by
    /// brightness. With `far`, most distant stars are not read.
    pub(super) fn gather(
        &self,
        visible: &[VisibleChunk],
        cells: u32,
        counts_brightnesses: bool,
        far: Option<&mut FarLight>,
    ) -> Gathered {
        let (distant, near) = match far {
            Some(far) => far.seen(self, visible, cells),
            None => (Vec::new(), visible.iter().collect()),
        };
        let groups = grouped(
            &near,
            || Group::new(cells, counts_brightnesses),
            |group, visible| {
                for (place_pc, star) in self.stars(visible) {
                    if self.is_near(visible, place_pc) {
                        group.near.push(NearStar { place_pc, star: *star });
                    } else if let Some(source) = self.source(place_pc, star, self.faintest_lx) {
                        group.add(&source, cells);
                    }
                }
            },
        );
        let mut whole = Group::new(cells, counts_brightnesses);
        groups.into_iter().for_each(|group| whole.add_all(group));
        // The light of a deep store. No composite star is bright enough to be drawn individually.
        for source in distant.into_iter().chain(self.deep_light()) {
            whole.sums[cell_of(source.direction, cells)].add(&Moments::of(&source));
        }
        let Group { mut sums, mut near, brightnesses } = whole;
        let light = |near: &NearStar| light_at(near.place_pc, &near.star, self.motion);
        // The sort is stable, so that the same stars are always in the same order.
        near.sort_by(|a, b| light(b).total_cmp(&light(a)));
        for NearStar { place_pc, star } in near.drain(near.len().min(MOST_NEAR)..) {
            if let Some(source) = self.source(place_pc, &star, self.faintest_lx) {
                sums[cell_of(source.direction, cells)].add(&Moments::of(&source));
            }
        }
        Gathered { cells: finished(&sums, cells), near, brightnesses }
    }

    /// Sources that are drawn individually.
    pub(super) fn sprites(&self, reach: &Reach, veil: &Veil) -> Vec<Sprite> {
        let least_lx = reach.least_lx(veil.least_hidden()).max(self.faintest_lx);
        // Visit only those stars of each chunk that can be bright enough.
        let visible = super::visible_everywhere(self.set, self.place_pc, self.motion, least_lx);
        let sprites = visible
            .par_iter()
            .filter(|visible| visible.brightest_lx >= least_lx)
            .flat_map_iter(|visible| {
                self.stars(visible).filter_map(|(place_pc, star)| {
                    if self.is_near(visible, place_pc) {
                        return None;
                    }
                    let source = self.source(place_pc, star, least_lx)?;
                    reach.sprite(&source, veil.hidden_at(source.direction))
                })
            })
            .collect();
        brightest(sprites)
    }
}

/// Adds items to sums, in groups of neighbours that do not depend on the number of threads. Returns the sums of the groups, in order.
pub(super) fn grouped<I: Sync, S: Send>(
    items: &[I],
    empty: impl Fn() -> S + Sync,
    add: impl Fn(&mut S, &I) + Sync,
) -> Vec<S> {
    let per_group = items.len().div_ceil(MOST_GROUPS).max(GROUP_CHUNKS);
    let sum = |group: &[I]| {
        let mut sum = empty();
        group.iter().for_each(|item| add(&mut sum, item));
        sum
    };
    items.par_chunks(per_group).map(sum).collect()
}

/// Selects the brightest [`MOST_SPRITES`], in their original order. The light of the others stays in the map.
fn brightest(mut sprites: Vec<Sprite>) -> Vec<Sprite> {
    if sprites.len() > MOST_SPRITES {
        let mut lights: Vec<f64> = sprites.iter().map(|sprite| luminance(sprite.light)).collect();
        let least = *lights.select_nth_unstable_by(MOST_SPRITES, |a, b| b.total_cmp(a)).1;
        sprites.retain(|sprite| luminance(sprite.light) > least);
    }
    sprites
}

fn finished(sums: &[Moments], cells: u32) -> Vec<Cell> {
    let cell = |(index, sum): (usize, &Moments)| Cell {
        direction: sum.place.try_normalize().unwrap_or_else(|| direction_of_cell(index, cells)),
        light: sum.light,
    };
    sums.iter().enumerate().map(cell).collect()
}

/// Combines cells into those of a level with half as many cells along an edge.
pub(super) fn halved(fine: &[Cell], fine_cells: u32) -> Vec<Cell> {
    let cells = fine_cells / 2;
    let mut sums = vec![Moments::default(); fine.len() / 4];
    for (index, cell) in fine.iter().enumerate() {
        let (n, half) = (fine_cells as usize, cells as usize);
        let (face, row, column) = (index / (n * n), index / n % n, index % n);
        let part = Moments { light: cell.light, place: cell.direction * luminance(cell.light) };
        sums[(face * half + row / 2) * half + column / 2].add(&part);
    }
    finished(&sums, cells)
}

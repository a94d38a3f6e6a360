//! Extracts stars of a deep store into another store: those in a cone of the sky, or in a range of magnitudes or distances.

use glam::DVec3;
use rayon::prelude::*;

use super::super::StarRecord;
use super::super::motion::velocity_by_star;
use super::super::store::Store;
use super::build::{Build, BuildOptions, BuildReport, BuildStep, NewStar, OnStep};
use super::cells::{CellFrame, cell_count};
use super::error::DeepError;
use super::{DeepStore, LAYERS};

/// Number of leaves that are read at a time.
const LEAVES_AT_ONCE: u64 = 4096;

/// Conditions for a star. All of them must be met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Selection {
    /// Unit vector towards the centre of a cone, ICRS axes, and its half-angle, rad.
    pub cone: Option<(DVec3, f64)>,
    /// Apparent V magnitudes, both ends included.
    pub magnitudes: Option<[f64; 2]>,
    /// Distances, pc, both ends included; stars at infinity are left out.
    pub distances_pc: Option<[f64; 2]>,
}

impl Selection {
    /// Whether a star meets the conditions.
    pub fn contains(&self, star: &StarRecord) -> bool {
        let within = |range: [f64; 2], value: f64| (range[0]..=range[1]).contains(&value);
        self.cone.is_none_or(|(axis, half_rad)| star.position.angle_between(axis) <= half_rad)
            && self.magnitudes.is_none_or(|range| within(range, star.apparent_magnitude()))
            && self.distances_pc.is_none_or(|range| star.distance_known && within(range, star.position.length()))
    }

    /// Whether a cell may have stars that meet the conditions.
    fn may_contain_cell(&self, order: u8, cell: u64) -> bool {
        let Some((axis, half_rad)) = self.cone else { return true };
        let frame = CellFrame::new(order, cell);
        frame.centre.angle_between(axis) <= half_rad + frame.radius_rad()
    }

    /// Whether a layer may have stars that meet the conditions.
    fn may_contain_layer(&self, layer: usize) -> bool {
        self.magnitudes.is_none_or(|[_, faintest]| faintest >= LAYERS[layer].brightest_mag())
    }
}

/// Receives a star, the Julian year of its position, and other data of the star.
pub type StarSink<'a> = dyn FnMut(StarRecord, f64, NewStar) -> Result<(), DeepError> + Send + 'a;

/// Passes the stars of a store that meet conditions to `sink`, in the order of the store: bright stars with their velocity and names, then the stars
/// of leaves.
///
/// # Errors
/// A part of the store is damaged, or `sink` fails.
pub fn each_star(
    store: &DeepStore,
    selection: &Selection,
    sink: &mut StarSink<'_>,
    on_step: &mut OnStep<'_>,
) -> Result<(), DeepError> {
    let bright = store.bright()?;
    each_bright_star(&bright, selection, sink)?;
    drop(bright);
    let epoch_year = store.index().epoch_year;
    each_leaf_star(store, selection, &mut |star| sink(star, epoch_year, NewStar::default()), on_step)
}

/// Passes the stars of the leaves that meet conditions to `sink`, in the order of the store.
///
/// # Errors
/// A leaf is damaged, or `sink` fails.
pub fn each_leaf_star(
    store: &DeepStore,
    selection: &Selection,
    sink: &mut (dyn FnMut(StarRecord) -> Result<(), DeepError> + Send + '_),
    on_step: &mut OnStep<'_>,
) -> Result<(), DeepError> {
    let total = store.index().leaves.iter().map(super::index::Segments::stars).sum();
    let mut done = 0;
    for (layer, kind) in LAYERS.iter().enumerate() {
        if !selection.may_contain_layer(layer) {
            continue;
        }
        for first in (0..cell_count(kind.order)).step_by(LEAVES_AT_ONCE as usize) {
            let cells = first..(first + LEAVES_AT_ONCE).min(cell_count(kind.order));
            let read = cells.clone().into_par_iter().map(|cell| {
                if store.leaf_stars(layer, cell) == 0 || !selection.may_contain_cell(kind.order, cell) {
                    return Ok(Vec::new());
                }
                let leaf = store.leaf(layer, cell)?;
                let stars = (0..leaf.words.len()).map(|index| leaf.star(index).record());
                Ok(stars.filter(|star| selection.contains(star)).collect())
            });
            let read: Vec<Vec<StarRecord>> = read.collect::<Result<_, DeepError>>()?;
            for star in read.into_iter().flatten() {
                sink(star)?;
            }
            done += cells.map(|cell| u64::from(store.leaf_stars(layer, cell))).sum::<u64>();
            on_step(BuildStep { work: "reading stars", done, total });
        }
    }
    Ok(())
}

/// Passes the stars of a single-file store that meet conditions to `sink`.
///
/// # Errors
/// `sink` fails.
pub fn each_bright_star(store: &Store, selection: &Selection, sink: &mut StarSink<'_>) -> Result<(), DeepError> {
    let mut velocity_of = velocity_by_star(&store.velocities);
    let mut names = store.names.iter().peekable();
    for (index, star) in store.records(0.0).into_iter().enumerate() {
        let velocity = velocity_of(index);
        let names = names.next_if(|of| of.star as usize == index).map(|of| of.names.clone());
        if selection.contains(&star) {
            sink(star, 2000.0, NewStar { velocity, names, ..NewStar::default() })?;
        }
    }
    Ok(())
}

/// Writes the stars of a store that meet conditions as another store. `options.job` is replaced. Stars are encoded again, so that they may move by
/// one more step of their words.
///
/// # Errors
/// The store is damaged, no star is left, or the other store cannot be written.
pub fn slice(
    store: &DeepStore,
    selection: &Selection,
    options: BuildOptions,
    on_step: &mut OnStep<'_>,
) -> Result<BuildReport, DeepError> {
    let job = options.job_of(&format!("{selection:?} of the store {}", store.root()));
    let mut build = Build::open(BuildOptions { job, ..options })?;
    if !build.is_read() {
        each_star(store, selection, &mut |star, _, about| build.add(star, about), on_step)?;
        build.checkpoint(1, String::new())?;
    }
    let description = format!("{}\npart: {}", store.index().description, selection.describe());
    build.finish(None, description, on_step)
}

impl Selection {
    /// The conditions as human-readable text.
    pub fn describe(&self) -> String {
        let mut parts = Vec::new();
        if let Some((axis, half_rad)) = self.cone {
            let (ra, dec) = crate::coordinates::lon_lat_from_direction(axis);
            let ra = ra.rem_euclid(std::f64::consts::TAU).to_degrees();
            parts.push(format!(
                "within {:.4} degrees of RA {ra:.4}, Dec {:.4} degrees",
                half_rad.to_degrees(),
                dec.to_degrees()
            ));
        }
        parts.extend(self.magnitudes.map(|[from, to]| format!("V {from} to {to}")));
        parts.extend(self.distances_pc.map(|[from, to]| format!("{from} to {to} pc")));
        if parts.is_empty() { "all stars".to_owned() } else { parts.join(", ") }
    }
}

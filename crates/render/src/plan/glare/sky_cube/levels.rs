//! Levels of the map. Each level has a kernel that ends at twice its width of smoothness; the kernel of the coarsest level covers the whole sphere.

use super::{
    FINEST_CELLS, LEVELS,
    cells::{Cell, halved},
    smooth_angle_rad,
};
use crate::photometry::glare::{
    GlareKernel,
    split::{SoftCore, angle_of_chord_squared},
};

/// Number of entries of the table of a level's kernel.
pub const TABLE_ENTRIES: usize = 1024;

/// A level of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Cells along an edge of a face.
    pub edge_cells: u32,
    /// Light of the cells, face by face, row by row.
    pub cells: Vec<Cell>,
    /// Kernel at equidistant squares of chords from 0 to `end_squared`, 1/sr.
    pub table: Vec<f64>,
    /// Square of the chord at which the kernel ends.
    pub end_squared: f64,
}

/// Levels of a kernel, the finest first.
pub(super) fn of_kernel(kernel: &dyn GlareKernel, finest: Vec<Cell>) -> Vec<Level> {
    let soft: [SoftCore; LEVELS] = std::array::from_fn(|level| SoftCore::new(kernel, smooth_angle_rad(level)));
    let mut cells = vec![finest];
    for level in 1..LEVELS {
        cells.push(halved(&cells[level - 1], FINEST_CELLS >> (level - 1)));
    }
    let with_cells = |(level, cells): (usize, Vec<Cell>)| {
        let own = soft[level];
        let coarser = soft.get(level + 1);
        let end_squared = coarser.map_or(4.0, |coarser| coarser.squared);
        let per_sr = |squared: f64| {
            let smooth = if squared < own.squared {
                own.per_sr(squared)
            } else {
                kernel.per_sr(angle_of_chord_squared(squared))
            };
            smooth - coarser.map_or(0.0, |coarser| coarser.per_sr(squared.min(coarser.squared)))
        };
        let step = end_squared / (TABLE_ENTRIES - 1) as f64;
        let table = (0..TABLE_ENTRIES).map(|entry| per_sr(entry as f64 * step)).collect();
        Level { edge_cells: FINEST_CELLS >> level, cells, table, end_squared }
    };
    cells.into_iter().enumerate().map(with_cells).collect()
}

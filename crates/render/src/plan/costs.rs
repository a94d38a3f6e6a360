//! Relative costs, in one table: the only decisions of the planner that follow from measured times and not from a budget.
//!
//! Budgets decide which kernel draws a star, which stars a map of faint light may contain, how far a source's veil is drawn, and the distances of
//! impostors and meshes. If two methods keep the budget, the table selects one. It is compiled in and never measured while a
//! program runs: the same input gives the same bytes on every machine. A wrong entry costs only time.

/// Table of costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Number of stars in the map of faint light, per pixel of the views, above which reading the map costs less than drawing the stars.
    pub map_from_stars_per_pixel: f64,
    /// Number of drawn stars above which units finer than the faintest star requires cost time: with finer units, more stars need a second atomic
    /// add.
    pub coarse_units_from_stars: u64,
}

/// Measured with llvmpipe on two cores (`docs/benchmarks.md`): reading the map costs as much per pixel as 0.3 stars, and below 50,000 stars the
/// cost of second adds is negligible compared with that of the pixels. On GPUs both are so fast that the choice hardly matters.
pub const BUILT_IN: Costs = Costs { map_from_stars_per_pixel: 0.3, coarse_units_from_stars: 50_000 };

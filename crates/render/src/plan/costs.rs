//! What the planner takes to cost less, in one table: the only choices that follow from measured times and from no budget.
//!
//! Which kernel draws a star, which stars a map of faint light may hold, how far a source's veil is drawn, how impostors and meshes
//! divide: all of that follows from budgets. Where two ways keep the budget, the table says which one is taken. It is built in, and never measured while a
//! program runs: the same input gives the same bytes on every machine. A wrong entry costs time and nothing else.

/// The table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Stars of the map of faint light per pixel of the views from which on reading the map costs less than drawing them.
    pub map_from_stars_per_pixel: f64,
    /// Stars drawn from which on units of light finer than the faintest star asks for cost time: more of the others then take a second add.
    pub coarse_units_from_stars: u64,
}

/// Measured with llvmpipe on two cores (`docs/benchmarks.md`): reading the map costs a pixel what 0.3 stars cost, and below 50,000 stars second
/// adds are lost in what the pixels cost. On GPUs both ways are so fast that the choice hardly matters.
pub const BUILT_IN: Costs = Costs { map_from_stars_per_pixel: 0.3, coarse_units_from_stars: 50_000 };

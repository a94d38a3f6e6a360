//! Stars without an adapter.

mod bright_stars;
mod reference;

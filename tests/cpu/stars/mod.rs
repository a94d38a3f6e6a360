//! Tests of stars that need no adapter.

mod bright_stars;
mod reference;

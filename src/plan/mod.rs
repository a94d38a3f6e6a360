//! What is drawn how: settings that name methods, and the plan that a frame follows.

pub mod settings;

use serde::Serialize;

/// One approximation that a frame makes, with its bound.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Approximation {
    /// What is approximated.
    pub what: String,
    /// Bound of the error.
    pub bound: f64,
    /// Unit of the bound.
    pub unit: String,
}

/// The methods chosen for a frame, and what they cost in accuracy.
#[derive(Clone, Debug, PartialEq, Serialize, Default)]
pub struct FramePlan {
    /// Star method.
    pub stars: String,
    /// How splats add up.
    pub accumulator: String,
    /// Glare method.
    pub glare: String,
    /// Every approximation with its bound.
    pub certificate: Vec<Approximation>,
}

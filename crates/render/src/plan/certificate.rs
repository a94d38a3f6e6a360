//! The report of a frame: its methods by name, and the bounds of all approximations. Each technique adds its own.

use serde::Serialize;

use super::{audit::Audit, budget::ErrorBudget};

/// An approximation with the bound of its error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Approximation {
    /// Name of the approximated quantity.
    #[serde(rename = "what")]
    pub name: String,
    /// Bound of the error.
    pub bound: f64,
    /// Unit of the bound.
    pub unit: String,
    /// Limit of the bound, in the same unit. `None`: it has no limit.
    pub limit: Option<f64>,
    /// Whether the bound is within the limit; `None` if there is none.
    pub within_budget: Option<bool>,
}

impl Approximation {
    /// An approximation with the limit of its bound, in the unit of the bound, if there is one.
    pub fn new(name: &str, bound: f64, unit: &str, limit: Option<f64>) -> Self {
        Self {
            name: name.to_owned(),
            bound,
            unit: unit.to_owned(),
            limit,
            within_budget: limit.map(|limit| bound <= limit),
        }
    }
}

/// Stars of a deep store in a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeepReport {
    /// Number of stars and composite stars that were drawn, in view or near its border.
    pub stars: u64,
    /// Largest cell whose stars were drawn as a composite star, the root of its area, pixels; 0: every star was drawn.
    pub cell_px: f64,
    /// Number of pages (leaves and tiles) that the frame lacks because they have not been read yet.
    pub missing: u64,
    /// Bound of the luminance that a pixel may lack or have in excess because of missing pages, or because finer pages do not fit into memory,
    /// cd/m^2.
    pub residual_cd_m2: f64,
    /// The same bound in codes of an 8-bit display image.
    pub residual_codes: f64,
}

/// Methods of a frame, and bounds of their errors.
#[derive(Clone, Debug, PartialEq, Serialize, Default)]
pub struct FramePlan {
    /// Star method, as configured, and the resulting kernels.
    pub stars: String,
    /// Kind of sums.
    pub accumulator: String,
    /// Glare method.
    pub glare: String,
    /// Error that the images may have; `None`: they are exact.
    #[serde(skip)]
    pub budget: Option<ErrorBudget>,
    /// Every approximation with its bound.
    pub certificate: Vec<Approximation>,
    /// Stars of a deep store; `None`: the frame draws none itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deep: Option<DeepReport>,
    /// Result of comparing sampled pixels with f64, if `accuracy.audit` is set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub audit: Option<Audit>,
}

//! What is drawn how, as plain data in f64, with no GPU in sight: settings that name methods, and the plan that a frame follows.
//!
//! `settings` names the methods, `frame` makes the plan of a frame and `certificate` the bounds of its approximations, `audit` what comparing a frame with f64 has found. `exposure` finds the
//! exposure as far as it follows from the plan, `view_settings` which views are drawn together. `costs` says which of two ways that keep the budget is
//! taken, `tiles` cuts viewports into what the adapter can hold, `tables` spreads tables of pictures over buffers. Each technique has a folder: `stars` (culling, fixed-point ranges, kernels, motion, the
//! numbers of the methods that blend), `bodies`, `asteroids` and `glare`; `smooth_light` chooses the map of faint
//! stars.

pub mod adaptation;
pub mod asteroids;
pub mod audit;
pub mod bodies;
pub mod budget;
mod certificate;
pub mod costs;
mod error;
pub mod exposure;
mod frame;
pub mod glare;
mod headset;
mod limits;
pub mod overlay;
pub mod settings;
pub mod smooth_light;
pub mod stars;
pub(crate) mod tables;
pub mod tiles;
pub mod view_settings;

pub use budget::Output;
pub use certificate::{Approximation, FramePlan, StarPlan, plan_stars};
pub use error::PlanError;
pub use frame::{ExposureSource, GlarePlan, Plan, PlanOutputs, Planner, SkyUse, VeilInSums, check_together};
pub use limits::{DISPLAY_BYTES, Limits};
pub use stars::kernels::{
    BSPLINE_FLICKER, GAUSSIAN_FLICKER, GaussianKernel, GaussianWidth, KernelPlan, PLANE_GAUSSIAN_FLICKER,
    TENT_FLICKER_AT_WHITE, TENT_FLICKER_PER_PEAK, bspline_peak_within, gaussian_of,
};

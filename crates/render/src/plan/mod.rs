//! Decides how a frame is drawn, as plain data in f64, without a GPU.
//!
//! [`settings`] names the methods. `frame` makes the plan of a frame: `sequence` lists the techniques, each of which plans its own part through the
//! interface in `technique`. A technique's folder or file has the same name as in `crate::render`. `views` contains the viewports and tiles that all
//! techniques share, `kept` the results that several of them reuse.
//!
//! `methods` contains the decisions that follow from the settings alone, and those that are known before the first frame. `certificate` states the
//! bounds of all approximations, and `audit` the result of comparing a frame with f64. `view_settings` groups views that are drawn together. `costs`
//! chooses between two methods if both keep the error budget. `tiles` divides viewports into pieces that fit into a binding, and `tables` distributes
//! the tables of pictures over buffers.

pub mod adaptation;
mod air;
pub mod asteroids;
pub mod audit;
pub mod bodies;
pub mod budget;
mod certificate;
pub mod costs;
mod diffuse;
mod display;
mod error;
pub mod exposure;
mod frame;
pub mod glare;
pub mod grid_spacing;
mod headset;
mod kept;
mod limits;
mod methods;
pub mod overlay;
pub mod plain_blocks;
mod sequence;
pub mod settings;
pub mod smooth_light;
pub mod stars;
pub(crate) mod tables;
mod technique;
pub mod tiles;
pub mod view_settings;
mod views;

pub use air::{AirPlan, GRID_FROM_SINE};
pub use budget::Output;
pub use certificate::{Approximation, DeepReport, FramePlan};
pub use diffuse::DiffusePlan;
pub use display::DisplayPlan;
pub use error::PlanError;
pub use exposure::{ExposurePlan, MeteringPlan};
pub use frame::{ExposureSource, PlanOutputs, Planner, SkyUse, check_together};
pub use glare::{GlareMap, GlarePlan, VeilInSums};
pub use limits::{DISPLAY_BYTES, Limits};
pub use methods::{Forecast, Methods};
pub use plain_blocks::PlainBlocksPlan;
pub use sequence::Plan;
pub use smooth_light::SmoothLightPlan;
pub use stars::StarsPlan;
pub use stars::kernels::{
    BSPLINE_FLICKER, GAUSSIAN_FLICKER, GaussianKernel, GaussianWidth, KernelPlan, PLANE_GAUSSIAN_FLICKER,
    TENT_FLICKER_AT_WHITE, TENT_FLICKER_PER_PEAK, bspline_peak_within, gaussian_of,
};
pub use views::ViewsPlan;

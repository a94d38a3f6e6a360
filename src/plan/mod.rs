//! What is drawn how: settings that name methods, and the plan that a frame follows.
//!
//! `settings` names the methods, `tiles` cuts viewports into what the adapter can hold, `cull` finds the stars that may be
//! seen, `range` chooses the fixed-point units, `kernels` the kernel of each star, `billboard` and `cube_faces` hold the
//! numbers of the methods that blend, `bodies` adds up the light of bodies, `asteroids` says how fields of asteroids are drawn, `glare` the methods of glare, `glare_sky` what `sky_cube` works from, `glare_pyramid`
//! the numbers of the published methods of glare,
//! `travel` says what motion does to the light of stars, and `frame_plan` puts them together.

pub mod adaptation;
pub mod asteroids;
pub mod billboard;
pub mod bodies;
pub mod cube_faces;
pub mod cull;
mod frame_plan;
mod glare;
pub mod glare_pyramid;
pub mod glare_sky;
mod headset;
mod kernels;
pub mod object_glare;
pub mod overlay;
pub mod range;
pub mod settings;
mod star_method;
mod star_settings;
pub mod tiles;
pub mod travel;
pub mod view_bodies;

pub use frame_plan::{Approximation, FramePlan, StarPlan, plan_stars};
pub use kernels::{
    BSPLINE_FLICKER, GAUSSIAN_FLICKER, GaussianKernel, GaussianWidth, KernelPlan, PLANE_GAUSSIAN_FLICKER,
    TENT_FLICKER_AT_WHITE, TENT_FLICKER_PER_PEAK, bspline_peak_within, gaussian_of,
};

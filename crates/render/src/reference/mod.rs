//! CPU references in f64: twins of the passes under the same names, slow and simple, for checking the GPU and for
//! drawing with custom projections; and ground truths that every method is compared with.
//!
//! - `stars`: twins of the star passes: `splat` with `gaussian` (the kernel that is round in view space), `packed`,
//!   `billboards`, `cell_sky`, and `point_spread`, kernels as functions on the sphere;
//! - `bodies`: ellipsoids, ray by ray;
//! - `diffuse`: unresolved light;
//! - `air`: the ground and the air around an observer;
//! - `asteroids`: fields of asteroids, ray by ray against their meshes, and `impostors`;
//! - `glare`: light scattered in every direction, which `sky_cube` adds up source by source, and the published pyramids;
//! - `sky`: the exact sky, with each star spread by an exact kernel over exact solid angles, in any projection;
//! - `sampled`: chosen pixels of images, with the kernels and the glare of a frame: the reference of audits;
//! - `overlay`: lines and text over display images;
//! - `triangle_solid_angle`: a published computation of a pixel's solid angle, in the arithmetic of a shader.

pub mod air;
pub mod asteroids;
pub mod bodies;
pub mod diffuse;
pub mod glare;
pub mod overlay;
pub mod sampled;
pub mod sky;
pub mod stars;
pub mod triangle_solid_angle;

//! The passes in f64 on the CPU, under the same names: slow and simple, to check the GPU by and to draw through
//! projections of your own; and the truth that every method is measured against.
//!
//! - `stars`: twins of the star passes: `splat` with `gaussian` (the kernel that is round in view space), `packed`, `billboards`,
//!   `cell_sky`, and `point_spread`, kernels as functions on the sphere;
//! - `bodies`: ellipsoids, ray by ray;
//! - `diffuse`: light of no single star;
//! - `air`: the ground and the air around an observer;
//! - `asteroids`: fields of asteroids, ray by ray against their meshes, and `impostors`;
//! - `glare`: what light scatters into every direction, source by source, and the published pyramids;
//! - `sky`: the sky as it is, each star spread by an exact kernel over exact solid angles, in any projection;
//! - `sampled`: chosen pixels of images, with the kernels and the glare that frames are to have: what an audit compares with;
//! - `overlay`: lines and text over display images;
//! - `triangle_solid_angle`: a published way to a pixel's solid angle, in the arithmetic of a shader.

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

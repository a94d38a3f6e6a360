//! The passes in f64 on the CPU, under the same names: slow and simple, to check the GPU by and to draw through
//! projections of your own; and the truth that every method is measured against.
//!
//! - `stars`: the twin of the star and resolve passes, `gaussian` of the kernel that is round in view space;
//! - `bodies`: ellipsoids, ray by ray;
//! - `billboards` and `cell_sky`: the twins of the published methods;
//! - `glare_pyramid`: the twin of the published glare methods;
//! - `sky`: the sky as it is, each star spread by an exact kernel over exact solid angles, in any projection;
//! - `point_spread`: the kernels of that, as functions on the sphere;
//! - `glare`: what light scatters into every direction, source by source;
//! - `asteroids`: fields of asteroids, ray by ray against their meshes;
//! - `impostors`: atlases of asteroids, what a method shows of them, and the mesh itself;
//! - `overlay`: lines and text over display images;
//! - `triangle_solid_angle`: a published way to a pixel's solid angle, in the arithmetic of a shader.

pub mod asteroids;
pub mod billboards;
pub mod bodies;
pub mod cell_sky;
pub mod gaussian;
pub mod glare;
pub mod glare_pyramid;
pub mod impostors;
pub mod overlay;
pub mod packed;
pub mod point_spread;
pub mod sky;
pub mod stars;
pub mod triangle_solid_angle;

//! Stars in a plan: the visible ones, the kernel of each, and the units in which their light is summed.

pub mod billboards;
pub mod cell_sky;
mod certificate;
pub mod cube_faces;
pub mod cull;
pub mod deep;
pub mod identify;
pub(crate) mod kernels;
pub(crate) mod method;
pub mod range;
pub(crate) mod settings;
mod technique;
pub mod travel;

pub(super) use technique::Stars;
pub use technique::StarsPlan;

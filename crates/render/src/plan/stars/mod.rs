//! Stars in a plan: which may be seen, which kernel draws each, and the units that their light adds up in.

pub mod billboards;
pub mod cell_sky;
pub mod cube_faces;
pub mod cull;
pub mod identify;
pub(crate) mod kernels;
pub(crate) mod method;
pub mod range;
pub(crate) mod settings;
pub mod travel;

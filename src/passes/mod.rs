//! The passes of a frame on the GPU. Each has one shader in `shaders/` and one file here of the same name; none imports
//! another; what several need stands in `shared`. `frame` records them in order: stars, resolve, exposure, tone map, present.

pub(crate) mod asteroid_cull;
pub(crate) mod asteroid_impostor;
pub(crate) mod asteroid_mesh;
pub(crate) mod asteroid_points;
pub(crate) mod billboards;
pub(crate) mod exposure;
pub(crate) mod geometry;
pub(crate) mod glare_composite;
pub(crate) mod glare_pyramid;
pub(crate) mod glare_sky;
pub(crate) mod impostor_bake;
pub(crate) mod luminance;
pub(crate) mod packed;
pub(crate) mod points;
pub(crate) mod present;
pub(crate) mod resolve;
pub(crate) mod shared;
pub(crate) mod stars;
pub(crate) mod tone_map;

//! Views: projections, poses, and the flat list of viewports that a frame renders.

pub mod projection;

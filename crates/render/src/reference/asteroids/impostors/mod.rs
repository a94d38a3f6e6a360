//! Impostors of asteroids in f64: an atlas baked on the CPU, the picture that a method draws from it, and the mesh
//! itself.
//!
//! Lengths are in mean radii of the shape, axes are those of the view (+x right, +y up, looking along -z). `raster`
//! finds the visible point of a mesh for each sample, `bake` makes atlases, `picture` draws both.

mod bake;
mod picture;
mod raster;
#[cfg(test)]
pub(crate) mod test_shape;
#[cfg(test)]
mod tests;

pub use bake::{Atlas, Texel};
pub use picture::{Picture, Sight, impostor_picture, mesh_picture, normal_error_rad, silhouette_iou};

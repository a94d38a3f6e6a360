//! Errors of planning: no part of the frame has been drawn.

use super::overlay::OverlayPlanError;
use crate::{
    photometry::{glare::GlareKernelError, psf::PsfError},
    view::RigError,
};

/// Reason why a scene cannot be drawn in these views with these settings within these limits.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A view is larger than the adapter allows.
    #[error("view `{view}` has {width} x {height} pixels, but this adapter allows at most {limit} pixels per side")]
    TooLarge {
        /// The view's name.
        view: String,
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// The rig has more images than one frame can have.
    #[error("the views have {images} images in all, but one frame can have at most {limit}")]
    TooManyImages {
        /// Number of images.
        images: usize,
        /// The limit.
        limit: usize,
    },
    /// The images of all views together take too much memory.
    #[error(
        "view `{view}`: the pixels of all views up to this one take {bytes} bytes, but one frame can take at most {limit} bytes: use smaller or fewer views"
    )]
    TooManyPixels {
        /// The view that exceeds the limit.
        view: String,
        /// Bytes needed.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The tables of tabulated pictures do not fit.
    #[error(
        "view `{view}`: the tables of tabulated pictures take {bytes} bytes in all, but this adapter can hold at most {limit}: use smaller or fewer pictures"
    )]
    TooLargeTables {
        /// The view that exceeds the limit.
        view: String,
        /// Bytes needed.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// Kernels that are round on the sky extend beyond the cuts of a tabulated picture.
    #[error(
        "view `{view}`: stars.method = `{method}` spreads light over the sky, but a tabulated picture with a cut, or of the full sphere, has no directions beyond its edges: set the method to auto, bspline or tent"
    )]
    RoundKernelAtCut {
        /// The view's name.
        view: String,
        /// The star method.
        method: &'static str,
    },
    /// The kernels of stars reach beyond the directions of a tabulated picture.
    #[error(
        "view `{view}`: the kernels of stars.method = `{method}` reach {reach_px:.1} pixels, but a tabulated picture has directions only up to {limit_px} pixels beyond its border: make the kernels narrower"
    )]
    KernelBeyondTable {
        /// The view's name.
        view: String,
        /// The star method.
        method: &'static str,
        /// Reach, pixels.
        reach_px: f64,
        /// The limit.
        limit_px: f64,
    },
    /// The overlay has too many items for one frame.
    #[error("overlay: {0}")]
    Overlay(#[from] OverlayPlanError),
    /// The point-spread function of `psf_texture` cannot be computed or read.
    #[error("stars.psf_texture: {0}")]
    Psf(#[from] PsfError),
    /// A picture of a map of faint light cannot be a view.
    #[error("map of faint light: {0}")]
    Sky(#[from] RigError),
    /// The glare kernel cannot be computed or read.
    #[error("glare: {0}")]
    Glare(#[from] GlareKernelError),
    /// A published method cannot draw for a moving camera.
    #[error(
        "stars.method = `{0}` can draw only for a camera at rest: set scene.camera.velocity_c = [0, 0, 0], or set the method to auto, bspline, tent or pixel_gaussian"
    )]
    AtRestOnly(&'static str),
    /// A published method cannot draw the stars of a deep store.
    #[error(
        "stars.method = `{0}` cannot draw the stars of a deep store: set the method to auto, bspline, tent or pixel_gaussian, or remove the store"
    )]
    DeepMethod(&'static str),
    /// Stars of a deep store cannot be drawn for a moving camera.
    #[error(
        "the stars of a deep store can be drawn only for a camera at rest: set scene.camera.velocity_c = [0, 0, 0], or remove the store"
    )]
    DeepAtRest,
    /// Stars of a deep store do not fit in memory.
    #[error(
        "these views need {needed_mib} MiB for the stars of the deep store, but stars.memory is {memory_mib} MiB: raise it, turn every_star off, or set a \
         brighter stars.magnitude_limit"
    )]
    DeepMemory {
        /// Needed memory, MiB.
        needed_mib: u64,
        /// `stars.memory`, MiB.
        memory_mib: u64,
    },
    /// A part of a deep store cannot be read.
    #[error("{0}; set stars.skip_damaged = true to draw the rest of the store")]
    DeepDamaged(String),
    /// `sky_cube` needs the catalogue's stars, which the star method does not draw.
    #[error(
        "glare.method = `sky_cube` reads the catalogue, but stars.method = `{0}` draws none of its stars: set glare.method to auto, view_pyramid, screen_pyramid or none"
    )]
    GlareOfCatalogue(&'static str),
    /// The scene has too many asteroid fields.
    #[error("the scene has {fields} asteroid fields, but at most {limit} are allowed")]
    TooManyFields {
        /// Number of fields.
        fields: usize,
        /// Maximum number.
        limit: usize,
    },
    /// The fields of the scene have too many shapes.
    #[error("the asteroid fields have {shapes} shapes in all, but at most {limit} are allowed in a scene")]
    TooManyShapes {
        /// Number of shapes.
        shapes: usize,
        /// Maximum number.
        limit: usize,
    },
    /// The scene has more asteroids than the adapter can bind at once.
    #[error(
        "the fields have {asteroids} asteroids in all, but this adapter can bind at most {limit} at once ({bytes} bytes)"
    )]
    TooManyAsteroids {
        /// Number of asteroids.
        asteroids: u64,
        /// Maximum number.
        limit: u64,
        /// Maximum size of one binding, bytes.
        bytes: u64,
    },
    /// A set of shapes has more meshes than culling can count.
    #[error("field `{field}`: its shapes have {meshes} meshes at all levels of detail: at most {limit} are allowed")]
    TooManyMeshes {
        /// The field's name.
        field: String,
        /// Number of meshes.
        meshes: usize,
        /// Maximum number.
        limit: usize,
    },
    /// A field has no shape, or a shape has no mesh.
    #[error("field `{field}`: it needs at least one shape, and every shape at least one mesh with triangles")]
    NoShape {
        /// The field's name.
        field: String,
    },
    /// The lists of asteroids exceed the adapter's binding size.
    #[error(
        "the lists of all views need up to {needed} asteroids, but this adapter can hold at most {limit}: use fewer views or asteroids, or a lower asteroids.quality"
    )]
    AsteroidLists {
        /// Entries needed.
        needed: u64,
        /// Maximum number of entries.
        limit: u64,
    },
    /// A published star method draws only stars.
    #[error(
        "stars.method = `{0}` draws only stars: bodies, asteroid fields, and the ground and air of an observer need auto, bspline, tent or pixel_gaussian"
    )]
    StarsOnly(&'static str),
    /// Bodies and asteroids can be drawn only for a camera at rest.
    #[error(
        "bodies, asteroid fields, and the ground and air of an observer can be drawn only for a camera at rest: set scene.camera.velocity_c = [0, 0, 0], or remove them"
    )]
    ObjectsAtRest,
    /// The textures of bodies do not fit.
    #[error("the textures of the bodies take {bytes} bytes in all, but this adapter can bind at most {limit}")]
    TooManyTexels {
        /// Bytes needed.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
}

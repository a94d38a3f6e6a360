//! Why a mapping cannot be tabulated.

use super::super::ProjectionError;

/// Why a mapping cannot be tabulated: each names the place.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TabulationError {
    /// The size is impossible.
    #[error(transparent)]
    Size(#[from] ProjectionError),
    /// The picture is larger than a table can be.
    #[error("{width} x {height} pixels: a tabulated picture has at most {limit} pixels a side")]
    TooLarge {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// No pixel lies in the picture.
    #[error("no pixel of the picture has a direction")]
    Empty,
    /// A pixel's direction or solid angle is not finite, or the direction is no unit vector.
    #[error("pixel ({}, {}): {what}", pixel[0], pixel[1])]
    Value {
        /// Column and row.
        pixel: [u32; 2],
        /// What is wrong.
        what: String,
    },
    /// A pixel's solid angle is not what its directions span.
    #[error(
        "pixel ({}, {}): its solid angle is given as {given_sr:e} sr, but its directions span {spanned_sr:e} sr",
        pixel[0],
        pixel[1]
    )]
    SolidAngle {
        /// Column and row.
        pixel: [u32; 2],
        /// By the mapping.
        given_sr: f64,
        /// Between the middles of the pixel's sides.
        spanned_sr: f64,
    },
    /// The mapping turns its orientation: part of the picture is mirrored, part is not.
    #[error("pixel ({}, {}): the mapping folds here: one side of it is mirrored, the other is not", pixel[0], pixel[1])]
    Folded {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The direction of a pixel has its image elsewhere: two places of the picture show one direction, or both ways of the
    /// mapping do not belong together.
    #[error(
        "pixel ({}, {}): its direction is mapped to ({:.3}, {:.3}): the mapping folds, or is not the inverse of its other way",
        pixel[0],
        pixel[1],
        image[0],
        image[1]
    )]
    NotInverse {
        /// Column and row.
        pixel: [u32; 2],
        /// Where its direction has its image.
        image: [f64; 2],
    },
    /// Neighbouring pixels have directions far apart.
    #[error("pixel ({}, {}): the mapping is torn here: pixels side by side show different parts of the sky", pixel[0], pixel[1])]
    Torn {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The table gives another place than the mapping.
    #[error(
        "pixel ({}, {}): between the centres of pixels the table is {off_px:.3} px off (allowed: {limit_px} px): the mapping changes too fast here",
        pixel[0],
        pixel[1]
    )]
    Coarse {
        /// Column and row.
        pixel: [u32; 2],
        /// How far off.
        off_px: f64,
        /// What is allowed.
        limit_px: f64,
    },
    /// More than two pieces of the picture meet in one place of the sky.
    #[error("pixel ({}, {}): more than two pieces of the picture meet in its direction", pixel[0], pixel[1])]
    Junction {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The mapping says that it shows the full sphere, and does not.
    #[error("the mapping says that it shows the full sphere, but its pixels add up to {sum_sr} sr, not to 4 pi sr")]
    NotFullSphere {
        /// Sum over the pixels, sr.
        sum_sr: f64,
    },
}

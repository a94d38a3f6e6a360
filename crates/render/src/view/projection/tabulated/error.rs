//! Why a mapping cannot be tabulated.

use super::super::ProjectionError;

/// Reasons why a mapping cannot be tabulated. Each names the pixel.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TabulationError {
    /// The size is impossible.
    #[error(transparent)]
    Size(#[from] ProjectionError),
    /// The picture is larger than a table can be.
    #[error("{width} x {height} pixels: a tabulated picture can have at most {limit} pixels per side")]
    TooLarge {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// The picture is a single pixel or a line of pixels, and the mapping does not continue beyond it.
    #[error(
        "{width} x {height} pixels: a tabulated picture must have at least 2 pixels per side, or a mapping that continues beyond its border"
    )]
    TooSmall {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// No pixel lies in the picture.
    #[error("no pixel of the picture has a direction")]
    Empty,
    /// A pixel's direction or solid angle is not finite, or the direction is not a unit vector.
    #[error("pixel ({}, {}): {what}", pixel[0], pixel[1])]
    Value {
        /// Column and row.
        pixel: [u32; 2],
        /// The problem.
        what: String,
    },
    /// A pixel's solid angle disagrees with the one that its directions span.
    #[error(
        "pixel ({}, {}): its solid angle is {given_sr:e} sr, but its directions span {spanned_sr:e} sr",
        pixel[0],
        pixel[1]
    )]
    SolidAngle {
        /// Column and row.
        pixel: [u32; 2],
        /// Reported by the mapping.
        given_sr: f64,
        /// Spanned between the midpoints of the pixel's sides.
        spanned_sr: f64,
    },
    /// The orientation of the mapping changes: part of the picture is mirrored, part is not.
    #[error("pixel ({}, {}): the mapping folds here: one side of it is mirrored, the other is not", pixel[0], pixel[1])]
    Folded {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The direction of a pixel has its image elsewhere: two points of the picture show the same direction, or the two functions of the mapping are
    /// not inverse to each other.
    #[error(
        "pixel ({}, {}): the picture shows its direction {}: two parts of the picture show the same direction, or the mapping's two \
         functions are not inverse",
        pixel[0],
        pixel[1],
        where_shown(*image)
    )]
    NotInverse {
        /// Column and row.
        pixel: [u32; 2],
        /// Image of the pixel's direction; NaN without one.
        image: [f64; 2],
    },
    /// Neighbouring pixels have directions far apart.
    #[error("pixel ({}, {}): the mapping is torn here: neighbouring pixels show different parts of the sky", pixel[0], pixel[1])]
    Torn {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The table and the mapping disagree.
    #[error(
        "pixel ({}, {}): between the centres of pixels the table is {off_px:.3} px off (limit: {limit_px} px): the mapping changes too fast here",
        pixel[0],
        pixel[1]
    )]
    Coarse {
        /// Column and row.
        pixel: [u32; 2],
        /// Distance, px.
        off_px: f64,
        /// Largest allowed distance, px.
        limit_px: f64,
    },
    /// More than two pieces of the picture meet at one direction.
    #[error("pixel ({}, {}): more than two pieces of the picture meet in its direction", pixel[0], pixel[1])]
    Junction {
        /// Column and row.
        pixel: [u32; 2],
    },
    /// The mapping claims to show the full sphere, but does not.
    #[error("the mapping claims to show the full sphere, but its pixels add up to {sum_sr} sr, not to 4 pi sr")]
    NotFullSphere {
        /// Sum over the pixels, sr.
        sum_sr: f64,
    },
}

fn where_shown([x, y]: [f64; 2]) -> String {
    if x.is_nan() || y.is_nan() { "nowhere".to_owned() } else { format!("at ({x:.3}, {y:.3})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_that_is_shown_nowhere_has_no_position() {
        let text = |image| TabulationError::NotInverse { pixel: [0, 7], image }.to_string();
        assert!(text([f64::NAN; 2]).starts_with("pixel (0, 7): the picture shows its direction nowhere: "));
        assert!(text([1.5, 20.25]).starts_with("pixel (0, 7): the picture shows its direction at (1.500, 20.250): "));
    }
}

//! Metrics: how far an image is from the light that it should show. Tests, `verify` and `chart` judge every method by
//! these.
//!
//! Everything is f64 on the CPU and works on [`HdrView`]: the pixels of one image together with the mapping that made
//! them. Solid angles come from the mapping, never from the image, so that errors of a shader's solid angle are
//! detected. One file per metric:
//!
//! | file | metric | value for a perfect method |
//! |---|---|---|
//! | `flux` | sum of luminance times solid angle, compared with the light of the stars | 0 |
//! | `centroid` | centre of a star's light compared with its direction, in pixels or as an angle | 0 |
//! | `shape` | width and ellipticity of a star, in pixels or in view space | 0 (ellipticity) |
//! | `flicker` | standard deviation divided by mean of a star's sum while it pans, before and after tone mapping | 0 |
//! | `colour` | distance in CIE 1976 u'v' | 0 |
//! | `range` | light of a faint source next to a bright one | 0 |
//! | `order` | whether images of shuffled input agree bit for bit | identical |
//! | `glare` | fall-off around a source, evenness on a circle around it, light beyond an angle | as the kernel, 0, the scattered share |
//! | `silhouette` | coverage of two pictures: intersection over union, displacement of the outline | 1, 0 |
//! | `normals` | angle between the normals of two pictures, each reconstructed with three suns | 0 |
//! | `seam` | how a star's light varies while it crosses an edge | 0 |
//!
//! If a metric has no meaning (the ellipticity of a point, the colour of black), the result is an error or `None`, never 0. So a black or broken
//! image cannot pass as a good one.

mod centroid;
mod colour;
mod error;
mod flicker;
mod flux;
mod glare;
mod image;
mod moments;
mod normals;
mod order;
mod range;
mod seam;
mod shape;
mod silhouette;
#[cfg(test)]
mod synthetic;

pub use self::{
    centroid::{centroid_direction, centroid_error_px, centroid_error_rad, centroid_px},
    colour::{ColourDifference, colour_difference, uv_distance},
    error::MetricError,
    flicker::{Flicker, FlickerMeter, kernel_flicker, sub_pixel_positions},
    flux::{
        fitted_scale, illuminance_lx, illuminance_near_direction_lx, illuminance_near_pixel_lx, relative_flux_error,
        total_illuminance_lx,
    },
    glare::{
        Annulus, RelativeErrors, Roundness, log_log_slope, radial_profile, relative_errors, roundness,
        scattered_flux_lx,
    },
    image::{HdrView, Pixels},
    normals::{ThreeSuns, mean_normal_error_rad},
    order::{Difference, difference, order_dependence},
    range::{FaintBesideBright, PointSource, faint_beside_bright},
    seam::{relative_variation, seam_error},
    shape::{Shape, shape_px, shape_rad},
    silhouette::{Overlap, overlap},
};

//! An observer on the Earth: position and velocity in the Solar System at a moment, and the orientation of the
//! horizon.
//!
//! The horizon's axes are those of a camera that looks north: +x east, +y to the zenith (normal of the ellipsoid), -z
//! north. Azimuth counts from north through east.

mod clock;
mod moment;
mod place;
pub mod refraction;

pub use self::{
    clock::Clock,
    moment::{Frame, Moment, Observer, direction_of_camera, frame_from_camera},
    place::{Place, Standpoint, horizontal_direction},
    refraction::{RefractingAir, Refraction},
};

//! A place on the Earth at a moment: where its observer is among the planets, how fast, and how the horizon lies.
//!
//! Axes of the horizon are those of a camera that looks north: +x east, +y to the zenith (the normal of the ellipsoid), -z north. Azimuth counts from north through east.

mod clock;
mod moment;
mod place;
pub mod refraction;

pub use self::{
    clock::Clock,
    moment::{Frame, Moment, Observer, frame_from_camera},
    place::{Place, Standpoint, horizontal_direction},
    refraction::{RefractingAir, Refraction},
};

//! Tests of display images: exposure, metering and tone mapping.

mod exposure;
mod spot;
mod views;
mod wanted;

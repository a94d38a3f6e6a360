//! Sizes of the axis `asteroids` in a quick and in a full run.

use std::time::Duration;

use crate::chart::ViewShape;

/// Size of the axis `asteroids`.
#[derive(Clone, Debug, PartialEq)]
pub struct AsteroidExtent {
    /// Numbers of asteroids in the first view, increasing.
    pub instances: Vec<u32>,
    /// The views. The first one is timed with all of [`Self::instances`], each of the others with [`Self::other_views_instances`].
    pub views: Vec<ViewShape>,
    /// Number of asteroids in the other views.
    pub other_views_instances: u32,
    /// Number of asteroids for the ratios.
    pub ratio_instances: u32,
    /// Side of the pictures for the ratios, pixels.
    pub ratio_px: u32,
    /// Side of the pictures in which errors are measured, pixels.
    pub scored_px: u32,
    /// Maximum number of measured frames per method and workload.
    pub rounds: usize,
    /// Maximum time; the share of the whole run may be less.
    pub budget: Duration,
}

impl AsteroidExtent {
    /// Returns the size of a quick run.
    pub(in crate::chart) fn quick() -> Self {
        Self {
            instances: vec![1000, 5000, 20_000],
            views: vec![ViewShape::Flat([960, 540]), ViewShape::Stereo([360, 400]), ViewShape::Dome(512)],
            other_views_instances: 5000,
            ratio_instances: 20_000,
            ratio_px: 256,
            scored_px: 512,
            rounds: 2,
            budget: Duration::from_secs(45),
        }
    }

    /// Returns the size of a full run. It has the published numbers and more: up to one million on a software driver, and up to the binding limit on
    /// a GPU with dedicated memory.
    pub(in crate::chart) fn full(discrete_gpu: bool) -> Self {
        // If a frame with many asteroids is skipped, small fields show how the time grows. The number 100 thousand is among the published ones.
        let mut instances = if discrete_gpu { vec![100_000] } else { vec![10_000, 30_000, 100_000] };
        instances.extend((1..=8).map(|quarters| quarters * 250_000).chain([4_000_000]));
        if discrete_gpu {
            instances.extend([8_000_000, 16_000_000, 32_000_000, 64_000_000]);
        }
        Self {
            instances,
            views: vec![ViewShape::Flat([1920, 1080]), ViewShape::Stereo([1440, 1600]), ViewShape::Dome(2048)],
            other_views_instances: if discrete_gpu { 1_000_000 } else { 250_000 },
            ratio_instances: if discrete_gpu { 1_000_000 } else { 250_000 },
            ratio_px: if discrete_gpu { 1440 } else { 512 },
            scored_px: 768,
            rounds: if discrete_gpu { 11 } else { 3 },
            budget: Duration::from_secs(if discrete_gpu { 400 } else { 700 }),
        }
    }
}

//! How much the axis `asteroids` does, in a quick run and in a full one.

use std::{path::PathBuf, time::Duration};

use crate::chart::ViewShape;

/// How much the axis `asteroids` does.
#[derive(Clone, Debug, PartialEq)]
pub struct AsteroidExtent {
    /// Numbers of asteroids in the first view, growing.
    pub instances: Vec<u32>,
    /// The views: all of [`Self::instances`] in the first one, [`Self::other_views_instances`] in each of the others.
    pub views: Vec<ViewShape>,
    /// Number of asteroids in the other views.
    pub other_views_instances: u32,
    /// Number of asteroids of which ratios are taken.
    pub ratio_instances: u32,
    /// Side of the pictures of which ratios are taken, pixels.
    pub ratio_px: u32,
    /// Side of the pictures in which errors are measured, pixels.
    pub scored_px: u32,
    /// Measured frames of every method and workload, at most.
    pub rounds: usize,
    /// Time that it has at most, if it does not have less as a part of the whole run.
    pub budget: Duration,
    /// Where baked atlases are kept from run to run; empty: nowhere, then they are baked in every turn.
    pub cache: PathBuf,
}

impl AsteroidExtent {
    /// A small one for a quick run.
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
            cache: atlas_cache(),
        }
    }

    /// The numbers that were published, and further: on a software driver one, where there is a GPU with memory of its
    /// own up to what it binds.
    pub(in crate::chart) fn full(discrete_gpu: bool) -> Self {
        // Where a frame of many is not drawn, few tell how the time grows. 100 thousand were published too.
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
            cache: atlas_cache(),
        }
    }
}

/// Atlases take seconds to bake on a software driver and are the same in every run.
fn atlas_cache() -> PathBuf {
    std::env::temp_dir().join("steradian-chart-atlases")
}

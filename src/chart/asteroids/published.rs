//! Figures published with the method, quoted unchanged: whole frames per second on other hardware.

use crate::{
    chart::{AsteroidMetric, Axis, Row},
    plan::settings::MethodSource,
};

use super::workload::count_name;

/// Hardware of the published figures.
const ADAPTER: &str = "NVIDIA RTX A2000 6 GB + i7-9700";
const SIZE: [u32; 2] = [1920, 1080];
/// All features on: number of asteroids, frames per second.
const WHOLE: [(u32, f64); 8] = [
    (250_000, 97.0),
    (500_000, 83.0),
    (750_000, 72.0),
    (1_000_000, 60.0),
    (1_250_000, 51.0),
    (1_500_000, 38.0),
    (1_750_000, 27.0),
    (2_000_000, 16.0),
];

/// Returns one row per published figure.
pub fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = WHOLE.iter().map(|(count, fps)| row("published", *count, *fps, "")).collect();
    rows.push(row("published_mesh_only", 1_000_000, 25.0, "; without billboards, approximate"));
    rows.push(row("published_cpu_culling", 100_000, 20.0, "; culling on the CPU, meshes at levels of detail"));
    rows
}

fn row(method: &str, count: u32, fps: f64, suffix: &str) -> Row {
    Row {
        axis: Axis::Asteroids.name().to_owned(),
        method: method.to_owned(),
        source: MethodSource::AsteroidFieldRendering.name().to_owned(),
        workload: format!("{} asteroids {}p", count_name(count), SIZE[1]),
        adapter: ADAPTER.to_owned(),
        width: SIZE[0],
        height: SIZE[1],
        items: u64::from(count),
        gpu_ms_median: Some(1000.0 / fps),
        error_metric: AsteroidMetric::SilhouetteIou.name().to_owned(),
        notes: format!("published, other hardware: whole frames at {fps} per second{suffix}"),
        ..Row::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_figures_name_their_hardware() {
        let rows = rows();
        assert_eq!(rows.len(), 10);
        assert!(rows.iter().all(|row| row.adapter.contains("A2000") && row.notes.contains("other hardware")));
        let million = rows.iter().find(|row| row.method == "published" && row.items == 1_000_000);
        assert_eq!(million.and_then(|row| row.gpu_ms_median), Some(1000.0 / 60.0));
        assert!(rows.iter().all(|row| row.error_value.is_none() && row.gpu_ms_min.is_none()));
    }
}

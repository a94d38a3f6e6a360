//! `chart.csv`: one row per method, workload and error metric. A figure that does not apply or was not measured is an
//! empty cell.

use serde::{Deserialize, Serialize};

use super::ChartError;

/// Columns of `chart.csv`, in their order.
pub const COLUMNS: [&str; 14] = [
    "axis",
    "method",
    "source",
    "workload",
    "adapter",
    "width",
    "height",
    "items",
    "gpu_ms_median",
    "gpu_ms_min",
    "gpu_ms_max",
    "error_metric",
    "error_value",
    "notes",
];

/// A row of `chart.csv`.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Row {
    /// Name of the axis.
    pub axis: String,
    /// Name of the method.
    pub method: String,
    /// Origin of the method.
    pub source: String,
    /// Name of the workload.
    pub workload: String,
    /// Adapter on which the time was measured.
    pub adapter: String,
    /// Width of the (first) image, pixels.
    pub width: u32,
    /// Height of the (first) image, pixels.
    pub height: u32,
    /// Number of stars in the workload.
    pub items: u64,
    /// Median frame time, ms.
    pub gpu_ms_median: Option<f64>,
    /// Shortest time, ms.
    pub gpu_ms_min: Option<f64>,
    /// Longest time, ms.
    pub gpu_ms_max: Option<f64>,
    /// Name of the error metric.
    pub error_metric: String,
    /// Value of the error metric.
    pub error_value: Option<f64>,
    /// Remarks on this row.
    pub notes: String,
}

/// Returns the text of `chart.csv`. Numbers are written with all digits.
///
/// # Errors
/// [`ChartError::Csv`] for a figure that is not finite.
pub fn write_csv(rows: &[Row]) -> Result<String, ChartError> {
    let wrong = |error: &dyn std::fmt::Display| ChartError::Csv(error.to_string());
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    writer.write_record(COLUMNS).map_err(|error| wrong(&error))?;
    for row in rows {
        let figures = [row.gpu_ms_median, row.gpu_ms_min, row.gpu_ms_max, row.error_value];
        if let Some(figure) = figures.into_iter().flatten().find(|figure| !figure.is_finite()) {
            let Row { method, workload, error_metric, .. } = row;
            return Err(ChartError::Csv(format!(
                "{method}, {workload}, {error_metric}: {figure} is not a finite number"
            )));
        }
        writer.serialize(row).map_err(|error| wrong(&error))?;
    }
    let bytes = writer.into_inner().map_err(|error| wrong(&error))?;
    String::from_utf8(bytes).map_err(|error| wrong(&error))
}

/// Reads the text of a `chart.csv`.
///
/// # Errors
/// [`ChartError::Csv`] if the columns differ from [`COLUMNS`] or a cell has the wrong type.
pub fn read_csv(text: &str) -> Result<Vec<Row>, ChartError> {
    let wrong = |error: csv::Error| ChartError::Csv(error.to_string());
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let columns = reader.headers().map_err(wrong)?;
    if columns != COLUMNS[..] {
        let found: Vec<&str> = columns.iter().collect();
        return Err(ChartError::Csv(format!("columns {} instead of {}", found.join(","), COLUMNS.join(","))));
    }
    reader.deserialize().map(|row| row.map_err(wrong)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            axis: "stars".to_owned(),
            method: "tent".to_owned(),
            source: "steradian".to_owned(),
            workload: "1M anticentre-1080p".to_owned(),
            adapter: "llvmpipe (LLVM 15.0.6, 256 bits)".to_owned(),
            width: 1920,
            height: 1080,
            items: 1_000_000,
            gpu_ms_median: Some(17.25),
            gpu_ms_min: Some(16.0),
            gpu_ms_max: Some(30.5),
            error_metric: "flicker_k10".to_owned(),
            error_value: Some(0.1),
            notes: "says \"so\", twice".to_owned(),
        }
    }

    #[test]
    fn header_has_the_documented_columns() {
        let text = write_csv(&[]).unwrap();
        assert_eq!(
            text,
            "axis,method,source,workload,adapter,width,height,items,gpu_ms_median,gpu_ms_min,gpu_ms_max,\
             error_metric,error_value,notes\n"
        );
    }

    #[test]
    fn rows_round_trip_with_empty_cells() {
        let missing = Row { gpu_ms_median: None, gpu_ms_min: None, gpu_ms_max: None, error_value: None, ..row() };
        let text = write_csv(&[row(), missing.clone()]).unwrap();
        assert!(text.lines().nth(2).unwrap().contains(",1000000,,,,flicker_k10,,"), "{text}");
        assert_eq!(read_csv(&text).unwrap(), [row(), missing]);
    }

    #[test]
    fn non_finite_figures_are_refused() {
        let error = write_csv(&[Row { error_value: Some(f64::NAN), ..row() }]).unwrap_err().to_string();
        assert!(error.contains("tent") && error.contains("NaN"), "{error}");
        assert!(write_csv(&[Row { gpu_ms_max: Some(f64::INFINITY), ..row() }]).is_err());
    }

    #[test]
    fn wrong_columns_and_malformed_cells_are_refused() {
        let text = write_csv(&[row()]).unwrap();
        assert!(read_csv(&text.replacen("gpu_ms_min", "gpu_ms_least", 1)).is_err());
        assert!(read_csv(&text.replacen("1920", "wide", 1)).is_err());
        assert!(read_csv("").is_err());
    }
}

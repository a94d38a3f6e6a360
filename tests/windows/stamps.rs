//! Sky stamps: the director turns the camera, so that one bright star is in another column in every frame. One image of the X server shows a line over all
//! windows at one moment; the columns of the star identify the frame that each window shows.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use steradian::service::{CameraUpdate, Client, ClientError, Lease};

use crate::desktop::Desktop;

/// Catalogue of one star ahead of the camera.
pub const STAR: &str = "ra_deg,dec_deg,v_mag\n0.0,-90.0,-1.0\n";

/// Codes below this do not belong to the star.
const DARK: u8 = 60;
/// Columns that differ by less than this belong to the same frame, pixels.
const SAME_PX: f64 = 0.5;

/// Windows next to each other at the upper edge of the desktop.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Width of each window, pixels.
    pub width: u16,
    pub windows: u16,
    /// First of the rows that contain the star, and number of these rows.
    pub rows: [u16; 2],
}

/// The columns of the star in all windows at one moment. A column is `None` if the star is not visible.
#[derive(Clone, Debug)]
pub struct Sample {
    pub at: Duration,
    pub columns: Vec<Option<f64>>,
}

/// Returns the brightness-weighted centre of a row of pixels.
fn centre(codes: impl Iterator<Item = u8>) -> Option<f64> {
    let (mut sum, mut moment) = (0.0, 0.0);
    for (column, code) in codes.enumerate().filter(|(_, code)| *code >= DARK) {
        sum += f64::from(code);
        moment += f64::from(code) * column as f64;
    }
    (sum > 0.0).then(|| moment / sum)
}

/// Reads the windows about once per millisecond for this length of time.
pub fn samples(desktop: &Desktop, line: Line, length: Duration) -> Vec<Sample> {
    let (begin, mut samples) = (Instant::now(), Vec::new());
    let width = usize::from(line.width);
    while begin.elapsed() < length {
        let at = begin.elapsed();
        let pixels = desktop.pixels([0, line.rows[0] as i16], [line.width * line.windows, line.rows[1]]);
        let brightest = |column: usize| {
            let row = |row: usize| pixels.codes[row * pixels.size[0] + column];
            (0..pixels.size[1]).flat_map(row).max().unwrap_or(0)
        };
        let columns =
            (0..usize::from(line.windows)).map(|window| centre((0..width).map(|x| brightest(window * width + x))));
        samples.push(Sample { at, columns: columns.collect() });
        std::thread::sleep(Duration::from_millis(1).saturating_sub(begin.elapsed() - at));
    }
    samples
}

/// Result of comparing the samples of some windows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Frames that all windows showed.
    pub frames: usize,
    /// Number of periods in which windows showed different frames.
    pub transitions: usize,
    /// Duration of each transition, from its first to its last sample, ms.
    pub lasted_ms: Vec<f64>,
    /// Number of transitions in which a window showed neither the previous nor the next common frame, but one that only some windows showed.
    pub mixed: usize,
}

impl Verdict {
    /// Number of transitions that lasted at least this time, ms.
    pub fn longer_than(&self, ms: f64) -> usize {
        self.lasted_ms.iter().filter(|lasted| **lasted >= ms).count()
    }

    /// Compares some of the windows. Samples before the first common frame and after the last one are not counted.
    pub fn of(samples: &[Sample], windows: &[usize]) -> Self {
        let is_same = |one: Option<f64>, other: Option<f64>| match (one, other) {
            (Some(one), Some(other)) => (one - other).abs() < SAME_PX,
            (None, None) => true,
            _ => false,
        };
        let common = |sample: &Sample| {
            let first = sample.columns[windows[0]];
            windows.iter().all(|window| is_same(sample.columns[*window], first)).then_some(first)
        };
        let mut verdict = Self::default();
        let mut before: Option<Option<f64>> = None;
        let mut differing: Vec<&Sample> = Vec::new();
        for sample in samples {
            let Some(after) = common(sample) else {
                if before.is_some() {
                    differing.push(sample);
                }
                continue;
            };
            if let (Some(first), Some(last)) = (differing.first(), differing.last()) {
                verdict.transitions += 1;
                verdict.lasted_ms.push((last.at - first.at).as_secs_f64() * 1e3);
                let is_known = |column: Option<f64>| {
                    is_same(column, after) || before.is_some_and(|before| is_same(column, before))
                };
                let all = differing.iter().flat_map(|sample| windows.iter().map(|window| sample.columns[*window]));
                verdict.mixed += usize::from(!all.into_iter().all(is_known));
            }
            if before.is_none_or(|before| !is_same(before, after)) {
                verdict.frames += 1;
            }
            before = Some(after);
            differing.clear();
        }
        // If the windows never show a common frame again, this counts as mixed too.
        verdict.mixed += usize::from(differing.len() > 1 && before.is_some());
        verdict
    }
}

/// Turns the camera of a daemon until the daemon ends. The angle is a function of the machine's time: it grows steadily, and jumps back when it
/// exceeds `sweep_rad`.
pub async fn turn(mut client: Client, rad_s: f64, sweep_rad: f64) -> Result<(), ClientError> {
    let mut steering = client.steer(Lease::None, "").await?;
    loop {
        let time = SystemTime::now() + Duration::from_millis(300);
        let since_s = time.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let half_rad = ((since_s * rad_s).rem_euclid(sweep_rad) - sweep_rad / 2.0) / 2.0;
        let orientation = Some([0.0, half_rad.sin(), 0.0, half_rad.cos()]);
        if !steering.send_for(&CameraUpdate { orientation, ..CameraUpdate::default() }, time).await {
            return steering.end().await.map(drop);
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

//! Three hundred frames on the simulated headset.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use steradian::xr::{HeadsetFrame, HeadsetStatistics, Status};

use crate::monado::{Monado, Service};

/// Number of frames that the program renders.
pub const FRAMES: u64 = 300;
/// Time limit. The runtime requests some 60 frames per second.
const LIMIT: Duration = Duration::from_secs(120);
/// Configuration of the scene.
pub const SCENE: &str = "";

/// Values that the program observes.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Observations {
    /// Name and version of the runtime, and name of the system.
    runtime: String,
    system: String,
    adapter: String,
    sizes: [[u32; 2]; 2],
    /// States of the session in order.
    states: Vec<String>,
    /// Edges of the fields of view of the first frame, rad.
    fovs_rad: Vec<[f64; 4]>,
    /// Smallest and largest distance between the eyes over all frames, m.
    between_eyes_m: Option<[f64; 2]>,
    /// Number of requested frames and of drawn frames.
    frames: u64,
    drawn: u64,
    /// Whether the time between two frames was always positive.
    display_times_rise: bool,
    last_display_ns: Option<i64>,
    /// Statistics of the headset: counts, and distributions of times by name (median, 95th percentile, maximum), ms.
    counts: Counts,
    times_ms: Vec<(String, [f64; 3])>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Counts {
    sessions: u64,
    losses: u64,
    frames: u64,
    rendered: u64,
    not_wanted: u64,
    missed: u64,
    recentred: u64,
    period_ms: f64,
}

impl Observations {
    pub fn frame(&mut self, frame: &HeadsetFrame) {
        self.frames += 1;
        let rises = self.last_display_ns.is_none_or(|last| frame.display_time_ns > last);
        self.display_times_rise = rises && (self.frames == 1 || self.display_times_rise);
        self.last_display_ns = Some(frame.display_time_ns);
        let Some([left, right]) = &frame.eyes else { return };
        self.drawn += 1;
        if self.fovs_rad.is_empty() {
            self.fovs_rad =
                [left, right].map(|eye| [eye.fov.left_rad, eye.fov.right_rad, eye.fov.up_rad, eye.fov.down_rad]).into();
        }
        let distance_m = (right.position_m - left.position_m).length();
        let [least, most] = self.between_eyes_m.unwrap_or([distance_m; 2]);
        self.between_eyes_m = Some([least.min(distance_m), most.max(distance_m)]);
    }

    pub fn status(&mut self, status: Status) {
        let Status::Connected { runtime, system, state, sizes, adapter, problem } = status else { return };
        assert_eq!(problem, None, "no frame is left out");
        (self.runtime, self.system, self.sizes, self.adapter) = (runtime, system, sizes, adapter);
        if self.states.last().is_none_or(|last| last != state) {
            self.states.push(state.to_owned());
        }
    }

    pub fn statistics(&mut self, figures: &HeadsetStatistics) {
        let &HeadsetStatistics { sessions, losses, frames, rendered, not_wanted, missed, recentred, period_ms, .. } =
            figures;
        self.counts = Counts { sessions, losses, frames, rendered, not_wanted, missed, recentred, period_ms };
        let ages = [("pose age at submission", Some(figures.pose_age_at_submission))]
            .into_iter()
            .chain([("pose age at display", figures.pose_age_at_display)]);
        let ages = ages.filter_map(|(name, spread)| Some((name, spread?)));
        let spreads = ages.chain(figures.stages.iter().copied());
        self.times_ms = spreads
            .map(|(name, distribution)| {
                (name.to_owned(), [distribution.median_ms, distribution.p95_ms, distribution.max_ms])
            })
            .collect();
    }
}

/// Runs a whole session under the core validation layer, from its creation to the end that the program requests.
pub fn three_hundred_frames(monado: &'static Monado) {
    let service = Service::simulated(monado);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("validation.txt");
    let printed = service.run(service.validated(&mut service.inner("show_frames"), &log), LIMIT);
    let observed: Observations = serde_json::from_str(&printed.unwrap_or_else(|error| panic!("{error}"))).unwrap();
    println!("{}, {}, on {}; {:?} px", observed.runtime, observed.system, observed.adapter, observed.sizes);
    println!(
        "states {:?}; fields of view {:.3?} rad; {:.4?} m apart",
        observed.states, observed.fovs_rad, observed.between_eyes_m
    );
    println!("{:?}", observed.counts);
    for (name, [median, p95, most]) in &observed.times_ms {
        println!("{name}: median {median:.2} ms, 95 % below {p95:.2}, at most {most:.2}");
    }
    assert_eq!(Service::complaints(&log), Vec::<String>::new());

    assert!(observed.runtime.starts_with("Monado") && observed.runtime.contains("25."), "{}", observed.runtime);
    assert!(observed.system.contains("Simulated HMD"), "{}", observed.system);
    // States that the session passes through within one step are not observed.
    assert!(observed.states.iter().any(|state| state == "focused"), "{:?}", observed.states);
    assert_eq!(observed.fovs_rad.len(), 2);
    for [left, right, up, down] in &observed.fovs_rad {
        assert!((-1.5..-0.2).contains(left) && (0.2..1.5).contains(right), "{left} {right}");
        assert!((-1.5..-0.2).contains(down) && (0.2..1.5).contains(up), "{down} {up}");
    }
    let [least_m, most_m] = observed.between_eyes_m.unwrap();
    assert!(least_m > 0.05 && most_m < 0.08 && most_m - least_m < 1e-5, "{least_m} {most_m}");

    // Every frame is either drawn or not wanted, and none is counted twice.
    let counts = &observed.counts;
    assert!(observed.drawn >= FRAMES, "{}", observed.drawn);
    assert_eq!((counts.sessions, counts.losses, counts.recentred), (1, 0, 0));
    assert_eq!((counts.frames, counts.rendered), (observed.frames, observed.drawn));
    assert_eq!(counts.frames, counts.rendered + counts.not_wanted);
    assert!(observed.display_times_rise && counts.period_ms > 0.0);
    for name in ["pose age at submission", "pose age at display", "wait", "acquire", "draw", "end", "gpu"] {
        let (_, [median, p95, most]) = observed.times_ms.iter().find(|(known, _)| known == name).unwrap();
        assert!(*median > 0.0 && median <= p95 && p95 <= most, "{name}: {median} {p95} {most}");
    }
}

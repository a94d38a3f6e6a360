//! Size of the axis `live` in a quick and in a full run.
//!
//! The configurations of the repository are embedded in the program, so that a chart can be made anywhere.

use std::time::Duration;

/// A configuration: name, text, and measured views.
type Scene = (&'static str, &'static str, &'static [&'static str]);

/// The configurations.
const SCENES: [Scene; 4] = [
    ("tonight", include_str!("../../../configs/tonight.toml"), &["dome", "south"]),
    ("dome", include_str!("../../../configs/dome.toml"), &["dome"]),
    ("demo", include_str!("../../../configs/demo.toml"), &["dome"]),
    ("mission-control", include_str!("../../../configs/mission-control.toml"), &["ahead"]),
];

/// A configuration of the axis `live`.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveScene {
    /// Name.
    pub name: String,
    /// The configuration, TOML; it names no files.
    pub text: String,
    /// Names of the measured views.
    pub views: Vec<String>,
    /// Budgets of display images, 8-bit codes, ascending.
    pub budgets_codes: Vec<f64>,
    /// Overrides of keys, `key=value`.
    pub set: Vec<String>,
}

impl LiveScene {
    /// Returns the overrides of keys, including that of a budget in 8-bit codes.
    pub(super) fn overrides(&self, codes: f64) -> Vec<String> {
        let budget = format!("accuracy.display_codes={codes:?}");
        self.set.iter().cloned().chain([budget]).collect()
    }
}

/// Size of the axis `live`.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveExtent {
    /// The configurations.
    pub scenes: Vec<LiveScene>,
    /// Maximum number of rounds.
    pub rounds: usize,
    /// Length of a round of one view.
    pub round: Duration,
    /// Number of poses at which errors are measured.
    pub poses: usize,
    /// Time after which no further round starts; the share of the whole run may be less.
    pub budget: Duration,
}

impl LiveExtent {
    fn new(
        budgets_codes: [&[f64]; SCENES.len()],
        rounds: usize,
        round: Duration,
        poses: usize,
        budget: Duration,
    ) -> Self {
        let scene = |((name, text, views), budgets_codes): (Scene, &[f64])| LiveScene {
            name: name.to_owned(),
            text: text.to_owned(),
            views: views.iter().map(|view| (*view).to_owned()).collect(),
            budgets_codes: budgets_codes.to_vec(),
            set: Vec::new(),
        };
        Self { scenes: SCENES.into_iter().zip(budgets_codes).map(scene).collect(), rounds, round, poses, budget }
    }

    /// Returns the size of a quick run. The daemons need half of its time to start, so most configurations have only two budgets.
    pub(in crate::chart) fn quick() -> Self {
        let two: &[f64] = &[0.5, 2.0];
        Self::new([two, two, &[0.5], two], 2, Duration::from_millis(700), 2, Duration::from_secs(100))
    }

    /// Returns the size of a full run.
    pub(in crate::chart) fn full() -> Self {
        Self::new([&[0.25, 0.5, 1.0, 2.0]; SCENES.len()], 5, Duration::from_secs(3), 4, Duration::from_secs(600))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use std::path::Path;

    #[test]
    fn configurations_are_valid_without_their_folder() {
        for scene in LiveExtent::quick().scenes {
            let config = Config::from_text(&scene.text, &scene.name, Path::new(""), &scene.overrides(0.25)).unwrap();
            assert_eq!(config.accuracy.display_codes, 0.25);
            assert!(config.named_files().is_empty(), "{}", scene.name);
            let rig = config.rig().unwrap();
            for name in &scene.views {
                assert!(rig.views().iter().any(|view| view.name == *name), "{} {name}", scene.name);
            }
        }
    }
}

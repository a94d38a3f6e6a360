//! Values of a path at each frame. Every quantity has a separate track through the keyframes that name it; a quantity
//! that no keyframe names comes from the configuration.
//!
//! Around a place (`around_m`) the logarithm of the distance is interpolated, and the direction along great arcs, so
//! that a flight over many orders of magnitude appears uniform. Fields of view are interpolated in the logarithm of the
//! picture's size on its plane, for the same reason.

use glam::{DQuat, DVec3};

use super::spline::{Track, Turns};
use crate::config::{
    Config, ConfigError, Easing, ExposureKey, FilmPath, FovKey, FovSpec, FrameValues, Keyframe, ViewKindSpec,
};
use crate::observer::Frame;
use crate::plan::settings::{ExposureMode, ExposureSettings};
use crate::scene::{Camera, PoseError};

/// Tracks of the camera's position.
#[derive(Clone, Debug)]
enum Positions {
    Straight(Track<3>),
    Around {
        around_m: DVec3,
        /// Positions of the keyframes, m.
        keyframes_m: Vec<DVec3>,
        frames: Vec<u32>,
        /// Logarithm of the distance in m.
        distances: Track<1>,
        /// Rotations of +x to the directions.
        directions: Turns,
    },
}

/// A number for which a function of it is interpolated. At keyframes, the original values are used.
#[derive(Clone, Debug)]
struct Scaled<T> {
    values: Vec<T>,
    track: Track<1>,
}

/// Tracks of all quantities.
#[derive(Clone, Debug)]
pub struct FilmTracks {
    positions: Option<Positions>,
    orientations: Option<Turns>,
    times_s: Option<Track<1>>,
    fovs: Option<Scaled<FovKey>>,
    exposures: Option<Track<1>>,
    /// Whether exposures are exposure values rather than compensations.
    is_fixed: bool,
    magnitudes: Option<Track<1>>,
    velocities_c: Option<Track<3>>,
}

/// Returns the keyframes that name a quantity.
fn naming<T>(
    keyframes: &[Keyframe],
    quantity: impl Fn(&FrameValues) -> Option<T>,
) -> impl Iterator<Item = (u32, T, Easing)> {
    keyframes.iter().filter_map(move |keyframe| Some((keyframe.frame, quantity(&keyframe.values)?, keyframe.easing)))
}

fn scalars(keyframes: &[Keyframe], quantity: impl Fn(&FrameValues) -> Option<f64>) -> Option<Track<1>> {
    Track::new(naming(keyframes, |values| quantity(values).map(|value| [value])))
}

fn vectors(keyframes: &[Keyframe], quantity: impl Fn(&FrameValues) -> Option<DVec3>) -> Option<Track<3>> {
    Track::new(naming(keyframes, |values| quantity(values).map(|value| value.to_array())))
}

impl Positions {
    fn new(path: &FilmPath) -> Option<Self> {
        let Some(around_m) = path.around_m else {
            return vectors(&path.keyframes, |values| values.position_m).map(Self::Straight);
        };
        let named: Vec<(u32, DVec3, Easing)> = naming(&path.keyframes, |values| values.position_m).collect();
        let distance_m = |position_m: DVec3| (position_m - around_m).length();
        let distances =
            Track::new(named.iter().map(|&(frame, at_m, easing)| (frame, [distance_m(at_m).ln()], easing)))?;
        // Each rotation is the previous one followed by the shortest arc to the next direction, so that the path
        // between directions follows great circles.
        let mut directions: Vec<(u32, DQuat, Easing)> = Vec::with_capacity(named.len());
        let mut last = (DVec3::X, DQuat::IDENTITY);
        for &(frame, at_m, easing) in &named {
            let direction = (at_m - around_m).try_normalize().unwrap_or(DVec3::X);
            last = (direction, (DQuat::from_rotation_arc(last.0, direction) * last.1).normalize());
            directions.push((frame, last.1, easing));
        }
        Some(Self::Around {
            around_m,
            keyframes_m: named.iter().map(|(_, at_m, _)| *at_m).collect(),
            frames: named.iter().map(|(frame, ..)| *frame).collect(),
            distances,
            directions: Turns::new(directions)?,
        })
    }

    fn position_m(&self, frame: f64) -> DVec3 {
        match self {
            Self::Straight(track) => DVec3::from_array(track.at(frame)),
            Self::Around { around_m, keyframes_m, frames, distances, directions } => {
                let (knot, [offset]) = distances.offset(frame);
                let [first, last] = [frames[0], frames[frames.len() - 1]].map(f64::from);
                if f64::from(frames[knot]) == frame || frame < first || frame >= last {
                    return keyframes_m[knot];
                }
                let distance_m = (keyframes_m[knot] - around_m).length() * offset.exp();
                around_m + directions.at(frame) * DVec3::X * distance_m
            }
        }
    }
}

fn fov_track(keyframes: &[Keyframe]) -> Option<Scaled<FovKey>> {
    let named: Vec<(u32, FovKey, Easing)> = naming(keyframes, |values| values.fov).collect();
    let size = |fov: FovKey| match fov {
        FovKey::Scale(scale) => scale,
        FovKey::YDeg(deg) => (0.5 * deg.to_radians()).tan(),
    };
    let track = Track::new(named.iter().map(|&(frame, fov, easing)| (frame, [size(fov).ln()], easing)))?;
    Some(Scaled { values: named.into_iter().map(|(_, fov, _)| fov).collect(), track })
}

impl Scaled<FovKey> {
    fn at(&self, frame: f64) -> FovKey {
        let (knot, [offset]) = self.track.offset(frame);
        match self.values[knot] {
            values if offset == 0.0 => values,
            FovKey::Scale(scale) => FovKey::Scale(scale * offset.exp()),
            FovKey::YDeg(deg) => {
                FovKey::YDeg((2.0 * ((0.5 * deg.to_radians()).tan() * offset.exp()).atan()).to_degrees())
            }
        }
    }
}

impl FilmTracks {
    /// Returns the tracks through the keyframes of a path.
    pub fn new(path: &FilmPath) -> Self {
        let keyframes = &path.keyframes;
        let exposure = |values: &FrameValues| match values.exposure? {
            ExposureKey::Ev100(value) | ExposureKey::CompensationEv(value) => Some(value),
        };
        Self {
            positions: Positions::new(path),
            orientations: Turns::new(naming(keyframes, |values| values.frame_from_camera)),
            times_s: scalars(keyframes, |values| values.time_s),
            fovs: fov_track(keyframes),
            exposures: scalars(keyframes, exposure),
            is_fixed: keyframes.iter().any(|keyframe| matches!(keyframe.values.exposure, Some(ExposureKey::Ev100(_)))),
            magnitudes: scalars(keyframes, |values| values.magnitude_limit),
            velocities_c: vectors(keyframes, |values| values.velocity_c),
        }
    }

    /// Returns the values at a frame.
    pub fn at(&self, frame: u32) -> FrameValues {
        self.at_moment(f64::from(frame))
    }

    /// Returns the values at a moment, in frames.
    pub fn at_moment(&self, moment: f64) -> FrameValues {
        let number = |track: &Option<Track<1>>| track.as_ref().map(|track| track.at(moment)[0]);
        let exposure = if self.is_fixed { ExposureKey::Ev100 } else { ExposureKey::CompensationEv };
        FrameValues {
            position_m: self.positions.as_ref().map(|positions| positions.position_m(moment)),
            frame_from_camera: self.orientations.as_ref().map(|turns| turns.at(moment)),
            time_s: number(&self.times_s),
            fov: self.fovs.as_ref().map(|fovs| fovs.at(moment)),
            exposure: number(&self.exposures).map(exposure),
            magnitude_limit: number(&self.magnitudes),
            velocity_c: self.velocities_c.as_ref().map(|track| DVec3::from_array(track.at(moment))),
        }
    }
}

/// Checks that the views and the exposure of a configuration have every quantity that a path names.
///
/// # Errors
///
/// The message names the path file, the key and the requirement.
pub fn check_with(path: &FilmPath, config: &Config) -> Result<(), ConfigError> {
    let fault = |key: &str, problem: String| {
        let origin = path.origin.clone();
        Err(ConfigError::Key { origin, key: format!("keyframes.{key}"), problem })
    };
    let perspective = |by_edges: bool| {
        config.views.iter().any(|view| match &view.geometry.kind {
            ViewKindSpec::Perspective(view) => by_edges || view.fov_y_deg.is_some(),
            _ => false,
        })
    };
    if path.frame == Frame::Horizon && config.observer().is_none() {
        return fault("look.frame", format!("horizon: {} has no [scene.observer]", config.origin));
    }
    for keyframe in &path.keyframes {
        match keyframe.values.fov {
            Some(FovKey::Scale(_)) if !perspective(true) => {
                return fault(
                    "fov_scale",
                    format!("{} has no perspective view, which this key requires", config.origin),
                );
            }
            Some(FovKey::YDeg(_)) if !perspective(false) => {
                let problem = "has no perspective view with fov_y_deg, which this key requires";
                return fault("fov_y_deg", format!("{} {problem}", config.origin));
            }
            _ => {}
        }
        if matches!(keyframe.values.exposure, Some(ExposureKey::CompensationEv(_)))
            && config.exposure.mode() == ExposureMode::Manual
        {
            let problem = "has no effect with mode = \"manual\"";
            return fault(
                "compensation_ev",
                format!("{problem} in {}: use ev100, or set mode = \"auto\"", config.origin),
            );
        }
    }
    Ok(())
}

fn scaled_deg(angle_deg: f64, scale: f64) -> f64 {
    (angle_deg.to_radians().tan() * scale).atan().to_degrees()
}

impl FrameValues {
    /// Returns the camera of a frame; `config_camera` is the camera of the configuration, and `icrs_from_frame` maps the
    /// path's axes to ICRS axes.
    ///
    /// # Errors
    ///
    /// The velocity is too high to be drawn, which is possible between two keyframes.
    pub fn camera(&self, config_camera: &Camera, icrs_from_frame: DQuat) -> Result<Camera, PoseError> {
        let position_m = self.position_m.unwrap_or(config_camera.position_m);
        let orientation =
            self.frame_from_camera.map_or(config_camera.world_from_camera, |turned| icrs_from_frame * turned);
        let velocity_c = self.velocity_c.unwrap_or(config_camera.velocity_c);
        Camera::new(position_m.to_array(), orientation.to_array(), velocity_c.to_array())
    }

    /// Returns the configuration of a frame. It does not include the camera and the time, for which the types of the configuration are less precise
    /// than those of the path.
    pub fn applied_to(&self, config: &Config) -> Config {
        let mut config = config.clone();
        if let Some(limit) = self.magnitude_limit {
            config.stars.magnitude_limit = limit;
        }
        match self.exposure {
            Some(ExposureKey::Ev100(ev100)) => {
                config.exposure = ExposureSettings::manual(ev100);
                // The path's exposure applies to every view.
                for view in &mut config.views {
                    (view.exposure, view.exposure_group) = (None, None);
                }
            }
            Some(ExposureKey::CompensationEv(ev)) => {
                if let ExposureSettings::Auto(auto) = &mut config.exposure {
                    auto.compensation_ev = ev;
                }
            }
            None => {}
        }
        let Some(fov) = self.fov else { return config };
        for view in &mut config.views {
            let ViewKindSpec::Perspective(perspective) = &mut view.geometry.kind else { continue };
            if let Some(own_deg) = perspective.fov_y_deg {
                let deg = match fov {
                    FovKey::Scale(scale) => 2.0 * scaled_deg(0.5 * own_deg, scale),
                    FovKey::YDeg(deg) => deg,
                };
                perspective.fov_y_deg = Some(deg);
            }
            if let (Some(edges), FovKey::Scale(scale)) = (&mut perspective.fov, fov) {
                let FovSpec { left_deg, right_deg, up_deg, down_deg } = edges;
                for edge in [left_deg, right_deg, up_deg, down_deg] {
                    *edge = scaled_deg(*edge, scale);
                }
            }
        }
        config
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use std::path::Path;

    use super::*;

    fn tracks(text: &str) -> FilmTracks {
        FilmTracks::new(&FilmPath::from_text(text, "p.toml").unwrap())
    }

    #[test]
    fn flight_is_even_in_log_distance() {
        let text = "around_m = [1e11, 2e10, -5e9]\n\
            [[keyframes]]\nframe = 0\nposition_m = [100010000000.0, 2e10, -5e9]\neasing = 'linear'\n\
            [[keyframes]]\nframe = 100\nposition_m = [1e11, 1e17, -5e9]\n";
        let around_m = DVec3::new(1e11, 2e10, -5e9);
        let film = tracks(text);
        let position_m = |frame| film.at(frame).position_m.unwrap() - around_m;
        let step = (position_m(100).length() / position_m(0).length()).ln() / 100.0;
        for frame in 0..100 {
            let found = (position_m(frame + 1).length() / position_m(frame).length()).ln();
            assert!((found / step - 1.0).abs() < 1e-4, "{frame}: {found} {step}");
            // The direction also turns evenly, and stays in its plane.
            let turned = position_m(frame + 1).angle_between(position_m(frame));
            assert!((turned * 100.0 / std::f64::consts::FRAC_PI_2 - 1.0).abs() < 1e-4, "{frame}: {turned}");
            assert!(position_m(frame).z.abs() < 1e-3 + 1e-12 * position_m(frame).length());
        }
        // Along a straight line, the distance would change by ten orders of magnitude in the first frame alone.
        let straight = tracks(&text.replace("around_m = [1e11, 2e10, -5e9]", ""));
        let first = straight.at(1).position_m.unwrap() - around_m;
        assert!(first.length() > 1e14 && position_m(1).length() < 2e7, "{first} {}", position_m(1));
    }

    #[test]
    fn keyframes_are_exact_and_unnamed_values_stay() {
        let text = "around_m = [1, 0, 0]\n[[keyframes]]\nframe = 3\nposition_m = [149597870700.123, 3.1e-3, 7.7]\n\
            look = { ra_deg = 266.4, dec_deg = -28.9 }\nfov_y_deg = 41.7\n\
            [[keyframes]]\nframe = 5\nmagnitude_limit = 6.3\n\
            [[keyframes]]\nframe = 9\nposition_m = [1.5e11, 2e10, 1e9]\norientation = [0, 0, 0, 1]\nfov_y_deg = 0.7\nev100 = -4.7\n\
            [[keyframes]]\nframe = 20\nposition_m = [1e17, 2e15, 1e16]\nev100 = 3.3\ntime = 2026-01-01T00:00:00Z\n";
        for text in [text.to_owned(), text.replace("around_m = [1, 0, 0]", "")] {
            let path = FilmPath::from_text(&text, "p.toml").unwrap();
            let film = FilmTracks::new(&path);
            for keyframe in &path.keyframes {
                let values = film.at(keyframe.frame);
                let same = |named: bool, same: bool| assert!(!named || same, "{keyframe:?} {values:?}");
                same(keyframe.values.position_m.is_some(), values.position_m == keyframe.values.position_m);
                same(
                    keyframe.values.frame_from_camera.is_some(),
                    values.frame_from_camera == keyframe.values.frame_from_camera,
                );
                same(keyframe.values.fov.is_some(), values.fov == keyframe.values.fov);
                same(keyframe.values.exposure.is_some(), values.exposure == keyframe.values.exposure);
                assert_eq!(values.velocity_c, None);
            }
            // The value is held before the first keyframe that names it and after the last one.
            assert_eq!(film.at(0).exposure, Some(ExposureKey::Ev100(-4.7)));
            assert_eq!(
                (film.at(0).position_m, film.at(90).position_m),
                (film.at(3).position_m, film.at(20).position_m)
            );
            assert_eq!((film.at(0).magnitude_limit, film.at(90).magnitude_limit), (Some(6.3), Some(6.3)));
        }
    }

    #[test]
    fn position_rates_around_a_place_are_continuous() {
        let film = tracks(
            "around_m = [0, 0, 0]\n[[keyframes]]\nframe = 0\nposition_m = [1e7, 0, 0]\n[[keyframes]]\nframe = 1000\n\
            position_m = [0, 1e9, 0]\n[[keyframes]]\nframe = 1500\nposition_m = [0, 1e9, 1e12]\n",
        );
        let position_m = |frame| film.at(frame).position_m.unwrap();
        for frame in [1000, 1500] {
            // Rate per frame in units of the distance.
            let rates = [frame - 1, frame].map(|f| (position_m(f + 1) - position_m(f)) / position_m(frame).length());
            assert!((rates[1] - rates[0]).length() < 3e-4, "{frame}: {rates:?}");
        }
    }

    #[test]
    fn fields_of_view_and_exposures_apply_to_views() {
        let text = "[[views]]\nname = 'a'\ntype = 'perspective'\nsize = [8, 8]\nfov_y_deg = 60\n[views.exposure]\nlimiting_magnitude = 7\n\
            [[views]]\nname = 'b'\ntype = 'perspective'\nsize = [8, 8]\nfov = { left_deg = -45, right_deg = 20, up_deg = 10, down_deg = -10 }\n";
        let config = Config::from_text(text, "c.toml", Path::new(""), &[]).unwrap();
        let halved = FrameValues { fov: Some(FovKey::Scale(0.5)), ..FrameValues::default() }.applied_to(&config);
        let ViewKindSpec::Perspective(view) = &halved.views[0].geometry.kind else { panic!() };
        assert!((view.fov_y_deg.unwrap() - 2.0 * (0.5 / 3.0_f64.sqrt()).atan().to_degrees()).abs() < 1e-12);
        let ViewKindSpec::Perspective(view) = &halved.views[1].geometry.kind else { panic!() };
        assert!((view.fov.unwrap().left_deg + 0.5_f64.atan().to_degrees()).abs() < 1e-12);
        halved.rig().unwrap();
        let fixed =
            FrameValues { exposure: Some(ExposureKey::Ev100(2.5)), ..FrameValues::default() }.applied_to(&config);
        let groups = fixed.frame_groups().unwrap();
        assert_eq!((groups.len(), groups[0].settings.exposure), (1, ExposureSettings::manual(2.5)));
        // A key without effect on the configuration is refused.
        let dome =
            "[exposure]\nmode = 'manual'\n[[views]]\nname = 'a'\ntype = 'dome_master'\nsize = [8, 8]\nfov_deg = 180\n";
        let dome = Config::from_text(dome, "c.toml", Path::new(""), &[]).unwrap();
        for key in ["fov_scale", "fov_y_deg", "compensation_ev"] {
            let path = FilmPath::from_text(&format!("[[keyframes]]\nframe = 0\n{key} = 1\n"), "p.toml").unwrap();
            let message = check_with(&path, &dome).unwrap_err().to_string();
            assert!(message.contains("p.toml") && message.contains(key) && message.contains("c.toml"), "{message}");
        }
    }
}

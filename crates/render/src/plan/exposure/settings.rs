//! `[exposure]`: how light becomes display white.
//!
//! [`ExposureSettings`] hold only values that have an effect with their mode and metering. Files and clients write the flat table of
//! [`ExposureKeys`]: every key may be left out; [`ExposureKeys::over`] converts it to settings, and [`ExposureKeys::check_effects`] rejects keys
//! without effect.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::photometry::exposure::{STANDARD_KEY, key_compensation_ev, metered_ev100};
use crate::ranges::PartialSettings;

/// How the exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExposureMode {
    /// Automatic: by `metering`.
    #[default]
    Auto,
    /// Fixed: `ev100`.
    Manual,
}

named!(ExposureMode { Auto = "auto", Manual = "manual" });

/// Light that determines the automatic exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Metering {
    /// Stars of `limiting_magnitude` are just visible in the first view; fewer stars are visible if sunlit bodies or asteroids would otherwise be too
    /// bright.
    #[default]
    LimitingMagnitude,
    /// The mean luminance of all views, weighted by solid angle.
    Mean,
    /// The mean luminance of a small cone around the middle of the first view's picture, weighted by solid angle.
    Spot,
}

named!(Metering {
    LimitingMagnitude = "limiting_magnitude",
    Mean = "mean",
    Spot = "spot",
});

/// Range of exposure values. White luminance and the stars' light both stay in the range of f32.
const EV100: [f64; 2] = [-100.0, 100.0];

settings! {
    /// Exposure settings.
    #[derive(Copy)]
    pub struct ExposureValues, ExposureKeys {
        /// How the exposure is chosen.
        pub mode: ExposureMode = ExposureMode::Auto,
        /// `auto`: the light that determines the exposure.
        pub metering: Metering = Metering::LimitingMagnitude,
        /// Metering `limiting_magnitude`: magnitude of the faintest stars that are visible in the first view. Their peak is code 20 of 255.
        // The range extends from brighter than any star to fainter than any telescope detects.
        #[schemars(range(min = -10.0, max = 30.0))]
        pub limiting_magnitude: f64 = 6.5,
        /// Metering `limiting_magnitude`: side of the square pixels for which the exposure is chosen, so that a small picture is as bright as a large
        /// one. 0 means the pixels of the first view.
        // A square pixel as large as the whole sky has sides of 203 degrees.
        #[schemars(range(min = 0.0, max = 12_000.0), extend("x-unit" = "arcminutes"))]
        pub reference_pixel_arcmin: f64 = 0.0,
        /// `manual`: exposure value at ISO 100; display white is 1.2 * 2^ev100 cd/m^2. Star methods of relative brightness use it as their unit.
        #[schemars(range(min = EV100[0], max = EV100[1]))]
        pub ev100: f64 = -3.0,
        /// Metering `mean` and `spot`: fraction of display white at which the mean luminance is shown; the default is that of ISO 2720 and ISO 12232.
        #[schemars(range(min = 1e-6, max = 1.0), extend("x-unit" = "of display white"))]
        pub key: f64 = STANDARD_KEY,
        /// Metering `spot`: angle across the cone whose mean luminance is metered.
        // Below 0.05 degrees a pixel of the meter is narrower than the resolution of directions in f32.
        #[schemars(range(min = 0.05, max = 90.0), extend("x-unit" = "degrees"))]
        pub spot_deg: f64 = 2.0,
        /// `auto`: exposure compensation, added to the exposure value; positive darkens.
        #[schemars(range(min = -30.0, max = 30.0))]
        pub compensation_ev: f64 = 0.0,
        /// `auto`: lowest exposure value, not above `max_ev100`.
        #[schemars(range(min = EV100[0], max = EV100[1]))]
        pub min_ev100: f64 = -20.0,
        /// `auto`: highest exposure value.
        #[schemars(range(min = EV100[0], max = EV100[1]))]
        pub max_ev100: f64 = 24.0,
        /// Time constant of exposure adaptation in `serve` and `xr`; 0 adapts at once.
        #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
        pub adaptation_s: f64 = 0.5,
    }
    optional {}
}

/// Meter of an automatic exposure, with the parameters of its metering mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meter {
    /// [`Metering::LimitingMagnitude`].
    LimitingMagnitude {
        /// Magnitude of the faintest visible stars.
        limiting_magnitude: f64,
        /// Side of the square pixels in which they are just visible, arcminutes; `None`: the pixels of the first view.
        reference_arcmin: Option<f64>,
    },
    /// [`Metering::Mean`].
    Mean {
        /// Fraction of display white at which the mean luminance is shown.
        key: f64,
    },
    /// [`Metering::Spot`].
    Spot {
        /// Fraction of display white at which the mean luminance is shown.
        key: f64,
        /// Angle across the metered cone, degrees.
        spot_deg: f64,
    },
}

/// Automatic exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutoExposure {
    /// Metering mode, with its keys.
    pub meter: Meter,
    /// Exposure compensation; positive darkens.
    pub compensation_ev: f64,
    /// Lowest exposure value.
    pub min_ev100: f64,
    /// Highest exposure value.
    pub max_ev100: f64,
    /// Time constant of adaptation; 0 adapts at once.
    pub adaptation_s: f64,
    /// Unit of star methods of relative brightness; other methods do not use it.
    pub unit_ev100: f64,
}

/// How the exposure of a frame is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExposureSettings {
    /// Fixed.
    Manual {
        /// Exposure value at ISO 100: display white is 1.2 * 2^ev100 cd/m^2.
        ev100: f64,
    },
    /// Follows the light of the picture, or the stars that are to be visible.
    Auto(AutoExposure),
}

impl Default for ExposureSettings {
    fn default() -> Self {
        ExposureValues::default().into()
    }
}

impl Default for AutoExposure {
    fn default() -> Self {
        Self::by(Metering::default())
    }
}

impl From<ExposureValues> for ExposureSettings {
    fn from(values: ExposureValues) -> Self {
        match values.mode {
            ExposureMode::Manual => Self::Manual { ev100: values.ev100 },
            ExposureMode::Auto => Self::Auto(values.into()),
        }
    }
}

impl From<ExposureValues> for AutoExposure {
    fn from(values: ExposureValues) -> Self {
        let ExposureValues { limiting_magnitude, reference_pixel_arcmin, key, spot_deg, .. } = values;
        Self {
            meter: match values.metering {
                Metering::LimitingMagnitude => Meter::LimitingMagnitude {
                    limiting_magnitude,
                    reference_arcmin: Some(reference_pixel_arcmin).filter(|side| *side > 0.0),
                },
                Metering::Mean => Meter::Mean { key },
                Metering::Spot => Meter::Spot { key, spot_deg },
            },
            compensation_ev: values.compensation_ev,
            min_ev100: values.min_ev100,
            max_ev100: values.max_ev100,
            adaptation_s: values.adaptation_s,
            unit_ev100: values.ev100,
        }
    }
}

impl AutoExposure {
    /// The defaults with a metering mode.
    pub fn by(metering: Metering) -> Self {
        ExposureValues { metering, ..ExposureValues::default() }.into()
    }

    /// Its metering mode.
    pub fn metering(&self) -> Metering {
        match self.meter {
            Meter::LimitingMagnitude { .. } => Metering::LimitingMagnitude,
            Meter::Mean { .. } => Metering::Mean,
            Meter::Spot { .. } => Metering::Spot,
        }
    }

    /// Fraction of display white at which a mean luminance is shown.
    pub fn key(&self) -> f64 {
        match self.meter {
            Meter::LimitingMagnitude { .. } => STANDARD_KEY,
            Meter::Mean { key } | Meter::Spot { key, .. } => key,
        }
    }

    /// Offset to the reading of a standard meter, from key and compensation together.
    pub fn offset_ev(&self) -> f64 {
        self.compensation_ev + key_compensation_ev(self.key())
    }
}

impl ExposureSettings {
    /// A fixed exposure.
    pub fn manual(ev100: f64) -> Self {
        Self::Manual { ev100 }
    }

    /// The defaults with a metering mode.
    pub fn auto(metering: Metering) -> Self {
        Self::Auto(AutoExposure::by(metering))
    }

    /// Its mode.
    pub fn mode(&self) -> ExposureMode {
        match self {
            Self::Manual { .. } => ExposureMode::Manual,
            Self::Auto(_) => ExposureMode::Auto,
        }
    }

    /// The automatic exposure; the default one if the exposure is fixed.
    pub fn auto_or_default(&self) -> AutoExposure {
        match self {
            Self::Manual { .. } => AutoExposure::default(),
            Self::Auto(auto) => *auto,
        }
    }

    /// Exposure value that star methods of relative brightness use as their unit: the fixed one, or the unit of an automatic exposure.
    pub fn unit_ev100(&self) -> f64 {
        match self {
            Self::Manual { ev100 } => *ev100,
            Self::Auto(auto) => auto.unit_ev100,
        }
    }

    /// The exposure of a frame if it is known before the frame is drawn: the manual one, the one adapted from previous frames, or the one that
    /// follows from the plan ([`super::planned_ev100`]).
    pub fn known_ev100(&self, adapted_ev100: Option<f64>, planned_ev100: Option<f64>) -> Option<f64> {
        match self {
            Self::Manual { ev100 } => Some(*ev100),
            Self::Auto(_) => adapted_ev100.or(planned_ev100),
        }
    }

    /// Whether automatic exposure uses this metering mode.
    pub fn uses(&self, metering: Metering) -> bool {
        matches!(self, Self::Auto(auto) if auto.metering() == metering)
    }

    /// Whether the exposure of a frame for a fully adapted eye is known only after the frame is drawn.
    pub fn is_metered(&self) -> bool {
        self.uses(Metering::Mean)
    }

    /// The automatic exposure of a mean luminance, by metering `mean` and `spot`.
    pub fn metered_ev100(&self, mean_cd_m2: f64) -> f64 {
        let auto = self.auto_or_default();
        metered_ev100(mean_cd_m2, auto.offset_ev(), auto.min_ev100, auto.max_ev100)
    }
}

/// All keys that have an effect, as in a configuration. `ev100` of an automatic exposure is one of them.
impl From<&ExposureSettings> for ExposureKeys {
    fn from(settings: &ExposureSettings) -> Self {
        let auto = match settings {
            ExposureSettings::Manual { ev100 } => {
                return Self { mode: Some(ExposureMode::Manual), ev100: Some(*ev100), ..Self::default() };
            }
            ExposureSettings::Auto(auto) => auto,
        };
        let (limiting_magnitude, reference_pixel_arcmin, key, spot_deg) = match auto.meter {
            Meter::LimitingMagnitude { limiting_magnitude, reference_arcmin } => {
                (Some(limiting_magnitude), Some(reference_arcmin.unwrap_or(0.0)), None, None)
            }
            Meter::Mean { key } => (None, None, Some(key), None),
            Meter::Spot { key, spot_deg } => (None, None, Some(key), Some(spot_deg)),
        };
        Self {
            mode: Some(ExposureMode::Auto),
            metering: Some(auto.metering()),
            limiting_magnitude,
            reference_pixel_arcmin,
            ev100: Some(auto.unit_ev100),
            key,
            spot_deg,
            compensation_ev: Some(auto.compensation_ev),
            min_ev100: Some(auto.min_ev100),
            max_ev100: Some(auto.max_ev100),
            adaptation_s: Some(auto.adaptation_s),
        }
    }
}

impl ExposureKeys {
    /// Returns the settings from these keys; keys that are left out are taken from `general`, and then from the defaults.
    pub fn over(&self, general: &ExposureSettings) -> ExposureSettings {
        let mut keys = Self::from(general);
        keys.extend(self.clone());
        ExposureValues::default().with(&keys).into()
    }

    /// The keys of settings that have an effect. `ev100` of an automatic exposure has one only if `stars_are_relative`: it is the unit of star methods
    /// of relative brightness.
    pub fn with_effect(settings: &ExposureSettings, stars_are_relative: bool) -> Self {
        let mut keys = Self::from(settings);
        if settings.mode() == ExposureMode::Auto && !stars_are_relative {
            keys.ev100 = None;
        }
        keys
    }

    /// Names of the given keys that have no effect in the settings that result from applying these keys to `general`.
    pub fn without_effect(&self, general: &ExposureSettings, stars_are_relative: bool) -> Vec<&'static str> {
        let effective = Self::with_effect(&self.over(general), stars_are_relative).given();
        self.given().into_iter().filter(|key| !effective.contains(key)).collect()
    }

    /// Rejects given keys that have no effect in the settings that result from applying these keys to `general`.
    ///
    /// # Errors
    ///
    /// The key, and the mode or metering that it needs.
    pub fn check_effects(
        &self,
        general: &ExposureSettings,
        stars_are_relative: bool,
    ) -> Result<(), (&'static str, String)> {
        let Some(key) = self.without_effect(general, stars_are_relative).first().copied() else { return Ok(()) };
        let needs = match key {
            "ev100" => "mode = \"manual\"",
            "limiting_magnitude" | "reference_pixel_arcmin" => "metering = \"limiting_magnitude\"",
            "key" => "metering = \"mean\" or \"spot\"",
            "spot_deg" => "metering = \"spot\"",
            _ => "mode = \"auto\"",
        };
        let present = match self.over(general) {
            ExposureSettings::Auto(auto) if needs.starts_with("metering") => {
                format!("metering = \"{}\"", auto.metering().name())
            }
            settings => format!("mode = \"{}\"", settings.mode().name()),
        };
        Err((key, format!("has no effect with {present}: leave it out, or set {needs}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_their_keys_over_any_others_of_the_same_mode() {
        for settings in [
            ExposureSettings::manual(2.0),
            ExposureSettings::default(),
            ExposureSettings::auto(Metering::Mean),
            ExposureValues { reference_pixel_arcmin: 2.4, ..Default::default() }.into(),
            ExposureSettings::Auto(AutoExposure { adaptation_s: 3.0, ..AutoExposure::by(Metering::Spot) }),
        ] {
            assert_eq!(ExposureKeys::from(&settings).over(&ExposureSettings::default()), settings);
            assert_eq!(ExposureKeys::default().over(&settings), settings);
        }
    }

    #[test]
    fn keys_without_effect_are_refused_with_what_they_need() {
        let general = ExposureSettings::default();
        for (keys, relative, expected) in [
            (ExposureKeys { ev100: Some(1.0), ..Default::default() }, true, None),
            (ExposureKeys { ev100: Some(1.0), ..Default::default() }, false, Some(("ev100", "mode = \"manual\""))),
            (ExposureKeys { reference_pixel_arcmin: Some(2.4), ..Default::default() }, false, None),
            (
                ExposureKeys {
                    metering: Some(Metering::Mean),
                    reference_pixel_arcmin: Some(2.4),
                    ..Default::default()
                },
                false,
                Some(("reference_pixel_arcmin", "set metering = \"limiting_magnitude\"")),
            ),
            (
                ExposureKeys { spot_deg: Some(1.0), ..Default::default() },
                false,
                Some(("spot_deg", "set metering = \"spot\"")),
            ),
            (
                ExposureKeys { mode: Some(ExposureMode::Manual), key: Some(0.2), ..Default::default() },
                false,
                Some(("key", "with mode = \"manual\": leave it out, or set metering = \"mean\" or \"spot\"")),
            ),
        ] {
            let found = keys.check_effects(&general, relative).err();
            let matches = match (&found, expected) {
                (None, None) => true,
                (Some((key, problem)), Some((expected, part))) => *key == expected && problem.contains(part),
                _ => false,
            };
            assert!(matches, "{found:?} instead of {expected:?}");
        }
    }
}

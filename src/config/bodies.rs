//! `[[bodies]]`: one table per body. A preset gives the keys that are left out.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use schemars::JsonSchema;
use serde::de::{Error, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer};
use toml::{Table, Value};

use super::document::read;
use crate::ranges::KeyError;
use crate::scene::bodies::{
    Body, Emission, Ephemeris, FARTHEST_M, RADII_M, ReflectionLaw, SUN_ABSOLUTE_MAGNITUDE, SUN_LIMB_DARKENING,
    SolarBody, Spin, Surface, Texture, mean_radius_m,
};
use crate::scene::unit_quaternion;

/// An ellipsoid: a planet, moon or sun. A preset gives the keys that are left out.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// A body of the Solar System, whose size, albedo, reflection law and spin are the defaults of these keys; for the Sun, also its position and
    /// emission.
    pub preset: Option<SolarBody>,
    /// Ephemeris of the position, instead of `position_m`: the name of a body of the Solar System, or `spk:NUMBER`, where NUMBER is the NAIF number
    /// of an object in `scene.kernels`. For a body of the Solar System it also gives the orientation and the rotation, instead of `orientation` and
    /// `spin`.
    #[serde(default)]
    #[schemars(schema_with = "super::reference::ephemeris")]
    pub ephemeris: Option<Ephemeris>,
    /// Centre, ICRS, barycentric. Either this or `ephemeris` is required. The preset `sun` needs neither: it is at the origin.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)), extend("x-unit" = "m"))]
    pub position_m: Option<[f64; 3]>,
    /// Unit quaternion from the body's axes to ICRS axes; the identity by default. The body spins about its z axis.
    pub orientation: Option<[f64; 4]>,
    /// Semi-axes along x, y and z; the largest is at most 100 times the smallest. Without a preset, either this or `radius_m` is required.
    #[schemars(inner(range(min = RADII_M[0], max = RADII_M[1])), extend("x-unit" = "m"))]
    pub radii_m: Option<[f64; 3]>,
    /// Radius of a sphere, instead of `radii_m`.
    #[schemars(range(min = RADII_M[0], max = RADII_M[1]), extend("x-unit" = "m"))]
    pub radius_m: Option<f64>,
    /// Geometric albedo, one number or [red, green, blue]; required without a preset.
    #[serde(default, deserialize_with = "albedo")]
    #[schemars(schema_with = "super::reference::albedo")]
    pub geometric_albedo: Option<[f64; 3]>,
    /// Reflection law of the surface; `lommel_seeliger` without a preset.
    pub law: Option<ReflectionLaw>,
    /// Whether brightness follows the measured phase curve of the preset instead of the reflection law; true by default for bodies with a preset.
    pub phase_curve: Option<bool>,
    /// PNG file, 8 bits, sRGB, equirectangular (longitude and latitude). Its values are factors on the albedo.
    pub texture: Option<PathBuf>,
    /// Rotation about the z axis.
    pub spin: Option<SpinConfig>,
    /// Emission; makes the body a sun. A scene has at most 8 suns.
    pub emission: Option<EmissionConfig>,
}

/// `spin` of a body.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpinConfig {
    /// Sidereal period, at least 0.001 s; negative for retrograde rotation. The default is that of the preset, or no rotation.
    pub period_s: Option<f64>,
    /// Rotation angle at 2000-01-01T12:00:00Z.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub phase_deg: f64,
}

/// `emission` of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmissionConfig {
    /// Absolute V magnitude; required without the preset `sun`.
    #[schemars(range(min = -50.0, max = 50.0))]
    pub absolute_magnitude: Option<f64>,
    /// Temperature of the black body that has the same colour; required without the preset `sun`.
    #[schemars(range(min = 100.0, max = 1e8), extend("x-unit" = "K"))]
    pub temperature_k: Option<f64>,
    /// Coefficient of linear limb darkening; 0 without the preset `sun`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub limb_darkening: Option<f64>,
    /// Whether there is a corona around it, as around the Sun; false by default without the preset `sun`.
    pub corona: Option<bool>,
}

/// One number, or one for each of red, green and blue.
pub(super) fn albedo<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; 3]>, D::Error> {
    struct Albedo;
    impl<'de> Visitor<'de> for Albedo {
        type Value = [f64; 3];

        fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            formatter.write_str("a number, or [red, green, blue]")
        }

        fn visit_f64<E: Error>(self, value: f64) -> Result<[f64; 3], E> {
            Ok([value; 3])
        }

        fn visit_i64<E: Error>(self, value: i64) -> Result<[f64; 3], E> {
            Ok([value as f64; 3])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, values: A) -> Result<[f64; 3], A::Error> {
            <[f64; 3]>::deserialize(SeqAccessDeserializer::new(values))
        }
    }
    deserializer.deserialize_any(Albedo).map(Some)
}

impl BodyConfig {
    /// A body of the Solar System at its true position.
    pub(super) fn of_solar_system(of: SolarBody) -> Self {
        Self {
            name: of.name().to_owned(),
            preset: Some(of),
            ephemeris: Some(of.into()),
            position_m: None,
            orientation: None,
            radii_m: None,
            radius_m: None,
            geometric_albedo: None,
            law: None,
            phase_curve: None,
            texture: None,
            spin: None,
            emission: None,
        }
    }

    /// Whether this body represents the given body of the Solar System.
    pub(super) fn stands_for(&self, of: SolarBody) -> bool {
        self.name == of.name() || self.preset == Some(of) || self.stands_as() == Some(of)
    }

    /// The body of the Solar System whose ephemeris, and therefore orientation, this body has.
    fn stands_as(&self) -> Option<SolarBody> {
        self.ephemeris.and_then(Ephemeris::stands_as)
    }

    /// Reads a body's table and checks it; an error names the key within it.
    pub(super) fn from_table(table: Table) -> Result<Self, KeyError> {
        let config: Self = read(Value::Table(table))?;
        config.body()?;
        Ok(config)
    }

    /// The body without its texture.
    pub(super) fn body(&self) -> Result<Body, KeyError> {
        if self.ephemeris.is_some() {
            let stands = self.stands_as().is_some();
            let given = [
                ("position_m", self.position_m.is_some()),
                ("orientation", self.orientation.is_some() && stands),
                ("spin", self.spin.is_some() && stands),
            ];
            if let Some((key, _)) = given.into_iter().find(|(_, given)| *given) {
                return Err(KeyError::new(key, "ephemeris is also given: give at most one of them"));
            }
        }
        let position_m = match (self.position_m, self.ephemeris, self.preset) {
            (Some(position_m), ..) => DVec3::from_array(position_m),
            // The ephemeris gives the position later, at the scene's time.
            (None, Some(_), _) | (None, None, Some(SolarBody::Sun)) => DVec3::ZERO,
            (None, None, _) => {
                let problem = "missing key: give the position, [x, y, z] in m, or ephemeris";
                return Err(KeyError::new("position_m", problem));
            }
        };
        let preset = self.preset.map(|preset| Body::preset(preset, &self.name, position_m));
        let needed = |key: &'static str, what: &str| {
            KeyError::new(key, format!("missing key: without a preset {what} is needed"))
        };
        let radii_m = match (self.radii_m, self.radius_m, &preset) {
            (Some(_), Some(_), _) => {
                let problem = "radii_m is also given: give exactly one of radius_m and radii_m";
                return Err(KeyError::new("radius_m", problem));
            }
            (Some(radii_m), None, _) => DVec3::from_array(radii_m),
            (None, Some(radius_m), _) => DVec3::splat(radius_m),
            (None, None, Some(preset)) => preset.radii_m,
            (None, None, None) => return Err(needed("radius_m", "radius_m or radii_m")),
        };
        let geometric_albedo = match (self.geometric_albedo, &preset) {
            (Some(albedo), _) => albedo,
            (None, Some(preset)) => preset.surface.geometric_albedo,
            (None, None) => return Err(needed("geometric_albedo", "it")),
        };
        let law = self.law.or(preset.as_ref().map(|preset| preset.surface.law)).unwrap_or_default();
        let default_spin = preset.as_ref().map(|preset| preset.spin).unwrap_or_default();
        let spin = match self.spin {
            _ if self.stands_as().is_some() => Spin::default(),
            Some(spin) => {
                let period_s = spin.period_s.or(default_spin.period_s);
                Spin { period_s, phase_rad: spin.phase_deg.to_radians() }
            }
            None => default_spin,
        };
        let orientation = self.orientation.map(unit_quaternion).transpose();
        let orientation = orientation.map_err(|e| KeyError::new("orientation", e.to_string()))?.unwrap_or_default();
        let measured = preset.as_ref().and_then(|preset| preset.surface.phase_curve);
        let phase_curve = match self.phase_curve {
            Some(true) if measured.is_none() => {
                return Err(KeyError::new(
                    "phase_curve",
                    "true: needs a preset with a measured curve: any except `sun`",
                ));
            }
            Some(false) => None,
            Some(true) | None => measured,
        };
        let mut body = Body {
            name: self.name.clone(),
            ephemeris: self.ephemeris,
            position_m,
            radii_m,
            orientation,
            spin,
            surface: Surface { law, geometric_albedo, phase_curve, texture: None },
            emission: None,
            seen_through: [1.0; 3],
        };
        body.check().map_err(|error| match error.key.as_str() {
            "radii_m" if self.radius_m.is_some() => KeyError::new("radius_m", error.problem),
            "spin" => KeyError::new("spin.period_s", error.problem),
            _ => error,
        })?;
        body.emission = self.emission(radii_m)?;
        body.check()?;
        Ok(body)
    }

    fn emission(&self, radii_m: DVec3) -> Result<Option<Emission>, KeyError> {
        let is_sun = self.preset == Some(SolarBody::Sun);
        let given = match self.emission {
            Some(emission) => emission,
            None if is_sun => EmissionConfig::default(),
            None => return Ok(None),
        };
        let of_sun = |value: f64| is_sun.then_some(value);
        let needed = |key: &str, value: Option<f64>| {
            let missing =
                || KeyError::new(format!("emission.{key}"), "missing key: without the preset `sun` it is needed");
            value.ok_or_else(missing)
        };
        let sun_k = f64::from(crate::units::SOLAR_TEMPERATURE_K);
        let magnitude = given.absolute_magnitude.or(of_sun(SUN_ABSOLUTE_MAGNITUDE));
        let magnitude = needed("absolute_magnitude", magnitude)?;
        let temperature_k = needed("temperature_k", given.temperature_k.or(of_sun(sun_k)))?;
        let darkening = given.limb_darkening.or(of_sun(SUN_LIMB_DARKENING)).unwrap_or(0.0);
        let of_star = Emission::of_star(magnitude, temperature_k, mean_radius_m(radii_m), darkening);
        Ok(Some(Emission { corona: given.corona.unwrap_or(is_sun), ..of_star }))
    }

    /// Reads the texture and returns the complete body; paths are relative to `folder`.
    pub(super) fn load(&self, folder: &Path) -> Result<Body, KeyError> {
        let mut body = self.body()?;
        if let Some(file) = &self.texture {
            let texture = Texture::from_png(&folder.join(file));
            let texture = texture.map_err(|error| KeyError::new("texture", error.to_string()))?;
            body.surface.texture = Some(Arc::new(texture));
        }
        Ok(body)
    }
}

//! Limits of bodies, shared by configurations and clients.

use glam::DVec3;

use super::Body;
use crate::ranges::KeyError;

/// Maximum number of bodies of a scene.
pub const MOST_BODIES: usize = 256;
/// Maximum number of suns of a scene: each one lights every body, in every pixel.
pub const MOST_SUNS: usize = 8;

/// Largest distance from the barycentre along each axis, m: keeps squares and quotients within the range of f64.
pub const FARTHEST_M: f64 = 1e25;
/// Smallest and largest semi-axis, m.
pub const RADII_M: [f64; 2] = [1e-3, 1e13];
/// Largest ratio of the semi-axes.
const MOST_ELONGATED: f64 = 100.0;
/// Largest geometric albedo; surfaces with backscatter can exceed 1.
pub const BRIGHTEST_ALBEDO: f64 = 2.0;
/// Shortest period of a spin, s.
const SHORTEST_PERIOD_S: f64 = 1e-3;
/// Largest luminance, cd/m^2: a million times that of the Sun.
const BRIGHTEST_CD_M2: f64 = 1e16;
/// Longest name, characters.
const LONGEST_NAME: usize = 64;

/// Checks a name: letters, digits, `_` and `-`, 1 to 64 of them.
pub fn check_name(name: &str) -> Result<(), KeyError> {
    let valid = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(valid) {
        let problem = format!("`{name}`: must be 1 to {LONGEST_NAME} letters, digits, `_` and `-`");
        return Err(KeyError::new("name", problem));
    }
    Ok(())
}

/// Checks that names are valid, unique and not too many. The error comes with the index of the offending name.
pub fn check_names<'a>(names: impl Iterator<Item = &'a str>, most: usize) -> Result<(), (usize, KeyError)> {
    let mut seen = std::collections::HashMap::new();
    for (index, name) in names.enumerate() {
        check_name(name).map_err(|error| (index, error))?;
        if index >= most {
            return Err((index, KeyError::new("name", format!("`{name}` is one too many: must be at most {most}"))));
        }
        if let Some(first) = seen.insert(name, index) {
            let problem = format!("`{name}` is also the name of number {first}: names must be unique");
            return Err((index, KeyError::new("name", problem)));
        }
    }
    Ok(())
}

/// Checks the number of suns. The error comes with the index of the first one too many.
pub fn check_suns<'a>(bodies: impl Iterator<Item = &'a Body>) -> Result<(), (usize, KeyError)> {
    let mut suns = bodies.enumerate().filter(|(_, body)| body.emission.is_some());
    match suns.nth(MOST_SUNS) {
        Some((index, body)) => {
            let problem = format!("`{}` is one sun too many: must be at most {MOST_SUNS}", body.name);
            Err((index, KeyError::new("emission", problem)))
        }
        None => Ok(()),
    }
}

/// Checks a position.
pub(in crate::scene) fn check_position(position_m: DVec3) -> Result<(), KeyError> {
    if position_m.is_finite() && position_m.abs().max_element() <= FARTHEST_M {
        return Ok(());
    }
    let problem = format!("{:?}: components must be at most {FARTHEST_M:e} m", position_m.to_array());
    Err(KeyError::new("position_m", problem))
}

/// Checks an albedo.
pub(in crate::scene) fn check_albedo(albedo: [f64; 3]) -> Result<(), KeyError> {
    if albedo.iter().all(|channel| (0.0..=BRIGHTEST_ALBEDO).contains(channel)) {
        return Ok(());
    }
    let problem = format!("{albedo:?}: must be between 0 and {BRIGHTEST_ALBEDO}");
    Err(KeyError::new("geometric_albedo", problem))
}

impl Body {
    /// Checks every part, except whether the name is unique.
    ///
    /// # Errors
    ///
    /// A part is out of range; the error names it and the valid values.
    pub fn check(&self) -> Result<(), KeyError> {
        check_name(&self.name)?;
        check_position(self.position_m)?;
        crate::scene::unit_quaternion(self.orientation.to_array())
            .map_err(|error| KeyError::new("orientation", error.to_string()))?;
        let (radii, [least, most]) = (self.radii_m, RADII_M);
        if !radii.to_array().iter().all(|radius| (least..=most).contains(radius)) {
            let problem = format!("{:?}: semi-axes must be between {least} and {most:e} m", radii.to_array());
            return Err(KeyError::new("radii_m", problem));
        }
        if radii.max_element() > MOST_ELONGATED * radii.min_element() {
            let problem = format!(
                "{:?}: the largest semi-axis must be at most {MOST_ELONGATED} times the smallest",
                radii.to_array()
            );
            return Err(KeyError::new("radii_m", problem));
        }
        check_albedo(self.surface.geometric_albedo)?;
        if let Some(texture) = &self.surface.texture {
            let texels = u64::from(texture.size[0]) * u64::from(texture.size[1]);
            if texels == 0 || texels != texture.rgb.len() as u64 {
                let problem = format!("a size of {:?} texels, but {} values", texture.size, texture.rgb.len());
                return Err(KeyError::new("texture", problem));
            }
        }
        let spin = self.spin;
        if spin.period_s.is_some_and(|period_s| !(period_s.is_finite() && period_s.abs() >= SHORTEST_PERIOD_S)) {
            let problem = format!(
                "period_s = {}: must be finite and at least {SHORTEST_PERIOD_S} s in absolute value (negative: retrograde); omit it for no rotation",
                spin.period_s.unwrap_or_default()
            );
            return Err(KeyError::new("spin", problem));
        }
        if !spin.phase_rad.is_finite() {
            return Err(KeyError::new("spin", format!("a phase of {} rad: must be finite", spin.phase_rad)));
        }
        if let Some(emission) = &self.emission {
            if !emission.luminance_cd_m2.iter().all(|channel| (0.0..=BRIGHTEST_CD_M2).contains(channel)) {
                let problem = format!(
                    "a luminance of {:?} cd/m^2: must be between 0 and {BRIGHTEST_CD_M2:e}",
                    emission.luminance_cd_m2
                );
                return Err(KeyError::new("emission", problem));
            }
            if !(0.0..=1.0).contains(&emission.limb_darkening) {
                let problem = format!("limb_darkening = {}: must be between 0 and 1", emission.limb_darkening);
                return Err(KeyError::new("emission", problem));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::bodies::{Emission, SolarBody};

    #[test]
    fn every_part_out_of_range_is_named() {
        let good = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        good.check().unwrap();
        let emission = good.emission.unwrap();
        let changed = |change: &dyn Fn(&mut Body)| {
            let mut body = good.clone();
            change(&mut body);
            body.check().unwrap_err().to_string()
        };
        for (message, parts) in [
            (changed(&|body| body.name = "a b".to_owned()), ["name", "letters"]),
            (changed(&|body| body.name = "a".repeat(65)), ["name", "1 to 64"]),
            (changed(&|body| body.position_m.y = f64::NAN), ["position_m", "1e25"]),
            (changed(&|body| body.orientation.w = 2.0), ["orientation", "unit quaternion"]),
            (changed(&|body| body.radii_m.z = 0.0), ["radii_m", "0.001"]),
            (changed(&|body| body.radii_m.z *= 101.0), ["radii_m", "100 times"]),
            (changed(&|body| body.surface.geometric_albedo[1] = -0.1), ["geometric_albedo", "between 0 and 2"]),
            (changed(&|body| body.spin.period_s = Some(0.0)), ["spin", "period_s"]),
            (changed(&|body| body.spin.phase_rad = f64::INFINITY), ["spin", "finite"]),
            (
                changed(&|body| body.emission = Some(Emission { limb_darkening: 1.1, ..emission })),
                ["emission", "between 0 and 1"],
            ),
            (
                changed(&|body| body.emission = Some(Emission { luminance_cd_m2: [f64::NAN; 3], ..emission })),
                ["emission", "1e16"],
            ),
        ] {
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }

    #[test]
    fn names_are_unique_and_counted() {
        let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
        let moon = Body::preset(SolarBody::Moon, "moon", DVec3::ZERO);
        let bodies = |suns: usize| std::iter::repeat_n(&sun, suns).chain(std::iter::repeat_n(&moon, 9));
        check_suns(bodies(MOST_SUNS)).unwrap();
        assert!(check_suns(bodies(MOST_SUNS + 1)).unwrap_err().1.to_string().contains("at most 8"));
        check_names(["a", "b"].into_iter(), 2).unwrap();
        let (place, error) = check_names(["a", "b", "a"].into_iter(), 9).unwrap_err();
        assert!(place == 2 && error.to_string().contains("unique"), "{error}");
        assert!(check_names(["a", "b"].into_iter(), 1).unwrap_err().1.to_string().contains("at most 1"));
    }
}

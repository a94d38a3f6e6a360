//! Normals from pictures: a Lambert surface lit by three suns in turn has three luminances, each proportional to the
//! cosine between the normal and the direction to that sun. The direction of the solution of the three equations is the
//! normal; its length contains albedo, coverage and exposure (Woodham 1980, photometric stereo). If a sun does not
//! reach the surface, there is no normal.

use glam::{DMat3, DVec3};

use super::error::{MetricError, not_negative, positive};

/// Three suns of equal illuminance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreeSuns {
    normal_from_luminances: DMat3,
}

impl ThreeSuns {
    /// Creates the three suns from the unit vectors to them.
    ///
    /// # Errors
    /// [`MetricError::NotPositive`] if they lie in one plane: they determine no normal.
    pub fn new(directions: [DVec3; 3]) -> Result<Self, MetricError> {
        let matrix = DMat3::from_cols(directions[0], directions[1], directions[2]).transpose();
        positive("volume between the directions of the suns", matrix.determinant().abs() - 1e-9)?;
        Ok(Self { normal_from_luminances: matrix.inverse() })
    }

    /// Returns the unit normal of a pixel from its luminances under the three suns; `None` if one of them does not exceed `least`.
    pub fn normal(&self, luminances: [f64; 3], least: f64) -> Option<DVec3> {
        let lit = luminances.iter().all(|luminance| luminance.is_finite() && *luminance > least);
        lit.then(|| (self.normal_from_luminances * DVec3::from_array(luminances)).try_normalize()).flatten()
    }
}

/// Returns the weighted mean angle between the two normals of a pixel, over the pixels that have both, rad; `None` if there is no such pixel.
///
/// # Errors
/// [`MetricError::NotPositive`] for a weight that is negative or not finite.
pub fn mean_normal_error_rad(
    pairs: impl IntoIterator<Item = (Option<DVec3>, Option<DVec3>, f64)>,
) -> Result<Option<f64>, MetricError> {
    let (mut sum, mut area) = (0.0, 0.0);
    for (a, b, weight) in pairs {
        let weight = not_negative("weight of a normal", weight)?;
        if let (Some(a), Some(b)) = (a, b) {
            sum += weight * a.cross(b).length().atan2(a.dot(b));
            area += weight;
        }
    }
    Ok((area > 0.0).then(|| sum / area))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn suns() -> [DVec3; 3] {
        [DVec3::new(0.5, 0.0, 0.9), DVec3::new(-0.3, 0.4, 0.9), DVec3::new(-0.3, -0.4, 0.9)].map(DVec3::normalize)
    }

    #[test]
    fn lambert_normals_are_recovered_and_a_tilt_is_measured() {
        let three = ThreeSuns::new(suns()).unwrap();
        let luminances = |normal: DVec3| suns().map(|sun| 0.37 * sun.dot(normal).max(0.0));
        let mut pairs = Vec::new();
        for i in 0..200 {
            let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
            let away = 0.5 * f64::from(i) / 200.0;
            let normal = DVec3::new(away.sin() * cos, away.sin() * sin, away.cos());
            let found = three.normal(luminances(normal), 1e-6).unwrap();
            assert!((found - normal).length() < 1e-12);
            let axis = normal.any_orthonormal_vector();
            let tilted = glam::DQuat::from_axis_angle(axis, 0.05) * normal;
            pairs.push((three.normal(luminances(tilted), 1e-6), Some(normal), 1.0));
        }
        assert!((mean_normal_error_rad(pairs.iter().copied()).unwrap().unwrap() - 0.05).abs() < 1e-9);
        let same = pairs.iter().map(|(_, b, weight)| (*b, *b, *weight));
        assert_eq!(mean_normal_error_rad(same).unwrap(), Some(0.0));
    }

    #[test]
    fn a_normal_needs_three_lights() {
        let three = ThreeSuns::new(suns()).unwrap();
        assert_eq!(three.normal([1.0, 1.0, 0.0], 0.0), None);
        assert_eq!(three.normal([1.0, f64::NAN, 1.0], 0.0), None);
        assert!(ThreeSuns::new([DVec3::X, DVec3::Y, DVec3::new(0.6, 0.8, 0.0)]).is_err());
        assert_eq!(mean_normal_error_rad([(None, Some(DVec3::Z), 1.0)]).unwrap(), None);
        assert!(mean_normal_error_rad([(None, None, f64::NAN)]).is_err());
    }
}

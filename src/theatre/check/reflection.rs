//! Light that a dome's screen reflects back onto itself.
//!
//! The screen is part of a sphere and reflects diffusely. Every element of a sphere is lit equally by every other element (the form factor of two
//! elements is their area divided by the area of the sphere). With reflectivity r and a screen that covers the fraction f of the sphere (the rest is
//! dark), the reflected light is the same everywhere: f r / (1 - f r) of the mean light that projectors throw onto the screen (the integrating
//! sphere; Goebel 1967, Applied Optics 6, 125).

use serde::Serialize;

use super::Dome;

/// The dome's cross-reflection and its effect on pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossReflection {
    /// Fraction of the light that the screen reflects.
    pub reflectivity: f64,
    /// Fraction of the sphere that the screen covers.
    pub screen_share: f64,
    /// Reflected light at every point, relative to the mean light from projectors.
    pub gain: f64,
    /// Contrast of a picture that is half white and half black.
    pub half_white_contrast: f64,
    /// Increase of the exposure value after which the mean light on the dome equals that of the picture.
    pub mean_ev: f64,
    /// Effect on one picture, if one was given.
    pub picture: Option<GreyedPicture>,
}

/// A picture on the dome.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GreyedPicture {
    /// Mean light of the picture, relative to white.
    pub mean: f64,
    /// Median of the light, relative to white. In a night picture, this is the light of the sky between the stars.
    pub median: f64,
    /// Light that is reflected everywhere, relative to white. It is the resulting level of black.
    pub grey: f64,
    /// Increase of the exposure value after which the median on the dome equals that of the picture; `None` if the median is black.
    pub median_ev: Option<f64>,
}

impl CrossReflection {
    /// Returns the cross-reflection of a dome whose screen has this reflectivity (at least 0 and below 1).
    pub fn new(dome: Dome, reflectivity: f64) -> Self {
        let screen_share = 0.5 * (1.0 - (0.5 * dome.fov_deg.to_radians()).cos());
        let back = screen_share * reflectivity;
        let gain = back / (1.0 - back);
        Self {
            reflectivity,
            screen_share,
            gain,
            half_white_contrast: (1.0 + 0.5 * gain) / (0.5 * gain),
            mean_ev: (1.0 + gain).log2(),
            picture: None,
        }
    }

    /// Adds the effect on a picture, which is a domemaster (equidistant, as wide as the dome) with this side. `light`
    /// has its rows from the top, relative to white.
    #[must_use]
    pub fn with_picture(self, dome: Dome, side: u32, light: &[f64]) -> Self {
        let half = 0.5 * f64::from(side);
        let half_fov_rad = 0.5 * dome.fov_deg.to_radians();
        let mut weighed: Vec<(f64, f64)> = Vec::with_capacity(light.len());
        for (index, light) in light.iter().enumerate() {
            let [x, y] =
                [index as u32 % side, index as u32 / side].map(|coordinate| f64::from(coordinate) + 0.5 - half);
            let angle = x.hypot(y) / half * half_fov_rad;
            if angle < half_fov_rad {
                // Solid angle of a pixel of an equidistant picture.
                weighed.push((*light, if angle > 0.0 { angle.sin() / angle } else { 1.0 }));
            }
        }
        let whole: f64 = weighed.iter().map(|(_, weight)| weight).sum();
        let mean = weighed.iter().map(|(light, weight)| light * weight).sum::<f64>() / whole;
        weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut below = 0.0;
        let median = weighed.iter().find(|(_, weight)| {
            below += weight;
            below >= 0.5 * whole
        });
        let median = median.map_or(0.0, |(light, _)| *light);
        let grey = self.gain * mean;
        let median_ev = (median > 0.0).then(|| ((median + grey) / median).log2());
        Self { picture: Some(GreyedPicture { mean, median, grey, median_ev }), ..self }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec3;

    use super::*;

    /// Computes the radiosity of a cap of the sphere element by element. Returns the light that all other elements
    /// reflect to each element, relative to the mean projected light.
    fn radiosity(fov_deg: f64, reflectivity: f64, thrown: impl Fn(DVec3) -> f64) -> Vec<f64> {
        const ELEMENTS: usize = 900;
        let end = (0.5 * fov_deg.to_radians()).cos();
        let element_sr = 2.0 * PI * (1.0 - end) / ELEMENTS as f64;
        let places: Vec<DVec3> = (0..ELEMENTS)
            .map(|i| {
                let z = 1.0 - (1.0 - end) * (i as f64 + 0.5) / ELEMENTS as f64;
                let (sin, cos) = (i as f64 * 2.399_963).sin_cos();
                DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
            })
            .collect();
        let thrown: Vec<f64> = places.iter().map(|place| thrown(*place)).collect();
        // The form factor cos cos / (pi d^2), computed from the geometry.
        let form = |a: DVec3, b: DVec3| {
            // The form factor of an element with itself equals that of any two elements.
            if a == b {
                return element_sr / (4.0 * PI);
            }
            let off = b - a;
            let towards = off.normalize();
            (-a).dot(towards) * b.dot(towards) / (PI * off.length_squared()) * element_sr
        };
        let mut back = vec![0.0; ELEMENTS];
        for _ in 0..60 {
            back = places
                .iter()
                .map(|a| {
                    let others = places.iter().zip(thrown.iter().zip(&back));
                    others.map(|(b, (own, back))| reflectivity * (own + back) * form(*a, *b)).sum()
                })
                .collect();
        }
        let mean = thrown.iter().sum::<f64>() / ELEMENTS as f64;
        back.into_iter().map(|light| light / mean).collect()
    }

    #[test]
    fn reflected_light_matches_radiosity_everywhere() {
        for (fov_deg, reflectivity) in [(180.0, 0.45), (180.0, 0.8), (210.0, 0.3), (120.0, 0.6)] {
            let expected = CrossReflection::new(Dome { fov_deg, tilt_deg: 0.0 }, reflectivity).gain;
            let pictures: [fn(DVec3) -> f64; 3] =
                [|_| 1.0, |place| f64::from(place.x > 0.0), |place| if place.z > 0.99 { 50.0 } else { 0.1 }];
            for thrown in pictures {
                for back in radiosity(fov_deg, reflectivity, thrown) {
                    assert!((back / expected - 1.0).abs() < 0.02, "{fov_deg} {reflectivity}: {back} {expected}");
                }
            }
            let wrong = CrossReflection::new(Dome { fov_deg, tilt_deg: 0.0 }, reflectivity + 0.05).gain;
            assert!((wrong / expected - 1.0).abs() > 0.02);
        }
    }

    #[test]
    fn black_is_raised_in_proportion_to_the_mean() {
        let dome = Dome { fov_deg: 180.0, tilt_deg: 0.0 };
        let side = 200_u32;
        // One of a hundred pixels is white; the sky is a thousandth of that.
        let light: Vec<f64> =
            (0..side * side).map(|i| if i * 7919 % 100 == 7 * (i / side) % 100 { 1.0 } else { 1e-3 }).collect();
        let found = CrossReflection::new(dome, 0.5).with_picture(dome, side, &light);
        let picture = found.picture.unwrap();
        assert!((found.gain - 1.0 / 3.0).abs() < 1e-12 && (found.half_white_contrast - 7.0).abs() < 1e-9);
        assert!((picture.mean - 0.01099).abs() < 4e-4, "{picture:?}");
        assert!((picture.median - 1e-3).abs() < 1e-12 && (picture.grey - picture.mean / 3.0).abs() < 1e-12);
        assert!((picture.median_ev.unwrap() - (1.0 + picture.grey / 1e-3).log2()).abs() < 1e-12);
        let none = CrossReflection::new(dome, 0.0).with_picture(dome, side, &light);
        assert_eq!((none.gain, none.mean_ev, none.picture.unwrap().grey), (0.0, 0.0, 0.0));
        let black = CrossReflection::new(dome, 0.5).with_picture(dome, side, &vec![0.0; 200 * 200]);
        assert_eq!(black.picture.unwrap().median_ev, None);
    }
}

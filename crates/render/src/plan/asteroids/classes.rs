//! Selects the form in which each asteroid is drawn, so that every error stays below half a pixel. Let r be the mean radius, D the distance of the
//! centre from the eye, p the finer side of a pixel there (rad) and q the quality. Then u = q r / p is the distance at which the radius covers a
//! pixel (at quality 1). The forms are used:
//!
//! - a level of detail whose surface has an error of at most e mean radii: from 2 e u, where the error is half a pixel,
//! - an impostor: from the distance at which its errors fall below half a pixel ([`ImpostorReach`]),
//! - a point: from u, where the diameter is two pixels, and exclusively from 2 u, where it is one.
//!
//! The coarsest permitted form is drawn. A level or an impostor takes over gradually, while the distance grows from its start by the factor [`BAND`];
//! a point takes over between u and 2 u. Meanwhile an asteroid is drawn in both forms, with shares that add up to 1 and depend only on the distance.
//! A form is left out if the next one would begin before it has taken over completely. `shaders/asteroids/class.wgsl` does the same in f32.

use super::views::ImpostorReach;

/// Factor by which the distance grows while one form takes over from another.
pub const BAND: f64 = 0.1;

/// Form of an asteroid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// A mesh of this level of detail.
    Mesh(u32),
    /// An impostor.
    Impostor,
    /// A point of light.
    Point,
}

/// The form of an asteroid, or two forms while one takes over from the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classes {
    /// The form that takes over.
    pub class: Class,
    /// Its share, 0 to 1.
    pub share: f64,
    /// The previous form, with the remaining share; `None` if the share is 1.
    pub before: Option<Class>,
}

/// Parameters for all asteroids of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassRules {
    /// Factor on distances.
    pub quality: f64,
    /// Distances of impostors; `None`: there are none.
    pub impostor: Option<ImpostorReach>,
    /// Whether every asteroid is drawn with its finest mesh.
    pub finest_only: bool,
}

impl ClassRules {
    /// Forms of an asteroid of radius `radius_m` at `distance_m`, where a pixel has `pixel_rad`. `errors` are those of its levels.
    pub fn classes(
        &self,
        errors: impl Iterator<Item = f64>,
        bound: f64,
        radius_m: f64,
        distance_m: f64,
        pixel_rad: f64,
    ) -> Classes {
        let mut classes = Classes { class: Class::Mesh(0), share: 1.0, before: None };
        if self.finest_only {
            return classes;
        }
        let unit = self.quality * radius_m / pixel_rad;
        let allowed_rad = pixel_rad / self.quality;
        let reach = self.impostor.map_or(f64::INFINITY, |impostor| impostor.start_m(bound * radius_m, allowed_rad));
        let uses_impostor = reach * (1.0 + BAND) <= unit;
        let meshes_until = if uses_impostor { reach } else { unit };
        let mut end = 0.0;
        let mut take = |class: Class, start: f64, stop: f64| {
            let share = if distance_m >= stop { 1.0 } else { (distance_m - start) / (stop - start) };
            classes = Classes { class, share, before: (share < 1.0).then_some(classes.class) };
        };
        for (level, error) in errors.enumerate().skip(1) {
            let start = f64::max(2.0 * error * unit, end);
            let stop = start * (1.0 + BAND);
            if stop > meshes_until || distance_m < start {
                break;
            }
            take(Class::Mesh(level as u32), start, stop);
            end = stop;
        }
        if uses_impostor && distance_m >= reach {
            take(Class::Impostor, reach, reach * (1.0 + BAND));
        }
        if distance_m >= unit {
            take(Class::Point, unit, 2.0 * unit);
        }
        classes
    }
}

impl ImpostorReach {
    /// Distance from which an impostor is permitted for an asteroid within a sphere of `bound_m`, m. `allowed_rad` is the angle of a pixel divided by
    /// the quality.
    pub fn start_m(&self, bound_m: f64, allowed_rad: f64) -> f64 {
        let disparity = (2.0 * self.eyes_m * bound_m / allowed_rad).sqrt();
        let perspective = bound_m * allowed_rad.powf(-self.exponent);
        disparity.max(self.linear * bound_m / allowed_rad).max(perspective)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ERRORS: [f64; 5] = [0.0, 0.004, 0.008, 0.0081, 0.02];

    fn rules(impostor: Option<ImpostorReach>) -> ClassRules {
        ClassRules { quality: 1.0, impostor, finest_only: false }
    }

    /// With increasing distance, forms only become coarser, shares are continuous, and no error exceeds half a pixel.
    #[test]
    fn classes_change_continuously_and_keep_half_a_pixel() {
        for impostor in [
            None,
            Some(ImpostorReach { eyes_m: 0.045, linear: 0.1, exponent: 1.0 / 3.0 }),
            Some(ImpostorReach { eyes_m: 4e3, linear: 0.1, exponent: 0.5 }),
        ] {
            let (radius, pixel) = (20.0, 1e-3);
            let mut before: Option<(Classes, f64)> = None;
            for step in 0..200_000 {
                let distance = 30.0 * (1.0 + 4e-5_f64).powi(step);
                let found = rules(impostor).classes(ERRORS.into_iter(), 1.0, radius, distance, pixel);
                if let Class::Mesh(level) = found.class {
                    assert!(ERRORS[level as usize] * radius / distance <= 0.5 * pixel * (1.0 + 1e-9));
                }
                if let (Class::Impostor, Some(impostor)) = (found.class, impostor) {
                    assert!(impostor.start_m(radius, pixel) <= distance);
                }
                if let Some((last, last_distance)) = before {
                    assert!(last.class <= found.class, "{last:?} {found:?}");
                    // A share changes by no more than its band permits. A new form begins with the share 0 when the previous one has the share 1.
                    let most = (distance - last_distance) / (BAND * last_distance) * (1.0 + 1.2 * BAND);
                    if last.class == found.class {
                        assert!((found.share - last.share).abs() <= most);
                    } else {
                        assert!(1.0 - last.share <= most && found.share <= most, "{last:?} {found:?}");
                        assert_eq!(found.before, Some(last.class));
                    }
                }
                before = Some((found, distance));
            }
            assert_eq!(before.unwrap().0, Classes { class: Class::Point, share: 1.0, before: None });
        }
    }

    #[test]
    fn twice_the_quality_omits_detail_at_twice_the_distance() {
        let classes = |quality: f64, distance: f64| {
            let reach = Some(ImpostorReach { eyes_m: 0.0, linear: 0.1, exponent: 0.0 });
            let rules = ClassRules { quality, impostor: reach, finest_only: false };
            rules.classes(ERRORS.into_iter(), 1.0, 3.0, distance, 1e-3)
        };
        for step in 0..400 {
            let distance = 5.0 * 1.02_f64.powi(step);
            let (one, two) = (classes(1.0, distance), classes(2.0, 2.0 * distance));
            assert_eq!(one.class, two.class);
            assert!((one.share - two.share).abs() < 1e-9);
        }
    }
}

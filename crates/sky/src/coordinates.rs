//! Frames of reference and the rotations between them.
//!
//! The world frame is ICRS: x to right ascension 0, z to the north celestial pole. The galactic frame has x to
//! galactic longitude 0 (towards the galactic centre), y to longitude 90 degrees, z to the north galactic pole.
//! Longitude and latitude may also be right ascension and declination; all angles are in radians.

use glam::{DMat3, DVec3};

/// ICRS right ascension of the north galactic pole, degrees (J2000; Hipparcos Catalogue, ESA SP-1200, vol. 1, 1.5.3).
pub const GALACTIC_POLE_RA_DEG: f64 = 192.859_48;
/// ICRS declination of the north galactic pole, degrees (same source).
pub const GALACTIC_POLE_DEC_DEG: f64 = 27.128_25;
/// Galactic longitude of the north celestial pole, degrees (same source: 90 degrees + 32.93192).
pub const CELESTIAL_POLE_GALACTIC_LONGITUDE_DEG: f64 = 122.931_92;

/// Unit vector at longitude and latitude `lon_rad`, `lat_rad`.
pub fn direction_from_lon_lat(lon_rad: f64, lat_rad: f64) -> DVec3 {
    let (sin_lon, cos_lon) = lon_rad.sin_cos();
    let (sin_lat, cos_lat) = lat_rad.sin_cos();
    DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
}

/// Longitude in [0, 2 pi) and latitude in [-pi/2, pi/2] of a nonzero vector, radians.
pub fn lon_lat_from_direction(direction: DVec3) -> (f64, f64) {
    let lon_rad = direction.y.atan2(direction.x).rem_euclid(std::f64::consts::TAU);
    // The remainder of a tiny negative angle rounds up to the full circle.
    let lon_rad = if lon_rad < std::f64::consts::TAU { lon_rad } else { 0.0 };
    (lon_rad, direction.z.atan2(direction.x.hypot(direction.y)))
}

/// Rotation from galactic to ICRS vectors.
pub fn icrs_from_galactic() -> DMat3 {
    let z_axis = direction_from_lon_lat(GALACTIC_POLE_RA_DEG.to_radians(), GALACTIC_POLE_DEC_DEG.to_radians());
    // The known galactic longitude of the celestial pole fixes the rotation about the galactic pole.
    let towards_celestial_pole = (DVec3::Z - z_axis * z_axis.z).normalize();
    let quarter_turn_on = z_axis.cross(towards_celestial_pole);
    let (sin_l, cos_l) = CELESTIAL_POLE_GALACTIC_LONGITUDE_DEG.to_radians().sin_cos();
    let x_axis = towards_celestial_pole * cos_l - quarter_turn_on * sin_l;
    DMat3::from_cols(x_axis, z_axis.cross(x_axis), z_axis)
}

/// Rotation from ICRS to galactic vectors: the inverse of [`icrs_from_galactic`].
pub fn galactic_from_icrs() -> DMat3 {
    icrs_from_galactic().transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angle between two vectors in degrees, exact for small angles.
    fn separation_deg(a: DVec3, b: DVec3) -> f64 {
        a.cross(b).length().atan2(a.dot(b)).to_degrees()
    }

    #[test]
    fn known_galactic_places_have_their_icrs_coordinates() {
        // (l, b, RA, Dec) in degrees: centre, cross-point at l = 90, poles, the Crab pulsar.
        for (l, b, ra, dec, tolerance) in [
            (0.0, 0.0, 266.405, -28.936, 1e-3),
            (90.0, 0.0, 318.004, 48.330, 1e-3),
            (0.0, 90.0, 192.859_48, 27.128_25, 1e-9),
            (0.0, -90.0, 12.859_48, -27.128_25, 1e-9),
            (184.5575, -5.7843, 83.6332, 22.0145, 2e-3),
            (122.931_92, 27.128_25, 0.0, 90.0, 1e-9),
        ] {
            let galactic = direction_from_lon_lat(f64::to_radians(l), f64::to_radians(b));
            let icrs = direction_from_lon_lat(f64::to_radians(ra), f64::to_radians(dec));
            let error_deg = separation_deg(icrs_from_galactic() * galactic, icrs);
            assert!(error_deg < tolerance, "l {l} b {b}: {error_deg} degrees off");
            assert!(separation_deg(galactic_from_icrs() * icrs, galactic) < tolerance);
        }
    }

    #[test]
    fn the_rotation_is_a_proper_rotation() {
        let rotation = icrs_from_galactic();
        assert!((rotation.determinant() - 1.0).abs() < 1e-14);
        assert!((rotation * galactic_from_icrs()).abs_diff_eq(DMat3::IDENTITY, 1e-14));
    }

    #[test]
    fn longitude_and_latitude_invert_the_direction() {
        for lon_deg in [0.0, 12.5, 90.0, 179.9, 180.0, 270.0, 359.999] {
            for lat_deg in [-89.9, -30.0, 0.0, 45.0, 89.9] {
                let direction = direction_from_lon_lat(f64::to_radians(lon_deg), f64::to_radians(lat_deg)) * 7.0;
                let (lon_rad, lat_rad) = lon_lat_from_direction(direction);
                assert!((lon_rad.to_degrees() - lon_deg).abs() < 1e-9, "{lon_deg} {lat_deg}");
                assert!((lat_rad.to_degrees() - lat_deg).abs() < 1e-9, "{lon_deg} {lat_deg}");
            }
        }
        let (lon_rad, _) = lon_lat_from_direction(DVec3::new(1.0, -1e-300, 0.0));
        assert!((0.0..std::f64::consts::TAU).contains(&lon_rad));
    }
}

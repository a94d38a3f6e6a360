//! Light of a planet with rings, divided between the globe and the rings, so that the picture of both has the measured
//! light although they hide and shade parts of each other.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use crate::{
    photometry::{
        phase_curve::{Tilt, ring_share},
        rings,
    },
    scene::bodies::{Body, Light, SolarBody},
};

/// Number of sample positions along each side of the rectangle around globe and rings.
const PLACES: i32 = 108;

/// Whether a body has rings: Saturn with its measured light.
pub(super) fn has_rings(body: &Body) -> bool {
    body.surface.phase_curve == Some(SolarBody::Saturn)
}

/// Divides the light of a body with rings between globe and rings: reduces the light of the suns on the globe, and
/// returns the luminance of the rings divided by their reflectance, cd/m^2. `None`: the body has no rings.
pub(super) fn lit_rings(body: &Body, eye_m: DVec3, light_lx: [f64; 3], suns: &mut [Light]) -> Option<[f64; 3]> {
    let sun = suns.first().filter(|_| has_rings(body))?;
    let to_eye_m = eye_m - body.position_m;
    let pole = body.orientation * DVec3::Z;
    let latitude_rad = |towards: DVec3| FRAC_PI_2 - pole.angle_between(towards);
    let tilt = Tilt { eye_rad: latitude_rad(to_eye_m), sun_rad: latitude_rad(sun.direction) };
    let share = ring_share(sun.direction.angle_between(to_eye_m), tilt);
    let (mu_eye, mu_sun) = (tilt.eye_rad.sin().abs(), tilt.sun_rad.sin().abs());
    let unit = rings::illuminance_of_unit(mu_eye, mu_sun, body.radii_m.x / to_eye_m.length())?;
    if share <= 0.0 {
        return None;
    }
    let to_body = body.orientation.conjugate();
    let [globe, ring] = open_shares(body, to_body * to_eye_m.normalize(), to_body * sun.direction);
    // The measured light is that of the visible parts.
    let more = 1.0 / (globe * (1.0 - share) + ring * share).max(0.1);
    for sun in suns {
        sun.illuminance_lx = sun.illuminance_lx.map(|lx| lx * (1.0 - share) * more);
    }
    // Divide by the transmission of the air between body and eye: it is applied later, to everything that is drawn.
    Some([0, 1, 2].map(|c| light_lx[c] * share * more / unit / body.seen_through[c].max(1e-9)))
}

/// The zone of a radius, in equatorial radii.
fn zone_at(radius: f64) -> Option<rings::Zone> {
    let within = (rings::INNER..rings::OUTER).contains(&radius);
    rings::ZONES.into_iter().find(|zone| within && radius < zone.outer)
}

/// Fractions of the light of the globe and of the light of the rings that the eye sees: each hides parts of the other from the eye or from the sun.
/// The directions are unit vectors in the axes of the body. Eye and sun are far away, on the same side of the rings.
fn open_shares(body: &Body, to_eye: DVec3, to_sun: DVec3) -> [f64; 2] {
    let shape = body.radii_m / body.radii_m.x;
    let side = DVec3::Z.cross(to_eye).try_normalize().unwrap_or(DVec3::X);
    let up = to_eye.cross(side);
    let (mu_eye, mu_sun) = (to_eye.z.abs(), to_sun.z.abs());
    let [mut globe, mut ring] = [[0.0; 2]; 2];
    // Rings that are seen almost edge-on are narrow: reduce the height of the rectangle to that of globe and rings.
    let half_height = 1.0_f64.max(rings::OUTER * mu_eye);
    for (i, j) in (0..PLACES).flat_map(|i| (0..PLACES).map(move |j| (i, j))) {
        let place = |index: i32| (f64::from(index) + 0.5) / f64::from(PLACES) * 2.0 - 1.0;
        let place = side * (rings::OUTER * place(i)) + up * (half_height * place(j));
        // Positions of the globe's front and of the plane of the rings along the line of sight, counted towards the eye.
        let on_globe = meets_globe(place, to_eye, shape);
        let at_rings = -place.z / to_eye.z;
        let in_rings = place + to_eye * at_rings;
        let zone = zone_at(in_rings.truncate().length());
        if let Some(along) = on_globe {
            let point = place + to_eye * along;
            let normal = (point / (shape * shape)).normalize();
            let light = body.surface.law.luminance_factor(normal.dot(to_sun), normal.dot(to_eye).max(0.0));
            globe[0] += light;
            let hidden = zone.filter(|_| at_rings > along).map_or(0.0, |zone| zone.hidden(mu_eye));
            let steps = -point.z / to_sun.z;
            let shading = zone_at((point + to_sun * steps).truncate().length()).filter(|_| steps > 0.0);
            let shaded = shading.map_or(0.0, |zone| zone.hidden(mu_sun));
            globe[1] += light * (1.0 - hidden) * (1.0 - shaded);
        }
        if let Some(zone) = zone {
            let light = zone.reflected(mu_eye, mu_sun);
            ring[0] += light;
            let is_hidden = on_globe.is_some_and(|along| along > at_rings);
            let is_shaded = meets_globe(in_rings, to_sun, shape).is_some_and(|along| along > 0.0);
            ring[1] += if is_hidden || is_shaded { 0.0 } else { light };
        }
    }
    [globe, ring].map(|[all, open]| if all > 0.0 { open / all } else { 1.0 })
}

/// Returns the position of the farther intersection with the globe, along a line through `place`.
fn meets_globe(place: DVec3, towards: DVec3, shape: DVec3) -> Option<f64> {
    let (place, towards) = (place / shape, towards / shape);
    let squared = towards.length_squared();
    let half = -place.dot(towards) / squared;
    let root = half * half - (place.length_squared() - 1.0) / squared;
    (root >= 0.0).then(|| half + root.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_rings_hide_and_lose_more_than_closed_ones() {
        let saturn = Body::preset(SolarBody::Saturn, "saturn", DVec3::X);
        let shares = |degrees: f64| {
            let towards = DVec3::new(degrees.to_radians().cos(), 0.0, degrees.to_radians().sin());
            open_shares(&saturn, towards, towards)
        };
        // From above the pole nothing is hidden.
        let [globe, ring] = shares(90.0);
        assert!(globe > 0.999 && ring > 0.999, "{globe} {ring}");
        for degrees in [5.0, 15.0, 27.0] {
            let [globe, ring] = shares(degrees);
            println!("{degrees}: globe {globe:.3}, rings {ring:.3}");
            assert!((0.5..1.0).contains(&globe) && (0.5..1.0).contains(&ring), "{degrees}: {globe} {ring}");
        }
    }
}

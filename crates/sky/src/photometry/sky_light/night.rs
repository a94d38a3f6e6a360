//! Light of the night sky from zenith to horizon: a layer of airglow and evenly spread light from space, seen through
//! air that also scatters this light towards the observer, in all orders of scattering.
//!
//! The air does not only dim the light: it scatters the light from one line of sight into others. Near the
//! horizon, where no direct light passes, the sky has the luminance of the air itself, which is lit from all sides (R.
//! H. Garstang, PASP 101, 306, 1989; S. Noll et al., A&A 543, A92, 2012, section 3.6). The mean light at each height
//! and the light of the ground solve a linear system. The light has no sharp features. So scattering by aerosol, which
//! is mostly forwards, is multiplied by one minus its asymmetry (similarity relation of H. C. van de Hulst, "Multiple
//! light scattering", 1980, chapter 14), and is then treated as isotropic.

use std::f64::consts::PI;

use super::{
    ASYMMETRY, Depths, EARTH_KM, FRAC_PI_2, Rgb, TABLE_NODES, TOP_KM, altitude_of_row, each, height_along, height_of,
    lowest_rad, meets_earth, to_sphere_km,
};

/// Height of the layer of airglow, km, and its share in the light of the zenith; the rest comes from space.
const LAYER_KM: f64 = 90.0;
const LAYER_SHARE: f64 = 0.6;
/// Reflectance of the ground below the air.
const GROUND_ALBEDO: f64 = 0.15;
/// Numbers of heights at which the mean light is known, of directions over which it is averaged, and of steps along
/// each.
const HEIGHTS: usize = 20;
const DIRECTIONS: usize = 40;
const STEPS: usize = 32;
/// Unknowns: the mean light at the heights, and the luminance of the ground.
const UNKNOWNS: usize = HEIGHTS + 1;
/// Number of iterations that solve the system: each adds an order of scattering, which has less than half of the light
/// of the previous order.
const ORDERS: usize = 40;

/// Light along a line of sight in one channel: known light, and factors for the unknowns.
#[derive(Clone, Copy)]
struct Line {
    known: f64,
    factors: [f64; UNKNOWNS],
}

impl Line {
    fn luminance(&self, unknowns: &[f64; UNKNOWNS]) -> f64 {
        self.known + self.factors.iter().zip(unknowns).map(|(factor, value)| factor * value).sum::<f64>()
    }
}

/// Light from outside the air at a height, for the sine of an altitude: 1 in the zenith of the ground (J. van Rhijn,
/// Publications of the Astronomical Laboratory at Groningen 31, 1921).
fn from_outside(height_km: f64, sine: f64) -> f64 {
    let shorter = (EARTH_KM + height_km.min(LAYER_KM)) / (EARTH_KM + LAYER_KM);
    let longer = (1.0 - shorter * shorter * (1.0 - sine * sine)).max(1e-3).sqrt().recip();
    1.0 - LAYER_SHARE + LAYER_SHARE * longer
}

/// Scattering and extinction per km by the similarity relation.
fn similar(depths: &Depths, height_km: f64) -> [Rgb; 2] {
    let medium = depths.medium(height_km);
    let forwards = medium.aerosol.map(|scatters| ASYMMETRY * scatters);
    let scatters = each(|c| medium.molecules[c] + medium.aerosol[c] - forwards[c]);
    [scatters, each(|c| medium.extinction[c] - forwards[c])]
}

/// The light that arrives at a height from the sine of an altitude, by channel.
fn line(depths: &Depths, height_km: f64, sine: f64) -> [Line; 3] {
    let radius = EARTH_KM + height_km;
    let on_ground = meets_earth(radius, sine);
    let whole = if on_ground {
        let along = radius * sine;
        -along - (along * along + EARTH_KM * EARTH_KM - radius * radius).max(0.0).sqrt()
    } else {
        to_sphere_km(radius, sine, EARTH_KM + TOP_KM)
    };
    let mut lines = [Line { known: 0.0, factors: [0.0; UNKNOWNS] }; 3];
    let mut open = [1.0; 3];
    let mut before_km = 0.0;
    for step in 1..=STEPS {
        let end_km = whole * (step as f64 / STEPS as f64).powi(2);
        let height = height_along(height_km, sine, 0.5 * (before_km + end_km));
        let [scatters, extinction] = similar(depths, height);
        let place = (height / TOP_KM).clamp(0.0, 1.0).sqrt() * (HEIGHTS - 1) as f64;
        let node = (place as usize).min(HEIGHTS - 2);
        let part = place - node as f64;
        for c in 0..3 {
            let depth = extinction[c] * (end_km - before_km);
            let seen = if depth > 1e-12 {
                open[c] * -(-depth).exp_m1() / extinction[c]
            } else {
                open[c] * (end_km - before_km)
            };
            lines[c].factors[node] += seen * scatters[c] * (1.0 - part);
            lines[c].factors[node + 1] += seen * scatters[c] * part;
            open[c] *= (-depth).exp();
        }
        before_km = end_km;
    }
    for c in 0..3 {
        if on_ground {
            lines[c].factors[HEIGHTS] += open[c];
        } else {
            lines[c].known = open[c] * from_outside(height_km, sine);
        }
    }
    lines
}

/// Sum of lines with weights.
fn sum(lines: impl Iterator<Item = (f64, [Line; 3])>) -> [Line; 3] {
    let mut total = [Line { known: 0.0, factors: [0.0; UNKNOWNS] }; 3];
    for (weight, lines) in lines {
        for (total, line) in total.iter_mut().zip(lines) {
            total.known += weight * line.known;
            total.factors.iter_mut().zip(line.factors).for_each(|(sum, factor)| *sum += weight * factor);
        }
    }
    total
}

/// Luminance of the night sky at the altitudes of a table's rows, relative to the zenith.
pub(super) fn profile(depths: &Depths) -> Vec<Rgb> {
    // Sines from -1 to 1, denser at the horizon.
    let sines = || {
        (0..DIRECTIONS).map(|index| {
            let t = 2.0 * (index as f64 + 0.5) / DIRECTIONS as f64 - 1.0;
            (t * t.abs(), 2.0 * t.abs() / DIRECTIONS as f64)
        })
    };
    let mut rows: Vec<[Line; 3]> = (0..HEIGHTS)
        .map(|index| {
            let height_km = height_of(index as f64 / (HEIGHTS - 1) as f64);
            sum(sines().map(|(sine, weight)| (weight, line(depths, height_km, sine))))
        })
        .collect();
    // Luminance of the ground: its albedo times its illuminance over pi.
    let downwards = sines().filter(|(sine, _)| *sine > 0.0);
    let lit = downwards.map(|(sine, weight)| (GROUND_ALBEDO / PI * 2.0 * PI * 2.0 * sine * weight, sine));
    rows.push(sum(lit.map(|(weight, sine)| (weight, line(depths, 0.0, sine)))));
    let solved = [0, 1, 2].map(|c| {
        let mut unknowns = [0.0; UNKNOWNS];
        for _ in 0..ORDERS {
            let mut next = unknowns;
            next.iter_mut().zip(&rows).for_each(|(value, row)| *value = row[c].luminance(&unknowns));
            unknowns = next;
        }
        unknowns
    });
    let seen = |altitude_rad: f64| {
        let lines = line(depths, depths.height_km, altitude_rad.sin());
        each(|c| lines[c].luminance(&solved[c]))
    };
    let zenith = seen(FRAC_PI_2);
    let lowest = lowest_rad(depths.height_km);
    (0..TABLE_NODES[0])
        .map(|row| {
            let light = seen(altitude_of_row(lowest, row));
            each(|c| light[c] / zenith[c].max(f64::MIN_POSITIVE))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_air_takes_out_of_a_line_it_gives_to_others() {
        // Without absorption, the factors of a line that ends in space sum to the share that does not pass.
        let depths = Depths {
            molecules: [0.3; 3],
            aerosol: [0.0; 3],
            ozone: [0.0; 3],
            height_km: 0.0,
            molecules_below_km: 8.0,
            most_haze_below: 1.0,
        };
        for sine in [0.0, 0.1, 0.5, 1.0] {
            let [line, ..] = line(&depths, 0.0, sine);
            let passed = line.known / from_outside(0.0, sine);
            let sum: f64 = line.factors.iter().sum();
            assert!((sum + passed - 1.0).abs() < 1e-9, "{sine}: {sum} {passed}");
        }
    }
}

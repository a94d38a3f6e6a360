//! Density of each stellar population of the Milky Way.
//!
//! Positions are galactic Cartesian parsecs as seen from the Sun: x to the galactic centre, y to longitude 90
//! degrees, z to the north galactic pole. A density is relative to the population's own density in the plane at the
//! Sun's distance from the centre (for the bulge: relative to the old disc there), so that it multiplies a local
//! luminosity function.
//!
//! Discs are exponential in radius (scale length 2.6 kpc) and height; the young, luminous stars are in the thinnest
//! layer. Sources of the figures: Bahcall and Soneira 1980 (scale heights by luminosity, 90 to 325 pc), Juric et al.
//! 2008 and Bland-Hawthorn and Gerhard 2016 (lengths, thick disc, halo, position of the Sun), Dwek et al. 1995
//! (bulge, model G2).

use std::sync::LazyLock;

/// Distance of the Sun from the galactic centre, parsecs.
pub const SUN_RADIUS_PC: f64 = 8200.0;
/// Height of the Sun above the galactic plane, parsecs.
pub const SUN_HEIGHT_PC: f64 = 20.0;

/// Scale length of the thin disc, parsecs.
const THIN_LENGTH_PC: f64 = 2600.0;
/// Scale length of the thick disc, parsecs.
const THICK_LENGTH_PC: f64 = 2200.0;
/// Scale height of the thick disc, parsecs.
const THICK_HEIGHT_PC: f64 = 900.0;
/// Height over which the cusp of the vertical exponential is rounded off, parsecs.
const ROUNDED_HEIGHT_PC: f64 = 30.0;
/// Radius over which the cusp of the radial exponential is rounded off, parsecs; inside it the bulge dominates.
const ROUNDED_RADIUS_PC: f64 = 1000.0;

/// Exponent of the halo's power law, its flattening c/a, and the core radius that keeps it finite at the centre (parsecs).
const HALO_SLOPE: f64 = 2.8;
const HALO_FLATTENING: f64 = 0.64;
const HALO_CORE_PC: f64 = 1000.0;

/// Semi-axes of the bar-shaped bulge, parsecs: along the bar, across it in the plane, vertical.
const BULGE_AXES_PC: [f64; 3] = [1580.0, 620.0, 430.0];
/// Angle between the bar and the line from the Sun to the centre, degrees. The near end is at positive longitudes.
const BULGE_ANGLE_DEG: f64 = 27.0;
/// Central density of the bulge relative to the old disc at the Sun: 1.3e10 solar masses in the volume above, against
/// 0.03 solar masses per cubic parsec.
const BULGE_CENTRAL_DENSITY: f64 = 50.0;

/// A stellar population: stars with one spatial distribution and one luminosity function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Population {
    /// Main sequence of types O to A and supergiants: the thinnest layer.
    YoungDisc,
    /// Main sequence about type F.
    IntermediateDisc,
    /// Main sequence from G to M, and the giants.
    OldDisc,
    /// The thick disc.
    ThickDisc,
    /// Bulge and bar.
    Bulge,
    /// The stellar halo.
    Halo,
}

impl Population {
    /// All populations. The index in this array is also the index in other arrays by population.
    pub const ALL: [Population; POPULATIONS] =
        [Self::YoungDisc, Self::IntermediateDisc, Self::OldDisc, Self::ThickDisc, Self::Bulge, Self::Halo];

    /// Scale height in parsecs of the populations of the thin disc.
    const fn thin_disc_height_pc(self) -> f64 {
        match self {
            Self::YoungDisc => 90.0,
            Self::IntermediateDisc => 180.0,
            _ => 300.0,
        }
    }
}

/// Number of populations.
pub const POPULATIONS: usize = 6;

/// Galactocentric coordinates of a position, shared by several populations.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Components relative to the galactic centre, along the Sun's x and y axes, and the height above the plane;
    /// parsecs.
    x: f64,
    y: f64,
    height: f64,
    /// Squared distance from the axis of rotation.
    radius2: f64,
}

/// Density of an exponential disc for the radial and the vertical argument of a position.
#[inline]
fn disc([radial_pc, vertical_pc]: [f64; 2], length_pc: f64, height_pc: f64) -> f64 {
    (-radial_pc / length_pc - vertical_pc / height_pc).exp()
}

impl Place {
    /// Creates the position at galactic Cartesian coordinates in parsecs from the Sun.
    #[inline]
    pub fn from_sun(x_pc: f64, y_pc: f64, z_pc: f64) -> Self {
        let x = x_pc - SUN_RADIUS_PC;
        Self { x, y: y_pc, height: z_pc + SUN_HEIGHT_PC, radius2: x * x + y_pc * y_pc }
    }

    /// Distance from the axis, rounded off at the axis, minus its value at the Sun's distance; parsecs.
    fn radial_argument(self) -> f64 {
        static AT_SUN: LazyLock<f64> = LazyLock::new(|| SUN_RADIUS_PC.hypot(ROUNDED_RADIUS_PC));
        (self.radius2 + ROUNDED_RADIUS_PC * ROUNDED_RADIUS_PC).sqrt() - *AT_SUN
    }

    /// Height above or below the plane, rounded off at the plane where it is zero; parsecs.
    fn vertical_argument(self) -> f64 {
        (self.height * self.height + ROUNDED_HEIGHT_PC * ROUNDED_HEIGHT_PC).sqrt() - ROUNDED_HEIGHT_PC
    }

    /// Density of an exponential disc with a scale length and height (parsecs); it is 1 in the plane at the Sun's distance.
    pub fn exponential_disc(self, length_pc: f64, height_pc: f64) -> f64 {
        disc(self.disc_arguments(), length_pc, height_pc)
    }

    /// The radial and the vertical argument of a disc.
    #[inline]
    fn disc_arguments(self) -> [f64; 2] {
        [self.radial_argument(), self.vertical_argument()]
    }

    /// Relative densities of all populations, as [`Place::density`] gives them, in the order of [`Population::ALL`].
    #[inline]
    pub fn densities(self) -> [f64; POPULATIONS] {
        let arguments = self.disc_arguments();
        let of = |population| self.density_for(population, arguments);
        let [young, intermediate, old, thick, bulge, halo] = Population::ALL;
        [of(young), of(intermediate), of(old), of(thick), of(bulge), of(halo)]
    }

    /// Relative density of a population (see the documentation of the module).
    #[inline]
    pub fn density(self, population: Population) -> f64 {
        self.density_for(population, self.disc_arguments())
    }

    /// Relative density of a population, if the arguments of the disc are already known.
    #[inline(always)]
    fn density_for(self, population: Population, arguments: [f64; 2]) -> f64 {
        match population {
            Population::YoungDisc | Population::IntermediateDisc | Population::OldDisc => {
                disc(arguments, THIN_LENGTH_PC, population.thin_disc_height_pc())
            }
            Population::ThickDisc => disc(arguments, THICK_LENGTH_PC, THICK_HEIGHT_PC),
            Population::Bulge => self.bulge(),
            Population::Halo => self.halo(),
        }
    }

    fn bulge(self) -> f64 {
        static ANGLE: LazyLock<(f64, f64)> = LazyLock::new(|| BULGE_ANGLE_DEG.to_radians().sin_cos());
        let (sin, cos) = *ANGLE;
        // The near end points towards the Sun (-x) and to positive longitudes (+y).
        let along = (-cos * self.x + sin * self.y) / BULGE_AXES_PC[0];
        let across = (sin * self.x + cos * self.y) / BULGE_AXES_PC[1];
        let vertical = self.height / BULGE_AXES_PC[2];
        let in_plane2 = along * along + across * across;
        let vertical2 = vertical * vertical;
        let exponent = -0.5 * (in_plane2 * in_plane2 + vertical2 * vertical2).sqrt();
        // Nearly everywhere the exponential is 0, which takes the library long to find out.
        if exponent < -746.0 { 0.0 } else { BULGE_CENTRAL_DENSITY * exponent.exp() }
    }

    fn halo(self) -> f64 {
        let flattened = self.height / HALO_FLATTENING;
        let s2 = self.radius2 + flattened * flattened + HALO_CORE_PC * HALO_CORE_PC;
        let at_sun2 = SUN_RADIUS_PC * SUN_RADIUS_PC + HALO_CORE_PC * HALO_CORE_PC;
        (s2 / at_sun2).powf(-0.5 * HALO_SLOPE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_and_halo_are_one_in_the_plane_at_the_sun() {
        let below_the_sun = Place::from_sun(0.0, 0.0, -SUN_HEIGHT_PC);
        for population in Population::ALL {
            let density = below_the_sun.density(population);
            if population == Population::Bulge {
                assert!(density < 1e-3, "bulge at the Sun: {density}");
            } else {
                assert!((density - 1.0).abs() < 1e-12, "{population:?}: {density}");
            }
        }
    }

    #[test]
    fn densities_of_all_populations_are_those_of_each() {
        for [x, y, z] in [[0.0, 0.0, 0.0], [8000.0, 300.0, -200.0], [-30_000.0, 20_000.0, 5_000.0]] {
            let place = Place::from_sun(x, y, z);
            assert_eq!(place.densities(), Population::ALL.map(|population| place.density(population)));
        }
    }

    #[test]
    fn densities_fall_by_e_over_a_scale_length_and_height() {
        // Far outside the rounded peaks the profile is a pure exponential.
        for (population, height) in [(Population::YoungDisc, 90.0), (Population::OldDisc, 300.0)] {
            let ratio = Place::from_sun(0.0, 0.0, 1000.0).density(population)
                / Place::from_sun(0.0, 0.0, 1000.0 + height).density(population);
            assert!((ratio - std::f64::consts::E).abs() < 0.01, "{population:?}: {ratio}");
        }
        let ratio = Place::from_sun(-2600.0, 0.0, 0.0).density(Population::OldDisc)
            / Place::from_sun(-5200.0, 0.0, 0.0).density(Population::OldDisc);
        assert!((ratio - std::f64::consts::E).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn the_near_end_of_the_bar_is_at_positive_longitude() {
        let angle = 10f64.to_radians();
        let density = |sign: f64| {
            let distance = 6800.0;
            Place::from_sun(distance * angle.cos(), sign * distance * angle.sin(), 0.0).density(Population::Bulge)
        };
        assert!(density(1.0) > 3.0 * density(-1.0), "{} against {}", density(1.0), density(-1.0));
    }
}

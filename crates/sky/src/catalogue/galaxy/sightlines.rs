//! The space around the Sun in cells of galactic longitude, latitude and distance, with the extinction at their
//! corners.
//!
//! Latitudes are narrow at the plane (half a degree) and wide at the poles; distances grow by a constant factor from
//! shell to shell. Between corners the extinction is linear in longitude, latitude and the logarithm of the distance.
//! It is therefore continuous over the whole sky, and inside a cell it never exceeds the values at the corners.
//! Angles are radians, distances parsecs, extinction and distance moduli V magnitudes.

use super::dust;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::LazyLock;

/// Number of cells around the galactic equator.
pub const LONGITUDES: usize = 480;
/// Number of cells from pole to pole.
pub const LATITUDES: usize = 120;
/// Number of shells of distance.
pub const SHELLS: usize = 92;
/// Inner distance of the first shell: that of the star nearest to the Sun, parsecs.
pub const NEAREST_PC: f64 = 1.3;
/// Width of a shell in the decimal logarithm of the distance (92 shells reach 51.8 kpc).
pub const SHELL_LOG10: f64 = 0.05;

/// Number of corners along one line of sight, and in one plane of constant longitude.
const DISTANCES: usize = SHELLS + 1;
pub const PLANE_CORNERS: usize = (LATITUDES + 1) * DISTANCES;

/// Extinction at the corners of all cells.
pub struct Sightlines {
    /// Sorted by longitude, then latitude, then distance.
    extinction_mag: Vec<f32>,
}

/// A cell, given by its indices.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Below [`LONGITUDES`].
    pub longitude: usize,
    /// Below [`LATITUDES`], from the south pole.
    pub latitude: usize,
    /// Below [`SHELLS`], from the Sun.
    pub shell: usize,
}

/// A position in galactic coordinates as seen from the Sun.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Galactic Cartesian parsecs.
    pub position_pc: glam::DVec3,
    /// Apparent minus absolute V magnitude of a star at this position: distance modulus plus extinction.
    pub modulus_mag: f64,
    /// Extinction between the Sun and this position.
    pub extinction_mag: f64,
}

/// Functions of the indices of corners, computed once because millions of cells need them.
struct Tables {
    longitude_sin_cos: Vec<(f64, f64)>,
    latitude_rad: Vec<f64>,
    latitude_sin: Vec<f64>,
    distance_pc: Vec<f64>,
    /// Third power of the distance.
    cubed_pc3: Vec<f64>,
    /// Coordinates of the middles of cells.
    middle_longitude_sin_cos: Vec<(f64, f64)>,
    middle_latitudes: Vec<LatitudeInCell>,
    middle_distances: Vec<DistanceInCell>,
}

/// A latitude inside a cell.
#[derive(Clone, Copy)]
struct LatitudeInCell {
    sin: f64,
    /// Fraction of the angle between the southern and the northern edge.
    fraction: f64,
}

/// A distance inside a cell.
#[derive(Clone, Copy)]
struct DistanceInCell {
    pc: f64,
    log10: f64,
    /// Fraction of the logarithm between the inner and the outer edge.
    fraction: f64,
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// The latitude at a fraction of the sine between the edges of a cell, which are sines and latitudes in rad.
fn latitude_in_cell(sines: [f64; 2], [south, north]: [f64; 2], across: f64) -> LatitudeInCell {
    let sin = lerp(sines[0], sines[1], across);
    LatitudeInCell { sin, fraction: ((sin.asin() - south) / (north - south)).clamp(0.0, 1.0) }
}

/// The distance at a fraction of the volume between the edges of a shell, which are third powers of distances in pc.
fn distance_in_cell(cubed_pc3: [f64; 2], shell: usize, across: f64) -> DistanceInCell {
    let pc = lerp(cubed_pc3[0], cubed_pc3[1], across).cbrt();
    let log10 = pc.log10();
    let fraction = ((log10 - NEAREST_PC.log10()) / SHELL_LOG10 - shell as f64).clamp(0.0, 1.0);
    DistanceInCell { pc, log10, fraction }
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let latitude_rad = |i: usize| {
        let u = 2.0 * i as f64 / LATITUDES as f64 - 1.0;
        FRAC_PI_2 * u * (0.35 + 0.65 * u.abs().powf(1.5))
    };
    let distance_pc = |i: usize| NEAREST_PC * 10f64.powf(SHELL_LOG10 * i as f64);
    let cubed_pc3 = |i: usize| distance_pc(i).powi(3);
    let middle_latitude = |i: usize| {
        let edges_rad = [i, i + 1].map(latitude_rad);
        latitude_in_cell(edges_rad.map(f64::sin), edges_rad, 0.5)
    };
    Tables {
        longitude_sin_cos: (0..=LONGITUDES).map(|i| longitude_rad(i).sin_cos()).collect(),
        latitude_rad: (0..=LATITUDES).map(latitude_rad).collect(),
        latitude_sin: (0..=LATITUDES).map(|i| latitude_rad(i).sin()).collect(),
        distance_pc: (0..DISTANCES).map(distance_pc).collect(),
        cubed_pc3: (0..DISTANCES).map(cubed_pc3).collect(),
        middle_longitude_sin_cos: (0..LONGITUDES).map(|i| longitude_in_cell(i, 0.5).sin_cos()).collect(),
        middle_latitudes: (0..LATITUDES).map(middle_latitude).collect(),
        middle_distances: (0..SHELLS).map(|i| distance_in_cell([i, i + 1].map(cubed_pc3), i, 0.5)).collect(),
    }
});

/// Longitude of corner `i`.
pub fn longitude_rad(i: usize) -> f64 {
    i as f64 * TAU / LONGITUDES as f64
}

/// Longitude at a fraction of a cell.
fn longitude_in_cell(longitude: usize, across: f64) -> f64 {
    lerp(longitude_rad(longitude), longitude_rad(longitude + 1), across)
}

/// Latitude of corner `i`, from the south pole to the north pole.
pub fn latitude_rad(i: usize) -> f64 {
    TABLES.latitude_rad[i]
}

/// Distance of corner `i`, parsecs.
pub fn distance_pc(i: usize) -> f64 {
    TABLES.distance_pc[i]
}

/// Distance modulus of corner `i`, magnitudes.
#[inline]
pub fn distance_modulus_mag(i: usize) -> f64 {
    5.0 * (NEAREST_PC / 10.0).log10() + 5.0 * SHELL_LOG10 * i as f64
}

/// Index in one plane of constant longitude of the corner at a latitude and distance.
#[inline]
pub fn plane_index(latitude: usize, distance: usize) -> usize {
    latitude * DISTANCES + distance
}

/// Galactic Cartesian vector at polar coordinates; the longitude is given by its sine and cosine.
#[inline]
fn from_polar((sin_l, cos_l): (f64, f64), sin_latitude: f64, distance_pc: f64) -> glam::DVec3 {
    let in_plane = distance_pc * (1.0 - sin_latitude * sin_latitude).max(0.0).sqrt();
    glam::DVec3::new(in_plane * cos_l, in_plane * sin_l, distance_pc * sin_latitude)
}

/// Galactic Cartesian parsecs of the corner at the three indices.
#[inline]
pub fn corner_pc(longitude: usize, latitude: usize, distance: usize) -> glam::DVec3 {
    let Tables { longitude_sin_cos, latitude_sin, distance_pc, .. } = &*TABLES;
    from_polar(longitude_sin_cos[longitude], latitude_sin[latitude], distance_pc[distance])
}

impl Cell {
    /// Volume in cubic parsecs.
    #[inline]
    pub fn volume_pc3(self) -> f64 {
        let Tables { latitude_sin, cubed_pc3, .. } = &*TABLES;
        let height = latitude_sin[self.latitude + 1] - latitude_sin[self.latitude];
        TAU / LONGITUDES as f64 * height * (cubed_pc3[self.shell + 1] - cubed_pc3[self.shell]) / 3.0
    }
}

impl Sightlines {
    /// Integrates the dust along every line of sight, with one sample in the middle of each shell.
    pub fn new() -> Self {
        let mut extinction_mag = vec![0f32; LONGITUDES * PLANE_CORNERS];
        extinction_mag.par_chunks_mut(PLANE_CORNERS).enumerate().for_each(|(longitude, plane)| {
            for (latitude, line) in plane.chunks_mut(DISTANCES).enumerate() {
                let direction = from_polar(TABLES.longitude_sin_cos[longitude], TABLES.latitude_sin[latitude], 1.0);
                let mut sum = 0.0;
                for shell in 0..SHELLS {
                    let (near, far) = (distance_pc(shell), distance_pc(shell + 1));
                    let middle = direction * (0.5 * (near + far));
                    sum += dust::opacity_mag_per_pc(middle.x, middle.y, middle.z) * (far - near);
                    line[shell + 1] = sum as f32;
                }
            }
        });
        Self { extinction_mag }
    }

    /// Extinction at the corners of the plane of constant longitude `i` (at most [`LONGITUDES`], which is the same
    /// plane as 0).
    #[inline]
    pub fn plane(&self, i: usize) -> &[f32] {
        let start = (i % LONGITUDES) * PLANE_CORNERS;
        &self.extinction_mag[start..start + PLANE_CORNERS]
    }

    /// Returns the position in a cell at the fractions `across` of the longitude, of the sine of the latitude and of the cube of the distance, each
    /// in 0..1. Uniform fractions fill the volume uniformly.
    pub fn spot(&self, cell: Cell, across: [f64; 3]) -> Spot {
        let Tables { latitude_rad, latitude_sin, cubed_pc3, .. } = &*TABLES;
        let Cell { longitude, latitude, shell } = cell;
        let edges = |of: &[f64], i: usize| [of[i], of[i + 1]];
        self.spot_at(
            cell,
            (longitude_in_cell(longitude, across[0]).sin_cos(), across[0]),
            latitude_in_cell(edges(latitude_sin, latitude), edges(latitude_rad, latitude), across[1]),
            distance_in_cell(edges(cubed_pc3, shell), shell, across[2]),
        )
    }

    /// Returns the middle of a cell, as [`Self::spot`] does for fractions of 0.5.
    pub fn middle(&self, cell: Cell) -> Spot {
        let Tables { middle_longitude_sin_cos, middle_latitudes, middle_distances, .. } = &*TABLES;
        let longitude = (middle_longitude_sin_cos[cell.longitude], 0.5);
        self.spot_at(cell, longitude, middle_latitudes[cell.latitude], middle_distances[cell.shell])
    }

    /// Returns a position in a cell. Its longitude is given by the sine and the cosine, and by the fraction of the cell.
    #[inline]
    fn spot_at(
        &self,
        cell: Cell,
        (longitude_sin_cos, longitude_fraction): ((f64, f64), f64),
        latitude: LatitudeInCell,
        distance: DistanceInCell,
    ) -> Spot {
        // Linear in longitude, latitude and the logarithm of the distance.
        let along = |plane: &[f32], latitude: usize| {
            let index = plane_index(latitude, cell.shell);
            lerp(f64::from(plane[index]), f64::from(plane[index + 1]), distance.fraction)
        };
        let between =
            |plane: &[f32]| lerp(along(plane, cell.latitude), along(plane, cell.latitude + 1), latitude.fraction);
        let [west, east] = [cell.longitude, cell.longitude + 1].map(|longitude| between(self.plane(longitude)));
        let extinction_mag = lerp(west, east, longitude_fraction);
        Spot {
            position_pc: from_polar(longitude_sin_cos, latitude.sin, distance.pc),
            modulus_mag: 5.0 * distance.log10 - 5.0 + extinction_mag,
            extinction_mag,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cells_fill_the_sphere() {
        let mut volume = 0.0;
        for latitude in 0..LATITUDES {
            for shell in 0..SHELLS {
                volume += LONGITUDES as f64 * Cell { longitude: 0, latitude, shell }.volume_pc3();
            }
        }
        let sphere = 2.0 / 3.0 * TAU * (distance_pc(SHELLS).powi(3) - NEAREST_PC.powi(3));
        assert!((volume / sphere - 1.0).abs() < 1e-12, "{volume} of {sphere}");
    }

    #[test]
    fn the_middle_of_a_cell_is_at_half_of_its_coordinates() {
        let sightlines = Sightlines::new();
        for cell in [(0, 0, 0), (479, 119, 91), (130, 61, 40)] {
            let cell = Cell { longitude: cell.0, latitude: cell.1, shell: cell.2 };
            let (middle, spot) = (sightlines.middle(cell), sightlines.spot(cell, [0.5; 3]));
            assert_eq!(
                (middle.position_pc, middle.modulus_mag, middle.extinction_mag),
                (spot.position_pc, spot.modulus_mag, spot.extinction_mag)
            );
        }
    }

    #[test]
    fn extinction_grows_outwards_and_is_continuous_between_cells() {
        let sightlines = Sightlines::new();
        let cell = Cell { longitude: 479, latitude: 60, shell: 40 };
        // Each entry: a face of the cell, the neighbouring cell, and the same face in the coordinates of that cell.
        for (from, beyond, to) in [
            ([1.0, 0.3, 0.6], Cell { longitude: 0, ..cell }, [0.0, 0.3, 0.6]),
            ([0.4, 1.0, 0.6], Cell { latitude: 61, ..cell }, [0.4, 0.0, 0.6]),
            ([0.4, 0.3, 1.0], Cell { shell: 41, ..cell }, [0.4, 0.3, 0.0]),
        ] {
            let (a, b) = (sightlines.spot(cell, from), sightlines.spot(beyond, to));
            assert!((a.modulus_mag - b.modulus_mag).abs() < 1e-6, "{} {}", a.modulus_mag, b.modulus_mag);
            assert!(a.position_pc.distance(b.position_pc) < 1e-6 * a.position_pc.length());
        }
        for line in sightlines.plane(7).chunks(DISTANCES) {
            assert!(line.is_sorted());
        }
    }

    #[test]
    fn the_centre_is_hidden_and_the_poles_are_clear() {
        let sightlines = Sightlines::new();
        let to_8kpc = |longitude: usize, latitude: usize| sightlines.plane(longitude)[plane_index(latitude, 76)];
        let centre = to_8kpc(0, LATITUDES / 2);
        assert!((10.0..80.0).contains(&centre), "A_V to the centre: {centre}");
        for pole in [to_8kpc(0, 0), to_8kpc(0, LATITUDES)] {
            assert!((0.01..0.3).contains(&pole), "A_V at the pole: {pole}");
        }
    }
}

//! Apertures: the shapes of the pupil's open area.
//!
//! An aperture is a signed distance, negative inside the opening, in units of its diameter: x to the right, y up; its
//! enclosing circle has radius 1/2. Intersections and unions take the larger and the smaller of two distances. The
//! result is never farther from 0 than the true distance, so a cell whose centre is half a diagonal from the edge is
//! entirely open or entirely closed. Only the other cells are sampled more finely ([`Aperture::grid`]).
//!
//! The telescopes are approximations from published dimensions: segments 1.32 m flat to flat, 7 mm apart, of a mirror
//! of 6.6 m, with one vertical strut and two at 30 degrees from it (JWST); a central obstruction of 0.33, vanes of
//! 0.022 radii, three mirror pads of 0.065 radii at 0.89 radii (Hubble, the figures of Krist's Tiny Tim).

use std::f64::consts::{FRAC_PI_3, FRAC_PI_6, PI, TAU};

use glam::DVec2;
use rayon::prelude::*;

/// Fewest and most blades of [`Aperture::CurvedBlades`].
pub const BLADES: std::ops::RangeInclusive<u32> = 3..=24;

/// Radius of the arcs of [`Aperture::CurvedBlades`], in units of the diameter: twice the radius of the opening.
const BLADE_RADIUS: f64 = 1.0;

/// Sub-samples along a side of a cell on the edge.
const SUBSAMPLES: usize = 16;

/// JWST: width of a segment between its flats, width of the gaps, width of the struts; metres.
const JWST_SEGMENT_M: f64 = 1.32;
const JWST_GAP_M: f64 = 0.007;
const JWST_STRUT_M: f64 = 0.1;

/// Hubble: central obstruction, full width of the vanes, radius of the pads and their centres, in units of the mirror's
/// radius.
const HUBBLE_OBSTRUCTION: f64 = 0.33;
const HUBBLE_VANE: f64 = 0.022;
const HUBBLE_PAD: f64 = 0.065;
const HUBBLE_PADS: [DVec2; 3] = [DVec2::new(0.8921, 0.0), DVec2::new(-0.4615, 0.7555), DVec2::new(-0.4564, -0.7606)];

/// An aperture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Aperture {
    /// A circle.
    Circle,
    /// A regular hexagon, two of its sides horizontal.
    Hexagon,
    /// The opening of curved blades: the intersection of as many discs. Its corners are on the circle.
    CurvedBlades {
        /// Number of blades, [`BLADES`].
        blades: u32,
    },
    /// Eighteen hexagonal segments with gaps, and three struts.
    Jwst,
    /// A ring with four vanes on the diagonals, and three pads.
    Hubble,
}

impl Aperture {
    /// Names of all apertures, as [`Aperture::from_name`] takes them.
    pub const NAMES: [&'static str; 5] = ["circle", "hexagon", "curved_blades", "jwst", "hubble"];

    /// The aperture with a name; `blades` is used if it has blades. `None` for an unknown name, or if the number is
    /// outside [`BLADES`].
    pub fn from_name(name: &str, blades: u32) -> Option<Self> {
        match name {
            "circle" => Some(Self::Circle),
            "hexagon" => Some(Self::Hexagon),
            "curved_blades" => BLADES.contains(&blades).then_some(Self::CurvedBlades { blades }),
            "jwst" => Some(Self::Jwst),
            "hubble" => Some(Self::Hubble),
            _ => None,
        }
    }

    /// Name in configurations and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::Hexagon => "hexagon",
            Self::CurvedBlades { .. } => "curved_blades",
            Self::Jwst => "jwst",
            Self::Hubble => "hubble",
        }
    }

    /// Open share of each cell of a grid of `n` x `n` cells, row by row from the top, each `cell` diameters wide,
    /// centred on the aperture.
    pub fn grid(self, n: usize, cell: f64) -> Vec<f64> {
        let shape = Shape::new(self);
        let middle = 0.5 * (n as f64 - 1.0);
        let mut cells = vec![0.0; n * n];
        cells.par_chunks_mut(n.max(1)).enumerate().for_each(|(row, line)| {
            for (column, share) in line.iter_mut().enumerate() {
                *share = shape.open_share(DVec2::new(column as f64 - middle, middle - row as f64) * cell, cell);
            }
        });
        cells
    }
}

/// An aperture with precomputed geometry.
enum Shape {
    Circle,
    Hexagon,
    /// Centres of the discs whose intersection is the opening.
    CurvedBlades(Vec<DVec2>),
    Jwst {
        /// Centres, metres.
        segments: Vec<DVec2>,
        /// Directions.
        struts: [DVec2; 3],
        diameter_m: f64,
    },
    Hubble,
}

/// Cosine of 30 degrees; the sine is 1/2.
const COS_30: f64 = 0.866_025_403_784_438_6;

impl Shape {
    fn new(aperture: Aperture) -> Self {
        match aperture {
            Aperture::Circle => Self::Circle,
            Aperture::Hexagon => Self::Hexagon,
            Aperture::CurvedBlades { blades } => Self::CurvedBlades(blade_centres(blades)),
            Aperture::Jwst => {
                let segments: Vec<DVec2> = jwst_segments().collect();
                // A segment's farthest corner is on one of its six axes.
                let corner = JWST_SEGMENT_M / 3.0_f64.sqrt();
                let corners = segments
                    .iter()
                    .flat_map(|c| (0..6).map(|k| *c + DVec2::from_angle(f64::from(k) * FRAC_PI_3) * corner));
                let diameter_m = 2.0 * corners.map(DVec2::length).fold(0.0, f64::max);
                let struts = [0.5 * PI, 1.5 * PI - FRAC_PI_6, 1.5 * PI + FRAC_PI_6].map(DVec2::from_angle);
                Self::Jwst { segments, struts, diameter_m }
            }
            Aperture::Hubble => Self::Hubble,
        }
    }

    /// Signed distance to the edge at `p`, in diameters, negative inside. In some places it is closer to 0 than the
    /// true distance.
    fn distance(&self, p: DVec2) -> f64 {
        match self {
            Self::Circle => p.length() - 0.5,
            Self::Hexagon => hexagon(p, 0.5 * COS_30),
            Self::CurvedBlades(centres) => {
                centres.iter().fold(f64::NEG_INFINITY, |worst, centre| worst.max(p.distance(*centre) - BLADE_RADIUS))
            }
            Self::Jwst { segments, struts, diameter_m } => {
                let p = p * *diameter_m;
                let mirror =
                    segments.iter().map(|c| hexagon(p - *c, 0.5 * JWST_SEGMENT_M)).fold(f64::INFINITY, f64::min);
                let struts = struts.map(|along| strut(p, along, 0.5 * JWST_STRUT_M));
                mirror.max(-struts.into_iter().fold(f64::INFINITY, f64::min)) / *diameter_m
            }
            Self::Hubble => hubble(p),
        }
    }

    /// Open share of a square cell.
    fn open_share(&self, centre: DVec2, cell: f64) -> f64 {
        let distance = self.distance(centre);
        if distance.abs() >= cell * std::f64::consts::FRAC_1_SQRT_2 {
            return if distance < 0.0 { 1.0 } else { 0.0 };
        }
        let offset = |i: usize| ((i as f64 + 0.5) / SUBSAMPLES as f64 - 0.5) * cell;
        let open = (0..SUBSAMPLES * SUBSAMPLES)
            .filter(|i| self.distance(centre + DVec2::new(offset(i % SUBSAMPLES), offset(i / SUBSAMPLES))) < 0.0)
            .count();
        open as f64 / (SUBSAMPLES * SUBSAMPLES) as f64
    }
}

/// A regular hexagon with the apothem `apothem`, two of its sides horizontal.
fn hexagon(p: DVec2, apothem: f64) -> f64 {
    let p = p.abs();
    (COS_30 * p.x + 0.5 * p.y).max(p.y) - apothem
}

/// Centres of the discs of radius [`BLADE_RADIUS`], each moved away from its arc.
fn blade_centres(blades: u32) -> Vec<DVec2> {
    // Two neighbouring arcs meet at radius 1/2 and pi/n from the centre of either:
    // (1/2)^2 + shift cos(pi/n) + shift^2 = R^2.
    let half_cos = 0.5 * (PI / f64::from(blades)).cos();
    let shift = -half_cos + (half_cos * half_cos + BLADE_RADIUS * BLADE_RADIUS - 0.25).sqrt();
    (0..blades).map(|blade| DVec2::from_angle((f64::from(blade) + 0.5) / f64::from(blades) * TAU) * -shift).collect()
}

/// Centres of the JWST's segments in metres, without the central one.
fn jwst_segments() -> impl Iterator<Item = DVec2> {
    let pitch = JWST_SEGMENT_M + JWST_GAP_M;
    // Two steps of the hexagonal lattice, along normals of the sides.
    let (a, b) = (DVec2::from_angle(FRAC_PI_6) * pitch, DVec2::from_angle(FRAC_PI_6 + FRAC_PI_3) * pitch);
    (-2_i32..=2)
        .flat_map(move |i| (-2_i32..=2).map(move |j| (i, j)))
        .filter(|(i, j)| (1..=2).contains(&i.abs().max(j.abs()).max((i + j).abs())))
        .map(move |(i, j)| a * f64::from(i) + b * f64::from(j))
}

/// A bar from the centre outwards.
fn strut(p: DVec2, along: DVec2, half_width: f64) -> f64 {
    (p.perp_dot(along).abs() - half_width).max(-p.dot(along))
}

fn hubble(p: DVec2) -> f64 {
    let p = 2.0 * p;
    let ring = (p.length() - 1.0).max(HUBBLE_OBSTRUCTION - p.length());
    let vanes = p.dot(DVec2::ONE).abs().min(p.dot(DVec2::new(1.0, -1.0)).abs()) * std::f64::consts::FRAC_1_SQRT_2
        - 0.5 * HUBBLE_VANE;
    let pads = HUBBLE_PADS.map(|pad| (p - pad).length() - HUBBLE_PAD).into_iter().fold(f64::INFINITY, f64::min);
    0.5 * ring.max(-vanes).max(-pads)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Aperture; 5] =
        [Aperture::Circle, Aperture::Hexagon, Aperture::CurvedBlades { blades: 6 }, Aperture::Jwst, Aperture::Hubble];

    fn open_area(aperture: Aperture, n: usize) -> f64 {
        let cell = 1.02 / n as f64;
        aperture.grid(n, cell).iter().sum::<f64>() * cell * cell
    }

    #[test]
    fn areas_match_geometry() {
        let hexagon = 3.0 * 3.0_f64.sqrt() / 8.0;
        let found = open_area(Aperture::Circle, 400);
        assert!((found / (0.25 * PI) - 1.0).abs() < 1e-4, "{found}");
        assert!((open_area(Aperture::Hexagon, 400) / hexagon - 1.0).abs() < 1e-4);
        // A wrong shape must fail.
        assert!((open_area(Aperture::Hexagon, 400) / (0.25 * PI) - 1.0).abs() > 0.1);
        // Blades: larger than the hexagon through the corners, smaller than the circle.
        let blades = open_area(Aperture::CurvedBlades { blades: 6 }, 400);
        assert!(blades > 1.05 * hexagon && blades < 0.99 * 0.25 * PI, "{blades}");
        // Eighteen segments without struts, and the struts' share.
        let jwst_m2 = 18.0 * 0.5 * 3.0_f64.sqrt() * JWST_SEGMENT_M * JWST_SEGMENT_M;
        let share = open_area(Aperture::Jwst, 800);
        println!("open share of the enclosing circle: jwst {:.4}, hubble {:.4}", share / (0.25 * PI), {
            open_area(Aperture::Hubble, 800) / (0.25 * PI)
        });
        let diameter_m = 2.0 * (DVec2::from_angle(FRAC_PI_6) * 2.654 + DVec2::new(0.762_1, 0.0)).length();
        let without_struts = jwst_m2 / diameter_m.powi(2);
        assert!(share < 0.99 * without_struts && share > 0.93 * without_struts, "{share} of {without_struts}");
    }

    #[test]
    fn apertures_touch_the_enclosing_circle_and_stay_inside() {
        for aperture in ALL {
            let shape = Shape::new(aperture);
            let farthest = (0..2000)
                .flat_map(|angle| (0..1000).map(move |r| (f64::from(angle) / 2000.0 * TAU, f64::from(r) * 6e-4)))
                .filter(|(angle, radius)| shape.distance(DVec2::from_angle(*angle) * *radius) < 0.0)
                .fold(0.0, |far: f64, (_, radius)| far.max(radius));
            assert!((farthest - 0.5).abs() < 2e-3, "{aperture:?}: {farthest}");
        }
    }

    #[test]
    fn distances_never_exceed_the_true_ones() {
        // `open_share` relies on this: within the distance the sign does not change.
        for aperture in ALL {
            let shape = Shape::new(aperture);
            for i in 0..4000 {
                let p = DVec2::from_angle(f64::from(i) * 2.4) * (f64::from(i) / 4000.0).sqrt() * 0.55;
                let distance = shape.distance(p);
                for k in 0..32 {
                    let q = p + DVec2::from_angle(f64::from(k) / 32.0 * TAU) * distance.abs() * 0.999;
                    assert!(shape.distance(q) * distance >= 0.0, "{aperture:?} at {p}");
                }
            }
        }
    }

    #[test]
    fn there_are_eighteen_segments_one_pitch_apart() {
        let centres: Vec<DVec2> = jwst_segments().collect();
        assert_eq!(centres.len(), 18);
        for (i, a) in centres.iter().enumerate() {
            let nearest =
                centres.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| a.distance(*b)).fold(9.0, f64::min);
            assert!((nearest - 1.327).abs() < 1e-9);
        }
    }

    #[test]
    fn from_name_inverts_name() {
        for aperture in ALL {
            assert_eq!(Aperture::from_name(aperture.name(), 6), Some(aperture));
            assert!(Aperture::NAMES.contains(&aperture.name()));
        }
        assert_eq!(Aperture::from_name("square", 6), None);
        assert_eq!(Aperture::from_name("curved_blades", 2), None);
    }
}

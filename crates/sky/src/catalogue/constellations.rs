//! The constellations of the IAU: their borders, the constellation at a direction, and their names.

use std::{
    f64::consts::{PI, TAU},
    sync::OnceLock,
};

use glam::{DMat3, DVec3};
use sofars::pnp::pmat06;

use super::names;
use crate::{
    coordinates::{direction_from_lon_lat, lon_lat_from_direction},
    units::{ARCSECOND_RAD, J2000_JD},
};

const TABLE: &str = include_str!("constellation_borders.csv");
/// B1875.0 as days from J2000.0.
const B1875_DAYS: f64 = 2_405_889.258_55 - J2000_JD;
/// Number of rings of sample directions from which the centres of the constellations are computed.
const RINGS: u32 = 180;

/// Abbreviation and name of a constellation. Serpens has two parts.
pub type Constellation = (&'static str, &'static str);

/// All constellations, sorted by abbreviation.
pub const CONSTELLATIONS: [Constellation; 89] = [
    ("And", "Andromeda"),
    ("Ant", "Antlia"),
    ("Aps", "Apus"),
    ("Aql", "Aquila"),
    ("Aqr", "Aquarius"),
    ("Ara", "Ara"),
    ("Ari", "Aries"),
    ("Aur", "Auriga"),
    ("Boo", "Bootes"),
    ("CMa", "Canis Major"),
    ("CMi", "Canis Minor"),
    ("CVn", "Canes Venatici"),
    ("Cae", "Caelum"),
    ("Cam", "Camelopardalis"),
    ("Cap", "Capricornus"),
    ("Car", "Carina"),
    ("Cas", "Cassiopeia"),
    ("Cen", "Centaurus"),
    ("Cep", "Cepheus"),
    ("Cet", "Cetus"),
    ("Cha", "Chamaeleon"),
    ("Cir", "Circinus"),
    ("Cnc", "Cancer"),
    ("Col", "Columba"),
    ("Com", "Coma Berenices"),
    ("CrA", "Corona Australis"),
    ("CrB", "Corona Borealis"),
    ("Crt", "Crater"),
    ("Cru", "Crux"),
    ("Crv", "Corvus"),
    ("Cyg", "Cygnus"),
    ("Del", "Delphinus"),
    ("Dor", "Dorado"),
    ("Dra", "Draco"),
    ("Equ", "Equuleus"),
    ("Eri", "Eridanus"),
    ("For", "Fornax"),
    ("Gem", "Gemini"),
    ("Gru", "Grus"),
    ("Her", "Hercules"),
    ("Hor", "Horologium"),
    ("Hya", "Hydra"),
    ("Hyi", "Hydrus"),
    ("Ind", "Indus"),
    ("LMi", "Leo Minor"),
    ("Lac", "Lacerta"),
    ("Leo", "Leo"),
    ("Lep", "Lepus"),
    ("Lib", "Libra"),
    ("Lup", "Lupus"),
    ("Lyn", "Lynx"),
    ("Lyr", "Lyra"),
    ("Men", "Mensa"),
    ("Mic", "Microscopium"),
    ("Mon", "Monoceros"),
    ("Mus", "Musca"),
    ("Nor", "Norma"),
    ("Oct", "Octans"),
    ("Oph", "Ophiuchus"),
    ("Ori", "Orion"),
    ("Pav", "Pavo"),
    ("Peg", "Pegasus"),
    ("Per", "Perseus"),
    ("Phe", "Phoenix"),
    ("Pic", "Pictor"),
    ("PsA", "Piscis Austrinus"),
    ("Psc", "Pisces"),
    ("Pup", "Puppis"),
    ("Pyx", "Pyxis"),
    ("Ret", "Reticulum"),
    ("Scl", "Sculptor"),
    ("Sco", "Scorpius"),
    ("Sct", "Scutum"),
    ("SerCa", "Serpens Caput"),
    ("SerCd", "Serpens Cauda"),
    ("Sex", "Sextans"),
    ("Sge", "Sagitta"),
    ("Sgr", "Sagittarius"),
    ("Tau", "Taurus"),
    ("Tel", "Telescopium"),
    ("TrA", "Triangulum Australe"),
    ("Tri", "Triangulum"),
    ("Tuc", "Tucana"),
    ("UMa", "Ursa Major"),
    ("UMi", "Ursa Minor"),
    ("Vel", "Vela"),
    ("Vir", "Virgo"),
    ("Vol", "Volans"),
    ("Vul", "Vulpecula"),
];

/// A segment of a border along a parallel or a meridian of B1875.0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Right ascension of its start and of its end, eastwards, rad; the end may exceed a full turn. Both are equal along a meridian.
    pub ra_rad: [f64; 2],
    /// Declination of both ends, rad.
    pub dec_rad: [f64; 2],
    /// Constellations north and south of the segment; for a meridian, those on its two sides.
    pub sides: [&'static str; 2],
}

/// Returns all border segments, each once.
pub fn borders() -> &'static [Border] {
    static BORDERS: OnceLock<Vec<Border>> = OnceLock::new();
    BORDERS.get_or_init(|| TABLE.lines().filter(|line| !line.starts_with('#')).skip(1).map(border).collect())
}

/// Parses a row. The table is part of the program: an unreadable row is a bug, which the tests below catch.
fn border(line: &'static str) -> Border {
    let fields: Vec<&'static str> = line.split(',').collect();
    let number = |index: usize| fields[index].parse::<f64>().expect("the built-in table has numbers");
    let [from, mut to] = [number(0), number(1)].map(|seconds| seconds / 86_400.0 * TAU);
    if to < from {
        to += TAU;
    }
    Border {
        ra_rad: [from, to],
        dec_rad: [number(2), number(3)].map(|arcseconds| arcseconds * ARCSECOND_RAD),
        sides: [fields[4], fields[5]],
    }
}

/// Returns the rotation from the mean equator and equinox of B1875.0 to ICRS.
pub fn icrs_from_b1875() -> DMat3 {
    static ROTATION: OnceLock<DMat3> = OnceLock::new();
    // SOFA stores matrices by rows: read as columns, the array gives the inverse matrix.
    *ROTATION.get_or_init(|| DMat3::from_cols_array_2d(&pmat06(J2000_JD, B1875_DAYS)))
}

/// Returns the constellation that contains a direction (ICRS unit vector).
pub fn constellation_of(direction: DVec3) -> Constellation {
    CONSTELLATIONS[number_of(direction)]
}

/// Index into [`CONSTELLATIONS`] of the constellation at a direction.
fn number_of(direction: DVec3) -> usize {
    let (ra_rad, dec_rad) = lon_lat_from_direction(icrs_from_b1875().transpose() * direction);
    let ra_rad = ra_rad.rem_euclid(TAU);
    let spans = |border: &&Border| {
        let [from, to] = border.ra_rad;
        from < to && ((from..to).contains(&ra_rad) || (from..to).contains(&(ra_rad + TAU)))
    };
    // Find the nearest border to the north: the constellation is on its southern side.
    let north = borders().iter().filter(spans).filter(|border| border.dec_rad[0] > dec_rad);
    let next = north.min_by(|a, b| a.dec_rad[0].total_cmp(&b.dec_rad[0])).map_or("UMi", |border| border.sides[1]);
    let found = CONSTELLATIONS.binary_search_by_key(&next, |(short, _)| short);
    found.expect("the built-in table has known constellations")
}

/// Returns the index in [`CONSTELLATIONS`] of the constellation with this name or abbreviation, ignoring case. `Ser` and `Serpens` mean Serpens
/// Caput.
pub fn find(name: &str) -> Option<usize> {
    let is_it = |(short, full): &Constellation| names::is_same(short, name) || names::is_same(full, name);
    let is_serpens = names::is_same("Ser", name) || names::is_same("Serpens", name);
    CONSTELLATIONS.iter().position(is_it).or_else(|| is_serpens.then(|| find("SerCa"))?)
}

/// Names and centres of the constellations. A centre is the mean direction over the area, an ICRS unit vector.
pub fn middles() -> &'static [(&'static str, DVec3)] {
    static MIDDLES: OnceLock<Vec<(&'static str, DVec3)>> = OnceLock::new();
    MIDDLES.get_or_init(|| {
        let mut sums = [DVec3::ZERO; CONSTELLATIONS.len()];
        for ring in 0..RINGS {
            let latitude = ((f64::from(ring) + 0.5) / f64::from(RINGS) - 0.5) * PI;
            let places = (2.0 * f64::from(RINGS) * latitude.cos()).ceil() as u32;
            for place in 0..places {
                let direction = direction_from_lon_lat(f64::from(place) / f64::from(places) * TAU, latitude);
                sums[number_of(direction)] += direction;
            }
        }
        CONSTELLATIONS.iter().zip(sums).map(|((_, name), sum)| (*name, sum.normalize_or_zero())).collect()
    })
}

/// Solid angle of each of [`CONSTELLATIONS`], sr. Each border along a parallel contributes an area that is added to the constellation south of it and
/// subtracted from the one north of it.
pub fn areas_sr() -> &'static [f64] {
    static AREAS: OnceLock<Vec<f64>> = OnceLock::new();
    AREAS.get_or_init(|| {
        let area_sr = |short: &str| -> f64 {
            let piece = |border: &Border| {
                let [from, to] = border.ra_rad;
                let [north, south] = border.sides.map(|side| f64::from(u8::from(side == short)));
                (to - from) * border.dec_rad[0].sin() * (south - north)
            };
            // The polar constellations extend to the pole.
            let cap = if short == "UMi" || short == "Oct" { TAU } else { 0.0 };
            cap + borders().iter().map(piece).sum::<f64>()
        };
        CONSTELLATIONS.iter().map(|(short, _)| area_sr(short)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::bright::named_bright_stars;

    #[test]
    fn the_table_has_every_constellation_in_order() {
        assert!(CONSTELLATIONS.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(borders().len(), 781);
        let known = |side: &&str| CONSTELLATIONS.iter().any(|(short, _)| short == side);
        assert!(borders().iter().all(|border| border.sides.iter().all(&known)));
        for (short, _) in CONSTELLATIONS {
            assert!(borders().iter().any(|border| border.sides.contains(&short)), "{short}");
        }
    }

    #[test]
    fn stars_lie_in_the_constellations_of_their_names() {
        // Bayer and Flamsteed designations are older than the borders. The borders were drawn to agree with them, but since then a few stars have
        // crossed a border.
        let mut wrong = Vec::new();
        let mut compared = 0;
        for star in named_bright_stars(0.0) {
            let Some((_, rest)) = star.designation.split_once(' ').filter(|(prefix, _)| *prefix != "HR") else {
                continue;
            };
            let abbreviation = rest.split(' ').next().unwrap_or_default();
            let (found, _) = constellation_of(star.star.position.normalize());
            compared += 1;
            if found.get(..3) != Some(abbreviation) {
                wrong.push(format!("{} is in {found}", star.designation));
            }
        }
        println!("{compared} stars, {} elsewhere: {}", wrong.len(), wrong.join(", "));
        assert!(compared > 2500 && wrong.len() < 40, "{compared} {wrong:?}");
    }

    #[test]
    fn areas_match_the_published_ones() {
        // Areas in square degrees from the IAU's list of constellations.
        let published = [
            ("Hya", 1302.844),
            ("UMa", 1279.660),
            ("Ori", 594.120),
            ("UMi", 255.864),
            ("Oct", 291.045),
            ("Cru", 68.447),
        ];
        let degrees = |short: &str| {
            let number = CONSTELLATIONS.iter().position(|(abbreviation, _)| *abbreviation == short).unwrap_or_default();
            areas_sr()[number].to_degrees().to_degrees()
        };
        for (short, expected) in published {
            println!("{short}: {:.3} square degrees, published {expected}", degrees(short));
            assert!((degrees(short) - expected).abs() < 0.02, "{short}: {}", degrees(short));
        }
        assert!((areas_sr().iter().sum::<f64>() - 4.0 * PI).abs() < 1e-9);
    }

    #[test]
    fn centres_are_near_the_published_positions() {
        for (name, ra_deg, dec_deg) in
            [("Orion", 83.0, 6.0), ("Crux", 187.0, -60.0), ("Ursa Minor", 225.0, 78.0), ("Octans", 339.0, -83.0)]
        {
            let expected = direction_from_lon_lat(f64::to_radians(ra_deg), f64::to_radians(dec_deg));
            let found = middles()
                .iter()
                .find(|(constellation, _)| *constellation == name)
                .map(|(_, middle)| *middle)
                .unwrap_or_default();
            assert!(found.angle_between(expected).to_degrees() < 4.0, "{name}: {found}");
        }
    }
}

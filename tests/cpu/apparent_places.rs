//! Apparent positions of the Sun, the Moon, planets and stars at 20 dates and 6 places, compared with Skyfield and
//! JPL's DE440.

use std::collections::HashMap;

use serde::{Deserialize, de::DeserializeOwned};
use steradian::{
    catalogue::{StarRecord, motion::StarMotion},
    config::Config,
    coordinates::direction_from_lon_lat,
    glam::DVec3,
    observer::{Clock, Place, horizontal_direction},
    solar_system::SolarBody,
    units::{ARCSECOND_RAD, ASTRONOMICAL_UNIT_M, PARSEC_M},
};

#[derive(Deserialize)]
struct Row {
    time: String,
    delta_t_s: Option<f64>,
    ut1_utc_s: Option<f64>,
    place: String,
    object: String,
    ra_deg: f64,
    dec_deg: f64,
    azimuth_deg: f64,
    altitude_deg: f64,
    distance_au: f64,
}

/// A star with catalogue values.
#[derive(Clone, Copy)]
struct CatalogueStar {
    direction: DVec3,
    distance_pc: Option<f64>,
    motion: StarMotion,
}

#[derive(Deserialize)]
struct PlaceRow {
    place: String,
    latitude_deg: f64,
    longitude_deg: f64,
    height_m: f64,
}

fn table<T: DeserializeOwned>(name: &str) -> Vec<T> {
    let path = format!("{}/tests/data/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// A row of the table of stars. Their motion is from the Bright Star Catalogue.
#[derive(Deserialize)]
struct StarRow {
    object: String,
    ra_deg: f64,
    dec_deg: f64,
    pm_ra_arcsec: f64,
    pm_dec_arcsec: f64,
    parallax_arcsec: f64,
    radial_velocity_km_s: f64,
}

fn direction(longitude_deg: f64, latitude_deg: f64) -> DVec3 {
    direction_from_lon_lat(longitude_deg.to_radians(), latitude_deg.to_radians())
}

/// Converts a time in a configuration to seconds since 2000-01-01T12:00:00.
fn time_s(text: &str) -> f64 {
    let config = Config::from_text(&format!("[scene]\ntime = {text}Z\n"), "time", std::path::Path::new("."), &[]);
    config.unwrap().scene.time_s()
}

/// Largest errors of a kind of object: apparent direction and horizontal position, arcsec, and relative distance.
#[derive(Default)]
struct Worst {
    apparent: f64,
    horizontal: f64,
    distance: f64,
    count: usize,
}

impl Worst {
    fn add(&mut self, apparent: f64, horizontal: f64, distance: f64) {
        self.apparent = self.apparent.max(apparent / ARCSECOND_RAD);
        self.horizontal = self.horizontal.max(horizontal / ARCSECOND_RAD);
        self.distance = self.distance.max(distance);
        self.count += 1;
    }
}

/// Returns the errors by kind of object, with clocks that `changed` modifies.
fn errors(changed: impl Fn(Clock) -> Clock) -> HashMap<String, Worst> {
    let places: HashMap<String, Place> = table::<PlaceRow>("places")
        .into_iter()
        .map(|row| {
            let [latitude_rad, longitude_rad] = [row.latitude_deg, row.longitude_deg].map(f64::to_radians);
            (row.place, Place { latitude_rad, longitude_rad, height_m: row.height_m })
        })
        .collect();
    let stars: HashMap<String, CatalogueStar> = table::<StarRow>("stars")
        .into_iter()
        .map(|row| {
            let motion = StarMotion {
                pm_ra_arcsec: row.pm_ra_arcsec,
                pm_dec_arcsec: row.pm_dec_arcsec,
                radial_velocity_km_s: row.radial_velocity_km_s,
            };
            let distance_pc = (row.parallax_arcsec > 0.0).then(|| 1.0 / row.parallax_arcsec);
            let star = CatalogueStar { direction: direction(row.ra_deg, row.dec_deg), distance_pc, motion };
            (row.object, star)
        })
        .collect();
    let mut worst: HashMap<String, Worst> = HashMap::new();
    for row in table::<Row>("apparent_places") {
        let ut1_minus_utc_s = row.ut1_utc_s.unwrap_or(0.0);
        // The UTC of the table keeps the 37 leap seconds of 2017, whereas ours follows a prediction from 2027 on.
        let of_table = row.ut1_utc_s.filter(|_| row.time.as_str() >= "2027").map(|ut1_utc_s| 69.184 - ut1_utc_s);
        let clock = changed(Clock { delta_t_s: row.delta_t_s.or(of_table), ut1_minus_utc_s });
        let standpoint = places[&row.place].standpoint(time_s(&row.time), &clock);
        let planet = SolarBody::from_name(&row.object);
        let (kind, place_m) = match planet {
            Some(body) => (row.object.as_str(), standpoint.apparent_m(body)),
            None => {
                let CatalogueStar { direction, distance_pc, motion } = stars[&row.object];
                let epoch = standpoint.of_stars();
                let position = motion.after(direction, distance_pc, epoch.years);
                let distance_known = distance_pc.is_some();
                let record = StarRecord { position, magnitude: 0.0, temperature_k: 5772.0, distance_known };
                let seen = epoch.seen(record).position;
                ("star", if distance_known { seen * PARSEC_M - standpoint.position_m } else { seen })
            }
        };
        let apparent = place_m.angle_between(direction(row.ra_deg, row.dec_deg));
        let [azimuth, altitude] = standpoint.azimuth_altitude_rad(place_m);
        let expected = horizontal_direction(row.azimuth_deg.to_radians(), row.altitude_deg.to_radians());
        let horizontal = horizontal_direction(azimuth, altitude).angle_between(expected);
        let distance = match planet {
            Some(_) => (place_m.length() / ASTRONOMICAL_UNIT_M / row.distance_au - 1.0).abs(),
            None => 0.0,
        };
        worst.entry(kind.to_owned()).or_default().add(apparent, horizontal, distance);
    }
    worst
}

/// Limits, arcsec, of about four times the measured errors. The computed stars lack the deflection of light by the Sun,
/// and the computed Moon lacks terms below 0.01 arcsec.
const MOST_ARCSEC: [(&str, f64); 10] = [
    ("sun", 0.15),
    ("moon", 0.8),
    ("mercury", 0.2),
    ("venus", 0.2),
    ("mars", 1.1),
    ("jupiter", 1.3),
    ("saturn", 1.2),
    ("uranus", 1.3),
    ("neptune", 0.5),
    ("star", 0.9),
];

#[test]
fn apparent_positions_match_de440() {
    let found = errors(|clock| clock);
    assert_eq!(found.len(), MOST_ARCSEC.len());
    for (kind, most) in MOST_ARCSEC {
        let Worst { apparent, horizontal, distance, count } = &found[kind];
        println!(
            "{kind}: {count} places, at most {apparent:.3} arcsec, over the horizon {horizontal:.3}, distance {distance:.1e}"
        );
        assert!(*count >= 120 && *apparent < most && *horizontal < most && *distance < 8e-6, "{kind}");
    }
}

/// In 0.1 s of UT1 the Earth rotates by 1.5 arcsec. In a minute of TT the Moon moves by half an arcminute.
#[test]
fn wrong_clocks_are_detected() {
    let turned = errors(|clock| Clock { ut1_minus_utc_s: clock.ut1_minus_utc_s + 0.1, ..clock });
    assert!(turned["star"].horizontal > 1.3 && turned["star"].apparent < 0.9, "{}", turned["star"].horizontal);
    let late = errors(|clock| Clock { delta_t_s: Some(clock.delta_t_s.unwrap_or(69.0) + 60.0), ..clock });
    assert!(late["moon"].apparent > 20.0, "{}", late["moon"].apparent);
}

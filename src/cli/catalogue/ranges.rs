//! Values of options: ranges and cones.

use std::str::FromStr;

use glam::DVec3;

use crate::coordinates::direction_from_lon_lat;

/// A range `A..B` of numbers. If an end is missing, the range has no limit there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range(pub [f64; 2]);

impl FromStr for Range {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let end = |text: &str, missing: f64| match text.trim() {
            "" => Some(missing),
            text => text.parse().ok().filter(|value: &f64| value.is_finite()),
        };
        let ends =
            text.split_once("..").and_then(|(from, to)| Some([end(from, f64::NEG_INFINITY)?, end(to, f64::INFINITY)?]));
        match ends {
            Some(ends) if ends[0] <= ends[1] => Ok(Self(ends)),
            _ => Err("must be two numbers in order, such as 13..16, or one end alone, such as ..15".to_owned()),
        }
    }
}

/// A cone `RA,DEC,RADIUS` in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector along its axis.
    pub axis: DVec3,
    /// Half-angle, rad.
    pub half_rad: f64,
}

impl FromStr for Cone {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
        let fields = text.split(',').count();
        match numbers[..] {
            [ra, dec, radius]
                if fields == 3 && (0.0..=360.0).contains(&ra) && dec.abs() <= 90.0 && radius > 0.0 && radius <= 180.0 =>
            {
                Ok(Self { axis: direction_from_lon_lat(ra.to_radians(), dec.to_radians()), half_rad: radius.to_radians() })
            }
            _ => Err("must be right ascension (0 to 360), declination (-90 to 90) and half-angle (up to 180) in degrees, such as \
                      83.8,-5.4,10"
                .to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_cones_are_parsed_or_refused() {
        assert_eq!("13..16.5".parse(), Ok(Range([13.0, 16.5])));
        assert_eq!("..-1".parse(), Ok(Range([f64::NEG_INFINITY, -1.0])));
        assert!(["16..13", "3", "a..b", "nan..1", "1...2", ""].iter().all(|text| text.parse::<Range>().is_err()));
        let cone: Cone = "90,-30,5".parse().expect("a cone");
        assert!((cone.axis - DVec3::new(0.0, 0.75_f64.sqrt(), -0.5)).length() < 1e-12);
        assert!(
            ["90,-30", "90,-91,5", "90,0,0", "361,0,1", "1,2,3,4", "1,x,2,3"]
                .iter()
                .all(|text| text.parse::<Cone>().is_err())
        );
    }
}

//! Recognition of a file's columns by their names.
//!
//! Names are compared without case and surrounding blanks. `ra` alone is in hours in HYG and AT-HYG and in degrees in
//! exports of the Gaia archive; other columns of the file show which of these it is. If they do not, a decimal `ra`
//! is an error: a guess could be wrong by a factor of 15.

/// Required columns, for messages.
pub(super) const NEEDED: &str = "needed: a direction (ra_deg,dec_deg or x,y,z in parsecs), a brightness (v_mag or \
     phot_g_mean_mag, or abs_mag with a distance), and if known teff_k, bp_rp or b_v, parallax_mas or distance_pc, and \
     pm_ra_mas_yr, pm_dec_mas_yr and radial_velocity_km_s; \
     the headers of HYG, AT-HYG and Gaia exports and magnitude,temperature,x,y,z are known too";

/// HYG and AT-HYG write this distance in parsecs, or a larger one, if it is unknown.
pub(super) const HYG_UNKNOWN_DISTANCE_PC: f64 = 100_000.0;

/// Epoch of positions if the file does not give one.
pub(super) const J2000_EPOCH: f64 = 2000.0;
/// Epoch of positions in Gaia's third data release.
const GAIA_EPOCH: f64 = 2016.0;

/// Unit of a decimal number in the right ascension column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RaUnit {
    /// Degrees.
    Degrees,
    /// Hours.
    Hours,
    /// Unknown: only sexagesimal right ascensions, always in hours, can be read.
    Unknown,
}

/// Columns that hold a star's direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// Right ascension and declination.
    Equatorial {
        /// Column of the right ascension.
        ra: usize,
        /// Column of the declination, degrees.
        dec: usize,
        /// Unit of the right ascension.
        unit: RaUnit,
    },
    /// ICRS position in parsecs, which also gives the distance.
    Cartesian([usize; 3]),
}

/// Columns of a file by their meaning; numbers are column indices from 0.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    pub direction: Direction,
    pub v_mag: Option<usize>,
    pub g_mag: Option<usize>,
    pub abs_mag: Option<usize>,
    pub teff_k: Option<usize>,
    pub bp_rp: Option<usize>,
    pub b_v: Option<usize>,
    pub parallax_mas: Option<usize>,
    pub distance_pc: Option<usize>,
    pub pm_ra_mas_yr: Option<usize>,
    pub pm_dec_mas_yr: Option<usize>,
    pub radial_velocity_km_s: Option<usize>,
    /// Epoch of the positions, Julian years.
    pub ref_epoch: Option<usize>,
    /// Epoch of the positions without such a column.
    pub epoch: f64,
    /// Distances from this one on mean "unknown".
    pub unknown_from_pc: f64,
    names: Vec<String>,
}

impl Columns {
    /// Recognises the columns by their names. The error describes a missing or contradictory column.
    pub fn recognise<S: AsRef<str>>(header: &[S]) -> Result<Self, String> {
        // Names without byte order mark, blanks and case.
        let names: Vec<String> =
            header.iter().map(|n| n.as_ref().trim_start_matches('\u{feff}').trim().to_lowercase()).collect();
        let find = |candidates: &[&str]| -> Result<Option<usize>, String> {
            for candidate in candidates {
                let mut matches = names.iter().enumerate().filter(|(_, n)| n == candidate).map(|(i, _)| i);
                if let Some(first) = matches.next() {
                    return match matches.next() {
                        None => Ok(Some(first)),
                        Some(_) => Err(format!("the column {candidate} appears twice")),
                    };
                }
            }
            Ok(None)
        };
        let has = |name: &str| names.iter().any(|n| n == name);

        // Position, brightness and distance.
        let xyz = |axes: [&str; 3]| -> Result<Option<[usize; 3]>, String> {
            Ok(match (find(&[axes[0]])?, find(&[axes[1]])?, find(&[axes[2]])?) {
                (Some(x), Some(y), Some(z)) => Some([x, y, z]),
                _ => None,
            })
        };
        let cartesian = match xyz(["x", "y", "z"])? {
            None => xyz(["x0", "y0", "z0"])?,
            found => found,
        };
        let v_mag = find(&["v_mag", "mag"])?;
        let g_mag = find(&["phot_g_mean_mag"])?;
        let parallax_mas = find(&["parallax_mas", "parallax"])?;
        let distance_pc = find(&["distance_pc", "dist"])?;

        // Columns that occur only in one family of files.
        let is_hyg = has("mag") && (has("dist") || has("ci") || has("absmag"));
        let is_gaia = has("source_id") || has("phot_g_mean_mag") || has("parallax");
        // Right ascension and declination, and their unit.
        let equatorial = match (find(&["ra_deg"])?, find(&["dec_deg"])?, find(&["ra"])?, find(&["dec"])?) {
            (Some(ra), Some(dec), ..) => Some(Direction::Equatorial { ra, dec, unit: RaUnit::Degrees }),
            (_, dec_deg, Some(ra), dec) if dec.is_some() || dec_deg.is_some() => {
                let unit = match (is_hyg, is_gaia) {
                    (true, false) => RaUnit::Hours,
                    (false, true) => RaUnit::Degrees,
                    _ => RaUnit::Unknown,
                };
                dec.or(dec_deg).map(|dec| Direction::Equatorial { ra, dec, unit })
            }
            (Some(ra), None, _, Some(dec)) => Some(Direction::Equatorial { ra, dec, unit: RaUnit::Degrees }),
            _ => None,
        };
        // If a file has both, angles are the measured values; but without a distance, x, y and z hold more.
        let has_distance = parallax_mas.is_some() || distance_pc.is_some();
        let direction = match (equatorial, cartesian) {
            (Some(angles), None) => angles,
            (Some(angles), Some(_)) if has_distance => angles,
            (_, Some(position)) => Direction::Cartesian(position),
            (None, None) => return Err("no direction".into()),
        };

        // `magnitude` alone is ambiguous; with x, y, z and without any other brightness it is the absolute magnitude.
        let mut abs_mag = find(&["abs_mag", "absmag"])?;
        if abs_mag.is_none() && v_mag.is_none() && g_mag.is_none() && cartesian.is_some() {
            abs_mag = find(&["magnitude"])?;
        }
        // Without any brightness, or a distance for an absolute magnitude, the file is unusable.
        if v_mag.is_none() && g_mag.is_none() {
            if abs_mag.is_none() {
                return Err("no brightness".into());
            }
            if !has_distance && cartesian.is_none() {
                return Err("an absolute magnitude, but no distance".into());
            }
        }
        let hyg_distance = has("dist") || is_hyg;
        Ok(Self {
            direction,
            v_mag,
            g_mag,
            abs_mag,
            teff_k: find(&["teff_k", "teff_gspphot", "teff_val", "temperature"])?,
            bp_rp: find(&["bp_rp"])?,
            b_v: find(&["b_v", "ci"])?,
            parallax_mas,
            distance_pc,
            pm_ra_mas_yr: find(&["pm_ra_mas_yr", "pmra"])?,
            pm_dec_mas_yr: find(&["pm_dec_mas_yr", "pmdec"])?,
            radial_velocity_km_s: find(&["radial_velocity_km_s", "radial_velocity", "rv"])?,
            ref_epoch: find(&["ref_epoch"])?,
            epoch: if has("source_id") || has("phot_g_mean_mag") { GAIA_EPOCH } else { J2000_EPOCH },
            unknown_from_pc: if hyg_distance { HYG_UNKNOWN_DISTANCE_PC } else { f64::INFINITY },
            names,
        })
    }

    /// Name of a column, in lower case, for messages.
    pub fn name(&self, column: usize) -> &str {
        &self.names[column]
    }

    /// Number of columns in the file.
    pub fn len(&self) -> usize {
        self.names.len()
    }
}

/// Lists the columns of a file for a message: the first 40, each shortened.
pub(super) fn listing<S: AsRef<str>>(header: &[S]) -> String {
    let mut list: Vec<String> = header.iter().take(40).map(|n| super::excerpt(n.as_ref().trim())).collect();
    if header.len() > 40 {
        list.push(format!("and {} more", header.len() - 40));
    }
    if list.is_empty() { "none".into() } else { list.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recognise(header: &str) -> Result<Columns, String> {
        Columns::recognise(&header.split(',').collect::<Vec<_>>())
    }

    fn unit(header: &str) -> RaUnit {
        match recognise(header).unwrap().direction {
            Direction::Equatorial { unit, .. } => unit,
            Direction::Cartesian(_) => panic!("{header}: read as x, y, z"),
        }
    }

    #[test]
    fn other_columns_decide_between_hours_and_degrees() {
        assert_eq!(unit("id,hip,proper,ra,dec,dist,mag,absmag,ci,x,y,z"), RaUnit::Hours);
        assert_eq!(unit("id,tyc,gaia,ra,dec,pos_src,dist,x0,y0,z0,dist_src,mag,absmag,ci"), RaUnit::Hours);
        assert_eq!(unit("source_id,ra,dec,parallax,phot_g_mean_mag,bp_rp"), RaUnit::Degrees);
        assert_eq!(unit(" RA_DEG , Dec_Deg ,V_MAG"), RaUnit::Degrees);
        assert_eq!(unit("ra,dec,v_mag"), RaUnit::Unknown);
        assert_eq!(unit("ra,dec,mag,ci,parallax"), RaUnit::Unknown, "columns of both families");
    }

    #[test]
    fn a_position_is_preferred_to_angles_without_distance() {
        assert!(matches!(recognise("ra_deg,dec_deg,x,y,z,v_mag").unwrap().direction, Direction::Cartesian([2, 3, 4])));
        assert_eq!(unit("ra_deg,dec_deg,x,y,z,v_mag,parallax_mas"), RaUnit::Degrees);
    }

    #[test]
    fn magnitude_is_absolute_only_with_a_position() {
        assert_eq!(recognise("magnitude,temperature,x,y,z").unwrap().abs_mag, Some(0));
        assert!(recognise("ra_deg,dec_deg,magnitude").unwrap_err().contains("brightness"));
        assert_eq!(recognise("v_mag,magnitude,x,y,z").unwrap().abs_mag, None);
    }

    #[test]
    fn errors_name_the_missing_column() {
        assert_eq!(recognise("v_mag,dec_deg").unwrap_err(), "no direction");
        assert_eq!(recognise("ra_deg,dec_deg,b_v").unwrap_err(), "no brightness");
        assert!(recognise("ra_deg,dec_deg,abs_mag").unwrap_err().contains("no distance"));
        assert!(recognise("ra_deg,dec_deg,v_mag,v_mag").unwrap_err().contains("v_mag appears twice"));
        assert!(recognise("").is_err());
    }
}

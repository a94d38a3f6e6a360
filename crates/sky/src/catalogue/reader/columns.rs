//! Recognition of a file's columns by their names.
//!
//! Names are compared without case and surrounding blanks. The source of the file is recognised from the set of columns ([`super::sources`]), and the
//! source determines their meaning: `dist` is a distance in HYG and an angle in a cone search of the Gaia archive; `ra` is in hours in HYG and in
//! degrees in the archive. If the unit of a decimal `ra` is unknown, it is an error, because a guess could be wrong by a factor of 15. A line of
//! units, such as VizieR writes, takes precedence over the source.

use super::finder::{Finder, SIMBAD};
use super::sources::{DEGREES, Source};
use super::units::{Conversion, DirectionUnit, Quantity, direction_unit};

/// Required columns, for messages.
pub(super) const NEEDED: &str = "needed: a direction (ra_deg,dec_deg or x,y,z in parsecs), a brightness (v_mag or \
     phot_g_mean_mag, or abs_mag with a distance), and, if known, teff_k, bp_rp or b_v, parallax_mas or distance_pc, and \
     pm_ra_mas_yr, pm_dec_mas_yr and radial_velocity_km_s; \
     the headers of HYG, AT-HYG, Gaia exports and VizieR, and magnitude,temperature,x,y,z are also recognised";

/// In HYG and AT-HYG, this distance in parsecs or a larger one means that the distance is unknown.
pub(super) const HYG_UNKNOWN_DISTANCE_PC: f64 = 100_000.0;

/// Epoch to which motions refer, Julian years.
pub(super) const J2000_EPOCH: f64 = 2000.0;

/// Unit of a decimal number in the right ascension column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RaUnit {
    /// Degrees.
    Degrees,
    /// Hours.
    Hours,
    /// Radians.
    Radians,
    /// Hours according to the source of the file, unless a row has a value that cannot be hours.
    HoursUnlessRefuted,
    /// Hours or degrees: only sexagesimal right ascensions can be read, because they are always in hours.
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
        /// Another pair of columns with its unit, for rows without values in the first pair. Tycho-2 has no mean position of some stars.
        other: Option<(usize, usize, RaUnit)>,
    },
    /// ICRS position in parsecs, which also gives the distance.
    Cartesian([usize; 3]),
}

/// Columns of a file by their meaning; the numbers are column indices from 0.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    /// The source of the file.
    pub source: Source,
    pub direction: Direction,
    pub v_mag: Option<usize>,
    pub g_mag: Option<usize>,
    /// Magnitudes of Tycho, BT and VT.
    pub tycho_mag: Option<[usize; 2]>,
    /// Magnitude of Hipparcos.
    pub hp_mag: Option<usize>,
    pub abs_mag: Option<usize>,
    pub teff_k: Option<usize>,
    pub bp_rp: Option<usize>,
    /// Gaia's BP and RP magnitudes, which are used if BP-RP is missing.
    pub bp_and_rp: Option<[usize; 2]>,
    pub b_v: Option<usize>,
    /// Magnitudes B and V, which are used if B-V is missing.
    pub b_and_v: Option<[usize; 2]>,
    pub parallax_mas: Option<usize>,
    pub parallax_error_mas: Option<usize>,
    pub distance_pc: Option<usize>,
    pub pm_ra: Option<usize>,
    pub pm_dec: Option<usize>,
    pub radial_velocity_km_s: Option<usize>,
    /// Names and numbers of the star.
    pub names: NameColumns,
    /// Epoch of the positions, Julian years.
    pub ref_epoch: Option<usize>,
    /// Epoch of the positions if there is no such column, Julian years.
    pub epoch: f64,
    /// Equinox of the positions in each row.
    pub equinox: Option<usize>,
    /// Gaia's designation, such as `Gaia DR2 4472832130942575872`.
    pub designation: Option<usize>,
    /// This distance and larger ones mean "unknown".
    pub unknown_from_pc: f64,
    /// Columns that are not read although the renderer could use them, with the reason if it is known.
    pub unused: Vec<String>,
    /// Conversion of each column to the unit in which it is read.
    conversions: Vec<Conversion>,
    header: Vec<String>,
}

/// Columns that name a star.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct NameColumns {
    /// A proper name.
    pub name: Option<usize>,
    /// A designation such as `9Alp CMa` (HYG).
    pub bayer_flamsteed: Option<usize>,
    /// A Greek letter such as `Alp`, its constellation, and a Flamsteed number (AT-HYG).
    pub bayer: Option<usize>,
    pub flamsteed: Option<usize>,
    pub constellation: Option<usize>,
    pub hip: Option<usize>,
    pub hd: Option<usize>,
    pub hr: Option<usize>,
    /// Gaia's number.
    pub gaia: Option<usize>,
}

/// Columns of brightness.
struct Brightness {
    v_mag: Option<usize>,
    g_mag: Option<usize>,
    tycho_mag: Option<[usize; 2]>,
    hp_mag: Option<usize>,
    abs_mag: Option<usize>,
}

impl Brightness {
    /// Finds the columns. `has_position` is true if the file has x, y and z, `has_distance` if it has a parallax or a distance.
    fn find(finder: &mut Finder<'_>, source: Source, has_position: bool, has_distance: bool) -> Result<Self, String> {
        let v_mag = finder.magnitude(match (source.is_hyg(), finder.has(SIMBAD)) {
            (true, _) => &["mag"],
            (false, true) => &["v_mag", "vmag", "mag", "flux_v", "v"],
            (false, false) => &["v_mag", "vmag", "mag", "flux_v"],
        })?;
        let g_mag = if source.is_gaia() { finder.magnitude(&["phot_g_mean_mag", "gmag"])? } else { None };
        let tycho_mag = finder.magnitudes(&["btmag", "bt_mag"], &["vtmag", "vt_mag"])?;
        let hp_mag = finder.magnitude(&["hpmag"])?;
        let mut abs_mag = finder.magnitude(&["abs_mag", "absmag"])?;
        let has_apparent = [v_mag, g_mag, hp_mag].iter().any(Option::is_some) || tycho_mag.is_some();
        // `magnitude` alone is ambiguous. In a file with x, y, z and without any other brightness it is the absolute magnitude.
        if abs_mag.is_none() && !has_apparent && has_position {
            abs_mag = finder.magnitude(&["magnitude"])?;
        }
        // A file without any brightness is unusable, and so is one with an absolute magnitude but no distance.
        if !has_apparent {
            if abs_mag.is_none() {
                return Err("no brightness".into());
            }
            if !has_distance && !has_position {
                return Err("an absolute magnitude, but no distance".into());
            }
        }
        Ok(Self { v_mag, g_mag, tycho_mag, hp_mag, abs_mag })
    }
}

/// Columns of distance.
struct Distance {
    parallax_mas: Option<usize>,
    parallax_error_mas: Option<usize>,
    distance_pc: Option<usize>,
}

impl Distance {
    /// Finds the columns. Columns that look like a distance but are not one are added to `unused`.
    fn find(finder: &mut Finder<'_>, source: Source, unused: &mut Vec<String>) -> Result<Self, String> {
        let unstated = source.parallax_unit();
        let parallaxes = ["parallax_mas", "parallax", "plx", "plx_value"];
        let parallax_mas = finder.quantity_in(Quantity::Parallax, unstated, &parallaxes)?;
        let distance_pc = match source {
            Source::Gaia | Source::Gaia2 => {
                // A cone search adds this column.
                if finder.find(&["dist"])?.is_some() {
                    unused.push("dist: the angle from the centre of a cone search, degrees".to_owned());
                }
                finder.quantity(Quantity::Distance, &["distance_pc"])?
            }
            _ if source.is_hyg() => finder.quantity(Quantity::Distance, &["dist", "distance"])?,
            _ => match finder.quantity(Quantity::Distance, &["distance_pc"])? {
                Some(column) => Some(column),
                None => finder.distance(&["dist", "distance"], parallax_mas.is_some(), unused)?,
            },
        };
        let errors = ["parallax_error", "parallax_error_mas", "e_plx"];
        let parallax_error_mas = finder.quantity_in(Quantity::Parallax, unstated, &errors)?;
        // An error without a unit has the unit of the parallax.
        if let (Some(error), Some(parallax)) = (parallax_error_mas, parallax_mas)
            && finder.unit(error).is_none()
        {
            finder.conversions[error] = finder.conversions[parallax];
        }
        let parallax_error_mas = parallax_error_mas.filter(|_| parallax_mas.is_some());
        Ok(Self { parallax_mas, parallax_error_mas, distance_pc })
    }

    fn is_known(&self) -> bool {
        self.parallax_mas.is_some() || self.distance_pc.is_some()
    }
}

/// Checks the unit that the file states for a declination: it must be radians if the right ascension is in radians, otherwise degrees.
fn check_dec_unit(finder: &Finder<'_>, dec: usize, ra_unit: RaUnit) -> Result<(), String> {
    let Some(unit) = finder.unit(dec) else { return Ok(()) };
    match (ra_unit, direction_unit(unit)) {
        (RaUnit::Radians, Some(DirectionUnit::Radians)) => Ok(()),
        (RaUnit::Radians, _) => {
            Err(format!("{} is in {unit}, but the right ascension is in radians", finder.names[dec]))
        }
        (_, Some(DirectionUnit::Degrees)) => Ok(()),
        _ => Err(format!("{} is in {unit}; it must be in degrees", finder.names[dec])),
    }
}

/// Returns the unit that the file states for a right ascension.
fn stated_ra_unit(finder: &Finder<'_>, ra: usize) -> Result<Option<RaUnit>, String> {
    let Some(unit) = finder.unit(ra) else { return Ok(None) };
    Ok(Some(match direction_unit(unit) {
        Some(DirectionUnit::Radians) => RaUnit::Radians,
        Some(DirectionUnit::Hours) => RaUnit::Hours,
        Some(DirectionUnit::Degrees) => RaUnit::Degrees,
        None => return Err(format!("{} is in {unit}; it must be in degrees, radians or hours", finder.names[ra])),
    }))
}

/// Finds right ascension and declination, and their epoch if their names give it.
fn equatorial(
    finder: &mut Finder<'_>,
    source: Source,
    has_parallax: bool,
) -> Result<Option<(Direction, Option<f64>)>, String> {
    let mut found: Option<(usize, usize, RaUnit, Option<f64>)> = None;
    for (ra_name, dec_name, epoch) in DEGREES {
        let (Some(ra), Some(dec)) = (finder.find(&[ra_name])?, finder.find(&[dec_name])?) else { continue };
        let unit = match stated_ra_unit(finder, ra)? {
            Some(unit) => unit,
            // The original table of the Hipparcos reduction is in radians, but VizieR's answers are in degrees.
            None if *ra_name == "rarad" && found.is_some() => continue,
            None if *ra_name == "rarad" => {
                return Err("rarad may be radians or degrees: name it ra_deg, or keep the line of units".into());
            }
            None => RaUnit::Degrees,
        };
        check_dec_unit(finder, dec, unit)?;
        match found {
            None => found = Some((ra, dec, unit, *epoch)),
            Some((first_ra, first_dec, first_unit, epoch)) => {
                let other = Some((ra, dec, unit));
                let direction = Direction::Equatorial { ra: first_ra, dec: first_dec, unit: first_unit, other };
                return Ok(Some((direction, epoch)));
            }
        }
    }
    if let Some((ra, dec, unit, epoch)) = found {
        return Ok(Some((Direction::Equatorial { ra, dec, unit, other: None }, epoch)));
    }
    let in_hours = finder.find(&["ra_hours", "ra_h"])?;
    let columns = (in_hours.or(finder.find(&["ra", "ra_deg"])?), finder.find(&["dec", "dec_deg", "de"])?);
    let (Some(ra), Some(dec)) = columns else { return Ok(None) };
    let like_gaia = source.is_gaia() || has_parallax || finder.has(SIMBAD);
    let unit = match (stated_ra_unit(finder, ra)?, source.is_hyg(), like_gaia) {
        (Some(unit), ..) => unit,
        _ if in_hours.is_some() => RaUnit::Hours,
        _ if finder.has("ra_deg") => RaUnit::Degrees,
        (None, true, false) => RaUnit::HoursUnlessRefuted,
        (None, false, true) => RaUnit::Degrees,
        _ => RaUnit::Unknown,
    };
    check_dec_unit(finder, dec, unit)?;
    Ok(Some((Direction::Equatorial { ra, dec, unit, other: None }, None)))
}

/// Columns of motion.
struct Motion {
    pm_ra: Option<usize>,
    pm_dec: Option<usize>,
    radial_velocity_km_s: Option<usize>,
}

impl Motion {
    /// Finds the columns. If only one component of a proper motion exists, it is added to `unused`.
    fn find(finder: &mut Finder<'_>, source: Source, unused: &mut Vec<String>) -> Result<Self, String> {
        let east = ["pm_ra_mas_yr", "pmra", "pm_ra", "pm_ra_cosdec", "pm_racosdec", "pmra*", "pm_ra*", "pmracosdec"];
        let north = ["pm_dec_mas_yr", "pmdec", "pm_dec", "pmde"];
        let unstated = source.motion_unit(finder.names);
        let given = unstated.unwrap_or_default();
        let mut pm_ra = finder.quantity_in(Quantity::ProperMotion, given, &east)?;
        let mut pm_dec = finder.quantity_in(Quantity::ProperMotion, given, &north)?;
        if let (Some(east), Some(north), Err(reason)) = (pm_ra, pm_dec, unstated)
            && finder.unit(east).is_none()
        {
            unused.push(format!("{}, {}: {reason}", finder.names[east], finder.names[north]));
            (pm_ra, pm_dec) = (None, None);
        }
        // If a file states the unit of one component, it applies to both.
        if let (Some(east), Some(north)) = (pm_ra, pm_dec) {
            for (stated, other) in [(east, north), (north, east)] {
                if finder.unit(stated).is_some() && finder.unit(other).is_none() {
                    finder.conversions[other] = finder.conversions[stated];
                }
            }
        }
        let radial = ["radial_velocity_km_s", "radial_velocity", "rv", "radvel", "rv_value", "rvz_radvel", "rvel"];
        let radial_velocity_km_s = finder.quantity(Quantity::RadialVelocity, &radial)?;
        let (pm_ra, pm_dec) = match (pm_ra, pm_dec) {
            (Some(_), Some(_)) | (None, None) => (pm_ra, pm_dec),
            (Some(half), None) | (None, Some(half)) => {
                unused.push(format!("{}: the other component of the proper motion is missing", finder.names[half]));
                (None, None)
            }
        };
        Ok(Self { pm_ra, pm_dec, radial_velocity_km_s })
    }
}

impl NameColumns {
    fn find(finder: &mut Finder<'_>) -> Result<Self, String> {
        Ok(Self {
            name: finder.find(&["proper", "propername", "name", SIMBAD])?,
            bayer_flamsteed: finder.find(&["bf", "bayerflamsteed"])?,
            bayer: finder.find(&["bayer"])?,
            flamsteed: finder.find(&["flam"])?,
            constellation: finder.find(&["con"])?,
            hip: finder.find(&["hip"])?,
            hd: finder.find(&["hd"])?,
            hr: finder.find(&["hr"])?,
            gaia: finder.find(&["source_id", "source", "gaia"])?,
        })
    }
}

/// Returns the name of a column in lower case, without byte order mark, comment mark, quotation marks and surrounding blanks.
fn normalised(name: &str) -> String {
    name.trim_start_matches('\u{feff}').trim().trim_start_matches('#').trim().trim_matches('"').to_lowercase()
}

impl Columns {
    /// If `ra_in_degrees` is true, sets the unit of right ascensions that may be in hours or degrees to degrees.
    pub fn in_degrees(mut self, ra_in_degrees: bool) -> Self {
        if let Direction::Equatorial { unit: unit @ (RaUnit::Unknown | RaUnit::HoursUnlessRefuted), .. } =
            &mut self.direction
            && ra_in_degrees
        {
            *unit = RaUnit::Degrees;
        }
        self
    }

    /// Recognises the columns by their names, and their units if a line of the file gives them. The error describes a missing or
    /// contradictory column.
    pub fn recognise<S: AsRef<str>>(header: &[S], units: Option<&[S]>) -> Result<Self, String> {
        let names: Vec<String> = header.iter().map(|name| normalised(name.as_ref())).collect();
        let units = units.unwrap_or_default().iter().map(|unit| unit.as_ref().trim().to_lowercase()).collect();
        let source = Source::recognise(&names);
        let conversions = vec![Conversion::default(); names.len()];
        let mut finder = Finder { names: &names, units, used: Vec::new(), conversions };
        let mut unused = Vec::new();

        // If a file has both angles and x, y, z, prefer the angles, which are the measured values. Without a parallax or a distance, prefer x, y and
        // z, which contain the distance.
        let cartesian = match finder.xyz(["x", "y", "z"])? {
            None => finder.xyz(["x0", "y0", "z0"])?,
            found => found,
        };
        let distance = Distance::find(&mut finder, source, &mut unused)?;
        let equatorial = equatorial(&mut finder, source, distance.parallax_mas.is_some())?;
        let (direction, epoch) = match (equatorial, cartesian) {
            (Some(angles), None) => angles,
            (Some(angles), Some(_)) if distance.is_known() => angles,
            (_, Some(position)) => (Direction::Cartesian(position), None),
            (None, None) => {
                let of_1950 = names.iter().find(|name| name.contains("b1950"));
                return Err(of_1950.map_or("no direction".to_owned(), |name| {
                    format!("no direction: {name} is of the equinox B1950; positions must be in the ICRS or of J2000")
                }));
            }
        };
        let Brightness { v_mag, g_mag, tycho_mag, hp_mag, abs_mag } =
            Brightness::find(&mut finder, source, cartesian.is_some(), distance.is_known())?;
        let Motion { pm_ra, pm_dec, radial_velocity_km_s } = Motion::find(&mut finder, source, &mut unused)?;

        let temperatures = ["teff_k", "teff_gspphot", "teff_val", "teff", "temperature"];
        let teff_k = finder.quantity(Quantity::Temperature, &temperatures)?;
        let bp_rp = finder.magnitude(&["bp_rp", "bp-rp"])?;
        let bp_and_rp = finder.magnitudes(&["phot_bp_mean_mag", "bpmag"], &["phot_rp_mean_mag", "rpmag"])?;
        let b_v = finder.magnitude(&["b_v", "b-v", "ci", "colorindex"])?;
        let b_and_v = if finder.has(SIMBAD) { finder.magnitudes(&["flux_b", "b"], &["flux_v", "v"])? } else { None };
        let ref_epoch = finder.quantity(Quantity::Epoch, &["ref_epoch"])?;
        let equinox = finder.find(&["equinox"])?;
        let designation = finder.find(&["designation"])?;
        let name_columns = NameColumns::find(&mut finder)?;
        unused.extend(finder.left());
        let has_placeholder = source.is_hyg() || finder.has("dist");
        Ok(Self {
            source,
            direction,
            v_mag,
            g_mag,
            tycho_mag,
            hp_mag,
            abs_mag,
            teff_k,
            bp_rp,
            bp_and_rp,
            b_v,
            b_and_v,
            parallax_mas: distance.parallax_mas,
            parallax_error_mas: distance.parallax_error_mas,
            distance_pc: distance.distance_pc,
            pm_ra,
            pm_dec,
            radial_velocity_km_s,
            names: name_columns,
            ref_epoch,
            epoch: epoch.unwrap_or(source.epoch()),
            equinox,
            designation,
            unknown_from_pc: if has_placeholder { HYG_UNKNOWN_DISTANCE_PC } else { f64::INFINITY },
            unused,
            conversions: finder.conversions,
            header: names,
        })
    }

    /// Returns the same columns with other names for messages.
    pub fn called(self, names: &[String]) -> Self {
        Self { header: names.iter().map(|name| normalised(name)).collect(), ..self }
    }

    /// Converts a number of a column to the unit in which the column is read.
    pub fn converted(&self, column: usize, stored: f64) -> f64 {
        self.conversions[column].apply(stored)
    }

    /// Name of a column, in lower case, for messages.
    pub fn name(&self, column: usize) -> &str {
        &self.header[column]
    }

    /// Number of columns in the file.
    pub fn len(&self) -> usize {
        self.header.len()
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
        Columns::recognise(&header.split(',').collect::<Vec<_>>(), None)
    }

    fn unit(header: &str) -> RaUnit {
        match recognise(header).unwrap().direction {
            Direction::Equatorial { unit, .. } => unit,
            Direction::Cartesian(_) => panic!("{header}: read as x, y, z"),
        }
    }

    #[test]
    fn other_columns_decide_between_hours_and_degrees() {
        assert_eq!(unit("id,hip,proper,ra,dec,dist,mag,absmag,ci,x,y,z"), RaUnit::HoursUnlessRefuted);
        assert_eq!(unit("id,tyc,gaia,ra,dec,pos_src,dist,x0,y0,z0,dist_src,mag,absmag,ci"), RaUnit::HoursUnlessRefuted);
        assert_eq!(unit("name,ra,dec,mag,dist"), RaUnit::Unknown, "no column occurs only in HYG");
        assert_eq!(unit("ra_hours,dec,v_mag"), RaUnit::Hours);
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
        assert!(recognise("RAB1950,DEB1950,Vmag").unwrap_err().contains("rab1950 is of the equinox B1950"));
        assert_eq!(recognise("ra_deg,dec_deg,b_v").unwrap_err(), "no brightness");
        assert!(recognise("ra_deg,dec_deg,abs_mag").unwrap_err().contains("no distance"));
        assert!(recognise("ra_deg,dec_deg,v_mag,v_mag").unwrap_err().contains("v_mag appears twice"));
        assert!(recognise("").is_err());
    }
}

//! Finds the columns of a file by their names, with the conversions from their units, and lists those that are not read.

use super::units::{Conversion, Quantity, direction_unit};

/// Column that exists only in answers of SIMBAD. In these answers, `v` is the magnitude V, and a decimal `ra` is in degrees.
pub(super) const SIMBAD: &str = "main_id";

/// Beginnings of the names of columns that the renderer could use. If such a column is not read, it is reported.
const USEFUL: [&str; 19] = [
    "pm",
    "mu_",
    "r_med",
    "rgeo",
    "plx",
    "parallax",
    "dist",
    "radial",
    "rv",
    "teff",
    "epoch",
    "ref_epoch",
    "b_v",
    "b-v",
    "bp_rp",
    "bp-rp",
    "vmag",
    "v_mag",
    "gmag",
];
/// Parts of the names of columns that do not hold a value of the star itself, such as errors and flags.
const AUXILIARY: [&str; 22] = [
    "_error",
    "_err",
    "_corr",
    "_over_",
    "_src",
    "err",
    "flag",
    "_lower",
    "_upper",
    "num",
    "count",
    "nb_",
    "_msc",
    "_method",
    "_visibility",
    "_sig_to_noise",
    "_gof",
    "_pvalue",
    "_atm_param",
    // Columns about the archive's radial velocities.
    "_amplitude",
    "_duration",
    "_template",
];

/// Finds columns by their names.
pub(super) struct Finder<'a> {
    pub(super) names: &'a [String],
    /// Unit of each column, in lower case; empty if the file gives none.
    pub(super) units: Vec<String>,
    pub(super) used: Vec<usize>,
    pub(super) conversions: Vec<Conversion>,
}

impl Finder<'_> {
    pub(super) fn has(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    /// Unit of a column, in lower case, if the file gives one.
    pub(super) fn unit(&self, column: usize) -> Option<&str> {
        self.units.get(column).map(String::as_str).filter(|unit| !unit.is_empty())
    }

    /// Returns the first of these columns that exists; an error if it exists twice.
    pub(super) fn find(&mut self, candidates: &[&str]) -> Result<Option<usize>, String> {
        for candidate in candidates {
            let mut matches =
                self.names.iter().enumerate().filter(|(_, name)| name == candidate).map(|(index, _)| index);
            if let Some(first) = matches.next() {
                if matches.next().is_some() {
                    return Err(format!("the column {candidate} appears twice"));
                }
                self.used.push(first);
                return Ok(Some(first));
            }
        }
        Ok(None)
    }

    /// As [`Self::find`], with the conversion from the unit that the file states.
    pub(super) fn quantity(&mut self, quantity: Quantity, candidates: &[&str]) -> Result<Option<usize>, String> {
        self.quantity_in(quantity, None, candidates)
    }

    /// As [`Self::quantity`]. `unstated` is the unit that the source uses if the file states none.
    pub(super) fn quantity_in(
        &mut self,
        quantity: Quantity,
        unstated: Option<&str>,
        candidates: &[&str],
    ) -> Result<Option<usize>, String> {
        let column = self.find(candidates)?;
        if let Some(column) = column
            && let Some(unit) = self.unit(column).or(unstated)
        {
            let conversion = quantity.conversion(unit);
            self.conversions[column] = conversion.map_err(|problem| format!("{} {problem}", self.names[column]))?;
        }
        Ok(column)
    }

    /// Whether the file states that a column is an angle.
    pub(super) fn is_angle(&self, column: usize) -> bool {
        self.unit(column)
            .is_some_and(|unit| Quantity::Parallax.conversion(unit).is_ok() || direction_unit(unit).is_some())
    }

    /// Returns a distance in these columns. A column that is an angle, or has no unit in a file with parallaxes, is not read; it is added to `unused`
    /// with the reason.
    pub(super) fn distance(
        &mut self,
        candidates: &[&str],
        has_parallax: bool,
        unused: &mut Vec<String>,
    ) -> Result<Option<usize>, String> {
        let Some(column) = self.find(candidates)? else { return Ok(None) };
        let reason = if self.is_angle(column) {
            "an angle"
        } else if self.has(SIMBAD) && self.unit(column).is_none() {
            "the angle from the centre of a cone search"
        } else if has_parallax && self.unit(column).is_none() {
            "without a unit; the parallax is read"
        } else {
            return self.quantity(Quantity::Distance, candidates);
        };
        unused.push(format!("{}: {reason}", self.names[column]));
        Ok(None)
    }

    pub(super) fn magnitude(&mut self, candidates: &[&str]) -> Result<Option<usize>, String> {
        self.quantity(Quantity::Magnitude, candidates)
    }

    pub(super) fn magnitudes(&mut self, first: &[&str], second: &[&str]) -> Result<Option<[usize; 2]>, String> {
        Ok(self.magnitude(first)?.zip(self.magnitude(second)?).map(|(first, second)| [first, second]))
    }

    pub(super) fn xyz(&mut self, axes: [&str; 3]) -> Result<Option<[usize; 3]>, String> {
        Ok(match (self.find(&[axes[0]])?, self.find(&[axes[1]])?, self.find(&[axes[2]])?) {
            (Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        })
    }

    /// Returns the columns that the renderer could use but that are not read.
    pub(super) fn left(&self) -> impl Iterator<Item = String> {
        let is_useful = |name: &str| {
            let is_error = name.starts_with("e_");
            let starts = USEFUL.iter().any(|start| name.starts_with(start));
            starts && !is_error && !AUXILIARY.iter().any(|part| name.contains(part))
        };
        // Gaia's total proper motion adds nothing to its components.
        let is_total = |name: &str| name == "pm" && self.has("pmra") && self.has("pmdec");
        let is_left =
            move |(index, name): &(usize, &String)| !self.used.contains(index) && is_useful(name) && !is_total(name);
        self.names.iter().enumerate().filter(is_left).map(|(_, name)| name.clone())
    }
}

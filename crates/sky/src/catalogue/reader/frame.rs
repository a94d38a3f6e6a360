//! Frames of reference that files state for their positions: system, equinox and epoch.

/// A frame as stated in a file; parts that the file does not state are empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Frame {
    /// `ICRS`, `eq_FK5` (VOTable), `FK5` (FITS) and the like.
    pub system: String,
    /// Equinox, such as `J2000`, `B1950` or `2000.0`.
    pub equinox: String,
    /// Epoch of the positions, such as `J1991.25`.
    pub epoch: String,
}

impl Frame {
    /// Returns the epoch of the positions, Julian years, if the frame states it.
    ///
    /// # Errors
    /// If positions are in another frame than the ICRS or the FK5 of the equinox J2000, or if the epoch is not a year. These two frames agree to
    /// 0.03 arcseconds.
    pub fn epoch(&self) -> Result<Option<f64>, String> {
        let system = self.system.to_lowercase();
        let is_known = ["", "icrs", "icrf", "fk5", "eq_fk5"].contains(&system.as_str());
        let is_j2000 = self.equinox.is_empty() || is_j2000(&self.equinox);
        if !is_known || !is_j2000 {
            let stated = [self.system.as_str(), self.equinox.as_str()].map(super::excerpt).join(" ");
            return Err(format!(
                "its positions are in the frame {}; they must be in the ICRS, or in the FK5 of the equinox J2000 (TOPCAT and astropy \
                 convert them)",
                stated.trim()
            ));
        }
        if self.epoch.is_empty() {
            return Ok(None);
        }
        match year(&self.epoch).filter(|year| super::row::EPOCHS.contains(year)) {
            Some(year) => Ok(Some(year)),
            None => Err(format!(
                "its positions have the epoch {}; it must be a year such as J2016.0, from 1800 to 2200",
                super::excerpt(&self.epoch)
            )),
        }
    }
}

/// Whether an equinox is that of J2000.
pub(super) fn is_j2000(equinox: &str) -> bool {
    year(equinox).is_some_and(|year| (year - 2000.0).abs() < 0.01)
}

/// Julian year of a text such as `J2000.0`, `B1950` or `2000`.
fn year(text: &str) -> Option<f64> {
    let text = text.trim();
    let besselian = text.strip_prefix(['B', 'b']);
    let number: f64 = besselian.or(text.strip_prefix(['J', 'j'])).unwrap_or(text).trim().parse().ok()?;
    Some(match besselian {
        Some(_) => {
            let (day, fraction) = sofars::cal::epb2jd(number);
            sofars::cal::epj(day, fraction)
        }
        None => number,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(system: &str, equinox: &str, epoch: &str) -> Frame {
        Frame { system: system.to_owned(), equinox: equinox.to_owned(), epoch: epoch.to_owned() }
    }

    #[test]
    fn frames_of_j2000_are_read_with_their_epoch() {
        for (system, equinox, epoch, expected) in [
            ("", "", "", None),
            ("ICRS", "", "J1991.25", Some(1991.25)),
            ("eq_FK5", "J2000", "", None),
            ("FK5", "2000.0", "2015.5", Some(2015.5)),
            ("ICRS", "", "B1950.0", Some(1_949.999_790)),
        ] {
            let found = frame(system, equinox, epoch).epoch().unwrap();
            let is_same = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() < 1e-6,
                (found, expected) => found == expected,
            };
            assert!(is_same, "{system} {equinox} {epoch}: {found:?}");
        }
    }

    #[test]
    fn other_frames_and_epochs_are_refused() {
        for (system, equinox, epoch, part) in [
            ("eq_FK4", "B1950", "", "eq_FK4 B1950"),
            ("", "1950.0", "", "frame 1950.0"),
            ("eq_FK5", "B1950", "", "eq_FK5 B1950"),
            ("galactic", "", "", "galactic"),
            ("FK4-NO-E", "", "", "FK4-NO-E"),
            ("ICRS", "", "57389.0", "57389.0"),
            ("ICRS", "", "soon", "soon"),
        ] {
            let error = frame(system, equinox, epoch).epoch().expect_err(part);
            assert!(error.contains(part), "{error}");
        }
    }
}

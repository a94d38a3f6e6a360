//! Conversion of one row's fields to a star.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::super::motion::StarMotion;
use super::super::names::{self, StarNames};
use super::super::packed::ILLUMINANCE_RANGE_LX;
use super::super::{StarRecord, distance_modulus};
use super::columns::{self, Columns, Direction, NameColumns, RaUnit};
use super::excerpt;
use super::frame;
use super::sexagesimal::{self, Angle, Unit};
use super::sources::Source;
use super::units;
use crate::photometry::colour_index::{
    johnson_from_tycho, temperature_k_from_b_v, temperature_k_from_bp_rp, v_from_gaia,
};
use crate::units::{SOLAR_TEMPERATURE_K, illuminance_lx_from_magnitude};

/// Plausible magnitudes, from a nearby supernova to stars far too faint for any survey.
const MAGNITUDE_RANGE: RangeInclusive<f64> = -40.0..=60.0;

/// Magnitudes at least this far from 0 mark a missing value, such as 99.999 or -99.9.
const MISSING_MAGNITUDE: f64 = 90.0;

/// Plausible colour indices, magnitudes: B-V and BP-RP from the hottest stars to the reddest carbon stars. Other values mark a missing value, such as
/// 9.999, 99.999 or -9999.
const COLOUR_RANGE: RangeInclusive<f64> = -1.5..=8.5;

/// A star nearer than this, pc (200 astronomical units), with about the Sun's absolute magnitude is the Sun.
const SUN_WITHIN_PC: f64 = 1e-3;
/// The Sun's absolute magnitude (Willmer 2018), and the largest difference from it in catalogues.
const SUN_ABSOLUTE_MAG: f64 = 4.81;
const SUN_TOLERANCE_MAG: f64 = 0.5;

/// Apparent magnitudes of the Sun in catalogues without distances.
const SUN_APPARENT_MAG: RangeInclusive<f64> = -28.0..=-25.0;
/// Bright limit of a star's apparent V magnitude: that of Sirius minus its error.
const BRIGHTEST_STAR_MAG: f64 = -1.6;

/// Range of a star's temperature, kelvin.
const TEMPERATURE_RANGE_K: (f64, f64) = (500.0, 100_000.0);

/// This distance and larger ones, pc, count as unknown. It corresponds to a parallax of a hundred-thousandth of a milliarcsecond.
const IMMEASURABLE_PC: f64 = 1e8;

/// Smallest distance of a star in parsecs, 0.2 astronomical units. HYG puts the Sun at 5e-6 pc; nearer values are not positions of stars.
const NEAREST_PC: f64 = 1e-6;
/// No star other than the Sun is nearer.
const NO_STAR_WITHIN_PC: f64 = 1.0;

/// Largest accepted proper motion, mas per year (the largest known one is 10,400), and radial velocity, km/s.
const MOST_MAS_YR: f64 = 1e5;
const MOST_KM_S: f64 = 1e5;

/// Valid epochs of positions, years.
pub(super) const EPOCHS: RangeInclusive<f64> = 1800.0..=2200.0;

/// Notes on how a star was derived, for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Notes {
    pub without_distance: bool,
    /// Whether the star is nearer than any known one.
    pub very_near: bool,
    /// Whether it is apparently brighter than any real star.
    pub very_bright: bool,
    pub without_colour: bool,
    pub temperature_clamped: bool,
    pub colour_ignored: bool,
    /// Whether a proper motion or the radial velocity marks a missing value.
    pub motion_ignored: bool,
    pub g_taken_as_v: bool,
    pub hp_taken_as_v: bool,
    /// Velocity of the star, as in [`StarVelocity`](super::super::motion::StarVelocity); `None` if it has none.
    pub velocity: Option<[f32; 3]>,
    /// The measured parallax, if the file has a column of errors, which decide whether the parallax can be used.
    pub parallax: Option<MeasuredParallax>,
    /// The source that the row itself names, if it differs from that of the columns.
    pub source: Option<Source>,
}

/// A parallax with its error in a catalogue that has both columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeasuredParallax {
    /// Parallax, mas; `None` if it is missing.
    pub parallax_mas: Option<f64>,
    /// Its standard error, mas; `None` if it is missing or not positive.
    pub error_mas: Option<f64>,
}

/// Reason why a row did not become a star.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// This row is unusable.
    Row(Reason),
    /// The right ascension may be in hours or in degrees; another row may decide.
    HoursOrDegrees(String),
    /// The right ascension cannot be in hours, although its column might be. `refutes` is true if the recognised source uses hours.
    Degrees { reason: String, refutes: bool },
}

/// Reason why a row is unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reason {
    /// The reason, with the values of the row.
    pub text: String,
    /// The reason without values: it is the same for all rows with this problem.
    pub kind: String,
}

impl<T: Into<String>> From<T> for Reason {
    fn from(text: T) -> Self {
        let text = text.into();
        Self { kind: text.clone(), text }
    }
}

impl Refusal {
    /// Refusal of a row with a reason without values.
    pub fn row(reason: impl Into<Reason>) -> Self {
        Self::Row(reason.into())
    }

    /// Refusal of a row with a text that contains values, and with the kind of the problem.
    fn of_kind(kind: &str, text: String) -> Self {
        Self::Row(Reason { text, kind: kind.to_owned() })
    }
}

/// Converts one row to a star at its position `years` Julian years after J2000.0. `field(i)` is the text of column i; an empty text and the usual
/// marks for "no value" count as a missing column.
pub(super) fn star<'a>(
    columns: &Columns,
    field: impl Fn(usize) -> &'a str,
    years: f64,
) -> Result<(StarRecord, Notes), Refusal> {
    let row = Row { columns, field };
    let mut notes = Notes::default();
    let (direction, distance_pc) = row.place()?;
    let tycho = row.tycho()?;
    let bp_rp = row.bp_rp(&mut notes)?;
    let b_v = row.b_v(&mut notes)?.or(tycho.and_then(|[_, b_v]| b_v));
    let temperature_k = row.temperature_k(bp_rp, b_v, &mut notes)?;

    // Apparent V magnitude: the catalogued one or, if it is missing, computed from another photometric system.
    let mut apparent = row.magnitude(columns.v_mag)?.or(tycho.and_then(|[v, _]| v));
    if apparent.is_none()
        && let Some(g) = row.magnitude(columns.g_mag)?
    {
        notes.g_taken_as_v = bp_rp.is_none();
        apparent = Some(bp_rp.map_or(g, |colour| v_from_gaia(g, colour)));
    }
    if apparent.is_none()
        && let Some(hp) = row.magnitude(columns.hp_mag)?
    {
        notes.hp_taken_as_v = true;
        apparent = Some(hp);
    }
    // Absolute magnitude if the distance is known, otherwise the apparent one.
    let magnitude = match (apparent, row.magnitude(columns.abs_mag)?, distance_pc) {
        (Some(v), _, Some(d)) => v - distance_modulus(d),
        (Some(v), _, None) => v,
        (None, Some(absolute), Some(_)) => absolute,
        (None, Some(_), None) => return Err(Refusal::row("an absolute magnitude needs a distance")),
        (None, None, _) => {
            let given = [columns.v_mag, columns.g_mag, columns.hp_mag].into_iter().find_map(|column| row.text(column));
            return Err(given.map_or_else(
                || Refusal::row("no brightness"),
                |(column, text)| row.refuse(column, text, "is not a magnitude: no brightness"),
            ));
        }
    };
    if let Some(distance_pc) = distance_pc.filter(|distance| *distance < SUN_WITHIN_PC)
        && (magnitude - SUN_ABSOLUTE_MAG).abs() < SUN_TOLERANCE_MAG
    {
        return Err(Refusal::of_kind(
            "it is the Sun",
            format!("it is the Sun, at {distance_pc:e} pc: the Sun is a body of the scene, not a star of a catalogue"),
        ));
    }
    let apparent_mag = magnitude + distance_pc.map_or(0.0, distance_modulus);
    if distance_pc.is_none() && SUN_APPARENT_MAG.contains(&apparent_mag) {
        return Err(Refusal::of_kind(
            "it is the Sun",
            format!(
                "it is the Sun, with V = {apparent_mag}: the Sun is a body of the scene, not a star of a catalogue"
            ),
        ));
    }
    // Compute the illuminance as the renderer stores it, from the rounded magnitude. A star at infinity is treated as if it were at 1 pc.
    let magnitude_at_1_pc = f64::from(magnitude as f32) - if distance_pc.is_some() { 5.0 } else { 0.0 };
    let illuminance_lx = illuminance_lx_from_magnitude(magnitude_at_1_pc);
    if !ILLUMINANCE_RANGE_LX.contains(&illuminance_lx) {
        let (least, most) = ILLUMINANCE_RANGE_LX.into_inner();
        let stored = format!(
            "{illuminance_lx:.1e} lx at 1 pc is outside the range that can be stored ({least:.1e} to {most:.1e} lx)"
        );
        return Err(match distance_pc {
            Some(_) => {
                let kind = "magnitude and distance do not match";
                Refusal::of_kind(kind, format!("{stored}: {kind}"))
            }
            None => Refusal::of_kind(
                "the magnitude is outside the range that can be stored",
                format!("V = {apparent_mag}: {stored}; a star without a distance counts as 1 pc away"),
            ),
        });
    }
    notes.without_distance = distance_pc.is_none();
    notes.very_bright = apparent_mag < BRIGHTEST_STAR_MAG;
    notes.source = row.named_source();
    notes.very_near = distance_pc.is_some_and(|distance_pc| distance_pc < NO_STAR_WITHIN_PC);
    notes.parallax = row.measured_parallax()?;
    let record = StarRecord {
        position: row.moved(direction, distance_pc, years, &mut notes)?,
        magnitude: magnitude as f32,
        temperature_k: temperature_k as f32,
        distance_known: distance_pc.is_some(),
    };
    Ok((record, notes))
}

struct Row<'c, F> {
    columns: &'c Columns,
    field: F,
}

impl<'a, F: Fn(usize) -> &'a str> Row<'_, F> {
    /// Text of a column, `None` without a value.
    fn text(&self, column: Option<usize>) -> Option<(usize, &'a str)> {
        let column = column?;
        let text = (self.field)(column).trim();
        let is_missing =
            ["", "null", "nan", "none", "na", "n/a", "-", "--", "\\n"].iter().any(|m| text.eq_ignore_ascii_case(m));
        (!is_missing).then_some((column, text))
    }

    fn refuse(&self, column: usize, text: &str, problem: &str) -> Refusal {
        self.refuse_as(column, text, problem, problem)
    }

    /// The same, if `problem` contains values of the row; `kind` must not contain any.
    fn refuse_as(&self, column: usize, text: &str, problem: &str, kind: &str) -> Refusal {
        let name = self.columns.name(column);
        Refusal::of_kind(&format!("{name} {kind}"), format!("{name} = \"{}\" {problem}", excerpt(text)))
    }

    /// Number in a column; infinities are accepted.
    fn number(&self, column: Option<usize>) -> Result<Option<f64>, Refusal> {
        let Some((column, text)) = self.text(column) else { return Ok(None) };
        match units::number(text) {
            Some(value) if !value.is_nan() => Ok(Some(self.columns.converted(column, value))),
            Some(_) => Ok(None),
            None => Err(self.refuse(column, text, "is not a number")),
        }
    }

    /// Number in a column; `None` also if the number consists of nines and `is_impossible`, because it then marks a missing value.
    fn unmarked(&self, column: Option<usize>, is_impossible: impl Fn(f64) -> bool) -> Result<Option<f64>, Refusal> {
        match (self.number(column)?, self.text(column)) {
            (Some(value), Some((_, text))) if is_impossible(value) && is_nines(text) => Ok(None),
            (value, _) => Ok(value),
        }
    }

    fn distance_column_pc(&self) -> Result<Option<f64>, Refusal> {
        self.unmarked(self.columns.distance_pc, |distance_pc| distance_pc < 0.0)
    }

    fn parallax_mas(&self) -> Result<Option<f64>, Refusal> {
        self.unmarked(self.columns.parallax_mas, |parallax_mas| parallax_mas >= 999.0)
    }

    fn finite(&self, column: Option<usize>) -> Result<Option<f64>, Refusal> {
        match (self.number(column)?, self.text(column)) {
            (Some(value), Some((column, text))) if !value.is_finite() => {
                Err(self.refuse(column, text, "is not finite"))
            }
            (value, _) => Ok(value),
        }
    }

    fn magnitude(&self, column: Option<usize>) -> Result<Option<f64>, Refusal> {
        match (self.finite(column)?, self.text(column)) {
            (Some(value), _) if value.abs() >= MISSING_MAGNITUDE => Ok(None),
            (Some(value), Some((column, text))) if !MAGNITUDE_RANGE.contains(&value) => {
                Err(self.refuse(column, text, "is outside -40 to 60"))
            }
            (value, _) => Ok(value),
        }
    }

    /// A colour index. A value outside [`COLOUR_RANGE`] counts as missing, which is noted in `notes`.
    fn colour(&self, column: Option<usize>, notes: &mut Notes) -> Result<Option<f64>, Refusal> {
        let value = self.finite(column)?;
        let plausible = value.filter(|value| COLOUR_RANGE.contains(value));
        notes.colour_ignored |= plausible != value;
        Ok(plausible)
    }

    /// B-V: the catalogued one, or the difference of both magnitudes.
    fn b_v(&self, notes: &mut Notes) -> Result<Option<f64>, Refusal> {
        if let Some(colour) = self.colour(self.columns.b_v, notes)? {
            return Ok(Some(colour));
        }
        let Some([b, v]) = self.columns.b_and_v else { return Ok(None) };
        let (b, v) = (self.magnitude(Some(b))?, self.magnitude(Some(v))?);
        Ok(b.zip(v).map(|(b, v)| b - v).filter(|colour| COLOUR_RANGE.contains(colour)))
    }

    /// The source that the row's designation names. It is needed because tables of DR2 and DR3 may have the same columns.
    fn named_source(&self) -> Option<Source> {
        if self.columns.source != Source::Gaia {
            return None;
        }
        let (_, designation) = self.text(self.columns.designation)?;
        designation.get(..9).filter(|release| release.eq_ignore_ascii_case("gaia dr2 ")).map(|_| Source::Gaia2)
    }

    /// BP-RP: the catalogued one, or the difference of both magnitudes.
    fn bp_rp(&self, notes: &mut Notes) -> Result<Option<f64>, Refusal> {
        if let Some(colour) = self.colour(self.columns.bp_rp, notes)? {
            return Ok(Some(colour));
        }
        let Some([bp, rp]) = self.columns.bp_and_rp else { return Ok(None) };
        let (bp, rp) = (self.magnitude(Some(bp))?, self.magnitude(Some(rp))?);
        Ok(bp.zip(rp).map(|(bp, rp)| bp - rp).filter(|colour| COLOUR_RANGE.contains(colour)))
    }

    /// Johnson V and B-V from the Tycho magnitudes; VT alone gives only V.
    fn tycho(&self) -> Result<Option<[Option<f64>; 2]>, Refusal> {
        let Some([bt, vt]) = self.columns.tycho_mag else { return Ok(None) };
        let (bt, vt) = (self.magnitude(Some(bt))?, self.magnitude(Some(vt))?);
        Ok(match (bt, vt) {
            (Some(bt), Some(vt)) => Some(johnson_from_tycho(bt, vt).map(Some)),
            (_, vt) => Some([vt, None]),
        })
    }

    /// Unit vector towards the star, and the distance in parsecs if it is known.
    fn place(&self) -> Result<(DVec3, Option<f64>), Refusal> {
        let (direction, distance_pc) = match self.columns.direction {
            Direction::Equatorial { ra, dec, unit, other } => {
                let is_missing = || self.text(Some(ra)).is_none() && self.text(Some(dec)).is_none();
                let (ra, dec, unit) = other.filter(|_| is_missing()).unwrap_or((ra, dec, unit));
                if let Some((column, text)) = self.text(self.columns.equinox)
                    && !frame::is_j2000(text)
                {
                    return Err(self.refuse(
                        column,
                        text,
                        "is not J2000: positions must be in the ICRS or the FK5 of J2000",
                    ));
                }
                (self.equatorial(ra, dec, unit)?, self.distance_pc()?)
            }
            Direction::Cartesian(axes) => {
                let mut position = DVec3::ZERO;
                for (axis, column) in axes.into_iter().enumerate() {
                    let Some(value) = self.finite(Some(column))? else {
                        return Err(Refusal::row(format!("{} is missing", self.columns.name(column))));
                    };
                    position[axis] = value;
                }
                let distance_pc = position.length();
                if !distance_pc.is_finite() {
                    return Err(Refusal::row("the position overflows"));
                }
                if distance_pc == 0.0 {
                    return Err(Refusal::row("the distance is 0: the star is at the origin"));
                }
                if distance_pc < NEAREST_PC {
                    return Err(Refusal::of_kind(TOO_NEAR, too_near(distance_pc)));
                }
                (position / distance_pc, Some(distance_pc))
            }
        };
        // The x, y and z of HYG have few digits, so that their length may be slightly below the distance that means "unknown".
        let unknown_from_pc = IMMEASURABLE_PC.min(self.columns.unknown_from_pc * (1.0 - 1e-6));
        Ok((direction, distance_pc.filter(|&d| d < unknown_from_pc)))
    }

    fn equatorial(&self, ra: usize, dec: usize, unit: RaUnit) -> Result<DVec3, Refusal> {
        let angle = |column: usize| {
            let Some((_, text)) = self.text(Some(column)) else {
                return Err(Refusal::row(format!("{} is missing", self.columns.name(column))));
            };
            sexagesimal::parse(text)
                .map(|angle| (angle, text))
                .map_err(|problem| self.refuse_as(column, text, &problem, "is not an angle"))
        };
        let (ra_angle, ra_text) = angle(ra)?;
        let (ra_deg, range) = match (ra_angle, unit) {
            // Some programs write right ascensions above 180 degrees as negative.
            (Angle::Decimal(v), RaUnit::Degrees) if (-180.0..0.0).contains(&v) => (v + 360.0, ""),
            (Angle::Decimal(v), RaUnit::Degrees) => (v, "is outside -180 to 360 degrees"),
            (Angle::Decimal(v), RaUnit::Radians) => (v.to_degrees(), "is outside 0 to 2 pi radians"),
            (Angle::Decimal(v), RaUnit::Hours) => (v * 15.0, "is outside 0 to 24 hours"),
            (Angle::Decimal(v), RaUnit::HoursUnlessRefuted) if (0.0..=24.0).contains(&v) => (v * 15.0, ""),
            (Angle::Decimal(v), RaUnit::HoursUnlessRefuted | RaUnit::Unknown) => {
                let (name, text) = (self.columns.name(ra), excerpt(ra_text));
                let refutes = unit == RaUnit::HoursUnlessRefuted;
                return Err(if (0.0..=24.0).contains(&v) {
                    Refusal::HoursOrDegrees(format!(
                        "{name} = \"{text}\" may be hours or degrees, and no other column or row decides which; name it ra_deg or ra_hours"
                    ))
                } else if (-180.0..=360.0).contains(&v) {
                    Refusal::Degrees {
                        reason: format!("{name} = \"{text}\" can only be degrees; name it ra_deg"),
                        refutes,
                    }
                } else {
                    self.refuse(ra, ra_text, "is outside 0 to 24 hours and outside -180 to 360 degrees")
                });
            }
            (Angle::Sexagesimal { value, unit: Some(Unit::Degrees) }, _) => (value, "is outside 0 to 360 degrees"),
            (Angle::Sexagesimal { value, .. }, _) => (value * 15.0, "is outside 0 to 24 hours"),
        };
        if !(0.0..=360.0).contains(&ra_deg) {
            return Err(self.refuse(ra, ra_text, range));
        }
        let (dec_angle, dec_text) = angle(dec)?;
        let dec_deg = match dec_angle {
            Angle::Decimal(v) if unit == RaUnit::Radians => v.to_degrees(),
            Angle::Sexagesimal { unit: Some(Unit::Hours), .. } => {
                return Err(self.refuse(dec, dec_text, "is in hours, but a declination must be in degrees"));
            }
            Angle::Decimal(v) | Angle::Sexagesimal { value: v, .. } => v,
        };
        if !(-90.0..=90.0).contains(&dec_deg) {
            return Err(self.refuse(dec, dec_text, "is outside -90 to 90 degrees"));
        }
        let (sin_ra, cos_ra) = ra_deg.to_radians().sin_cos();
        let (sin_dec, cos_dec) = dec_deg.to_radians().sin_cos();
        Ok(DVec3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec))
    }

    /// Distance in parsecs from the distance column or, if it has none, from the parallax column; `None` if both have none.
    fn distance_pc(&self) -> Result<Option<f64>, Refusal> {
        if let (Some(d), Some((column, text))) = (self.distance_column_pc()?, self.text(self.columns.distance_pc)) {
            if d == 0.0 {
                return Err(self.refuse(column, text, "puts the star at the origin"));
            }
            if d < 0.0 {
                return Err(self.refuse(column, text, "is below 0"));
            }
            if d < NEAREST_PC {
                return Err(self.refuse_as(column, text, &format!("is too near: {}", too_near(d)), "is too near"));
            }
            if d.is_finite() && d < self.columns.unknown_from_pc {
                return Ok(Some(d));
            }
        }
        match (self.parallax_mas()?, self.text(self.columns.parallax_mas)) {
            (Some(p), Some((column, text))) if p.is_finite() && p > 0.0 => {
                let d = 1000.0 / p;
                if d < NEAREST_PC {
                    return Err(self.refuse_as(
                        column,
                        text,
                        &format!("is too large: {}", too_near(d)),
                        "is too large",
                    ));
                }
                Ok(Some(d))
            }
            _ => Ok(None),
        }
    }

    /// Parallax and error; `None` if the file has no column of errors, or if the distance does not come from the parallax.
    fn measured_parallax(&self) -> Result<Option<MeasuredParallax>, Refusal> {
        let Columns { direction, parallax_error_mas, .. } = self.columns;
        let is_cartesian = matches!(direction, Direction::Cartesian(_));
        if is_cartesian || parallax_error_mas.is_none() || self.distance_column_pc()?.is_some() {
            return Ok(None);
        }
        let error_mas = self.number(*parallax_error_mas)?.filter(|error| *error > 0.0 && error.is_finite());
        let parallax_mas = self.parallax_mas()?.filter(|parallax| parallax.is_finite());
        Ok(Some(MeasuredParallax { parallax_mas, error_mas }))
    }

    /// Position of the star after its motion, pc, or a unit vector if the distance is unknown.
    fn moved(
        &self,
        direction: DVec3,
        distance_pc: Option<f64>,
        years: f64,
        notes: &mut Notes,
    ) -> Result<DVec3, Refusal> {
        let Columns { pm_ra, pm_dec, radial_velocity_km_s, ref_epoch, epoch, .. } = self.columns;
        let mut bounded = |column: Option<usize>, most: f64, unit: &str| match (self.finite(column)?, self.text(column))
        {
            (Some(value), Some((_, text))) if value.abs() >= 999.0 && is_nines(text) => {
                notes.motion_ignored = true;
                Ok(0.0)
            }
            (Some(value), Some((column, text))) if value.abs() > most => {
                Err(self.refuse(column, text, &format!("is outside -{most} to {most} {unit}")))
            }
            (value, _) => Ok(value.unwrap_or(0.0)),
        };
        let motion = StarMotion {
            pm_ra_arcsec: 1e-3 * bounded(*pm_ra, MOST_MAS_YR, "mas/yr")?,
            pm_dec_arcsec: 1e-3 * bounded(*pm_dec, MOST_MAS_YR, "mas/yr")?,
            radial_velocity_km_s: bounded(*radial_velocity_km_s, MOST_KM_S, "km/s")?,
        };
        if motion == StarMotion::default() {
            return Ok(direction * distance_pc.unwrap_or(1.0));
        }
        let from_year = match (self.finite(*ref_epoch)?, self.text(*ref_epoch)) {
            (Some(year), Some((column, text))) if !EPOCHS.contains(&year) => {
                return Err(self.refuse(column, text, "is outside 1800 to 2200"));
            }
            (year, _) => year.unwrap_or(notes.source.map_or(*epoch, Source::epoch)),
        };
        let place = motion.after(direction, distance_pc, years + columns::J2000_EPOCH - from_year);
        if place.length() < NEAREST_PC {
            return Err(Refusal::of_kind(TOO_NEAR, too_near(place.length())));
        }
        let mut velocity = motion.velocity(direction, distance_pc);
        if distance_pc.is_none() {
            // Make the velocity relative to the star's unit vector at the epoch.
            velocity /= (direction + velocity * (years + columns::J2000_EPOCH - from_year)).length();
        }
        notes.velocity = Some(velocity.as_vec3().to_array());
        Ok(place)
    }

    fn temperature_k(&self, bp_rp: Option<f64>, b_v: Option<f64>, notes: &mut Notes) -> Result<f64, Refusal> {
        if let (Some(t), Some((column, text))) = (self.finite(self.columns.teff_k)?, self.text(self.columns.teff_k)) {
            // 9999 K is a possible temperature.
            if !(0.0..99_999.0).contains(&t) && is_nines(text) {
                return Ok(temperature_of_colour_k(bp_rp, b_v, notes));
            }
            if t <= 0.0 {
                return Err(self.refuse(column, text, "is not above 0 K"));
            }
            let clamped = t.clamp(TEMPERATURE_RANGE_K.0, TEMPERATURE_RANGE_K.1);
            notes.temperature_clamped = clamped != t;
            return Ok(clamped);
        }
        Ok(temperature_of_colour_k(bp_rp, b_v, notes))
    }

    /// The names and numbers of the star; `None` if it has none.
    fn names(&self) -> Option<StarNames> {
        let NameColumns { name, bayer_flamsteed, bayer, flamsteed, constellation, hip, hd, hr, gaia } =
            self.columns.names;
        let text = |column: Option<usize>| self.text(column).map(|(_, text)| text);
        let mut designations = Vec::new();
        designations.extend(text(bayer_flamsteed).and_then(names::of_hyg));
        if let Some(constellation) = text(constellation) {
            let letters = [text(bayer), text(flamsteed)].into_iter().flatten();
            designations.extend(letters.filter_map(|letter| names::of_hyg(&format!("{letter} {constellation}"))));
        }
        for (catalogue, column) in [("HR", hr), ("HIP", hip), ("HD", hd)] {
            // Some programs write whole numbers with a decimal point.
            let number = text(column).map(|text| text.trim_start_matches(catalogue).trim().trim_end_matches(".0"));
            designations
                .extend(number.filter(|text| text.parse::<u64>().is_ok()).map(|text| format!("{catalogue} {text}")));
        }
        if let Some(release) = self.named_source().unwrap_or(self.columns.source).gaia_release() {
            let number = text(gaia).filter(|text| text.parse::<u64>().is_ok());
            designations.extend(number.map(|number| format!("Gaia {release} {number}")));
        }
        let name = text(name).unwrap_or_default().to_owned();
        designations.dedup();
        (!name.is_empty() || !designations.is_empty()).then_some(StarNames { name, designations })
    }
}

/// Temperature of a colour index, K; the Sun's if there is none.
fn temperature_of_colour_k(bp_rp: Option<f64>, b_v: Option<f64>, notes: &mut Notes) -> f64 {
    match (bp_rp, b_v) {
        (Some(colour), _) => temperature_k_from_bp_rp(colour),
        (None, Some(colour)) => temperature_k_from_b_v(colour),
        (None, None) => {
            notes.without_colour = true;
            f64::from(SOLAR_TEMPERATURE_K)
        }
    }
}

/// Whether a column of names has a value in this row.
pub(super) fn has_names<'a>(columns: &Columns, field: impl Fn(usize) -> &'a str) -> bool {
    let row = Row { columns, field };
    let NameColumns { name, bayer_flamsteed, bayer, flamsteed, hip, hd, hr, gaia, .. } = columns.names;
    let gaia = gaia.filter(|_| columns.source.gaia_release().is_some());
    [name, bayer_flamsteed, bayer, flamsteed, hip, hd, hr, gaia].into_iter().any(|column| row.text(column).is_some())
}

/// The names and numbers in a row; `None` if it has none.
pub(super) fn names<'a>(columns: &Columns, field: impl Fn(usize) -> &'a str) -> Option<StarNames> {
    Row { columns, field }.names()
}

/// Whether a number consists of at least two digits that are all 9, apart from zeros after the point. Such a number marks a missing value, such as
/// -9999.
fn is_nines(text: &str) -> bool {
    let is_whole = |(_, rest): &(&str, &str)| rest.bytes().all(|digit| digit == b'0');
    let text = text.split_once('.').filter(is_whole).map_or(text, |(whole, _)| whole);
    let digits = text.trim_start_matches(['+', '-']).bytes().filter(|digit| *digit != b'.');
    digits.clone().count() >= 2 && digits.clone().all(|digit| digit == b'9')
}

/// Kind of refusal for a distance below [`NEAREST_PC`].
const TOO_NEAR: &str = "the distance is too small";

/// Describes a distance below [`NEAREST_PC`].
fn too_near(distance_pc: f64) -> String {
    format!("the distance is {distance_pc:.1e} pc and must be at least {NEAREST_PC:e} pc")
}

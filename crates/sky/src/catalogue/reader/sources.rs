//! The known sources of catalogue files, and their conventions. A source is recognised from its set of columns.

/// Right ascension columns in degrees, each with its declination column and the epoch of both, Julian years; `None`: that of the
/// source. Positions at J2000.0 come first.
pub(super) const DEGREES: &[(&str, &str, Option<f64>)] = &[
    ("ra_deg", "dec_deg", None),
    ("_raj2000", "_dej2000", Some(2000.0)),
    ("raj2000", "dej2000", Some(2000.0)),
    ("ramdeg", "demdeg", Some(2000.0)),
    ("ra_icrs", "de_icrs", None),
    ("raicrs", "deicrs", None),
    ("_ra.icrs", "_de.icrs", None),
    ("ra(icrs)", "de(icrs)", None),
    ("rahms", "dedms", None),
    ("rarad", "derad", None),
];

/// Columns that HYG and AT-HYG have besides `mag`. Few other tables have one of them.
const HYG: [&str; 14] = [
    "absmag",
    "bayerflamsteed",
    "bf",
    "ci",
    "colorindex",
    "dist_src",
    "gl",
    "gliese",
    "mag_src",
    "pos_src",
    "proper",
    "propername",
    "spect",
    "spectrum",
];

/// Source of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// This program's own column names, or a table that no other source fits.
    #[default]
    Plain,
    /// HYG, versions 1 to 4.
    Hyg,
    /// AT-HYG, versions 1 to 4.
    AtHyg,
    /// The Gaia archive, third data release.
    Gaia,
    /// The Gaia archive, second data release.
    Gaia2,
    /// Gaia's third data release from VizieR (I/355).
    VizierGaia,
    /// Gaia's second data release from VizieR (I/345).
    VizierGaia2,
    /// Hipparcos from VizieR (I/239 and I/311).
    Hipparcos,
    /// Tycho-2 from VizieR (I/259).
    Tycho2,
    /// The Bright Star Catalogue from VizieR (V/50).
    BrightStars,
    /// Another table from VizieR.
    Vizier,
}

impl Source {
    /// Recognises the source from the names of its columns, which must be in lower case.
    pub(super) fn recognise(names: &[String]) -> Self {
        let has = |name: &str| names.iter().any(|known| known == name);
        if has("mag") && HYG.iter().any(|name| has(name)) {
            return if has("dist_src") || has("mag_src") || has("pos_src") { Self::AtHyg } else { Self::Hyg };
        }
        if has("phot_g_mean_mag") || (has("source_id") && has("ra")) {
            // These columns exist in the second data release only.
            return if has("teff_val") || has("lum_val") || has("a_g_val") { Self::Gaia2 } else { Self::Gaia };
        }
        let from_vizier = DEGREES.iter().skip(1).any(|(ra, ..)| has(ra));
        if !from_vizier {
            return Self::Plain;
        }
        if has("gmag") && (has("bpmag") || has("bp-rp") || has("source")) {
            return if has("ag") && has("lum") && !has("ruwe") { Self::VizierGaia2 } else { Self::VizierGaia };
        }
        if has("btmag") && has("vtmag") && !has("vmag") {
            return Self::Tycho2;
        }
        // Tycho-1 is the second table of I/239.
        if (has("hip") || has("tyc")) && ["hpmag", "raicrs", "rahms", "rarad"].iter().any(|name| has(name)) {
            return Self::Hipparcos;
        }
        // Other tables with numbers of the Bright Star Catalogue call the parallax `plx`.
        if has("hr") && has("vmag") && !has("plx") && (has("hd") || has("parallax")) {
            return Self::BrightStars;
        }
        Self::Vizier
    }

    /// Its name, for logs and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain table",
            Self::Hyg => "HYG",
            Self::AtHyg => "AT-HYG",
            Self::Gaia => "Gaia archive, DR3",
            Self::Gaia2 => "Gaia archive, DR2",
            Self::VizierGaia => "Gaia DR3 of VizieR",
            Self::VizierGaia2 => "Gaia DR2 of VizieR",
            Self::Hipparcos => "Hipparcos of VizieR",
            Self::Tycho2 => "Tycho-2 of VizieR",
            Self::BrightStars => "Bright Star Catalogue of VizieR",
            Self::Vizier => "VizieR",
        }
    }

    /// Description, for the report, of the conventions of the source that matter for reading.
    pub(super) fn conventions(self) -> &'static str {
        match self {
            Self::Plain => "V magnitudes, positions at J2000.0 unless a column says otherwise",
            Self::Hyg | Self::AtHyg => "V magnitudes, right ascension in hours, J2000.0, distances in parsecs",
            Self::Gaia | Self::VizierGaia => "V from G and BP-RP, positions at J2016.0 unless a column says otherwise",
            Self::Gaia2 | Self::VizierGaia2 => {
                "V from G and BP-RP, positions at J2015.5 unless a column says otherwise"
            }
            Self::Hipparcos => "V and B-V of Johnson, positions at J1991.25 unless they are those of J2000",
            Self::Tycho2 => "V and B-V from VT and BT, positions at J2000.0",
            Self::BrightStars => {
                "V magnitudes, positions at J2000.0, parallaxes and motions in arcsec if there is no line of units"
            }
            Self::Vizier => "V magnitudes, positions at J2000.0",
        }
    }

    /// Epoch of positions if no column and no column name gives it, Julian years.
    pub(super) fn epoch(self) -> f64 {
        match self {
            Self::Gaia | Self::VizierGaia => 2016.0,
            Self::Gaia2 | Self::VizierGaia2 => 2015.5,
            // ESA 1997, SP-1200, volume 1, section 1.2.
            Self::Hipparcos => 1991.25,
            _ => 2000.0,
        }
    }

    /// Unit of parallaxes in a file without units; `None` means milliarcseconds.
    pub(super) fn parallax_unit(self) -> Option<&'static str> {
        (self == Self::BrightStars).then_some("arcsec")
    }

    /// Unit of proper motions in a file without units that has the columns `names`; `None` means milliarcseconds per year. Returns an error if they
    /// are not angles.
    pub(super) fn motion_unit(self, names: &[String]) -> Result<Option<&'static str>, &'static str> {
        let has = |name: &str| names.iter().any(|known| known == name);
        if self == Self::BrightStars || (self == Self::Vizier && has("lspm")) {
            return Ok(Some("arcsec/yr"));
        }
        // These are the tables I/149A, I/146, I/193 and I/131A.
        let in_seconds_of_time =
            ["fk5", "ppm", "sao"].iter().any(|name| has(name)) && self == Self::Vizier && !has("hip");
        if in_seconds_of_time { Err("FK5, PPM and SAO use seconds of time: keep the line of units") } else { Ok(None) }
    }

    /// Whether the file belongs to HYG or AT-HYG.
    pub(super) fn is_hyg(self) -> bool {
        matches!(self, Self::Hyg | Self::AtHyg)
    }

    /// Gaia data release to which the numbers in the file belong. The numbers in AT-HYG are those of DR3.
    pub(super) fn gaia_release(self) -> Option<&'static str> {
        match self {
            Self::Gaia | Self::VizierGaia | Self::AtHyg => Some("DR3"),
            Self::Gaia2 | Self::VizierGaia2 => Some("DR2"),
            _ => None,
        }
    }

    /// Whether the magnitudes are Gaia's.
    pub(super) fn is_gaia(self) -> bool {
        matches!(self, Self::Gaia | Self::Gaia2 | Self::VizierGaia | Self::VizierGaia2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(header: &str) -> Source {
        Source::recognise(&header.split(',').map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn every_source_is_recognised_by_its_columns() {
        for (header, source) in [
            ("ra_deg,dec_deg,v_mag", Source::Plain),
            ("name,ra,dec,mag,dist", Source::Plain),
            ("id,hip,proper,ra,dec,dist,mag,absmag,ci,x,y,z", Source::Hyg),
            ("starid,hip,ra,dec,distance,mag,absmag,colorindex", Source::Hyg),
            ("id,tyc,gaia,ra,dec,pos_src,dist,x0,y0,z0,dist_src,mag,absmag,ci,mag_src", Source::AtHyg),
            ("source_id,ra,dec,parallax,phot_g_mean_mag,bp_rp", Source::Gaia),
            ("source_id,ra,dec,parallax,phot_g_mean_mag,bp_rp,teff_val", Source::Gaia2),
            ("ra_icrs,de_icrs,source,plx,gmag,bpmag,rpmag,bp-rp", Source::VizierGaia),
            ("ra_icrs,de_icrs,source,plx,gmag,bpmag,rpmag,bp-rp,ag,lum", Source::VizierGaia2),
            ("hip,rahms,dedms,vmag,raicrs,deicrs,plx,b-v", Source::Hipparcos),
            ("hip,rahms,dedms,vmag,plx", Source::Hipparcos),
            ("tyc,rahms,dedms,vmag,raicrs,deicrs,btmag,vtmag,b-v", Source::Hipparcos),
            ("hr,name,hd,raj2000,dej2000,vmag,b-v,pmra,pmde,parallax", Source::BrightStars),
            ("hip,hr,raj2000,dej2000,vmag,plx,hd", Source::Vizier),
            ("tyc1,tyc2,tyc3,ramdeg,demdeg,pmra,pmde,btmag,vtmag", Source::Tycho2),
            ("_raj2000,_dej2000,vmag,b-v", Source::Vizier),
        ] {
            assert_eq!(of(header), source, "{header}");
        }
    }
}

//! A glare function from a file: a table of angle and density, or the radial mean of a point-spread function.
//!
//! A table is CSV with the header `theta_deg,per_sr`; angles must increase, from 0 or more to at most 180 degrees;
//! densities are relative. Blank lines and lines that begin with `#` are skipped; any other line that is not two
//! numbers is an error that names the line. Between rows the logarithm of the density is linear in that of the angle;
//! if one of the values is 0, the density is linear in the angle. Below the first row, and within the inner angle, it
//! is constant; beyond the last row it is 0.
//!
//! OpenEXR and FITS files (recognised by their extension) are read by `photometry::psf`: Y is averaged over circles
//! one pixel apart.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use glam::DVec2;

use super::{
    GlareKernelError,
    normalised::{Normalised, Shape},
};
use crate::files;
use crate::photometry::{
    psf::{self, Psf},
    rec709::luminance,
};

/// Largest table of a kernel, bytes.
const MOST_TABLE_BYTES: u64 = 16 << 20;

const HEADER: &str = "theta_deg,per_sr";

/// Extensions of picture files.
const PICTURES: [&str; 4] = ["exr", "fits", "fit", "fts"];

/// A tabulated glare function; see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfTable {
    /// File of the table.
    path: PathBuf,
    /// Angle, rad, and density, at least two.
    rows: Vec<(f64, f64)>,
    inner_rad: f64,
}

impl PsfTable {
    /// Reads a file.
    ///
    /// # Errors
    /// [`GlareKernelError::Read`], [`GlareKernelError::Row`] and [`GlareKernelError::File`] for a table,
    /// [`GlareKernelError::Psf`] for an unusable picture.
    pub fn read(path: &Path) -> Result<Self, GlareKernelError> {
        let is_picture = path.extension().is_some_and(|found| PICTURES.iter().any(|e| found.eq_ignore_ascii_case(e)));
        let rows = if is_picture {
            radial_means(&psf::read(path, None)?.psf)
        } else {
            let text = files::read_text_bounded(path, MOST_TABLE_BYTES)
                .map_err(|source| GlareKernelError::Read { path: path.to_owned(), source })?;
            parse(path, &text)?
        };
        let inner_rad = rows[0].0;
        Ok(Self { path: path.to_owned(), rows, inner_rad })
    }

    /// Creates the kernel, which is constant within an inner angle above 0, rad.
    ///
    /// # Errors
    /// [`GlareKernelError::Inner`] if that angle covers the whole table, [`GlareKernelError::File`] if it has no
    /// light.
    pub fn kernel(self, inner_rad: f64) -> Result<Normalised<Self>, GlareKernelError> {
        let last_rad = self.rows.last().map_or(0.0, |row| row.0);
        let path = self.path.clone();
        if inner_rad >= last_rad {
            return Err(GlareKernelError::Inner {
                path,
                inner_deg: inner_rad.to_degrees(),
                last_deg: last_rad.to_degrees(),
            });
        }
        let inner_rad = inner_rad.max(self.rows[0].0);
        let problem = || "the density must not be 0 everywhere beyond the inner angle".to_owned();
        Normalised::new(Self { inner_rad, ..self }).ok_or_else(|| GlareKernelError::File { path, problem: problem() })
    }
}

/// Parses the rows of a table.
fn parse(path: &Path, text: &str) -> Result<Vec<(f64, f64)>, GlareKernelError> {
    let refuse = |line: usize, problem: String| GlareKernelError::Row { path: path.to_owned(), line, problem };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (line, header) = lines.next().unwrap_or((1, ""));
    if !header.split(',').map(str::trim).eq(HEADER.split(',')) {
        return Err(refuse(line, format!("`{header}`: the header must be `{HEADER}`")));
    }
    let mut rows: Vec<(f64, f64)> = Vec::new();
    for (line, row) in lines {
        let number = |field: &str| field.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let fields: Vec<Option<f64>> = row.split(',').map(number).collect();
        let [Some(theta_deg), Some(per_sr)] = fields[..] else {
            return Err(refuse(line, format!("`{row}`: must be two finite numbers, {HEADER}")));
        };
        if !(0.0..=180.0).contains(&theta_deg) {
            return Err(refuse(line, format!("theta_deg = {theta_deg}: must be between 0 and 180")));
        }
        if per_sr < 0.0 {
            return Err(refuse(line, format!("per_sr = {per_sr}: must be at least 0")));
        }
        let theta_rad = theta_deg.to_radians();
        if rows.last().is_some_and(|last| theta_rad <= last.0) {
            return Err(refuse(line, format!("theta_deg = {theta_deg}: angles must increase from row to row")));
        }
        rows.push((theta_rad, per_sr));
    }
    if rows.len() < 2 {
        let problem = format!("{} rows: must be at least 2", rows.len());
        return Err(GlareKernelError::File { path: path.to_owned(), problem });
    }
    Ok(rows)
}

/// Mean of Y over circles around the star, from its centre to the edge of the texture: angle, rad, and density, 1/sr.
fn radial_means(psf: &Psf) -> Vec<(f64, f64)> {
    let ring = |ring: u32| {
        // Two points for each pixel of the circle.
        let points = 8 + 13 * ring;
        let radius_rad = f64::from(ring) * psf.pixel_rad;
        let sum: f64 = (0..points)
            .map(|i| DVec2::from_angle(TAU * (f64::from(i) + 0.5) / f64::from(points)) * radius_rad)
            .map(|offset| luminance(psf.sample(offset)))
            .sum();
        (radius_rad, sum / f64::from(points))
    };
    // The smallest texture is two pixels wide: two rows.
    (0..=psf.size / 2).map(ring).collect()
}

/// Interpolates the density between two rows.
fn between(a: (f64, f64), b: (f64, f64), angle_rad: f64) -> f64 {
    if a.0 > 0.0 && a.1 > 0.0 && b.1 > 0.0 {
        a.1 * (angle_rad / a.0).powf((b.1 / a.1).ln() / (b.0 / a.0).ln())
    } else {
        a.1 + (b.1 - a.1) * (angle_rad - a.0) / (b.0 - a.0)
    }
}

impl Shape for PsfTable {
    fn relative(&self, angle_rad: f64) -> f64 {
        let angle_rad = angle_rad.max(self.inner_rad);
        let after = self.rows.partition_point(|row| row.0 <= angle_rad);
        match (after.checked_sub(1).map(|before| self.rows[before]), self.rows.get(after)) {
            (Some(before), Some(after)) => between(before, *after, angle_rad),
            (Some(last), None) if last.0 == angle_rad => last.1,
            (None, Some(first)) => first.1,
            _ => 0.0,
        }
    }

    fn inner_rad(&self) -> f64 {
        self.inner_rad
    }

    fn kinks_rad(&self) -> Vec<f64> {
        let rows = self.rows.iter().map(|row| row.0).filter(|angle| *angle > self.inner_rad);
        std::iter::once(self.inner_rad).chain(rows).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::{
        glare::{GlareKernel, InverseSquareKernel, normalised::tests::shares_are_integrals_of_the_density},
        psf::{Aperture, Optics, write_exr},
    };

    fn table(text: &str) -> Result<PsfTable, GlareKernelError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("eye.csv");
        std::fs::write(&path, text).unwrap();
        PsfTable::read(&path)
    }

    #[test]
    fn a_table_of_the_inverse_square_is_the_inverse_square() {
        let inner = 0.1_f64.to_radians();
        let rows: String =
            [0.01, 0.1, 1.0, 30.0, 180.0_f64].map(|deg| format!("{deg}, {}\n", 7.0 * deg.powi(-2))).concat();
        let kernel = table(&format!("# an eye\n\ntheta_deg, per_sr\n{rows}")).unwrap().kernel(inner).unwrap();
        let known = InverseSquareKernel::new(inner);
        for deg in [0.0, 0.05, 0.1, 0.3, 1.0, 12.0, 100.0, 180.0_f64] {
            let (found, expected) = (kernel.per_sr(deg.to_radians()), known.per_sr(deg.to_radians()));
            assert!((found / expected - 1.0).abs() < 1e-7, "{deg}: {found} {expected}");
        }
        assert_eq!(kernel.inner_rad(), inner);
        shares_are_integrals_of_the_density(&kernel);
        // It is constant below the first row too.
        let kernel = table(&format!("theta_deg,per_sr\n{rows}")).unwrap().kernel(1e-9).unwrap();
        assert_eq!(kernel.inner_rad(), 0.01_f64.to_radians());
        assert_eq!(kernel.per_sr(0.0), kernel.per_sr(0.01_f64.to_radians()));
    }

    #[test]
    fn zeros_are_interpolated_linearly_and_the_density_is_0_beyond_the_last_row() {
        let kernel = table("theta_deg,per_sr\n0,4\n2,2\n4,0\n6,1\n13,1\n").unwrap().kernel(1e-9).unwrap();
        let relative_density = |deg: f64| kernel.per_sr(deg.to_radians()) / kernel.per_sr(13.0_f64.to_radians());
        for (deg, expected) in [(1.0, 3.0), (3.0, 1.0), (4.0, 0.0), (5.0, 0.5), (7.0, 1.0), (13.001, 0.0), (180.0, 0.0)]
        {
            assert!((relative_density(deg) - expected).abs() < 1e-9, "{deg}: {}", relative_density(deg));
        }
        assert_eq!(kernel.share_within(13.01_f64.to_radians()), 1.0);
        shares_are_integrals_of_the_density(&kernel);
    }

    #[test]
    fn errors_name_file_and_line() {
        for (text, parts) in [
            ("", &["1: ", "theta_deg,per_sr"][..]),
            ("\n# x\nangle,per_sr\n", &["3: ", "angle,per_sr", "header"]),
            ("theta_deg,per_sr\n1,2\n2,x\n", &["3: ", "2,x", "two finite numbers"]),
            ("theta_deg,per_sr\r\n\r\n1,2\r\n2,1,0\r\n", &["4: ", "2,1,0"]),
            ("theta_deg,per_sr\n1,inf\n", &["2: ", "finite"]),
            ("theta_deg,per_sr\n1\n", &["2: ", "two"]),
            ("theta_deg,per_sr\n-1,2\n", &["2: ", "between 0 and 180"]),
            ("theta_deg,per_sr\n1,2\n181,2\n", &["3: ", "between 0 and 180"]),
            ("theta_deg,per_sr\n1,-2\n", &["2: ", "at least 0"]),
            ("theta_deg,per_sr\n1,2\n# y\n1,1\n", &["4: ", "must increase"]),
            ("theta_deg,per_sr\n1,2\n", &["1 rows", "at least 2"]),
        ] {
            let message = table(text).unwrap_err().to_string();
            for part in parts.iter().chain(&["eye.csv"]) {
                assert!(message.contains(part), "`{part}` is not in: {message}");
            }
        }
        assert!(matches!(PsfTable::read(Path::new("/no/eye.csv")), Err(GlareKernelError::Read { .. })));
        let usable = || table("theta_deg,per_sr\n1,2\n5,0\n9,0").unwrap();
        let message = usable().kernel(0.2).unwrap_err().to_string();
        assert!(message.contains("eye.csv") && message.contains("inner_deg") && message.contains('9'), "{message}");
        assert!(matches!(usable().kernel(0.1), Err(GlareKernelError::File { .. })));
        assert!(usable().kernel(0.05).is_ok());
    }

    #[test]
    fn a_picture_is_averaged_over_circles() {
        let optics = Optics {
            aperture: Aperture::Circle,
            diameter_mm: 1.0,
            size: 64,
            pixel_rad: 1e-4,
            wavelengths: 4,
            temperature_k: 6000.0,
        };
        let picture = Psf::from_aperture(&optics, |_, _| {}).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("circle.EXR");
        write_exr(&path, &picture).unwrap();
        let kernel = PsfTable::read(&path).unwrap().kernel(1e-5).unwrap();
        // The image of a star through a circular aperture depends on the angle alone.
        for pixels in [0.0, 2.0, 5.0, 20.0] {
            let angle = pixels * picture.pixel_rad;
            let expected = luminance(picture.sample(DVec2::new(angle, 0.0)));
            let found = kernel.per_sr(angle);
            assert!((found / expected - 1.0).abs() < 0.1, "{pixels}: {found} {expected}");
            let share = kernel.share_within(angle) - picture.encircled_energy(angle);
            assert!(share.abs() < 0.03, "{pixels}: {share}");
        }
        assert_eq!(kernel.per_sr(0.5), 0.0);
        std::fs::write(&path, "not a picture").unwrap();
        let error = PsfTable::read(&path).unwrap_err();
        assert!(matches!(error, GlareKernelError::Psf(_)) && error.to_string().contains("circle.EXR"), "{error}");
    }
}

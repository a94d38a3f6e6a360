//! Reader for the part of FITS (Flexible Image Transport System, FITS Standard 4.0) that is used for point-spread
//! functions: the first two-dimensional image of a file.
//!
//! A unit is a header of 80-character cards in blocks of 2880 bytes, followed by big-endian data in such blocks. A
//! stored value v means BSCALE v + BZERO; rows start at the bottom. Units without a two-dimensional image are
//! skipped. Angles of pixels: PIXELSCL and PIXSCALE in arcseconds, CDELT1/2 and CD1_1 .. CD2_2 in CUNIT1, degrees if
//! it is missing.

use std::path::Path;

use super::PsfError;
use super::read::{Plane, checked_size};
use crate::fits::{BLOCK, Header};

/// Header entries that give the angle of a pixel.
pub const SCALES: &str = "PIXELSCL, PIXSCALE, CDELT1 and CDELT2, or CD1_1 to CD2_2";

const ALLOWED: &str = "a FITS file with an image of two axes and BITPIX 8, 16, 32, 64, -32 or -64";

/// Largest relative difference between height and width of a pixel.
const SQUARE_WITHIN: f64 = 0.01;

/// Angle of a pixel in arcseconds, if the header has it.
fn pixel_arcsec(header: &Header) -> Result<Option<f64>, String> {
    if let Some(scale) = header.number("PIXELSCL").or_else(|| header.number("PIXSCALE")) {
        return Ok(Some(scale));
    }
    let unit_arcsec = match header.0.get("CUNIT1").map(|unit| unit.to_ascii_lowercase()).as_deref() {
        None | Some("" | "deg" | "degree" | "degrees") => 3600.0,
        Some("arcsec" | "arcseconds") => 1.0,
        Some("arcmin") => 60.0,
        Some("rad" | "radian") => 1.0 / super::ARCSECOND_RAD,
        Some("mas") => 1e-3,
        Some(other) => return Err(format!("CUNIT1 is `{other}`, not deg, arcmin, arcsec, mas or rad")),
    };
    let entry = |key: &str| header.number(key).unwrap_or(0.0);
    let has_matrix = header.number("CD1_1").is_some() || header.number("CD1_2").is_some();
    let sides = if has_matrix {
        [entry("CD1_1").hypot(entry("CD2_1")), entry("CD1_2").hypot(entry("CD2_2"))]
    } else if let (Some(x), Some(y)) = (header.number("CDELT1"), header.number("CDELT2")) {
        [x.abs(), y.abs()]
    } else {
        return Ok(None);
    };
    if (sides[0] - sides[1]).abs() > SQUARE_WITHIN * sides[0] {
        return Err(format!("pixels are {} by {}, not square", sides[0], sides[1]));
    }
    Ok(Some((sides[0] * sides[1]).sqrt() * unit_arcsec))
}

/// Verifies DATASUM and CHECKSUM (FITS Standard 4.0, 4.4.2.7 and appendix J) if they are present. `unit` has the
/// bytes from the header on; its data begin at `data` and end at `end`.
fn check_sums(header: &Header, unit: &[u8], data: usize, end: Option<usize>) -> Result<(), String> {
    let declared = header.0.get("DATASUM").filter(|text| !text.is_empty());
    let whole = header.0.get("CHECKSUM").filter(|text| !text.is_empty());
    if declared.is_none() && whole.is_none() {
        return Ok(());
    }
    let cut = || "it ends within its data; its checksum cannot be verified".to_owned();
    let unit = end.and_then(|end| unit.get(..end)).ok_or_else(cut)?;
    if let Some(text) = declared {
        let found = ones_complement_sum(unit.get(data..).unwrap_or_default());
        let expected: u32 = text.parse().map_err(|_| format!("DATASUM is `{text}`, not a 32-bit number"))?;
        if found != expected {
            return Err(format!("the sum of its data is {found}, but DATASUM is {expected}: it is damaged"));
        }
    }
    // With a valid card the sum of the unit is minus zero, or zero.
    let sum = ones_complement_sum(unit);
    if whole.is_some() && sum != u32::MAX && sum != 0 {
        return Err("its CHECKSUM does not match: it is damaged".to_owned());
    }
    Ok(())
}

/// Sum of 32-bit big-endian words in ones' complement: the carry is added to the lowest bit.
fn ones_complement_sum(bytes: &[u8]) -> u32 {
    let words = bytes.chunks(4).map(|word| {
        let mut whole = [0; 4];
        whole[..word.len()].copy_from_slice(word);
        u64::from(u32::from_be_bytes(whole))
    });
    let mut sum: u64 = words.sum();
    while sum >> 32 != 0 {
        sum = (sum & u64::from(u32::MAX)) + (sum >> 32);
    }
    sum as u32
}

/// Reads the first two-dimensional image.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Plane, PsfError> {
    find_image(bytes).map_err(|problem| PsfError::File { path: path.to_owned(), problem, allowed: ALLOWED })
}

fn find_image(bytes: &[u8]) -> Result<Plane, String> {
    let (mut start, mut seen) = (0, Vec::new());
    while start < bytes.len() {
        let (header, data) = Header::read(bytes, start)?;
        let axes = header.axes()?;
        let bitpix = header.number("BITPIX").ok_or("BITPIX is missing or not a number")? as i64;
        let kind = header.0.get("XTENSION").map_or("primary", String::as_str);
        if matches!(kind, "primary" | "IMAGE") && is_picture(&axes) {
            let picture = axes[0].checked_mul(axes[1]).and_then(|n| n.checked_mul(bitpix.unsigned_abs() as usize / 8));
            let end = picture.and_then(|n| n.checked_next_multiple_of(BLOCK)).and_then(|n| n.checked_add(data));
            check_sums(&header, &bytes[start..], data - start, end.map(|end| end - start))?;
            return image(&header, bitpix, axes[0], axes[1], bytes.get(data..).unwrap_or_default());
        }
        seen.push(format!("{kind} with axes {axes:?}"));
        start = header.data_bytes()?.checked_add(data).ok_or_else(|| format!("the axes {axes:?} are too large"))?;
    }
    Err(format!("no image of two axes ({})", seen.join("; ")))
}

/// Whether axes beyond the second have one element only.
fn is_picture(axes: &[usize]) -> bool {
    axes.len() >= 2 && axes[..2].iter().all(|n| *n > 0) && axes[2..].iter().all(|n| *n == 1)
}

fn image(header: &Header, bitpix: i64, width: usize, height: usize, data: &[u8]) -> Result<Plane, String> {
    let bytes_each = bitpix.unsigned_abs() as usize / 8;
    let pixels = width.checked_mul(height).ok_or_else(|| format!("{width} x {height} pixels are too many"))?;
    let needed = pixels.checked_mul(bytes_each).ok_or_else(|| format!("{width} x {height} pixels are too many"))?;
    let decode: fn(&[u8]) -> f64 = match bitpix {
        8 => |b| f64::from(b[0]),
        16 => |b| f64::from(i16::from_be_bytes([b[0], b[1]])),
        32 => |b| f64::from(i32::from_be_bytes([b[0], b[1], b[2], b[3]])),
        64 => |b| i64::from_be_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f64,
        -32 => |b| f64::from(f32::from_be_bytes([b[0], b[1], b[2], b[3]])),
        -64 => |b| f64::from_be_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
        other => return Err(format!("BITPIX is {other}")),
    };
    if data.len() < needed {
        return Err(format!(
            "{width} x {height} pixels of {bytes_each} bytes are {needed} bytes; the file has {}",
            data.len()
        ));
    }
    checked_size(width, height)?;
    let (scale, zero) = (header.number("BSCALE").unwrap_or(1.0), header.number("BZERO").unwrap_or(0.0));
    let blank = if bitpix > 0 { header.number("BLANK") } else { None };
    let values: Vec<[f64; 3]> = (0..pixels)
        .map(|index| {
            // The file's first row is the lowest.
            let place = (height - 1 - index / width) * width + index % width;
            let stored = decode(&data[place * bytes_each..][..bytes_each]);
            let value = if blank == Some(stored) { f64::NAN } else { scale * stored + zero };
            [value; 3]
        })
        .collect();
    Ok(Plane { width, height, values, pixel_arcsec: pixel_arcsec(header)?, covered: 1.0 })
}

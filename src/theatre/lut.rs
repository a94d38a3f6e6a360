//! Look-up tables for colours: `.cube` text with one or three dimensions.

use std::path::Path;

use super::{MOST_BYTES, TheatreError, fault::Fault};
use crate::files;
pub use crate::view::projector::{Lut, LutKind};

/// Maximum number of entries of a one-dimensional table.
const MOST_1D: usize = 65536;
/// Maximum number of entries along each side of a cube.
const MOST_3D: usize = 256;

const ALLOWED: &str = "a .cube file must have LUT_1D_SIZE (2 to 65536) or LUT_3D_SIZE (2 to 256), optionally TITLE, and DOMAIN_MIN and \
                       DOMAIN_MAX or the two numbers of LUT_1D_INPUT_RANGE or LUT_3D_INPUT_RANGE, then that many lines of three finite numbers";

/// Byte order mark, which some programs write at the beginning of a text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads a `.cube` file.
///
/// # Errors
///
/// See [`TheatreError`].
pub fn read_lut(path: &Path) -> Result<Lut, TheatreError> {
    let bytes =
        files::read_bounded(path, MOST_BYTES).map_err(|source| TheatreError::Read { path: path.to_owned(), source })?;
    decode(&bytes).map_err(|fault| fault.of_file(path))
}

/// Whether the first meaningful line begins with one of the keywords.
pub(super) fn is_cube(bytes: &[u8]) -> bool {
    const KEYWORDS: [&[u8]; 4] = [b"TITLE", b"LUT_", b"DOMAIN_", b"#LUT"];
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let lines = bytes.split(|byte| *byte == b'\n').take(1000).map(<[u8]>::trim_ascii);
    let first = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#"));
    first.is_some_and(|line| KEYWORDS.iter().any(|keyword| line.starts_with(keyword)))
}

/// Parses exactly N finite numbers.
fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> Option<[f32; N]> {
    let parsed: Option<Vec<f32>> =
        words.take(N + 1).map(|word| word.parse::<f32>().ok().filter(|value| value.is_finite())).collect();
    parsed?.try_into().ok()
}

pub(super) fn decode(bytes: &[u8]) -> Result<Lut, Fault> {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new("look-up table", "not text in UTF-8", ALLOWED))?;
    let mut size: Option<(LutKind, usize)> = None;
    let mut domain = [[0.0; 3], [1.0; 3]];
    // The keyword that gives the domain.
    let mut domain_by: Option<&str> = None;
    let mut values = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let bad = |problem: &str| Err(Fault::new(format!("line {}", number + 1), problem, ALLOWED));
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        match keyword {
            "TITLE" => {}
            "LUT_1D_SIZE" | "LUT_3D_SIZE" => {
                let (kind, most) =
                    if keyword == "LUT_1D_SIZE" { (LutKind::One, MOST_1D) } else { (LutKind::Three, MOST_3D) };
                let entries = words.next().and_then(|word| word.parse().ok()).filter(|n| (2..=most).contains(n));
                match (entries, size) {
                    (Some(entries), None) => size = Some((kind, entries)),
                    (None, _) => return bad("an invalid size"),
                    (_, Some(_)) => return bad("a second size"),
                }
            }
            "DOMAIN_MIN" | "DOMAIN_MAX" => {
                let Some(bound) = numbers::<3>(words) else { return bad("not three numbers") };
                if domain_by.is_some_and(|by| by != "DOMAIN") {
                    return bad("a domain in addition to an input range");
                }
                domain_by = Some("DOMAIN");
                domain[usize::from(keyword == "DOMAIN_MAX")] = bound;
            }
            "LUT_1D_INPUT_RANGE" | "LUT_3D_INPUT_RANGE" => {
                let Some(range) = numbers::<2>(words) else { return bad("not two numbers") };
                if domain_by.replace(keyword).is_some() {
                    return bad("a second input range, or an input range in addition to a domain");
                }
                domain = range.map(|bound| [bound; 3]);
            }
            word if word.starts_with(|c: char| c.is_alphabetic() || c == '_') && word.parse::<f32>().is_err() => {
                return bad(&format!("`{}` is not a known keyword", word.escape_debug()));
            }
            _ => {
                let Some(value) = numbers::<3>(line.split_whitespace()) else {
                    return bad("not three finite numbers");
                };
                values.push(value);
            }
        }
    }
    let bad = |problem: String| Err(Fault::new("look-up table", problem, ALLOWED));
    let Some((kind, size)) = size else {
        return bad("no size".to_owned());
    };
    let other = if kind == LutKind::One { "LUT_3D_INPUT_RANGE" } else { "LUT_1D_INPUT_RANGE" };
    if domain_by == Some(other) {
        return bad(format!("{other} in a table with another number of dimensions"));
    }
    let expected = if kind == LutKind::One { size } else { size.pow(3) };
    if values.len() != expected {
        return bad(format!("{} lines of values, but the size requires {expected}", values.len()));
    }
    if (0..3).any(|c| domain[0][c] >= domain[1][c]) {
        return bad(format!("a domain from {:?} to {:?}", domain[0], domain[1]));
    }
    Ok(Lut { kind, size, domain, values })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn tables_of_one_and_three_dimensions_are_read() {
        let one = decode(b"# made by hand\nTITLE \"a\"\nLUT_1D_SIZE 2\nDOMAIN_MAX 2 2 2\n0 0 0\n1 0.5 0.25\n").unwrap();
        assert_eq!((one.kind, one.size, one.domain), (LutKind::One, 2, [[0.0; 3], [2.0; 3]]));
        assert_eq!(one.values, [[0.0; 3], [1.0, 0.5, 0.25]]);
        let cube = decode(format!("LUT_3D_SIZE 2\n{}", "0 0.5 1\n".repeat(8)).as_bytes()).unwrap();
        assert_eq!((cube.kind, cube.values.len()), (LutKind::Three, 8));
    }

    #[test]
    fn tables_of_davinci_resolve_have_an_input_range_and_perhaps_a_mark() {
        let one = decode(b"\xef\xbb\xbfLUT_1D_SIZE 2\r\nLUT_1D_INPUT_RANGE 0 1\r\n0 0 0\r\n1 1 1\r\n").unwrap();
        assert_eq!((one.kind, one.domain), (LutKind::One, [[0.0; 3], [1.0; 3]]));
        let three = format!("LUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE -0.5 2.0\n{}", "0 0.5 1\n".repeat(8));
        assert_eq!(decode(three.as_bytes()).unwrap().domain, [[-0.5; 3], [2.0; 3]]);
        assert!(is_cube(b"\xef\xbb\xbfLUT_3D_SIZE 2\n"));
        for (wrong, expected) in [
            ("LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 0\n0 0 0\n1 1 1", "not two numbers"),
            ("LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 1 0\n0 0 0\n1 1 1", "a domain from"),
            ("LUT_1D_SIZE 2\nLUT_3D_INPUT_RANGE 0 1\n0 0 0\n1 1 1", "with another number of dimensions"),
            ("LUT_1D_SIZE 2\nDOMAIN_MIN 0 0 0\nLUT_1D_INPUT_RANGE 0 1\n0 0 0\n1 1 1", "in addition to a domain"),
            ("LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 0 1\nDOMAIN_MIN 0 0 0\n0 0 0\n1 1 1", "in addition to an input range"),
            ("LUT_1D_SIZE 2\nLUT_IN_VIDEO_RANGE\n0 0 0\n1 1 1", "`LUT_IN_VIDEO_RANGE` is not a known keyword"),
        ] {
            let Err(Fault::Content { problem, .. }) = decode(wrong.as_bytes()) else { panic!("{wrong}") };
            assert!(problem.contains(expected), "{problem}");
        }
    }

    #[test]
    fn invalid_tables_are_refused() {
        for wrong in [
            "",
            "LUT_1D_SIZE 1\n0 0 0",
            "LUT_3D_SIZE 257\n",
            "LUT_1D_SIZE 2\n0 0 0",
            "LUT_1D_SIZE 2\n0 0 0\n1 1 1\n2 2 2",
            "LUT_1D_SIZE 2\n0 0 0\n1 1 nan",
            "LUT_1D_SIZE 2\n0 0 0\n1 1",
            "LUT_1D_SIZE 2\nLUT_1D_SIZE 2\n0 0 0\n1 1 1",
            "LUT_1D_SIZE 2\nDOMAIN_MAX 0 1 1\n0 0 0\n1 1 1",
            "LUT_1D_SIZE 2\nGAMMA 2\n0 0 0\n1 1 1",
        ] {
            assert!(decode(wrong.as_bytes()).is_err(), "{wrong}");
        }
        assert!(is_cube(b"# x\nLUT_3D_SIZE 2\n") && !is_cube(b"2\n3 3\n"));
    }
}

//! Look-up tables for colours: `.cube` text with one or three dimensions.

use std::path::Path;

use super::{MOST_BYTES, TheatreError, fault::Fault};
use crate::files;
pub use crate::view::projector::{Lut, LutKind};

/// Maximum number of entries of a one-dimensional table.
const MOST_1D: usize = 65536;
/// Maximum number of entries along each side of a cube.
const MOST_3D: usize = 256;

const ALLOWED: &str = "a .cube file must have LUT_1D_SIZE (2 to 65536) or LUT_3D_SIZE (2 to 256), optionally TITLE, DOMAIN_MIN and DOMAIN_MAX, then \
                       that many lines of three finite numbers";

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
    let lines = bytes.split(|byte| *byte == b'\n').take(1000).map(<[u8]>::trim_ascii);
    let first = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#"));
    first.is_some_and(|line| KEYWORDS.iter().any(|keyword| line.starts_with(keyword)))
}

/// Parses exactly three finite numbers.
fn three<'a>(words: impl Iterator<Item = &'a str>) -> Option<[f32; 3]> {
    let mut words = words.map(|word| word.parse::<f32>().ok().filter(|value| value.is_finite()));
    let three = [words.next()??, words.next()??, words.next()??];
    words.next().is_none().then_some(three)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Lut, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new("look-up table", "not text in UTF-8", ALLOWED))?;
    let mut size: Option<(LutKind, usize)> = None;
    let mut domain = [[0.0; 3], [1.0; 3]];
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
                let Some(bound) = three(words) else { return bad("not three numbers") };
                domain[usize::from(keyword == "DOMAIN_MAX")] = bound;
            }
            _ => {
                let Some(value) = three(line.split_whitespace()) else {
                    return bad("neither a known keyword nor three finite numbers");
                };
                values.push(value);
            }
        }
    }
    let bad = |problem: String| Err(Fault::new("look-up table", problem, ALLOWED));
    let Some((kind, size)) = size else {
        return bad("no size".to_owned());
    };
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

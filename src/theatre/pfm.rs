//! Portable float maps (PFM of Netpbm) with three floats per sample: a text header, then f32 values; the sign of the
//! scale gives the byte order (negative: little-endian).

use super::{MOST_SIDE, RowOrder, fault::Fault};

/// Range of the absolute values of coordinates, unit vectors and points that are not 0.
const PLAUSIBLE: std::ops::Range<f32> = 1e-6..1e6;

/// A picture of three floats per sample, in the order of the file.
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<[f32; 3]>,
}

impl Plane {
    /// Returns the column, the row (from the top) and the value of every sample, top row first.
    pub fn top_down(&self, order: RowOrder) -> impl Iterator<Item = (usize, usize, [f32; 3])> {
        (0..self.height).flat_map(move |row| {
            let in_file = if order == RowOrder::BottomFirst { self.height - 1 - row } else { row };
            let values = &self.values[in_file * self.width..(in_file + 1) * self.width];
            values.iter().enumerate().map(move |(column, value)| (column, row, *value))
        })
    }
}

pub(super) fn is_pfm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', end, ..] if end.is_ascii_whitespace())
}

/// Returns the next word of a text header. Also consumes one whitespace character after it.
fn word<'a>(bytes: &mut &'a [u8]) -> Option<&'a str> {
    let text = bytes.trim_ascii_start();
    // The numbers of a header are short; longer words are invalid.
    let end = text.iter().take(64).position(u8::is_ascii_whitespace)?;
    *bytes = &text[end + 1..];
    std::str::from_utf8(&text[..end]).ok()
}

/// Reads a map of three floats per sample.
pub(super) fn decode(bytes: &[u8]) -> Result<Plane, Fault> {
    let mut rest = bytes;
    let bad = |problem: String, allowed: &str| Fault::new("PFM header", problem, allowed);
    match word(&mut rest) {
        Some("PF") => {}
        Some("Pf") => {
            return Err(bad("it has one float per sample (Pf)".to_owned(), "must be three floats per sample (PF)"));
        }
        _ => return Err(bad("it does not begin with PF".to_owned(), "must have PF, width, height and scale")),
    }
    let mut side = |name: &str| {
        let word = word(&mut rest);
        word.and_then(|text| text.parse::<usize>().ok()).filter(|side| (1..=MOST_SIDE).contains(side)).ok_or_else(
            || {
                bad(
                    format!("{name} `{}`", word.unwrap_or_default()),
                    &format!("must be a number from 1 to {MOST_SIDE}"),
                )
            },
        )
    };
    let (width, height) = (side("width")?, side("height")?);
    let scale = word(&mut rest);
    let little_endian = match scale.and_then(|text| text.parse::<f64>().ok()) {
        Some(-1.0) => true,
        Some(1.0) => false,
        _ => {
            let allowed = "must be -1 (little-endian) or 1 (big-endian): values are absolute, and no factor is applied";
            return Err(bad(format!("scale `{}`", scale.unwrap_or_default()), allowed));
        }
    };
    let expected = width * height * 12;
    if rest.len() != expected {
        let problem = format!("{} bytes of samples", rest.len());
        return Err(Fault::new(
            "PFM samples",
            problem,
            format!("{width} x {height} samples of three floats must have {expected}"),
        ));
    }
    let read_as = |little_endian: bool, four: &[u8]| {
        let four = [four[0], four[1], four[2], four[3]];
        if little_endian { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) }
    };
    let plausible = |little_endian: bool| {
        let values = rest.chunks_exact(4).map(|four| read_as(little_endian, four));
        values.filter(|value| value.is_nan() || *value == 0.0 || PLAUSIBLE.contains(&value.abs())).count()
    };
    let count = rest.len() / 4;
    if 2 * plausible(little_endian) < count && 100 * plausible(!little_endian) >= 99 * count {
        let (order, right, sign) = if little_endian { ("little", "big", "1") } else { ("big", "little", "-1") };
        let problem = format!("most values are implausible in the byte order of the header ({order}-endian)");
        let allowed = format!(
            "they are plausible in the other byte order: the scale must be {sign} if the samples are {right}-endian"
        );
        return Err(Fault::new("PFM samples", problem, allowed));
    }
    let number = |four: &[u8]| read_as(little_endian, four);
    let values = rest.chunks_exact(12).map(|s| [number(&s[..4]), number(&s[4..8]), number(&s[8..])]).collect();
    Ok(Plane { width, height, values })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn a_scale_with_the_wrong_sign_is_named() {
        let file = |scale: &str, bytes: fn(f32) -> [u8; 4]| {
            let values = (0..48).map(|i| if i % 3 == 2 { 0.0 } else { (i as f32 + 0.5) / 48.0 });
            let mut file = format!("PF\n4 4\n{scale}\n").into_bytes();
            file.extend(values.flat_map(bytes));
            decode(&file)
        };
        assert!(file("-1", f32::to_le_bytes).is_ok() && file("1", f32::to_be_bytes).is_ok());
        for (scale, bytes, right) in [
            ("-1", f32::to_be_bytes as fn(f32) -> [u8; 4], "must be 1 if the samples are big-endian"),
            ("1", f32::to_le_bytes, "must be -1 if the samples are little-endian"),
        ] {
            let Err(Fault::Content { allowed, .. }) = file(scale, bytes) else { panic!("{scale}") };
            assert!(allowed.contains(right), "{allowed}");
        }
    }
}

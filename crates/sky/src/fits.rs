//! Headers of FITS files (Flexible Image Transport System, FITS Standard 4.0): cards of 80 characters in blocks of 2880 bytes.

use std::collections::HashMap;
use std::io::{self, Read};

/// Length of a block, bytes; header and data of a unit are padded to whole blocks.
pub const BLOCK: usize = 2880;
/// Length of a card, bytes.
pub const CARD: usize = 80;

/// Largest header that is read from a stream, bytes; 999 columns with ten cards each need less than half of it.
const MOST_HEADER_BYTES: usize = 2 << 20;

/// A header: keywords and their values as text, strings without quotes.
#[derive(Clone, Debug, Default)]
pub struct Header(pub HashMap<String, String>);

impl Header {
    /// Value of a keyword as a number.
    pub fn number(&self, key: &str) -> Option<f64> {
        // FORTRAN's D for an exponent is accepted.
        self.0.get(key)?.replace(['D', 'd'], "E").parse().ok()
    }

    /// Value of a keyword as a count.
    pub fn count(&self, key: &str) -> Option<usize> {
        self.0.get(key)?.parse().ok()
    }

    /// Reads the cards from `start` to END; returns the header and the start of its data.
    ///
    /// # Errors
    /// A card is not ASCII, or END is missing.
    pub fn read(bytes: &[u8], start: usize) -> Result<(Self, usize), String> {
        let mut entries = HashMap::new();
        for (index, card) in bytes[start..].chunks_exact(CARD).enumerate() {
            let card = std::str::from_utf8(card)
                .ok()
                .filter(|card| card.is_ascii())
                .ok_or_else(|| format!("card {} of the header at byte {start} is not ASCII", index + 1))?;
            let key = card[..8].trim_end();
            if key == "END" {
                return Ok((Self(entries), start + ((index + 1) * CARD).next_multiple_of(BLOCK)));
            }
            if let Some(value) = card[8..].strip_prefix("= ") {
                entries.insert(key.to_owned(), value_of(value));
            }
        }
        Err(format!("the header at byte {start} has no END"))
    }

    /// Reads the next header of a file; `None` at its end. Bytes after the last unit that do not fill a block are ignored.
    ///
    /// # Errors
    /// Reading fails, which is the outer error; or the header is not valid, which is the inner error.
    pub fn next(source: &mut impl Read) -> io::Result<Option<Result<Self, String>>> {
        let mut bytes = Vec::new();
        loop {
            let start = bytes.len();
            source.by_ref().take(BLOCK as u64).read_to_end(&mut bytes)?;
            if bytes.len() < BLOCK {
                return Ok(None);
            }
            let block = &bytes[start..];
            if block.chunks_exact(CARD).any(|card| card.starts_with(b"END     ")) {
                return Ok(Some(Header::read(&bytes, 0).map(|(header, _)| header)));
            }
            if block.len() < BLOCK || bytes.len() > MOST_HEADER_BYTES {
                return Ok(Some(Err(format!("a header of {} bytes has no END", bytes.len()))));
            }
        }
    }

    /// Sizes of the axes.
    ///
    /// # Errors
    /// A keyword of an axis is missing or invalid.
    pub fn axes(&self) -> Result<Vec<usize>, String> {
        let count =
            self.count("NAXIS").filter(|n| *n <= 999).ok_or("NAXIS is missing or not a number from 0 to 999")?;
        let axis = |i: usize| {
            let key = format!("NAXIS{i}");
            self.count(&key).ok_or_else(|| format!("{key} is missing or not a whole number"))
        };
        (1..=count).map(axis).collect()
    }

    /// Length of the data of a unit, bytes, padding included.
    ///
    /// # Errors
    /// A keyword is missing or invalid, or the length overflows.
    pub fn data_bytes(&self) -> Result<usize, String> {
        let axes = self.axes()?;
        let bitpix = self.number("BITPIX").ok_or("BITPIX is missing or not a number")? as i64;
        let elements = axes.iter().try_fold(usize::from(!axes.is_empty()), |all, axis| all.checked_mul(*axis));
        elements
            .and_then(|n| n.checked_add(self.count("PCOUNT").unwrap_or(0)))
            .and_then(|n| n.checked_mul(self.count("GCOUNT").unwrap_or(1)))
            .and_then(|n| n.checked_mul(bitpix.unsigned_abs() as usize / 8))
            .and_then(|n| n.checked_next_multiple_of(BLOCK))
            .ok_or_else(|| format!("the axes {axes:?} are too large"))
    }
}

/// A card's value without its comment; for a string, the text between the quotes.
fn value_of(text: &str) -> String {
    let text = text.trim_start();
    let Some(string) = text.strip_prefix('\'') else {
        return text.split('/').next().unwrap_or_default().trim().to_owned();
    };
    // A quote inside a string is doubled.
    let mut value = String::new();
    let mut rest = string.chars().peekable();
    while let Some(c) = rest.next() {
        if c == '\'' && rest.next_if_eq(&'\'').is_none() {
            break;
        }
        value.push(c);
    }
    value.trim_end().to_owned()
}

//! Arguments that are numbers.

/// Parses a number argument and checks its range.
pub(super) fn within(text: &str, [least, most]: [f64; 2]) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if (least..=most).contains(&number) {
        Ok(number)
    } else {
        Err(format!("{text}: must be between {least} and {most}"))
    }
}

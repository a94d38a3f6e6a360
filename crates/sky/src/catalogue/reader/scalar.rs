//! Numbers of binary tables: big-endian, as in FITS and in the binary forms of VOTable.

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Logical,
    Byte,
    Short,
    Int,
    Long,
    Float,
    Double,
}

impl Scalar {
    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::Logical | Self::Byte => 1,
            Self::Short => 2,
            Self::Int | Self::Float => 4,
            Self::Long | Self::Double => 8,
        }
    }

    /// The integer in `bytes`; `None` if the type is not an integer, or if there are too few bytes.
    pub fn integer(self, bytes: &[u8]) -> Option<i64> {
        Some(match self {
            Self::Byte => i64::from(*bytes.first()?),
            Self::Short => i64::from(i16::from_be_bytes(*bytes.first_chunk()?)),
            Self::Int => i64::from(i32::from_be_bytes(*bytes.first_chunk()?)),
            Self::Long => i64::from_be_bytes(*bytes.first_chunk()?),
            Self::Logical | Self::Float | Self::Double => return None,
        })
    }

    /// The number in `bytes` as text that parses to the same number; empty if it has no value.
    pub fn text(self, bytes: &[u8]) -> String {
        let text = match self {
            Self::Logical => bytes.first().map(|byte| match byte {
                b'T' | b't' | b'1' => "true".to_owned(),
                b'F' | b'f' | b'0' => "false".to_owned(),
                _ => String::new(),
            }),
            // The shortest text of an f32 has the same digits as in the source.
            Self::Float => bytes.first_chunk().map(|bytes| f32::from_be_bytes(*bytes).to_string()),
            Self::Double => bytes.first_chunk().map(|bytes| f64::from_be_bytes(*bytes).to_string()),
            _ => self.integer(bytes).map(|value| value.to_string()),
        };
        text.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_value_as_text() {
        assert_eq!(Scalar::Float.text(&0.44_f32.to_be_bytes()), "0.44");
        assert_eq!(Scalar::Double.text(&101.287_155_33_f64.to_be_bytes()), "101.28715533");
        assert_eq!(Scalar::Long.text(&i64::MIN.to_be_bytes()), "-9223372036854775808");
        assert_eq!(Scalar::Short.text(&(-7_i16).to_be_bytes()), "-7");
        assert_eq!(Scalar::Byte.text(&[200]), "200");
        assert_eq!((Scalar::Logical.text(b"T"), Scalar::Logical.text(b"\0")), ("true".into(), String::new()));
        assert_eq!(Scalar::Int.text(&[1, 2]), "", "too few bytes");
    }
}

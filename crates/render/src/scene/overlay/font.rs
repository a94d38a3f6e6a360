//! The font of all text: Hack, with its licences (MIT and Bitstream Vera) in `LICENSE-FONT-HACK`.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId};

/// The font.
pub fn font() -> &'static FontRef<'static> {
    static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
        FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR)
            .unwrap_or_else(|error| panic!("cannot read the built-in font: {error}"))
    });
    &FONT
}

/// Returns the first character of a text that the font lacks.
pub fn missing_character(text: &str) -> Option<char> {
    text.chars().find(|character| character.is_control() || font().glyph_id(*character) == GlyphId(0))
}

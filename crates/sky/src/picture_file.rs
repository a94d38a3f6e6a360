//! Reader of PNG pictures with 8 bits per channel.

use std::{
    io::{BufRead, BufReader, Cursor, Seek},
    path::{Path, PathBuf},
};

use png::{BitDepth, ColorType, Transformations};

use crate::files;

/// Largest number of texels of a picture: 16384 by 8192.
pub const MOST_TEXELS: u64 = 1 << 27;

/// A picture, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureFile {
    /// Width and height.
    pub size: [u32; 2],
    /// Codes of red, green, blue and alpha; alpha is 255 if the file has none.
    pub rgba: Vec<[u8; 4]>,
    /// Whether the file has an alpha channel.
    pub has_alpha: bool,
}

/// Errors from reading a picture. `wanted` describes a valid picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is not a valid PNG.
    #[error("{}: {source}; {wanted}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// The decoder's error.
        source: png::DecodingError,
        /// Description of a valid picture.
        wanted: &'static str,
    },
    /// The PNG has an unsupported format.
    #[error("{}: {problem}; {wanted}, of at most {MOST_TEXELS} texels", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Its format.
        problem: String,
        /// Description of a valid picture.
        wanted: &'static str,
    },
}

impl PictureFile {
    /// Reads a PNG with 8 bits per channel: grey, RGB or palette, with or without alpha. `wanted` describes a valid
    /// picture, for messages.
    ///
    /// # Errors
    ///
    /// See [`PictureError`]; every message names the file.
    pub fn read(path: &Path, wanted: &'static str) -> Result<Self, PictureError> {
        let read = |source| PictureError::Read { path: path.to_owned(), source };
        Self::from_reader(path, BufReader::new(files::open_regular(path).map_err(read)?), wanted)
    }

    /// As [`read`](Self::read), for the content of a file. `path` is a name for messages.
    ///
    /// # Errors
    ///
    /// See [`PictureError`].
    pub fn decode(path: &Path, bytes: &[u8], wanted: &'static str) -> Result<Self, PictureError> {
        Self::from_reader(path, Cursor::new(bytes), wanted)
    }

    /// Width and height from the header of a PNG; `None` if the header cannot be read.
    pub fn size_of(bytes: &[u8]) -> Option<[u32; 2]> {
        let mut decoder = png::Decoder::new(Cursor::new(bytes));
        decoder.read_header_info().ok().map(|header| [header.width, header.height])
    }

    fn from_reader(path: &Path, source: impl BufRead + Seek, wanted: &'static str) -> Result<Self, PictureError> {
        let broken = |source| PictureError::Png { path: path.to_owned(), source, wanted };
        let kind = |problem: String| PictureError::Kind { path: path.to_owned(), problem, wanted };
        // The size is checked before anything is allocated.
        let mut decoder = png::Decoder::new(source);
        decoder.set_transformations(Transformations::EXPAND);
        let header = decoder.read_header_info().map_err(broken)?;
        let size = [header.width, header.height];
        if u64::from(size[0]) * u64::from(size[1]) > MOST_TEXELS {
            return Err(kind(format!("it has {} x {} texels", size[0], size[1])));
        }
        let mut reader = decoder.read_info().map_err(broken)?;
        // The decoder trusts the length of a palette, and panics if it is wrong.
        if let Some(palette) = &reader.info().palette
            && (palette.is_empty() || palette.len() % 3 != 0 || palette.len() > 3 * 256)
        {
            return Err(kind(format!(
                "its palette has {} bytes and must have 1 to 256 colours of 3 bytes",
                palette.len()
            )));
        }
        // Format of the texels.
        let (colour, depth) = reader.output_color_type();
        if depth != BitDepth::Eight {
            return Err(kind(format!("it has {} bits per channel", depth as u8)));
        }
        let (channels, has_alpha) = match colour {
            ColorType::Grayscale => (1, false),
            ColorType::GrayscaleAlpha => (2, true),
            ColorType::Rgb => (3, false),
            ColorType::Rgba => (4, true),
            ColorType::Indexed => return Err(kind("its palette was not expanded".to_owned())),
        };
        // Texels, expanded to four channels.
        let length = reader.output_buffer_size().ok_or_else(|| kind("it is too large".to_owned()))?;
        let mut bytes = vec![0; length];
        reader.next_frame(&mut bytes).map_err(broken)?;
        let colours = if has_alpha { channels - 1 } else { channels };
        let rgba = bytes.chunks_exact(channels).map(|texel| {
            let channel = |c: usize| texel[c.min(colours - 1)];
            [channel(0), channel(1), channel(2), if has_alpha { texel[channels - 1] } else { 255 }]
        });
        Ok(Self { size, rgba: rgba.collect(), has_alpha })
    }
}

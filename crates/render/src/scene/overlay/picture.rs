//! Pictures over display images: a PNG on a plane that is tangent to the sphere of directions.

use std::{path::Path, sync::Arc};

use crate::{
    photometry::tone_map::{linear_from_srgb, srgb_from_linear},
    picture_file::{PictureError, PictureFile},
};

use super::Anchor;

/// Required format of the file.
const WANTED: &str = "a picture of the overlay is a PNG of 8 bits per channel, with or without alpha";

/// Maximum number of texels of all pictures together: 64 MiB on the adapter, and a third more for coarser levels.
pub const MOST_PICTURE_TEXELS: usize = 1 << 24;

/// A level of a picture: sRGB codes and alpha, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Width and height.
    pub size: [u32; 2],
    /// Width and height of the part that the picture fills, texels: the last column and row may be filled in part.
    pub extent: [f64; 2],
    /// Red, green, blue and alpha.
    pub rgba: Vec<[u8; 4]>,
}

/// A picture at its full size, at half of it, and so on.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureLevels {
    levels: Vec<Level>,
}

/// A picture in the sky.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Unique among pictures.
    pub name: String,
    /// Its texels.
    pub levels: Arc<PictureLevels>,
    /// The PNG file content, if a client has sent the picture.
    pub png: Option<Arc<[u8]>>,
    /// Direction of its middle.
    pub anchor: Anchor,
    /// Angle between the middles of its left and right edges, rad, below pi.
    pub width_rad: f64,
    /// Angle by which its top is turned to the left of the direction to the pole or the zenith, rad.
    pub roll_rad: f64,
    /// Opacity, which multiplies its alpha.
    pub opacity: f64,
}

impl PictureLevels {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a PNG, or has another format.
    pub fn from_png(path: &Path) -> Result<Self, PictureError> {
        let PictureFile { size, rgba, .. } = PictureFile::read(path, WANTED)?;
        Ok(Self::new(size, rgba))
    }

    /// Reads the content of a file; messages use `name` as its path.
    ///
    /// # Errors
    ///
    /// It is not a PNG, or has another format.
    pub fn from_png_bytes(name: &Path, bytes: &[u8]) -> Result<Self, PictureError> {
        let PictureFile { size, rgba, .. } = PictureFile::decode(name, bytes, WANTED)?;
        Ok(Self::new(size, rgba))
    }

    /// A picture with the given size, at least 1 by 1.
    pub fn new(size: [u32; 2], rgba: Vec<[u8; 4]>) -> Self {
        let mut levels = vec![Level { size, extent: size.map(f64::from), rgba }];
        while let Some(last) = levels.last().filter(|last| last.size[0] > 1 && last.size[1] > 1) {
            levels.push(last.halved());
        }
        Self { levels }
    }

    /// All levels, finest first.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Its own size, texels.
    pub fn size(&self) -> [u32; 2] {
        self.levels[0].size
    }
}

impl Level {
    /// Averages two by two texels, in linear light and weighted by alpha. Texels beyond an odd last row or column count as transparent.
    fn halved(&self) -> Self {
        let size = self.size.map(|side| side.div_ceil(2));
        let [width, height] = self.size;
        let of = |x: u32, y: u32| if x < width && y < height { self.rgba[(y * width + x) as usize] } else { [0; 4] };
        let texel = |index: u32| {
            let (x, y) = (2 * (index % size[0]), 2 * (index / size[0]));
            let (mut sums, mut alpha) = ([0.0; 3], 0.0);
            for [red, green, blue, opaque] in [of(x, y), of(x + 1, y), of(x, y + 1), of(x + 1, y + 1)] {
                let weight = f64::from(opaque) / 255.0;
                alpha += weight;
                for (sum, code) in sums.iter_mut().zip([red, green, blue]) {
                    *sum += weight * linear_from_srgb(f64::from(code) / 255.0);
                }
            }
            let code = |value: f64| (value * 255.0).round() as u8;
            let [red, green, blue] = sums.map(|sum| if alpha > 0.0 { code(srgb_from_linear(sum / alpha)) } else { 0 });
            [red, green, blue, code(alpha / 4.0)]
        };
        let extent = self.extent.map(|side| side / 2.0);
        Self { size, extent, rgba: (0..size[0] * size[1]).map(texel).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_keep_the_light_and_colour_of_opaque_texels() {
        let white = [255, 255, 255, 255];
        let red = [255, 0, 0, 255];
        let clear = [0, 255, 0, 0];
        let levels = PictureLevels::new([5, 2], vec![white, white, red, clear, red, white, white, clear, red, red]);
        let sizes: Vec<_> = levels.levels().iter().map(|level| level.size).collect();
        assert_eq!(sizes, [[5, 2], [3, 1]]);
        let half = &levels.levels()[1];
        assert_eq!((half.extent, &half.rgba[..]), ([2.5, 1.0], &[white, [255, 0, 0, 128], [255, 0, 0, 128]][..]));
        // The mean of a black and white checkerboard is half of the light, not half of the code.
        let black = [0, 0, 0, 255];
        let grey = PictureLevels::new([2, 2], vec![white, black, black, white]).levels()[1].rgba[0];
        assert_eq!(grey, [188, 188, 188, 255]);
    }
}

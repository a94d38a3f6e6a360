//! Textures of bodies: read from PNG files, sampled between texels.

use std::path::Path;

use glam::DVec3;

use crate::{
    photometry::tone_map::linear_from_srgb,
    picture_file::{PictureError, PictureFile},
};

/// Albedo factors of a body, in longitude and latitude: the left edge is longitude -180 degrees, the middle is the body's +x axis, the top is its +z
/// axis; longitude increases to the right, towards +y. Longitude and latitude are those of the point on the unit sphere that corresponds to the
/// surface point. The factors are interpolated bilinearly between texel centres, including across the left and right edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Linear factors of red, green and blue, 0 to 1, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
}

/// Required format of a texture file.
const WANTED: &str = "a texture is a PNG of 8 bits per channel, grey or RGB";

impl Texture {
    /// Reads a PNG of 8 bits per channel: grey, RGB or palette; an alpha channel is refused. The values are decoded
    /// from sRGB (IEC 61966-2-1) to linear factors.
    ///
    /// # Errors
    ///
    /// See [`PictureError`]; every message names the file.
    pub fn from_png(path: &Path) -> Result<Self, PictureError> {
        let PictureFile { size, rgba, has_alpha } = PictureFile::read(path, WANTED)?;
        if has_alpha {
            let problem = "it has an alpha channel".to_owned();
            return Err(PictureError::Kind { path: path.to_owned(), problem, wanted: WANTED });
        }
        let linear: Vec<f32> = (0..=255).map(|value| linear_from_srgb(f64::from(value) / 255.0) as f32).collect();
        let factors = rgba.iter().map(|texel| [0, 1, 2].map(|c| linear[usize::from(texel[c])]));
        Ok(Self { size, rgb: factors.collect() })
    }

    /// Factors at a point of the unit sphere that corresponds to the surface point.
    pub fn sample(&self, unit: DVec3) -> [f64; 3] {
        let [width, height] = self.size.map(f64::from);
        let longitude = unit.y.atan2(unit.x);
        let latitude = unit.z.atan2(unit.x.hypot(unit.y));
        let x = (longitude / std::f64::consts::TAU + 0.5) * width - 0.5;
        let y = ((0.5 - latitude / std::f64::consts::PI) * height - 0.5).clamp(0.0, height - 1.0);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, low_share) = (x - left, y - top);
        let column = |step: f64| (left + step).rem_euclid(width) as usize;
        let row = |step: f64| ((top + step) as usize).min(self.size[1] as usize - 1);
        let texel = |i: f64, j: f64| self.rgb[row(j) * self.size[0] as usize + column(i)].map(f64::from);
        let corners = [texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0)];
        [0, 1, 2].map(|c| {
            let upper = corners[0][c] + (corners[1][c] - corners[0][c]) * right_share;
            let lower = corners[2][c] + (corners[3][c] - corners[2][c]) * right_share;
            upper + (lower - upper) * low_share
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use png::{BitDepth, ColorType};

    use super::*;

    fn written(size: [u32; 2], colour: ColorType, depth: BitDepth, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.png");
        let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), size[0], size[1]);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        (folder, path)
    }

    #[test]
    fn values_are_decoded_from_srgb_and_mapped_to_longitude_and_latitude() {
        let bytes: Vec<u8> = (0..8u8).flat_map(|i| [i * 30, 128, 255]).collect();
        let (_folder, path) = written([4, 2], ColorType::Rgb, BitDepth::Eight, &bytes);
        let texture = Texture::from_png(&path).unwrap();
        assert_eq!(texture.size, [4, 2]);
        let [_, green, blue] = texture.rgb[5];
        assert!((f64::from(green) - 0.215_860_5).abs() < 1e-6 && blue == 1.0, "{green} {blue}");
        let red_at = |longitude_deg: f64, latitude_deg: f64| {
            let (lon, lat) = (longitude_deg.to_radians(), latitude_deg.to_radians());
            texture.sample(DVec3::new(lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin()))[0]
        };
        let texel = |index: usize| f64::from(texture.rgb[index][0]);
        // Sample at texel centres, halfway between two, across the edge, and beyond the last row.
        assert!((red_at(-135.0, 45.0) - texel(0)).abs() < 1e-12);
        assert!((red_at(45.0, 45.0) - texel(2)).abs() < 1e-12);
        assert!((red_at(45.0, -45.0) - texel(6)).abs() < 1e-12);
        assert!((red_at(0.0, 45.0) - (texel(1) + texel(2)) / 2.0).abs() < 1e-12);
        assert!((red_at(180.0, 45.0) - (texel(3) + texel(0)) / 2.0).abs() < 1e-12);
        assert!((red_at(45.0, 0.0) - (texel(2) + texel(6)) / 2.0).abs() < 1e-12);
        assert!((red_at(45.0, 80.0) - texel(2)).abs() < 1e-12);
        assert!((red_at(45.0, 45.0) - red_at(-45.0, 45.0)).abs() > 1e-3, "a mirrored map is detected");
    }

    #[test]
    fn palettes_have_whole_colours_and_at_most_256() {
        let read = |palette: usize| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("map.png");
            let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 4, 1);
            encoder.set_color(ColorType::Indexed);
            encoder.set_palette(vec![255; palette]);
            encoder.write_header().unwrap().write_image_data(&[0; 4]).unwrap();
            Texture::from_png(&path).map_err(|error| error.to_string())
        };
        assert_eq!(read(3).unwrap().rgb, [[1.0; 3]; 4]);
        assert!(read(768).is_ok());
        let message = read(50).unwrap_err();
        assert!(message.contains("its palette has 50 bytes"), "{message}");
        // The decoder itself refuses some of these.
        assert!([1, 769, 771].into_iter().all(|wrong| read(wrong).is_err()));
    }

    #[test]
    fn grey_is_grey_and_other_files_are_refused_by_name() {
        let (_folder, path) = written([2, 1], ColorType::Grayscale, BitDepth::Eight, &[0, 255]);
        assert_eq!(Texture::from_png(&path).unwrap().rgb, [[0.0; 3], [1.0; 3]]);
        let (_deep_folder, deep) = written([1, 1], ColorType::Grayscale, BitDepth::Sixteen, &[0, 255]);
        let (_alpha_folder, alpha) = written([1, 1], ColorType::Rgba, BitDepth::Eight, &[0, 255, 3, 4]);
        let text_folder = tempfile::tempdir().unwrap();
        let text = text_folder.path().join("map.png");
        std::fs::write(&text, "no picture").unwrap();
        for (file, part) in [
            (&deep, "16 bits per channel"),
            (&alpha, "alpha"),
            (&text, "a texture is a PNG"),
            (&text_folder.path().join("none.png"), "cannot read"),
        ] {
            let message = Texture::from_png(file).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains(&file.display().to_string()), "{message}");
        }
    }
}

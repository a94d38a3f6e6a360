//! A panorama of the landscape around an observer: an equirectangular picture with alpha, which hides the sky.
//!
//! The picture spans all azimuths, increasing to the right, and all altitudes, with the zenith at the top. Its colour
//! is the reflectance of the surface (sRGB codes; white reflects everything), so its brightness follows the light that
//! falls on it: dark at night, red at sunset. Alpha is the fraction of the sky that is hidden. A pyramid of halved
//! pictures avoids aliasing of fine twigs in coarse pixels.

use std::{f64::consts::PI, path::Path};

use glam::{DVec2, DVec3};

use super::surroundings::{HORIZON_STEPS, Horizon, azimuth};
use crate::{
    photometry::tone_map::linear_from_srgb,
    picture_file::{PictureError, PictureFile},
};

/// Required format of a landscape file.
const WANTED: &str =
    "a landscape is a PNG of 8 bits per channel with alpha, twice as wide as high: all azimuths and all altitudes";
/// Wider pictures are halved, so that every GPU can hold them.
const MOST_WIDTH: u32 = 4096;
/// Smallest height of a picture.
const LEAST_HEIGHT: u32 = 4;

/// One level of the pyramid.
#[derive(Clone, Debug, PartialEq)]
struct Level {
    size: [u32; 2],
    /// Reflectance of red, green and blue times alpha, and alpha, row by row from the zenith.
    texels: Vec<[f32; 4]>,
}

/// The panorama.
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
    /// Finest level first.
    levels: Vec<Level>,
    /// Azimuth of the middle of the picture, rad.
    middle_rad: f64,
    /// See [`Self::highest_rad`].
    highest_rad: f64,
}

impl Landscape {
    /// Reads a picture whose middle has the given azimuth, rad.
    ///
    /// # Errors
    ///
    /// The file cannot be read, has another format, or hides nothing or everything.
    pub fn from_png(path: &Path, middle_rad: f64) -> Result<Self, PictureError> {
        let PictureFile { size, rgba, has_alpha } = PictureFile::read(path, WANTED)?;
        let refused = |problem: String| Err(PictureError::Kind { path: path.to_owned(), problem, wanted: WANTED });
        let [width, height] = size;
        if width != 2 * height || height < LEAST_HEIGHT {
            return refused(format!("it has {width} x {height} texels"));
        }
        if !has_alpha {
            return refused("it has no alpha channel".to_owned());
        }
        if [0, 255].iter().any(|all| rgba.iter().all(|texel| texel[3] == *all)) {
            return refused("its alpha is the same everywhere: it hides nothing, or the whole sky".to_owned());
        }
        let linear: Vec<f32> = (0..=255).map(|code| linear_from_srgb(f64::from(code) / 255.0) as f32).collect();
        let texel = |rgba: &[u8; 4]| {
            let alpha = f32::from(rgba[3]) / 255.0;
            let [r, g, b] = [0, 1, 2].map(|c| alpha * linear[usize::from(rgba[c])]);
            [r, g, b, alpha]
        };
        Ok(Self::new(size, rgba.iter().map(texel).collect(), middle_rad))
    }

    /// A picture with the given size, at least 2 by 1: reflectance times alpha, and alpha.
    pub fn new(size: [u32; 2], texels: Vec<[f32; 4]>, middle_rad: f64) -> Self {
        let mut level = Level { size, texels };
        while level.size[0] > MOST_WIDTH {
            level = level.halved();
        }
        let [width, height] = level.size;
        let hides = |row: &[[f32; 4]]| row.iter().any(|texel| texel[3] > 0.0);
        let first = level.texels.chunks(width as usize).position(hides).unwrap_or(height as usize);
        // Light is interpolated between texels.
        let highest_rad = (0.5 - (first as f64 - 1.0) / f64::from(height)) * PI;
        let mut levels = vec![level];
        while let Some(last) = levels.last().filter(|last| last.size[1] > 1 && last.size[0] > 1) {
            levels.push(last.halved());
        }
        Self { levels, middle_rad, highest_rad: highest_rad.min(0.5 * PI) }
    }

    /// Size of the finest level.
    pub fn size(&self) -> [u32; 2] {
        self.levels[0].size
    }

    /// Azimuth of the middle of the picture, rad.
    pub fn middle_rad(&self) -> f64 {
        self.middle_rad
    }

    /// Altitude above which it hides nothing, rad.
    pub fn highest_rad(&self) -> f64 {
        self.highest_rad
    }

    /// All levels, finest first: reflectance of red, green and blue times alpha, and alpha, with 8 bits each; the three
    /// colours are stored as square roots.
    pub fn words(&self) -> Vec<u32> {
        let code = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u32;
        let word =
            |[r, g, b, a]: &[f32; 4]| code(r.sqrt()) | code(g.sqrt()) << 8 | code(b.sqrt()) << 16 | code(*a) << 24;
        self.levels.iter().flat_map(|level| level.texels.iter().map(word)).collect()
    }

    /// Reflectance times alpha, and alpha, towards a unit vector (east, up, south), bilinear in the finest level.
    pub fn sample(&self, local: DVec3) -> [f64; 4] {
        let Level { size: [width, height], texels } = &self.levels[0];
        let across = (azimuth(local) - self.middle_rad) / (2.0 * PI) + 0.5;
        let down = 0.5 - local.y.clamp(-1.0, 1.0).asin() / PI;
        let place = DVec2::new(across * f64::from(*width), down * f64::from(*height)) - 0.5;
        let low = place.floor();
        let share = place - low;
        let texel = |x: f64, y: f64| {
            let column = x.rem_euclid(f64::from(*width)) as usize;
            let row = y.clamp(0.0, f64::from(*height) - 1.0) as usize;
            texels[row * *width as usize + column].map(f64::from)
        };
        let [a, b] = [texel(low.x, low.y), texel(low.x + 1.0, low.y)];
        let [c, d] = [texel(low.x, low.y + 1.0), texel(low.x + 1.0, low.y + 1.0)];
        [0, 1, 2, 3].map(|i| {
            let (upper, lower) = (a[i] + (b[i] - a[i]) * share.x, c[i] + (d[i] - c[i]) * share.x);
            upper + (lower - upper) * share.y
        })
    }

    /// Returns the altitude below which the picture hides more than half of the sky. Objects below that altitude cause no glare and have no labels.
    pub fn horizon(&self) -> Horizon {
        let rows = self.levels[0].size[1] * 4;
        let altitude = |row: u32| PI * (0.5 - (f64::from(row) + 0.5) / f64::from(rows));
        let points = (0..HORIZON_STEPS).map(|step| {
            let azimuth_rad = step as f64 / HORIZON_STEPS as f64 * 2.0 * PI;
            let (sin, cos) = azimuth_rad.sin_cos();
            let hides = |row: &u32| {
                let (up, flat) = altitude(*row).sin_cos();
                self.sample(DVec3::new(flat * sin, up, -flat * cos))[3] >= 0.5
            };
            [azimuth_rad, (0..rows).find(hides).map_or(-0.5 * PI, altitude)]
        });
        Horizon::new(points.collect())
    }
}

impl Level {
    /// Halves width and height; an odd last row or column is merged with the one before.
    fn halved(&self) -> Self {
        let [width, height] = self.size.map(|side| side as usize);
        let half = [(width / 2).max(1), (height / 2).max(1)];
        let mut texels = Vec::with_capacity(half[0] * half[1]);
        for y in 0..half[1] {
            for x in 0..half[0] {
                let mut sum = [0.0; 4];
                let mut count = 0.0;
                for row in y * height / half[1]..(y + 1) * height / half[1] {
                    for column in x * width / half[0]..(x + 1) * width / half[0] {
                        let texel = self.texels[row * width + column];
                        sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value);
                        count += 1.0;
                    }
                }
                texels.push(sum.map(|value| value / count));
            }
        }
        Self { size: half.map(|side| side as u32), texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall up to 30 degrees in the eastern half, ground below the horizon elsewhere; red where opaque.
    fn wall(middle_rad: f64) -> Landscape {
        let size = [360, 180];
        let texels = (0..size[1]).flat_map(|row| {
            (0..size[0]).map(move |column| {
                let altitude_deg = 89.5 - f64::from(row);
                let is_east = column >= 180;
                let hides = altitude_deg < if is_east { 30.0 } else { 0.0 };
                if hides { [0.5, 0.25, 0.0, 1.0] } else { [0.0; 4] }
            })
        });
        Landscape::new(size, texels.collect(), middle_rad)
    }

    fn towards(azimuth_deg: f64, altitude_deg: f64) -> DVec3 {
        let ((sin, cos), (up, flat)) = (azimuth_deg.to_radians().sin_cos(), altitude_deg.to_radians().sin_cos());
        DVec3::new(flat * sin, up, -flat * cos)
    }

    #[test]
    fn a_wall_appears_at_its_azimuth() {
        // The middle looks north, so the right half is the east.
        let landscape = wall(0.0);
        for (azimuth_deg, altitude_deg, hidden) in
            [(90.0, 29.0, 1.0), (90.0, 31.0, 0.0), (270.0, -1.0, 1.0), (270.0, 1.0, 0.0), (0.0, -90.0, 1.0)]
        {
            let found = landscape.sample(towards(azimuth_deg, altitude_deg));
            assert_eq!(found[3], hidden, "{azimuth_deg} {altitude_deg}");
            assert_eq!(found[0], 0.5 * hidden);
        }
        // A rotated picture has its wall elsewhere.
        assert_eq!(wall(PI).sample(towards(90.0, 29.0))[3], 0.0);
        let horizon = landscape.horizon();
        assert!((horizon.altitude_rad(1.5).to_degrees() - 30.0).abs() < 0.3, "{}", horizon.altitude_rad(1.5));
        assert!(horizon.altitude_rad(4.5).to_degrees().abs() < 0.3);
    }

    #[test]
    fn levels_keep_the_mean_and_large_pictures_are_halved() {
        let landscape = wall(0.0);
        let mean = |level: &Level| {
            level.texels.iter().map(|texel| f64::from(texel[3])).sum::<f64>() / level.texels.len() as f64
        };
        // Halving a picture with odd sides counts some texels twice.
        for level in landscape.levels.iter().filter(|level| level.size[1] >= 20) {
            assert!((mean(level) - mean(&landscape.levels[0])).abs() < 0.03, "{:?}", level.size);
        }
        assert_eq!(landscape.words().len(), landscape.levels.iter().map(|level| level.texels.len()).sum::<usize>());
        let wide = Landscape::new([16384, 2], vec![[0.0, 0.0, 0.0, 0.5]; 32768], 0.0);
        assert_eq!(wide.size(), [4096, 1]);
    }

    #[test]
    fn invalid_landscapes_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hills.png");
        let written = |size: [u32; 2], colour: png::ColorType, bytes: &[u8]| {
            let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), size[0], size[1]);
            encoder.set_color(colour);
            encoder.write_header().unwrap().write_image_data(bytes).unwrap();
            Landscape::from_png(&path, 0.0).map_err(|error| error.to_string())
        };
        let half: Vec<u8> = (0..32).flat_map(|i| [0, 188, 255, if i < 16 { 0 } else { 255 }]).collect();
        let found = written([8, 4], png::ColorType::Rgba, &half).unwrap();
        let below = found.sample(towards(10.0, -60.0));
        assert!((below[1] - 0.5029).abs() < 1e-3 && below[0] == 0.0 && below[3] == 1.0, "{below:?}");
        for (size, colour, bytes, part) in [
            ([8, 8], png::ColorType::Rgba, vec![9; 256], "8 x 8 texels"),
            ([8, 4], png::ColorType::Rgb, vec![9; 96], "no alpha"),
            ([8, 4], png::ColorType::Rgba, vec![255; 128], "the whole sky"),
        ] {
            let message = written(size, colour, &bytes).unwrap_err();
            assert!(message.contains(part) && message.contains("hills.png"), "{message}");
        }
    }
}

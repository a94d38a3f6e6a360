//! The image that metrics measure: pixels of luminance together with the mapping that placed them.

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::error::MetricError;
use crate::{
    photometry::rec709::luminance,
    view::projection::{PlaneMapping, pixel_centre},
};

/// Pixels of an HDR image, linear Rec. 709 in cd/m^2, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// From a rendered frame: R, G, B and a fourth channel that is ignored.
    Rgba32(&'a [[f32; 4]]),
    /// From the f64 renderer.
    Rgb64(&'a [[f64; 3]]),
}

impl Pixels<'_> {
    fn len(&self) -> usize {
        match self {
            Pixels::Rgba32(pixels) => pixels.len(),
            Pixels::Rgb64(pixels) => pixels.len(),
        }
    }

    fn rgb(&self, index: usize) -> [f64; 3] {
        match self {
            Pixels::Rgba32(pixels) => {
                let [r, g, b, _] = pixels[index];
                [r, g, b].map(f64::from)
            }
            Pixels::Rgb64(pixels) => pixels[index],
        }
    }
}

impl<'a> From<&'a [[f32; 4]]> for Pixels<'a> {
    fn from(pixels: &'a [[f32; 4]]) -> Self {
        Pixels::Rgba32(pixels)
    }
}

impl<'a> From<&'a Vec<[f32; 4]>> for Pixels<'a> {
    fn from(pixels: &'a Vec<[f32; 4]>) -> Self {
        Pixels::Rgba32(pixels)
    }
}

impl<'a> From<&'a [[f64; 3]]> for Pixels<'a> {
    fn from(pixels: &'a [[f64; 3]]) -> Self {
        Pixels::Rgb64(pixels)
    }
}

impl<'a> From<&'a Vec<[f64; 3]>> for Pixels<'a> {
    fn from(pixels: &'a Vec<[f64; 3]>) -> Self {
        Pixels::Rgb64(pixels)
    }
}

/// One image to be measured. All pixels are finite, and no luminance is negative.
#[derive(Clone, Copy)]
pub struct HdrView<'a> {
    mapping: &'a dyn PlaneMapping,
    pixels: Pixels<'a>,
    camera_from_view: DQuat,
}

impl<'a> HdrView<'a> {
    /// Creates the image of `mapping` with these `pixels` (cd/m^2).
    ///
    /// # Errors
    /// [`MetricError::PixelCount`] if the pixels do not fill the picture, [`MetricError::NotLight`] for the first pixel with a
    /// channel that is not finite or with a negative luminance.
    pub fn new(mapping: &'a dyn PlaneMapping, pixels: impl Into<Pixels<'a>>) -> Result<Self, MetricError> {
        let pixels = pixels.into();
        let [width, height] = mapping.size();
        if pixels.len() != width as usize * height as usize {
            return Err(MetricError::PixelCount { pixels: pixels.len(), width, height });
        }
        let is_light = |index: usize| {
            let rgb = pixels.rgb(index);
            rgb.iter().all(|channel| channel.is_finite()) && luminance(rgb) >= 0.0
        };
        if let Some(index) = (0..pixels.len()).into_par_iter().find_first(|index| !is_light(*index)) {
            let (x, y) = (index % width as usize, index / width as usize);
            return Err(MetricError::NotLight { x: x as u32, y: y as u32 });
        }
        Ok(Self { mapping, pixels, camera_from_view: DQuat::IDENTITY })
    }

    /// Returns the same image, rotated: `camera_from_view` rotates the directions of its mapping into the axes in which several images of one view
    /// (the faces of a cubemap) are measured together.
    pub fn turned(self, camera_from_view: DQuat) -> Self {
        Self { camera_from_view, ..self }
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.mapping.size()
    }

    /// Returns the mapping between directions and pixels of this image.
    pub fn mapping(&self) -> &'a dyn PlaneMapping {
        self.mapping
    }

    /// Returns the colour of a pixel of the image, cd/m^2. Panics outside of the image, as slices do.
    pub fn rgb_cd_m2(&self, x: u32, y: u32) -> [f64; 3] {
        let [width, height] = self.size();
        assert!(x < width && y < height, "pixel ({x}, {y}) of an image of {width} x {height}");
        self.pixels.rgb(y as usize * width as usize + x as usize)
    }

    /// Returns the luminance of a pixel of the image, cd/m^2. Panics outside of the image, as slices do.
    pub fn luminance_cd_m2(&self, x: u32, y: u32) -> f64 {
        luminance(self.rgb_cd_m2(x, y))
    }

    /// Returns the illuminance that reaches the eye from a pixel: its luminance times its solid angle in f64, lx.
    ///
    /// # Errors
    /// [`MetricError::OutsidePicture`] if the pixel is lit and has no solid angle.
    pub fn illuminance_lx(&self, x: u32, y: u32) -> Result<f64, MetricError> {
        let luminance = self.luminance_cd_m2(x, y);
        if luminance == 0.0 {
            return Ok(0.0);
        }
        let omega = self.mapping.solid_angle_sr(x, y);
        if omega > 0.0 { Ok(luminance * omega) } else { Err(MetricError::OutsidePicture { x, y }) }
    }

    /// Returns the direction of a pixel's centre after [`HdrView::turned`]; `None` outside of the picture.
    pub(super) fn direction(&self, x: u32, y: u32) -> Option<DVec3> {
        Some(self.camera_from_view * self.mapping.direction_from_pixel(pixel_centre(x, y))?)
    }

    /// Returns the continuous pixel coordinates of a direction after [`HdrView::turned`]; `None` if it has no image.
    pub(super) fn pixel(&self, direction: DVec3) -> Option<DVec2> {
        self.mapping.pixel_from_direction(self.camera_from_view.conjugate() * direction)
    }

    /// Returns the lit pixels whose centres lie within `radius_px` of `centre`, each as its centre and its light in lx.
    pub(super) fn lit_near_pixel(&self, centre: DVec2, radius_px: f64) -> Result<Vec<(DVec2, f64)>, MetricError> {
        // Pixels whose centres lie between the edges of the window, clipped to the image.
        let range = |centre: f64, side: u32| {
            let first = (centre - radius_px - 0.5).ceil().max(0.0) as u32;
            let end = ((centre + radius_px + 0.5).floor().max(0.0) as u32).min(side);
            first..end
        };
        let [width, height] = self.size();
        let mut lit = Vec::new();
        for y in range(centre.y, height) {
            for x in range(centre.x, width) {
                let position = pixel_centre(x, y);
                if (position - centre).length() <= radius_px && self.luminance_cd_m2(x, y) > 0.0 {
                    lit.push((position, self.illuminance_lx(x, y)?));
                }
            }
        }
        Ok(lit)
    }

    /// Returns the lit pixels whose centres lie within `radius_rad` of `direction`, each as its direction and its light in lx.
    pub(super) fn lit_near_direction(
        &self,
        direction: DVec3,
        radius_rad: f64,
    ) -> Result<Vec<(DVec3, f64)>, MetricError> {
        let [width, height] = self.size();
        let mut lit = Vec::new();
        for y in 0..height {
            for x in 0..width {
                if self.luminance_cd_m2(x, y) == 0.0 {
                    continue;
                }
                let pixel_direction = self.direction(x, y).ok_or(MetricError::OutsidePicture { x, y })?;
                if separation_rad(pixel_direction, direction) <= radius_rad {
                    lit.push((pixel_direction, self.illuminance_lx(x, y)?));
                }
            }
        }
        Ok(lit)
    }
}

/// Returns the angle between two vectors, rad. It is accurate even near 0 and pi.
pub(super) fn separation_rad(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Returns the lit pixels of several images within `radius_rad` of `direction`, each as its direction and its light in lx.
pub(super) fn lit_near_direction(
    images: &[HdrView<'_>],
    direction: DVec3,
    radius_rad: f64,
) -> Result<Vec<(DVec3, f64)>, MetricError> {
    let mut lit = Vec::new();
    for image in images {
        lit.extend(image.lit_near_direction(direction, radius_rad)?);
    }
    Ok(lit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::projection::{Fisheye, FisheyeMapping, Perspective};

    #[test]
    fn invalid_light_is_refused_with_its_pixel() {
        let mapping = Perspective::symmetric([4, 3], 1.0).unwrap();
        for (wrong, fine) in [
            ([f32::NAN, 1.0, 1.0, 0.0], false),
            ([1.0, 1.0, f32::INFINITY, 0.0], false),
            ([0.0, -1.0, 0.0, 0.0], false),
            // A colour outside the gamut, and a fourth channel that is ignored.
            ([-0.1, 1.0, 0.0, f32::NAN], true),
        ] {
            let mut pixels = vec![[1.0_f32; 4]; 12];
            pixels[6] = wrong;
            let expected = (!fine).then_some(MetricError::NotLight { x: 2, y: 1 });
            assert_eq!(HdrView::new(&mapping, &pixels).err(), expected, "{wrong:?}");
        }
        let short = vec![[0.0_f64; 3]; 11];
        let found = HdrView::new(&mapping, &short).err();
        assert_eq!(found, Some(MetricError::PixelCount { pixels: 11, width: 4, height: 3 }));
    }

    #[test]
    fn light_outside_of_a_round_picture_is_found() {
        let mapping = Fisheye::new([16, 16], FisheyeMapping::Equisolid, 2.0).unwrap();
        let mut pixels = vec![[0.0_f64; 3]; 256];
        pixels[0] = [1.0; 3];
        let image = HdrView::new(&mapping, &pixels).unwrap();
        let outside = Some(MetricError::OutsidePicture { x: 0, y: 0 });
        assert_eq!(image.illuminance_lx(0, 0).err(), outside);
        assert_eq!(image.lit_near_direction(DVec3::NEG_Z, 0.1).err(), outside);
        assert_eq!(image.illuminance_lx(8, 8), Ok(0.0));
    }

    #[test]
    fn a_window_holds_the_pixel_centres_within_its_radius_and_stops_at_the_border() {
        let mapping = Perspective::symmetric([8, 8], 1.0).unwrap();
        let pixels = vec![[1.0_f64; 3]; 64];
        let image = HdrView::new(&mapping, &pixels).unwrap();
        let count = |x: f64, y: f64, radius: f64| image.lit_near_pixel(DVec2::new(x, y), radius).unwrap().len();
        assert_eq!(count(4.5, 4.5, 0.4), 1);
        assert_eq!(count(4.5, 4.5, 1.0), 5);
        assert_eq!(count(4.0, 4.0, 1.0), 4);
        assert_eq!(count(0.5, 0.5, 1.0), 3);
        assert_eq!(count(-3.0, 4.0, 1.0), 0);
        assert_eq!(count(f64::NAN, 4.0, 1.0), 0);
        assert_eq!(count(4.0, 4.0, 100.0), 64);
    }
}

//! From a view's picture to the image sent to a projector. Steps, all in linear light: resampling (if the view is not
//! drawn directly in the projector's pixels), the share of light, the black level, and the projector's response.
//!
//! A display image arrives with 8 bits, after tone mapping. Light is multiplied by at most one. So the first rounding contributes at most half a code
//! to the result, and so does the second.

mod blend;
mod edges;
mod lut;
mod resampling;
mod response;

use rayon::prelude::*;

use self::{blend::blended, response::EightBits};
pub use self::{
    blend::{Blend, BlendError, DISPLAY_GAMMA, Weights},
    edges::{Beam, edge_blends},
    lut::{Lut, LutKind},
    resampling::Resampling,
    response::Response,
};
use crate::photometry::tone_map::light_of_codes;

/// Pixels per parallel chunk.
const CHUNK: usize = 4096;

/// Processing of a projector's picture.
#[derive(Clone, Debug)]
pub struct ProjectorOutput {
    size: [u32; 2],
    resampling: Option<Resampling>,
    blend: Option<Blend>,
    response: Response,
    eight_bits: EightBits,
}

impl PartialEq for ProjectorOutput {
    /// The table of codes is determined by the other fields.
    fn eq(&self, other: &Self) -> bool {
        (self.size, &self.resampling, &self.blend, &self.response)
            == (other.size, &other.resampling, &other.blend, &other.response)
    }
}

impl ProjectorOutput {
    /// Output for a raster of `size` pixels.
    ///
    /// # Errors
    ///
    /// The blend or the resampling has another size, or the gamma is not above 0.
    pub fn new(
        size: [u32; 2],
        resampling: Option<Resampling>,
        blend: Option<Blend>,
        response: Response,
    ) -> Result<Self, String> {
        for (what, other) in
            [("blend", blend.as_ref().map(Blend::size)), ("resampling", resampling.as_ref().map(Resampling::size))]
        {
            if let Some(other) = other.filter(|other| *other != size) {
                return Err(format!("a {what} of {other:?} pixels does not fit a raster of {size:?}"));
            }
        }
        if let Some(gamma) = response.gamma.filter(|gamma| !(gamma.is_finite() && *gamma > 0.0)) {
            return Err(format!("gamma = {gamma}: must be a number above 0"));
        }
        let eight_bits = EightBits::new(&response);
        Ok(Self { size, resampling, blend, response, eight_bits })
    }

    /// Width and height of the raster, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The resampling; `None` if the view is drawn directly in the projector's pixels.
    pub fn resampling(&self) -> Option<&Resampling> {
        self.resampling.as_ref()
    }

    /// The blend; `None` if the projector shows all of the light.
    pub fn blend(&self) -> Option<&Blend> {
        self.blend.as_ref()
    }

    /// The same output with another blend.
    ///
    /// # Errors
    ///
    /// The blend has another size.
    pub fn with_blend(&self, blend: Option<Blend>) -> Result<Self, String> {
        Self::new(self.size, self.resampling.clone(), blend, self.response.clone())
    }

    /// HDR pixels of the raster (R, G, B in cd/m^2, solid angle in sr) from those of the picture, without blending.
    pub fn hdr(&self, picture: Vec<[f32; 4]>) -> Vec<[f32; 4]> {
        match &self.resampling {
            Some(resampling) => resampling.hdr(&picture),
            None => picture,
        }
    }

    /// The display image of the raster (R, G, B, A with 8 bits) from that of the picture, which is encoded as sRGB.
    pub fn display(&self, picture: Vec<u8>) -> Vec<u8> {
        let pixels = self.size.map(|side| side as usize).iter().product::<usize>();
        if self.resampling.is_none() && self.blend.is_none() && self.response == Response::default() {
            return picture;
        }
        let light = light_of_codes();
        if let (None, None, Some(factors)) =
            (&self.resampling, &self.response.lut, self.blend.as_ref().and_then(Blend::code_factors_alone))
        {
            let codes: [f32; 256] =
                std::array::from_fn(|code| (255.0 * self.response.code(f64::from(light[code]))) as f32);
            return scaled(picture, factors, &codes);
        }
        let mut display = vec![u8::MAX; 4 * pixels];
        display.par_chunks_mut(4 * CHUNK).enumerate().for_each(|(chunk, codes)| {
            for (offset, codes) in codes.chunks_exact_mut(4).enumerate() {
                let pixel = chunk * CHUNK + offset;
                let rgb = match &self.resampling {
                    Some(resampling) => resampling.light(&picture, pixel),
                    None => {
                        codes[3] = picture[4 * pixel + 3];
                        [0, 1, 2].map(|c| light[usize::from(picture[4 * pixel + c])])
                    }
                };
                let displayed = self.displayed(pixel, rgb);
                match &self.response.lut {
                    None => {
                        for (code, light) in codes.iter_mut().zip(displayed) {
                            *code = self.eight_bits.code(light);
                        }
                    }
                    Some(_) => {
                        for (code, exact) in codes.iter_mut().zip(self.response.codes(displayed.map(f64::from))) {
                            *code = (255.0 * exact).round() as u8;
                        }
                    }
                }
            }
        });
        display
    }

    /// The light that a pixel displays, before the look-up table, in units of display white.
    fn displayed(&self, pixel: usize, light: [f32; 3]) -> [f32; 3] {
        let Some(blend) = &self.blend else { return light };
        let [alpha, beta] = blend.weights()[pixel];
        match blend.code_factor(pixel) {
            None => blended(light, [alpha, beta]),
            Some(1.0) => blended(light, [1.0, beta]),
            Some(factor) => {
                let multiplied =
                    |light: f32| self.response.light(self.response.code(f64::from(light)) * f64::from(factor)) as f32;
                blended(light.map(multiplied), [1.0, beta])
            }
        }
    }

    /// The codes, 0 to 1, of a pixel (index row by row from the top) that would display `light` without blending, in
    /// units of display white.
    pub fn codes(&self, pixel: usize, light: [f64; 3]) -> [f64; 3] {
        let light = light.map(|light| light.clamp(0.0, 1.0) as f32);
        self.response.codes(self.displayed(pixel, light).map(f64::from))
    }
}

/// Replaces the codes of each pixel of a picture by those of a table, multiplied by the pixel's factor.
fn scaled(mut picture: Vec<u8>, factors: &[f32], codes: &[f32; 256]) -> Vec<u8> {
    picture.par_chunks_mut(4 * CHUNK).zip(factors.par_chunks(CHUNK)).for_each(|(picture, factors)| {
        for (pixel, factor) in picture.chunks_exact_mut(4).zip(factors) {
            for code in &mut pixel[..3] {
                *code = (codes[usize::from(*code)] * factor).round() as u8;
            }
        }
    });
    picture
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;
    use crate::photometry::tone_map::linear_from_srgb;

    fn output(size: [u32; 2], weights: [f32; 2], response: Response) -> ProjectorOutput {
        let pixels = (size[0] * size[1]) as usize;
        let blend = Blend::from_weights(size, vec![weights; pixels]);
        ProjectorOutput::new(size, None, Some(blend), response).unwrap()
    }

    #[test]
    fn shares_apply_to_linear_light_and_codes_follow_the_projector_s_response() {
        for gamma in [None, Some(1.8), Some(2.4)] {
            let light_of = |code: f64| gamma.map_or_else(|| linear_from_srgb(code), |gamma: f64| code.powf(gamma));
            for [alpha, beta] in [[0.5, 0.0], [0.25, 0.02], [0.0, 0.0], [0.0, 0.1], [1.0, 0.05], [1.0, 0.0]] {
                let output = output([256, 1], [alpha, beta], Response { gamma, lut: None });
                let picture: Vec<u8> = (0..=255).flat_map(|code| [code, code, 255 - code, 77]).collect();
                let display = output.display(picture);
                for (code, pixel) in display.chunks_exact(4).enumerate() {
                    let light = |code: u8| linear_from_srgb(f64::from(code) / 255.0);
                    let share = |code: u8| light(code) * f64::from(alpha) * (1.0 - f64::from(beta)) + f64::from(beta);
                    for (found, from) in [(pixel[0], code as u8), (pixel[2], 255 - code as u8)] {
                        // The result may differ by half a code.
                        let [below, above] =
                            [-0.5, 0.5].map(|by| ((f64::from(found) + by) / 255.0).clamp(0.0, 1.0)).map(light_of);
                        let expected = share(from);
                        assert!(
                            below <= expected + 1e-6 && (expected <= above + 1e-6 || found == 255),
                            "{gamma:?} {from} {alpha} {beta}: {found}"
                        );
                        // The unrounded codes agree as well.
                        let exact = output.codes(code, [light(from); 3])[0];
                        assert!((light_of(exact) - expected).abs() < 1e-6, "{exact} {expected}");
                    }
                    assert_eq!(pixel[3], 77);
                }
            }
        }
    }

    #[test]
    fn masks_of_codes_multiply_codes_with_every_response() {
        let light = 0.5_f32.powf(DISPLAY_GAMMA as f32);
        for gamma in [None, Some(1.8), Some(2.2)] {
            let response = Response { gamma, lut: None };
            let codes_of = |blend: Blend| ProjectorOutput::new([256, 1], None, Some(blend), response.clone()).unwrap();
            let blend = |beta: f32| Blend::from_weights([256, 1], vec![[light, beta]; 256]);
            let picture: Vec<u8> = (0..=255).flat_map(|code| [code, code, code, 77]).collect();
            let [halved, lifted, of_light] = [blend(0.0).of_codes(), blend(1e-7).of_codes(), blend(0.0)].map(codes_of);
            let exact = |code: usize| 255.0 * response.code(linear_from_srgb(code as f64 / 255.0)) / 2.0;
            let differs = |display: &[u8], most: f64| {
                let codes = display.chunks_exact(4).enumerate();
                codes.filter(|(code, pixel)| (f64::from(pixel[0]) - exact(*code)).abs() > most).count()
            };
            assert_eq!(differs(&halved.display(picture.clone()), 0.501), 0, "{gamma:?}");
            // Check the same with a blend that also raises black.
            assert_eq!(differs(&lifted.display(picture.clone()), 0.6), 0, "{gamma:?}");
            assert!((halved.codes(9, [linear_from_srgb(0.5); 3])[1] * 255.0 - exact(127)).abs() < 0.5, "{gamma:?}");
            // Multiplying the light gives the same result only for a response with that gamma.
            let others = differs(&of_light.display(picture), 0.501);
            assert_eq!(others == 0, gamma == Some(DISPLAY_GAMMA), "{gamma:?}: {others}");
        }
        let white = Blend::from_weights([4, 1], vec![[1.0, 0.0]; 4]).of_codes();
        let output = ProjectorOutput::new([4, 1], None, Some(white.clone()), Response::default()).unwrap();
        let picture: Vec<u8> = (0..16).collect();
        assert_eq!(output.display(picture.clone()), picture);
        assert!((white.dimmed(0.25).code_factor(0).unwrap() - 0.25_f32.powf(1.0 / 2.2)).abs() < 1e-6);
    }

    #[test]
    fn the_look_up_table_comes_last() {
        let inverse = Lut {
            kind: LutKind::One,
            size: 2,
            domain: [[0.0; 3], [1.0; 3]],
            values: vec![[1.0, 0.5, 0.0], [0.0, 1.0, 1.0]],
        };
        let output = output([256, 1], [0.5, 0.0], Response { gamma: Some(2.0), lut: Some(inverse) });
        let picture: Vec<u8> = (0..=255).flat_map(|code| [code, code, code, 255]).collect();
        for (code, pixel) in output.display(picture).chunks_exact(4).enumerate() {
            let blended = (0.5 * linear_from_srgb(code as f64 / 255.0)).sqrt();
            let expected = [1.0 - blended, 0.5 + 0.5 * blended, blended].map(|code| 255.0 * code);
            for (found, expected) in pixel.iter().zip(expected) {
                assert!((f64::from(*found) - expected).abs() <= 0.501, "{code}: {found} {expected}");
            }
        }
    }

    #[test]
    fn mismatched_sizes_and_bad_gammas_are_refused() {
        let error_of = |size: [u32; 2], gamma| {
            let blend = Blend::from_weights([4, 4], vec![[1.0, 0.0]; 16]);
            ProjectorOutput::new(size, None, Some(blend), Response { gamma, lut: None }).unwrap_err()
        };
        assert!(error_of([4, 5], None).contains("a blend of [4, 4] pixels"));
        assert!(error_of([4, 4], Some(0.0)).contains("gamma = 0"));
        assert!(error_of([4, 4], Some(f64::NAN)).contains("gamma = NaN"));
    }
}

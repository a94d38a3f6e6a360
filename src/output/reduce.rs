//! Smaller copies of display images.

use crate::{
    photometry::tone_map::{light_of_codes, srgb_from_linear},
    render::FrameImage,
};

/// Returns a copy of the display image whose longest side has at most `longest_px` pixels. The size is divided by the smallest whole number that
/// suffices. Each pixel is the mean light of a square of pixels, of which fewer exist at the right and lower edges. Returns `None` if the image is
/// already small enough, or has no display image.
pub fn reduced(image: &FrameImage, longest_px: u32) -> Option<FrameImage> {
    let factor = image.width.max(image.height).div_ceil(longest_px.max(1));
    let pixels = image.display.as_deref().filter(|_| factor > 1)?;
    let [width, height] = [image.width, image.height].map(|side| side.div_ceil(factor));
    let light = light_of_codes();
    let mut display = Vec::with_capacity(4 * width as usize * height as usize);
    for top in (0..image.height).step_by(factor as usize) {
        for left in (0..image.width).step_by(factor as usize) {
            let (right, bottom) = ((left + factor).min(image.width), (top + factor).min(image.height));
            let (mut sum, mut alpha) = ([0.0_f32; 3], 0_u32);
            for y in top..bottom {
                let row = (y * image.width) as usize;
                for pixel in pixels[4 * (row + left as usize)..4 * (row + right as usize)].chunks_exact(4) {
                    for (sum, code) in sum.iter_mut().zip(pixel) {
                        *sum += light[usize::from(*code)];
                    }
                    alpha += u32::from(pixel[3]);
                }
            }
            let count = (right - left) * (bottom - top);
            let code = |light: f32| (255.0 * srgb_from_linear(f64::from(light / count as f32))).round() as u8;
            display.extend(sum.map(code));
            display.push((alpha / count) as u8);
        }
    }
    Some(FrameImage {
        view: image.view,
        part: image.part,
        width,
        height,
        display: Some(display),
        hdr: None,
        projector: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Part;

    fn image(width: u32, height: u32, code: impl Fn(u32, u32) -> u8) -> FrameImage {
        let pixel = |i: u32| [code(i % width, i / width), 0, 255, 255];
        let display = (0..width * height).flat_map(pixel).collect();
        FrameImage { view: 3, part: Part::Whole, width, height, display: Some(display), hdr: None, projector: None }
    }

    #[test]
    fn light_is_averaged_rather_than_codes() {
        let star = image(4, 4, |x, y| if (x, y) == (1, 1) { 255 } else { 0 });
        let small = reduced(&star, 2).expect("four pixels are more than two");
        assert_eq!((small.view, small.width, small.height), (3, 2, 2));
        // A quarter of full light is code 137, not 64.
        assert_eq!(small.display.expect("a display image")[..8], [137, 0, 255, 255, 0, 0, 255, 255]);
    }

    #[test]
    fn edge_pixels_average_existing_pixels_only() {
        let small = reduced(&image(7, 5, |_, _| 90), 3).expect("seven pixels are more than three");
        assert_eq!((small.width, small.height), (3, 2));
        assert!(small.display.expect("a display image").chunks_exact(4).all(|pixel| pixel == [90, 0, 255, 255]));
    }

    #[test]
    fn small_images_are_not_reduced() {
        assert!(reduced(&image(7, 5, |_, _| 1), 7).is_none());
    }
}

//! Packs the pictures of two eyes into one picture, as players of stereo films expect.

use crate::render::FrameImage;
use crate::view::{Packing, Part, Rig};

/// Joins two buffers with `row` elements per row; the second one is to the right or below.
fn joined<T: Copy>([left, right]: [&[T]; 2], row: usize, packing: Packing) -> Vec<T> {
    match packing {
        Packing::SideBySide => left
            .chunks(row)
            .zip(right.chunks(row))
            .flat_map(|(left, right)| left.iter().chain(right))
            .copied()
            .collect(),
        Packing::TopBottom | Packing::None => [left, right].concat(),
    }
}

/// For every view that requests packing, packs the pictures of both eyes into one image, which then is the whole view.
/// Both eyes belong to the same frame and have the same buffers.
pub fn pack(rig: &Rig, images: Vec<FrameImage>) -> Vec<FrameImage> {
    let mut packed: Vec<FrameImage> = Vec::with_capacity(images.len());
    for image in images {
        let packing = rig.views().get(image.view).map_or(Packing::None, |view| view.packing);
        let left = packed.last().is_some_and(|last| last.view == image.view && last.part == Part::LeftEye);
        let Some(left) = packed.pop_if(|_| packing != Packing::None && left && image.part == Part::RightEye) else {
            packed.push(image);
            continue;
        };
        let (width, height) = (left.width, left.height);
        let row = width as usize;
        let display = left.display.as_deref().zip(image.display.as_deref());
        let hdr = left.hdr.as_deref().zip(image.hdr.as_deref());
        packed.push(FrameImage {
            part: Part::Whole,
            width: if packing == Packing::SideBySide { 2 * width } else { width },
            height: if packing == Packing::SideBySide { height } else { 2 * height },
            display: display.map(|(left, right)| joined([left, right], 4 * row, packing)),
            hdr: hdr.map(|(left, right)| joined([left, right], row, packing)),
            ..image
        });
    }
    packed
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use glam::{DQuat, DVec3};

    use super::super::encode::tests::sample;
    use super::*;
    use crate::view::{View, ViewKind};

    #[test]
    fn left_eye_is_left_or_on_top_and_other_views_are_unchanged() {
        let view = |name: &str, kind| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
        let dome = ViewKind::StereoDome { size: 6, fov_rad: 3.0, tilt_rad: 0.0, ipd_m: 0.1 };
        let image = |view, part, first: u8| {
            let mut image = FrameImage { view, part, ..sample(6, 6) };
            image.display.as_mut().unwrap()[0] = first;
            image.hdr.as_mut().unwrap()[0][1] = f32::from(first);
            image
        };
        for packing in [Packing::None, Packing::TopBottom, Packing::SideBySide] {
            let eyes = view("eyes", dome.clone()).packed(packing).unwrap();
            let pictures = eyes.pictures();
            let rig = Rig::new(vec![view("plain", dome.clone()), eyes]).unwrap();
            let images = [(0, Part::LeftEye, 1), (0, Part::RightEye, 2), (1, Part::LeftEye, 3), (1, Part::RightEye, 4)];
            let packed = pack(&rig, images.map(|(view, part, first)| image(view, part, first)).to_vec());
            assert_eq!(packed[..2].iter().map(|image| image.part).collect::<Vec<_>>(), [Part::LeftEye, Part::RightEye]);
            assert_eq!(packed.len(), 2 + pictures.len());
            for (image, picture) in packed[2..].iter().zip(pictures) {
                assert_eq!((image.part, [image.width, image.height]), (picture.part, picture.size));
            }
            let second = match packing {
                Packing::None => continue,
                Packing::TopBottom => 36,
                Packing::SideBySide => 6,
            };
            let (display, hdr) = (packed[2].display.as_ref().unwrap(), packed[2].hdr.as_ref().unwrap());
            assert_eq!((display.len(), hdr.len()), (72 * 4, 72));
            assert_eq!([display[0], display[4 * second]], [3, 4]);
            assert_eq!([hdr[0][1], hdr[second][1]], [3.0, 4.0]);
        }
    }
}

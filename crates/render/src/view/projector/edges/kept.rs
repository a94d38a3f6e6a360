//! The form in which the cache keeps computed edge blends: the size of each raster, then its shares, then its black levels if any is not 0.

use super::{Beam, Blend};
use crate::cache::{self, Form, Part};

/// The blends that [`super::edge_blends`] computes.
pub(super) const PART: Part = Part { name: "edge-blends", version: 1 };

/// Bytes of the blends of all projectors.
pub(super) const FORM: Form<Vec<Blend>> = Form { to_bytes, from_bytes };

/// Everything that determines the blends. `None` if a mapping has no key.
pub(super) fn inputs(beams: &[Beam]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    for beam in beams {
        let [x, y, z, w] = beam.dome_from_view.to_array();
        bytes.extend_from_slice(beam.mapping.key()?);
        bytes.extend_from_slice(bytemuck::bytes_of(&[x, y, z, w, beam.black]));
    }
    Some(bytes)
}

fn to_bytes(blends: &Vec<Blend>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for blend in blends {
        let [width, height] = blend.size();
        let lifts_black = blend.lifts_black();
        bytes.extend_from_slice(bytemuck::bytes_of(&[width, height, u32::from(lifts_black)]));
        for channel in 0..=usize::from(lifts_black) {
            let values: Vec<f32> = blend.weights().iter().map(|weights| weights[channel]).collect();
            bytes.extend_from_slice(bytemuck::cast_slice(&values));
        }
    }
    bytes
}

fn from_bytes(mut bytes: &[u8]) -> Option<Vec<Blend>> {
    let mut blends = Vec::new();
    while !bytes.is_empty() {
        let (numbers, rest) = bytes.split_at_checked(size_of::<[u32; 3]>())?;
        let [width, height, channels]: [u32; 3] = bytemuck::pod_read_unaligned(numbers);
        let length = (width as usize).checked_mul(height as usize)?.checked_mul(size_of::<f32>())?;
        let (shares, rest) = rest.split_at_checked(length)?;
        let shares: Vec<f32> = cache::values(shares)?;
        let (black, rest) = match channels {
            0 => (vec![0.0; shares.len()], rest),
            1 => {
                let (black, rest) = rest.split_at_checked(length)?;
                (cache::values(black)?, rest)
            }
            _ => return None,
        };
        bytes = rest;
        let weights: Vec<[f32; 2]> = shares.into_iter().zip(black).map(|(share, black)| [share, black]).collect();
        let is_valid = weights.iter().flatten().all(|weight| (0.0..=1.0).contains(weight));
        blends.push(is_valid.then(|| Blend::from_weights([width, height], weights))?);
    }
    Some(blends)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;

    #[test]
    fn blends_are_read_as_they_were_written() {
        let blend = |size, weights: &[[f32; 2]]| Blend::from_weights(size, weights.to_vec());
        let blends =
            vec![blend([3, 1], &[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]), blend([1, 2], &[[0.25, 0.0], [1.0, 0.125]])];
        let bytes = to_bytes(&blends);
        assert_eq!(from_bytes(&bytes), Some(blends));
        assert_eq!(from_bytes(&[]), Some(Vec::new()));
    }

    #[test]
    fn damaged_blends_are_refused() {
        let bytes = to_bytes(&vec![Blend::uniform([2, 2], 0.5)]);
        assert_eq!(from_bytes(&bytes[..bytes.len() - 1]), None);
        assert_eq!(from_bytes(&[&bytes[..], &[0; 5]].concat()), None);
        let with = |at: usize, value: [u8; 4]| [&bytes[..at], &value, &bytes[at + 4..]].concat();
        assert_eq!(from_bytes(&with(0, u32::MAX.to_le_bytes())), None, "a width that is too large");
        assert_eq!(from_bytes(&with(8, 2_u32.to_le_bytes())), None, "a third channel");
        assert_eq!(from_bytes(&with(12, 1.5_f32.to_le_bytes())), None, "a share above 1");
        assert_eq!(from_bytes(&with(12, f32::NAN.to_le_bytes())), None, "a share that is not a number");
    }

    #[test]
    fn every_input_changes_the_key() {
        let mapping = super::super::tests::kept(b"one");
        let beam = Beam { mapping, dome_from_view: glam::DQuat::IDENTITY, black: 0.0 };
        let inputs = |beam: &Beam| inputs(std::slice::from_ref(beam)).unwrap();
        let own = inputs(&beam);
        assert_eq!(inputs(&beam.clone()), own);
        let others = [
            Beam { mapping: super::super::tests::kept(b"other"), ..beam.clone() },
            Beam { dome_from_view: glam::DQuat::from_rotation_x(1e-9), ..beam.clone() },
            Beam { black: 0.01, ..beam.clone() },
        ];
        assert!(others.iter().all(|other| inputs(other) != own));
        assert_eq!(
            super::inputs(&[super::super::tests::beam(super::super::tests::window(), 0.0, 0.0)]),
            None,
            "no key"
        );
    }
}

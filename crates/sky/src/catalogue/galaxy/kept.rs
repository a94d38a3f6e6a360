//! The form in which the cache stores a synthetic Milky Way: 8 bytes with the number of stars, then the stars, then the light of the other stars.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::{super::diffuse::DiffuseSky, Galaxy, StarRecord};
use crate::cache::{self, Form, Part};

/// The stars and the light that [`super::generate`] makes.
pub const PART: Part = Part { name: "galaxy", version: 1 };

/// Bytes of a galaxy.
pub const FORM: Form<Galaxy> = Form { to_bytes, from_bytes };

/// A star, whose distance is known.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Kept {
    position: [f64; 3],
    magnitude: f32,
    temperature_k: f32,
}

fn to_bytes(galaxy: &Galaxy) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(size_of::<u64>() + size_of::<Kept>() * galaxy.stars.len());
    bytes.extend((galaxy.stars.len() as u64).to_le_bytes());
    for &StarRecord { position, magnitude, temperature_k, .. } in &galaxy.stars {
        bytes.extend_from_slice(bytemuck::bytes_of(&Kept { position: position.to_array(), magnitude, temperature_k }));
    }
    bytes.extend(galaxy.unresolved.iter().flat_map(DiffuseSky::to_bytes));
    bytes
}

fn from_bytes(bytes: &[u8]) -> Option<Galaxy> {
    let (stars, bytes) = bytes.split_first_chunk()?;
    let of_stars = usize::try_from(u64::from_le_bytes(*stars)).ok()?.checked_mul(size_of::<Kept>())?;
    let (stars, light) = bytes.split_at_checked(of_stars)?;
    let stars = cache::values(stars)?.into_iter().map(|Kept { position, magnitude, temperature_k }| StarRecord {
        position: DVec3::from_array(position),
        magnitude,
        temperature_k,
        distance_known: true,
    });
    let stars = stars.collect();
    let unresolved = if light.is_empty() { None } else { Some(DiffuseSky::from_bytes(light)?) };
    Some(Galaxy { stars, unresolved })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use std::sync::LazyLock;

    use super::{
        super::{GalaxyParameters, tests::with_light},
        *,
    };

    /// A galaxy of 300 stars and the light of all others.
    static GALAXY: LazyLock<Galaxy> = LazyLock::new(|| {
        with_light(&GalaxyParameters { stars: 300, seed: 1, fainter_than: None, unresolved_light: true }).unwrap()
    });

    #[test]
    fn a_galaxy_survives_its_bytes_and_incomplete_ones_are_refused() {
        let without_light = Galaxy { unresolved: None, ..GALAXY.clone() };
        for galaxy in [&without_light, &GALAXY] {
            let bytes = to_bytes(galaxy);
            assert!(from_bytes(&bytes).unwrap() == *galaxy);
            for length in [0, 7, 8, 300 * 32 + 7, bytes.len() - 1] {
                assert!(from_bytes(&bytes[..length]).is_none(), "{length} bytes");
            }
            assert!(from_bytes(&[&bytes[..], &[0]].concat()).is_none());
        }
    }

    /// The digest of the content uses few decimals, because the last bits of functions differ between systems.
    #[test]
    fn the_version_of_the_part_belongs_to_its_content() {
        let sum: f64 = GALAXY
            .stars
            .iter()
            .map(|star| star.position.x.abs() + f64::from(star.magnitude + star.temperature_k))
            .sum();
        let found = format!("{sum:.4e} {:.4e}", GALAXY.unresolved.as_ref().unwrap().mean_cd_m2());
        assert_eq!(
            (PART.version, found.as_str()),
            (1, "3.8034e6 9.0118e-5"),
            "other content: increase the version of the part"
        );
    }
}

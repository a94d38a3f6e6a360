//! A synthetic Milky Way: the stars that appear brightest from the Sun, drawn from a model of the galaxy.
//!
//! The model has a thin disc in three layers (luminous stars in the thinnest), a thick disc, a bar-shaped bulge and a halo (`structure`), a
//! luminosity function with temperatures for each of them (`luminosity_function`), and dust with clouds (`dust`, `clouds`). The module `sightlines`
//! divides the space around the Sun into cells and integrates the dust. The module `sampling` computes the expected number of stars up to any
//! apparent magnitude, and draws stars. The galaxy's 1e11 stars are never drawn: first the magnitude limit for the requested number is found, then
//! only stars brighter than this limit are made, cell by cell. The light of all other stars is integrated along lines of sight (`unresolved`).
//!
//! Each block of the sky has its own random stream, so the stars depend on the parameters alone and not on the number
//! of threads. Positions are ICRS parsecs from the Solar-System barycentre, magnitudes are Johnson V.
//!
//! **Extinction** is part of the magnitude: a record's absolute magnitude is M_V + A_V, with A_V the extinction between the star and the Sun. Stars
//! therefore have the correct apparent magnitude from the Sun, but a distant camera also sees them dimmed by the dust between them and the Sun.
//! **Temperatures are intrinsic**: reddening is left out.
//!
//! The stars' motion, binaries, clusters, spiral arms and white dwarfs are left out. No star is nearer than 1.3 pc.

mod clouds;
mod dust;
mod kept;
mod luminosity_function;
mod neighbours;
mod noise;
mod sampling;
mod sightlines;
pub mod stream;
mod structure;
mod unresolved;

use std::borrow::Borrow;

use super::{StarRecord, diffuse::DiffuseSky};
use crate::cache;
use rayon::prelude::*;
use sampling::{BLOCKS, MagnitudeRange, Sky};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest number of stars that can be requested.
pub const MOST_STARS: usize = 200_000_000;

/// Faintest apparent V magnitude that the model covers.
pub const FAINTEST_APPARENT_MAGNITUDE: f64 = 20.0;

/// Number of blocks of the sky that are drawn at a time before they are appended to the result. It limits the additional memory to this share of the
/// result.
const BLOCKS_AT_ONCE: usize = 24;
/// Number of adjacent blocks that one task draws. They share the densities between them.
const BLOCKS_TOGETHER: usize = 2;

/// A synthetic Milky Way whose star counts follow those of the real sky.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GalaxyParameters {
    /// Number of stars: the brightest ones of the model, as seen from the Sun.
    #[schemars(range(min = 1, max = MOST_STARS))]
    pub stars: usize,
    /// Seed of the random number generator.
    #[serde(default = "first_seed")]
    pub seed: u64,
    /// Stars brighter than this apparent V magnitude are left out, so that a catalogue can provide them. Without it there is no limit.
    pub fainter_than: Option<f64>,
    /// Whether the light of all fainter stars is included: the band of the Milky Way and the Magellanic Clouds.
    #[serde(default = "has_unresolved_light")]
    pub unresolved_light: bool,
}

fn first_seed() -> u64 {
    1
}

fn has_unresolved_light() -> bool {
    true
}

/// A synthetic Milky Way.
#[derive(Clone, Debug, PartialEq)]
pub struct Galaxy {
    /// The stars, all with known distances, ordered by position in the sky.
    pub stars: Vec<StarRecord>,
    /// Light of all fainter stars, if requested: see `unresolved`.
    pub unresolved: Option<DiffuseSky>,
}

/// Errors from generating a galaxy.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GalaxyError {
    /// The number of stars is out of range.
    #[error("a synthetic galaxy must have 1 to {MOST_STARS} stars, not {stars}")]
    StarCount {
        /// Requested number.
        stars: usize,
    },
    /// The number of stars is out of range for a deep store.
    #[error("a synthetic galaxy in a deep store must have 1 to {} stars, not {stars}", stream::MOST_STREAMED)]
    StreamedStarCount {
        /// Requested number.
        stars: usize,
    },
    /// The model has fewer stars than requested, in a deep store.
    #[error(
        "between V = {fainter_than} and V = {} the synthetic galaxy has about {available} stars, fewer than the {stars} requested",
        stream::FAINTEST_STREAMED_MAGNITUDE
    )]
    TooFewStreamedStars {
        /// Requested number.
        stars: usize,
        /// Requested bright limit, minus infinity if there is none.
        fainter_than: f64,
        /// Number expected in the model.
        available: u64,
    },
    /// The bright limit is not a finite number.
    #[error("`fainter_than` must be a finite V magnitude, not {fainter_than}")]
    NotFinite {
        /// Requested magnitude.
        fainter_than: f64,
    },
    /// The model has fewer stars than requested.
    #[error(
        "between V = {fainter_than} and V = {FAINTEST_APPARENT_MAGNITUDE} the synthetic galaxy has about {available} stars, \
         fewer than the {stars} requested"
    )]
    TooFewStars {
        /// Requested number.
        stars: usize,
        /// Requested bright limit, minus infinity if there is none.
        fainter_than: f64,
        /// Number expected in the model.
        available: u64,
    },
}

/// Returns the galaxy of these parameters from the cache of the process; if it is not there, generates it and stores it in the cache. See
/// [`generate`].
///
/// # Errors
///
/// As [`generate`].
pub fn kept_or_generated(parameters: &GalaxyParameters) -> Result<Galaxy, GalaxyError> {
    let GalaxyParameters { stars, seed, fainter_than, unresolved_light } = *parameters;
    let fainter_than = fainter_than.map(f64::to_bits);
    let inputs = format!("{stars} {seed} {fainter_than:?} {unresolved_light}");
    cache::kept_or_made(kept::PART, &[inputs.as_bytes()], kept::FORM, || generate(parameters))
}

/// Generates exactly `parameters.stars` stars, and the light of the stars that are fainter than all of them.
///
/// The same parameters give the same stars, bit for bit, with any number of threads. The documentation of this module defines positions, magnitudes
/// and temperatures.
///
/// # Errors
///
/// [`GalaxyError`] if a parameter is out of range, or if the model does not have enough stars.
pub fn generate(parameters: &GalaxyParameters) -> Result<Galaxy, GalaxyError> {
    generate_from(parameters, Sky::new)
}

/// As [`generate`], with a model that is made after the parameters have been checked.
fn generate_from<S: Borrow<Sky>>(
    parameters: &GalaxyParameters,
    model: impl FnOnce() -> S,
) -> Result<Galaxy, GalaxyError> {
    check(parameters)?;
    let mut galaxy = draw_with_light(model().borrow(), parameters)?;
    // The model has been dropped, so that the memory of its large tables is free before the temporary list of magnitudes is allocated.
    keep_brightest(&mut galaxy.stars, parameters.stars);
    Ok(galaxy)
}

/// Draws the stars as [`draw`] does, and computes the light of the fainter stars if it is requested.
fn draw_with_light(sky: &Sky, parameters: &GalaxyParameters) -> Result<Galaxy, GalaxyError> {
    let stars = draw(sky, parameters)?;
    // The magnitude of the faintest drawn star is taken to be the one up to which this number of stars is expected.
    let unresolved = parameters.unresolved_light.then(|| {
        let left_out = sky.brighter_than(parameters.fainter_than.unwrap_or(f64::NEG_INFINITY));
        let faintest = sky.magnitude_with(left_out + parameters.stars as f64, FAINTEST_APPARENT_MAGNITUDE);
        unresolved::unresolved_light(sky, faintest)
    });
    Ok(Galaxy { stars, unresolved })
}

fn check(parameters: &GalaxyParameters) -> Result<(), GalaxyError> {
    let &GalaxyParameters { stars, fainter_than, .. } = parameters;
    if stars == 0 || stars > MOST_STARS {
        return Err(GalaxyError::StarCount { stars });
    }
    if let Some(fainter_than) = fainter_than.filter(|v| !v.is_finite()) {
        return Err(GalaxyError::NotFinite { fainter_than });
    }
    Ok(())
}

/// Draws the requested number of stars, and a few fainter ones that [`keep_brightest`] removes.
fn draw(sky: &Sky, parameters: &GalaxyParameters) -> Result<Vec<StarRecord>, GalaxyError> {
    let &GalaxyParameters { stars, seed, fainter_than, .. } = parameters;
    let brightest = fainter_than.unwrap_or(f64::NEG_INFINITY);
    let left_out = sky.brighter_than(brightest);
    let available = (sky.brighter_than(FAINTEST_APPARENT_MAGNITUDE) - left_out).max(0.0);
    let too_few = GalaxyError::TooFewStars { stars, fainter_than: brightest, available: available as u64 };
    if available < stars as f64 {
        return Err(too_few);
    }

    // Aim for more stars than requested. The margin is larger than the fluctuation of the draw and the error of the integration.
    let mut aim = 1.003 * stars as f64 + 5.0 * (stars as f64).sqrt() + 5.0;
    let mut made = Vec::with_capacity(aim as usize + aim as usize / 200);
    let mut range = MagnitudeRange { brightest, faintest: brightest };
    let mut round = 0;
    while made.len() < stars {
        if range.faintest >= FAINTEST_APPARENT_MAGNITUDE {
            return Err(too_few);
        }
        // A further round, which is hardly ever needed, continues at the faint limit of the previous one.
        range.brightest = range.faintest;
        range.faintest = sky.magnitude_with(left_out + aim, FAINTEST_APPARENT_MAGNITUDE);
        for first in (0..BLOCKS).step_by(BLOCKS_AT_ONCE) {
            let next = (first + BLOCKS_AT_ONCE).min(BLOCKS);
            let drawn: Vec<Vec<StarRecord>> = (first..next)
                .into_par_iter()
                .step_by(BLOCKS_TOGETHER)
                .map(|block| {
                    let mut stars = Vec::new();
                    let blocks = block..(block + BLOCKS_TOGETHER).min(next);
                    sky.draw_blocks(blocks, range, (seed, round), &mut |star| stars.push(star));
                    stars
                })
                .collect();
            for block in drawn {
                made.extend(block);
            }
        }
        aim = 1.01 * aim + 10.0;
        round += 1;
    }
    Ok(made)
}

/// Keeps the `count` apparently brightest stars, in their order. Of stars of equal magnitude the first ones are kept.
fn keep_brightest(stars: &mut Vec<StarRecord>, count: usize) {
    if stars.len() <= count {
        return;
    }
    let magnitude = |star: &StarRecord| star.apparent_magnitude() as f32;
    let mut magnitudes: Vec<f32> = stars.par_iter().map(magnitude).collect();
    let (brighter, &mut limit, _) = magnitudes.select_nth_unstable_by(count - 1, f32::total_cmp);
    let mut equals_left = count - brighter.iter().filter(|m| **m < limit).count();
    stars.retain(|star| {
        let m = magnitude(star);
        let equal = m == limit && equals_left > 0;
        equals_left -= usize::from(equal);
        m < limit || equal
    });
}

#[cfg(test)]
pub(in crate::catalogue) mod tests;

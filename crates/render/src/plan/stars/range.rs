//! Choice of the fixed-point units of a frame.
//!
//! Every channel of a pixel has 42 bits. The unit is chosen so that all light of the frame would fit into one pixel, so sums cannot overflow in any
//! scene. The unit is also not finer than the faintest star needs: light above 2^21 units costs a second atomic add, and in a scene of few stars of
//! similar brightness all of them would need it. If one or a few stars are more than 65536 times as bright as all others together (such as the Sun
//! among the stars), they have separate sums with a separate unit, so that the other stars keep their resolution.

use glam::DVec3;

use super::cull::{VisibleChunk, light_at, most_light, near_stars};
use crate::{catalogue::chunks::StarSet, plan::costs, relativity::Motion};

/// Bits of a channel's sum.
pub const CHANNEL_BITS: i32 = 42;
/// Number of units of the faintest star's light, if the range permits. Unbiased rounding in each of nine pixels then has an error of 2.1e-4 of the
/// star's light (one standard deviation). The error is smaller for brighter stars.
const STAR_UNITS: f64 = 4096.0;
/// Number of units of the least visible light of a pixel to which many sources add, each with unbiased rounding.
const PIXEL_STEP_UNITS: f64 = 32.0;
/// Greatest channel of a colour in gamut with luminance 1: pure red, 1 / 0.2126.
const GREATEST_CHANNEL: f64 = 4.71;
/// A star is summed separately if the ratio of its light to the total of everything fainter exceeds this.
const OUTSHINES: f64 = 65_536.0;
/// Number of chunks that are searched for such stars: the brightest ones.
const SEARCHED_CHUNKS: usize = 16;

/// Fixed-point sums of the stars in a brightness range.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FixedPoint {
    /// Units per lux.
    pub units_per_lx: f64,
    /// Least illuminance, lx.
    pub faintest_lx: f64,
    /// Greatest illuminance, excluded, lx.
    pub brightest_lx: f64,
}

/// Sums of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ranges {
    /// Sums of nearly all stars.
    pub main: FixedPoint,
    /// Sums of the few stars that are far brighter.
    pub bright: Option<FixedPoint>,
}

fn units_per_lx(total_lx: f64, needed: f64) -> f64 {
    // Half of the range is reserved for rounding. Without light, any unit is sufficient.
    let greatest_sum_lx = total_lx * GREATEST_CHANNEL;
    // A power of two: exact in f32, and constant from frame to frame while the light hardly changes.
    if greatest_sum_lx > 0.0 {
        (2f64.powi(CHANNEL_BITS - 1) / greatest_sum_lx).min(needed).min(1e30).log2().floor().exp2()
    } else {
        1.0
    }
}

/// Lower bound of the illuminance of the faintest star of the visible chunks, lx. The distance of the camera from the barycentre reduces the light of
/// a star at most by the factor that applies to the nearest star of its chunk.
fn faintest_star_lx(set: &StarSet, visible: &[VisibleChunk], eyes_pc: &[DVec3]) -> f64 {
    let farthest_eye_pc = eyes_pc.iter().map(|eye| eye.length()).fold(0.0, f64::max);
    let seen_lx = set.faintest_seen_lx();
    visible
        .iter()
        .map(|visible| {
            let chunk = &set.chunks[visible.chunk];
            if chunk.at_infinity {
                return f64::from(seen_lx[visible.chunk]);
            }
            let travelled_pc = (chunk.origin_pc - visible.origin_pc).length() + farthest_eye_pc;
            let kept = (chunk.nearest_pc / (chunk.nearest_pc + travelled_pc)).powi(2);
            f64::from(seen_lx[visible.chunk]) * kept
        })
        .fold(f64::INFINITY, f64::min)
}

/// Illuminance of one of the brightest stars, lx: the greatest of all eyes, and that at every eye.
struct Light {
    most_lx: f64,
    per_eye_lx: Vec<f64>,
}

/// Light of other sources than stars.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OtherLight {
    /// Illuminance of each point of light at each eye, lx.
    pub points_lx: Vec<Vec<f64>>,
    /// Upper bound of the light of a crowd of faint points, lx.
    pub crowd_lx: f64,
    /// Illuminance of the faintest of its many points, lx; 0: not known.
    pub faintest_lx: f64,
    /// Number of these points.
    pub many: u64,
    /// Least visible light of a pixel to which many sources add a little each, lx; 0: only stars add to pixels.
    pub pixel_step_lx: f64,
}

impl OtherLight {
    /// Adds the stars of `visible` between two illuminances to the crowd.
    pub fn add_crowd(
        &mut self,
        set: &StarSet,
        visible: &[VisibleChunk],
        eyes_pc: &[DVec3],
        [faintest_lx, brightest_lx]: [f64; 2],
    ) {
        let faintest_star_lx = faintest_star_lx(set, visible, eyes_pc).max(faintest_lx);
        self.faintest_lx = if self.many > 0 { self.faintest_lx.min(faintest_star_lx) } else { faintest_star_lx };
        self.many += visible.iter().map(|chunk| u64::from(chunk.count)).sum::<u64>();
        // Brighter stars of these chunks are not part of the crowd.
        let of_chunk = |chunk: &VisibleChunk| chunk.total_lx.min(f64::from(chunk.count) * brightest_lx);
        self.crowd_lx += visible.iter().map(of_chunk).sum::<f64>();
    }
}

/// The greatest illuminance at any eye.
fn most(per_eye_lx: &[f64]) -> f64 {
    per_eye_lx.iter().copied().fold(0.0, f64::max)
}

/// Chooses the units for the stars of `visible` not fainter than `faintest_lx`, and for `other` light. Eyes are at `eyes_pc` from the
/// camera, which may move.
pub fn choose(
    set: &StarSet,
    visible: &[VisibleChunk],
    eyes_pc: &[DVec3],
    faintest_lx: f64,
    motion: Option<Motion>,
    other: &OtherLight,
) -> Ranges {
    // Add up all light, and find the finest unit that any source needs.
    let total_lx: f64 = visible
        .iter()
        .map(|chunk| chunk.total_lx)
        .chain(other.points_lx.iter().map(|per_eye_lx| most(per_eye_lx)))
        .sum::<f64>()
        + other.crowd_lx;
    // For a moving camera only the range determines the unit, because motion changes the light of every star by a different factor.
    let faintest_star_lx = match motion {
        Some(_) => 0.0,
        None if other.many > 0 => faintest_star_lx(set, visible, eyes_pc).max(faintest_lx).min(other.faintest_lx),
        None => faintest_star_lx(set, visible, eyes_pc).max(faintest_lx),
    };
    let drawn: u64 = visible.iter().map(|chunk| u64::from(chunk.count)).sum::<u64>() + other.many;
    let needed = if drawn >= costs::BUILT_IN.coarse_units_from_stars && faintest_star_lx > 0.0 {
        STAR_UNITS / faintest_star_lx
    } else {
        f64::INFINITY
    };
    let needed = if other.pixel_step_lx > 0.0 { needed.max(PIXEL_STEP_UNITS / other.pixel_step_lx) } else { needed };
    // The brightest stars and points, in order of decreasing brightness.
    let mut by_brightness: Vec<&VisibleChunk> = visible.iter().collect();
    let searched = SEARCHED_CHUNKS.min(by_brightness.len());
    if searched > 0 {
        by_brightness.select_nth_unstable_by(searched - 1, |a, b| b.brightest_lx.total_cmp(&a.brightest_lx));
    }
    let mut lights: Vec<Light> = by_brightness[..searched]
        .iter()
        .flat_map(|visible| {
            let chunk = &set.chunks[visible.chunk];
            near_stars(set, chunk, visible.origin_pc).map(|(place, star)| {
                // At infinity the position is a direction, the same for every eye.
                let eyes: &[DVec3] = if chunk.at_infinity { &[DVec3::ZERO] } else { eyes_pc };
                Light {
                    most_lx: most_light(place, star, eyes, motion),
                    per_eye_lx: eyes.iter().map(|eye| light_at(place - *eye, star, motion)).collect(),
                }
            })
        })
        .collect();
    lights.extend(
        other.points_lx.iter().map(|per_eye_lx| Light { most_lx: most(per_eye_lx), per_eye_lx: per_eye_lx.clone() }),
    );
    lights.sort_by(|a, b| b.most_lx.total_cmp(&a.most_lx));
    let others_lx = by_brightness[searched..].iter().map(|chunk| chunk.total_lx).sum::<f64>() + other.crowd_lx;
    // For each star, the sum of everything fainter.
    let mut fainter_lx = vec![others_lx; lights.len()];
    for index in (1..lights.len()).rev() {
        fainter_lx[index - 1] = fainter_lx[index] + lights[index].most_lx;
    }
    // Separate sums for lights that are far brighter than everything fainter together.
    let outshines = |i: usize| fainter_lx[i] > 0.0 && lights[i].most_lx > OUTSHINES * fainter_lx[i];
    if let Some(last) = (0..lights.len()).find(|&i| outshines(i)) {
        let bright = &lights[..=last];
        let bright_lx: f64 = bright.iter().map(|light| light.most_lx).sum();
        let threshold_lx = lights[last].most_lx / 2.0;
        // At a more distant eye, the same star may be faint enough for the main sums.
        let left_lx: f64 = bright
            .iter()
            .map(|light| light.per_eye_lx.iter().copied().filter(|lx| *lx < threshold_lx).fold(0.0, f64::max))
            .sum();
        return Ranges {
            main: FixedPoint {
                units_per_lx: units_per_lx(fainter_lx[last] + left_lx, needed),
                faintest_lx,
                brightest_lx: threshold_lx,
            },
            bright: Some(FixedPoint {
                units_per_lx: units_per_lx(bright_lx * (1.0 + 1e-5), f64::INFINITY),
                faintest_lx: threshold_lx.max(faintest_lx),
                brightest_lx: f64::INFINITY,
            }),
        };
    }
    let main = FixedPoint { units_per_lx: units_per_lx(total_lx, needed), faintest_lx, brightest_lx: f64::INFINITY };
    Ranges { main, bright: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        catalogue::StarRecord,
        plan::stars::cull::{CullSettings, SPLAT_MARGIN_PX, visible_chunks},
        units::illuminance_lx_from_magnitude,
        view::{
            Part, Viewport,
            projection::{Equirectangular, Projection},
        },
    };

    fn ranges_of(magnitudes: &[f32]) -> Ranges {
        ranges_in_flight(magnitudes, None)
    }

    fn whole_sky() -> Viewport {
        Viewport {
            view: 0,
            part: Part::Whole,
            projection: Projection::Equirectangular(Equirectangular::new([8, 4]).unwrap()),
            world_from_view: glam::DQuat::IDENTITY,
            eye_offset_m: DVec3::ZERO,
            viewing_circle_m: 0.0,
        }
    }

    fn ranges_in_flight(magnitudes: &[f32], motion: Option<Motion>) -> Ranges {
        let records = magnitudes
            .iter()
            .map(|&magnitude| StarRecord {
                position: DVec3::X,
                magnitude,
                temperature_k: 5772.0,
                distance_known: false,
            })
            .collect();
        let set = StarSet::from_records(records);
        let settings =
            CullSettings { faintest_lx: 0.0, enabled: true, motion, refraction: None, margin_px: SPLAT_MARGIN_PX };
        choose(
            &set,
            &visible_chunks(&set, DVec3::ZERO, &[whole_sky()], settings),
            &[DVec3::ZERO],
            0.0,
            motion,
            &OtherLight::default(),
        )
    }

    /// Stars of caps share their chunks with brighter stars, which are drawn elsewhere.
    #[test]
    fn a_crowd_contains_no_brighter_stars() {
        let record =
            |magnitude: f32| StarRecord { position: DVec3::X, magnitude, temperature_k: 5772.0, distance_known: false };
        let set = StarSet::from_records([-26.7, 8.0, 9.0, 10.0].map(record).to_vec());
        let settings = CullSettings {
            faintest_lx: 0.0,
            enabled: false,
            motion: None,
            refraction: None,
            margin_px: SPLAT_MARGIN_PX,
        };
        let visible = visible_chunks(&set, DVec3::ZERO, &[whole_sky()], settings);
        let mut other = OtherLight::default();
        let limits_lx = [10.5, 7.5].map(illuminance_lx_from_magnitude);
        other.add_crowd(&set, &visible, &[DVec3::ZERO], limits_lx);
        assert_eq!(other.many, 4);
        assert!(other.crowd_lx <= 4.0 * limits_lx[1] && other.crowd_lx > limits_lx[1], "{}", other.crowd_lx);
        let faintest_lx = illuminance_lx_from_magnitude(10.0);
        assert!((other.faintest_lx / faintest_lx - 1.0).abs() < 1e-3, "{}", other.faintest_lx);
        // The Sun is alone in the other set: its light is summed apart, because it outshines the crowd.
        let ranges = choose(&set, &visible, &[DVec3::ZERO], limits_lx[1], None, &other);
        assert!(ranges.bright.is_some());
    }

    #[test]
    fn all_light_in_one_pixel_fits() {
        let ranges = ranges_of(&[1.0, 2.0, 3.0, 3.0]);
        assert_eq!(ranges.bright, None);
        let total: f64 = [1.0, 2.0, 3.0, 3.0].into_iter().map(illuminance_lx_from_magnitude).sum();
        let greatest = total * GREATEST_CHANNEL * ranges.main.units_per_lx;
        assert!(greatest < 2f64.powi(42) && greatest > 2f64.powi(39), "{greatest}");
    }

    #[test]
    fn with_many_stars_the_faintest_has_its_units_and_not_twice_as_many() {
        let magnitudes: Vec<f32> =
            (0..costs::BUILT_IN.coarse_units_from_stars + 1).map(|i| if i == 0 { 12.0 } else { 9.0 }).collect();
        let faintest = illuminance_lx_from_magnitude(12.0) * ranges_of(&magnitudes).main.units_per_lx;
        assert!((0.49 * STAR_UNITS..1.01 * STAR_UNITS).contains(&faintest), "{faintest}");
    }

    #[test]
    fn units_follow_the_light_for_a_moving_camera() {
        let at_rest = ranges_of(&[1.0; 64]).main.units_per_lx;
        let ahead = ranges_in_flight(&[1.0; 64], Motion::new(DVec3::X * 0.9)).main.units_per_lx;
        let behind = ranges_in_flight(&[1.0; 64], Motion::new(DVec3::X * -0.9)).main.units_per_lx;
        assert!(at_rest / ahead >= 2.0 && at_rest / ahead <= 8.0, "{at_rest} {ahead}");
        assert!(behind / at_rest > 1e3, "{at_rest} {behind}");
    }

    #[test]
    fn the_sun_has_separate_sums_and_sirius_does_not() {
        let with_sun = ranges_of(&[-26.7, -1.46, 6.0, 21.0]);
        let bright = with_sun.bright.expect("the Sun outshines all others");
        assert!(with_sun.main.brightest_lx < illuminance_lx_from_magnitude(-26.7));
        assert!(with_sun.main.brightest_lx > illuminance_lx_from_magnitude(-1.46));
        assert_eq!(bright.faintest_lx, with_sun.main.brightest_lx);
        // Next to the Sun, a star of magnitude 21 keeps more than a hundred units.
        assert!(illuminance_lx_from_magnitude(21.0) * with_sun.main.units_per_lx > 100.0);
        assert_eq!(ranges_of(&[-1.46, 0.0, 0.5, 1.0, 6.0]).bright, None);
    }

    #[test]
    fn no_stars_give_finite_units() {
        assert_eq!(ranges_of(&[]).main.units_per_lx, 1.0);
    }
}

//! Air and ground in f64: each pixel is divided into n x n parts, and the direction of each part's centre shows the
//! ground or, through the air, the sky. The scattered light of the air is taken at the centre of the pixel, since it
//! varies negligibly within a pixel; the ground is resolved where the horizon crosses the pixel.

use glam::{DQuat, DVec2, DVec3};

use crate::{scene::surroundings::LocalSky, view::projection::PlaneMapping};

/// Returns the luminance of a pixel whose bodies have the mean luminance `shown_cd_m2` without air, linear Rec. 709, cd/m^2; `None` outside of the
/// picture.
pub fn pixel(
    sky: &LocalSky,
    mapping: &dyn PlaneMapping,
    world_from_view: DQuat,
    [x, y]: [u32; 2],
    shown_cd_m2: [f64; 3],
    parts: u32,
) -> Option<[f64; 3]> {
    let direction_at = |dx: f64, dy: f64| {
        let direction = mapping.direction_from_pixel(DVec2::new(f64::from(x) + dx, f64::from(y) + dy))?;
        Some(world_from_view * direction)
    };
    let middle = direction_at(0.5, 0.5)?;
    let places = (0..parts).flat_map(|j| (0..parts).map(move |i| [i, j]));
    let share = |part: u32| (f64::from(part) + 0.5) / f64::from(parts);
    let seen: Vec<DVec3> = places.filter_map(|[i, j]| direction_at(share(i), share(j))).collect();
    let (ground, share) =
        seen.iter().map(|direction| sky.ground(*direction)).fold(([0.0; 3], 0.0), |(sum, all), (light, share)| {
            ([0, 1, 2].map(|c| sum[c] + light[c] / seen.len() as f64), all + share / seen.len() as f64)
        });
    let above = sky.above_cd_m2(middle, shown_cd_m2);
    Some([0, 1, 2].map(|c| ground[c] + (1.0 - share) * above[c]))
}

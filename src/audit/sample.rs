//! Chooses the pixels of an image that an audit compares: some from every region that is drawn differently. The choice
//! is deterministic.
//!
//! A quarter of them lies on and around the brightest stars of the image, an eighth at its edges, a quarter where it is
//! darkest, and the rest is spread evenly. Difficult places are therefore over-represented.

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::{DQuat, DVec3};

use crate::{reference::glare::sky_cube::sampled_pixels, view::projection::PlaneMapping};

/// Why a pixel is in the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    NearStar,
    Edge,
    Dark,
    Anywhere,
}

impl Place {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::NearStar => "near a bright star",
            Self::Edge => "at an edge",
            Self::Dark => "in the dark sky",
            Self::Anywhere => "anywhere",
        }
    }
}

/// Offsets (columns, rows) from the pixel that holds a star's image: the pixel itself, its neighbours, the end of the
/// kernel, the veil.
const AROUND_STAR: [[i64; 2]; 8] = [[0, 0], [1, 0], [0, -1], [-2, 1], [3, 3], [-4, 0], [0, 8], [-16, 5]];
/// Number of brightest stars that are searched for stars inside the image.
const BRIGHT_STARS: usize = 4096;
/// Candidates for each dark pixel.
const CANDIDATES: usize = 4;

/// Chooses `count` distinct pixels of an image; fewer in a small image. `bright` are the brightest stars of the sky,
/// brightest first, as unit vectors in world axes; `darkness` orders pixels, darkest first.
pub(super) fn pixels(
    mapping: &dyn PlaneMapping,
    world_from_view: DQuat,
    bright: &[DVec3],
    darkness: &dyn Fn([u32; 2]) -> u64,
    count: usize,
) -> Vec<([u32; 2], Place)> {
    let mut sample = Sample { mapping, taken: Vec::new(), left: 0 };
    sample.begin(count / 4);
    let [width, height] = mapping.size();
    let view_from_world = world_from_view.conjugate();
    let images = bright.iter().filter_map(|star| mapping.pixel_from_direction(view_from_world * *star));
    for image in images {
        let own = [image.x.floor() as i64, image.y.floor() as i64];
        if sample.left == 0 {
            break;
        }
        // Only stars inside the image; the pixels around a star show its effect on its surroundings.
        if sample.holds(own) {
            AROUND_STAR.iter().for_each(|[x, y]| sample.take([own[0] + x, own[1] + y], Place::NearStar));
        }
    }
    let lines = count / 32;
    sample.begin(count / 8);
    for line in 0..lines {
        let along = |side: u32| (f64::from(side) * (line as f64 + 0.5) / lines as f64) as u32;
        let (column, row) = (along(width), along(height));
        let row_ends = ends(mapping, (0..width).map(|x| [x, row]));
        let column_ends = ends(mapping, (0..height).map(|y| [column, y]));
        for end in row_ends.into_iter().chain(column_ends).flatten() {
            sample.take(end.map(i64::from), Place::Edge);
        }
    }
    let anywhere = sampled_pixels(mapping, CANDIDATES * count, &[]);
    let mut dark = anywhere.clone();
    dark.sort_by_key(|pixel| darkness(*pixel));
    sample.begin(count / 4);
    dark.iter().for_each(|pixel| sample.take(pixel.map(i64::from), Place::Dark));
    sample.begin(count - sample.taken.len().min(count));
    anywhere.iter().for_each(|pixel| sample.take(pixel.map(i64::from), Place::Anywhere));
    sample.taken
}

/// The first and the last pixel of a line that belong to the picture.
fn ends(mapping: &dyn PlaneMapping, mut line: impl DoubleEndedIterator<Item = [u32; 2]>) -> [Option<[u32; 2]>; 2] {
    let holds = |[x, y]: &[u32; 2]| mapping.contains(*x, *y);
    let first = line.find(holds);
    [first, line.rfind(holds)]
}

struct Sample<'a> {
    mapping: &'a dyn PlaneMapping,
    taken: Vec<([u32; 2], Place)>,
    /// How many more pixels of the current kind to take.
    left: usize,
}

impl Sample<'_> {
    fn begin(&mut self, count: usize) {
        self.left = count;
    }

    fn holds(&self, [x, y]: [i64; 2]) -> bool {
        let pixel = (u32::try_from(x), u32::try_from(y));
        if let (Ok(x), Ok(y)) = pixel { self.mapping.contains(x, y) } else { false }
    }

    fn take(&mut self, pixel: [i64; 2], place: Place) {
        if self.left == 0 || !self.holds(pixel) {
            return;
        }
        // The pixel lies inside the image, whose sides fit 32 bits.
        let pixel = pixel.map(|coordinate| coordinate as u32);
        if self.taken.iter().all(|(taken, _)| *taken != pixel) {
            self.taken.push((pixel, place));
            self.left -= 1;
        }
    }
}

/// Directions of the brightest stars, brightest first. Equally bright stars keep their order.
pub(super) fn brightest(stars: impl Iterator<Item = (f64, DVec3)>) -> Vec<DVec3> {
    struct Kept {
        lx: f64,
        number: usize,
        towards: DVec3,
    }
    impl Ord for Kept {
        fn cmp(&self, other: &Self) -> std::cmp::Ordering {
            self.lx.total_cmp(&other.lx).then(other.number.cmp(&self.number))
        }
    }
    impl PartialOrd for Kept {
        fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
            Some(self.cmp(other))
        }
    }
    impl PartialEq for Kept {
        fn eq(&self, other: &Self) -> bool {
            self.cmp(other).is_eq()
        }
    }
    impl Eq for Kept {}
    let mut kept: BinaryHeap<Reverse<Kept>> = BinaryHeap::new();
    for (number, (lx, towards)) in stars.enumerate() {
        if kept.len() < BRIGHT_STARS || kept.peek().is_some_and(|least| lx > least.0.lx) {
            kept.push(Reverse(Kept { lx, number, towards }));
            if kept.len() > BRIGHT_STARS {
                kept.pop();
            }
        }
    }
    // Reversed elements sort with the greatest first.
    kept.into_sorted_vec().into_iter().map(|Reverse(kept)| kept.towards).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use std::{collections::HashSet, f64::consts::PI};

    use super::*;
    use crate::view::projection::{Equirectangular, Fisheye, FisheyeMapping};

    #[test]
    fn a_sample_has_pixels_of_every_kind_each_once() {
        let dome = Fisheye::new([200, 200], FisheyeMapping::Equidistant, PI).unwrap();
        let bright = [DVec3::Z, DVec3::new(0.2, 0.1, -1.0).normalize(), DVec3::new(-0.5, 0.4, -1.0).normalize()];
        let left_is_dark = |[x, _]: [u32; 2]| u64::from(x);
        let sample = pixels(&dome, DQuat::IDENTITY, &bright, &left_is_dark, 256);
        assert_eq!(sample.len(), 256);
        assert_eq!(sample.iter().map(|(pixel, _)| pixel).collect::<HashSet<_>>().len(), 256);
        assert!(sample.iter().all(|([x, y], _)| dome.contains(*x, *y)));
        let pixels_of =
            |place: Place| sample.iter().filter(|(_, own)| *own == place).map(|(pixel, _)| *pixel).collect::<Vec<_>>();
        // The first star is behind the eye.
        assert_eq!(pixels_of(Place::NearStar).len(), 16);
        for star in &bright[1..] {
            let own = dome.pixel_from_direction(*star).unwrap();
            assert!(pixels_of(Place::NearStar).contains(&[own.x as u32, own.y as u32]));
        }
        assert!(pixels_of(Place::Edge).iter().all(|[x, y]| {
            let off = [*x, *y].map(|coordinate| f64::from(coordinate) + 0.5 - 100.0);
            off[0].hypot(off[1]) > 97.0
        }));
        assert_eq!(pixels_of(Place::Edge).len(), 32);
        let dark = pixels_of(Place::Dark);
        assert!(dark.len() == 64 && dark.iter().all(|[x, _]| *x < 80), "{dark:?}");
        assert!(pixels_of(Place::Anywhere).iter().any(|[x, _]| *x > 150));
        assert_eq!(sample, pixels(&dome, DQuat::IDENTITY, &bright, &left_is_dark, 256));
        let small = Equirectangular::new([6, 3]).unwrap();
        assert_eq!(pixels(&small, DQuat::IDENTITY, &bright, &|_| 0, 256).len(), 18);
    }

    #[test]
    fn the_brightest_stars_come_first() {
        let stars = (0..10_000).map(|i| (f64::from((i * 7919) % 10_000), DVec3::splat(f64::from((i * 7919) % 10_000))));
        let found = brightest(stars);
        assert_eq!(found.len(), BRIGHT_STARS);
        assert!(found.iter().enumerate().all(|(i, star)| star.x == 9999.0 - i as f64));
    }
}

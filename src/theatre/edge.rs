//! The edge of the lit part of a raster. It is the edge of the content that the calibration refers to, evaluated for each pixel.
//!
//! The programs that use these calibrations interpolate the positions of nodes in the content, and look up each pixel there. A cell with nodes on
//! both sides of the content's edge is therefore lit up to the edge.

use glam::{DVec2, DVec3};

use super::{Border, Reader, content::Content, unlit::strays};

/// The samples of a grid, computed from their places in a content.
pub(super) struct Placed {
    /// Directions of the samples, including samples beyond the edge of the content.
    pub samples: Vec<Option<DVec3>>,
    /// Where the content ends; `None` if no place is outside.
    pub border: Option<Border>,
    /// Number of places outside.
    pub outside: usize,
    /// Number of places outside that do not continue the places of their neighbours, and are treated as unknown.
    pub strays: usize,
}

/// Computes the samples of a grid of `columns` columns from their places in a content. With `looks_for_strays` (for a smooth lattice of the nodes of
/// a file), strays are removed: a spline through strays would bend the cells around them.
pub(super) fn placed(
    content: &Content,
    mut places: Vec<Option<DVec2>>,
    columns: usize,
    looks_for_strays: bool,
) -> Placed {
    let shape = content.shape();
    let inside: Vec<bool> = places.iter().map(|place| place.is_some_and(|at| shape.holds(at))).collect();
    let known = places.iter().flatten().count();
    let outside = known - inside.iter().filter(|inside| **inside).count();
    let mut count = 0;
    if outside > 0 && looks_for_strays {
        let strays = strays(&places, columns, &inside);
        for (place, stray) in places.iter_mut().zip(strays) {
            count += usize::from(stray);
            *place = place.filter(|_| !stray);
        }
    }
    let direction = |place: &Option<DVec2>| place.and_then(|at| content.direction(at.x, at.y));
    let samples = places.iter().map(direction).collect();
    let border = (outside > count).then_some(Border { places, shape });
    Placed { samples, border, outside, strays: count }
}

impl Placed {
    /// Whether the content appears on the raster.
    pub fn is_reached(&self, columns: usize) -> bool {
        let has_samples = self.samples.iter().any(Option::is_some);
        has_samples && self.border.as_ref().is_none_or(|border| border.is_reached(columns))
    }
}

impl Reader<'_> {
    /// Adds a note on how many of the `count` places of `what` are outside of the content.
    pub(super) fn note_edge(&mut self, place: &str, what: &str, count: usize, placed: &Placed) {
        let Placed { outside, strays, .. } = placed;
        if outside > strays {
            self.note(format!(
                "{place}: {outside} of {count} {what} lie outside of the content: pixels are dark where their own place is outside, also \
                 within cells"
            ));
        }
        if *strays > 0 {
            self.note(format!(
                "{place}: {strays} of {count} {what} lie outside of the content and do not continue their neighbours: they are taken as \
                 unknown, and the cells around them are dark"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> Content {
        Content::Plane { lower_left: DVec3::new(-1.0, -1.0, -1.0), right: 2.0 * DVec3::X, up: 2.0 * DVec3::Y }
    }

    /// Places of a lattice of 5 x 5 nodes from `low` to `high`.
    fn lattice(low: f64, high: f64) -> Vec<Option<DVec2>> {
        let share = |i: i32| low + (high - low) * f64::from(i) / 4.0;
        (0..25).map(|i| Some(DVec2::new(share(i % 5), share(i / 5)))).collect()
    }

    #[test]
    fn nodes_beyond_the_edge_keep_their_directions() {
        let found = placed(&plane(), lattice(-0.1, 1.1), 5, true);
        assert_eq!((found.outside, found.strays), (16, 0));
        assert!(found.samples.iter().all(Option::is_some) && found.border.is_some() && found.is_reached(5));
        let inside = placed(&plane(), lattice(0.0, 1.0), 5, true);
        assert!(inside.border.is_none() && inside.outside == 0 && inside.is_reached(5));
        let pixels = placed(&plane(), lattice(20.0, 800.0), 5, true);
        assert!(!pixels.is_reached(5) && pixels.outside == 25);
    }

    #[test]
    fn a_mark_among_the_nodes_is_unknown_unless_the_mesh_is_linear() {
        let mut places = lattice(0.0, 1.0);
        places[12] = Some(DVec2::splat(-1.0));
        let smooth = placed(&plane(), places.clone(), 5, true);
        assert!(smooth.strays == 1 && smooth.samples[12].is_none() && smooth.border.is_none());
        let linear = placed(&plane(), places, 5, false);
        assert!(linear.strays == 0 && linear.samples[12].is_some() && linear.border.is_some());
    }

    #[test]
    fn a_fisheye_ends_at_its_circle() {
        let content = Content::fisheye(std::f64::consts::TAU, 0.0, [1.0, 1.0]);
        let Ok(content) = content else { panic!("a fisheye of 360 degrees") };
        let found = placed(&content, lattice(0.0, 1.0), 5, true);
        // The four corners and their neighbours are outside, at 1.12 radii. The mapping continues beyond the antipode.
        assert_eq!(found.outside, 12);
        assert!(found.samples.iter().all(Option::is_some));
    }
}

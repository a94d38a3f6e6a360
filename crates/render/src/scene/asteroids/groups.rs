//! Groups of neighbouring instances, and the tree over them.
//!
//! Instances are split recursively across the longest side of their bounding box until each part is one group, so neighbours in the list are
//! neighbours in space. This also holds in thin rings, where a space-filling curve would jump from one end to the other. The size of each half is a
//! multiple of the group size, and at higher levels of the node size. So each node is a contiguous range of the list, and all nodes but the last are
//! full.
//!
//! A node's sphere contains every one of its instances completely. It is computed from the unpacked values: position from the f32 offset, radius from
//! 16 bits, and bound of the shape. It is computed from the instances themselves, not from the spheres of the level below, so it is as tight as
//! those.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{GROUP, Node, PackedAsteroid, shapes::F32_ROUNDING};

/// Number of nodes of a level that form a node of the next level.
pub const BRANCHING: usize = 16;

/// Below this number of instances, a single thread does the splitting.
const TOGETHER: usize = 1 << 14;

/// An instance with its f64 position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Position in the field's axes, m.
    pub place_m: DVec3,
    /// The packed data; its offset is still 0.
    pub packed: PackedAsteroid,
}

/// Returns the instances in groups, and the nodes by level.
pub(super) fn grouped(
    mut placed: Vec<Placed>,
    largest_m: f64,
    bounds: &[f64],
) -> (Vec<PackedAsteroid>, Vec<Vec<Node>>) {
    if placed.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let mut stretch = GROUP;
    while stretch < placed.len() {
        stretch *= BRANCHING;
    }
    order(&mut placed, stretch);
    let middles: Vec<DVec3> = placed.par_chunks(GROUP).map(middle_m).collect();
    placed.par_chunks_mut(GROUP).zip(&middles).for_each(|(group, middle_m)| {
        for one in group {
            one.packed.offset = (one.place_m - middle_m).as_vec3().to_array().map(f32::to_bits);
            // From here on, use the positions that the packed offsets encode.
            one.place_m = middle_m + one.packed.offset_m();
        }
    });

    let node = |middle_m: DVec3, members: &[Placed], (first, count): (usize, usize)| {
        bounding_node(middle_m, members, largest_m, bounds, (first as u32, count as u32))
    };
    let groups = placed.par_chunks(GROUP).zip(&middles).enumerate();
    let groups = groups.map(|(k, (members, middle_m))| node(*middle_m, members, (k * GROUP, members.len()))).collect();
    let mut levels: Vec<Vec<Node>> = vec![groups];
    let mut stretch = GROUP;
    while let Some(below) = levels.last().map(Vec::len).filter(|below| *below > 1) {
        stretch *= BRANCHING;
        let nodes = placed.par_chunks(stretch).enumerate().map(|(k, members)| {
            let first = k * BRANCHING;
            node(middle_m(members), members, (first, BRANCHING.min(below - first)))
        });
        let nodes = nodes.collect();
        levels.push(nodes);
    }
    (placed.par_iter().map(|one| one.packed).collect(), levels)
}

/// Sorts the list so that neighbours in space are next to each other. `stretch` is the node size of some level, at least the length of the list.
fn order(placed: &mut [Placed], mut stretch: usize) {
    if placed.len() <= GROUP {
        return;
    }
    while stretch >= placed.len() {
        stretch /= BRANCHING;
    }
    let left = placed.len().div_ceil(stretch) / 2 * stretch;
    let (low, high) = extent_m(placed);
    let axis = (high - low).max_position();
    placed.select_nth_unstable_by(left, |a, b| a.place_m[axis].total_cmp(&b.place_m[axis]));
    let (near, far) = placed.split_at_mut(left);
    if near.len() + far.len() > TOGETHER {
        rayon::join(|| order(near, stretch), || order(far, stretch));
    } else {
        order(near, stretch);
        order(far, stretch);
    }
}

fn extent_m(placed: &[Placed]) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    placed.iter().fold(none, |(low, high), one| (low.min(one.place_m), high.max(one.place_m)))
}

/// Centre of the bounding box of the positions.
fn middle_m(placed: &[Placed]) -> DVec3 {
    let (low, high) = extent_m(placed);
    low + (high - low) * 0.5
}

fn bounding_node(
    middle_m: DVec3,
    members: &[Placed],
    largest_m: f64,
    bounds: &[f64],
    (first, count): (u32, u32),
) -> Node {
    let (mut reach_m, mut area_m2, mut weighted) = (0f64, 0.0, DVec3::ZERO);
    let (mut smallest_m, mut most_m) = (f64::INFINITY, 0f64);
    for Placed { place_m, packed } in members {
        let radius_m = packed.radius_m(largest_m);
        let offset_m = place_m - middle_m;
        reach_m = reach_m.max(offset_m.length() + radius_m * bounds[packed.shape()]);
        let one_m2 = PI * radius_m * radius_m;
        area_m2 += one_m2;
        weighted += offset_m * one_m2;
        (smallest_m, most_m) = (smallest_m.min(radius_m), most_m.max(radius_m));
    }
    // Adding the offset to the middle in f64 rounds by a few parts in 1e16 of the middle's distance from the origin.
    let radius_m = reach_m * (1.0 + F32_ROUNDING) + 1e-15 * middle_m.length();
    let centroid_m = middle_m + weighted / area_m2;
    Node { middle_m, radius_m, centroid_m, area_m2, largest_m: most_m, smallest_m, first, count }
}

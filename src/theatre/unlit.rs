//! Nodes of intensity 0 in Paul Bourke's meshes.
//!
//! Programs that write such meshes often leave placeholders in the coordinates of nodes that get no light. The light fades between a lit node and an
//! unlit one, so an unlit node next to lit ones needs coordinates. The coordinates in the file are used if they continue those of its neighbours;
//! otherwise they are extrapolated from the neighbours. Other unlit nodes are treated as unknown if their coordinates do not continue those of their
//! neighbours.

use std::collections::VecDeque;

use glam::DVec2;

use super::mesh::Mesh;

/// Steps to the eight neighbours of a node, in columns and rows.
const STEPS: [[isize; 2]; 8] = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]];
/// Coordinates continue those of neighbours if they deviate by at most this from the extrapolated coordinates. The deviation is relative to the
/// distance of the neighbours.
const CONTINUES_WITHIN: f64 = 0.5;

/// The places of a lattice's nodes, row by row.
struct Lattice {
    contents: Vec<DVec2>,
    columns: usize,
    rows: usize,
}

impl Lattice {
    fn stepped(&self, node: usize, [across, down]: [isize; 2], times: isize) -> Option<usize> {
        let column = (node % self.columns).checked_add_signed(across * times).filter(|at| *at < self.columns)?;
        let row = (node / self.columns).checked_add_signed(down * times).filter(|at| *at < self.rows)?;
        Some(row * self.columns + column)
    }

    /// Extrapolates from two or three neighbours in a direction. Returns the order of the extrapolation, the position in the content and its
    /// tolerance.
    fn continued(&self, node: usize, step: [isize; 2], trusted: &[bool]) -> Option<(usize, DVec2, f64)> {
        let content = |times: isize| {
            let at = self.stepped(node, step, times).filter(|at| trusted[*at])?;
            Some(self.contents[at])
        };
        let (first, second) = (content(1)?, content(2)?);
        let within = CONTINUES_WITHIN * first.distance(second) + 1e-9;
        Some(match content(3) {
            Some(third) => (2, 3.0 * first - 3.0 * second + third, within),
            None => (1, 2.0 * first - second, within),
        })
    }

    /// Returns the mean of the extrapolations to a node that have the highest order.
    fn extrapolated(&self, node: usize, trusted: &[bool]) -> Option<DVec2> {
        let found: Vec<_> = STEPS.iter().filter_map(|step| self.continued(node, *step, trusted)).collect();
        let most = found.iter().map(|(order, ..)| *order).max()?;
        let best: Vec<DVec2> = found.iter().filter(|(order, ..)| *order == most).map(|(_, at, _)| *at).collect();
        Some(best.iter().sum::<DVec2>() / best.len() as f64)
    }

    /// Returns the nodes whose coordinates are trusted: lit nodes, and nodes whose coordinates continue those of trusted nodes.
    fn trusted(&self, lit: &[bool], has_own: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut trusted = lit.to_vec();
        let mut waiting: VecDeque<usize> = (0..lit.len()).filter(|node| !lit[*node] && has_own(*node)).collect();
        while let Some(node) = waiting.pop_front() {
            let own = self.contents[node];
            let continues = |step: &[isize; 2]| {
                self.continued(node, *step, &trusted).is_some_and(|(_, at, within)| own.distance(at) <= within)
            };
            if trusted[node] || !STEPS.iter().any(continues) {
                continue;
            }
            trusted[node] = true;
            for step in STEPS {
                let near = (1..=3).filter_map(|times| self.stepped(node, step, times));
                waiting.extend(near.filter(|at| !trusted[*at] && has_own(*at)));
            }
        }
        trusted
    }
}

/// Replaces the coordinates of unlit nodes where they are unknown, or marks such nodes as not drawn. Returns the number of these nodes.
pub(super) fn settle(mesh: &mut Mesh, columns: usize, rows: usize) -> usize {
    let lit: Vec<bool> = mesh.nodes.iter().map(|node| node.intensity > 0.0).collect();
    if !lit.contains(&true) || mesh.nodes.iter().all(|node| node.intensity != 0.0) {
        return 0;
    }
    let lattice = Lattice { contents: mesh.nodes.iter().map(|node| node.content).collect(), columns, rows };
    let trusted = lattice.trusted(&lit, |_| true);
    let unknown: Vec<usize> =
        (0..lit.len()).filter(|node| !trusted[*node] && mesh.nodes[*node].intensity == 0.0).collect();
    let settled: Vec<Option<DVec2>> = unknown
        .iter()
        .map(|node| {
            let beside = STEPS.iter().filter_map(|step| lattice.stepped(*node, *step, 1)).any(|at| lit[at]);
            if beside { lattice.extrapolated(*node, &trusted) } else { None }
        })
        .collect();
    for (node, content) in unknown.iter().zip(&settled) {
        match content {
            Some(content) => mesh.nodes[*node].content = *content,
            None => mesh.nodes[*node].intensity = -1.0,
        }
    }
    unknown.len()
}

/// Returns which places outside of a picture are strays. A stray is a placeholder for a missing place, which does not continue the places of its
/// neighbours. `places` has the places of the lattice's nodes, row by row, with `None` for nodes without a place; `inside` marks those in the
/// picture.
pub(super) fn strays(places: &[Option<DVec2>], columns: usize, inside: &[bool]) -> Vec<bool> {
    let contents = places.iter().map(|place| place.unwrap_or_default()).collect();
    let lattice = Lattice { contents, columns, rows: places.len() / columns };
    let trusted = lattice.trusted(inside, |node| places[node].is_some());
    let is_open = |node: &usize| places[*node].is_some() && !trusted[*node];
    // A place is a stray if it contradicts its neighbours. Next to strays, places that cannot be compared with neighbours are also strays.
    let contradicts = |node: &usize| STEPS.iter().any(|step| lattice.continued(*node, *step, &trusted).is_some());
    let mut waiting: Vec<usize> = (0..places.len()).filter(is_open).filter(contradicts).collect();
    let mut strays = vec![false; places.len()];
    while let Some(node) = waiting.pop() {
        if !std::mem::replace(&mut strays[node], true) {
            let beside = STEPS.iter().filter_map(|step| lattice.stepped(node, *step, 1));
            waiting.extend(beside.filter(|at| is_open(at) && !strays[*at]));
        }
    }
    strays
}

#[cfg(test)]
mod tests {
    use super::{super::mesh::Node, *};

    fn mesh(content: impl Fn(DVec2) -> DVec2, intensity: impl Fn(usize, usize) -> f64) -> Mesh {
        let nodes = (0..48).map(|i| {
            let place = DVec2::new((i % 8) as f64, (i / 8) as f64) / 8.0;
            Node { place, content: content(place), intensity: intensity(i % 8, i / 8) }
        });
        Mesh { nodes: nodes.collect(), triangles: Vec::new() }
    }

    #[test]
    fn placeholders_are_replaced_beside_light_and_unknown_elsewhere() {
        let dark = |column: usize, _: usize| if column < 5 { 1.0 } else { 0.0 };
        let smooth = |place: DVec2| place + place * place * 0.1;
        let right = mesh(smooth, dark);
        let mut found = mesh(|place| if place.x > 0.6 { DVec2::new(0.5, 0.3) } else { smooth(place) }, dark);
        assert_eq!(settle(&mut found, 8, 6), 18);
        for (i, (node, right)) in found.nodes.iter().zip(&right.nodes).enumerate() {
            if i % 8 > 5 {
                assert!(node.intensity < 0.0, "{i}");
            } else {
                assert!(node.content.abs_diff_eq(right.content, 1e-12) && node.intensity >= 0.0, "{i}");
            }
        }
    }

    #[test]
    fn unlit_nodes_with_coordinates_of_their_own_stay_as_they_are() {
        let smooth = |place: DVec2| place + place * place * 0.1;
        for dark in [|column: usize, _: usize| (column % 3) as f64, |_: usize, row: usize| (row / 3) as f64, |_, _| 0.0]
        {
            let right = mesh(smooth, dark);
            let mut found = right.clone();
            assert_eq!(settle(&mut found, 8, 6), 0);
            assert_eq!(found.nodes, right.nodes);
        }
    }

    /// Returns the strays among places outside of the unit square, in a lattice of 8 x 6.
    fn strays_of(place: impl Fn(usize, usize) -> Option<DVec2>) -> Vec<bool> {
        let places: Vec<Option<DVec2>> = (0..48).map(|i| place(i % 8, i / 8)).collect();
        let holds = |at: &DVec2| at.min_element() >= 0.0 && at.max_element() <= 1.0;
        let inside: Vec<bool> = places.iter().map(|place| place.is_some_and(|at| holds(&at))).collect();
        strays(&places, 8, &inside)
    }

    #[test]
    fn places_that_continue_beyond_a_picture_are_no_strays() {
        let regular = |column: usize, row: usize| DVec2::new(column as f64, row as f64) * 0.2 - 0.25;
        assert!(!strays_of(|column, row| Some(regular(column, row))).contains(&true));
        // Nothing tests them.
        assert!(!strays_of(|column, row| Some(regular(column, row) * 9.0 - 1.0)).contains(&true));
        assert!(!strays_of(|_, _| None).contains(&true));
    }

    #[test]
    fn marks_of_nodes_without_a_place_are_strays() {
        let regular = |column: usize, row: usize| DVec2::new(column as f64, row as f64) * 0.15;
        let marked = |column: usize, _: usize| column > 3;
        let mark = DVec2::splat(-1.0);
        let found = strays_of(|column, row| Some(if marked(column, row) { mark } else { regular(column, row) }));
        for (node, stray) in found.into_iter().enumerate() {
            assert_eq!(stray, marked(node % 8, node / 8), "{node}");
        }
    }
}

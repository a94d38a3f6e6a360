//! The glare of many sources in f64: sources that are close together compared with their distance from a pixel are treated as one source at their
//! centroid.
//!
//! A node of radius r at distance d represents its sources if r < [`OPENING`] d. Using the centroid cancels the first-order error. For the inverse
//! square, the second-order error is at most 2 <x^2> / d^2 of the node's veil, where <x^2> is the mean square of the offsets along an axis and at
//! most r^2 / 2. This is below 2.5e-3 for a single node, and a tenth of that for nodes with evenly spread sources in all directions. Distances are
//! chords of the unit sphere.

use std::ops::Range;

use glam::DVec3;

use super::{SampledImage, world_direction};
use crate::photometry::glare::{
    GlareKernel,
    split::{ShownCore, angle_of_chord_squared, bump_share},
};

/// Largest ratio of radius to distance at which a node represents its sources.
const OPENING: f64 = 0.05;
/// Square of the chord over which `sky_cube` spreads the light near faint sources that are not drawn individually (its
/// bumps).
const AROUND_SQUARED: f64 = 0.078 * 0.078;
/// Maximum number of sources in a leaf.
const LEAF: usize = 4;

/// A direction for which scattered light is computed.
#[derive(Clone, Copy)]
pub(super) struct Scattered {
    /// Unit vector in world axes; 0 outside of the picture.
    pub(super) direction: DVec3,
    /// The kernel at the resolution of the pixels there.
    shown: Option<ShownCore>,
}

impl Scattered {
    pub(super) fn of_image<'a>(image: &'a SampledImage<'_>) -> impl Iterator<Item = Self> + use<'a> {
        let for_pixel = |pixel: &[u32; 2]| Self {
            direction: world_direction(image, *pixel).unwrap_or(DVec3::ZERO),
            shown: image.shown,
        };
        image.pixels.iter().map(for_pixel)
    }

    fn per_sr(&self, kernel: &dyn GlareKernel, chord_squared: f64) -> f64 {
        match &self.shown {
            Some(shown) => shown.per_sr(kernel, chord_squared),
            None => kernel.per_sr(angle_of_chord_squared(chord_squared)),
        }
    }
}

/// A source of light.
#[derive(Clone, Copy)]
pub(super) struct Source {
    /// Unit vector.
    pub(super) direction: DVec3,
    /// Linear Rec. 709, lx.
    pub(super) rgb_lx: [f64; 3],
    /// Its illuminance if it is too faint to be drawn individually, else 0, lx.
    pub(super) faint_lx: f64,
}

struct Node {
    centroid: DVec3,
    rgb_lx: [f64; 3],
    faint_lx: f64,
    /// Square of the largest chord from the centroid to a source.
    radius_squared: f64,
    sources: Range<usize>,
    /// Index of the node after the last descendant of this one.
    after: usize,
}

/// Sources in a binary tree.
#[derive(Default)]
pub(super) struct VeilTree {
    sources: Vec<Source>,
    /// Each node precedes its descendants.
    nodes: Vec<Node>,
}

impl VeilTree {
    /// Replaces the sources: unit directions, linear Rec. 709 in lx.
    pub(super) fn build(&mut self, sources: impl Iterator<Item = Source>) {
        self.nodes.clear();
        self.sources.clear();
        self.sources.extend(sources);
        if !self.sources.is_empty() {
            self.divide(0..self.sources.len());
        }
    }

    fn divide(&mut self, range: Range<usize>) {
        let sources = &mut self.sources[range.clone()];
        let mut rgb_lx = [0.0; 3];
        let mut faint_lx = 0.0;
        let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for source in sources.iter() {
            (0..3).for_each(|channel| rgb_lx[channel] += source.rgb_lx[channel]);
            faint_lx += source.faint_lx;
            let source_weight: f64 = source.rgb_lx.iter().sum();
            sum += source.direction * source_weight;
            weight += source_weight;
            (least, most) = (least.min(source.direction), most.max(source.direction));
        }
        let centroid = if weight > 0.0 { (sum / weight).normalize_or_zero() } else { sources[0].direction };
        let chord_squared = |source: &Source| source.direction.distance_squared(centroid);
        let radius_squared = sources.iter().map(chord_squared).fold(0.0, f64::max);
        let node = self.nodes.len();
        let middle = sources.len() / 2;
        let is_leaf = sources.len() <= LEAF;
        if !is_leaf {
            let axis = (most - least).max_position();
            sources.select_nth_unstable_by(middle, |a, b| a.direction[axis].total_cmp(&b.direction[axis]));
        }
        self.nodes.push(Node { centroid, rgb_lx, faint_lx, radius_squared, sources: range.clone(), after: node + 1 });
        if !is_leaf {
            self.divide(range.start..range.start + middle);
            self.divide(range.start + middle..range.end);
            self.nodes[node].after = self.nodes.len();
        }
    }

    /// Adds the light that all sources would scatter in a direction if the scattered fraction were 1. Also adds the mean luminance of the faint
    /// sources around this direction. Both are in cd/m^2.
    pub(super) fn add_veil(
        &self,
        kernel: &dyn GlareKernel,
        scattered: &Scattered,
        veil: &mut [f64; 3],
        faint: &mut f64,
    ) {
        let mut add = |rgb_lx: &[f64; 3], faint_lx: f64, chord_squared: f64| {
            let density = scattered.per_sr(kernel, chord_squared);
            (0..3).for_each(|channel| veil[channel] += rgb_lx[channel] * density);
            if chord_squared < AROUND_SQUARED {
                *faint += faint_lx * (1.0 - chord_squared / AROUND_SQUARED).powi(2) / bump_share(AROUND_SQUARED);
            }
        };
        let mut next = 0;
        while let Some(node) = self.nodes.get(next) {
            let chord_squared = node.centroid.distance_squared(scattered.direction);
            if node.radius_squared <= OPENING * OPENING * chord_squared {
                add(&node.rgb_lx, node.faint_lx, chord_squared);
                next = node.after;
            } else {
                if node.after == next + 1 {
                    for source in &self.sources[node.sources.clone()] {
                        add(&source.rgb_lx, source.faint_lx, source.direction.distance_squared(scattered.direction));
                    }
                }
                next += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::photometry::glare::InverseSquareKernel;

    #[test]
    fn the_tree_matches_the_sum_over_sources() {
        let kernel = InverseSquareKernel::new(0.1_f64.to_radians());
        let direction = |i: u32| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 3000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        };
        // Uneven light: the blue channel increases towards +z.
        let sources: Vec<Source> = (0..3000)
            .map(|i| Source {
                direction: direction(i),
                rgb_lx: [f64::from(i % 17), 1.0, (1.0 + direction(i).z).powi(4)],
                faint_lx: 1.0,
            })
            .collect();
        let mut tree = VeilTree::default();
        tree.build(sources.iter().copied());
        for i in 0..40 {
            let scattered = Scattered { direction: (direction(i * 71) + DVec3::splat(0.003)).normalize(), shown: None };
            let mut exact = [0.0; 3];
            for Source { direction, rgb_lx, .. } in &sources {
                let density = kernel.per_sr(angle_of_chord_squared(direction.distance_squared(scattered.direction)));
                (0..3).for_each(|channel| exact[channel] += rgb_lx[channel] * density);
            }
            let (mut found, mut faint) = ([0.0; 3], 0.0);
            tree.add_veil(&kernel, &scattered, &mut found, &mut faint);
            // 3000 lx over the whole sphere.
            assert!((faint / (3000.0 / (4.0 * PI)) - 1.0).abs() < 0.3, "{i}: {faint}");
            for channel in 0..3 {
                assert!((found[channel] / exact[channel] - 1.0).abs() < 1e-3, "{i}: {found:?} {exact:?}");
            }
        }
        tree.build(std::iter::empty());
        let (mut none, mut faint) = ([0.0; 3], 0.0);
        tree.add_veil(&kernel, &Scattered { direction: DVec3::X, shown: None }, &mut none, &mut faint);
        assert_eq!((none, faint), ([0.0; 3], 0.0));
    }
}

//! Degrees of detail in which a part of the sky can be drawn, from composite stars in wide cells to every star.

use super::super::{BUCKET_ORDER, COARSEST_PLANE, LAYERS, PLANES};
use super::page::PageKey;

/// Level of detail in which the stars of a cell of [`BUCKET_ORDER`] are drawn. Every level has the total light of the leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Detail {
    /// Composite stars.
    Composites {
        /// Number of layers that are drawn star by star, the brightest ones of [`LAYERS`]; at least one layer remains.
        leaves: u8,
        /// Order of the cells, from [`COARSEST`] to [`finest_of`] this number of layers.
        order: u8,
    },
    /// Every star.
    Stars,
}

/// Coarsest order of composite stars.
pub const COARSEST: u8 = COARSEST_PLANE;
/// Order of the composite stars that are always in memory.
pub const BASE: u8 = COARSEST;
/// Index of their plane in [`PLANES`].
pub const BASE_PLANE: u8 = plane(0, BASE);

/// Index of the plane that has the light without the `leaves` brightest layers, in cells of an order.
const fn plane(leaves: u8, order: u8) -> u8 {
    let mut index = 0;
    while index < PLANES.len() {
        if PLANES[index].magnitude == LAYERS[leaves as usize].magnitude && PLANES[index].order == order {
            return index as u8;
        }
        index += 1;
    }
    panic!("there is no such plane")
}

/// Finest order of the composite stars that represent the light without the `leaves` brightest layers.
pub const fn finest_of(leaves: u8) -> u8 {
    LAYERS[leaves as usize].order + 4
}

impl Detail {
    /// The composite stars that are always in memory.
    pub const BASE: Self = Self::Composites { leaves: 0, order: BASE };

    /// Returns the detail with the coarsest cells that are not larger than `cell_rad` (the square root of their area), and with at least `leaves`
    /// layers star by star.
    pub fn for_cells(cell_rad: f64, leaves: u8) -> Self {
        let composites = |leaves: u8| {
            let order = (COARSEST..=finest_of(leaves)).find(|order| cell_rad_of(*order) <= cell_rad)?;
            Some(Self::Composites { leaves, order })
        };
        (leaves..LAYERS.len() as u8).find_map(composites).unwrap_or(Self::Stars)
    }

    /// Returns the next coarser detail; `None` for the base. First, fewer layers are drawn star by star; the cells become larger only if the next
    /// plane has no cells of their order. When no layer is left, the cells become larger.
    pub fn coarser(self) -> Option<Self> {
        match self {
            Self::Stars => {
                let leaves = LAYERS.len() as u8 - 1;
                Some(Self::Composites { leaves, order: finest_of(leaves) })
            }
            Self::Composites { leaves: 0, order } => {
                (order > BASE).then(|| Self::Composites { leaves: 0, order: order - 1 })
            }
            Self::Composites { leaves, order } => {
                Some(Self::Composites { leaves: leaves - 1, order: order.min(finest_of(leaves - 1)) })
            }
        }
    }

    /// Returns the coarser of the two numbers of layers, with the coarser of the two orders.
    #[must_use]
    pub fn at_most(self, most: Self) -> Self {
        match (self, most) {
            (detail, Self::Stars) | (Self::Stars, detail) => detail,
            (Self::Composites { leaves, order }, Self::Composites { leaves: most_leaves, order: most_order }) => {
                let leaves = leaves.min(most_leaves);
                Self::Composites { leaves, order: order.min(most_order).min(finest_of(leaves)) }
            }
        }
    }

    /// Square root of the area of its cells, rad; 0 for stars.
    pub fn cell_rad(self) -> f64 {
        match self {
            Self::Composites { order, .. } => cell_rad_of(order),
            Self::Stars => 0.0,
        }
    }

    /// Number of layers that are drawn star by star.
    pub fn leaves(self) -> usize {
        match self {
            Self::Composites { leaves, .. } => usize::from(leaves),
            Self::Stars => LAYERS.len(),
        }
    }

    /// Calls `add` for each page of a cell of [`BUCKET_ORDER`]. Of the layers that are drawn star by star only the first `layers` layers of
    /// [`LAYERS`] are included.
    pub fn pages(self, bucket: u64, layers: usize, mut add: impl FnMut(PageKey)) {
        let plane = match self {
            Self::Composites { leaves, order } => Some(plane(leaves, order)),
            Self::Stars => None,
        };
        let inside = |order: u8| {
            let shift = 2 * (order - BUCKET_ORDER);
            (bucket << shift..(bucket + 1) << shift).map(|cell| cell as u32)
        };
        for (layer, of_layer) in LAYERS.iter().enumerate().take(self.leaves().min(layers)) {
            inside(of_layer.order).for_each(|cell| add(PageKey::Leaf { layer: layer as u8, cell }));
        }
        if let Some(plane) = plane {
            let order = PageKey::Tile { plane, cell: 0 }.order();
            inside(order).for_each(|cell| add(PageKey::Tile { plane, cell }));
        }
    }
}

/// Square root of the area of a cell of an order, rad.
pub fn cell_rad_of(order: u8) -> f64 {
    (std::f64::consts::PI / 3.0).sqrt() / f64::from(1_u32 << order)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All details.
    fn all() -> Vec<Detail> {
        let of_layer =
            |leaves: u8| (COARSEST..=finest_of(leaves)).map(move |order| Detail::Composites { leaves, order });
        (0..3).flat_map(of_layer).chain([Detail::Stars]).collect()
    }

    #[test]
    fn every_detail_has_the_light_of_all_layers_once() {
        for detail in all() {
            let mut layers = [0_u64; 3];
            let mut area = 0.0;
            detail.pages(77, 3, |key| {
                let share = 0.25_f64.powi(i32::from(key.order() - BUCKET_ORDER));
                assert_eq!(key.cell() >> (2 * (key.order() - BUCKET_ORDER)), 77);
                match key {
                    PageKey::Leaf { layer, .. } => layers[usize::from(layer)] += 1,
                    PageKey::Tile { plane, .. } => {
                        area += share;
                        let magnitude = PLANES[usize::from(plane)].magnitude;
                        let brighter = LAYERS.iter().filter(|layer| layer.magnitude < magnitude).count();
                        assert!((0..3).all(|layer| (layers[layer] > 0) == (layer < brighter)), "{detail:?}");
                    }
                }
            });
            assert_eq!(area, if detail == Detail::Stars { 0.0 } else { 1.0 });
            assert!(detail != Detail::Stars || layers == [16, 64, 256]);
        }
    }

    #[test]
    fn the_detail_is_the_coarsest_that_is_fine_enough() {
        let degrees = |order: u8| cell_rad_of(order).to_degrees();
        assert!((degrees(9) - 0.114_5).abs() < 1e-4);
        let composites = |leaves: u8, order: u8| Detail::Composites { leaves, order };
        // The finest cells are available only for the light of fainter stars.
        let fitting = [(7, 0), (8, 0), (9, 0), (10, 0), (11, 1), (12, 2)];
        for (order, leaves) in fitting {
            assert_eq!(Detail::for_cells(cell_rad_of(order), 0), composites(leaves, order));
        }
        assert_eq!(Detail::for_cells(0.99 * cell_rad_of(10), 0), composites(1, 11));
        assert_eq!(Detail::for_cells(0.99 * cell_rad_of(12), 0), Detail::Stars);
        // Bright layers are drawn star by star, independent of the size of the cells.
        assert_eq!(Detail::for_cells(cell_rad_of(9), 2), composites(2, 9));
        assert_eq!(Detail::for_cells(cell_rad_of(9), 3), Detail::Stars);
    }

    #[test]
    fn coarser_details_end_at_the_base_and_none_is_finer_than_its_limit() {
        for detail in all() {
            let mut coarser = detail;
            while let Some(next) = coarser.coarser() {
                assert!(next.leaves() <= coarser.leaves() && next.cell_rad() >= coarser.cell_rad(), "{next:?}");
                assert_eq!(coarser.at_most(next), next);
                coarser = next;
            }
            assert_eq!(coarser, Detail::BASE);
            for most in all() {
                let found = detail.at_most(most);
                assert!(found.leaves() <= most.leaves() && found.cell_rad() >= most.cell_rad(), "{detail:?} {most:?}");
                assert_eq!(found, most.at_most(detail));
            }
        }
    }
}

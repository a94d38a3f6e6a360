//! Degrees of detail in which a part of the sky can be drawn, from composite stars in wide cells to every star.

use super::super::{BUCKET_ORDER, COARSEST_PLANE, LAYERS, PLANES};
use super::page::PageKey;

/// Detail in which the stars of a cell of [`BUCKET_ORDER`] are drawn. Each has all the light of the leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Detail {
    /// Composite stars in cells of this order, 7 to 12. From order 11 on, the brighter layers are drawn star by star.
    Composites(u8),
    /// Every star.
    Stars,
}

/// Coarsest order of composite stars.
pub const COARSEST: u8 = COARSEST_PLANE;
/// Finest order.
pub const FINEST: u8 = 12;
/// Order of the composite stars that are always in memory.
pub const BASE: u8 = COARSEST;
/// Index of their plane in [`PLANES`].
pub(super) const BASE_PLANE: u8 = plane(13, BASE);

/// Index of the plane of a magnitude and an order.
const fn plane(magnitude: u8, order: u8) -> u8 {
    let mut index = 0;
    while index < PLANES.len() {
        if PLANES[index].magnitude == magnitude && PLANES[index].order == order {
            return index as u8;
        }
        index += 1;
    }
    panic!("there is no such plane")
}

/// Plane and layers of an order: the number of layers that are drawn star by star, and the plane with the rest of the light.
fn parts(order: u8) -> (usize, u8) {
    match order {
        ..=10 => (0, plane_of(order)),
        11 => (1, plane(15, 11)),
        _ => (2, plane(17, 12)),
    }
}

fn plane_of(order: u8) -> u8 {
    const PLANE_13: [u8; 4] = [plane(13, 7), plane(13, 8), plane(13, 9), plane(13, 10)];
    PLANE_13[usize::from(order.clamp(COARSEST, 10) - COARSEST)]
}

impl Detail {
    /// The composite stars that are always in memory.
    pub const BASE: Self = Self::Composites(BASE);

    /// Detail of the coarsest cells that are not larger than `cell_rad` (the root of their area).
    pub fn for_cells(cell_rad: f64) -> Self {
        (COARSEST..=FINEST).find(|order| cell_rad_of(*order) <= cell_rad).map_or(Self::Stars, Self::Composites)
    }

    /// The next coarser detail; `None` below the base.
    pub fn coarser(self) -> Option<Self> {
        match self {
            Self::Stars => Some(Self::Composites(FINEST)),
            Self::Composites(order) if order > BASE => Some(Self::Composites(order - 1)),
            Self::Composites(_) => None,
        }
    }

    /// The root of the area of its cells, rad; 0 for stars.
    pub fn cell_rad(self) -> f64 {
        match self {
            Self::Composites(order) => cell_rad_of(order),
            Self::Stars => 0.0,
        }
    }

    /// Calls `add` for each page of a cell of [`BUCKET_ORDER`]; only the first `layers` layers of [`LAYERS`] are drawn star by star, if their stars are.
    pub fn pages(self, bucket: u64, layers: usize, mut add: impl FnMut(PageKey)) {
        let (leaves, plane) = match self {
            Self::Composites(order) => {
                let (leaves, plane) = parts(order);
                (leaves, Some(plane))
            }
            Self::Stars => (LAYERS.len(), None),
        };
        let inside = |order: u8| {
            let shift = 2 * (order - BUCKET_ORDER);
            (bucket << shift..(bucket + 1) << shift).map(|cell| cell as u32)
        };
        for (layer, of_layer) in LAYERS.iter().enumerate().take(leaves.min(layers)) {
            inside(of_layer.order).for_each(|cell| add(PageKey::Leaf { layer: layer as u8, cell }));
        }
        if let Some(plane) = plane {
            let order = PageKey::Tile { plane, cell: 0 }.order();
            inside(order).for_each(|cell| add(PageKey::Tile { plane, cell }));
        }
    }
}

/// The root of the area of a cell of an order, rad.
pub fn cell_rad_of(order: u8) -> f64 {
    (std::f64::consts::PI / 3.0).sqrt() / f64::from(1_u32 << order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_detail_has_the_light_of_all_layers_once() {
        let all = [7, 8, 9, 10, 11, 12].map(Detail::Composites).into_iter().chain([Detail::Stars]);
        for detail in all {
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
        for order in COARSEST..=FINEST {
            assert_eq!(Detail::for_cells(cell_rad_of(order)), Detail::Composites(order));
            let finer = if order == FINEST { Detail::Stars } else { Detail::Composites(order + 1) };
            assert_eq!(Detail::for_cells(cell_rad_of(order) * 0.99), finer);
            assert_eq!(finer.coarser(), Some(Detail::Composites(order)));
        }
    }
}

//! The form in which the cache keeps a table: numbers, then nodes, cells and patches.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::{
    Tables,
    bake::Baked,
    check::TableAccuracy,
    nodes::{Nodes, node_counts},
    starts::Starts,
};
use crate::cache::{self, Form, Part};

/// The tables that [`super::tables`] bakes.
pub(super) const PART: Part = Part { name: "projector-table", version: 3 };

/// Bytes of the tables of a mapping.
pub(super) const FORM: Form<Tables> = Form { to_bytes, from_bytes };

/// The numbers of [`Baked`], [`Starts`] and [`TableAccuracy`], and the lengths of the lists.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Numbers {
    size: [u32; 2],
    side: u32,
    unused: u32,
    lengths: [u64; 3],
    pixels: u64,
    sum_sr: f64,
    least_sr: f64,
    longer_rad: [f64; 2],
    shortest_rad: f64,
    axis: [f64; 3],
    reach_rad: [f64; 2],
    grid: [[f64; 3]; 3],
    scale: f64,
    accuracy_px: [f64; 2],
}

fn to_bytes(Tables { baked, starts, accuracy }: &Tables) -> Vec<u8> {
    let Baked { nodes, pixels, sum_sr, least_sr, longer_rad, shortest_rad, axis, reach_rad } = baked;
    let Starts { side, axis: column, right, up, scale, cells, patches } = starts;
    let numbers = Numbers {
        size: nodes.size,
        side: *side,
        unused: 0,
        lengths: [nodes.values.len(), cells.len(), patches.len()].map(|length| length as u64),
        pixels: *pixels,
        sum_sr: *sum_sr,
        least_sr: *least_sr,
        longer_rad: *longer_rad,
        shortest_rad: *shortest_rad,
        axis: axis.to_array(),
        reach_rad: *reach_rad,
        grid: [column, right, up].map(DVec3::to_array),
        scale: *scale,
        accuracy_px: [accuracy.smooth_px, accuracy.kink_px],
    };
    let mut bytes = bytemuck::bytes_of(&numbers).to_vec();
    bytes.extend_from_slice(bytemuck::cast_slice(&nodes.values));
    bytes.extend_from_slice(bytemuck::cast_slice(cells));
    bytes.extend_from_slice(bytemuck::cast_slice(patches));
    bytes
}

fn from_bytes(bytes: &[u8]) -> Option<Tables> {
    let (numbers, lists) = bytes.split_at_checked(size_of::<Numbers>())?;
    let numbers: Numbers = bytemuck::pod_read_unaligned(numbers);
    let lengths = numbers.lengths.map(usize::try_from);
    let [Ok(nodes), Ok(cells), Ok(patches)] = lengths else { return None };
    let (nodes, lists) = lists.split_at_checked(nodes.checked_mul(16)?)?;
    let (cells, lists) = lists.split_at_checked(cells.checked_mul(16)?)?;
    let (patches, rest) = lists.split_at_checked(patches.checked_mul(8)?)?;
    let nodes = Nodes { size: numbers.size, values: cache::values(nodes)? };
    let cells: Vec<[u32; 4]> = cache::values(cells)?;
    let [columns, rows] = node_counts(numbers.size);
    let complete = columns * rows == nodes.values.len() as i64 && u64::from(numbers.side).pow(2) == cells.len() as u64;
    if !complete || !rest.is_empty() {
        return None;
    }
    let [axis, right, up] = numbers.grid.map(DVec3::from_array);
    let [smooth_px, kink_px] = numbers.accuracy_px;
    Some(Tables {
        baked: Baked {
            nodes,
            pixels: numbers.pixels,
            sum_sr: numbers.sum_sr,
            least_sr: numbers.least_sr,
            longer_rad: numbers.longer_rad,
            shortest_rad: numbers.shortest_rad,
            axis: DVec3::from_array(numbers.axis),
            reach_rad: numbers.reach_rad,
        },
        starts: Starts {
            side: numbers.side,
            axis,
            right,
            up,
            scale: numbers.scale,
            cells,
            patches: cache::values(patches)?,
        },
        accuracy: TableAccuracy { smooth_px, kink_px },
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::{super::TabulatedMapping, *};
    use crate::view::projection::{Fisheye, FisheyeMapping};

    #[test]
    fn a_table_survives_its_bytes_and_incomplete_ones_are_refused() {
        let fisheye = Fisheye::new([48, 48], FisheyeMapping::Equidistant, 360_f64.to_radians()).unwrap();
        let table = TabulatedMapping::new(fisheye).unwrap();
        let (words, accuracy) = (table.words(), table.accuracy());
        let TabulatedMapping { source, baked, starts, accuracy: found, .. } = table;
        let bytes = to_bytes(&Tables { baked, starts, accuracy: found });
        let again = TabulatedMapping::with_tables(source, from_bytes(&bytes).unwrap(), None);
        assert!(again.words() == words);
        assert_eq!(again.accuracy(), accuracy);
        assert_eq!(to_bytes(&Tables { baked: again.baked, starts: again.starts, accuracy }), bytes);
        for length in [0, size_of::<Numbers>() - 1, size_of::<Numbers>(), bytes.len() - 8, bytes.len() - 1] {
            assert!(from_bytes(&bytes[..length]).is_none(), "{length} bytes");
        }
        let mut other_size = bytes.clone();
        other_size[0] += 1;
        assert!(from_bytes(&other_size).is_none());
        assert!(from_bytes(&[&bytes[..], &[0; 8]].concat()).is_none());
    }

    #[test]
    fn equal_inputs_share_a_mapping_while_it_exists() {
        let fisheye = || Fisheye::new([24, 24], FisheyeMapping::Equidistant, 2.0).unwrap();
        let kept = |inputs: &[u8]| TabulatedMapping::kept(fisheye(), inputs).unwrap();
        let first = kept(b"shared");
        assert_eq!(first, kept(b"shared"));
        assert_ne!(first, kept(b"other"));
        let weak = std::sync::Arc::downgrade(&first);
        drop(first);
        assert!(weak.upgrade().is_none(), "the list keeps no mapping alive");
        kept(b"shared");
    }
}

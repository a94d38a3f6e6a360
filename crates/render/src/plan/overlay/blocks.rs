//! Items by blocks of pixels, so that each pixel evaluates few of them.

use super::{Item, Shape};
use crate::view::Viewport;

/// Side of a block, pixels.
pub const BLOCK_PX: u32 = 16;

/// A block of pixels of an image with the items that may cover part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Index of the viewport.
    pub viewport: u32,
    /// Column and row of its first pixel: multiples of [`BLOCK_PX`].
    pub corner: [u32; 2],
    /// Index of its first entry.
    pub first_entry: u32,
    /// Number of its entries.
    pub entries: u32,
}

/// Blocks with items, viewport by viewport and row by row, and the items of each in order.
pub fn sort_into_blocks(items: &[Item], first_items: &[usize], viewports: &[Viewport]) -> (Vec<Block>, Vec<u32>) {
    let (mut blocks, mut entries) = (Vec::new(), Vec::new());
    for (number, viewport) in viewports.iter().enumerate() {
        let [columns, rows] = viewport.size().map(|side| side.div_ceil(BLOCK_PX));
        let range = first_items[number]..first_items[number + 1];
        // First count the entries of each block, then store them.
        let mut counts = vec![0_u32; (columns * rows) as usize];
        for item in &items[range.clone()] {
            touched(&item.shape, [columns, rows], &mut |block| counts[block] += 1);
        }
        let mut next = Vec::with_capacity(counts.len());
        for (index, &count) in counts.iter().enumerate() {
            let first_entry = entries.len() as u32;
            next.push(entries.len());
            entries.resize(entries.len() + count as usize, 0);
            if count > 0 {
                let corner = [index as u32 % columns * BLOCK_PX, index as u32 / columns * BLOCK_PX];
                blocks.push(Block { viewport: number as u32, corner, first_entry, entries: count });
            }
        }
        for index in range {
            touched(&items[index].shape, [columns, rows], &mut |block| {
                entries[next[block]] = index as u32;
                next[block] += 1;
            });
        }
    }
    (blocks, entries)
}

/// Calls `visit` once for each block that a shape may cover.
fn touched(shape: &Shape, [columns, rows]: [u32; 2], visit: &mut dyn FnMut(usize)) {
    let side = f64::from(BLOCK_PX);
    let block = |pixel: f64, count: u32| (pixel / side).floor().clamp(-1.0, f64::from(count)) as i64;
    let mut run = |row: i64, from_px: f64, to_px: f64| {
        for column in block(from_px, columns).max(0)..=block(to_px, columns).min(i64::from(columns) - 1) {
            visit((row * i64::from(columns) + column) as usize);
        }
    };
    match *shape {
        Shape::Line { from, to, half_width_px, .. } => {
            // Slightly more than the reach of the coverage: a margin for f32 rounding.
            let reach = half_width_px + 0.6;
            let (top, bottom) = if from.y <= to.y { (from, to) } else { (to, from) };
            let [first, last] = [top.y - reach, bottom.y + reach].map(|y| block(y, rows));
            for row in first.max(0)..=last.min(i64::from(rows) - 1) {
                let band = [row as f64 * side - reach, (row + 1) as f64 * side + reach];
                // The section of the line within the rows of the block.
                let column_at = |y: f64| {
                    let height = bottom.y - top.y;
                    let part = if height > 0.0 { ((y - top.y) / height).clamp(0.0, 1.0) } else { 0.0 };
                    top.x + (bottom.x - top.x) * part
                };
                let ends =
                    if bottom.y - top.y > 1e-9 { [column_at(band[0]), column_at(band[1])] } else { [top.x, bottom.x] };
                run(row, ends[0].min(ends[1]) - reach, ends[0].max(ends[1]) + reach);
            }
        }
        Shape::Box { from, to, .. } | Shape::Picture { from, to, .. } => boxed(from, to, rows, &mut run),
        Shape::Glyph { from, size, .. } => {
            boxed(from, [from[0] + size[0] as i32, from[1] + size[1] as i32], rows, &mut run);
        }
    }
}

fn boxed(from: [i32; 2], to: [i32; 2], rows: u32, run: &mut dyn FnMut(i64, f64, f64)) {
    if from[0] >= to[0] || from[1] >= to[1] {
        return;
    }
    let side = i64::from(BLOCK_PX);
    let first = i64::from(from[1]).div_euclid(side).max(0);
    let last = i64::from(to[1] - 1).div_euclid(side).min(i64::from(rows) - 1);
    for row in first..=last {
        run(row, f64::from(from[0]), f64::from(to[0] - 1));
    }
}

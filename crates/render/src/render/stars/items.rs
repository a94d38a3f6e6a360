//! Items: runs of stars, each with the set of tiles into which the passes over stars draw it, and their bindings.
//!
//! No shader: encodes the result of culling.
//! No twin: encodes the result of culling.

use glam::DVec3;
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{buffers::StarBuffers, pages::PagePlace};
use crate::{
    catalogue::{chunks::Chunk, deep::live::PageKey, packed::PackedStar},
    gpu::{Gpu, GrowingBuffer, bind_buffers},
    plan::{
        stars::{
            cull::{VisibleChunk, near_stars},
            deep::VisiblePage,
        },
        tiles::Batch,
    },
    render::{
        constants::star_forms::{COMPOSITES_OF_PAGE, STARS_AT_INFINITY, STARS_IN_SPACE, STARS_OF_PAGE},
        stars::layout,
    },
};

/// Maximum number of stars per workgroup.
const ITEM_STARS: u32 = 1024;
/// Runs of items begin at multiples of this number, so that binding offsets are aligned.
const ITEM_ALIGNMENT: usize = 8;

/// Run of items that read from one buffer of stars.
pub(crate) struct StarDraw<'a> {
    pub stars: &'a wgpu::Buffer,
    pub items: &'a wgpu::Buffer,
    /// Index of the first item; a multiple of [`ITEM_ALIGNMENT`].
    pub first_item: u64,
    pub item_count: u32,
    /// Stars of the run.
    pub kind: StarKind,
}

/// Stars that are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StarKind {
    /// Stars of chunks.
    Chunks,
    /// Stars of chunks that are also in the map of faint light: [`crate::plan::smooth_light::caps`].
    Caps,
    /// Stars of pages of a deep store.
    Pages,
}

/// Returns the bind group of stars and their items, the same for every pass over items.
pub(crate) fn bind_items(gpu: &Gpu, pipeline: &wgpu::ComputePipeline, draw: &StarDraw<'_>) -> wgpu::BindGroup {
    let items = wgpu::BufferBinding {
        buffer: draw.items,
        offset: draw.first_item * size_of::<layout::StarItem>() as u64,
        size: wgpu::BufferSize::new(u64::from(draw.item_count) * size_of::<layout::StarItem>() as u64),
    };
    bind_buffers(gpu, pipeline, 1, &[(0, draw.stars.as_entire_binding()), (1, wgpu::BindingResource::Buffer(items))])
}

/// Buffer that the items of a run read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ItemSource {
    /// Near stars, relative to the camera.
    Near,
    /// A segment of the buffers of the run's kind.
    Segment(usize),
}

/// Run of items of one batch that read from one buffer of stars.
pub(super) struct ItemRun {
    /// Index of the batch.
    pub batch: usize,
    /// Stars of the run.
    pub kind: StarKind,
    /// The stars.
    pub source: ItemSource,
    /// First item.
    pub first_item: u64,
    /// Number of items.
    pub item_count: u32,
}

impl ItemRun {
    /// Draws this run, from the stars of its source and the items of its batch.
    pub(super) fn draw<'a>(&self, stars: &'a wgpu::Buffer, items: &'a wgpu::Buffer) -> StarDraw<'a> {
        StarDraw { stars, items, first_item: self.first_item, item_count: self.item_count, kind: self.kind }
    }
}

/// Items of all batches, in one buffer.
#[derive(Default)]
pub(super) struct Items {
    pub items: Vec<layout::StarItem>,
    pub runs: Vec<ItemRun>,
    /// Near stars, relative to the camera.
    pub near: Vec<PackedStar>,
}

/// If there are at most this many stars, each item of a shuffled order holds one star, so that every order is possible.
const SINGLE_STARS: u64 = 1 << 16;

/// Adds the items of visible chunks. With a seed the items are shuffled; each holds a single star, or many stars if more than [`SINGLE_STARS`] are
/// visible. A star keeps its number within the set.
pub(super) fn push_chunks(
    Items { items, runs, near }: &mut Items,
    kind: StarKind,
    buffers: &StarBuffers,
    visible: &[VisibleChunk],
    batches: &[Batch],
    order: Option<u64>,
) {
    let set = &*buffers.set;
    let visible_stars: u64 = visible.iter().map(|chunk| u64::from(chunk.count)).sum();
    let most = if order.is_some() && visible_stars <= SINGLE_STARS { 1 } else { ITEM_STARS };
    let mut random = order.map(ChaCha8Rng::seed_from_u64);
    // Near stars, relative to the camera, for all batches.
    let mut near_first = Vec::new();
    for chunk in visible.iter().filter(|chunk| chunk.near) {
        near_first.push(near.len() as u32);
        near.extend(
            near_stars(set, &set.chunks[chunk.chunk], chunk.origin_pc)
                .map(|(place, star)| PackedStar { offset_pc: place.as_vec3().to_array(), light: star.light }),
        );
    }
    // Items of each batch, segment by segment, then those of the near stars.
    for (batch_index, batch) in batches.iter().enumerate() {
        let tiles_of = tiles_of(batch);
        let mut far = visible.iter().filter(|chunk| !chunk.near).peekable();
        for (segment_index, segment) in buffers.segments.iter().enumerate() {
            let first_item = items.len();
            while let Some(chunk) = far.next_if(|chunk| chunk.chunk < segment.end_chunk) {
                let stars = &set.chunks[chunk.chunk];
                push_items(
                    items,
                    chunk,
                    stars,
                    stars.first - segment.first_star,
                    chunk.origin_pc,
                    tiles_of(chunk.viewports),
                    most,
                );
            }
            shuffle(&mut items[first_item..], &mut random);
            close_run(items, runs, (batch_index, kind), ItemSource::Segment(segment_index), first_item);
        }
        let first_item = items.len();
        for (chunk, first) in visible.iter().filter(|chunk| chunk.near).zip(&near_first) {
            push_items(items, chunk, &set.chunks[chunk.chunk], *first, DVec3::ZERO, tiles_of(chunk.viewports), most);
        }
        shuffle(&mut items[first_item..], &mut random);
        close_run(items, runs, (batch_index, kind), ItemSource::Near, first_item);
    }
}

/// Returns the tiles of a set of viewports in a batch.
fn tiles_of(batch: &Batch) -> impl Fn(u64) -> u32 + use<> {
    let mut tiles_of_viewport = [0_u32; 64];
    for (index, tile) in batch.tiles.iter().enumerate() {
        tiles_of_viewport[tile.viewport] |= 1 << index;
    }
    move |viewports: u64| {
        let mut remaining = viewports;
        let mut tiles = 0;
        while remaining != 0 {
            tiles |= tiles_of_viewport[remaining.trailing_zeros() as usize];
            remaining &= remaining - 1;
        }
        tiles
    }
}

/// Adds the items of the pages of a deep store. `places` are the places of the pages in `segments` buffers.
pub(super) fn push_pages(
    Items { items, runs, .. }: &mut Items,
    visible: &[VisiblePage],
    places: &[PagePlace],
    segments: usize,
    batches: &[Batch],
) {
    for (batch_index, batch) in batches.iter().enumerate() {
        let tiles_of = tiles_of(batch);
        for segment in 0..segments {
            let first_item = items.len();
            for (VisiblePage { page, viewports, count }, place) in visible.iter().zip(places) {
                let tiles = tiles_of(*viewports);
                if place.segment != segment || tiles == 0 {
                    continue;
                }
                let numbers = first_number(page.key);
                for start in (0..*count).step_by(ITEM_STARS as usize) {
                    items.push(layout::StarItem {
                        origin: page.centre.to_array(),
                        first: place.first + start,
                        count: (*count - start).min(ITEM_STARS),
                        tiles,
                        first_number: numbers.wrapping_add(start),
                        form: if page.key.is_composite() { COMPOSITES_OF_PAGE } else { STARS_OF_PAGE },
                    });
                }
            }
            close_run(items, runs, (batch_index, StarKind::Pages), ItemSource::Segment(segment), first_item);
        }
    }
}

/// Returns the number of the first star of a page. The rounding of stars derives from it. It depends only on the leaf or tile.
fn first_number(key: PageKey) -> u32 {
    let part = match key {
        PageKey::Leaf { layer, .. } => u32::from(layer),
        PageKey::Tile { plane, .. } => 3 + u32::from(plane),
    };
    (key.cell() as u32).wrapping_mul(0x9E37_79B1).rotate_left(part) ^ part.wrapping_mul(0x85EB_CA6B)
}

fn push_items(
    items: &mut Vec<layout::StarItem>,
    visible: &VisibleChunk,
    chunk: &Chunk,
    first_in_buffer: u32,
    origin_pc: DVec3,
    tiles: u32,
    most: u32,
) {
    if tiles == 0 {
        return;
    }
    let mut start = 0;
    while start < visible.count {
        let count = (visible.count - start).min(most);
        items.push(layout::StarItem {
            origin: origin_pc.as_vec3().to_array(),
            first: first_in_buffer + start,
            count,
            tiles,
            first_number: chunk.first + start,
            form: if chunk.at_infinity { STARS_AT_INFINITY } else { STARS_IN_SPACE },
        });
        start += count;
    }
}

fn shuffle(items: &mut [layout::StarItem], random: &mut Option<ChaCha8Rng>) {
    if let Some(random) = random {
        items.shuffle(random);
    }
}

fn close_run(
    items: &mut Vec<layout::StarItem>,
    runs: &mut Vec<ItemRun>,
    (batch, kind): (usize, StarKind),
    source: ItemSource,
    first_item: usize,
) {
    let item_count = (items.len() - first_item) as u32;
    if item_count > 0 {
        runs.push(ItemRun { batch, kind, source, first_item: first_item as u64, item_count });
        items.resize(items.len().next_multiple_of(ITEM_ALIGNMENT), layout::StarItem::default());
    }
}

/// Buffers of items and near stars, kept from frame to frame.
pub(super) struct ItemBuffers {
    pub items: GrowingBuffer,
    pub near: GrowingBuffer,
}

impl ItemBuffers {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self { items: GrowingBuffer::new("star items", usage), near: GrowingBuffer::new("near stars", usage) }
    }
}

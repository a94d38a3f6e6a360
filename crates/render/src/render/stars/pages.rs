//! Pages of a deep store in GPU buffers: uploaded when a frame first draws them, and kept up to a limit.
//!
//! No shader: holds buffers.
//! No twin: holds buffers.

use std::collections::{BTreeMap, HashMap};

use crate::{
    catalogue::deep::live::{Page, PageStar},
    gpu::Gpu,
    plan::stars::deep::{DeepPlan, VisiblePage},
};

/// Number of stars of a buffer, unless a page has more.
const SEGMENT_STARS: u32 = 1 << 20;

/// Place of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PagePlace {
    /// Index of its buffer.
    pub segment: usize,
    /// Index of its first star in the buffer.
    pub first: u32,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    place: PagePlace,
    count: u32,
    /// Number of the last frame that drew it.
    used: u64,
}

/// A buffer and its free runs: the length of each run, by its first star. Neighbouring runs are joined.
struct Segment {
    buffer: wgpu::Buffer,
    free: BTreeMap<u32, u32>,
}

/// Takes the first run that is long enough.
fn take(free: &mut BTreeMap<u32, u32>, count: u32) -> Option<u32> {
    let (first, length) = free.iter().find(|(_, length)| **length >= count).map(|(first, length)| (*first, *length))?;
    free.remove(&first);
    if length > count {
        free.insert(first + count, length - count);
    }
    Some(first)
}

/// Gives a run back.
fn give_back(free: &mut BTreeMap<u32, u32>, first: u32, count: u32) {
    let (mut first, mut count) = (first, count);
    if let Some(length) = free.remove(&(first + count)) {
        count += length;
    }
    if let Some((before, length)) = free.range(..first).next_back().map(|(before, length)| (*before, *length))
        && before + length == first
    {
        (first, count) = (before, count + length);
    }
    free.insert(first, count);
}

/// Pages in buffers.
#[derive(Default)]
pub(super) struct PageBuffers {
    segments: Vec<Segment>,
    held: HashMap<u64, Held>,
    frame: u64,
}

impl PageBuffers {
    /// Uploads the pages of a frame that are not held yet, and returns the place of each.
    pub(super) fn hold(&mut self, gpu: &Gpu, plan: &DeepPlan) -> Vec<PagePlace> {
        self.frame += 1;
        if plan.visible.is_empty() {
            return Vec::new();
        }
        for VisiblePage { page, .. } in &plan.visible {
            if let Some(held) = self.held.get_mut(&page.id) {
                held.used = self.frame;
            }
        }
        let missing: u64 = plan
            .visible
            .iter()
            .map(|visible| &visible.page)
            .filter(|page| !self.held.contains_key(&page.id))
            .map(|page| page.stars.len() as u64)
            .sum();
        self.make_room(missing, plan.device_bytes / size_of::<PageStar>() as u64);
        plan.visible.iter().map(|visible| self.place(gpu, &visible.page)).collect()
    }

    fn place(&mut self, gpu: &Gpu, page: &Page) -> PagePlace {
        if let Some(held) = self.held.get(&page.id) {
            return held.place;
        }
        let count = page.stars.len() as u32;
        let place = self.free_place(gpu, count);
        let offset = u64::from(place.first) * size_of::<PageStar>() as u64;
        gpu.queue.write_buffer(&self.segments[place.segment].buffer, offset, bytemuck::cast_slice(&page.stars));
        self.held.insert(page.id, Held { place, count, used: self.frame });
        place
    }

    fn free_place(&mut self, gpu: &Gpu, count: u32) -> PagePlace {
        for (segment, Segment { free, .. }) in self.segments.iter_mut().enumerate() {
            if let Some(first) = take(free, count) {
                return PagePlace { segment, first };
            }
        }
        let stars = SEGMENT_STARS.max(count);
        let buffer = gpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some("deep stars"),
            size: u64::from(stars) * size_of::<PageStar>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut free = BTreeMap::from([(0, stars)]);
        let first = take(&mut free, count).unwrap_or(0);
        self.segments.push(Segment { buffer, free });
        PagePlace { segment: self.segments.len() - 1, first }
    }

    /// Removes the pages that were not drawn for the longest time, until this number of stars fits in addition to the remaining pages. Pages of this
    /// frame stay.
    fn make_room(&mut self, stars: u64, limit: u64) {
        let mut held: u64 = self.held.values().map(|held| u64::from(held.count)).sum();
        if held + stars <= limit {
            return;
        }
        let mut oldest: Vec<(u64, u64)> = self.held.iter().map(|(id, held)| (held.used, *id)).collect();
        oldest.sort_unstable();
        for (used, id) in oldest {
            if held + stars <= limit || used == self.frame {
                break;
            }
            if let Some(Held { place, count, .. }) = self.held.remove(&id) {
                give_back(&mut self.segments[place.segment].free, place.first, count);
                held -= u64::from(count);
            }
        }
    }

    pub(super) fn buffer(&self, segment: usize) -> &wgpu::Buffer {
        &self.segments[segment].buffer
    }

    /// Returns the number of buffers.
    pub(super) fn segments(&self) -> usize {
        self.segments.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_taken_and_joined_again() {
        let mut free = BTreeMap::from([(0, 100)]);
        let places: Vec<u32> = [10, 20, 30].map(|count| take(&mut free, count).unwrap()).to_vec();
        assert_eq!(places, [0, 10, 30]);
        assert_eq!(take(&mut free, 41), None);
        give_back(&mut free, 10, 20);
        assert_eq!(free, BTreeMap::from([(10, 20), (60, 40)]));
        assert_eq!(take(&mut free, 5), Some(10));
        give_back(&mut free, 10, 5);
        give_back(&mut free, 30, 30);
        assert_eq!(free, BTreeMap::from([(10, 90)]));
        give_back(&mut free, 0, 10);
        assert_eq!(free, BTreeMap::from([(0, 100)]));
    }
}

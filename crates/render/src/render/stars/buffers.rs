//! Stars of a scene in GPU buffers.
//!
//! No shader: holds buffers.
//! No twin: holds buffers.

use std::sync::Arc;

use crate::{
    catalogue::{
        chunks::{Chunk, StarSet},
        packed::PackedStar,
    },
    gpu::{Gpu, storage_buffer},
};

/// Run of whole chunks in one buffer, small enough for a binding.
pub(super) struct Segment {
    buffer: wgpu::Buffer,
    /// End of the chunk range in this buffer, which begins at the end of the previous segment.
    pub(super) end_chunk: usize,
    pub(super) first_star: u32,
}

/// Stars of one scene on the GPU.
pub(super) struct StarBuffers {
    pub(super) set: Arc<StarSet>,
    pub(super) segments: Vec<Segment>,
}

impl StarBuffers {
    pub(super) fn new(gpu: &Gpu, set: Arc<StarSet>) -> Self {
        let fitting = (gpu.max_binding_bytes() / size_of::<PackedStar>() as u64) as usize;
        let mut segments = Vec::new();
        let mut start = 0;
        while start < set.chunks.len() {
            let first_star = set.chunks[start].first;
            let end_of = |chunk: &Chunk| (chunk.first + chunk.count - first_star) as usize;
            let length = set.chunks[start..].partition_point(|chunk| end_of(chunk) <= fitting);
            let end_chunk = start + length;
            let last = &set.chunks[end_chunk - 1];
            let stars = &set.stars[first_star as usize..(last.first + last.count) as usize];
            segments.push(Segment { buffer: storage_buffer(gpu, "stars", stars), end_chunk, first_star });
            start = end_chunk;
        }
        Self { set, segments }
    }

    /// Whether these buffers hold the stars of `set`.
    pub(super) fn holds(&self, set: &Arc<StarSet>) -> bool {
        Arc::ptr_eq(&self.set, set)
    }

    pub(super) fn buffer(&self, segment: usize) -> &wgpu::Buffer {
        &self.segments[segment].buffer
    }
}

//! Buffers that grow on demand, and the transfer of results to the host.

use bytemuck::{NoUninit, Pod};

use super::{Gpu, GpuError};

/// Creates a storage buffer filled with `data`, without a staging copy.
pub(crate) fn storage_buffer<T: NoUninit>(gpu: &Gpu, label: &str, data: &[T]) -> wgpu::Buffer {
    filled_buffer(gpu, label, data, wgpu::BufferUsages::STORAGE)
}

/// Creates a uniform buffer filled with `data`.
pub(crate) fn uniform_buffer<T: NoUninit>(gpu: &Gpu, label: &str, data: &T) -> wgpu::Buffer {
    filled_buffer(gpu, label, std::slice::from_ref(data), wgpu::BufferUsages::UNIFORM)
}

/// Creates a uniform buffer for a list that shaders declare with `capacity` items. It begins with `items`; the rest is zero.
pub(crate) fn uniform_list<T: NoUninit>(gpu: &Gpu, label: &str, items: &[T], capacity: usize) -> wgpu::Buffer {
    let mut bytes = bytemuck::cast_slice::<T, u8>(items).to_vec();
    bytes.resize(capacity * size_of::<T>(), 0);
    filled_buffer(gpu, label, &bytes, wgpu::BufferUsages::UNIFORM)
}

/// Creates a buffer for `usage` filled with `data`.
pub(crate) fn filled_buffer<T: NoUninit>(
    gpu: &Gpu,
    label: &str,
    data: &[T],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let buffer = gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len() as u64).max(16).next_multiple_of(16),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    if !bytes.is_empty() {
        // If the creation failed, the buffer is not mapped, and the device's error handler receives the reason.
        if let Ok(mut range) = buffer.slice(..bytes.len() as u64).get_mapped_range_mut() {
            range.copy_from_slice(bytes);
        }
    }
    buffer.unmap();
    buffer
}

/// A buffer that is recreated only when it has to grow.
pub(crate) struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl GrowingBuffer {
    pub(crate) fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: None }
    }

    /// Creates a buffer for a list that shaders declare as uniform: see [`GrowingBuffer::upload_list`].
    pub(crate) fn for_list(label: &'static str) -> Self {
        Self::new(label, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST)
    }

    /// Returns the buffer, with at least `bytes` bytes.
    pub(crate) fn with_room(&mut self, gpu: &Gpu, bytes: u64) -> &wgpu::Buffer {
        let bytes = bytes.max(16).next_multiple_of(16);
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() < bytes) {
            // The old buffer is not destroyed: commands that this frame recorded with it may not be submitted yet.
            self.buffer = None;
        }
        self.buffer.get_or_insert_with(|| {
            gpu.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size: bytes,
                usage: self.usage,
                mapped_at_creation: false,
            })
        })
    }

    /// Fills the buffer with `data` and returns it.
    pub(crate) fn upload<T: NoUninit>(&mut self, gpu: &Gpu, data: &[T]) -> &wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.with_room(gpu, bytes.len() as u64);
        gpu.queue.write_buffer(buffer, 0, bytes);
        buffer
    }

    /// Fills the start of a list that shaders declare with `capacity` items, and returns the buffer.
    pub(crate) fn upload_list<T: NoUninit>(&mut self, gpu: &Gpu, items: &[T], capacity: usize) -> &wgpu::Buffer {
        assert!(items.len() <= capacity, "{}: {} items, {capacity} fit", self.label, items.len());
        self.with_room(gpu, (capacity * size_of::<T>()) as u64);
        self.upload(gpu, items)
    }

    /// Returns the buffer, if it was created.
    pub(crate) fn held(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }

    /// Frees the memory of the buffer after the submitted work, even if other handles to it exist.
    pub(crate) fn release(&mut self) {
        if let Some(buffer) = self.buffer.take() {
            buffer.destroy();
        }
    }
}

/// Position of results in the readback buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ReadbackPlace {
    buffer: usize,
    offset: u64,
}

/// Host-visible buffers that results are copied into. There are as many as needed, and none is larger than the adapter's limit.
pub(crate) struct ReadbackBuffer {
    label: &'static str,
    buffers: Vec<GrowingBuffer>,
    /// Bytes of each buffer that the frame uses so far.
    used: Vec<u64>,
    /// Bytes that were announced but are not copied yet.
    expected: u64,
}

impl ReadbackBuffer {
    pub(crate) fn new(label: &'static str) -> Self {
        Self { label, buffers: Vec::new(), used: Vec::new(), expected: 0 }
    }

    /// Discards the old contents, and announces that about `bytes` bytes will be copied.
    pub(crate) fn begin(&mut self, bytes: u64) {
        self.used.clear();
        self.expected = bytes;
    }

    /// Records a copy of `bytes` bytes from `source`, which must not exceed the limit of one buffer. Returns their position.
    pub(crate) fn copy(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        source: &wgpu::Buffer,
        offset: u64,
        bytes: u64,
    ) -> ReadbackPlace {
        let limit = gpu.max_readback_bytes();
        if self.used.last().is_none_or(|used| used + bytes > limit) {
            self.used.push(0);
        }
        let index = self.used.len() - 1;
        if self.buffers.len() <= index {
            let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
            self.buffers.push(GrowingBuffer::new(self.label, usage));
        }
        let place = ReadbackPlace { buffer: index, offset: self.used[index] };
        // The first copy of a frame into a buffer allocates the buffer for all remaining bytes, because it must not grow after a copy into it.
        let room = if place.offset == 0 { self.expected.min(limit).max(bytes) } else { place.offset + bytes };
        encoder.copy_buffer_to_buffer(source, offset, self.buffers[index].with_room(gpu, room), place.offset, bytes);
        self.used[index] = (place.offset + bytes).next_multiple_of(16);
        self.expected = self.expected.saturating_sub(bytes);
        place
    }

    /// Requests the mapping of the buffers; the next wait for the device completes it.
    pub(crate) fn map(&mut self, gpu: &Gpu) {
        for (buffer, used) in self.buffers.iter_mut().zip(&self.used) {
            // `read` returns an error if mapping fails.
            buffer.with_room(gpu, *used).slice(..*used).map_async(wgpu::MapMode::Read, |_| {});
        }
    }

    /// Returns the values at `place`. The caller must have waited for the device.
    pub(crate) fn read<T: Pod>(&mut self, gpu: &Gpu, place: ReadbackPlace, count: usize) -> Result<Vec<T>, GpuError> {
        let mut values = Vec::with_capacity(count);
        self.append(gpu, place, count, &mut values)?;
        Ok(values)
    }

    /// Appends the values at `place` to `values`. The caller must have waited for the device.
    pub(crate) fn append<T: Pod>(
        &mut self,
        gpu: &Gpu,
        place: ReadbackPlace,
        count: usize,
        values: &mut Vec<T>,
    ) -> Result<(), GpuError> {
        let view = self.mapped(gpu, place, count * size_of::<T>())?;
        values.extend_from_slice(bytemuck::cast_slice(&view));
        Ok(())
    }

    /// Appends items to `values`, each of which is joined from a value at the first place and one at the second. The caller must have waited for the
    /// device.
    pub(crate) fn append_joined<T: Pod, U>(
        &mut self,
        gpu: &Gpu,
        places: [ReadbackPlace; 2],
        count: usize,
        join: impl Fn(&T, &T) -> U,
        values: &mut Vec<U>,
    ) -> Result<(), GpuError> {
        let [first, second] = places;
        let first = self.mapped(gpu, first, count * size_of::<T>())?;
        let second = self.mapped(gpu, second, count * size_of::<T>())?;
        let pairs = bytemuck::cast_slice::<u8, T>(&first).iter().zip(bytemuck::cast_slice::<u8, T>(&second));
        values.extend(pairs.map(|(first, second)| join(first, second)));
        Ok(())
    }

    fn mapped(&mut self, gpu: &Gpu, place: ReadbackPlace, bytes: usize) -> Result<wgpu::BufferView, GpuError> {
        let buffer = self.buffers[place.buffer].with_room(gpu, self.used[place.buffer]);
        Ok(buffer.slice(place.offset..place.offset + bytes as u64).get_mapped_range()?)
    }

    /// Unmaps the buffers after reading.
    pub(crate) fn unmap(&mut self, gpu: &Gpu) {
        for (buffer, used) in self.buffers.iter_mut().zip(&self.used) {
            buffer.with_room(gpu, *used).unmap();
        }
        // Buffers that this frame does not need are dropped.
        self.buffers.truncate(self.used.len());
    }
}
